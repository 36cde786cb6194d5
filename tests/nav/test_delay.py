"""The delay between pictures and encoders is found while driving, and none is seen where there is none."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from planar_world import PlanarWorld

from host.depth.report import Correction, SolvedMotion
from host.nav.delay import Delay
from host.nav.odometry import Odometry, WheelReading, heading_of
from host.pose import Pose

FPS = 15
LATEST_S = 0.1  # after its exposure a picture is there
SEEDS = range(4)


def drive(late_s: float, seed: int, seconds: float, sigma_rad: float = 5e-4, wild: float = 0.0) -> Delay:
    """Stops, straight ways and turns; what the net sees of them is true but for some noise.

    wild : share of pictures whose motion is far off.
    """
    world = PlanarWorld([], room=(-1e4, -1e4, 1e4, 1e4), seed=seed, fps=100)
    rng = np.random.default_rng((0xDE1A, seed))
    odometry, delay = Odometry(world.body), Delay()
    odometry.add(WheelReading(0.0, 0, 0, None, None))
    truth: list[tuple[float, float]] = [(0.0, 0.0)]
    seen: list[tuple[float, Pose, float]] = []  # looked-up time, pose by the wheels, true heading
    due_s, change_s = 0.2, 0.3
    while world.t_s < seconds:
        if world.t_s > change_s:
            change_s = world.t_s + rng.uniform(0.6, 2.0)
            world.command = ((20.0, 0.0), (0.0, 0.5), (0.0, -0.5), (15.0, rng.uniform(-0.5, 0.5)))[
                rng.integers(4)
            ]
        for reading in world.run(0.01):
            odometry.add(reading)
        truth.append((world.t_s, world.heading))
        if world.t_s >= due_s + LATEST_S:
            t, h = np.array(truth[-40:]).T
            stamp_s = due_s + late_s
            pose = odometry.pose_at(delay.exposed_s(stamp_s))
            heading = float(np.interp(due_s, t, h)) + sigma_rad * rng.standard_normal()
            heading += 0.05 * rng.standard_normal() * (rng.random() < wild)
            since = tuple(
                Correction(
                    then_s, heading - then - heading_of(pose) + heading_of(by_wheels), sigma_rad, 0.0, 1.0
                )
                for then_s, by_wheels, then in seen[-4:]
            )
            delay.learn(stamp_s, pose, SolvedMotion(pose, 0.0, 0.0, 0.0, since), odometry)
            seen.append((pose.t_s, pose, heading))
            due_s += 1 / FPS
    return delay


@cache
def found(late_s: float, seed: int) -> tuple[float, float, float]:
    """(estimate, its standard error, what is in use), s."""
    delay = drive(late_s, seed, 20.0)
    return *delay.estimate, delay.late_s


@pytest.mark.parametrize("late_ms", [-20, 10, 40, 60])
def test_after_some_turns_a_delay_is_found_to_3_ms(late_ms):
    off = [1e3 * found(late_ms / 1e3, seed)[0] - late_ms for seed in SEEDS]
    print(f"\n{late_ms} ms: off by {np.round(off, 1)}")
    assert np.median(np.abs(off)) < 3.0


def test_without_a_delay_none_is_used():
    assert max(abs(found(0.0, seed)[2]) for seed in SEEDS) < 0.003


def test_its_standard_error_is_honest():
    pulls = [(m - late) / s for late in (-0.02, 0.0, 0.04) for m, s, _ in (found(late, k) for k in SEEDS)]
    print(np.round(pulls, 1))
    assert 0.2 < math.sqrt(np.mean(np.square(pulls))) < 1.7


def test_pictures_whose_motion_is_far_off_do_little_harm():
    late = [drive(0.03, seed, 20.0, wild=0.1).estimate[0] for seed in SEEDS]
    assert abs(float(np.median(late)) - 0.03) < 0.006


def test_driving_straight_on_tells_nothing_and_changes_nothing():
    world = PlanarWorld([], room=(-1e4, -1e4, 1e4, 1e4), seed=1, fps=100)
    odometry, delay = Odometry(world.body), Delay()
    world.command = (20.0, 0.0)
    for k in range(1000):
        for reading in world.run(0.01):
            odometry.add(reading)
        if k % 7 == 0:
            pose = odometry.pose_at(world.t_s)
            since = (Correction(world.t_s - 0.07, 0.0, 1e-3, 0.0, 0.1),)
            delay.learn(world.t_s, pose, SolvedMotion(pose, 0.0, 0.0, 0.0, since), odometry)
    assert delay.late_s == 0.0
    assert delay.estimate[1] > 0.02
