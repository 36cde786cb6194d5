"""A listener on a line: hands every frame and every byte of both directions on to whoever asked."""

from __future__ import annotations

from collections.abc import Callable

from host.link.bench.frames import Frame, FrameReader
from host.link.clock import Clock
from host.link.transport import Transport

OnFrame = Callable[[Frame], None]
OnBytes = Callable[[float, bool, bytes], None]  # time, to the host?, bytes


class Tap:
    """A Transport around another one that changes nothing.

    Attributes
    ----------
    on_frame, on_bytes
        Those who are told; add to them.
    bytes_to_robot, bytes_to_host : int
    """

    def __init__(self, line: Transport, clock: Clock) -> None:
        self._line, self._clock = line, clock
        self.on_frame: list[OnFrame] = []
        self.on_bytes: list[OnBytes] = []
        self.to_robot = FrameReader(to_host=False)
        self.to_host = FrameReader(to_host=True)
        self.bytes_to_robot = self.bytes_to_host = 0

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        self.bytes_to_robot += len(data)
        self._pass_on(self.to_robot, False, data)  # first: a listener further on must not know it earlier
        self._line.write(data)

    def read(self) -> bytes:
        """What has arrived since the last call."""
        data = self._line.read()
        self.bytes_to_host += len(data)
        if data:
            self._pass_on(self.to_host, True, data)
        return data

    def close(self) -> None:
        """Let go of the line."""
        self._line.close()

    def _pass_on(self, reader: FrameReader, to_host: bool, data: bytes) -> None:
        now_s = self._clock.now_s()
        for tell in self.on_bytes:
            tell(now_s, to_host, data)
        for frame in reader.feed(now_s, data):
            for tell in self.on_frame:
                tell(frame)
