"""A lost session comes back by itself: on a new line, after a restart, after silence, after a pause."""

from __future__ import annotations

import pytest
from scripted_robot import ScriptedRobot, VirtualClock

from host.errors import DeviceError
from host.link.protocol import (
    Drive,
    Fault,
    KeepAlive,
    Message,
    Move,
    Outcome,
    ParamWrite,
    Refusal,
    ResetCause,
    State,
)
from host.link.requests import Errand, Result
from host.link.robot import Robot


class Plug:
    """Opens a line to a board, which fails while the plug is out."""

    def __init__(self, board: ScriptedRobot, clock: VirtualClock) -> None:
        self.board, self.clock = board, clock
        self.back_at_s = 0.0
        self.opened = 0
        self.resets = False  # opening the port restarts the board, as an Arduino does

    def pull(self, for_s: float) -> None:
        self.board.read()
        self.board.cut()
        self.back_at_s = self.clock.now_s() + for_s

    def open(self) -> ScriptedRobot:
        if self.clock.now_s() < self.back_at_s:
            raise DeviceError("/dev/ttyACM0 does not exist")
        self.opened += 1
        self.board.unplugged = self.board.silent = False
        self.board.read()  # what was on the line is lost
        if self.resets:
            self.board.restart(ResetCause.EXTERNAL, self.board.nonce + 1)
        return self.board


def connected(**scripted) -> tuple[Robot, ScriptedRobot, VirtualClock, Plug]:
    clock = VirtualClock()
    board = ScriptedRobot(clock, **scripted)
    plug = Plug(board, clock)
    robot = Robot(board, clock, plug.open)
    robot.connect()
    return robot, board, clock, plug


def drive(robot: Robot, clock: VirtualClock, seconds: float) -> None:
    for _ in range(round(seconds * 100)):
        clock.sleep_s(0.01)
        robot.poll()
        robot.drive(200, 0)


def move_until_lost(robot: Robot, clock: VirtualClock, then) -> Errand:
    errand = robot.move(300)
    for _ in range(10):
        clock.sleep_s(0.01)
        robot.poll()
    then()
    with pytest.raises(DeviceError):
        robot.wait(errand)
    return errand


def heard_since(board: ScriptedRobot, count: int, *kinds: type[Message]) -> list[Message]:
    return [message for _, message in board.heard[count:] if isinstance(message, kinds)]


@pytest.mark.parametrize("resets", [False, True])
def test_an_unplugged_robot_is_back_soon_after_it_is_plugged_in(resets: bool):
    robot, board, clock, plug = connected()
    plug.resets = resets
    drive(robot, clock, 0.3)
    plug.pull(for_s=1.5)
    with pytest.raises(DeviceError, match="gone"):
        drive(robot, clock, 0.1)
    began_s, heard = clock.now_s(), len(board.heard)
    back = robot.reconnect()
    assert 1.5 <= clock.now_s() - began_s < 2.1
    assert back.restarted == resets
    assert back.why == "/dev/null is gone"
    assert heard_since(board, heard, Drive, Move, ParamWrite, KeepAlive) == []
    if not resets:
        assert robot.latest is not None
        assert robot.latest.fault == Fault.LINK_LOST  # it stopped by itself meanwhile
        robot.clear()
    drive(robot, clock, 0.1)
    assert board.state == State.DRIVING


def test_what_happened_is_told_in_one_line_each_with_its_time():
    robot, _, clock, plug = connected()
    drive(robot, clock, 0.3)
    plug.pull(for_s=0.5)
    with pytest.raises(DeviceError):
        drive(robot, clock, 0.1)
    robot.reconnect()
    texts = [event.text for event in robot.events]
    assert texts[0].startswith("connected to build 0000b11d")
    assert texts[1] == "lost: /dev/null is gone"
    assert texts[-1].startswith("connected again after 0.")
    assert texts[-1].endswith("the robot had not restarted; it was lost because /dev/null is gone")
    assert all("\n" not in text for text in texts)
    times = [event.t_s for event in robot.events]
    assert times == sorted(times)


def test_a_robot_that_restarted_is_connected_on_the_line_that_is_open():
    robot, board, clock, plug = connected()
    drive(robot, clock, 0.3)
    board.restart(ResetCause.BROWN_OUT, 0xBAD)
    with pytest.raises(DeviceError, match="restarted"):
        drive(robot, clock, 0.3)
    back = robot.reconnect()
    assert (back.restarted, plug.opened) == (True, 0)  # opening it would restart it once more
    assert "its voltage broke down" in back.why


def test_a_line_that_fell_silent_is_opened_anew():
    robot, board, clock, plug = connected()
    drive(robot, clock, 0.3)
    board.silent = True
    with pytest.raises(DeviceError, match="silent"):
        drive(robot, clock, 0.5)
    began_s = clock.now_s()
    assert not robot.reconnect().restarted
    assert plug.opened == 1
    assert clock.now_s() - began_s < 2.0


def test_a_pause_of_the_host_ends_a_drive_but_not_the_session():
    robot, board, clock, _ = connected()
    drive(robot, clock, 0.3)
    clock.sleep_s(3.0)
    robot.poll()
    assert board.fault == Fault.LINK_LOST
    assert "did not look at the robot for 3.0 s" in robot.events[-1].text
    robot.clear()
    drive(robot, clock, 0.1)
    assert board.state == State.DRIVING


def test_a_robot_that_stays_away_is_an_error_after_the_timeout():
    robot, _, clock, plug = connected()
    plug.pull(for_s=1e9)
    with pytest.raises(DeviceError):
        drive(robot, clock, 0.1)
    began_s = clock.now_s()
    with pytest.raises(DeviceError, match=r"not back after 4 s: /dev/ttyACM0 does not exist"):
        robot.reconnect(timeout_s=4)
    assert 3.5 < clock.now_s() - began_s <= 4.0


def test_without_a_way_to_open_the_line_that_is_said_at_once():
    clock = VirtualClock()
    board = ScriptedRobot(clock)
    robot = Robot(board, clock)
    robot.connect()
    board.unplugged = True
    with pytest.raises(DeviceError, match="gone"):
        robot.poll()
    began_s = clock.now_s()
    with pytest.raises(DeviceError, match="was not told how to open it"):
        robot.reconnect()
    assert clock.now_s() == began_s


def test_a_move_that_the_unplugging_ended_is_told_and_not_begun_again():
    robot, board, clock, plug = connected(move_takes_s=1.0)
    errand = move_until_lost(robot, clock, lambda: plug.pull(for_s=0.5))
    heard = len(board.heard)
    robot.reconnect()
    assert robot.wait(errand) == Result(Outcome.ABORTED, Refusal.BY_FAULT, Fault.LINK_LOST)
    assert heard_since(board, heard, Move, KeepAlive) == []
    assert len(board.begun) == 1


def test_a_move_that_never_arrived_before_the_unplugging_is_never_begun():
    robot, board, clock, plug = connected()
    board_write, board.write = board.write, lambda data: None
    errand = robot.move(300)
    clock.sleep_s(0.05)
    robot.poll()
    plug.pull(for_s=0.5)
    with pytest.raises(DeviceError):
        robot.wait(errand)
    board.write = board_write
    robot.reconnect()
    assert robot.wait(errand) == Result(Outcome.NONE)
    assert board.begun == []
    assert robot.wait(robot.move(100)).done


def test_a_move_cut_off_by_a_restart_is_told_as_ended_and_not_begun_again():
    robot, board, clock, _ = connected()
    errand = move_until_lost(robot, clock, lambda: board.restart(ResetCause.WATCHDOG, 0xBAD))
    robot.reconnect()
    assert errand.result == Result(Outcome.ABORTED, Refusal.BAD_NONCE)
    clock.sleep_s(0.1)
    robot.poll()
    assert len(board.begun) == 1
    assert robot.wait(robot.move(100)).done
    assert [one.request for one in board.begun] == [1, 1]


def test_a_robot_found_moving_is_stopped():
    robot, board, clock, plug = connected(move_takes_s=5.0)
    errand = move_until_lost(robot, clock, lambda: plug.pull(for_s=0.05))
    board._tick = lambda t_s: None  # type: ignore[method-assign]  # nor does its dead-man
    robot.reconnect()
    assert board.state == State.MOVING
    clock.sleep_s(0.02)
    robot.poll()
    assert board.state == State.STOPPED
    clock.sleep_s(0.02)
    robot.poll()
    assert errand.result == Result(Outcome.ABORTED, Refusal.BY_STOP)


def test_readings_from_before_the_loss_are_handed_on_first():
    robot, board, clock, _ = connected()
    robot.poll()
    clock.sleep_s(0.055)
    arrived = [board.read()]
    board.restart(ResetCause.BROWN_OUT, 0xBAD)
    clock.sleep_s(0.025)
    read = board.read
    board.read = lambda: (arrived.pop() if arrived else b"") + read()  # type: ignore[method-assign]
    reports = robot.poll()
    assert len(reports) >= 5
    assert {report.boot_nonce for report in reports} == {0xC0FFEE}
    with pytest.raises(DeviceError, match="restarted"):
        robot.poll()


def test_another_program_that_closes_the_session_is_noticed():
    robot, board, clock, _ = connected()
    board.session = False
    with pytest.raises(DeviceError, match="closed the session"):
        drive(robot, clock, 0.1)
    assert not robot.reconnect().restarted
    drive(robot, clock, 0.1)


def test_counters_go_on_over_a_reconnection():
    robot, _, clock, plug = connected()
    drive(robot, clock, 0.3)
    frames = robot.counters.frames
    plug.pull(for_s=0.1)
    with pytest.raises(DeviceError):
        drive(robot, clock, 0.1)
    robot.reconnect()
    assert robot.counters.frames > frames
