"""Pitch, yaw and travel that odometry does not know are found with the depths."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from drives import (
    TICK_SIGMA_CM,
    Run,
    ahead,
    before_the_wall,
    boards_before_a_wall,
    drive,
    shaken,
    ticked,
    tilted,
)
from solid_scene import Eye, board

from host.pose import Pose

SCENES = range(5)


def look_at(scene: int, noise_px: float = 0.1) -> Eye:
    return Eye(boards_before_a_wall(scene), noise_px=noise_px, vertex_noise_px=noise_px, seed=scene)


def rms(errors: list[np.ndarray]) -> float:
    """Over everything; what has no depth counts as wholly wrong."""
    return float(np.sqrt(np.mean(np.square(np.nan_to_num(np.concatenate(errors), nan=1.0)))))


def median(errors: list[np.ndarray]) -> float:
    return float(np.median(np.abs(np.nan_to_num(np.concatenate(errors), nan=1.0))))


def shaken_run(scene: int, degrees: float, frames: int = 11) -> Run:
    path = ahead(frames, 10.0)
    return drive(look_at(scene), shaken(path, degrees, scene), path)


def turns_deg(cameras: list[Pose]) -> np.ndarray:
    """Turn about x and y from each frame to the next, (N - 1, 2)."""
    steps = [a.rotation.T @ b.rotation for a, b in pairwise(cameras)]
    return np.degrees([(step[2, 1], step[0, 2]) for step in steps])


@pytest.mark.parametrize("degrees", [0.2, 1.0])
def test_an_unknown_turn_of_a_degree_a_frame_is_found(degrees: float):
    # what is left is the camera's angle to its way: known to a tenth of a degree, and better with every frame
    off = []
    for s in SCENES:
        run = shaken_run(s, degrees, 16)
        off.append((turns_deg([r.motion.camera for r in run.reports]) - turns_deg(run.poses))[8:])
    assert np.median(np.abs(off)) < 0.1 * degrees


@pytest.mark.parametrize("degrees", [0.2, 1.0])
def test_an_unknown_turn_makes_depth_at_most_half_as_bad_again(degrees: float):
    path, known, unknown = ahead(11, 10.0), [], []
    for scene in SCENES:
        for seed in range(2):
            eye = look_at(scene).again(10 * scene + seed)
            known.append(before_the_wall(drive(eye, path)))
            unknown.append(before_the_wall(drive(eye, shaken(path, degrees, 10 * scene + seed), path)))
    assert rms(unknown) < 1.5 * rms(known)


def test_four_regions_are_enough_for_the_turn():
    places = [(-18, -10, 80), (16, -9, 70), (-15, 12, 95), (14, 10, 120)]
    things = [board(10 + k, p, (14.0, 11.0)) for k, p in enumerate(places)]
    path, errors = ahead(11, 10.0), []
    for seed in range(6):
        run = drive(Eye(things, noise_px=0.1, seed=seed), shaken(path, 1.0, seed), path)
        errors.append(before_the_wall(run))
    assert median(errors) < 0.01
    assert rms(errors) < 0.02


def test_one_region_alone_and_an_unknown_turn_give_no_wrong_claim():
    path = ahead(11, 10.0)
    for seed in range(8):
        eye = Eye([board(10, (12.0, 6.0, 90.0), (16.0, 14.0))], noise_px=0.1, seed=seed)
        told = [Pose(p.rotation, p.position_cm, p.t_s, 0.0, np.radians(1.0)) for p in path]
        run = drive(eye, shaken(path, 1.0, seed), told)
        for frame in range(len(path)):
            found = run.region(10, frame)
            if found.depth_cm is not None:
                true = eye.truth(run.poses[frame])[10]
                assert abs(found.depth_cm - true) < 3.5 * found.sigma_cm


def test_after_few_frames_sigma_says_what_the_encoder_is_worth():
    ratios, sigmas = [], []
    for s in SCENES:
        for phase in range(4):
            path = ahead(3, 7.7)
            run = drive(look_at(s).again(phase), path, ticked(path, 100 * s + phase, told=True))
            truth = run.eye.truth(run.poses[-1])
            for name, found in run.last.regions.items():
                if found.depth_cm is not None and name in truth:
                    ratios.append((found.depth_cm - truth[name]) / found.sigma_cm)
                    sigmas.append(found.sigma_cm / found.depth_cm)
    assert len(ratios) > 70
    assert np.mean(np.abs(ratios) < 2) > 0.9
    # two readings of 0.14 cm each in 8 cm
    assert 0.015 < np.median(sigmas) < 0.06


def test_the_travel_is_found_where_odometry_rounds_it():
    path, off = ahead(30, 9.8), []
    for s in SCENES:
        run = drive(look_at(s), path, ticked(path, s))
        solved = [r.motion.camera.position_cm[2] for r in run.reports]
        late = (np.array(solved) - [p.position_cm[2] for p in path])[12:]
        # but for the offset and the scale of all
        off.append(late - np.polyval(np.polyfit(np.arange(18), late, 1), np.arange(18)))
    assert np.sqrt(np.mean(np.square(off))) < 0.4 * TICK_SIGMA_CM


def test_a_camera_that_looks_down_is_no_trouble():
    path = [tilted(p, -0.15, 0.1) for p in ahead(11, 10.0)]
    errors = [before_the_wall(drive(look_at(s), path)) for s in SCENES]
    assert np.nanmedian(np.abs(np.concatenate(errors))) < 0.01


def test_what_odometry_knows_well_is_left_alone():
    for s in SCENES:
        run = drive(look_at(s), ahead(11, 10.0))
        assert np.degrees(np.hypot(run.last.motion.pitch_rad, run.last.motion.yaw_rad)) < 0.02
        assert abs(run.last.motion.travel_cm) < 0.1
