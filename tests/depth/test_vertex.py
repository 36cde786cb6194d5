"""Depth of the net's vertices."""

from __future__ import annotations

import numpy as np
import pytest
from board_scene import LENS, Board, Camera, disc, rectangle, straight_path, turned

from host.depth.config import DepthConfig
from host.depth.motion import first_station, next_station
from host.depth.report import Declined, Estimate, VertexDepths
from host.depth.vertex import VertexMethod
from host.pose import Pose
from host.rbdn.snapshot import Snapshot

EXACT_POSES = DepthConfig(
    travel_sigma_cm=0.0, rotation_sigma_rad=0.0, rotation_sigma_share=0.0, timing_sigma_s=0.0
)
BOX = rectangle(7, (14.0, 9.0, 85.0), (20.0, 16.0))


def run(
    boards: list[Board], path: list[Pose], config: DepthConfig = EXACT_POSES, **camera: float
) -> tuple[VertexMethod, Snapshot, VertexDepths]:
    eye = Camera(boards, **camera)
    method, station = VertexMethod(LENS, config), None
    for pose in path:
        snapshot = eye.look(pose)
        station = (
            first_station(snapshot.seq, pose, config)
            if station is None
            else next_station(station, snapshot.seq, pose, config)
        )
        found = method.update(snapshot, station)
    return method, snapshot, found


def in_camera(points_cm: np.ndarray, pose: Pose) -> np.ndarray:
    return (points_cm - pose.position_cm) @ pose.rotation


def test_corners_are_found_in_space_on_a_straight_way():
    path = straight_path(11, 1.0)
    _, _, found = run([BOX], path)
    assert found.xyz_cm == pytest.approx(in_camera(BOX.corners_cm, path[-1]), rel=1e-6)


def test_two_frames_give_equation_10():
    path = straight_path(2, 10.0)
    _, snapshot, found = run([BOX], path)
    before = Camera([BOX]).look(path[0])
    y_i = before.vertices.xy_px[:, 1] - LENS.cy
    y_j = snapshot.vertices.xy_px[:, 1] - LENS.cy
    at_the_first_frame = 10.0 * y_j / (y_j - y_i)
    assert found.xyz_cm[:, 2] == pytest.approx(at_the_first_frame - 10.0, rel=1e-6)


def test_pitch_and_yaw_of_a_degree_are_taken_out():
    path = [
        turned(p, np.radians((-1) ** k), np.radians(0.5 * k)) for k, p in enumerate(straight_path(6, 2.0))
    ]
    _, _, found = run([BOX], path)
    assert found.xyz_cm == pytest.approx(in_camera(BOX.corners_cm, path[-1]), rel=1e-6)


def test_sideways_travel_shows_depth_too():
    path = straight_path(6, 2.0, (1, 0.5, 0))
    _, _, found = run([BOX], path)
    assert found.xyz_cm == pytest.approx(in_camera(BOX.corners_cm, path[-1]), rel=1e-6)


def test_without_motion_there_is_no_depth():
    _, _, found = run([BOX], [Pose.planar(0, 0, 0)] * 5)
    assert np.isnan(found.xyz_cm).all()


def test_turning_on_the_spot_shows_no_depth():
    path = [turned(Pose.planar(0, 0, 0), 0.0, 0.02 * k) for k in range(8)]
    _, _, found = run([BOX], path, vertex_noise_px=0.1)
    assert np.isnan(found.xyz_cm).all()


def test_a_corner_near_the_focus_of_expansion_is_less_sure():
    off_axis = rectangle(7, (12.0, 10.0, 85.0), (20.0, 16.0))
    _, _, found = run([off_axis], straight_path(11, 1.0), vertex_noise_px=0.1)
    from_focus = np.hypot(*off_axis.corners_cm[:, :2].T)
    assert np.argmax(found.sigma_cm) == np.argmin(from_focus)


def test_sigma_is_worth_what_it_says():
    path, misses = straight_path(9, 1.5), []
    for seed in range(60):
        _, _, found = run([BOX], path, vertex_noise_px=0.15, seed=seed)
        misses.append((found.xyz_cm[:, 2] - (85.0 - 12.0)) / found.sigma_cm)
    misses = np.abs(np.array(misses))
    assert 0.58 < (misses < 1).mean() < 0.8
    assert (misses < 2).mean() > 0.9


def test_doubt_about_rotation_is_doubt_about_depth():
    _, _, sure = run([BOX], straight_path(11, 1.0))
    _, _, unsure = run([BOX], straight_path(11, 1.0), DepthConfig(rotation_sigma_rad=0.0005))
    assert (unsure.sigma_cm[1:] > 3 * sure.sigma_cm[1:]).all()
    assert np.isnan(unsure.sigma_cm[0])


def test_a_corner_that_slides_along_an_edge_loses_its_sureness():
    _, _, steady = run([BOX], straight_path(8, 1.0), vertex_noise_px=0.05)
    wandering = Board(7, BOX.corners_cm + 0.0)
    config, eye = DepthConfig(), Camera([wandering], vertex_noise_px=0.05)
    method, station = VertexMethod(LENS, config), None
    for k, pose in enumerate(straight_path(8, 1.0)):
        wandering.corners_cm[2, 0] += 0.4 * np.sin(2.0 * k)
        snapshot = eye.look(pose)
        station = (
            first_station(k, pose, config) if station is None else next_station(station, k, pose, config)
        )
        found = method.update(snapshot, station)
    assert not found.sigma_cm[2] < 3 * steady.sigma_cm[2]


def test_a_region_is_as_far_as_its_corners():
    method, snapshot, found = run([BOX], straight_path(11, 1.0), vertex_noise_px=0.05)
    answer = method.region(snapshot.regions[0], snapshot, found, 1.0)
    assert isinstance(answer, Estimate)
    assert answer.depth_cm == pytest.approx(75.0, rel=0.01)


def test_a_polygon_on_a_round_outline_has_no_corners():
    method, snapshot, found = run([disc(7, (14, 9, 85), 9.0)], straight_path(11, 1.0))
    answer = method.region(snapshot.regions[0], snapshot, found, 1.0)
    assert isinstance(answer, Declined)
    assert "corners" in answer.reason


def test_corners_of_what_lies_behind_are_not_used():
    method, snapshot, found = run([BOX], straight_path(11, 1.0))
    answer = method.region(snapshot.regions[0], snapshot, found, 0.2)
    assert isinstance(answer, Declined)
    assert "nearer" in answer.reason


def test_an_empty_net_is_no_trouble():
    _, _, found = run([rectangle(7, (0, 0, 50), (10, 10))], straight_path(1, 1.0))
    assert found.xyz_cm.shape == (4, 3)
