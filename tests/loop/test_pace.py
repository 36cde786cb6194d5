"""Drives at any rate of pictures and on machines of any speed: there in the end, and touching nothing."""

from __future__ import annotations

import pytest
from driving import run, stands

from host.nav.ahead import brakeable_cm_s
from host.nav.config import NavConfig
from host.nav.pace import MOTORS_S, Pace
from host.nav.task import Route
from host.sim.session import Simulation


def test_a_reaction_takes_as_long_as_a_picture_goes_on_being_acted_on():
    pace = Pace(least_s=0.1)
    assert pace.reaction_s == pytest.approx(0.14)  # motors alone, in steps
    for k in range(10):
        pace.commanded(picture_s=0.2 * k, now_s=0.2 * k + 0.05)
    assert 0.25 + MOTORS_S <= pace.reaction_s < 0.25 + MOTORS_S + 0.02
    for k in range(10):
        pace.commanded(picture_s=2.0 + k / 60, now_s=2.0 + k / 60)
    assert pace.reaction_s == pytest.approx(0.16)
    assert Pace(least_s=0.2).reaction_s == pytest.approx(0.2)


def test_standing_is_no_reaction():
    pace = Pace(least_s=0.1)
    pace.commanded(0.0, 0.05)
    pace.stopped()
    pace.commanded(5.0, 5.05)
    assert pace.reaction_s == pytest.approx(0.14)


@pytest.mark.parametrize("fps", [5, 60])
def test_the_goal_is_reached_at_any_rate_of_pictures(fps: int):
    simulation = Simulation("sim:corridor?seed=5", fps=fps)
    log, _ = run(simulation, task=Route([(0.0, 60.0)]), max_time_s=30.0)
    print(f"\n{fps} a second: {log.outcome} after {log.duration_s:.1f} s, {log.refused_frames} refused")
    assert log.outcome == "goal", log.reason
    assert simulation.body.collisions == 0
    assert (log.dropped_frames, log.refused_frames, log.faults_cleared) == (0, 0, 0)
    assert log.frames == pytest.approx(fps * log.duration_s, abs=3)
    assert stands(simulation)


@pytest.mark.parametrize("work_ms", [80, 250])
def test_a_slow_machine_drives_as_safely_or_stands_and_says_why(work_ms: int):
    simulation = Simulation("sim:corridor?seed=5")
    log, _ = run(simulation, compute_s=1e-3 * work_ms, max_time_s=10.0)
    print(
        f"\n{work_ms} ms a picture: {log.outcome}, {simulation.body.distance_cm:.0f} cm, "
        f"{log.dropped_frames} dropped, latency {log.latency_ms.summary()}"
    )
    assert simulation.body.collisions == 0
    assert log.faults_cleared == 0  # never so slow that the robot has to stop itself
    if work_ms <= 80:
        assert simulation.body.distance_cm > 40.0 and log.refused_frames == 0
        more_than_can_be_understood = max(0.0, 10.0 * 15 - 10e3 / work_ms)
        assert abs(log.dropped_frames - more_than_can_be_understood) <= 5
        assert log.latency_ms.percentile(100) < work_ms + 1e3 / 15 + 5  # newest picture, never a queue
    else:
        assert simulation.body.distance_cm < 1.0
        assert "the machine is slow" in log.reason
    assert stands(simulation)


def test_less_room_is_used_up_at_speed_the_longer_a_reaction_takes():
    speeds = [brakeable_cm_s(NavConfig(reaction_s=s), 15.0) for s in (0.2, 0.3, 0.4)]
    assert speeds[0] > speeds[1] > speeds[2] > 0
