"""Round things that the robot drives up to: their depth stays right when the border begins to cut them."""

from __future__ import annotations

import numpy as np
import pytest
from drives import LENS, ahead, drive
from solid_scene import Ball, Eye, board

from host.depth.config import DepthConfig
from host.depth.estimator import Estimator
from host.rbdn.snapshot import Event


@pytest.mark.parametrize("aside_cm", [9.0, -11.0])
@pytest.mark.parametrize("radius_cm", [10.0, 14.0])
def test_a_ball_that_the_border_cuts_keeps_the_relief_it_had_when_it_was_whole(radius_cm, aside_cm):
    ball = Ball(7, np.array([aside_cm, 0.0, 90.0]), radius_cm)
    eye = Eye([ball, board(1, (0, 0, 300), (3000, 3000))], noise_px=0.1)
    path = ahead(60, 50.0)
    run = drive(eye, path, path)
    snapshot = eye.look(run.poses[-1])
    assert next(r for r in snapshot.regions if r.id == 7).touches_border
    found, true_cm = run.last.regions[7], eye.truth(run.poses[-1])[7]
    assert found.depth_cm is not None
    print(f"{found.depth_cm:.1f} ± {found.sigma_cm:.1f} cm, truly {true_cm:.1f}")
    off_cm = abs(found.depth_cm - true_cm)
    assert off_cm < 2.5  # so that the robot can stop before it within 3 cm
    assert off_cm < 2 * found.sigma_cm


def test_a_region_that_has_merged_keeps_nothing_of_the_ball_it_was():
    wall, ball = board(1, (0, 0, 300), (3000, 3000)), Ball(7, np.array([20.0, 0.0, 130.0]), 8.0)
    before, after = (Eye([thing, wall], noise_px=0.1) for thing in (ball, board(7, (45, 0, 130), (60, 40))))
    estimator, path = Estimator(LENS, DepthConfig()), ahead(100, 60.0)
    for pose in path[:40]:
        estimator.update(before.look(pose), pose)
    merged = (Event(kind="merge", id=8, parent=7),)
    for n, pose in enumerate(path[40:80]):
        snapshot = after.look(pose, merged if n == 0 else ())
        found = estimator.update(snapshot, pose).regions[7]
    assert next(region for region in snapshot.regions if region.id == 7).touches_border
    assert found.depth_cm is not None
    assert abs(found.depth_cm - after.truth(path[79])[7]) < 2 * found.sigma_cm
