"""What OpenCV does not ask a webcam's driver: which sizes and rates it offers, and its controls by name.

Numbers and structures are those of linux/videodev2.h, the kernel's interface to cameras.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

QUERY_CAPABILITY = 0x80685600
ENUMERATE_FORMATS = 0xC0405602
ENUMERATE_SIZES = 0xC02C564A
ENUMERATE_INTERVALS = 0xC034564B
QUERY_CONTROL = 0xC0445624
GET_CONTROL = 0xC008561B
SET_CONTROL = 0xC008561C

CAPABILITY = struct.Struct("<16s32s32sIII12x")  # driver, card, bus, version, capabilities, of this node
FORMAT = struct.Struct("<III32s4s16x")  # index, buffer type, flags, description, code
SIZE = struct.Struct("<I4sIII16x8x")  # index, code, kind, width, height
INTERVAL = struct.Struct("<I4sIIIII16x8x")  # index, code, width, height, kind, fraction of a second
CONTROL = struct.Struct("<II32siiiiI8x")  # id, type, name, lowest, highest, step, default, flags
VALUE = struct.Struct("<Ii")  # id, value

CAN_CAPTURE = 1  # among a node's capabilities
BUFFER_TYPE_CAPTURE = 1
DISCRETE = 1  # sizes and intervals one by one, not as a range
DISABLED = 1  # among a control's flags
NEXT_CONTROL = 0x8000_0000

Ioctl = Callable[[int, int, bytearray], object]


@dataclass(frozen=True)
class Control:
    """One of a camera's knobs."""

    id: int
    name: str  # as v4l2-ctl has it
    lowest: int
    highest: int
    step: int


@dataclass(frozen=True)
class Mode:
    """A kind of picture that a camera offers."""

    code: str  # MJPG, YUYV ...
    width: int
    height: int
    fps: float  # at most

    def __str__(self) -> str:
        return f"{self.code} {self.width}x{self.height} at {self.fps:g}"


class Driver:
    """A webcam's driver, beside whoever takes pictures.

    Raises
    ------
    OSError
        It cannot be opened.
    """

    def __init__(self, device: Path, ioctl: Ioctl = fcntl.ioctl) -> None:
        self._file = os.open(device, os.O_RDWR | os.O_NONBLOCK)
        self._ioctl = ioctl

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._file)

    def card(self) -> str:
        """The camera's name; OSError where it is no camera, but perhaps the node beside it."""
        _, card, _, _, _, capabilities = CAPABILITY.unpack(
            self._ask(QUERY_CAPABILITY, bytes(CAPABILITY.size))
        )
        if not capabilities & CAN_CAPTURE:
            raise OSError("takes no pictures")
        return _text(card)

    def modes(self) -> list[Mode]:
        """All it offers one by one; ranges of sizes are left out."""
        out = []
        for code in self._codes():
            for width, height in self._sizes(code):
                fps = max(self._rates(code, width, height), default=0.0)
                out.append(Mode(code.decode("latin-1"), width, height, fps))
        return out

    def controls(self) -> dict[int, Control]:
        """Its controls by their numbers."""
        out: dict[int, Control] = {}
        number = 0
        with contextlib.suppress(OSError):  # that is how the list ends
            while True:
                asked = CONTROL.pack(number | NEXT_CONTROL, 0, b"", 0, 0, 0, 0, 0)
                answer = self._ask(QUERY_CONTROL, asked)
                number, _, name, lowest, highest, step, _, flags = CONTROL.unpack(answer)
                if not flags & DISABLED:
                    out[number] = Control(number, _variable(_text(name)), lowest, highest, step)
        return out

    def get(self, control: Control) -> int:
        """A control's value."""
        return VALUE.unpack(self._ask(GET_CONTROL, VALUE.pack(control.id, 0)))[1]

    def set(self, control: Control, value: int) -> None:
        """Set it; OSError where the driver refuses."""
        self._ask(SET_CONTROL, VALUE.pack(control.id, value))

    def _ask(self, request: int, question: bytes) -> bytes:
        buffer = bytearray(question)
        self._ioctl(self._file, request, buffer)
        return bytes(buffer)

    def _each(self, request: int, question: Callable[[int], bytes]) -> Iterator[bytes]:
        with contextlib.suppress(OSError):  # that is how a list ends
            index = 0
            while True:
                yield self._ask(request, question(index))
                index += 1

    def _codes(self) -> list[bytes]:
        answers = self._each(
            ENUMERATE_FORMATS, lambda index: FORMAT.pack(index, BUFFER_TYPE_CAPTURE, 0, b"", b"")
        )
        return [FORMAT.unpack(answer)[4] for answer in answers]

    def _sizes(self, code: bytes) -> list[tuple[int, int]]:
        answers = self._each(ENUMERATE_SIZES, lambda index: SIZE.pack(index, code, 0, 0, 0))
        sizes = (SIZE.unpack(answer)[2:] for answer in answers)
        return [(width, height) for kind, width, height in sizes if kind == DISCRETE]

    def _rates(self, code: bytes, width: int, height: int) -> list[float]:
        answers = self._each(
            ENUMERATE_INTERVALS, lambda index: INTERVAL.pack(index, code, width, height, 0, 0, 0)
        )
        intervals = (INTERVAL.unpack(answer)[4:] for answer in answers)
        return [below / above for kind, above, below in intervals if kind == DISCRETE and above]


def _text(field: bytes) -> str:
    return field.split(b"\0")[0].decode("utf-8", "replace")


def _variable(name: str) -> str:
    """``Exposure Time, Absolute`` as v4l2-ctl has it: exposure_time_absolute."""
    return "_".join("".join(c if c.isalnum() else " " for c in name.lower()).split())
