"""The whole room, from snapshots and poses to depths."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from board_scene import LENS, WALL, Camera, disc, rectangle, straight_path

from host.depth.config import DepthConfig
from host.depth.estimator import Estimator
from host.depth.report import DepthReport
from host.pose import Pose
from host.rbdn.snapshot import Contour, Event, Snapshot, Vertices

RED = rectangle(7, (-15.75, -3.8, 85.0), (20.5, 25.0))
GREEN = rectangle(8, (16.0, -3.3, 85.0), (15.0, 23.9), rgb=(40.0, 180.0, 60.0))


def drive(path: list[Pose], **camera: float) -> list[DepthReport]:
    """Reports of a run towards two boxes, as in the paper's first experiment."""
    eye, estimator = Camera([RED, GREEN], **camera), Estimator(LENS, DepthConfig())
    return [estimator.update(eye.look(pose), pose) for pose in path]


def test_both_boxes_of_the_first_experiment_are_found_within_half_a_percent():
    last = drive(straight_path(11, 1.0), noise_px=0.1, vertex_noise_px=0.1)[-1]
    for box in (7, 8):
        found = last.regions[box]
        assert found.depth_cm == pytest.approx(75.0, rel=5e-3)
        assert found.sigma_cm is not None and 0 < found.sigma_cm < 3.0
        assert set(found.estimates) == {"area", "vertex", "outline"}
        assert found.method in found.estimates


def test_all_eight_corners_are_found_within_two_percent():
    last = drive(straight_path(11, 1.0), noise_px=0.1, vertex_noise_px=0.1)[-1]
    assert last.vertices.xyz_cm[:, 2] == pytest.approx(np.full(8, 75.0), rel=0.02)


def test_every_region_has_a_depth_or_a_reason():
    for report in drive(straight_path(4, 2.0), noise_px=0.1):
        for region in report.regions.values():
            assert (region.depth_cm is None) == (region.sigma_cm is None) == (region.method is None)
            assert region.depth_cm is not None or region.method_note


def test_the_first_frame_has_no_depth():
    first = drive(straight_path(1, 1.0))[0]
    assert all(r.depth_cm is None for r in first.regions.values())
    assert np.isnan(first.vertices.xyz_cm).all()


def test_a_standing_robot_never_gets_surer():
    way = straight_path(8, 1.0)
    reports = drive(way + [way[-1]] * 30, noise_px=0.2, vertex_noise_px=0.2)
    sigma = [r.regions[7].sigma_cm for r in reports[7:]]
    assert min(sigma) >= sigma[0]


def test_the_wall_behind_has_no_depth_of_its_own():
    assert drive(straight_path(11, 1.0), noise_px=0.1)[-1].regions[WALL].depth_cm is None


def test_a_region_that_comes_back_under_its_name_still_has_its_depth():
    path = straight_path(12, 1.0)
    eye, estimator = Camera([RED, GREEN], noise_px=0.1), Estimator(LENS, DepthConfig())
    for k, pose in enumerate(path):
        snapshot = eye.look(pose)
        if 6 <= k < 11:
            snapshot = without(snapshot, 7)
        report = estimator.update(snapshot, pose)
        assert (7 in report.regions) == (not 6 <= k < 11)
    assert report.regions[7].depth_cm == pytest.approx(74.0, rel=0.02)


def test_what_a_split_leaves_begins_anew():
    path = straight_path(10, 1.0)
    eye, estimator = Camera([RED, GREEN], noise_px=0.1), Estimator(LENS, DepthConfig())
    for k, pose in enumerate(path):
        events = (Event("split", 8, 7),) if k == 9 else ()
        report = estimator.update(eye.look(pose, events), pose)
    assert "area" in report.regions[7].declined
    assert report.regions[7].depth_cm == pytest.approx(76.0, rel=0.02)


def test_an_empty_image_is_no_trouble():
    empty = Snapshot(
        0,
        (),
        Vertices(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros(0)),
        Contour(
            np.zeros((0, 2)),
            np.zeros((0, 2)),
            np.zeros(0, np.int64),
            np.zeros(0, np.int64),
            np.zeros(0),
            np.zeros(0),
        ),
        (),
        0,
        0.0,
        0.0,
    )
    estimator = Estimator(LENS, DepthConfig())
    for k, pose in enumerate(straight_path(3, 1.0)):
        report = estimator.update(dataclasses.replace(empty, seq=k), pose)
        assert report.regions == {}
        assert len(report.vertices.ids) == 0


def test_a_net_that_empties_and_fills_again_is_no_trouble():
    eye, estimator = Camera([RED, GREEN], noise_px=0.1), Estimator(LENS, DepthConfig())
    for k, pose in enumerate(straight_path(8, 1.5)):
        snapshot = eye.look(pose)
        if k in (2, 5):
            snapshot = without(without(without(snapshot, 7), 8), WALL)
        report = estimator.update(snapshot, pose)
    assert report.regions[7].depth_cm == pytest.approx(74.5, rel=0.02)


def test_the_same_run_gives_the_same_numbers():
    one, two = (drive(straight_path(6, 1.0), noise_px=0.1)[-1] for _ in range(2))
    assert one.regions == two.regions


def test_a_far_and_a_near_thing_are_told_apart():
    near, far = disc(7, (-6, 3, 40), 3.0), rectangle(8, (25.0, -10.0, 160.0), (30.0, 30.0))
    eye, estimator = Camera([near, far], noise_px=0.1), Estimator(LENS, DepthConfig())
    for pose in straight_path(11, 1.0):
        report = estimator.update(eye.look(pose), pose)
    assert report.regions[7].silhouette_cm == pytest.approx(30.0, rel=0.01)
    assert report.regions[8].depth_cm == pytest.approx(150.0, rel=0.02)


def without(snapshot: Snapshot, region: int) -> Snapshot:
    """The snapshot with one region lost."""
    c = snapshot.contour
    keep = (c.left != region) & (c.right != region)
    contour = Contour(
        c.xy_px[keep], c.normal[keep], c.left[keep], c.right[keep], c.length_px[keep], c.sigma_px[keep]
    )
    regions = tuple(r for r in snapshot.regions if r.id != region)
    return dataclasses.replace(snapshot, regions=regions, contour=contour)
