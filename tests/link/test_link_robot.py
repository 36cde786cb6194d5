"""The client against a scripted robot in virtual time: sessions, commands, silence, restarts."""

from __future__ import annotations

import itertools
import math

import pytest
from scripted_robot import ScriptedRobot, VirtualClock

from host.errors import DeviceError
from host.link.protocol import (
    Clear,
    Drive,
    EStop,
    Fault,
    Message,
    Nack,
    Refusal,
    ResetCause,
    State,
    Stop,
)
from host.link.robot import ESTOP_COPIES, Robot


def pair(**scripted) -> tuple[Robot, ScriptedRobot, VirtualClock]:
    clock = VirtualClock()
    board = ScriptedRobot(clock, **scripted)
    return Robot(board, clock), board, clock


def connected(**scripted) -> tuple[Robot, ScriptedRobot, VirtualClock]:
    robot, board, clock = pair(**scripted)
    robot.connect()
    return robot, board, clock


def commands(board: ScriptedRobot, kind: type[Message]) -> list[Message]:
    return [message for _, message in board.heard if isinstance(message, kind)]


# --- Sessions -------------------------------------------------------------------------------------


def test_connecting_tells_who_answered_within_300_ms():
    robot, board, clock = pair()
    began_s = clock.now_s()
    hello = robot.connect()
    assert (hello.boot_nonce, hello.build_id, hello.reset_cause) == (board.nonce, 0xB11D, ResetCause.POWER_ON)
    assert clock.now_s() - began_s < 0.3


def test_after_connecting_the_state_of_the_robot_is_known():
    robot, _, _ = connected()
    assert robot.latest is not None
    assert robot.latest.state == State.READY


def test_a_board_that_restarts_when_its_port_is_opened_is_waited_for():
    robot, board, clock = pair(starts_at_s=101.9)
    began_s = clock.now_s()
    robot.connect()
    assert 1.9 < clock.now_s() - began_s < 2.5
    assert board.state == State.READY


@pytest.mark.parametrize("button_pressed", [False, True])
def test_the_hello_of_a_starting_robot_is_not_taken_for_an_answer(button_pressed: bool):
    robot, board, clock = pair(button_pressed=button_pressed)
    clock.sleep_s(0.05)  # its HELLO and telemetry are on the line before anyone asks
    robot.connect()
    assert board.session


def test_a_start_between_question_and_answer_does_not_leave_the_session_closed():
    for starts_at_s in (100.0001 + 0.0003 * n for n in range(400)):
        robot, board, _ = pair(starts_at_s=starts_at_s, button_pressed=True)
        robot.connect()
        assert board.session


def test_nobody_there_is_an_error_after_the_timeout_and_not_before():
    robot, _, clock = pair(silent=True)
    began_s = clock.now_s()
    with pytest.raises(DeviceError, match="does not answer HELLO: check that it has power"):
        robot.connect(timeout_s=1.0)
    assert clock.now_s() - began_s == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("other", [{"schema_hash": 0x1234}, {"protocol_version": 99}])
def test_another_schema_or_version_is_refused_with_both_named(other: dict[str, int]):
    robot, _, _ = pair(**other)
    with pytest.raises(DeviceError, match=r"speaks protocol \d+, schema [0-9a-f]{8}.*flash the firmware"):
        robot.connect()
    with pytest.raises(DeviceError, match="connect first"):
        robot.drive(100, 0)


def test_a_robot_without_a_clock_is_refused():
    robot, _, _ = pair(answers_ping=False)
    with pytest.raises(DeviceError, match="does not answer PING"):
        robot.connect()


@pytest.mark.parametrize("act", [lambda r: r.drive(1, 0), lambda r: r.clear(), lambda r: r.poll()])
def test_without_a_session_nothing_moves_and_nothing_is_cleared(act):
    robot, board, _ = pair()
    with pytest.raises(DeviceError, match="connect first"):
        act(robot)
    board.read()
    assert commands(board, Drive) == commands(board, Clear) == []


# --- Commands -------------------------------------------------------------------------------------


def test_a_setpoint_dies_200_ms_after_it_was_given_by_the_robots_own_clock():
    robot, board, clock = connected(start_us=0xFFFF_0000)  # which wraps meanwhile
    clock.sleep_s(0.0371)
    given_us = board.mcu_us(clock.now_s())
    robot.drive(300, -0.5)
    clock.sleep_s(0.01)
    robot.poll()
    (drive,) = commands(board, Drive)
    assert isinstance(drive, Drive)
    assert (drive.v_mm_s, drive.omega_mrad_s) == (300, -500)
    held_us = (drive.expires_us - given_us) & 0xFFFF_FFFF
    assert held_us == pytest.approx(200_000, abs=200)


@pytest.mark.parametrize("speeds", [(math.nan, 0), (0, math.inf), (40_000, 0), (0, -33)])
def test_a_speed_that_is_no_number_or_out_of_range_is_refused_and_not_sent(speeds: tuple[float, float]):
    robot, board, clock = connected()
    with pytest.raises(ValueError):
        robot.drive(*speeds)
    clock.sleep_s(0.01)
    robot.poll()
    assert commands(board, Drive) == []


def test_an_emergency_stop_needs_no_session_and_is_sent_three_times():
    robot, board, clock = pair()
    robot.estop()
    clock.sleep_s(0.01)
    board.read()
    assert len(commands(board, EStop)) == ESTOP_COPIES == 3


def test_clearing_names_the_start_of_the_robot_that_is_meant():
    robot, board, clock = connected()
    robot.clear()
    clock.sleep_s(0.01)
    robot.poll()
    assert commands(board, Clear) == [Clear(board.nonce)]


def lossy(lost: int) -> tuple[Robot, ScriptedRobot, VirtualClock]:
    """A session in which the next `lost` frames to the robot vanish."""
    robot, board, clock = connected()
    for _ in range(300):  # past the time in which many PINGs are sent
        clock.sleep_s(0.01)
        robot.poll()
    write, left = board.write, [lost]

    def lose(data: bytes) -> None:
        left[0] -= 1
        if left[0] < 0:
            write(data)

    board.write = lose  # type: ignore[method-assign]
    return robot, board, clock


def look(robot: Robot, clock: VirtualClock, seconds: float) -> None:
    for _ in range(round(seconds * 100)):
        clock.sleep_s(0.01)
        robot.poll()


def test_a_setpoint_that_was_lost_is_repeated_with_its_first_deadline_until_it_is_obeyed():
    robot, board, clock = lossy(2)
    given_us = board.mcu_us(clock.now_s())
    robot.drive(300, 0)
    look(robot, clock, 0.15)
    (drive,) = commands(board, Drive)
    assert isinstance(drive, Drive)
    assert (drive.expires_us - given_us) & 0xFFFF_FFFF == pytest.approx(200_000, abs=200)
    assert board.state == State.DRIVING


def test_a_setpoint_that_keeps_getting_lost_is_given_up_before_it_dies():
    robot, board, clock = lossy(1000)
    sent_to, board.write = [], lambda data: sent_to.append(data)  # type: ignore[method-assign]
    robot.drive(300, 0)
    look(robot, clock, 0.24)
    assert 6 <= sum(data[2] == Drive.ID for data in sent_to) <= 9


def test_a_later_command_ends_the_repetition_of_the_one_before():
    robot, board, clock = lossy(1)
    robot.drive(300, 0)
    robot.stop()
    look(robot, clock, 0.2)
    assert commands(board, Drive) == []
    assert commands(board, Stop) == [Stop()]


def test_an_emergency_stop_that_was_lost_thrice_is_repeated_until_telemetry_shows_it():
    robot, board, clock = lossy(ESTOP_COPIES + 1)
    robot.estop()
    look(robot, clock, 0.1)
    assert len(commands(board, EStop)) == 1
    assert board.state == State.FAULT


@pytest.mark.parametrize("start", [lambda robot: robot.move(1000), lambda robot: robot.drive(300, 0)])
def test_a_stop_that_was_lost_just_after_the_start_is_repeated_though_the_robot_stood_before(start):
    robot, board, clock = connected()
    look(robot, clock, 3.0)
    clock.sleep_s(0.01)  # telemetry of a robot that stands waits to be read
    start(robot)
    write, board.write = board.write, lambda data: None  # type: ignore[method-assign]
    robot.stop()
    board.write = write  # type: ignore[method-assign]
    look(robot, clock, 0.05)
    assert commands(board, Stop) == [Stop()]
    assert board.state == State.READY


def test_a_stop_that_was_lost_on_a_slow_line_is_repeated_when_the_robot_begins_to_move():
    for k in range(10):
        robot, board, clock = connected(delay_s=0.015)
        look(robot, clock, 0.5)
        clock.sleep_s(0.001 * k)
        robot.move(1000)
        write, board.write = board.write, lambda data: None  # type: ignore[method-assign]
        robot.stop()
        board.write = write  # type: ignore[method-assign]
        look(robot, clock, 0.3)
        assert board.fault == Fault.NONE and commands(board, Stop)


def test_an_emergency_stop_that_was_lost_is_repeated_though_another_fault_is_latched():
    robot, board, clock = lossy(ESTOP_COPIES)
    board.latch(Fault.LINK_LOST)
    clock.sleep_s(0.01)
    robot.estop()
    look(robot, clock, 0.1)
    assert commands(board, EStop) == [EStop()]
    assert board.fault == Fault.ESTOP_FRAME


def test_orders_are_sent_once_on_a_good_line():
    robot, board, clock = connected()
    look(robot, clock, 3.0)
    robot.drive(300, 0)
    look(robot, clock, 0.1)
    robot.stop()
    look(robot, clock, 0.2)
    robot.estop()
    look(robot, clock, 0.2)
    assert [len(commands(board, kind)) for kind in (Drive, Stop, EStop)] == [1, 1, ESTOP_COPIES]


def test_a_setpoint_that_was_lost_is_not_taken_for_the_one_of_256_messages_ago():
    robot, board, clock = connected()
    look(robot, clock, 0.1)
    robot.drive(100, 0)
    look(robot, clock, 0.05)
    robot.stop()
    look(robot, clock, 0.1)
    while robot._seq != board.telemetry(clock.now_s()).drive_seq:  # 255 other messages
        robot.clear()
    look(robot, clock, 0.02)
    while robot._seq != board.telemetry(clock.now_s()).drive_seq:
        robot.clear()
    write = board.write
    board.write = lambda data: None if data[2] == Drive.ID else write(data)  # type: ignore[method-assign]
    robot.drive(200, 0)
    board.write = write  # type: ignore[method-assign]
    look(robot, clock, 0.1)
    assert [drive.v_mm_s for drive in commands(board, Drive) if isinstance(drive, Drive)] == [100, 200]


@pytest.mark.parametrize("speeds", [(math.nan, 0), (40_000, 0), (0, 33), (0, 1e308)])
def test_a_setpoint_that_is_refused_here_leaves_a_move_running(speeds: tuple[float, float]):
    robot, board, clock = connected()
    errand = robot.move(300)
    look(robot, clock, 0.1)
    with pytest.raises(ValueError):
        robot.drive(*speeds)
    look(robot, clock, 0.5)
    assert errand.result is not None and errand.result.done
    assert board.fault == Fault.NONE


def test_noise_in_a_pause_costs_no_command():
    robot, board, clock = connected()
    board.write(b"\x07\x55\x55")
    robot.drive(100, 0)
    clock.sleep_s(0.01)
    robot.poll()
    assert len(commands(board, Drive)) == 1


def test_closing_stops_the_robot_and_lets_go_of_the_line():
    robot, board, clock = connected()
    with robot:
        robot.drive(100, 0)
    clock.sleep_s(0.01)
    board.read()
    assert isinstance(board.heard[-1][1], Stop)
    assert board.closed


def test_closing_works_though_the_line_is_gone():
    robot, board, _ = connected()
    board.unplugged = True
    robot.close()
    assert board.closed


# --- Reports --------------------------------------------------------------------------------------


def test_every_telemetry_comes_once_and_in_order():
    robot, _, clock = connected()
    robot.poll()
    times_us = []
    for _ in range(15):
        clock.sleep_s(1 / 15)
        times_us += [report.mcu_time_us for report in robot.poll()]
    steps = {later - earlier for earlier, later in itertools.pairwise(times_us)}
    assert steps == {10_000}
    assert len(times_us) in (99, 100)
    assert robot.counters.lost == 0


def test_telemetry_can_be_placed_on_the_hosts_clock():
    robot, board, clock = connected(start_us=4_294_000_000)
    clock.sleep_s(1.5)
    for report in robot.poll():
        t_s = robot.host_time_s(report.mcu_time_us)
        assert board.mcu_us(t_s) == pytest.approx(report.mcu_time_us, abs=150)


def test_what_the_robots_end_of_the_line_saw_is_known():
    robot, _, clock = connected()
    clock.sleep_s(0.25)
    robot.poll()
    assert robot.robot_counters is not None
    assert robot.robot_counters.frames > 16


def test_a_refusal_is_kept_with_its_reason():
    robot, board, clock = connected()
    board.send(Nack(Drive.ID, 3, Refusal.FAULT_LATCHED))
    clock.sleep_s(0.01)
    robot.poll()
    assert robot.refusals == 1
    assert robot.last_refusal == Nack(Drive.ID, 3, Refusal.FAULT_LATCHED)


def test_noise_from_the_robot_is_counted_and_survived():
    robot, board, clock = connected()
    for _ in range(10):
        board.disturb(b"\x03noise\x00")
        clock.sleep_s(0.05)
        robot.poll()
    assert robot.counters.framing + robot.counters.crc >= 10


def test_silence_is_noticed_after_a_quarter_of_a_second_and_ends_the_session():
    robot, board, clock = connected()
    robot.poll()
    board.silent = True
    clock.sleep_s(0.2)
    robot.poll()
    clock.sleep_s(0.1)
    with pytest.raises(DeviceError, match=r"silent for 0\.\d\d s: check cable and power"):
        robot.poll()
    with pytest.raises(DeviceError, match="connect first"):
        robot.drive(100, 0)


def test_noise_alone_counts_as_silence():
    robot, board, clock = connected()
    board.silent = True
    with pytest.raises(DeviceError, match="silent"):
        for _ in range(10):
            clock.sleep_s(0.05)
            board.read = lambda: b"\x11\x22\x00" * 20
            robot.poll()


def test_a_restart_is_noticed_within_50_ms_and_ends_the_session():
    robot, board, clock = connected()
    for _ in range(10):
        clock.sleep_s(0.01)
        robot.poll()
    board.restart(ResetCause.BROWN_OUT, nonce=0xBAD)
    began_s = clock.now_s()
    with pytest.raises(DeviceError, match=r"restarted \(its voltage broke down: check the battery\)"):
        while clock.now_s() < began_s + 1:
            clock.sleep_s(0.01)
            robot.poll()
    assert clock.now_s() - began_s <= 0.05
    with pytest.raises(DeviceError, match="connect first"):
        robot.drive(100, 0)
    assert robot.connect().boot_nonce == 0xBAD
    robot.drive(100, 0)


def test_a_restart_is_noticed_by_telemetry_alone_when_its_hello_is_lost():
    robot, board, clock = connected()
    clock.sleep_s(0.5)
    robot.poll()
    board.silent = True
    board.restart(ResetCause.WATCHDOG, nonce=0xBAD)
    board.silent = False
    with pytest.raises(DeviceError, match="the robot restarted; connect again"):
        for _ in range(5):
            clock.sleep_s(0.01)
            robot.poll()
