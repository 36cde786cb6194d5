"""The delay between pictures and wheels is found while driving, and none is used where there is none."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from planar_world import LENS, PlanarWorld

from host.depth.report import Correction, SolvedMotion
from host.nav.delay import Delay
from host.nav.localise import Localiser
from host.nav.odometry import Odometry, WheelReading, heading_of
from host.pose import Pose

FPS = 15
LATEST_S = 0.1  # after its exposure a picture is there
SEEDS = range(2)
SIGMA_RAD, SIGMA_CM = 1e-3, 0.1
STOP_AND_GO = ((20.0, 0.0), (0.0, 0.5), (0.0, 0.0), (0.0, -0.5), (15.0, 0.3), (20.0, 0.0), (0.0, 0.0))


@cache
def drive(late_s: float, seed: int, seconds: float = 20.0, wild: float = 0.0, steady: bool = False) -> Delay:
    """Stops, straight ways and turns; what the net sees of them is true but for some noise.

    wild : share of pictures whose motion is far off.
    steady : drives straight on at one speed.
    """
    world = PlanarWorld([], room=(-1e4, -1e4, 1e4, 1e4), seed=seed, fps=100)
    rng = np.random.default_rng((0xDE1A, seed))
    odometry, delay, localiser = Odometry(world.body), Delay(world.body), Localiser(world.body, LENS)
    odometry.add(WheelReading(0.0, 0, 0, None, None))
    truth: list[tuple[float, float, float, float]] = []
    seen: list[tuple[Pose, np.ndarray]] = []  # pose by the wheels, and what is true
    due_s, change_s, step = 0.2, 0.3, seed
    while world.t_s < seconds:
        if world.t_s > change_s:
            change_s, step = world.t_s + rng.uniform(0.5, 1.5), step + 1
            world.command = (20.0, 0.0) if steady else STOP_AND_GO[step % len(STOP_AND_GO)]
        for reading in world.run(0.01):
            odometry.add(reading)
        truth.append((world.t_s, world.x, world.z, world.heading))
        if world.t_s < due_s + LATEST_S:
            continue
        t, *place = np.array(truth[-60:]).T
        true = np.array([np.interp(due_s, t, axis) for axis in place])
        true[2] += SIGMA_RAD * rng.standard_normal() + 0.05 * rng.standard_normal() * (rng.random() < wild)
        true[:2] += SIGMA_CM * rng.standard_normal(2)
        pose = localiser.move(odometry.pose_at(delay.exposed_s(due_s + late_s)))
        since = tuple(_seen(then, before, pose, true) for then, before in seen[-4:])
        delay.learn(pose, SolvedMotion(pose, 0.0, 0.0, 0.0, since), odometry, localiser)
        seen.append((pose, true))
        due_s += 1 / FPS
    return delay


def _seen(then: Pose, before: np.ndarray, now: Pose, true: np.ndarray) -> Correction:
    ahead = then.rotation[:, 2]
    way = np.hypot(*(true[:2] - before[:2]))
    turned, by_wheels = true[2] - before[2], heading_of(now) - heading_of(then)
    came = float(ahead @ (now.position_cm - then.position_cm))
    return Correction(then.t_s, turned - by_wheels, SIGMA_RAD, way - came, SIGMA_CM)


@pytest.mark.parametrize("late_ms", [-40, 40])
def test_after_some_starts_and_turns_a_delay_is_taken_back(late_ms: int) -> None:
    used = [1e3 * drive(late_ms / 1e3, seed).late_s for seed in SEEDS]
    print(f"\n{late_ms} ms: {np.round(used, 1)} used")
    assert max(np.abs(np.array(used) - late_ms)) < 12.0


@pytest.mark.parametrize("late_ms", [-40, 0, 40])
def test_its_standard_error_is_honest(late_ms: int) -> None:
    found = [drive(late_ms / 1e3, seed).estimate for seed in SEEDS]
    assert all(abs(best - late_ms / 1e3) < 2.5 * sigma < 0.02 for best, sigma in found)


def test_without_a_delay_next_to_none_is_used() -> None:
    assert max(abs(drive(0.0, seed).late_s) for seed in SEEDS) < 0.003


def test_pictures_whose_motion_is_far_off_do_little_harm() -> None:
    assert abs(drive(0.04, 0, wild=0.1).late_s - drive(0.04, 0).late_s) < 0.008


def test_driving_straight_on_tells_little_and_changes_nothing() -> None:
    delay = drive(0.04, 1, seconds=12.0, steady=True)
    before = drive(0.04, 1, seconds=4.0, steady=True)
    assert delay.estimate == before.estimate


def test_the_delay_in_use_never_jumps() -> None:
    delay = Delay(PlanarWorld([]).body)
    delay.estimate = (0.08, 0.002)
    used = [stamp_s - delay.exposed_s(stamp_s) for stamp_s in np.arange(0.0, 20.0, 1 / FPS)]
    assert max(np.diff(used)) <= 0.01 / FPS + 1e-9
    assert used[-1] > 0.07
