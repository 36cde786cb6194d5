"""What moves by itself, or is tracked wrongly, is named and does not disturb the rest."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from drives import FIRST, Run, ahead, boards_before_a_wall, drive, shaken
from solid_scene import Eye

from host.pose import Pose
from host.rbdn.snapshot import Snapshot

MOVER = FIRST + 1
FRAMES = 13


@cache
def with_mover(scene: int, step_cm: tuple[float, float, float], shaken_deg: float = 0.0) -> Run:
    """A drive before boards of which one moves by so much a frame."""
    still = boards_before_a_wall(scene)
    eye = Eye(still, noise_px=0.1, vertex_noise_px=0.1, seed=scene)

    def look(k: int, eye: Eye, pose: Pose) -> Snapshot:
        by = tuple((k - FRAMES // 2) * s for s in step_cm)
        eye.things = [t.moved(by) if t.id == MOVER else t for t in still]
        return eye.look(pose)

    path = ahead(FRAMES, 12.0)
    true = shaken(path, shaken_deg, scene) if shaken_deg else path
    return drive(eye, true, path, change=look)


STEPS = [(0.4, 0, 0), (0, -0.35, 0), (0.3, 0.25, 0), (-0.4, 0, 0.5)]  # none comes before another


@pytest.mark.parametrize("shaken_deg", [0.0, 1.0])
@pytest.mark.parametrize("step_cm", STEPS, ids=str)
def test_a_thing_that_moves_does_not_disturb_the_others(
    step_cm: tuple[float, float, float], shaken_deg: float
):
    errors = []
    for scene in range(3):
        found = with_mover(scene, step_cm, shaken_deg).errors()
        errors += [found.get(FIRST + k, np.nan) for k in range(6) if FIRST + k != MOVER]
    assert np.isnan(errors).mean() < 0.1
    assert np.nanmedian(np.abs(errors)) < 0.01
    assert np.nanmax(np.abs(errors)) < 0.04


@pytest.mark.parametrize("step_cm", STEPS, ids=str)
def test_nothing_that_stands_is_called_moving(step_cm: tuple[float, float, float]):
    for scene in range(3):
        run = with_mover(scene, step_cm)
        for report in run.reports:
            assert not [n for n, found in report.regions.items() if found.moving and n not in (MOVER, 1)]


def test_where_nothing_moves_nothing_is_called_moving():
    for scene in range(6):
        eye = Eye(boards_before_a_wall(scene), noise_px=0.2, vertex_noise_px=0.2, seed=scene)
        path = ahead(11, 10.0)
        for run in (drive(eye, path), drive(eye.again(7), shaken(path, 1.0, scene), path)):
            assert not [n for report in run.reports for n, found in report.regions.items() if found.moving]


def test_a_thing_that_moves_while_the_robot_stands_has_no_new_depth():
    still = boards_before_a_wall(0)
    eye = Eye(still, noise_px=0.1)

    def look(k: int, eye: Eye, pose: Pose) -> Snapshot:
        eye.things = [t.moved((0.5 * k, 0.0, 0.0)) if t.id == MOVER else t for t in still]
        return eye.look(pose)

    run = drive(eye, [ahead(2, 1.0)[0]] * 12, change=look)
    assert all(found.depth_cm is None for found in run.last.regions.values())


def test_a_thing_that_stops_gets_its_depth_back():
    still = boards_before_a_wall(2)
    eye = Eye(still, noise_px=0.1)

    def look(k: int, eye: Eye, pose: Pose) -> Snapshot:
        eye.things = [t.moved((0.8 * min(k, 6), 0.0, 0.0)) if t.id == MOVER else t for t in still]
        return eye.look(pose)

    run = drive(eye, ahead(31, 24.0), change=look)
    found = run.region(MOVER)
    if found.depth_cm is not None and not found.moving:
        assert abs(run.errors()[MOVER]) < max(0.03, 3 * found.sigma_cm / found.depth_cm)
    assert run.region(FIRST).depth_cm is not None


def mistracked(scene: int, jump_px: float, drift_px: float) -> Run:
    """A drive on which one region's outline jumps at frame 6 and creeps from there."""
    eye = Eye(boards_before_a_wall(scene), noise_px=0.1, seed=scene)

    def look(k: int, eye: Eye, pose: Pose) -> Snapshot:
        seen = eye.look(pose)
        if k < 6:
            return seen
        by = np.array([jump_px + drift_px * (k - 6), 0.5 * jump_px])
        mine = (seen.contour.left == MOVER) | (seen.contour.right == MOVER)
        xy = seen.contour.xy_px + mine[:, None] * by
        regions = tuple(
            replace(r, loops=tuple(loop + by for loop in r.loops)) if r.id == MOVER else r
            for r in seen.regions
        )
        nodes = np.concatenate([n for r in seen.regions if r.id == MOVER for n in r.loop_vertices])
        moved = np.isin(seen.vertices.ids, nodes)
        vertices = replace(seen.vertices, xy_px=seen.vertices.xy_px + moved[:, None] * by)
        return replace(seen, regions=regions, vertices=vertices, contour=replace(seen.contour, xy_px=xy))

    return drive(eye, ahead(FRAMES, 12.0), change=look)


@pytest.mark.parametrize(("jump_px", "drift_px"), [(3.0, 0.0), (8.0, 0.0), (0.0, 1.0), (2.0, -0.7)])
def test_a_region_that_is_tracked_wrongly_does_not_disturb_the_others(jump_px: float, drift_px: float):
    errors = []
    for scene in range(3):
        found = mistracked(scene, jump_px, drift_px).errors()
        errors += [found.get(FIRST + k, np.nan) for k in range(6) if FIRST + k != MOVER]
    assert np.isnan(errors).mean() < 0.1
    assert np.nanmedian(np.abs(errors)) < 0.01
    assert np.nanmax(np.abs(errors)) < 0.03


@pytest.mark.parametrize("step_cm", [(0.3, 0.25, 0), (-0.3, -0.25, 0)], ids=str)
def test_a_thing_that_moves_across_is_named(step_cm: tuple[float, float, float]):
    for scene in range(3):
        assert with_mover(scene, step_cm).region(MOVER).moving
