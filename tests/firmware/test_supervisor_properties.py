"""supervisor.c against a model written from its manual, and what no sequence of events can bring about."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from firmware_in_c import FirmwareInC
from hypothesis import given, settings
from hypothesis import strategies as st

from host.link.protocol import (
    DEAD_MAN_US,
    DRIVE_AHEAD_MAX_US,
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    Fault,
    Refusal,
    ResetCause,
    State,
    StopHow,
)

NONCE = 0x12345678
TICK_US = 5000
BATTERY_MIN_MV = 6400
HOLD_MAX_US = DEAD_MAN_US - 6000
WHEEL_FAULTS = (Fault.RUNAWAY, Fault.ENCODER_REVERSED, Fault.ENCODER_DEAD, Fault.STALL)

milliseconds = st.integers(-1000, 1000)
holds = st.sampled_from([200, 200, 200, 50, 400]) | milliseconds
events = st.lists(
    st.one_of(
        st.just(("hello", SCHEMA_HASH)),
        st.just(("hello", SCHEMA_HASH ^ 1)),
        st.tuples(st.just("drive"), holds),
        st.tuples(st.just("move"), holds),
        st.tuples(st.just("keep_alive"), holds),
        st.just(("move_ended", 0)),
        st.tuples(st.just("stop"), st.sampled_from(StopHow)),
        st.just(("estop", 0)),
        st.just(("clear", NONCE)),
        st.just(("clear", NONCE ^ 1)),
        st.tuples(st.just("ticks"), st.integers(1, 50)),
        st.tuples(st.just("late"), st.integers(5, 40)),
        st.tuples(st.just("battery"), st.sampled_from([0, 6000, 6500, 7400])),
        st.tuples(st.just("button"), st.booleans()),
        st.tuples(st.just("still"), st.booleans()),
        st.tuples(st.just("wheels"), st.sampled_from([Fault.NONE, Fault.NONE, *WHEEL_FAULTS])),
    ),
    max_size=60,
)
# Most runs begin ready to drive or move, lest they never get out of BOOT.
openings = st.sampled_from([
    [],
    [("hello", SCHEMA_HASH), ("drive", 200)],
    [("hello", SCHEMA_HASH), ("move", 200)],
])  # fmt: skip
histories = st.tuples(openings, events).map(lambda parts: parts[0] + parts[1])
clocks = st.integers(0, 2**32 - 1)
causes = st.sampled_from(ResetCause)


@dataclass
class Model:
    """The supervisor as its manual describes it: no table, no bits, and a clock that does not wrap."""

    now_us: int
    state: State = State.BOOT
    fault: Fault = Fault.NONE
    session: bool = False
    coasts: bool = False
    alive_until_us: int = 0
    silent_at_us: int = 0  # when the dead-man acts
    button: bool = False
    still: bool = True
    wheels: Fault = Fault.NONE
    low: bool = False
    sagging_since_us: int | None = None
    ticked_us: int | None = None

    def fail(self, fault: Fault) -> None:
        self.state, self.fault, self.coasts = State.FAULT, fault, False

    @property
    def runs(self) -> bool:
        return self.state in (State.DRIVING, State.MOVING) and self.now_us < self.alive_until_us

    @property
    def stands(self) -> bool:
        return self.state == State.READY or (self.state == State.FAULT and self.still)

    def still_wrong(self) -> bool:
        """What is wrong until it changes comes before whatever else happens."""
        if self.button:
            self.fail(Fault.ESTOP_BUTTON)
        elif self.state == State.FAULT:
            return False
        elif self.wheels != Fault.NONE:
            self.fail(self.wheels)
        elif self.low:
            self.fail(Fault.BATTERY_LOW)
        return self.state == State.FAULT

    def rest(self) -> None:
        """What happens by itself when nothing else does."""
        if self.state == State.STOPPED and self.still:
            self.state = State.READY

    def refuse(self, ahead_us: int) -> Refusal:
        if not self.session:
            return Refusal.NO_SESSION
        if self.state == State.FAULT:
            return Refusal.FAULT_LATCHED
        if ahead_us <= 0:
            return Refusal.EXPIRED
        return Refusal.BAD_VALUE if ahead_us > DRIVE_AHEAD_MAX_US else Refusal.NONE

    def live(self, ahead_us: int) -> None:
        self.alive_until_us = self.now_us + min(ahead_us, HOLD_MAX_US)
        self.silent_at_us = self.now_us + HOLD_MAX_US
        self.coasts = False

    def hello(self, schema_hash: int) -> Refusal:
        self.session = schema_hash == SCHEMA_HASH
        if self.still_wrong() or self.state == State.FAULT:
            pass
        elif not self.session:
            self.state = State.BOOT
        elif self.state == State.BOOT:
            self.state = State.READY if self.still else State.STOPPED
        else:
            self.rest()
        return Refusal.NONE if self.session else Refusal.SCHEMA

    def drive(self, ahead_us: int) -> Refusal:
        refusal = self.refuse(ahead_us)
        if not refusal:
            if not self.still_wrong():
                self.state = State.DRIVING
            self.live(ahead_us)
        return refusal

    def move(self, ahead_us: int) -> Refusal:
        refusal = self.refuse(ahead_us)
        if not refusal and self.state != State.READY:
            return Refusal.NOT_STANDING
        if not refusal:
            if not self.still_wrong():
                self.state = State.MOVING
            self.live(ahead_us)
        return refusal

    def keep_alive(self, ahead_us: int) -> Refusal:
        if self.state != State.MOVING:
            return Refusal.NONE
        refusal = self.refuse(ahead_us)
        if not refusal:
            self.live(ahead_us)
        return refusal

    def move_ended(self) -> None:
        if self.still_wrong():
            return
        if self.state == State.MOVING:
            self.state = State.READY
        else:
            self.rest()

    def stop(self, how: StopHow) -> None:
        coasts = how == StopHow.COAST and self.session and self.state != State.FAULT
        self.coasts = coasts
        if self.still_wrong():
            return
        if self.state in (State.DRIVING, State.MOVING):
            self.state = State.STOPPED
        else:
            self.rest()

    def estop(self) -> None:
        self.fail(Fault.ESTOP_BUTTON if self.button else Fault.ESTOP_FRAME)

    def clear(self, nonce: int) -> Refusal:
        if nonce != NONCE:
            return Refusal.BAD_NONCE
        if self.still_wrong():
            return Refusal.FAULT_PERSISTS
        if self.state != State.FAULT:
            self.rest()
            return Refusal.NONE
        if self.wheels == Fault.RUNAWAY or self.low:
            self.fault = Fault.RUNAWAY if self.wheels == Fault.RUNAWAY else Fault.BATTERY_LOW
            return Refusal.FAULT_PERSISTS
        self.fault = Fault.NONE
        standing = State.READY if self.still else State.STOPPED
        self.state = standing if self.session else State.BOOT
        return Refusal.NONE

    def tick(self, now_us: int, battery_mv: int, button: bool, still: bool, wheels: Fault) -> None:
        self.now_us, self.button, self.still, self.wheels = now_us, button, still, wheels
        if battery_mv == 0 or battery_mv >= BATTERY_MIN_MV + 200:
            self.low = False
        if battery_mv == 0 or battery_mv >= BATTERY_MIN_MV:
            self.sagging_since_us = None
        elif self.sagging_since_us is None:
            self.sagging_since_us = now_us
        elif now_us - self.sagging_since_us >= 500_000:
            self.low = True
        late = self.ticked_us is not None and now_us - self.ticked_us > 15_000
        self.ticked_us = now_us

        if self.button or wheels != Fault.NONE:
            self.still_wrong()
        elif self.state == State.FAULT:
            pass
        elif late:
            self.fail(Fault.OVERRUN)
        elif self.low:
            self.fail(Fault.BATTERY_LOW)
        elif self.state in (State.DRIVING, State.MOVING) and now_us >= self.silent_at_us:
            self.fail(Fault.LINK_LOST)
        else:
            self.rest()


@dataclass
class Rig:
    """A supervisor and its model under the same events."""

    firmware: FirmwareInC
    start_us: int
    cause: ResetCause = ResetCause.POWER_ON
    battery_mv: int = 7400
    button: bool = False
    still: bool = True
    wheels: Fault = Fault.NONE
    model: Model = field(init=False)

    def __post_init__(self) -> None:
        self.c = self.firmware.c
        self.supervisor = self.firmware.new("supervisor", NONCE, BATTERY_MIN_MV, self.cause)
        self.model = Model(self.start_us)
        if self.cause == ResetCause.WATCHDOG:
            self.model.fail(Fault.WATCHDOG)

    @property
    def state(self) -> State:
        return State(self.c.shim_supervisor_state(self.supervisor))

    @property
    def fault(self) -> Fault:
        return Fault(self.c.shim_supervisor_fault(self.supervisor))

    @property
    def may_run(self) -> bool:
        return bool(self.c.shim_supervisor_may_run(self.supervisor))

    def tick(self, after_us: int) -> None:
        now_us = self.model.now_us + after_us
        senses = (self.battery_mv, self.button, self.still, self.wheels)
        self.c.shim_supervisor_tick(self.supervisor, now_us % 2**32, *senses)
        self.model.tick(now_us, *senses)

    def do(self, event: str, value: Any) -> None:
        model, c, supervisor = self.model, self.c, self.supervisor
        refused = expected = Refusal.NONE
        match event:
            case "hello":
                refused = c.supervisor_hello(supervisor, PROTOCOL_VERSION, value)
                expected = model.hello(value)
            case "drive" | "move" | "keep_alive":
                ahead_us = value * 1000
                times = (model.now_us % 2**32, (model.now_us + ahead_us) % 2**32)
                refused = getattr(c, f"supervisor_{event}")(supervisor, *times)
                expected = getattr(model, event)(ahead_us)
            case "move_ended":
                c.supervisor_move_ended(supervisor)
                model.move_ended()
            case "stop":
                c.supervisor_stop(supervisor, value)
                model.stop(value)
            case "estop":
                c.supervisor_estop(supervisor)
                model.estop()
            case "clear":
                refused = c.supervisor_clear(supervisor, value)
                expected = model.clear(value)
            case "ticks":
                for _ in range(value):
                    self.tick(TICK_US)
                    self.check()
            case "late":
                self.tick(value * 1000)
            case _:
                setattr(self, {"battery": "battery_mv"}.get(event, event), value)
        assert refused == expected, f"{event} {value}"
        self.check()

    def check(self) -> None:
        model = self.model
        assert (self.state, self.fault) == (model.state, model.fault)
        assert self.may_run == model.runs
        assert bool(self.c.shim_supervisor_coasts(self.supervisor)) == model.coasts
        assert bool(self.c.supervisor_stands(self.supervisor)) == model.stands
        assert (self.fault != Fault.NONE) == (self.state == State.FAULT)


@settings(max_examples=500, deadline=None)
@given(history=histories, start_us=clocks, cause=causes)
def test_it_does_what_its_manual_says_after_any_history(
    firmware: FirmwareInC, history: list[tuple[str, Any]], start_us: int, cause: ResetCause
) -> None:
    rig = Rig(firmware, start_us, cause)
    for event, value in history:
        rig.do(event, value)


@settings(max_examples=200, deadline=None)
@given(history=histories, start_us=clocks)
def test_after_200_ms_of_silence_motors_are_off_whatever_came_before(
    firmware: FirmwareInC, history: list[tuple[str, Any]], start_us: int
) -> None:
    rig = Rig(firmware, start_us)
    for event, value in history:
        rig.do(event, value)
    was_running = rig.state in (State.DRIVING, State.MOVING)
    rig.do("ticks", DEAD_MAN_US // TICK_US)
    assert not rig.may_run
    assert rig.state not in (State.DRIVING, State.MOVING)
    assert rig.state == State.FAULT or not was_running


@settings(max_examples=200, deadline=None)
@given(history=histories, more=events, start_us=clocks)
def test_a_fault_stays_until_clear_with_the_right_nonce(
    firmware: FirmwareInC, history: list[tuple[str, Any]], more: list[tuple[str, Any]], start_us: int
) -> None:
    rig = Rig(firmware, start_us)
    for event, value in [*history, ("estop", 0)]:
        rig.do(event, value)
    for event, value in more:
        if (event, value) != ("clear", NONCE):
            rig.do(event, value)
            assert rig.state == State.FAULT
            assert rig.fault in (Fault.ESTOP_FRAME, Fault.ESTOP_BUTTON)


@settings(max_examples=200, deadline=None)
@given(history=histories, start_us=clocks, cause=causes)
def test_whatever_happened_a_healthy_robot_can_be_driven_again(
    firmware: FirmwareInC, history: list[tuple[str, Any]], start_us: int, cause: ResetCause
) -> None:
    rig = Rig(firmware, start_us, cause)
    recovery = [
        *(("battery", 7400), ("button", False), ("wheels", Fault.NONE), ("ticks", 1)),
        *(("hello", SCHEMA_HASH), ("clear", NONCE), ("drive", 200)),
    ]
    for event, value in [*history, *recovery]:
        rig.do(event, value)
    assert rig.may_run
