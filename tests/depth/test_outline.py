"""Depth from the motion of outlines."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from board_scene import LENS, WALL, Board, Camera, disc, rectangle, straight_path, turned

from host.camera.lens import Lens
from host.depth.config import DepthConfig
from host.depth.motion import first_station, next_station
from host.depth.outline import OutlineAnswers, OutlineDepth, OutlineMethod
from host.depth.ownership import edge_owners
from host.depth.report import Declined
from host.depth.surface import FLAT, may_be_one_face, relief_of
from host.pose import Pose

BOX = rectangle(7, (8.0, 4.0, 85.0), (20.0, 16.0))


def run(
    boards: list[Board],
    path: list[Pose],
    noise_px: float = 0.1,
    seed: int = 0,
    hidden_by: dict[int, int] | None = None,
    lens: Lens = LENS,
) -> OutlineAnswers:
    """What the method says after the last frame."""
    config = DepthConfig()
    eye = Camera(boards, lens, noise_px, seed=seed, hidden_by=hidden_by or {})
    method, station = OutlineMethod(lens, config), None
    for k, pose in enumerate(path):
        station = (
            first_station(k, pose, config) if station is None else next_station(station, k, pose, config)
        )
        said = method.update(eye.look(pose), station)
    return said


def found(said: OutlineAnswers, region: int = 7) -> OutlineDepth:
    answer = said.depths[region]
    assert isinstance(answer, OutlineDepth), answer
    return answer


def test_a_frontal_board_is_found_within_half_a_percent():
    for seed in range(5):
        said = run([BOX], straight_path(11, 1.0), seed=seed)
        assert found(said).silhouette_cm == pytest.approx(75.0, rel=5e-3)


def test_a_first_frame_says_nothing():
    answer = run([BOX], straight_path(1, 1.0)).depths[7]
    assert isinstance(answer, Declined)
    assert answer.reason == "no motion yet"


def test_turning_on_the_spot_shows_no_depth():
    path = [turned(Pose.planar(0, 0, 0, t_s=0.1 * k), 0.0, 0.02 * k) for k in range(8)]
    assert all(isinstance(a, Declined) for a in run([BOX], path).depths.values())


def test_known_rotation_on_the_way_changes_nothing():
    path = [turned(p, 0.02 * (-1) ** k, 0.01 * k) for k, p in enumerate(straight_path(8, 1.5))]
    pose = path[-1]
    true_depth = ((np.array([8.0, 4.0, 85.0]) - pose.position_cm) @ pose.rotation)[2]
    assert found(run([BOX], path)).silhouette_cm == pytest.approx(true_depth, rel=0.01)


def test_sideways_travel_shows_depth_too():
    said = run([BOX], straight_path(8, 1.5, (1, 0, 0.2)))
    assert found(said).silhouette_cm == pytest.approx(85.0 - 7 * 1.5 * 0.2 / np.hypot(1, 0.2), rel=0.01)


@pytest.mark.parametrize("degrees", [-60, -45, 45, 60])
def test_a_slanted_board_shows_its_slant(degrees: float):
    board = rectangle(7, (10.0, 4.0, 80.0), (24.0, 16.0), np.radians(degrees))
    said = run([board], straight_path(11, 1.0), noise_px=0.05)
    answer = found(said)
    assert answer.slope is not None
    # the right side is away where the angle is positive: 1/Z falls to the right
    assert np.sign(answer.slope[0]) == -np.sign(degrees)
    x, z = board.corners_cm[:, 0], board.corners_cm[:, 2] - 10.0
    columns = np.linspace(x[0] / z[0], x[1] / z[1], 201)
    a = (z[1] - z[0]) / (x[1] - x[0])
    depth_of_column = (z[0] - a * x[0]) / (1 - a * columns)
    height = 1 / depth_of_column
    true_mean = (depth_of_column * height).sum() / height.sum()
    assert answer.surface.depth_cm == pytest.approx(true_mean, rel=0.02)


def test_a_region_cut_by_the_border_is_measured_on_what_is_left():
    cut = rectangle(7, (36.0, 4.0, 85.0), (24.0, 16.0))
    answer = found(run([cut], straight_path(11, 1.0), noise_px=0.05))
    assert answer.silhouette_cm == pytest.approx(75.0, rel=0.05)


def test_what_lies_behind_does_not_take_the_outline_of_what_is_before_it():
    said = run([BOX], straight_path(11, 1.0))
    answer = said.depths[WALL]
    assert isinstance(answer, Declined)
    assert "nearer" in answer.reason
    assert said.own_share[7] == 1.0


def test_a_thing_of_another_colour_is_not_taken_for_the_same():
    config = DepthConfig()
    method = OutlineMethod(LENS, config)
    path = straight_path(6, 2.0)
    eye, station = Camera([BOX], noise_px=0.05), None
    for k, pose in enumerate(path):
        snapshot = eye.look(pose)
        if k == 5:
            other = dataclasses.replace(snapshot.regions[0], id=9, mean_rgb=(20.0, 200.0, 20.0))
            contour = dataclasses.replace(snapshot.contour, left=np.full_like(snapshot.contour.left, 9))
            snapshot = dataclasses.replace(snapshot, regions=(other, *snapshot.regions[1:]), contour=contour)
        station = (
            first_station(k, pose, config) if station is None else next_station(station, k, pose, config)
        )
        said = method.update(snapshot, station)
    assert isinstance(said.depths[9], Declined)


def test_a_new_name_for_the_same_thing_keeps_its_depth():
    config = DepthConfig()
    method = OutlineMethod(LENS, config)
    eye, station = Camera([BOX], noise_px=0.05), None
    for k, pose in enumerate(straight_path(8, 1.5)):
        snapshot = eye.look(pose)
        if k == 7:
            other = dataclasses.replace(snapshot.regions[0], id=9)
            contour = dataclasses.replace(snapshot.contour, left=np.full_like(snapshot.contour.left, 9))
            snapshot = dataclasses.replace(snapshot, regions=(other, *snapshot.regions[1:]), contour=contour)
        station = (
            first_station(k, pose, config) if station is None else next_station(station, k, pose, config)
        )
        said = method.update(snapshot, station)
    assert found(said, 9).silhouette_cm == pytest.approx(74.5, rel=0.01)


def test_a_lens_that_bends_is_straightened():
    bent = dataclasses.replace(LENS, distortion=(-0.2, 0.05, 0.001, -0.001, 0.0))
    said = run([BOX], straight_path(11, 1.0), noise_px=0.05, lens=bent)
    # straight pieces between the corners are not quite straight through such a lens
    assert found(said).silhouette_cm == pytest.approx(75.0, rel=0.015)


def test_sigma_of_a_flat_board_covers_its_error():
    z = []
    for seed in range(25):
        answer = found(run([BOX], straight_path(8, 1.0), noise_px=0.2, seed=seed))
        z.append((answer.surface.depth_cm - 78.0) / answer.surface.sigma_cm)
    assert (np.abs(z) < 2).mean() > 0.9


def test_a_round_outline_lies_behind_its_surface():
    answer = found(run([disc(7, (9, 5, 60), 6.0)], straight_path(8, 1.0)))
    assert answer.silhouette_cm == pytest.approx(53.0, rel=0.01)
    assert answer.surface.depth_cm < 0.97 * answer.silhouette_cm


def test_shapes_tell_round_from_flat():
    camera = Camera([BOX, disc(8, (-15, -8, 70), 6.0)])
    box, ball = camera.look(Pose.planar(0, 0, 0)).regions[:2]
    assert relief_of(box.loops[0], cut=False).k < 0.05
    assert relief_of(ball.loops[0], cut=False).k > 0.25
    assert may_be_one_face(box.loops[0])
    assert not may_be_one_face(ball.loops[0])
    assert relief_of(ball.loops[0], cut=True).sigma_k > FLAT.sigma_k


def owners(cost: tuple[float, float], rho: tuple[float, float], **more: tuple[float, float]) -> list[bool]:
    """Who may use the one boundary between two regions."""
    outline = more.get("outline", (200.0, 200.0))
    border = more.get("border", (False, False))
    mine = edge_owners(
        np.array([[0, 1]]),
        np.array([cost]),
        np.array(rho),
        np.array([60.0]),
        np.array(outline),
        np.array(border, bool),
    )
    return mine[0].tolist()


def test_the_side_whose_depth_explains_an_edge_owns_it():
    assert owners((0.6, 0.05), (1 / 100, 1 / 60)) == [False, True]


def test_the_nearer_of_two_that_both_explain_an_edge_owns_it():
    assert owners((0.05, 0.05), (1 / 60, 1 / 100)) == [True, False]


def test_two_faces_at_one_depth_share_their_edge():
    assert owners((0.05, 0.05), (1 / 60, 1 / 60.5)) == [True, True]


def test_what_surrounds_a_thing_at_the_same_depth_has_that_depth_from_it():
    assert owners((0.05, 0.05), (1 / 60, 1 / 60), outline=(60.0, 900.0)) == [True, False]


def test_what_is_cut_by_the_border_is_behind_what_is_not():
    assert owners((0.05, 0.05), (1 / 60, 1 / 60), border=(True, False)) == [False, True]


def test_a_side_without_depth_takes_nothing_away():
    assert owners((0.6, 0.05), (1 / 60, 0.0))[0]
