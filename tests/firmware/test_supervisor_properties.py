"""Properties of supervisor.c: what no sequence of events can bring about."""

from __future__ import annotations

from typing import Any

from firmware_in_c import FirmwareInC
from hypothesis import given, settings
from hypothesis import strategies as st

from host.link.protocol import DEAD_MAN_US, PROTOCOL_VERSION, SCHEMA_HASH, Fault, ResetCause, State, StopHow

NONCE = 0x12345678
TICK_US = 5000

milliseconds = st.integers(-1000, 1000)
events = st.lists(
    st.one_of(
        st.just(("hello", SCHEMA_HASH)),
        st.just(("hello", SCHEMA_HASH ^ 1)),
        st.tuples(st.just("drive"), st.sampled_from([200, 200, 200, 50, 400]) | milliseconds),
        st.just(("stop", 0)),
        st.just(("estop", 0)),
        st.just(("clear", NONCE)),
        st.just(("clear", NONCE ^ 1)),
        st.tuples(st.just("ticks"), st.integers(1, 50)),
        st.tuples(st.just("battery"), st.sampled_from([0, 6000, 6500, 7400])),
        st.tuples(st.just("button"), st.booleans()),
        st.tuples(st.just("still"), st.booleans()),
    ),
    max_size=60,
)
# Half of the runs begin ready to drive, lest most of them never get out of BOOT.
histories = st.tuples(st.sampled_from([[], [("hello", SCHEMA_HASH), ("drive", 200)]]), events).map(
    lambda parts: parts[0] + parts[1]
)
clocks = st.integers(0, 2**32 - 1)


class Rig:
    """A supervisor, its senses and its clock; remembers by itself what was obeyed."""

    def __init__(self, firmware: FirmwareInC, start_us: int) -> None:
        self.c = firmware.c
        self.supervisor = firmware.new("supervisor", NONCE, 6400, ResetCause.POWER_ON)
        self.now_us = start_us  # does not wrap here, only where it is handed over
        self.battery_mv, self.button, self.still = 7400, False, True
        self.session = False
        self.runs_until_us = start_us  # as the commands obeyed would allow

    @property
    def state(self) -> State:
        return State(self.c.shim_supervisor_state(self.supervisor))

    @property
    def fault(self) -> Fault:
        return Fault(self.c.shim_supervisor_fault(self.supervisor))

    @property
    def may_run(self) -> bool:
        return bool(self.c.shim_supervisor_may_run(self.supervisor))

    def do(self, event: str, value: Any) -> None:
        match event:
            case "hello":
                refused = self.c.supervisor_hello(self.supervisor, PROTOCOL_VERSION, value)
                assert bool(refused) == (value != SCHEMA_HASH)
                self.session = not refused
            case "drive":
                ahead_us = value * 1000
                wrapped = (self.now_us % 2**32, (self.now_us + ahead_us) % 2**32)
                if self.c.supervisor_drive(self.supervisor, *wrapped) == 0:
                    self.runs_until_us = self.now_us + min(ahead_us, DEAD_MAN_US)
            case "stop":
                self.c.supervisor_stop(self.supervisor, StopHow.BRAKE)
            case "estop":
                self.c.supervisor_estop(self.supervisor)
            case "clear":
                self.c.supervisor_clear(self.supervisor, value)
            case "ticks":
                for _ in range(value):
                    self.now_us += TICK_US
                    senses = (self.battery_mv, self.button, self.still, Fault.NONE)
                    self.c.shim_supervisor_tick(self.supervisor, self.now_us % 2**32, *senses)
                    self.check()
            case "battery":
                self.battery_mv = value
            case "button":
                self.button = value
            case "still":
                self.still = value
        self.check()

    def check(self) -> None:
        assert (self.fault != Fault.NONE) == (self.state == State.FAULT)
        if self.may_run:
            assert self.state == State.DRIVING
            assert self.session
            assert self.now_us < self.runs_until_us


@settings(max_examples=200, deadline=None)
@given(history=histories, start_us=clocks)
def test_motors_run_only_while_driving_in_a_session_with_a_live_setpoint(
    firmware: FirmwareInC, history: list[tuple[str, Any]], start_us: int
) -> None:
    rig = Rig(firmware, start_us)
    for event, value in history:
        rig.do(event, value)


@settings(max_examples=200, deadline=None)
@given(history=histories, start_us=clocks)
def test_after_200_ms_of_silence_and_one_tick_motors_are_off_whatever_came_before(
    firmware: FirmwareInC, history: list[tuple[str, Any]], start_us: int
) -> None:
    rig = Rig(firmware, start_us)
    for event, value in history:
        rig.do(event, value)
    was_driving = rig.state == State.DRIVING
    rig.do("ticks", DEAD_MAN_US // TICK_US + 1)
    assert not rig.may_run
    assert rig.state != State.DRIVING
    assert rig.state == State.FAULT or not was_driving


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
@given(history=histories, start_us=clocks)
def test_whatever_happened_a_healthy_robot_can_be_driven_again(
    firmware: FirmwareInC, history: list[tuple[str, Any]], start_us: int
) -> None:
    rig = Rig(firmware, start_us)
    recovery = [
        *(("battery", 7400), ("button", False), ("ticks", 1)),
        *(("hello", SCHEMA_HASH), ("clear", NONCE), ("drive", 200)),
    ]
    for event, value in [*history, *recovery]:
        rig.do(event, value)
    assert rig.may_run
