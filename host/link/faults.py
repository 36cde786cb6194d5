"""A line made worse on purpose: frames lost, damaged, doubled, late or out of order, as often as asked.

    line = FaultyLine(SerialPort("/dev/ttyACM0"), SystemClock(), to_robot=Faults(drop=0.1), seed=1)
    robot = Robot(line, clock)
    line.to_host.bit_error_rate = 1e-4  # rates may be set at any time
    line.injected_to_robot.dropped      # what has been done so far

Equal seeds and equal calls give equal faults.
"""

from __future__ import annotations

import heapq
import math
import random
from dataclasses import dataclass

from host.link.clock import Clock
from host.link.transport import Transport

PIECE_MAX = 254  # bytes without a delimiter that are handed on as if they were a frame


@dataclass
class Faults:
    """How bad one direction is; rates are chances from 0 to 1. As it is made, the line is perfect."""

    drop: float = 0.0  # of a frame to vanish
    truncate: float = 0.0  # of a frame to lose its end, delimiter included, so that it runs into the next
    duplicate: float = 0.0  # of a frame to come again, up to `late_s` later
    reorder: float = 0.0  # of a frame to be held back for up to `late_s`, so that later ones overtake it
    bit_error_rate: float = 0.0  # of a bit to be flipped
    delay_s: float = 0.0  # every frame comes this much later
    jitter_s: float = 0.0  # and by up to this much more, evenly spread; frames keep their order
    late_s: float = 0.05  # for `duplicate` and `reorder`


@dataclass
class Injected:
    """What has been done to one direction so far."""

    frames: int = 0  # that were to be sent
    dropped: int = 0
    truncated: int = 0
    duplicated: int = 0
    reordered: int = 0  # held back; whether anything overtook it depends on what came
    damaged: int = 0  # with at least one flipped bit
    bits_flipped: int = 0


class FaultyLine:
    """A Transport around another one, which gets and gives only what the faults let through.

    Faults strike whole frames, which end at their zero byte. What is late is handed on by the first call of
    `read`, `write` or `pump` after its time; call `pump` once a millisecond where delays must be exact.

    Parameters
    ----------
    line
        The true line; `close` closes it too.
    clock
        Real or virtual time.
    to_robot, to_host
        How bad each direction is; their rates may be changed later.
    seed
        Decides all chances.
    """

    def __init__(
        self,
        line: Transport,
        clock: Clock,
        to_robot: Faults | None = None,
        to_host: Faults | None = None,
        seed: int = 0,
    ) -> None:
        self._line = line
        self._to_robot = _Direction(to_robot or Faults(), clock, f"to robot {seed}")
        self._to_host = _Direction(to_host or Faults(), clock, f"to host {seed}")

    @property
    def to_robot(self) -> Faults:
        """How bad the way to the robot is."""
        return self._to_robot.faults

    @property
    def to_host(self) -> Faults:
        """How bad the way to the host is."""
        return self._to_host.faults

    @property
    def injected_to_robot(self) -> Injected:
        """What was done on the way to the robot."""
        return self._to_robot.injected

    @property
    def injected_to_host(self) -> Injected:
        """What was done on the way to the host."""
        return self._to_host.injected

    def write(self, data: bytes) -> None:
        """Send `data`, or what the faults leave of it; a frame ends with it, delimiter or not."""
        self._to_robot.take(data)
        self._to_robot.end_frame()
        self.pump()

    def read(self) -> bytes:
        """What has arrived since the last call."""
        self.pump()
        return self._to_host.due()

    def pump(self) -> None:
        """Hand on what is due; `read` and `write` do this too."""
        if data := self._to_robot.due():
            self._line.write(data)
        self._to_host.take(self._line.read())

    def close(self) -> None:
        """Let go of the line; what was still under way is lost."""
        self._line.close()


class _Direction:
    """Bytes in, and out again later, by the faults of one direction."""

    def __init__(self, faults: Faults, clock: Clock, seed: str) -> None:
        self.faults = faults
        self.injected = Injected()
        self._clock = clock
        self._chance = random.Random(seed)
        self._partial = b""  # of the frame that has not ended yet
        self._waiting: list[tuple[float, int, bytes]] = []  # by time, then in order
        self._order = 0
        self._latest_s = -math.inf  # at which a frame in its order is due

    def take(self, data: bytes) -> None:
        self._partial += data
        while (end := self._partial.lstrip(b"\0").find(b"\0")) >= 0:
            # Delimiters that come first belong to the frame after them: the client sends one before each.
            idle = len(self._partial) - len(self._partial.lstrip(b"\0"))
            cut = idle + end + 1
            frame, self._partial = self._partial[:cut], self._partial[cut:]
            self._strike(frame)
        if len(self._partial) >= PIECE_MAX:
            self.end_frame()

    def end_frame(self) -> None:
        if self._partial:
            frame, self._partial = self._partial, b""
            self._strike(frame)

    def due(self) -> bytes:
        now_s, out = self._clock.now_s(), b""
        while self._waiting and self._waiting[0][0] <= now_s:
            out += heapq.heappop(self._waiting)[2]
        return out

    def _strike(self, frame: bytes) -> None:
        faults, injected = self.faults, self.injected
        injected.frames += 1
        if self._happens(faults.drop):
            injected.dropped += 1
            return
        due_s = self._clock.now_s() + faults.delay_s + self._chance.uniform(0.0, faults.jitter_s)
        due_s = max(due_s, self._latest_s)  # a line does not overtake itself
        if self._happens(faults.reorder):
            injected.reordered += 1
            self._put(due_s + self._chance.uniform(0.0, faults.late_s), frame)
        else:
            self._latest_s = due_s
            self._put(due_s, frame)
        if self._happens(faults.duplicate):
            injected.duplicated += 1
            self._put(due_s + self._chance.uniform(0.0, faults.late_s), frame)

    def _put(self, due_s: float, frame: bytes) -> None:
        if self._happens(self.faults.truncate):
            self.injected.truncated += 1
            frame = frame[: self._chance.randrange(len(frame))]
        self._order += 1
        heapq.heappush(self._waiting, (due_s, self._order, self._flipped(frame)))

    def _flipped(self, frame: bytes) -> bytes:
        rate = self.faults.bit_error_rate
        if rate <= 0.0:
            return frame
        damaged, flips = bytearray(frame), 0
        bit = self._bits_spared(rate)
        while bit < 8 * len(frame):
            damaged[bit // 8] ^= 1 << bit % 8
            flips += 1
            bit += 1 + self._bits_spared(rate)
        self.injected.bits_flipped += flips
        self.injected.damaged += flips > 0
        return bytes(damaged)

    def _bits_spared(self, rate: float) -> int:
        """How many bits in a row escape: one draw for all of them, not one for each."""
        if rate >= 1.0:
            return 0
        return int(math.log(1.0 - self._chance.random()) / math.log1p(-rate))

    def _happens(self, rate: float) -> bool:
        return rate > 0.0 and self._chance.random() < rate
