"""Requests, parameters, coasting and the watchdog on both simulated boards, from bytes to motors."""

from __future__ import annotations

import math

import pytest
from board_bench import Bench, MakeBoard

from host.link.parameters import PARAMETERS, Param
from host.link.protocol import (
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    Clear,
    Fault,
    Hello,
    HelloRequest,
    KeepAlive,
    Message,
    Move,
    Outcome,
    ParamRead,
    ParamSave,
    ParamValue,
    ParamWrite,
    Refusal,
    ResetCause,
    State,
    Stop,
    StopHow,
    Telemetry,
    Turn,
)
from host.sim.board import Board, Side
from host.sim.eeprom import FIRST_SLOT, MARK, SIZE, image, slot

OFF = (0.0, 0.0)
SAVE_MS = 500  # 73 bytes, one in each tick


class Rig(Bench):
    """A bench with a host on it that numbers its requests."""

    nonce = 0
    request = 0

    def start(self) -> Rig:
        """Open a session with a robot that has just been turned on."""
        self.run_ms(50)
        self.tell(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH))
        self.run_ms(20)
        self.nonce = [message for message in self.hear() if isinstance(message, Hello)][-1].boot_nonce
        self.request = 0
        return self

    def ask(self, kind: type[Message], *arguments: int) -> int:
        """A new request; its number."""
        self.request += 1
        self.tell(kind(self.nonce, self.request, *arguments))  # type: ignore[call-arg]
        return self.request

    def ask_to_move(self, kind: type[Move | Turn], way: int, speed: int) -> int:
        """A move that lives for 200 ms unless kept alive."""
        return self.ask(kind, way, speed, self.drive(0).expires_us)

    def keep_alive_for_ms(self, milliseconds: int) -> Telemetry:
        """Let time pass as a host does that watches its move; what telemetry says at last."""
        for _ in range(milliseconds // 50):
            self.tell(KeepAlive(self.drive(0).expires_us))
            self.run_ms(50)
        return self.hear_telemetry()

    def parameter(self, param: Param) -> int:
        """What the robot says it is."""
        self.hear()
        self.tell(ParamRead(param))
        self.run_ms(5)
        return [message.value for message in self.hear() if isinstance(message, ParamValue)][-1]


@pytest.fixture
def rig(make_board: MakeBoard) -> Rig:
    return Rig(make_board()).start()


# --- Moves --------------------------------------------------------------------------------------


def test_a_move_goes_its_way_once_and_is_done(rig: Rig) -> None:
    number = rig.ask_to_move(Move, 300, 200)
    for _ in range(5):
        rig.tell(Move(rig.nonce, number, 300, 200, rig.drive(0).expires_us))  # repeated, as hosts do
        rig.run_ms(30)
    assert rig.hear_telemetry().outcome == Outcome.RUNNING
    told = rig.keep_alive_for_ms(3500)
    assert (told.request, told.outcome, told.reason) == (number, Outcome.DONE, Refusal.NONE)
    assert told.state == State.READY
    assert [wheel.position_mm for wheel in rig.wheels] == pytest.approx([300, 300], abs=6)
    rig.tell(Move(rig.nonce, number, 300, 200, rig.drive(0).expires_us))
    rig.run_ms(300)
    assert rig.duties == OFF


def test_a_turn_goes_its_angle(rig: Rig) -> None:
    rig.ask_to_move(Turn, 1571, 1500)
    assert rig.keep_alive_for_ms(4000).outcome == Outcome.DONE
    left_mm, right_mm = (wheel.position_mm for wheel in rig.wheels)
    assert (left_mm - right_mm) / 150 == pytest.approx(math.pi / 2, abs=0.04)


def test_a_drive_takes_over_from_a_move_without_a_jerk(rig: Rig) -> None:
    rig.ask_to_move(Move, 3000, 400)
    rig.keep_alive_for_ms(1500)
    speed = rig.wheels[0].speed_mm_s
    assert speed > 350
    slowest = speed
    for _ in range(10):
        rig.tell(rig.drive(400))
        rig.run_ms(50)
        slowest = min(slowest, rig.wheels[0].speed_mm_s)
    assert rig.hear_telemetry().state == State.DRIVING
    assert slowest > 0.9 * speed


def test_a_move_whose_host_falls_silent_brakes_by_200_ms_and_is_aborted(rig: Rig) -> None:
    rig.ask_to_move(Move, 2000, 300)
    rig.keep_alive_for_ms(500)
    rig.run_ms(150)  # since the last one was sent
    assert rig.duties == OFF
    rig.run_ms(20)
    told = rig.hear_telemetry()
    assert (told.fault, told.outcome, told.reason) == (Fault.LINK_LOST, Outcome.ABORTED, Refusal.BY_FAULT)


def test_a_restart_forgets_the_move_and_refuses_its_repetition(make_board: MakeBoard) -> None:
    rig = Rig(make_board()).start()
    number = rig.ask_to_move(Move, 2000, 300)
    rig.keep_alive_for_ms(200)
    old = Move(rig.nonce, number, 2000, 300, 200_000)
    rig.board.reset(ResetCause.EXTERNAL)
    rig.start()
    rig.tell(old)
    rig.run_ms(100)
    assert rig.duties == OFF
    told = rig.hear_telemetry()
    assert (told.request, told.outcome) == (0, Outcome.NONE)


# --- Stopping -----------------------------------------------------------------------------------


def test_stop_brakes_or_lets_the_wheels_roll(rig: Rig) -> None:
    ways_mm = []
    for how in StopHow:
        rig.drive_for_ms(1000, 300)
        rig.tell(Stop(how))
        rig.run_ms(5)
        assert rig.duties == OFF
        assert [rig.board.coasting(side) for side in Side] == [how == StopHow.COAST] * 2
        before_mm = rig.wheels[0].position_mm
        rig.run_ms(1500)
        ways_mm.append(rig.wheels[0].position_mm - before_mm)
        assert rig.hear_telemetry().state == State.READY
    assert ways_mm[StopHow.COAST] > 3 * ways_mm[StopHow.BRAKE]


# --- Parameters ---------------------------------------------------------------------------------


def test_an_erased_eeprom_means_defaults(rig: Rig) -> None:
    assert {param: rig.parameter(param) for param in Param} == {
        param: PARAMETERS[param].default for param in Param
    }


def test_the_robot_believes_what_its_eeprom_says(make_board: MakeBoard) -> None:
    values = {Param.TRACK_UM: 123_456, Param.UM_PER_COUNT_RIGHT: 4321, Param.BATTERY_MIN_MV: 0}
    rig = Rig(make_board(0, image(values))).start()
    assert {param: rig.parameter(param) for param in values} == values
    assert rig.parameter(Param.UM_PER_COUNT_LEFT) == 5000


def test_saved_parameters_survive_a_restart_and_lie_as_the_host_expects(make_board: MakeBoard) -> None:
    rig = Rig(make_board()).start()
    rig.ask(ParamWrite, Param.TRACK_UM, 140_000)
    rig.ask(ParamWrite, Param.BATTERY_MIN_MV, 6600)
    number = rig.ask(ParamSave)
    rig.run_ms(20)
    assert rig.hear_telemetry().outcome == Outcome.RUNNING
    rig.run_ms(SAVE_MS)
    told = rig.hear_telemetry()
    assert (told.request, told.outcome, told.reason) == (number, Outcome.DONE, Refusal.NONE)
    assert rig.board.eeprom == image({Param.TRACK_UM: 140_000, Param.BATTERY_MIN_MV: 6600})
    rig.board.reset(ResetCause.POWER_ON)
    rig.start()
    assert (rig.parameter(Param.TRACK_UM), rig.parameter(Param.BATTERY_MIN_MV)) == (140_000, 6600)


@pytest.mark.parametrize("after_ms", range(5, 400, 40))
def test_a_reset_in_the_middle_of_a_save_leaves_the_old_set_or_the_new(
    make_board: MakeBoard, after_ms: int
) -> None:
    old = {param: PARAMETERS[param].lowest for param in Param}
    rig = Rig(make_board(0, image(old))).start()
    for param in Param:
        rig.ask(ParamWrite, param, PARAMETERS[param].highest)
        rig.run_ms(5)
    rig.ask(ParamSave)
    rig.run_ms(after_ms)
    rig.board.reset(ResetCause.BROWN_OUT)
    rig.start()
    held = {param: rig.parameter(param) for param in Param}
    assert held in (old, {param: PARAMETERS[param].highest for param in Param})


def test_an_image_is_one_slot_in_an_erased_eeprom() -> None:
    held = image({Param.TRACK_UM: 140_000})
    assert len(held) == SIZE
    one = slot({Param.TRACK_UM: 140_000}, generation=1)
    assert one.endswith(MARK)
    assert held == (b"\xff" * FIRST_SLOT + one).ljust(SIZE, b"\xff")
    with pytest.raises(ValueError, match="TRACK_UM must be 20000 to 1000000"):
        image({Param.TRACK_UM: 1})


def test_the_newer_of_two_slots_wins_even_when_generations_wrap() -> None:
    older, newer = slot({Param.TRACK_UM: 100_000}, 2**32 - 1), slot({Param.TRACK_UM: 200_000}, 0)
    for first, second in ((older, newer), (newer, older)):
        held = (b"\xff" * FIRST_SLOT + first).ljust(528, b"\xff") + second
        assert Rig(Board(0, held)).start().parameter(Param.TRACK_UM) == 200_000


# --- A hung main loop ---------------------------------------------------------------------------


def test_the_watchdog_ends_a_hang_turns_the_motors_off_and_waits_for_clear(rig: Rig) -> None:
    rig.drive_for_ms(500, 300)
    assert all(rig.duties)
    hung_us = rig.board.time_us
    rig.board.hang(10_000_000)
    while rig.duties != OFF:
        rig.tell(rig.drive(300))  # the host knows of nothing
        rig.run_ms(1)
    assert rig.board.time_us - hung_us <= 130_000
    rig.run_ms(50)
    hello = [message for message in rig.hear() if isinstance(message, Hello)][-1]
    assert hello.reset_cause == ResetCause.WATCHDOG
    rig.start()
    rig.started_us = rig.board.time_us  # near enough
    rig.drive_for_ms(100, 300)
    assert rig.duties == OFF
    assert rig.hear_telemetry().fault == Fault.WATCHDOG
    rig.tell(Clear(rig.nonce))
    rig.run_ms(20)
    assert rig.hear_telemetry().fault == Fault.NONE
    rig.drive_for_ms(100, 300)
    assert all(rig.duties)


def test_a_short_hang_is_an_overrun(rig: Rig) -> None:
    rig.drive_for_ms(500, 300)
    rig.board.hang(30_000)
    rig.run_ms(50)
    assert rig.duties == OFF
    assert rig.hear_telemetry().fault == Fault.OVERRUN
