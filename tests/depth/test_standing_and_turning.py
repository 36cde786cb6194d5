"""What no travel can show is not claimed, and what was known is kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drives import FIRST, Run, ahead, before_the_wall, boards_before_a_wall, drive, tilted
from solid_scene import Eye

from host.pose import Pose


def look_at(scene: int, noise_px: float = 0.1) -> Eye:
    return Eye(boards_before_a_wall(scene), noise_px=noise_px, vertex_noise_px=noise_px, seed=scene)


def confident(run: Run, share: float = 0.3) -> list[tuple[int, int, float, float]]:
    """Frame, region, depth and sigma of every finite depth whose sigma is below a share of it."""
    return [
        (k, name, found.depth_cm, found.sigma_cm)
        for k, report in enumerate(run.reports)
        for name, found in report.regions.items()
        if found.depth_cm is not None and found.sigma_cm < share * found.depth_cm
    ]


def hand_held(seed: int, sway_cm: float, degrees: float, frames: int = 30) -> list[Pose]:
    """A camera held in the hand that turns to and fro, sways a little and is where the hand is."""
    rng = np.random.default_rng(seed)
    t = np.arange(frames) / 10
    phase, pace = rng.uniform(0, 2 * np.pi, 6), rng.uniform(1.5, 3.5, 6)
    waves = np.sin(phase + np.outer(t, pace)) - np.sin(phase)
    path = []
    for k in range(frames):
        turned = tilted(Pose(np.eye(3), np.zeros(3), t[k]), *(np.radians(degrees) * waves[k, :3]))
        path.append(replace(turned, position_cm=sway_cm * waves[k, 3:] / 2))
    return path


@pytest.mark.parametrize("jitter_cm", [0.5, 1.0])
def test_turning_by_hand_on_the_spot_shows_no_depth(jitter_cm: float):
    for seed in range(4):
        path = hand_held(seed, 0.0, 8.0)
        rng = np.random.default_rng(seed)
        said = [replace(p, position_cm=p.position_cm + rng.normal(0, jitter_cm, 3)) for p in path]
        assert confident(drive(look_at(seed), path, said)) == []


def test_turning_on_the_spot_with_good_odometry_shows_no_depth():
    for seed in range(3):
        path = [tilted(Pose(np.eye(3), np.zeros(3), k / 10), 0.0, 0.02 * k) for k in range(15)]
        assert confident(drive(look_at(seed), path), 1.0) == []


def test_a_robot_that_never_moved_knows_no_depth():
    run = drive(look_at(0, 0.3), [ahead(2, 1.0)[0]] * 20)
    assert all(found.depth_cm is None for report in run.reports for found in report.regions.values())
    assert all(np.isnan(report.vertices.xyz_cm).all() for report in run.reports)


@pytest.mark.parametrize("noise_px", [0.1, 0.4])
def test_at_rest_nothing_gets_surer(noise_px: float):
    way = ahead(9, 8.0)
    rest = [replace(way[-1], t_s=way[-1].t_s + 0.1 * k) for k in range(1, 31)]
    run = drive(look_at(1, noise_px), way + rest)
    for name in run.reports[8].regions:
        sigma = [run.region(name, 8 + k).sigma_cm for k in range(31)]
        known = [s for s in sigma if s is not None]
        if sigma[0] is not None:
            assert min(known) >= 0.999 * sigma[0]
    for k in range(9, 39):
        before, now = run.reports[8].vertices, run.reports[k].vertices
        sigma = dict(zip(before.ids.tolist(), before.sigma_cm.tolist(), strict=True))
        for vertex, s in zip(now.ids.tolist(), now.sigma_cm.tolist(), strict=True):
            if np.isfinite(s) and np.isfinite(sigma.get(vertex, np.nan)):
                assert s > 0.8 * sigma[vertex]


def test_at_rest_the_depths_stay_what_they_were():
    way = ahead(9, 8.0)
    rest = [replace(way[-1], t_s=way[-1].t_s + 0.1 * k) for k in range(1, 11)]
    run = drive(look_at(2), way + rest)
    for name, found in run.reports[8].regions.items():
        if found.depth_cm is not None:
            for k in range(9, 19):
                assert run.region(name, k).depth_cm == pytest.approx(found.depth_cm, abs=found.sigma_cm)


def test_while_driving_depths_get_better_and_surer():
    early, late, early_sigma, late_sigma = [], [], [], []
    for scene in range(6):
        run = drive(look_at(scene), ahead(16, 15.0))
        early.append(before_the_wall(run, 4))
        late.append(before_the_wall(run, -1))
        for name in range(FIRST, FIRST + 6):
            one, two = run.region(name, 4), run.region(name, -1)
            if one.sigma_cm and two.sigma_cm:
                early_sigma.append(one.sigma_cm / one.depth_cm)
                late_sigma.append(two.sigma_cm / two.depth_cm)
    assert np.nanmedian(np.abs(np.concatenate(late))) < 0.5 * np.nanmedian(np.abs(np.concatenate(early)))
    assert np.median(late_sigma) < 0.6 * np.median(early_sigma)


def test_a_turn_on_the_way_is_survived():
    errors = []
    for scene in range(4):
        path = ahead(10, 9.0)
        corner = path[-1]
        path += [
            tilted(replace(corner, t_s=corner.t_s + 0.1 * k), 0.0, np.radians(1.5 * k)) for k in range(1, 11)
        ]
        heading = path[-1].rotation @ (0.0, 0.0, 1.0)
        path += [
            replace(path[19], position_cm=corner.position_cm + heading * k, t_s=path[19].t_s + 0.1 * k)
            for k in range(1, 9)
        ]
        run = drive(look_at(scene), path)
        for frame in range(10, 20):
            errors_there = run.errors(frame)
            for name, e in errors_there.items():
                assert abs(e) < max(
                    0.05, 3 * run.region(name, frame).sigma_cm / run.region(name, frame).depth_cm
                )
        errors.append(list(run.errors().values()))
    flat = np.concatenate(errors)
    assert len(flat) >= 12
    assert np.median(np.abs(flat)) < 0.01


def test_turning_on_the_spot_after_driving_keeps_the_depths():
    path = ahead(11, 10.0)
    path += [
        tilted(replace(path[-1], t_s=path[-1].t_s + 0.1 * k), 0.0, np.radians(1.0 * k)) for k in range(1, 8)
    ]
    run = drive(look_at(3), path)
    kept = [e for name, e in run.errors().items() if name >= FIRST]
    assert len(kept) >= 4
    assert np.max(np.abs(kept)) < 0.03


@pytest.mark.parametrize(
    "direction", [(0, 0, -1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (1, 0, 1), (-0.3, 0.1, -1)], ids=str
)
def test_depth_is_found_whatever_way_the_camera_goes(direction: tuple[float, float, float]):
    errors = [before_the_wall(drive(look_at(s), ahead(11, 10.0, direction))) for s in range(4)]
    flat = np.concatenate(errors)
    assert np.isfinite(flat).mean() > 0.8
    assert np.nanmedian(np.abs(flat)) < 0.006


def test_driving_to_and_fro_is_no_trouble():
    there = ahead(9, 8.0)
    path = [replace(p, t_s=0.1 * k) for k, p in enumerate(there + there[-2::-1] + there[1:])]
    for scene in range(3):
        run = drive(look_at(scene), path)
        assert np.nanmedian(np.abs(before_the_wall(run))) < 0.01
        assert np.isfinite(before_the_wall(run)).mean() > 0.8
