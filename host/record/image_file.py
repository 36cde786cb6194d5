"""PNG and JPEG files, with their truncation and damage noticed.

OpenCV alone will not do: for a truncated file it returns None or a picture whose lower part is grey,
depending on version and format, and prints the decoder's complaint past Python.
"""

from __future__ import annotations

import os
import re
import struct
import tempfile
import zlib
from pathlib import Path

import cv2
import numpy as np

from host.errors import InputError

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
JPEG_SIGNATURE = b"\xff\xd8"
JPEG_MARKER = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")  # skips stuffed bytes, restarts and fill
JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
JPEG_END = 0xD9
REMEDY = "copy or export it again"


def image_size(path: Path) -> tuple[int, int]:
    """Width and height in pixels of an image file that is whole, found without decoding it.

    Raises
    ------
    InputError
        where the file is missing, empty, cut short, damaged (PNG) or neither PNG nor JPEG.
    """
    return encoded_size(path, _bytes_of(path))


def read_image(path: Path) -> np.ndarray:
    """Decode an image file to (H, W, 3) uint8, BGR.

    Raises
    ------
    InputError
        as `image_size`, and where the decoder complains of its data.
    """
    content = _bytes_of(path)
    encoded_size(path, content)
    image, complaint = _decode(content)
    if image is None or complaint:
        raise InputError(f"{path}: damaged image ({complaint or 'it cannot be decoded'}); {REMEDY}")
    return image


def encoded_size(path: Path, content: bytes) -> tuple[int, int]:
    """As `image_size`, of what a file at `path` holds or will hold."""
    try:
        if content.startswith(PNG_SIGNATURE):
            return _png_size(content)
        if content.startswith(JPEG_SIGNATURE):
            return _jpeg_size(content)
    except _CutShort as error:
        raise InputError(f"{path}: truncated image ({len(content)} bytes, {error}); {REMEDY}") from error
    except _Damaged as error:
        raise InputError(f"{path}: damaged image ({error}); {REMEDY}") from error
    raise InputError(f"{path}: neither PNG nor JPEG; convert it to one of them")


def _bytes_of(path: Path) -> bytes:
    try:
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such image; put it there or take its row out of the poses") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from error
    if not content:
        raise InputError(f"{path}: empty image file; {REMEDY}")
    return content


class _CutShort(Exception):
    pass


class _Damaged(Exception):
    pass


def _png_size(content: bytes) -> tuple[int, int]:
    at, size = len(PNG_SIGNATURE), None
    while True:
        if at + 12 > len(content):
            raise _CutShort("its end is missing")
        (length,) = struct.unpack_from(">I", content, at)
        body = content[at + 4 : at + 8 + length]
        if at + 12 + length > len(content):
            raise _CutShort("its end is missing")
        if zlib.crc32(body) != struct.unpack_from(">I", content, at + 8 + length)[0]:
            raise _Damaged(f"checksum of the chunk at byte {at} does not match")
        if body[:4] == b"IHDR" and length >= 8:
            width, height = struct.unpack_from(">II", body, 4)
            size = width, height
        if body[:4] == b"IEND":
            break
        at += 12 + length
    if size is None:
        raise _Damaged("it has no header")
    return size


def _jpeg_size(content: bytes) -> tuple[int, int]:
    at, size = 2, None
    while True:
        found = JPEG_MARKER.search(content, at)  # also steps over the compressed data of a scan
        if found is None:
            raise _CutShort("its end is missing")
        marker, at = content[found.start() + 1], found.end()
        if marker == JPEG_END:
            break
        if at + 2 > len(content):
            raise _CutShort("its end is missing")
        (length,) = struct.unpack_from(">H", content, at)
        if at + length > len(content):
            raise _CutShort("its end is missing")
        if marker in JPEG_FRAMES and length >= 7:
            height, width = struct.unpack_from(">HH", content, at + 3)
            size = width, height
        at += length
    if size is None:
        raise _Damaged("it has no header")
    return size


def _decode(content: bytes) -> tuple[np.ndarray | None, str]:
    """The image and what libjpeg or libpng said; both write to file descriptor 2, so it is listened to."""
    with tempfile.TemporaryFile() as heard:
        normal = os.dup(2)
        os.dup2(heard.fileno(), 2)
        try:
            # A phone's rotation tag is not followed: the lens belongs to the rows as the sensor has them.
            flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
            image = cv2.imdecode(np.frombuffer(content, np.uint8), flags)
        except cv2.error as error:
            return None, error.err
        finally:
            os.dup2(normal, 2)
            os.close(normal)
        heard.seek(0)
        complaint = " ".join(heard.read().decode(errors="replace").split())
    return image, complaint if "orrupt" in complaint or image is None else ""
