"""Every frame of one direction, the broken ones with the reason."""

from __future__ import annotations

from dataclasses import asdict
from typing import NamedTuple

from host.link.protocol import Counters, Decoder, Message

BROKEN = ("crc", "framing", "overlong", "unknown", "length", "value", "stale")  # a frame ends in one at most


class Frame(NamedTuple):
    """What stood between two delimiters."""

    t_s: float  # when its last byte was read or written
    to_host: bool
    coded: bytes  # as on the line, without delimiter
    seq: int | None  # None: broken
    message: Message | None
    error: str | None  # a counter's name, as in docs/protocol.md
    lost: int  # messages that by their sequence numbers should have come before it


class FrameReader:
    """Bytes of one direction in, frames out; `counters` are those of the decoder."""

    def __init__(self, *, to_host: bool) -> None:
        self._to_host = to_host
        self._decoder = Decoder(to_host=to_host)
        self._partial = b""

    @property
    def counters(self) -> Counters:
        """What the decoder saw."""
        return self._decoder.counters

    def feed(self, t_s: float, data: bytes) -> list[Frame]:
        """Frames completed by `data`."""
        *ended, rest = data.split(b"\0")
        frames = []
        for part in ended:
            coded, self._partial = self._partial + part, b""
            if coded:
                frames.append(self._read(t_s, coded))
        self._partial += rest
        if len(self._partial) > 4096:  # a line that never pauses: the decoder knows that it is too long
            self._partial = self._partial[-4096:]
        return frames

    def _read(self, t_s: float, coded: bytes) -> Frame:
        before = asdict(self.counters)
        received = self._decoder.feed(coded + b"\0")
        after = asdict(self.counters)
        lost = after["lost"] - before["lost"]
        error = next((name for name in BROKEN if after[name] > before[name]), None)
        if not received:
            return Frame(t_s, self._to_host, coded, None, None, error, lost)
        ((seq, message),) = received
        return Frame(t_s, self._to_host, coded, seq, message, error, lost)
