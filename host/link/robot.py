"""The robot as the host sees it: connect, drive, stop, and what it reports."""

from __future__ import annotations

import math
from types import TracebackType
from typing import Self

from host.errors import DeviceError
from host.link.clock import Clock, RobotClock
from host.link.protocol import (
    BAUD,
    DEAD_MAN_US,
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    Clear,
    Counters,
    Decoder,
    Drive,
    EStop,
    Hello,
    HelloRequest,
    LinkStatus,
    Message,
    Nack,
    Ping,
    Pong,
    State,
    Stop,
    Telemetry,
    encode,
)
from host.link.transport import Transport

CONNECT_S = 3.0  # opening the port may reset the board, whose bootloader then waits up to 2 s
ASK_AGAIN_S = 0.1
STEP_S = 0.0002  # between two looks at the line while connecting; half of it may be in the clock mapping
SILENCE_S = 0.25  # 25 telemetry messages missing in a row
PING_PERIOD_S = 0.1
FIRST_PINGS = 16  # before the clock mapping is used
PING_TIMEOUT_S = 0.05
BYTE_S = 10 / BAUD  # on the line, start and stop bit included
_PONG_S = BYTE_S * len(encode(Pong(0, 0), 0))
ESTOP_COPIES = 3


class Robot:
    """One robot on one transport.

    Call `poll` at least ten times a second while driving: it reads the line, keeps the clocks together and
    notices when the robot falls silent or restarts.

    Parameters
    ----------
    transport
        The line; `close` closes it too.
    clock
        The host's time.

    Attributes
    ----------
    counters : Counters
        What this end of the line saw.
    robot_counters : LinkStatus or None
        What the robot's end saw, as last reported.
    latest : Telemetry or None
        The last telemetry received.
    refusals : int
        Messages the robot did not obey.
    last_refusal : Nack or None
        The last of them, with the reason.
    """

    def __init__(self, transport: Transport, clock: Clock) -> None:
        self.robot_counters: LinkStatus | None = None
        self.latest: Telemetry | None = None
        self.refusals = 0
        self.last_refusal: Nack | None = None
        self._transport = transport
        self._clock = clock
        self._decoder = Decoder(to_host=True)
        self._seq = 0
        self._hello: Hello | None = None  # of the open session
        self._offered: Hello | None = None  # the last one received
        self._offers = 0  # how often in a row that start of the robot said HELLO
        self._robot_clock = RobotClock()
        self._pings: dict[int, float] = {}  # not answered yet: what they carried -> earliest arrival
        self._pinged_s = float("-inf")
        self._heard_s = float("-inf")

    @property
    def counters(self) -> Counters:
        """What this end of the line saw."""
        return self._decoder.counters

    # --- Session --------------------------------------------------------------------------------

    def connect(self, timeout_s: float = CONNECT_S) -> Hello:
        """Open a session: same protocol, same schema, clocks compared.

        Returns
        -------
        Hello
            Who answered.

        Raises
        ------
        DeviceError
            Nobody answers within `timeout_s`, or somebody with another protocol or schema.
        """
        self._hello = self._offered = self.latest = None
        self._offers = 0
        self._robot_clock = RobotClock()
        self._pings.clear()
        give_up_s = self._clock.now_s() + timeout_s
        hello = self._await_session(give_up_s)
        self._compare_clocks(give_up_s)
        self._hello = hello
        return hello

    def _await_session(self, give_up_s: float) -> Hello:
        asked_s = float("-inf")
        while (now_s := self._clock.now_s()) < give_up_s:
            if now_s - asked_s >= ASK_AGAIN_S:
                # Twice, because a robot says HELLO unasked once, when it starts, and may not have heard us.
                self._send(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH))
                self._send(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH))
                asked_s = now_s
            self._clock.sleep_s(STEP_S)
            self._read()
            hello, telemetry = self._offered, self.latest
            if hello is None:
                continue
            if (hello.protocol_version, hello.schema_hash) != (PROTOCOL_VERSION, SCHEMA_HASH):
                raise DeviceError(
                    f"the robot speaks protocol {hello.protocol_version}, schema {hello.schema_hash:08x}, "
                    f"and this program protocol {PROTOCOL_VERSION}, schema {SCHEMA_HASH:08x}: "
                    "flash the firmware that belongs to this program"
                )
            current = telemetry and telemetry.boot_nonce == hello.boot_nonce and telemetry.state != State.BOOT
            if current and self._offers >= 2:
                return hello
        raise DeviceError(
            "the robot does not answer HELLO: check that it has power, that this is its port, "
            "and that its firmware is flashed"
        )

    def _compare_clocks(self, give_up_s: float) -> None:
        answered = 0
        while answered < FIRST_PINGS:
            if self._clock.now_s() >= give_up_s:
                raise DeviceError("the robot says HELLO but does not answer PING: check cable and firmware")
            self._ping()
            overdue_s = self._pinged_s + PING_TIMEOUT_S
            while self._pings and self._clock.now_s() < overdue_s:
                self._clock.sleep_s(STEP_S)
                self._read()
            answered += not self._pings
            self._pings.clear()

    def close(self) -> None:
        """Stop the motors and let go of the line."""
        try:
            self.stop()
        except DeviceError:
            pass  # the line is gone, and the dead-man stops the motors
        finally:
            self._hello = None
            self._transport.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # --- Commands -------------------------------------------------------------------------------

    def drive(self, v_mm_s: float, omega_rad_s: float) -> None:
        """Set the velocity for the next 0.2 s, counted from now: what the line delays it by is lost.

        When the setpoint dies without a new one or a `stop`, the robot brakes and latches LINK_LOST.

        Parameters
        ----------
        v_mm_s
            Forward speed.
        omega_rad_s
            Turn rate, positive to the right.

        Raises
        ------
        DeviceError
            No session is open.
        ValueError
            A speed is no number or beyond the protocol's range (32.767 m/s, 32.767 rad/s).
        """
        self._session()
        if not (math.isfinite(v_mm_s) and math.isfinite(omega_rad_s)):
            raise ValueError(f"no speed to drive at: {v_mm_s} mm/s, {omega_rad_s} rad/s")
        expires_us = self._robot_clock.mcu_time_us(self._clock.now_s() + DEAD_MAN_US * 1e-6)
        self._send(Drive(round(v_mm_s), round(omega_rad_s * 1000), expires_us))

    def stop(self) -> None:
        """Brake to a standstill."""
        self._send(Stop())

    def estop(self) -> None:
        """Motors off at once, latched until `clear`; needs no session."""
        for _ in range(ESTOP_COPIES):
            self._send(EStop())

    def clear(self) -> None:
        """Unlatch the fault; the next telemetry tells whether its cause is gone."""
        self._send(Clear(self._session().boot_nonce))

    # --- Reports --------------------------------------------------------------------------------

    def poll(self) -> list[Telemetry]:
        """Telemetry received since the last call, oldest first.

        Raises
        ------
        DeviceError
            The robot has been silent for 0.25 s or has restarted; `connect` again.
        """
        hello = self._session()
        if self._clock.now_s() - self._pinged_s >= PING_PERIOD_S:
            self._ping()
        reports = self._read()
        offered = self._offered
        if offered and offered.boot_nonce != hello.boot_nonce:
            cause = offered.reset_cause.name.lower().replace("_", " ")
            raise self._lost(f"the robot restarted ({cause}): check battery and cable, then connect again")
        if any(report.boot_nonce != hello.boot_nonce for report in reports):
            raise self._lost("the robot restarted: check battery and cable, then connect again")
        silent_s = self._clock.now_s() - self._heard_s
        if silent_s > SILENCE_S:
            raise self._lost(f"the robot has been silent for {silent_s:.2f} s: check cable and power")
        return reports

    def host_time_s(self, mcu_time_us: int) -> float:
        """Host time at which the robot's clock showed `mcu_time_us`, as in Telemetry; after `connect`."""
        return self._robot_clock.host_time_s(mcu_time_us)

    # --- The line -------------------------------------------------------------------------------

    def _session(self) -> Hello:
        if self._hello is None:
            raise DeviceError("no session with the robot is open: connect first")
        return self._hello

    def _lost(self, why: str) -> DeviceError:
        self._hello = None
        return DeviceError(why)

    def _send(self, message: Message) -> int:
        # The delimiter before the frame keeps noise of the pause from swallowing it.
        frame = b"\0" + encode(message, self._seq)
        self._seq = (self._seq + 1) & 0xFF
        self._transport.write(frame)
        return len(frame)

    def _ping(self) -> None:
        self._pinged_s = self._clock.now_s()
        token = int(self._pinged_s * 1e6) & 0xFFFF_FFFF
        if len(self._pings) >= FIRST_PINGS:
            del self._pings[next(iter(self._pings))]  # the oldest will not be answered any more
        self._pings[token] = self._pinged_s + BYTE_S * self._send(Ping(token))

    def _read(self) -> list[Telemetry]:
        received = self._decoder.feed(self._transport.read())
        now_s = self._clock.now_s()
        reports = []
        for _, message in received:
            self._heard_s = now_s
            match message:
                case Telemetry():
                    self.latest = message
                    reports.append(message)
                case Pong():
                    arrived_s = self._pings.pop(message.host_time_us, None)
                    if arrived_s is not None:
                        self._robot_clock.add(arrived_s, message.mcu_time_us, now_s - _PONG_S)
                case Hello():
                    same = self._offered is not None and self._offered.boot_nonce == message.boot_nonce
                    self._offers = self._offers + 1 if same else 1
                    self._offered = message
                case Nack():
                    self.refusals += 1
                    self.last_refusal = message
                case LinkStatus():
                    self.robot_counters = message
        return reports
