"""The client and the firmware's C on one virtual line: the whole way, there and back."""

from __future__ import annotations

import pytest

from host.errors import DeviceError
from host.link.protocol import DEAD_MAN_US, Drive, Fault, Refusal, ResetCause, State
from host.link.robot import Robot
from host.sim.board import Board, Line, Side


class BoardClock:
    """Host time is the board's virtual time, ten minutes on."""

    def __init__(self, board: Board) -> None:
        self._board = board

    def now_s(self) -> float:
        return self._board.time_us * 1e-6 + 600.0

    def sleep_s(self, duration_s: float) -> None:
        self._board.step(round(duration_s * 1e6))


@pytest.fixture
def board() -> Board:
    return Board(seed=3)


@pytest.fixture
def clock(board: Board) -> BoardClock:
    return BoardClock(board)


@pytest.fixture
def robot(board: Board, clock: BoardClock) -> Robot:
    robot = Robot(Line(board), clock)
    robot.connect()
    return robot


def test_telemetry_is_placed_on_the_hosts_clock_to_a_tenth_of_a_millisecond(robot: Robot, clock: BoardClock):
    for _ in range(40):  # a host that looks as seldom as its camera takes pictures
        clock.sleep_s(1 / 15)
        for report in robot.poll():
            assert robot.host_time_s(report.mcu_time_us) == pytest.approx(
                report.mcu_time_us * 1e-6 + 600, abs=1e-4
            )
    assert robot.counters.lost == 0


def test_a_setpoint_drives_until_the_dead_man_and_clearing_lets_it_drive_again(
    robot: Robot, board: Board, clock: BoardClock
):
    robot.drive(200, 0.5)
    clock.sleep_s(DEAD_MAN_US * 1e-6 - 0.01)
    assert robot.poll()[-1].state == State.DRIVING
    assert board.duty(Side.LEFT) > board.duty(Side.RIGHT) > 0  # it turns to the right
    clock.sleep_s(0.03)
    assert robot.poll()[-1].fault == Fault.LINK_LOST
    assert board.duty(Side.LEFT) == board.duty(Side.RIGHT) == 0

    robot.drive(200, 0)
    clock.sleep_s(0.03)
    assert robot.poll()[-1].state == State.FAULT
    assert robot.last_refusal is not None
    assert (robot.last_refusal.message, robot.last_refusal.reason) == (Drive.ID, Refusal.FAULT_LATCHED)

    robot.clear()
    robot.drive(200, 0)
    clock.sleep_s(0.03)
    assert robot.poll()[-1].state == State.DRIVING


def test_a_setpoint_that_waited_in_a_buffer_for_a_quarter_of_a_second_moves_nothing(
    robot: Robot, board: Board, clock: BoardClock
):
    line, waiting = Line(board), []
    robot._transport.write = waiting.append  # type: ignore[method-assign]
    robot.drive(200, 0)
    clock.sleep_s(0.25)
    for data in waiting:
        line.write(data)
    clock.sleep_s(0.03)
    assert robot.poll()[-1].state == State.READY
    assert robot.last_refusal is not None
    assert robot.last_refusal.reason == Refusal.EXPIRED


def test_an_emergency_stop_takes_the_motors_power_within_a_millisecond(
    robot: Robot, board: Board, clock: BoardClock
):
    robot.drive(200, 0)
    clock.sleep_s(0.1)
    assert board.duty(Side.LEFT) > 0
    robot.estop()
    clock.sleep_s(0.001)
    assert board.duty(Side.LEFT) == board.duty(Side.RIGHT) == 0
    clock.sleep_s(0.02)
    assert robot.poll()[-1].fault == Fault.ESTOP_FRAME


def test_a_restart_of_the_firmware_is_noticed_and_the_next_session_works(
    robot: Robot, board: Board, clock: BoardClock
):
    clock.sleep_s(0.1)
    robot.poll()
    board.reset(ResetCause.BROWN_OUT)
    clock.sleep_s(0.04)
    with pytest.raises(DeviceError, match="restarted"):
        robot.poll()
    hello = robot.connect()
    assert hello.reset_cause == ResetCause.BROWN_OUT
    robot.drive(100, 0)
    clock.sleep_s(0.03)
    assert robot.poll()[-1].state == State.DRIVING


def test_a_restart_with_the_button_pressed_still_opens_a_session(board: Board, clock: BoardClock):
    board.press_estop(True)
    board.step(100_000)
    robot = Robot(Line(board), clock)
    robot.connect()
    board.press_estop(False)
    clock.sleep_s(0.03)
    robot.clear()
    clock.sleep_s(0.03)
    assert robot.poll()[-1].state == State.READY


def test_an_unplugged_line_is_an_error_and_the_robot_stops_by_itself(
    robot: Robot, board: Board, clock: BoardClock
):
    robot.drive(200, 0)
    clock.sleep_s(0.1)
    robot._transport.close()
    with pytest.raises(DeviceError):
        robot.drive(200, 0)
    clock.sleep_s(0.11)
    assert board.duty(Side.LEFT) == board.duty(Side.RIGHT) == 0
