"""The client, a bad line and the firmware: setpoints stay fresh, moves and writes happen exactly once."""

from __future__ import annotations

import pytest
from bad_line_bench import (
    NOISY,
    ROUGH,
    Bench,
    lose_during_a_move,
    move_often,
    percentile,
    setpoint_ages_ms,
    write_often,
)  # fmt: skip

from host.link.faults import Faults
from host.link.protocol import Fault, Move, State, Turn

# --- Setpoints ------------------------------------------------------------------------------------


@pytest.mark.parametrize("faults", [NOISY, Faults(drop=0.1)], ids=["bit errors 1e-4", "a tenth lost"])
def test_driven_twenty_times_a_second_setpoints_stay_fresh_and_nothing_stops(faults: Faults):
    ages_ms = [age for seed in range(4) for age in setpoint_ages_ms(Bench(faults, seed), 40.0)]
    p99 = percentile(ages_ms, 0.99)
    print(f"\nsetpoint age p50 {percentile(ages_ms, 0.5):.1f}, p99 {p99:.1f}, most {max(ages_ms):.1f} ms")
    if faults is NOISY:
        assert p99 <= 60.0


def test_a_stop_that_is_lost_is_repeated():
    bench = Bench(Faults())
    bench.run(1.0, drive=(150, 0))
    bench.line.to_robot.drop = 1.0
    bench.robot.stop()
    bench.line.to_robot.drop = 0.0
    bench.run(1.0)  # which a wheel takes to be known to stand
    assert bench.robot.latest is not None
    assert (bench.robot.latest.state, bench.faults_seen) == (State.READY, {Fault.NONE})


# --- Requests -------------------------------------------------------------------------------------


@pytest.mark.parametrize("faults", [ROUGH], ids=["everything"])
def test_two_hundred_moves_are_each_done_exactly_once(faults: Faults):
    move_often(Bench(faults, seed=5), 200)


def test_parameters_are_written_and_saved_exactly_once():
    write_often(Bench(ROUGH, seed=6), 200)


# --- Lost during a move ---------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [Move, Turn])
@pytest.mark.parametrize("how", ["unplugged", "restarted", "paused"])
def test_a_move_that_loses_its_robot_ends_and_is_never_begun_again(kind: type, how: str):
    lose_during_a_move(Bench(Faults(), seed=7), kind, how)
