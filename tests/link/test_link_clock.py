"""Robot time on the host's clock: exact when the line is even, within a millisecond when it is not."""

from __future__ import annotations

import random

import pytest
from scripted_robot import ScriptedRobot, VirtualClock

from host.link.clock import RobotClock, SystemClock
from host.link.protocol import ResetCause
from host.link.robot import Robot


def test_an_even_line_gives_the_exact_mapping_from_the_first_window_on():
    clock = RobotClock()
    clock.add(earliest_s=10.0, mcu_time_us=5_001_000, latest_s=10.002)
    assert clock.host_time_s(5_001_000) == pytest.approx(10.001, abs=1e-9)
    assert clock.host_time_s(7_001_000) == pytest.approx(12.001, abs=1e-9)
    assert clock.mcu_time_us(10.001) == 5_001_000


def test_drift_is_learnt():
    clock = RobotClock()
    for n in range(64):
        t_s = 0.1 * n
        clock.add(t_s - 0.001, round(t_s * (1 + 3e-4) * 1e6), t_s + 0.001)
    for ahead_s in (0.0, 1.0):
        t_s = 6.3 + ahead_s
        assert clock.host_time_s(round(t_s * (1 + 3e-4) * 1e6)) == pytest.approx(t_s, abs=20e-6)


def test_the_robots_clock_may_wrap():
    clock = RobotClock()
    for n in range(100):
        t_s = 0.1 * n
        clock.add(t_s, (0xFFFF_0000 + n * 100_000) & 0xFFFF_FFFF, t_s)
        assert clock.host_time_s((0xFFFF_0000 + n * 100_000) & 0xFFFF_FFFF) == pytest.approx(t_s, abs=1e-6)
    assert clock.host_time_s(0xFFFF_0000) == pytest.approx(0.0, abs=1e-6)
    assert clock.mcu_time_us(0.0) == 0xFFFF_0000


def test_five_milliseconds_of_jitter_each_way_leave_less_than_one():
    errors_s = []
    for seed in range(12):
        chance = random.Random(seed)
        host = VirtualClock()
        board = ScriptedRobot(
            host,
            jitter_s=0.005,
            seed=seed,
            drift=chance.uniform(-0.005, 0.005),
            start_us=chance.randrange(1 << 32) if seed % 2 else (1 << 32) - 5_000_000,  # wraps meanwhile
        )
        robot = Robot(board, host)
        robot.connect()
        end_s = host.now_s() + 15
        while host.now_s() < end_s:
            host.sleep_s(0.005)
            robot.poll()
            t_s = host.now_s()
            errors_s.append(abs(robot.host_time_s(board.mcu_us(t_s)) - t_s))
    p99_s = sorted(errors_s)[int(0.99 * len(errors_s))]
    print(f"\nclock offset: p99 {1e3 * p99_s:.2f} ms of {len(errors_s)}")
    assert p99_s <= 0.001


def test_a_new_session_compares_the_clocks_anew():
    host = VirtualClock()
    board = ScriptedRobot(host, drift=0.004)
    robot = Robot(board, host)
    robot.connect()
    for _ in range(500):
        host.sleep_s(0.01)
        robot.poll()
    board.drift = -0.003
    board.restart(ResetCause.BROWN_OUT, nonce=2)
    robot.connect()
    t_s = host.now_s()
    assert robot.host_time_s(board.mcu_us(t_s)) == pytest.approx(t_s, abs=3e-4)


def test_a_host_that_reads_late_keeps_what_it_learnt_while_it_read_at_once():
    clock = RobotClock()
    for n in range(16):
        t_s = 0.002 * n
        clock.add(t_s, round((t_s + 0.0005) * 1e6), t_s + 0.001)
    for n in range(200):
        t_s = 0.1 + n / 15
        clock.add(t_s, round((t_s + 0.0005) * 1e6), t_s + 1 / 15)
    assert clock.host_time_s(20_000_000) == pytest.approx(20.0, abs=1e-5)


def test_the_system_clock_sleeps_and_never_goes_back():
    clock = SystemClock()
    before_s = clock.now_s()
    clock.sleep_s(0.01)
    assert clock.now_s() - before_s >= 0.01
