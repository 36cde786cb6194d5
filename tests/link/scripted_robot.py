"""A robot that answers as docs/protocol.md says, in virtual time, on a line as bad as the test wants it."""

from __future__ import annotations

import heapq
import random
from collections.abc import Iterator
from dataclasses import dataclass, field

from host.errors import DeviceError
from host.link.protocol import (
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    TELEMETRY_PERIOD_US,
    Decoder,
    Fault,
    Hello,
    HelloRequest,
    LinkStatus,
    Message,
    Nack,
    Outcome,
    Ping,
    Pong,
    Refusal,
    ResetCause,
    State,
    Telemetry,
    encode,
)


@dataclass
class VirtualClock:
    """Time that passes when told to."""

    t_s: float = 100.0

    def now_s(self) -> float:
        return self.t_s

    def sleep_s(self, duration_s: float) -> None:
        self.t_s += duration_s


@dataclass
class ScriptedRobot:
    """Transport and robot in one. `heard` holds every message that reached the robot, with its own time."""

    clock: VirtualClock
    delay_s: float = 0.0006  # each way; the PING's 13 bytes take 0.52 ms at 250000 baud, the PONG's 0.64
    jitter_s: float = 0.0
    drift: float = 0.0  # robot seconds per host second, less one
    start_us: int = 0  # what the robot's clock shows when it starts
    starts_at_s: float = 0.0  # host time; the boot loader swallows what comes before
    protocol_version: int = PROTOCOL_VERSION
    schema_hash: int = SCHEMA_HASH
    answers_ping: bool = True
    button_pressed: bool = False  # a fault from the start
    nonce: int = 0xC0FFEE
    heard: list[tuple[int, Message]] = field(default_factory=list)
    silent: bool = False
    unplugged: bool = False
    closed: bool = False

    def __post_init__(self) -> None:
        self._random = random.Random(1)
        self._to_robot: list[tuple[float, bytes]] = []
        self._to_host: list[tuple[float, int, bytes]] = []
        self._sent = 0
        self._start(max(self.starts_at_s, self.clock.t_s), ResetCause.POWER_ON)

    # --- As a transport -------------------------------------------------------------------------

    def write(self, data: bytes) -> None:
        if self.unplugged:
            raise DeviceError("/dev/null is gone")
        self._to_robot.append((self._arrival(self.clock.t_s), data))

    def read(self) -> bytes:
        if self.unplugged:
            raise DeviceError("/dev/null is gone")
        for t_s, data in self._events(self.clock.t_s):
            self._happen(t_s, data)
        arrived = b""
        while self._to_host and self._to_host[0][0] <= self.clock.t_s:
            arrived += heapq.heappop(self._to_host)[2]
        return arrived

    def close(self) -> None:
        self.closed = True

    # --- As a robot -----------------------------------------------------------------------------

    def mcu_us(self, t_s: float) -> int:
        """What its clock shows at a host time."""
        return (self.start_us + round((t_s - self._started_s) * (1 + self.drift) * 1e6)) & 0xFFFF_FFFF

    def restart(self, cause: ResetCause, nonce: int) -> None:
        self.nonce = nonce
        self._start(self.clock.t_s, cause)

    def disturb(self, noise: bytes) -> None:
        """Put noise on the line to the host."""
        self._put(self.clock.t_s, noise)

    def send(self, message: Message, t_s: float | None = None) -> None:
        self._put(self._arrival(self.clock.t_s if t_s is None else t_s), encode(message, self._seq))
        self._seq = (self._seq + 1) & 0xFF

    def telemetry(self, t_s: float) -> Telemetry:
        mcu_us = self.mcu_us(t_s)
        return Telemetry(
            mcu_us, self.state, Fault.NONE, 0, 0, 0, 0, 0, 0, 0, 0, 7400, 0, 0, self.nonce, 0,
            0, 0, 0, Outcome.NONE, Refusal.NONE,
        )  # fmt: skip

    def _start(self, t_s: float, cause: ResetCause) -> None:
        self._started_s = self._ticked_s = t_s
        self.session = False
        self.state = State.FAULT if self.button_pressed else State.BOOT
        self._decoder = Decoder(to_host=False)
        self._seq = 0
        self._cause = cause
        self.send(self._hello(), t_s)

    def _hello(self) -> Hello:
        return Hello(self.protocol_version, self.schema_hash, 0xB11D, self._cause, self.nonce)

    def _arrival(self, t_s: float) -> float:
        return t_s + self.delay_s + self._random.uniform(0, self.jitter_s)

    def _put(self, t_s: float, data: bytes) -> None:
        self._sent += 1
        last_s = max((t for t, _, _ in self._to_host), default=0.0)  # a line never overtakes itself
        if not self.silent:
            heapq.heappush(self._to_host, (max(t_s, last_s), self._sent, data))

    def _events(self, until_s: float) -> Iterator[tuple[float, bytes | None]]:
        """Arrivals and telemetry ticks up to a time, in order."""
        due = [one for one in self._to_robot if one[0] <= until_s]
        self._to_robot = [one for one in self._to_robot if one[0] > until_s]
        ticks: list[tuple[float, bytes | None]] = []
        period_s = TELEMETRY_PERIOD_US * 1e-6
        while self._ticked_s + period_s <= until_s:
            self._ticked_s += period_s
            ticks.append((self._ticked_s, None))
        yield from sorted([*due, *ticks], key=lambda event: event[0])

    def _happen(self, t_s: float, data: bytes | None) -> None:
        if t_s < self._started_s:
            return
        if data is None:
            self.send(self.telemetry(t_s), t_s)
            if self.mcu_us(t_s) // TELEMETRY_PERIOD_US % 20 == 0:
                self.send(LinkStatus(self._decoder.counters.frames, *[0] * 9), t_s)
            return
        for seq, message in self._decoder.feed(data):
            self.heard.append((self.mcu_us(t_s), message))
            match message:
                case HelloRequest():
                    self.session = message.schema_hash == self.schema_hash
                    if self.session and self.state == State.BOOT:
                        self.state = State.READY
                    self.send(self._hello(), t_s)
                case Ping() if self.answers_ping:
                    self.send(Pong(message.host_time_us, self.mcu_us(t_s)), t_s)
                case Ping():
                    pass
                case _ if not self.session:
                    self.send(Nack(message.ID, seq, Refusal.NO_SESSION), t_s)
