"""The rivals of bench.depth have a fair chance: on an easy drive each finds the depth it is asked for."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from bench.depth import OURS, PIXELS, Row, advantage, depth_over
from bench.depth_drives import SCENES, take
from bench.depth_rivals import RIVALS, Frames, pixel_count
from host.camera.lens import Lens
from host.depth.report import DepthReport, RegionDepth, VertexDepths
from host.pose import Pose
from host.rbdn.snapshot import Contour, Region, Snapshot, Vertices

LENS = Lens(320, 240, 371.0, 371.0, 159.5, 119.5)
TRAVEL_CM = np.arange(0.0, 10.5, 1.0)
NEAR_CM = 85.0
WALL = 128.0
AXIS = np.array([LENS.cx, LENS.cy])
FINE = 4  # the painted pictures have so many times the pixels


def painted(seed: int) -> np.ndarray:
    """Blots of all sizes, (H, W) float."""
    noise = np.random.default_rng(seed).normal(size=(240 * FINE, 320 * FINE))
    blots = sum(s * cv2.GaussianBlur(noise, (0, 0), s * FINE) for s in (1.5, 4.0, 9.0))
    return 128 + 40 * blots / blots.std()


def zoomed(picture: np.ndarray, factor: float) -> np.ndarray:
    """The frame in which all of a painted picture is so many times larger round the optical axis."""
    move = np.column_stack([factor * np.eye(2), (1 - factor) * ((AXIS + 0.5) * FINE - 0.5)])
    large = cv2.warpAffine(
        picture, move, picture.shape[1::-1], flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT
    )
    return cv2.resize(large, (320, 240), interpolation=cv2.INTER_AREA)


@pytest.fixture(scope="module")
def easy() -> tuple[Frames, list[np.ndarray]]:
    """A painted board before an even wall, and its masks."""
    board = painted(1)
    shape = np.zeros(board.shape)
    shape[75 * FINE : 180 * FINE, 60 * FINE : 150 * FINE] = 1.0
    grey, masks = [], []
    for travel in TRAVEL_CM:
        growth = NEAR_CM / (NEAR_CM - travel)
        share = zoomed(shape, growth)
        frame = share * zoomed(board, growth) + (1 - share) * WALL
        grey.append(np.clip(frame, 0, 255).astype(np.uint8))
        masks.append(share > 0.5)
    return Frames(grey, [Pose.planar(0, z, 0) for z in TRAVEL_CM], LENS), masks


@pytest.mark.parametrize("name", RIVALS)
def test_a_rival_finds_the_depth_of_a_painted_board(name: str, easy: tuple[Frames, list[np.ndarray]]):
    frames, masks = easy
    assert RIVALS[name](frames, masks[0]) == pytest.approx(NEAR_CM - TRAVEL_CM[-1], rel=0.03)


def test_counted_pixels_obey_equation_16():
    pixels = 1e4 * (NEAR_CM / (NEAR_CM - TRAVEL_CM)) ** 2
    assert pixel_count(TRAVEL_CM, pixels) == pytest.approx(NEAR_CM - 10.0)
    assert pixel_count(TRAVEL_CM, pixels[::-1]) is None, "what shrinks while one drives at it has no depth"


def test_corners_are_triangulated_also_where_the_camera_turns(easy: tuple[Frames, list[np.ndarray]]):
    frames, masks = easy
    yaw = math.radians(0.5)
    turn = LENS.matrix @ Pose.planar(0, 0, yaw).rotation.T @ np.linalg.inv(LENS.matrix)
    last = cv2.warpPerspective(frames.grey[-1], turn, (320, 240), flags=cv2.INTER_CUBIC)
    turned = Frames([*frames.grey[:-1], last], [*frames.poses[:-1], Pose.planar(0, 10, yaw)], LENS)
    assert RIVALS["KLT, triangulated"](turned, masks[0]) == pytest.approx(75.0, rel=0.03)


def test_a_rival_that_finds_nothing_says_so_instead_of_failing():
    blank = Frames([np.full((240, 320), 128, np.uint8)] * 3, [Pose.planar(0, z, 0) for z in range(3)], LENS)
    mask = np.zeros((240, 320), bool)
    mask[100:140, 2:60] = True
    assert [rival(blank, mask) for rival in RIVALS.values()] == [None] * len(RIVALS)


def test_an_object_has_the_mean_depth_of_its_regions_by_their_pixels_and_none_where_they_show_too_little():
    square, none = np.zeros((4, 2)), np.zeros(0)
    regions = tuple(
        Region(k, None, 0, 1.0, 1.0, False, (0.0, 0.0, 0.0), (square,), (none,), (none,)) for k in range(3)
    )
    contour = Contour(np.zeros((0, 2)), np.zeros((0, 2)), none, none, none, none)
    snapshot = Snapshot(0, regions, Vertices(none, np.zeros((0, 2)), none), contour, (), 1, 1.0, 1.0)
    owner = np.zeros((10, 10), int)  # region 0 is what lies behind
    owner[2:8, 2:6], owner[2:8, 6:8] = 1, 2
    mask = owner > 0
    answers = {0: RegionDepth(200.0, 1.0, None, None), 1: RegionDepth(60.0, 1.0, None, None)}
    vertices = VertexDepths(none, np.zeros((0, 3)), none)
    both = DepthReport(answers | {2: RegionDepth(90.0, 1.0, None, None)}, vertices)
    most = DepthReport(answers | {2: RegionDepth(None, None, None, "why")}, vertices)
    assert depth_over(mask, owner, snapshot, both) == pytest.approx((24 * 60 + 12 * 90) / 36)
    assert depth_over(mask, owner, snapshot, most) == 60.0
    assert depth_over(owner == 2, owner, snapshot, most) is None


def test_the_advantage_is_over_the_best_rival_and_what_is_missing_is_counted():
    rows = {name: Row() for name in (OURS, PIXELS, *RIVALS)}
    for name, off in zip(rows, (0.01, 0.03, 0.02, 0.04, 0.05), strict=True):
        rows[name].judge([100 * (1 + off), 50 * (1 - off), None], [100.0, 50.0, 20.0])
    assert advantage(rows) == pytest.approx({"median": 2.0, "rms": 2.0})
    figures = rows[OURS].figures()
    assert (figures["objects"], figures["without_depth"]) == (3, 1)
    assert figures["within_2_percent"] == pytest.approx(200 / 3)


def test_a_drive_hands_out_odometry_without_the_shaking_and_whole_objects_alone():
    drive = take(SCENES[0], 0, 1.0)
    assert len(drive.images) == len(drive.odometry) == SCENES[0].frames
    assert all(np.array_equal(pose.rotation, np.eye(3)) for pose in drive.odometry)
    assert any(not np.allclose(pose.rotation, np.eye(3)) for pose in drive.true_poses)
    assert {target.name for target in drive.targets} == {"red_box", "green_box"}
    for target in drive.targets:
        assert 74.0 < target.true_cm < 77.0  # the fronts stand at 75 cm then, before sides and tops
        assert target.pixels[-1] == target.last_mask.sum() > target.pixels[0] == target.first_mask.sum()
