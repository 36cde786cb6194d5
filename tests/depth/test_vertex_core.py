"""Depth of the net's vertices, in the depth engine."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from board_scene import LENS, Board, Camera, disc, rectangle, straight_path, turned
from parts import EXACT, Noise, Run

from host.pose import Pose
from host.rbdn.snapshot import Snapshot, Vertices

BOX = rectangle(7, (14.0, 9.0, 85.0), (20.0, 16.0))
X, Y, Z, SIGMA, SENSITIVITY = range(5)


def run(
    boards: list[Board], path: list[Pose], noise: Noise = EXACT, **camera: float
) -> tuple[Run, Snapshot, np.ndarray]:
    """Both methods after a path, the last snapshot, and what is said of its vertices, (N, 5)."""
    eye, out = Camera(boards, **camera), Run(LENS, noise)
    for pose in path:
        snapshot = eye.look(pose)
        found = out.see(snapshot, pose)
        out.frames()
    return out, snapshot, found


def in_camera(points_cm: np.ndarray, pose: Pose) -> np.ndarray:
    return (points_cm - pose.position_cm) @ pose.rotation


def test_corners_are_found_in_space_on_a_straight_way():
    path = straight_path(11, 1.0)
    _, _, found = run([BOX], path)
    assert found[:, :3] == pytest.approx(in_camera(BOX.corners_cm, path[-1]), rel=1e-6)


def test_two_frames_give_equation_10():
    path = straight_path(2, 10.0)
    _, snapshot, found = run([BOX], path)
    before = Camera([BOX]).look(path[0])
    y_i = before.vertices.xy_px[:, 1] - LENS.cy
    y_j = snapshot.vertices.xy_px[:, 1] - LENS.cy
    at_the_first_frame = 10.0 * y_j / (y_j - y_i)
    assert found[:, Z] == pytest.approx(at_the_first_frame - 10.0, rel=1e-6)


def test_the_sensitivity_is_that_of_equation_13_in_both_coordinates():
    path = straight_path(11, 1.0)
    _, snapshot, found = run([BOX], path)
    before = Camera([BOX]).look(path[-2])
    moved = np.linalg.norm(snapshot.vertices.xy_px - before.vertices.xy_px, axis=1)  # over the last cm
    assert found[:, SENSITIVITY] == pytest.approx(moved, rel=0.03)


def test_pitch_and_yaw_of_a_degree_are_taken_out():
    path = [
        turned(p, np.radians((-1) ** k), np.radians(0.5 * k)) for k, p in enumerate(straight_path(6, 2.0))
    ]
    _, _, found = run([BOX], path)
    assert found[:, :3] == pytest.approx(in_camera(BOX.corners_cm, path[-1]), rel=1e-6)


@pytest.mark.parametrize("way", [(1, 0.5, 0), (0, 0, -1), (1, 0, 1)])
def test_any_direction_of_travel_shows_depth(way: tuple[float, float, float]):
    path = straight_path(6, 2.0, way)
    _, _, found = run([BOX], path)
    assert found[:, :3] == pytest.approx(in_camera(BOX.corners_cm, path[-1]), rel=1e-6)


def test_without_motion_there_is_no_depth():
    _, _, found = run([BOX], [Pose.planar(0, 0, 0)] * 5)
    assert np.isnan(found).all()


def test_turning_on_the_spot_shows_no_depth():
    path = [turned(Pose.planar(0, 0, 0), 0.0, 0.02 * k) for k in range(8)]
    _, _, found = run([BOX], path, vertex_noise_px=0.1)
    assert np.isnan(found).all()


def test_a_corner_seen_from_one_place_only_has_no_depth():
    path = straight_path(6, 1.0)
    run_, eye = Run(LENS, EXACT), Camera([BOX])
    for pose in path[:-1]:
        run_.see(eye.look(pose), pose)
    newcomer = rectangle(9, (-14.0, 9.0, 85.0), (20.0, 16.0))
    eye.boards = [BOX, newcomer]
    found = run_.see(eye.look(path[-1]), path[-1])
    assert np.isfinite(found[:4]).all() and np.isnan(found[4:]).all()


def test_a_corner_near_the_focus_of_expansion_is_less_sure():
    off_axis = rectangle(7, (12.0, 10.0, 85.0), (20.0, 16.0))
    _, _, found = run([off_axis], straight_path(11, 1.0), vertex_noise_px=0.1)
    from_focus = np.hypot(*off_axis.corners_cm[:, :2].T)
    assert np.argmax(found[:, SIGMA]) == np.argmin(from_focus)
    assert np.argmin(found[:, SENSITIVITY]) == np.argmin(from_focus)


@pytest.mark.parametrize("frames", [2, 3, 9])
def test_sigma_is_worth_what_it_says(frames: int):
    path, misses = straight_path(frames, 12.0 / (frames - 1)), []
    for seed in range(80):
        _, _, found = run([BOX], path, vertex_noise_px=0.15, seed=seed)
        misses.append((found[1:, Z] - (85.0 - 12.0)) / found[1:, SIGMA])
    misses = np.abs(np.array(misses))
    assert 0.6 < (misses < 1).mean() < 0.8
    assert (misses < 2).mean() > 0.9


def test_corners_surer_than_promised_are_noticed():
    """The residuals of many frames tell: sigmas of 0.1 px for corners that err by 0.02 px are too large."""
    _, _, found = run([BOX], straight_path(12, 1.0), vertex_noise_px=0.02)
    _, _, noisy = run([BOX], straight_path(12, 1.0), vertex_noise_px=0.1)
    assert (found[1:, SIGMA] < 0.65 * noisy[1:, SIGMA]).all()


def test_doubt_about_rotation_is_doubt_about_depth():
    _, _, sure = run([BOX], straight_path(11, 1.0))
    _, _, unsure = run([BOX], straight_path(11, 1.0), Noise(0.0, 0.0005, 0.0, 0.0))
    assert (unsure[1:, SIGMA] > 2 * sure[1:, SIGMA]).all()
    assert not unsure[0, SIGMA] < 2 * sure[0, SIGMA]


def test_doubt_about_the_travelled_distance_is_doubt_about_depth():
    _, _, sure = run([BOX], straight_path(11, 1.0))
    _, _, unsure = run([BOX], straight_path(11, 1.0, sigma_z_cm=0.5))
    assert (unsure[1:, SIGMA] > np.hypot(sure[1:, SIGMA], 0.05 * 75)).all()


def slide(corner: int, shift_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What is said of the box's vertices, one displaced by (F, 2) px, and where they are."""
    path, eye, method = (
        straight_path(len(shift_px), 1.0),
        Camera([BOX], vertex_noise_px=0.05),
        Run(LENS, EXACT),
    )
    for pose, shift in zip(path, shift_px, strict=True):
        snapshot = eye.look(pose)
        snapshot.vertices.xy_px[corner] += shift
        found = method.see(snapshot, pose)
        method.frames()
    return found, in_camera(BOX.corners_cm, path[-1])


@pytest.mark.parametrize("bad", [[0], [4], [3, 4, 5], [0, 5, 9], [0, 1, 2, 3]])
def test_frames_in_which_a_vertex_sat_on_another_corner_do_not_count(bad: list[int]):
    shift = np.zeros((12, 2))
    shift[bad] = (-7.0, 12.0)
    found, truth = slide(2, shift)
    assert abs(found[2, Z] - truth[2, 2]) < 3 * found[2, SIGMA]
    assert found[2, Z] == pytest.approx(truth[2, 2], rel=0.05)


def test_a_vertex_that_has_just_slid_away_has_no_depth():
    shift = np.zeros((12, 2))
    shift[-1] = (-7.0, 12.0)
    found, truth = slide(2, shift)
    assert np.isnan(found[2, Z])
    assert found[[1, 3], Z] == pytest.approx(truth[[1, 3], 2], rel=0.05)


@pytest.mark.parametrize("since", [2, 4, 6, 8])
def test_after_a_vertex_slid_its_depth_is_that_of_the_new_place_or_none(since: int):
    """On a flat board any of its places has the same depth."""
    shift = np.zeros((12, 2))
    shift[since:] = (-9.0, 4.0)
    found, truth = slide(2, shift)
    assert np.isnan(found[2, Z]) or abs(found[2, Z] - truth[2, 2]) < 3 * found[2, SIGMA]


def test_a_corner_that_slides_along_an_edge_loses_its_sureness():
    _, _, steady = run([BOX], straight_path(8, 1.0), vertex_noise_px=0.05)
    shift = np.zeros((8, 2))
    shift[:, 0] = 1.8 * np.cumsum(np.sin(2.0 * np.arange(8)))
    found, _ = slide(2, shift)
    assert not found[2, SIGMA] < 3 * steady[2, SIGMA]


# --- Regions ---------------------------------------------------------------------------------------


def test_a_region_is_as_far_as_its_corners():
    method, _, _ = run([BOX], straight_path(11, 1.0), vertex_noise_px=0.05)
    answer = method.region()
    assert answer.known
    assert answer.depth_cm == pytest.approx(75.0, rel=0.02)
    assert abs(answer.depth_cm - 75.0) < 2 * answer.sigma_cm


@pytest.mark.parametrize("slant_deg", [0, 30, 60])
def test_a_slanted_face_has_the_mean_depth_of_its_surface(slant_deg: float):
    """The middle of the region in the image is nearer than the middle of the board."""
    board = rectangle(7, (8.0, 9.0, 85.0), (26.0, 16.0), np.radians(slant_deg))
    path = straight_path(11, 1.0)
    method, snapshot, _ = run([board], path)
    corners = in_camera(board.corners_cm, path[-1])
    normal = np.cross(corners[1] - corners[0], corners[3] - corners[0])
    loop = snapshot.regions[0].loops[0]
    x, y = np.meshgrid(np.arange(320), np.arange(240))
    inside = np.ones(x.shape, bool)
    for (ax, ay), (bx, by) in zip(loop, np.roll(loop, -1, axis=0), strict=True):
        inside &= (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0
    rays = np.column_stack([LENS.to_rays(np.column_stack([x[inside], y[inside]])), np.ones(inside.sum())])
    mean = (normal @ corners[0] / (rays @ normal)).mean()
    answer = method.region()
    assert answer.known
    # a slant is drawn back towards the frontal as far as the corners leave it open
    assert answer.depth_cm == pytest.approx(mean, rel=0.015)


def test_a_polygon_on_a_round_outline_has_no_corners():
    method, _, _ = run([disc(7, (14, 9, 85), 9.0)], straight_path(11, 1.0))
    assert "corners" in method.region().declined


def test_corners_of_what_lies_behind_are_not_used():
    method, _, _ = run([BOX], straight_path(11, 1.0))
    assert "nearer" in method.region(0, own_share=0.2).declined


def test_a_region_cut_by_the_border_declines():
    method, _, _ = run([rectangle(7, (36.0, 4.0, 85.0), (20.0, 16.0))], straight_path(5, 1.0))
    assert method.region().declined == "cut by the image border"


def test_one_corner_of_something_else_does_not_move_a_region():
    corners = BOX.corners_cm.copy()
    far_away = corners[1] + np.array([4.0, 8.0, 40.0])
    more = np.vstack([corners[:2], far_away, corners[2:]])
    method, _, _ = run([Board(7, more)], straight_path(11, 1.0))
    answer = method.region()
    assert not answer.known or abs(answer.depth_cm - 75.0) < 2 * answer.sigma_cm


def test_an_empty_net_is_no_trouble():
    full = Camera([BOX]).look(Pose.planar(0, 0, 0))
    none = Vertices(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros(0))
    empty = dataclasses.replace(full, regions=(), vertices=none)
    assert Run(LENS).see(empty, Pose.planar(0, 0, 0)).shape == (0, 5)
