"""A camera's own JPEG to an image, or nothing where it did not arrive whole."""

from __future__ import annotations

import re

import cv2
import numpy as np

START = b"\xff\xd8"
MARKER = re.compile(rb"\xff[^\x00\xff]")  # in the data itself a zero follows 0xFF, or more of its kind
RESTARTS = range(0xD0, 0xD8)
FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
SCAN, END, ANOTHER_START = 0xDA, 0xD9, 0xD8
COLOUR = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION  # a lens belongs to the rows as the sensor has them


def whole_jpeg(data: bytes) -> bytes | None:
    """The JPEG up to its end, without what a camera's buffer holds beyond; None where it is not whole.

    It has a head and an end, and in between neither another's start nor a gap among restarts. What this
    cannot see is damage inside the compressed data, after which the decoder guesses.
    """
    if not data.startswith(START):
        return None
    at, has_frame, restarts = len(START), False, 0
    while found := MARKER.search(data, at):
        marker, at = data[found.start() + 1], found.end()
        if marker == END:
            return data[:at] if has_frame else None
        if marker in RESTARTS:
            if marker != RESTARTS[restarts % len(RESTARTS)]:
                return None
            restarts += 1
            continue
        if marker == ANOTHER_START or at + 2 > len(data):
            return None
        has_frame |= marker in FRAMES
        restarts = 0 if marker == SCAN else restarts
        at += int.from_bytes(data[at : at + 2])
    return None


def decode_jpeg(data: bytes) -> np.ndarray | None:
    """A whole JPEG as (H, W, 3) uint8, BGR; None where OpenCV cannot."""
    try:
        return cv2.imdecode(np.frombuffer(data, np.uint8), COLOUR)
    except cv2.error:
        return None
