"""A camera's own JPEG to an image, or nothing where it did not arrive whole."""

from __future__ import annotations

import re

import cv2
import numpy as np

START, FRAME_END = b"\xff\xd8", b"\xff\xd9"
MARKER = re.compile(rb"\xff[^\x00\xff]")  # in the data itself a zero follows 0xFF, or more of its kind
RESTARTS = range(0xD0, 0xD8)
FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
SCAN, END, ANOTHER_START = 0xDA, 0xD9, 0xD8
COLOUR = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION  # a lens belongs to the rows as the sensor has them


def without_padding(data: bytes) -> bytes:
    """The JPEG less the zeros with which some cameras fill their buffers up."""
    return data if data.endswith(FRAME_END) else data.rstrip(b"\0")


def is_whole(data: bytes) -> bool:
    """Whether a JPEG has a head and its end, and in between neither another's start nor a gap of restarts.

    What this cannot see is damage inside the compressed data, after which the decoder guesses.
    """
    if not (data.startswith(START) and data.endswith(FRAME_END)):
        return False
    at, has_frame, restarts = 2, False, 0
    while found := MARKER.search(data, at):
        marker, at = data[found.start() + 1], found.end()
        if marker == END:
            return has_frame and at == len(data)
        if marker in RESTARTS:
            if marker != RESTARTS[restarts % len(RESTARTS)]:
                return False
            restarts += 1
            continue
        if marker == ANOTHER_START or at + 2 > len(data):
            return False
        has_frame |= marker in FRAMES
        restarts = 0 if marker == SCAN else restarts
        at += int.from_bytes(data[at : at + 2])
    return False


def decode_jpeg(data: bytes) -> np.ndarray | None:
    """(H, W, 3) uint8, BGR; None where it is damaged."""
    if not is_whole(data):
        return None
    try:
        return cv2.imdecode(np.frombuffer(data, np.uint8), COLOUR)
    except cv2.error:
        return None
