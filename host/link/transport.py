"""What every line to a robot can do: a serial port, a simulated board's line, a line made worse."""

from __future__ import annotations

from typing import Protocol


class Transport(Protocol):
    """Bytes to and from the robot."""

    def write(self, data: bytes) -> None:
        """Send all of `data`; DeviceError when the line is gone."""
        ...

    def read(self) -> bytes:
        """What has arrived since the last call, without waiting; DeviceError when the line is gone."""
        ...

    def close(self) -> None:
        """Let go of the line."""
        ...
