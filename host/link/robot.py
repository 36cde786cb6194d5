"""The robot as the host sees it: connect, drive, move, stop, set up, hear what it reports, connect again."""

from __future__ import annotations

import contextlib
import math
import threading
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import NamedTuple, Self

from host.errors import DeviceError
from host.link.clock import Clock, RobotClock
from host.link.explain import RESETS
from host.link.orders import Order
from host.link.parameters import PARAMETERS, Param
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
    KeepAlive,
    LinkStatus,
    Message,
    Move,
    Nack,
    ParamRead,
    ParamSave,
    ParamValue,
    ParamWrite,
    Ping,
    Pong,
    Refusal,
    Request,
    State,
    Stop,
    StopHow,
    Telemetry,
    Turn,
    encode,
)
from host.link.requests import REPEAT_S, Errand, Result
from host.link.transport import Transport

CONNECT_S = 3.0  # opening the port may reset the board, whose bootloader then waits up to 2 s
RECONNECT_S = 8.0  # time to put a plug back
ANSWER_S = 1.0  # to a HELLO on a line that stayed open, and to PARAM_READ
REOPEN_PERIOD_S = 0.2
ASK_AGAIN_S = 0.1
STEP_S = 0.0002  # between two looks at the line while connecting; half of it may be in the clock mapping
WAIT_STEP_S = 0.005
SILENCE_S = 0.25  # 25 telemetry messages missing in a row
PAUSE_S = 0.5  # between two looks at the robot, worth a line in the events
PAUSE_MAX_S = 1000.0  # after half an hour nobody could tell how often the robot's clock has wrapped
PING_PERIOD_S = 0.1
LEARN_S = 2.0  # after connecting, in which the clocks' drift is learnt
LEARN_PING_PERIOD_S = 0.02
FIRST_PINGS = 16  # before the clock mapping is used
PING_TIMEOUT_S = 0.05  # at first; doubled for every one that is not answered
PING_TIMEOUT_MAX_S = 0.2
BYTE_S = 10 / BAUD  # on the line, start and stop bit included
_PING_S = BYTE_S * len(encode(Ping(0), 0))
_PONG_S = BYTE_S * len(encode(Pong(0, 0), 0))
ESTOP_COPIES = 3
MOVING = (Drive, Move, Turn, KeepAlive, Clear)  # what a robot may move after
UNREAD_MAX = 6000  # telemetry of a minute
EVENTS_MAX = 1000


class Event(NamedTuple):
    """Something worth a line in a log."""

    t_s: float  # host time
    text: str


class Reconnection(NamedTuple):
    """How a session came back."""

    why: str  # it had gone
    away_s: float  # since it was noticed
    restarted: bool  # counts and parameters began anew, and so did the robot's clock

    def __str__(self) -> str:
        again = "the robot had restarted" if self.restarted else "the robot had not restarted"
        return f"connected again after {self.away_s:.1f} s, {again}; it was lost because {self.why}"


class Robot:
    """One robot on one transport.

    Call `poll` at least ten times a second while driving or moving: it reads the line, repeats what was lost,
    keeps moves alive and the clocks together, and notices when the robot falls silent or restarts. A program
    that no longer calls it stops the robot.

    Parameters
    ----------
    transport
        The line; `close` closes it too.
    clock
        The host's time.
    reopen
        Opens the line anew, for `reconnect` after an unplugging; None where that cannot be.

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
    round_trip_s : float or None
        The shortest since connecting from a PING to reading its answer.
    halted : str or None
        Why another thread has called `halt`; from then on nothing is sent that could move the robot.
    events : deque of Event
        What happened to the session, in one line each: connected, lost, paused, connected again.
    """

    def __init__(
        self, transport: Transport, clock: Clock, reopen: Callable[[], Transport] | None = None
    ) -> None:
        self.robot_counters: LinkStatus | None = None
        self.latest: Telemetry | None = None
        self.refusals = 0
        self.last_refusal: Nack | None = None
        self.round_trip_s: float | None = None
        self.halted: str | None = None
        self.events: deque[Event] = deque(maxlen=EVENTS_MAX)
        self._transport = transport
        self._clock = clock
        self._reopen = reopen
        self._line_gone = False
        self._decoder = Decoder(to_host=True)
        self._sending = threading.Lock()  # numbers go out in order, and nothing that moves after a halt
        self._seq = 0
        self._hello: Hello | None = None  # of the open session
        self._known: Hello | None = None  # of the last session
        self._lost_event: Event | None = None  # why that one ended
        self._offered: Hello | None = None  # the last one received
        self._offers = 0  # how often in a row that start of the robot said HELLO
        self._session_refused = False  # by the robot, since connecting
        self._ended: str | None = None  # why the session is over, when that is known and not yet told
        self._robot_clock = RobotClock()
        self._pings: dict[int, float] = {}  # not answered yet: what they carried -> earliest arrival
        self._pinged_s = float("-inf")
        self._heard_s = float("-inf")
        self._connected_s = float("-inf")
        self._polled_s = float("-inf")
        self._unread: deque[Telemetry] = deque(maxlen=UNREAD_MAX)  # of the open session
        self._order: Order | None = None  # the last one given
        self._errand: Errand | None = None  # the last one begun
        self._values: dict[Param, int] = {}  # parameters that the robot has told

    @property
    def counters(self) -> Counters:
        """What this end of the line saw."""
        return self._decoder.counters

    @property
    def connected(self) -> bool:
        """Whether a session is open, as far as is known."""
        return self._hello is not None

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
        self._hello = self._offered = self.latest = self.round_trip_s = None
        self._offers = 0
        self._robot_clock = RobotClock()
        self._pings.clear()
        self._unread.clear()
        counters, self._decoder = self._decoder.counters, Decoder(to_host=True)
        self._decoder.counters = counters
        give_up_s = self._clock.now_s() + timeout_s
        hello = self._await_session(give_up_s)
        self._compare_clocks(give_up_s)
        self._open_session(hello)
        return hello

    def _open_session(self, hello: Hello) -> None:
        if self._errand is not None:
            self._errand.withdraw()  # what was begun in another session is not sent in this one
            if self._known is None or self._known.boot_nonce != hello.boot_nonce:
                self._errand.lose()
                self._errand = None
        self._order = None
        self._hello = self._known = hello
        self._lost_event = self._ended = None
        self._unread = deque((r for r in self._unread if r.boot_nonce == hello.boot_nonce), UNREAD_MAX)
        self._session_refused = False
        self._connected_s = self._polled_s = self._clock.now_s()
        self._note(f"connected to build {hello.build_id:08x}, start {hello.boot_nonce:08x}")

    def reconnect(self, timeout_s: float = RECONNECT_S) -> Reconnection:
        """Open a session again after it was lost, on a newly opened line where the old one is gone.

        Nothing that was sent before is sent again: commands die, the robot is stopped if it moves, and a
        request that was open is asked after and not repeated. Waits until the robot is back.

        Returns
        -------
        Reconnection
            What had happened.

        Raises
        ------
        DeviceError
            The robot is not back within `timeout_s`, or has another schema.
        """
        before = self._known
        lost = self._lost_event or Event(self._clock.now_s(), "the program asked for it")
        give_up_s = self._clock.now_s() + timeout_s
        patience_s = CONNECT_S if self._offered != before else ANSWER_S
        while True:
            try:
                self._open_line()
                hello = self.connect(min(patience_s, give_up_s - self._clock.now_s()))
                if self.latest is not None and self.latest.state in (State.DRIVING, State.MOVING):
                    self.stop()
                break
            except DeviceError as error:
                if self._line_gone and self._reopen is None:
                    raise
                if self._clock.now_s() + REOPEN_PERIOD_S >= give_up_s:
                    raise DeviceError(f"the robot is not back after {timeout_s:g} s: {error}") from None
            self._line_gone = self._reopen is not None  # or as good as gone: a new one may do better
            patience_s = CONNECT_S
            self._clock.sleep_s(REOPEN_PERIOD_S)
        restarted = before is None or before.boot_nonce != hello.boot_nonce
        reconnection = Reconnection(lost.text, self._clock.now_s() - lost.t_s, restarted)
        self._note(str(reconnection))
        return reconnection

    def _open_line(self) -> None:
        if not self._line_gone:
            return
        if self._reopen is None:
            raise DeviceError("the line is gone and this program was not told how to open it again")
        self._transport.close()
        self._transport = self._reopen()
        self._line_gone = False

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
        answered, patience_s = 0, PING_TIMEOUT_S
        while answered < FIRST_PINGS:
            if self._clock.now_s() >= give_up_s:
                raise DeviceError("the robot says HELLO but does not answer PING: check cable and firmware")
            self._ping()
            overdue_s = self._pinged_s + patience_s
            while self._pings and self._clock.now_s() < overdue_s:
                self._clock.sleep_s(STEP_S)
                self._read()
            answered += not self._pings
            if self._pings:  # lost, or the line is slow
                patience_s = min(2 * patience_s, PING_TIMEOUT_MAX_S)
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

        Give one twenty times a second, and call `poll` at least as often, which repeats what got lost. When
        the setpoint dies without a new one or a `stop`, the robot brakes and latches LINK_LOST.

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
        omega_mrad_s = omega_rad_s * 1000
        if not (math.isfinite(v_mm_s) and math.isfinite(omega_mrad_s)):
            raise ValueError(f"no speed to drive at: {v_mm_s} mm/s, {omega_rad_s} rad/s")
        self._give(Drive(round(v_mm_s), round(omega_mrad_s), self._deadline_us(self._clock.now_s())))

    def stop(self, how: StopHow = StopHow.BRAKE) -> None:
        """Brake to a standstill, or roll out with `how` COAST; ends a move."""
        self._give(Stop(how))

    def estop(self) -> None:
        """Motors off at once, latched until `clear`; needs no session."""
        for _ in range(ESTOP_COPIES):
            self._give(EStop())

    def halt(self, why: str) -> None:
        """Motors off at once and for good, from any thread: waits for nothing but the line.

        Whoever polls goes on hearing the robot, and should look at `halted`. Never raises: where the line is
        gone the robot's own dead-man stops the motors.
        """
        self.halted = why
        with self._sending, contextlib.suppress(DeviceError):
            self._transport.write(b"".join(self._frame(EStop()) for _ in range(ESTOP_COPIES)))

    def clear(self) -> None:
        """Unlatch the fault; telemetry tells whether it arrived and the cause is gone."""
        self._send(Clear(self._session().boot_nonce))

    def _give(self, message: Drive | Stop | EStop) -> None:
        """Send what replaces all that was wanted before; `poll` repeats it if it gets lost."""
        encode(message, 0)  # ValueError now, and what the robot is doing goes on
        if self._errand is not None:
            self._errand.withdraw()
        self._order = None
        self._skip_seq_of_old_drive(message)
        now_s, seq = self._clock.now_s(), self._seq
        self._send(message)
        if self._hello is not None:  # without a session nobody polls, and nothing tells that it arrived
            self._order = Order(message, now_s, seq, self._robot_clock.mcu_time_us(now_s))

    def _serve_order(self, now_s: float) -> None:
        if self._order is not None and self._order.is_due(now_s):
            self._skip_seq_of_old_drive(self._order.message)
            self._order.sent(now_s, self._seq)
            self._send(self._order.message)

    def _skip_seq_of_old_drive(self, message: Drive | Stop | EStop) -> None:
        """Telemetry goes on showing the DRIVE of 256 messages ago, whose number must not seem this one's."""
        if isinstance(message, Drive) and self.latest is not None and self.latest.drive_seq == self._seq:
            self._ping()

    # --- Requests: done once or not at all ------------------------------------------------------

    def move(self, distance_mm: float, speed_mm_s: float = 200.0) -> Errand:
        """Begin to drive straight; `poll` carries it on, `wait` waits for its end, `stop` ends it early.

        Parameters
        ----------
        distance_mm
            Forward positive, within 32.767 m.
        speed_mm_s
            Fastest on the way.

        Raises
        ------
        DeviceError
            No session is open, or an earlier request is not over.
        ValueError
            A number cannot be sent.
        """
        return self._begin_move(Move, distance_mm, speed_mm_s)

    def turn(self, angle_rad: float, rate_rad_s: float = 1.5) -> Errand:
        """Begin to turn on the spot; as `move`.

        Parameters
        ----------
        angle_rad
            Positive to the right, within 32.767 rad.
        rate_rad_s
            Fastest on the way.
        """
        return self._begin_move(Turn, angle_rad * 1000, rate_rad_s * 1000)

    def wait(self, errand: Errand, timeout_s: float = 60.0) -> Result:
        """Poll until a request is over.

        Telemetry that comes meanwhile is kept for the next `poll`.

        Raises
        ------
        DeviceError
            The robot fell silent or restarted, as in `poll`; or it takes longer than `timeout_s`, at which
            it is stopped.
        """
        give_up_s = self._clock.now_s() + timeout_s
        while errand.result is None:
            if self._clock.now_s() >= give_up_s:
                self.stop()
                raise DeviceError(f"the robot was not done after {timeout_s:g} s and was told to stop")
            self._clock.sleep_s(WAIT_STEP_S)
            self._look()
        return errand.result

    def read_param(self, param: Param) -> int:
        """Ask the robot for one parameter."""
        self._session()
        self._values.pop(param, None)
        give_up_s = self._clock.now_s() + ANSWER_S
        asked_s = -math.inf
        while param not in self._values:
            now_s = self._clock.now_s()
            if now_s >= give_up_s:
                raise DeviceError(f"the robot does not tell {param.name}: check the cable")
            if now_s - asked_s >= REPEAT_S:
                self._send(ParamRead(param))
                asked_s = now_s
            self._clock.sleep_s(WAIT_STEP_S)
            self._look()
        return self._values[param]

    def read_params(self) -> dict[Param, int]:
        """Ask the robot for all its parameters."""
        return {param: self.read_param(param) for param in Param}

    def write_param(self, param: Param, value: int) -> None:
        """Change a parameter at once, until the robot's next start; the robot must stand.

        Raises
        ------
        DeviceError
            The robot refuses; the message says why.
        ValueError
            The value is out of the parameter's range.
        """
        known = PARAMETERS[param]
        if not known.lowest <= value <= known.highest:
            raise ValueError(f"{param.name} must be {known.lowest} to {known.highest}, not {value}")
        nonce = self._session().boot_nonce
        errand = self._begin(lambda number, _: ParamWrite(nonce, number, param, value), is_move=False)
        self.wait(errand).require_done(f"{param.name} = {value}")

    def save_params(self) -> None:
        """Keep all parameters as they are now in the robot's EEPROM, and wait until that is done.

        Raises
        ------
        DeviceError
            The robot refuses or cannot; the message says why.
        """
        nonce = self._session().boot_nonce
        errand = self._begin(lambda number, _: ParamSave(nonce, number), is_move=False)
        self.wait(errand).require_done("saving the parameters")

    def _begin_move(self, kind: type[Move] | type[Turn], way: float, speed: float) -> Errand:
        nonce = self._session().boot_nonce
        if not (math.isfinite(way) and math.isfinite(speed) and speed >= 1.0):
            raise ValueError(f"no way to go: {way} mm or mrad at {speed} a second")
        units, pace = round(way), round(speed)
        return self._begin(
            lambda number, expires_us: kind(nonce, number, units, pace, expires_us), is_move=True
        )

    def _begin(self, make: Callable[[int, int], Request], *, is_move: bool) -> Errand:
        if self._errand is not None and self._errand.result is None:
            raise DeviceError("the last request is not over yet: wait for it")
        encode(make(0, 0), 0)  # ValueError now, not in every later poll
        number = self.latest.request if self.latest is not None else 0
        if self._errand is not None and (self._errand.number - number) & 0xFFFF < 1 << 15:
            number = self._errand.number  # it was never taken; a late copy of it must not be this one
        now_s = self._clock.now_s()
        self._errand = Errand(make, (number + 1) & 0xFFFF, is_move=is_move, begun_s=now_s)
        if is_move:
            self._order = None  # a STOP that is repeated now would end the move
        self._serve_errand(now_s)
        return self._errand

    def _serve_errand(self, now_s: float) -> None:
        errand = self._errand
        if errand is None or errand.result is not None:
            return
        expires_us = self._deadline_us(now_s)
        if request := errand.to_send(now_s, expires_us):
            self._send(request)
        elif errand.keep_alive(now_s):
            self._send(KeepAlive(expires_us))

    def _deadline_us(self, now_s: float) -> int:
        return self._robot_clock.mcu_time_us(now_s + DEAD_MAN_US * 1e-6)

    # --- Reports --------------------------------------------------------------------------------

    def poll(self) -> list[Telemetry]:
        """Telemetry received since the last call, oldest first.

        Raises
        ------
        DeviceError
            The line is gone, or the robot has been silent for 0.25 s or has restarted; `reconnect`.
        """
        in_session = self._ended is None
        trouble = self._look(raising=False)
        reports = list(self._unread)
        self._unread.clear()
        if trouble is not None and not (reports and in_session):  # what came before the end goes first
            raise self._lose(trouble)
        return reports

    def _look(self, raising: bool = True) -> str | None:
        """Read the line and send what is due; why the session is over, if it is."""
        hello = self._session()
        now_s = self._clock.now_s()
        paused_s, self._polled_s = now_s - self._polled_s, now_s
        if paused_s > PAUSE_S:
            self._note(f"this program did not look at the robot for {paused_s:.1f} s")
        learning = now_s - self._connected_s < LEARN_S
        if now_s - self._pinged_s >= (LEARN_PING_PERIOD_S if learning else PING_PERIOD_S):
            self._ping()
        self._read()
        self._ended = self._ended or self._trouble(hello, paused_s)
        if self._ended is not None:
            if raising:
                raise self._lose(self._ended)
            return self._ended
        now_s = self._clock.now_s()
        self._serve_order(now_s)
        self._serve_errand(now_s)
        return None

    def _trouble(self, hello: Hello, paused_s: float) -> str | None:
        offered, latest = self._offered, self.latest
        if offered and offered.boot_nonce != hello.boot_nonce:
            return f"the robot restarted ({RESETS[offered.reset_cause]})"
        if latest and latest.boot_nonce != hello.boot_nonce:
            return "the robot restarted"
        if self._session_refused:
            return "the robot has closed the session, as when another program spoke to it"
        if paused_s > PAUSE_MAX_S:
            return f"this program was paused for {paused_s:.0f} s"
        silent_s = self._clock.now_s() - self._heard_s
        if silent_s > SILENCE_S:
            return f"the robot has been silent for {silent_s:.2f} s: check cable and power"
        return None

    def host_time_s(self, mcu_time_us: int) -> float:
        """Host time at which the robot's clock showed `mcu_time_us`, as in Telemetry; after `connect`."""
        return self._robot_clock.host_time_s(mcu_time_us)

    # --- The line -------------------------------------------------------------------------------

    def _session(self) -> Hello:
        if self._hello is None:
            raise DeviceError("no session with the robot is open: connect first")
        return self._hello

    def _lose(self, why: str) -> DeviceError:
        """The session is over; what to tell the caller."""
        if self._hello is not None:
            self._hello = self._order = None
            self._lost_event = Event(self._clock.now_s(), why)
            self._note(f"lost: {why}")
        return DeviceError(f"{why}; connect again")

    def _note(self, text: str) -> None:
        self.events.append(Event(self._clock.now_s(), text))

    def _send(self, message: Message) -> int:
        try:
            with self._sending:
                if self.halted is not None and isinstance(message, MOVING):
                    return 0
                frame = self._frame(message)
                self._transport.write(frame)
        except DeviceError as error:
            raise self._line_lost(error) from None
        return len(frame)

    def _frame(self, message: Message) -> bytes:
        # The delimiter before the frame keeps noise of the pause from swallowing it.
        frame = b"\0" + encode(message, self._seq)
        self._seq = (self._seq + 1) & 0xFF
        return frame

    def _line_lost(self, error: DeviceError) -> DeviceError:
        self._line_gone = True
        self._lose(str(error))
        return error

    def _ping(self) -> None:
        self._pinged_s = self._clock.now_s()
        token = int(self._pinged_s * 1e6) & 0xFFFF_FFFF
        if len(self._pings) >= FIRST_PINGS:
            del self._pings[next(iter(self._pings))]  # the oldest will not be answered any more
        self._pings[token] = self._pinged_s + BYTE_S * self._send(Ping(token))

    def _read(self) -> None:
        try:
            data = self._transport.read()
        except DeviceError as error:
            raise self._line_lost(error) from None
        now_s = self._clock.now_s()
        for _, message in self._decoder.feed(data):
            self._heard_s = now_s
            self._take(message, now_s)

    def _take(self, message: Message, now_s: float) -> None:
        match message:
            case Telemetry():
                self.latest = message
                if self._hello is None or message.boot_nonce == self._hello.boot_nonce:
                    self._unread.append(message)
                    if self._hello is not None and self._order is not None:
                        self._order.hear(message)
                    if self._hello is not None and self._errand is not None:
                        self._errand.hear(message, now_s)
            case Pong():
                arrived_s = self._pings.pop(message.host_time_us, None)
                if arrived_s is not None:
                    self._robot_clock.add(arrived_s, message.mcu_time_us, now_s - _PONG_S)
                    self.round_trip_s = min(now_s - arrived_s + _PING_S, self.round_trip_s or math.inf)
            case Hello():
                same = self._offered is not None and self._offered.boot_nonce == message.boot_nonce
                self._offers = self._offers + 1 if same else 1
                self._offered = message
            case Nack():
                self.refusals += 1
                self.last_refusal = message
                if self._order is not None:
                    self._order.hear(message)
                self._session_refused |= message.reason == Refusal.NO_SESSION
            case LinkStatus():
                self.robot_counters = message
            case ParamValue():
                self._values[message.param] = message.value
