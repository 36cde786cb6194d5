"""A robot that answers as docs/protocol.md says, in virtual time, on a line as bad as the test wants it."""

from __future__ import annotations

import heapq
import random
from collections.abc import Iterator
from dataclasses import dataclass, field

from host.errors import DeviceError
from host.link.parameters import PARAMETERS, Param
from host.link.protocol import (
    DEAD_MAN_US,
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    TELEMETRY_PERIOD_US,
    Clear,
    Decoder,
    Drive,
    EStop,
    Fault,
    Hello,
    HelloRequest,
    KeepAlive,
    LinkStatus,
    Message,
    Move,
    Nack,
    Outcome,
    ParamRead,
    ParamSave,
    ParamValue,
    ParamWrite,
    Ping,
    Pong,
    Refusal,
    Request,
    ResetCause,
    State,
    Stop,
    Telemetry,
    Turn,
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
    """Transport and robot in one.

    `heard` holds every message that reached the robot, with its own time; `begun` every request it carried
    out, once for each time it did.
    """

    clock: VirtualClock
    delay_s: float = 0.0006  # each way; the PING's 13 bytes take 0.52 ms at 250000 baud, the PONG's 0.64
    jitter_s: float = 0.0
    seed: int = 1  # of the jitter
    drift: float = 0.0  # robot seconds per host second, less one
    start_us: int = 0  # what the robot's clock shows when it starts
    starts_at_s: float = 0.0  # host time; the boot loader swallows what comes before
    protocol_version: int = PROTOCOL_VERSION
    schema_hash: int = SCHEMA_HASH
    answers_ping: bool = True
    button_pressed: bool = False  # a fault from the start
    nonce: int = 0xC0FFEE
    request: int = 0  # the last one taken before the session
    move_takes_s: float = 0.5
    save_takes_s: float = 0.1
    begun: list[Request] = field(default_factory=list)
    heard: list[tuple[int, Message]] = field(default_factory=list)
    silent: bool = False
    unplugged: bool = False
    closed: bool = False

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)
        self._to_robot: list[tuple[float, bytes]] = []
        self._to_host: list[tuple[float, int, bytes]] = []
        self._sent = 0
        first_request = self.request
        self._start(max(self.starts_at_s, self.clock.t_s), ResetCause.POWER_ON)
        self.request = first_request

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

    def cut(self) -> None:
        """Unplug: what is on the line in either direction is lost."""
        self.unplugged = True
        self._to_robot.clear()
        self._to_host.clear()

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
            mcu_us, self.state, self.fault, 0, 0, 0, 0, 0, 0, 0, 0, 7400, 0, 0, self.nonce, self._drive_seq,
            0, 0, self.request, self.outcome, self.reason,
        )  # fmt: skip

    def _start(self, t_s: float, cause: ResetCause) -> None:
        self._started_s = self._ticked_s = t_s
        self.session = False
        self.state = State.FAULT if self.button_pressed else State.BOOT
        self.fault = Fault.ESTOP_BUTTON if self.button_pressed else Fault.NONE
        self.request, self.outcome, self.reason = 0, Outcome.NONE, Refusal.NONE
        self.values = {param: known.default for param, known in PARAMETERS.items()}
        self._drive_seq = 0
        self._over_s = float("inf")  # when what runs is done
        self._obeyed_s = t_s  # last DRIVE, MOVE, TURN or KEEP_ALIVE
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
            self._tick(t_s)
            self.send(self.telemetry(t_s), t_s)
            if self.mcu_us(t_s) // TELEMETRY_PERIOD_US % 20 == 0:
                self.send(LinkStatus(self._decoder.counters.frames, *[0] * 9), t_s)
            return
        for seq, message in self._decoder.feed(data):
            self.heard.append((self.mcu_us(t_s), message))
            refusal = self._obey(message, t_s)
            if isinstance(message, Drive) and refusal == Refusal.NONE:
                self._drive_seq = seq
            if refusal != Refusal.NONE:
                self.send(Nack(message.ID, seq, refusal), t_s)

    def _tick(self, t_s: float) -> None:
        if self.outcome == Outcome.RUNNING and t_s >= self._over_s:
            self.outcome = Outcome.DONE
            if self.state == State.MOVING:
                self.state = State.READY
        if self.state == State.STOPPED:
            self.state = State.READY
        if self.state in (State.DRIVING, State.MOVING) and t_s - self._obeyed_s > DEAD_MAN_US * 1e-6:
            self.latch(Fault.LINK_LOST)

    def latch(self, fault: Fault) -> None:
        """Stop with a fault."""
        self._abort(Refusal.BY_FAULT)
        self.state, self.fault = State.FAULT, fault

    def _abort(self, reason: Refusal) -> None:
        if self.state == State.MOVING and self.outcome == Outcome.RUNNING:
            self.outcome, self.reason = Outcome.ABORTED, reason

    def _obey(self, message: Message, t_s: float) -> Refusal:
        match message:
            case HelloRequest():
                self.session = message.schema_hash == self.schema_hash
                if self.session and self.state == State.BOOT:
                    self.state = State.READY
                self.send(self._hello(), t_s)
            case Ping():
                if self.answers_ping:
                    self.send(Pong(message.host_time_us, self.mcu_us(t_s)), t_s)
            case EStop():
                self.latch(Fault.ESTOP_FRAME)
            case ParamRead():
                self.send(ParamValue(Param(message.param), self.values[Param(message.param)]), t_s)
            case _ if not self.session:
                return Refusal.NO_SESSION
            case Stop():
                self._abort(Refusal.BY_STOP)
                if self.state in (State.DRIVING, State.MOVING):
                    self.state = State.STOPPED
            case Clear():
                self.state, self.fault = State.READY, Fault.NONE
            case Drive() | KeepAlive():
                return self._drive(message, t_s)
            case Move() | Turn() | ParamWrite() | ParamSave():
                return self._take(message, t_s)
            case _:
                pass
        return Refusal.NONE

    def _late(self, expires_us: int, t_s: float) -> bool:
        return (expires_us - self.mcu_us(t_s)) & 0xFFFF_FFFF >= 1 << 31

    def _drive(self, message: Drive | KeepAlive, t_s: float) -> Refusal:
        if self.state == State.FAULT:
            return Refusal.FAULT_LATCHED if isinstance(message, Drive) else Refusal.NONE
        if self._late(message.expires_us, t_s):
            return Refusal.EXPIRED
        if isinstance(message, Drive):
            self._abort(Refusal.BY_DRIVE)
            self.state = State.DRIVING
        self._obeyed_s = t_s
        return Refusal.NONE

    def _take(self, message: Request, t_s: float) -> Refusal:
        if message.boot_nonce != self.nonce:
            return Refusal.BAD_NONCE
        ahead = (message.request - self.request) & 0xFFFF
        if ahead == 0:
            return Refusal.NONE
        if ahead >= 1 << 15:
            return Refusal.OLD_REQUEST
        self.request = message.request
        self.reason = self._objection(message, t_s)
        if self.reason != Refusal.NONE:
            self.outcome = Outcome.REFUSED
            return self.reason
        self.begun.append(message)
        self.outcome = Outcome.RUNNING
        match message:
            case ParamWrite():
                self.values[Param(message.param)] = message.value
                self.outcome = Outcome.DONE
                self.send(ParamValue(Param(message.param), message.value), t_s)
            case ParamSave():
                self._over_s = t_s + self.save_takes_s
            case _:
                self.state, self._obeyed_s = State.MOVING, t_s
                self._over_s = t_s + self.move_takes_s
        return Refusal.NONE

    def _objection(self, message: Request, t_s: float) -> Refusal:
        if isinstance(message, Move | Turn):
            if self.state == State.FAULT:
                return Refusal.FAULT_LATCHED
            if self._late(message.expires_us, t_s):
                return Refusal.EXPIRED
        return Refusal.NONE if self.state in (State.READY, State.FAULT) else Refusal.NOT_STANDING
