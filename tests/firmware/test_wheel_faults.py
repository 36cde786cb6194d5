"""Wheels that are not what they should be, on both boards: how soon a robot notices, and what it says."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from board_bench import Bench, MakeBoard, Wheel

from host.link.parameters import Param
from host.link.protocol import Fault, State
from host.sim.board import Board, Side
from host.sim.eeprom import image

OFF = (0.0, 0.0)


@dataclass
class Ends:
    """A board as a broken wheel sees it."""

    board: Board
    broken: str

    @property
    def time_us(self) -> int:
        """As the board's."""
        return self.board.time_us

    def duty(self, side: Side) -> float:
        """As the board's."""
        return self.board.duty(side)

    def coasting(self, side: Side) -> bool:
        """As the board's."""
        return self.board.coasting(side)

    def set_encoder_pins(self, side: Side, a: bool, b: bool, at_us: int) -> None:
        """Not at all, or with the channels swapped."""
        if self.broken != "dead":
            self.board.set_encoder_pins(side, *((b, a) if self.broken == "reversed" else (a, b)), at_us)


@dataclass
class BreakableWheel(Wheel):
    """A wheel whose encoder may be dead or reversed, or which may be blocked."""

    broken: str = ""

    def turn(self, board: Board, side: Side, duration_us: int) -> None:
        """As any wheel, but for what is broken."""
        if self.broken == "blocked":
            self.speed_mm_s = 0.0
        else:
            super().turn(Ends(board, self.broken), side, duration_us)  # type: ignore[arg-type]


def robot(board: Board, broken: str = "", sides: tuple[Side, ...] = tuple(Side)) -> Bench:
    """A robot with an open session, broken from the beginning."""
    wheels = tuple(BreakableWheel(broken=broken if side in sides else "") for side in Side)
    bench = Bench(board, wheels)  # type: ignore[arg-type]
    bench.run_ms(50)
    bench.open_session()
    return bench


def ms_until_off(bench: Bench, v_mm_s: int, omega_mrad_s: int = 0) -> int:
    """Drive until the robot turns its motors off; says when."""
    for ms in range(6000):
        if ms % 50 == 0:
            bench.tell(bench.drive(v_mm_s, omega_mrad_s))
        bench.run_ms(1)
        if ms > 20 and bench.duties == OFF:
            return ms + 1
    pytest.fail("nothing was noticed in 6 s")


def fault_told(bench: Bench) -> Fault:
    """After a few reports."""
    bench.run_ms(30)
    told = bench.hear_telemetry()
    assert told.state == State.FAULT
    return told.fault


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("v_mm_s", [100, 250, -400, 600])
def test_an_encoder_that_dies_while_driving_is_noticed_in_150_ms(
    make_board: MakeBoard, side: Side, v_mm_s: int
) -> None:
    bench = robot(make_board())
    bench.drive_for_ms(1500, v_mm_s)
    bench.wheels[side].broken = "dead"  # type: ignore[attr-defined]
    assert ms_until_off(bench, v_mm_s) <= 150
    assert fault_told(bench) == Fault.ENCODER_DEAD


@pytest.mark.parametrize("sides", [(Side.LEFT,), (Side.RIGHT,), tuple(Side)])
@pytest.mark.parametrize("v_mm_s", [100, 250, -400, 600])
def test_an_encoder_that_counts_the_wrong_way_is_noticed_before_5_cm_of_travel(
    make_board: MakeBoard, sides: tuple[Side, ...], v_mm_s: int
) -> None:
    bench = robot(make_board(), "reversed", sides)
    ms_until_off(bench, v_mm_s)
    assert max(abs(wheel.position_mm) for wheel in bench.wheels) < 50
    assert fault_told(bench) == Fault.ENCODER_REVERSED


@pytest.mark.parametrize("v_mm_s", [150, 300, -600])
def test_blocked_wheels_are_noticed_in_500_ms(make_board: MakeBoard, v_mm_s: int) -> None:
    bench = robot(make_board())
    bench.drive_for_ms(1000, v_mm_s)
    for wheel in bench.wheels:
        wheel.broken = "blocked"  # type: ignore[attr-defined]
    assert ms_until_off(bench, v_mm_s) <= 500
    assert fault_told(bench) == Fault.STALL


@pytest.mark.parametrize("v_mm_s", [50, 90])
@pytest.mark.parametrize("limit", [0, 4000])
def test_gains_too_small_to_move_a_wheel_do_not_hide_dead_encoders(
    make_board: MakeBoard, limit: int, v_mm_s: int
) -> None:
    bench = robot(make_board(0, image({Param.INTEGRAL_LIMIT: limit})), "dead")
    ms = ms_until_off(bench, v_mm_s)
    assert fault_told(bench) == Fault.STALL
    assert 0.001 * ms * v_mm_s < 250  # mm that it was told to go


def test_sound_wheels_are_not_found_fault_with(make_board: MakeBoard) -> None:
    bench = robot(make_board())
    for v_mm_s, omega_mrad_s in ((300, 0), (-300, 0), (50, 0), (0, 3000), (0, -3000), (500, 1000), (0, 0)):
        bench.drive_for_ms(1000, v_mm_s, omega_mrad_s)
        assert bench.hear_telemetry().fault == Fault.NONE
