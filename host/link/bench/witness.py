"""What the frames of both directions tell about the health of a line."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass, field

from host.link.bench.frames import Frame
from host.link.protocol import (
    Hello,
    LinkStatus,
    Nack,
    Ping,
    Pong,
    Refusal,
    ResetCause,
    Telemetry,
)

RTTS_MAX = 1000
UNANSWERED_MAX = 64


@dataclass
class Evidence:
    """Counters of both ends over some time; what a verdict is made from."""

    seconds: float = 0.0
    sent: int = 0  # frames to the robot
    bits_to_robot: int = 0
    bits_to_host: int = 0
    host: dict[str, int] = field(default_factory=dict)  # by the names of Counters
    robot: dict[str, int] = field(default_factory=dict)  # by the names of LinkStatus; empty: never told
    telemetry: int = 0
    telemetry_hz: float | None = None  # received, by the robot's clock
    restarts: list[str] = field(default_factory=list)  # causes, lower case
    refusals: dict[str, int] = field(default_factory=dict)  # NACKs by reason, lower case
    faults: dict[str, int] = field(default_factory=dict)  # latched by the robot, lower case
    longest_silence_s: float = 0.0  # without a whole frame from the robot
    rtt_ms: list[float] = field(default_factory=list)  # of very many, only some
    pings: int = 0
    answered: int = 0
    drift_ppm: float | None = None  # of the robot's clock against this computer's
    battery_mv_min: int | None = None
    violations: list[str] = field(default_factory=list)  # of what must never happen, in plain words


class Witness:
    """Sees every frame from a Tap and remembers what matters."""

    def __init__(self) -> None:
        self._evidence = Evidence()
        self._begin_s: float | None = None
        self._last_s = 0.0
        self._heard_s: float | None = None
        self._status: LinkStatus | None = None
        self._nonce: int | None = None
        self._nonces: set[int] = set()
        self._cause: tuple[int, str] | None = None
        self._fault: int | None = None  # not known yet
        self._pings: dict[int, float] = {}
        self._every = 1
        self._first_mcu_us: int | None = None
        self._mcu_us = 0
        self._run_us = 0  # robot time between telemetry, over all starts
        self._due = 0  # telemetry received in that time
        self.host: Counter[str] = Counter()

    def see(self, frame: Frame) -> None:
        """Take note of a frame."""
        evidence = self._evidence
        if self._begin_s is None:
            self._begin_s = frame.t_s
            self._heard_s = frame.t_s
        self._last_s = frame.t_s
        if not frame.to_host:
            evidence.sent += 1
            evidence.bits_to_robot += 8 * (len(frame.coded) + 1)
            if isinstance(frame.message, Ping):
                evidence.pings += 1
                if len(self._pings) >= UNANSWERED_MAX:
                    del self._pings[next(iter(self._pings))]
                self._pings[frame.message.host_time_us] = frame.t_s
            return
        evidence.bits_to_host += 8 * (len(frame.coded) + 1)
        self.host["lost"] += frame.lost
        if (
            frame.error is not None and self.host["frames"]
        ):  # before the first, the port was opened within one
            self.host[frame.error] += 1
        if frame.message is None:
            return
        self.host["frames"] += 1
        assert self._heard_s is not None
        evidence.longest_silence_s = max(evidence.longest_silence_s, frame.t_s - self._heard_s)
        self._heard_s = frame.t_s
        match frame.message:
            case Telemetry():
                self._see_telemetry(frame.message, frame.lost)
            case Pong():
                sent_s = self._pings.pop(frame.message.host_time_us, None)
                if sent_s is not None:
                    self._add_rtt(1000 * (frame.t_s - sent_s))
            case Hello():
                cause = ResetCause(frame.message.reset_cause).name.lower().replace("_", " ")
                self._cause = (frame.message.boot_nonce, cause)
                self._see_nonce(frame.message.boot_nonce)
            case Nack():
                reason = Refusal(frame.message.reason).name.lower().replace("_", " ")
                evidence.refusals[reason] = evidence.refusals.get(reason, 0) + 1
            case LinkStatus():
                self._see_status(frame.message)

    def _add_rtt(self, ms: float) -> None:
        """Of very many round trips, every second, fourth and so on."""
        self._evidence.answered += 1
        if self._evidence.answered % self._every == 0:
            self._evidence.rtt_ms.append(ms)
        if len(self._evidence.rtt_ms) >= RTTS_MAX:
            self._evidence.rtt_ms = self._evidence.rtt_ms[1::2]
            self._every *= 2

    def _see_nonce(self, nonce: int) -> None:
        if nonce in self._nonces and nonce != self._nonce:
            return  # an old message that comes late
        self._nonces.add(nonce)
        if self._nonce is not None and nonce != self._nonce:
            known = self._cause is not None and self._cause[0] == nonce
            self._evidence.restarts.append(self._cause[1] if known and self._cause else "unknown")
            self._status = None
            self._first_mcu_us = None
            self._fault = 0
        elif self._evidence.restarts and self._cause and self._cause[0] == nonce:
            self._evidence.restarts[-1] = self._cause[1]  # telemetry was faster than HELLO
        self._nonce = nonce

    def _see_telemetry(self, message: Telemetry, lost: int) -> None:
        evidence = self._evidence
        self._see_nonce(message.boot_nonce)
        evidence.telemetry += 1
        if self._first_mcu_us is None:
            self._first_mcu_us = message.mcu_time_us
        else:
            self._run_us += (message.mcu_time_us - self._mcu_us) & 0xFFFF_FFFF
            self._due += 1
        self._mcu_us = message.mcu_time_us
        if self._fault is not None and message.fault != self._fault and message.fault:
            name = message.fault.name.lower().replace("_", " ")
            evidence.faults[name] = evidence.faults.get(name, 0) + 1
        self._fault = message.fault
        if message.battery_mv:
            lowest = evidence.battery_mv_min
            evidence.battery_mv_min = (
                message.battery_mv if lowest is None else min(lowest, message.battery_mv)
            )

    def _see_status(self, message: LinkStatus) -> None:
        if self._status is not None:
            before, now = asdict(self._status), asdict(message)
            for name, value in now.items():
                gained = (value - before[name]) & 0xFFFF
                self._evidence.robot[name] = self._evidence.robot.get(name, 0) + gained
        self._status = message

    def evidence(self) -> Evidence:
        """All so far."""
        evidence = self._evidence
        evidence.seconds = self._last_s - (self._begin_s if self._begin_s is not None else self._last_s)
        evidence.host = dict(self.host)
        if self._heard_s is not None:
            evidence.longest_silence_s = max(evidence.longest_silence_s, self._last_s - self._heard_s)
        if self._run_us:
            evidence.telemetry_hz = self._due / (self._run_us * 1e-6)
        return evidence


def without_rtt(evidence: Evidence) -> dict[str, object]:
    """The evidence for a file, without every single round trip."""
    told = asdict(evidence)
    del told["rtt_ms"]
    return told
