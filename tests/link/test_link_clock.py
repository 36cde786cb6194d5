"""Robot time on the host's clock: exact when the line is even, within a millisecond when it is not."""

from __future__ import annotations

import random

import pytest

from host.link.clock import RobotClock, SystemClock


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
    chance = random.Random(1)
    errors_s = []
    for _ in range(12):
        clock = RobotClock()
        drift = chance.uniform(-1e-4, 1e-4)
        t_s = 0.0
        for n in range(316):
            t_s += 0.1 if n >= 16 else 0.005  # a burst while connecting, then ten a second
            there_s, back_s = chance.uniform(0, 0.005), chance.uniform(0, 0.005)
            mcu_us = round((t_s + there_s) * (1 + drift) * 1e6)
            clock.add(t_s, mcu_us, t_s + there_s + back_s)
            if n >= 16:
                errors_s.append(abs(clock.host_time_s(mcu_us) - t_s - there_s))
    assert sorted(errors_s)[int(0.99 * len(errors_s))] < 0.001


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
