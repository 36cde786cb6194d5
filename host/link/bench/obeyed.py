"""What the robot obeyed: how old its setpoints are, and whether anybody ever sent what reached it."""

from __future__ import annotations

from host.link.bench.frames import Frame
from host.link.protocol import DEAD_MAN_US, Drive, State, Telemetry


class SetpointAges:
    """Sees a tap's frames; `ages_ms` has, for each telemetry while driving, the age of its setpoint."""

    def __init__(self) -> None:
        self.ages_ms: list[float] = []
        self._decided_us: dict[int, int] = {}  # by sequence number, on the robot's clock

    def see(self, frame: Frame) -> None:
        """Take note of a frame."""
        message = frame.message
        if isinstance(message, Drive) and frame.seq is not None:
            self._decided_us[frame.seq] = (message.expires_us - DEAD_MAN_US) & 0xFFFF_FFFF
        elif isinstance(message, Telemetry) and message.state == State.DRIVING:
            decided_us = self._decided_us.get(message.drive_seq)
            if decided_us is not None:
                age_us = (message.mcu_time_us - decided_us) & 0xFFFF_FFFF
                self.ages_ms.append((age_us - (1 << 32) if age_us >= 1 << 31 else age_us) * 1e-3)


REMEMBERED = 512  # frames sent; none is under way for longer


class Comparison:
    """What the host sent against what reached the robot whole: `wrong` has what nobody had sent.

    Give `sent` to the tap on the host's side of the faults and `arrived` to the one on the robot's.
    """

    def __init__(self) -> None:
        self.wrong: list[Frame] = []
        self.arrived_frames = 0
        self.in_a_row = 0  # most frames lost between two that arrived
        self._order: dict[bytes, int] = {}  # when each was last sent, in frames; oldest first
        self._count = 0
        self._last = 0

    def sent(self, frame: Frame) -> None:
        """Take note of what the host sends."""
        if frame.to_host:
            return
        self._count += 1
        self._order.pop(frame.coded, None)
        self._order[frame.coded] = self._count
        if len(self._order) > REMEMBERED:
            del self._order[next(iter(self._order))]

    def arrived(self, frame: Frame) -> None:
        """Take note of what reaches the robot, which is after it was sent."""
        if frame.to_host or frame.message is None:
            return
        self.arrived_frames += 1
        order = self._order.get(frame.coded)
        if order is None:
            self.wrong.append(frame)
            return
        if order > self._last:
            self.in_a_row = max(self.in_a_row, order - self._last - 1)
            self._last = order
