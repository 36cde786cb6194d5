"""Slanted faces, walls and floors: 1/Z = a + b x + c y, and depth as the mean over what is seen."""

from __future__ import annotations

import numpy as np
import pytest
from drives import WALL, Run, ahead, drive, wall
from solid_scene import Ball, Eye, board, patch, room

SEEDS = range(6)


def rms_error(eye: Eye, name: int, frames: int = 11, length_cm: float = 10.0) -> float:
    """Relative error over seeds of one region's depth in the last frame; inf where it has none once."""
    errors = [drive(eye.again(s), ahead(frames, length_cm)).errors().get(name, np.inf) for s in SEEDS]
    return float(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.parametrize("degrees", [-60, -45, -30, -15, 0, 15, 30, 45, 60])
def test_a_face_at_any_slant_is_right_within_two_percent(degrees: float):
    face = board(7, (6.0, 4.0, 80.0), (24.0, 16.0), np.radians(degrees))
    assert rms_error(Eye([face, wall()], noise_px=0.1), 7) < 0.02


@pytest.mark.parametrize("degrees", [-60, -30, 30, 60])
def test_a_face_that_leans_is_right_within_two_percent(degrees: float):
    a = np.radians(degrees)
    low, high = (z * np.array([0.0, np.cos(a), np.sin(a)]) for z in (10.0, -10.0))
    centre, side = np.array([-5.0, 2.0, 80.0]), np.array([9.0, 0.0, 0.0])
    face = patch(7, [centre + high - side, centre + high + side, centre + low + side, centre + low - side])
    assert rms_error(Eye([face, wall()], noise_px=0.1), 7) < 0.02


def corridor() -> Eye:
    """A room with a rug, a poster on either wall, and a picture on the wall ahead."""
    rug = patch(10, [(-18, 13.9, 120), (10, 13.9, 120), (10, 13.9, 70), (-18, 13.9, 70)])
    left = patch(11, [(-42, -25, 125), (-42, -25, 185), (-42, 5, 185), (-42, 5, 125)])
    right = patch(12, [(44, -30, 140), (44, -30, 200), (44, 0, 200), (44, 0, 140)])
    ahead_of_us = board(13, (5, -20, 219), (40, 30))
    return Eye([*room(1, 220.0, 14.0, 60.0), rug, left, right, ahead_of_us], noise_px=0.1)


@pytest.mark.parametrize("name", [10, 11, 12], ids=["rug", "poster left", "poster right"])
def test_patches_of_floor_and_walls_are_right_within_two_percent(name: int):
    assert rms_error(corridor(), name, frames=16, length_cm=15.0) < 0.02


@pytest.mark.parametrize("name", [1, 3, 4], ids=["floor", "left wall", "right wall"])
def test_floor_and_walls_that_leave_the_picture_are_right_or_decline(name: int):
    for seed in SEEDS:
        run = drive(corridor().again(seed), ahead(16, 15.0))
        found = run.region(name)
        if found.depth_cm is not None:
            error = run.errors().get(name, 0.0)  # not judged where it is seen in pieces
            assert abs(error) < max(0.02, 2.5 * found.sigma_cm / found.depth_cm)


@pytest.mark.parametrize("turned", [-50, 50])
def test_a_face_cut_by_the_border_is_right_within_three_percent(turned: float):
    face = board(7, (33.0, 4.0, 85.0), (26.0, 18.0), np.radians(turned))
    assert rms_error(Eye([face, wall()], noise_px=0.1), 7, frames=16) < 0.03


def slanted_run(degrees: float, seed: int = 0) -> Run:
    face = board(7, (6.0, 4.0, 80.0), (24.0, 16.0), np.radians(degrees))
    return drive(Eye([face, wall()], noise_px=0.1, seed=seed), ahead(11, 10.0))


@pytest.mark.parametrize("degrees", [-60, -30, 30, 60])
def test_the_slope_of_a_slanted_face_is_the_planes(degrees: float):
    run = slanted_run(degrees)
    slope = run.region(7).slope
    assert slope is not None
    # on the plane n . X = d, 1/Z = (n . ray) / d
    a = np.radians(degrees)
    normal = np.array([-np.sin(a), 0.0, np.cos(a)])
    distance = normal @ (np.array([6.0, 4.0, 80.0]) - run.poses[-1].position_cm)
    assert slope[0] == pytest.approx(normal[0] / distance / run.eye.lens.fx, rel=0.25)
    assert abs(slope[1]) < 0.35 * abs(slope[0])


def test_a_frontal_face_has_no_slope_worth_two_percent():
    for seed in SEEDS:
        run = slanted_run(0.0, seed)
        slope = run.region(7).slope
        if slope is not None:
            assert np.hypot(*slope) * 60 * 70 < 0.1  # relative change of 1/Z over half its width


def test_a_ball_has_its_silhouette_behind_its_surface_and_both_are_told():
    ball = Ball(7, np.array([-8.0, 3.0, 75.0]), 8.0)
    for seed in SEEDS:
        run = drive(Eye([ball, wall()], noise_px=0.1, seed=seed), ahead(11, 10.0))
        found, rim = run.region(7), ball.rim(run.poses[-1])
        assert rim is not None
        assert found.silhouette_cm == pytest.approx(rim.depth_cm.mean(), rel=0.015)
        assert found.depth_cm == pytest.approx(run.eye.truth(run.poses[-1])[7], rel=0.025)


def test_the_wall_behind_everything_is_right_or_has_no_depth():
    for seed in SEEDS:
        run = drive(
            Eye(
                [board(7, (6, 4, 80), (24, 16)), board(8, (-25, 0, 110), (20, 30)), wall()],
                noise_px=0.1,
                seed=seed,
            ),
            ahead(11, 10.0),
        )
        assert run.region(WALL).depth_cm is None
