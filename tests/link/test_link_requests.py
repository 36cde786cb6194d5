"""Requests against a scripted robot: each done exactly once on any line, and its end told in plain words."""

from __future__ import annotations

import math
import random

import pytest
from scripted_robot import ScriptedRobot, VirtualClock

from host.errors import DeviceError
from host.link.explain import FAULTS, REFUSALS, RESETS
from host.link.faults import Faults, FaultyLine
from host.link.parameters import PARAMETERS, Param
from host.link.protocol import (
    Fault,
    KeepAlive,
    Message,
    Move,
    Outcome,
    ParamSave,
    ParamWrite,
    Refusal,
    ResetCause,
    Stop,
    StopHow,
    Turn,
)
from host.link.requests import REPEAT_S, Errand, Result
from host.link.robot import Robot


def connected(faults: Faults | None = None, seed: int = 0, **scripted):
    clock = VirtualClock()
    board = ScriptedRobot(clock, **scripted)
    line = FaultyLine(board, clock, seed=seed)
    robot = Robot(line, clock)
    robot.connect()
    if faults is not None:
        for one in (line.to_robot, line.to_host):
            vars(one).update(vars(faults))
    return robot, board, clock


def heard(board: ScriptedRobot, kind: type[Message]) -> list[Message]:
    return [message for _, message in board.heard if isinstance(message, kind)]


def look(robot: Robot, clock: VirtualClock, seconds: float) -> None:
    for _ in range(round(seconds * 100)):
        clock.sleep_s(0.01)
        robot.poll()


# --- Moves ----------------------------------------------------------------------------------------


def test_a_move_is_sent_once_on_a_good_line_kept_alive_and_told_as_done():
    robot, board, _ = connected()
    errand = robot.move(-300, 150)
    assert robot.wait(errand) == Result(Outcome.DONE)
    (move,) = heard(board, Move)
    assert isinstance(move, Move)
    assert (move.boot_nonce, move.request, move.distance_mm, move.speed_mm_s) == (board.nonce, 1, -300, 150)
    assert 20 <= len(heard(board, KeepAlive)) <= 26
    assert str(errand.result) == "done"


def test_a_turn_is_given_in_radians_and_sent_in_thousandths():
    robot, board, _ = connected()
    robot.wait(robot.turn(math.pi / 2, 1.2))
    (turn,) = heard(board, Turn)
    assert isinstance(turn, Turn)
    assert (turn.angle_mrad, turn.rate_mrad_s) == (1571, 1200)


def test_a_move_may_be_watched_without_waiting():
    robot, _, clock = connected()
    errand = robot.move(300)
    assert not errand.taken
    look(robot, clock, 0.1)
    assert errand.taken
    assert errand.result is None
    look(robot, clock, 0.6)
    assert errand.result == Result(Outcome.DONE)


def test_telemetry_of_the_time_waited_is_not_lost():
    robot, _, _ = connected()
    robot.poll()
    robot.wait(robot.move(300))
    assert 49 <= len(robot.poll()) <= 56


def test_nobody_polling_stops_a_move():
    robot, board, clock = connected()
    errand = robot.move(300)
    look(robot, clock, 0.05)
    clock.sleep_s(0.24)
    look(robot, clock, 0.05)
    assert errand.result == Result(Outcome.ABORTED, Refusal.BY_FAULT, Fault.LINK_LOST)
    assert "heard no command for 0.2 s" in str(errand.result)
    with pytest.raises(DeviceError, match="left a bit: ended early"):
        errand.result.require_done("left a bit")
    assert len(board.begun) == 1


@pytest.mark.parametrize(
    ("act", "reason"),
    [
        (lambda robot: robot.stop(), Refusal.BY_STOP),
        (lambda robot: robot.stop(StopHow.COAST), Refusal.BY_STOP),
        (lambda robot: robot.drive(100, 0), Refusal.BY_DRIVE),
        (lambda robot: robot.estop(), Refusal.BY_FAULT),
    ],
    ids=["stop", "coast", "drive", "estop"],
)
def test_a_move_ends_early_by_another_command_and_is_not_begun_again(act, reason: Refusal):
    robot, board, clock = connected()
    errand = robot.move(300)
    look(robot, clock, 0.1)
    act(robot)
    kept_alive = len(heard(board, KeepAlive))
    look(robot, clock, 0.15)
    assert errand.result is not None
    assert (errand.result.outcome, errand.result.reason) == (Outcome.ABORTED, reason)
    assert len(heard(board, KeepAlive)) <= kept_alive + 1
    assert len(board.begun) == 1


def test_stop_tells_the_robot_how():
    robot, board, clock = connected()
    robot.stop()
    robot.stop(StopHow.COAST)
    look(robot, clock, 0.02)
    assert heard(board, Stop) == [Stop(StopHow.BRAKE), Stop(StopHow.COAST)]


def test_a_move_that_never_arrives_is_not_begun_after_it_was_stopped():
    robot, board, clock = connected()
    board_write, board.write = board.write, lambda data: None
    errand = robot.move(300)
    look(robot, clock, 0.1)
    robot.stop()
    board.write = board_write
    look(robot, clock, 0.2)
    assert errand.result is None  # a copy may still be under way
    look(robot, clock, 0.2)
    assert errand.result == Result(Outcome.NONE)
    assert "not begun" in str(errand.result)
    assert heard(board, Move) == []
    later = robot.move(100)
    assert later.number == errand.number + 1  # which no copy of the first one can be taken for
    assert robot.wait(later).done


def test_a_request_that_never_arrives_is_given_up():
    robot, board, clock = connected()
    board.request, board._take = 0, lambda message, t_s: Refusal.NONE  # type: ignore[method-assign]
    errand = robot.move(300)
    began_s = clock.now_s()
    assert robot.wait(errand) == Result(Outcome.NONE)
    assert 1.2 < clock.now_s() - began_s < 1.5
    assert 25 <= len(heard(board, Move)) <= 35


def test_the_deadline_of_a_repeated_move_is_fresh():
    robot, board, clock = connected()
    board_write, board.write = board.write, lambda data: None
    errand = robot.move(300)
    look(robot, clock, 0.3)
    board.write = board_write
    assert robot.wait(errand).done
    assert len(board.begun) == 1


def test_a_refused_move_says_why_and_the_next_one_has_another_number():
    robot, board, clock = connected()
    robot.estop()
    look(robot, clock, 0.05)
    refused = robot.wait(robot.move(300))
    assert refused == Result(Outcome.REFUSED, Refusal.FAULT_LATCHED)
    assert "clear it first" in str(refused)
    robot.clear()
    look(robot, clock, 0.05)
    assert robot.wait(robot.move(300)).done
    assert [one.request for one in board.begun] == [2]


def test_one_request_at_a_time():
    robot, _, _ = connected()
    first = robot.move(300)
    with pytest.raises(DeviceError, match="not over yet"):
        robot.move(100)
    with pytest.raises(DeviceError, match="not over yet"):
        robot.write_param(Param.TRACK_UM, 160_000)
    robot.wait(first)
    robot.move(100)


def test_a_wait_that_is_too_long_stops_the_robot():
    robot, board, clock = connected(move_takes_s=100.0)
    errand = robot.move(300)
    with pytest.raises(DeviceError, match="not done after 2 s"):
        robot.wait(errand, timeout_s=2)
    look(robot, clock, 0.05)
    assert errand.result == Result(Outcome.ABORTED, Refusal.BY_STOP)
    assert len(heard(board, Stop)) == 1


@pytest.mark.parametrize("way", [(math.nan, 100), (100, math.inf), (100, 0), (100, -5), (40_000, 100)])
def test_a_move_that_cannot_be_sent_is_refused_here(way: tuple[float, float]):
    robot, board, clock = connected()
    with pytest.raises(ValueError):
        robot.move(*way)
    look(robot, clock, 0.05)
    assert heard(board, Move) == []


def test_numbers_go_on_where_the_robot_is_and_wrap():
    robot, board, _ = connected(request=65534)
    for number in (65535, 0, 1):
        errand = robot.move(10)
        assert errand.number == number
        assert robot.wait(errand).done
    assert len(board.begun) == 3


def test_a_request_of_another_program_meanwhile_is_noticed():
    robot, board, clock = connected()
    errand = robot.move(300)
    look(robot, clock, 0.1)
    board.request += 1
    look(robot, clock, 0.05)
    assert errand.result == Result(Outcome.REFUSED, Refusal.OLD_REQUEST)


# --- Parameters -----------------------------------------------------------------------------------


def test_parameters_are_read_written_and_saved():
    robot, board, _ = connected()
    assert robot.read_params() == {param: known.default for param, known in PARAMETERS.items()}
    robot.write_param(Param.TRACK_UM, 151_234)
    assert robot.read_param(Param.TRACK_UM) == 151_234
    robot.save_params()
    assert [type(one) for one in board.begun] == [ParamWrite, ParamSave]


def test_a_parameter_out_of_range_is_not_sent():
    robot, board, _ = connected()
    with pytest.raises(ValueError, match="TRACK_UM must be 20000 to 1000000, not 5"):
        robot.write_param(Param.TRACK_UM, 5)
    assert heard(board, ParamWrite) == []


def test_a_parameter_that_is_no_whole_number_is_refused_here_and_the_session_goes_on():
    robot, board, clock = connected()
    with pytest.raises(ValueError):
        robot.write_param(Param.UM_PER_COUNT_LEFT, 5000.5)  # type: ignore[arg-type]
    look(robot, clock, 0.1)
    robot.write_param(Param.UM_PER_COUNT_LEFT, 5001)
    (write,) = heard(board, ParamWrite)
    assert isinstance(write, ParamWrite) and write.value == 5001


def test_a_parameter_is_refused_while_driving_and_the_reason_is_told():
    robot, board, clock = connected()
    robot.drive(100, 0)
    look(robot, clock, 0.05)
    with pytest.raises(
        DeviceError, match=r"TRACK_UM = 160000: refused .*stop it and wait until its wheels rest"
    ):
        robot.write_param(Param.TRACK_UM, 160_000)
    assert board.begun == []


def test_a_robot_that_does_not_tell_a_parameter_is_an_error():
    robot, board, _ = connected()
    board._obey = lambda message, t_s: Refusal.NONE  # type: ignore[method-assign]
    with pytest.raises(DeviceError, match="does not tell TRACK_UM"):
        robot.read_param(Param.TRACK_UM)


# --- On a bad line --------------------------------------------------------------------------------

BAD = {  # late by less than 16 messages, which is how far back the link knows an old one
    "loss": Faults(drop=0.3),
    "duplicates": Faults(duplicate=0.5, late_s=0.1),
    "disorder": Faults(reorder=0.3, late_s=0.1),
    "delay": Faults(delay_s=0.03, jitter_s=0.03),
    "bits": Faults(bit_error_rate=1e-3),
    "all": Faults(0.1, 0.05, 0.2, 0.1, 1e-4, 0.01, 0.01, late_s=0.1),
}


@pytest.mark.parametrize("name", BAD)
def test_on_a_bad_line_every_request_is_done_exactly_once(name: str):
    robot, board, _ = connected(BAD[name], seed=7, move_takes_s=0.12)
    chance = random.Random(name)
    wanted = []
    for n in range(60):
        if chance.random() < 0.5:
            errand = robot.move(n + 1, 100)
            result = robot.wait(errand)
            assert result.done or result.reason == Refusal.BY_FAULT  # of keep-alives lost
            if not result.done:
                robot.clear()
                robot.clear()
                robot.wait(robot.move(1, 100))
                wanted += [n + 1, 1]
            else:
                wanted.append(n + 1)
        else:
            robot.write_param(Param.TRACK_UM, 150_000 + n)
            assert robot.read_param(Param.TRACK_UM) == 150_000 + n
            wanted.append(150_000 + n)
    done = [one.distance_mm if isinstance(one, Move) else one.value for one in board.begun]  # type: ignore[union-attr]
    assert done == wanted


# --- Words ----------------------------------------------------------------------------------------


def test_everything_the_robot_may_mean_has_plain_words():
    assert set(FAULTS) == set(Fault)
    assert set(REFUSALS) == set(Refusal)
    assert set(RESETS) == set(ResetCause)
    for fault in set(Fault) - {Fault.NONE}:
        assert "clear the fault" in FAULTS[fault]


def test_an_errand_is_repeated_at_its_period_until_taken():
    errand = Errand(
        lambda number, expires_us: Move(1, number, 10, 10, expires_us), 5, is_move=True, begun_s=0.0
    )
    assert errand.to_send(0.0, 100) == Move(1, 5, 10, 10, 100)
    assert errand.to_send(REPEAT_S / 2, 200) is None
    assert errand.to_send(REPEAT_S * 1.01, 300) == Move(1, 5, 10, 10, 300)
    assert not errand.keep_alive(0.1)
