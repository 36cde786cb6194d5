"""What stood on a line, both directions with their times, as a text file.

robot link capture 1
0.000123 > 0006...      # seconds, to the robot, bytes in hexadecimal
0.001409 < 0f82...      # to the host
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, TextIO

from host.errors import InputError, UsageError
from host.record.atomic import check_writable

HEADING = "robot link capture 1"


class Piece(NamedTuple):
    """Bytes that were sent or read at once."""

    t_s: float
    to_host: bool
    data: bytes


class CaptureWriter:
    """Appends to a capture file as things happen, so that an interrupted run leaves what it heard."""

    def __init__(self, path: Path) -> None:
        check_writable(path, folder=False)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file: TextIO = path.open("w", encoding="ascii")
        except OSError as error:
            raise UsageError(f"{path}: cannot be written ({error.strerror}); choose another place") from None
        self._file.write(HEADING + "\n")
        self._start_s: float | None = None

    def add(self, t_s: float, to_host: bool, data: bytes) -> None:
        """Note some bytes; times are written from the first ones on."""
        if self._start_s is None:
            self._start_s = t_s
        if data:
            self._file.write(f"{t_s - self._start_s:.6f} {'<' if to_host else '>'} {data.hex()}\n")

    def close(self) -> None:
        """Done."""
        self._file.close()


def read_capture(path: Path) -> list[Piece]:
    """All of a capture.

    Raises
    ------
    InputError
        The file cannot be read, or is no capture; the line is named.
    """
    try:
        text = path.read_text(encoding="ascii")
    except UnicodeDecodeError:
        raise InputError(f"{path}: {_NO_CAPTURE}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    heading, _, rest = text.partition("\n")
    if heading != HEADING:
        raise InputError(f"{path}: {_NO_CAPTURE}")
    return list(_pieces(path, rest))


_NO_CAPTURE = "is no capture of ours; for bytes of one direction as they stood on the line add --raw to-host"


def _pieces(path: Path, text: str) -> Iterator[Piece]:
    for number, line in enumerate(text.splitlines(), 2):
        try:
            time_text, direction, digits = line.split(" ")
            piece = Piece(float(time_text), {"<": True, ">": False}[direction], bytes.fromhex(digits))
            if not math.isfinite(piece.t_s):
                raise ValueError
        except (ValueError, KeyError):
            raise InputError(
                f"{path}, line {number}: not a time, > or <, and bytes; cut the line out"
            ) from None
        yield piece


def read_raw(path: Path, *, to_host: bool) -> list[Piece]:
    """Bytes of one direction without times, as a logic analyser saves them; they all get time 0."""
    try:
        return [Piece(0.0, to_host, path.read_bytes())]
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
