"""Pictures of depth: the colours, hatches and places in them are those of the numbers."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from test_pictures import GREY, SQUARE, report, snapshot

from host.depth.report import DepthReport, RegionDepth, SolvedMotion, VertexDepths
from host.pose import Pose
from host.record.sequence import read_sequence
from host.view.colour_scale import LEGEND_PX, RELATIVE_ERROR, RELATIVE_SIGMA, ColourScale, depth_scale
from host.view.depth_map import depth_map, depths_at
from host.view.depth_picture import GAP_PX, HATCH, MOVING, WIDTH_PX, draw_depth
from host.view.sequence_pictures import SequencePictures
from host.view.space_picture import PATH, SIZE_PX, draw_space, space_of

LEFT = np.array([[20.0, 60], [120, 60], [120, 180], [20, 180]])
RIGHT = LEFT + np.array([180.0, 0.0])
SCALE = depth_scale(np.array([50.0, 300.0]))
NEAR = RegionDepth(60.0, 0.6, "outline", None)
FAR = RegionDepth(240.0, 12.0, "outline", None)
NONE = RegionDepth(None, None, None, "outline: no motion yet")
LEFT_PIXEL, RIGHT_PIXEL = (70 * 2, 40 * 2), (70 * 2, 270 * 2)  # away from labels and outlines


def of_scale(scale: ColourScale, value: float) -> np.ndarray:
    return scale.colours(np.array(value)).astype(int)


def panels(*depths: RegionDepth, truth: np.ndarray | None = None) -> list[np.ndarray]:
    picture = draw_depth(GREY, snapshot(LEFT, RIGHT), report(*depths), SCALE, truth)
    count = 2 if truth is None else 3
    assert picture.shape[1] == count * WIDTH_PX + (count - 1) * GAP_PX
    return [picture[:480, k * (WIDTH_PX + GAP_PX) :][:, :WIDTH_PX].astype(int) for k in range(count)]


def test_regions_have_the_colours_of_their_depth_and_of_their_relative_sigma():
    depth, sigma = panels(NEAR, FAR)
    for pixel, region in ((LEFT_PIXEL, NEAR), (RIGHT_PIXEL, FAR)):
        assert depth[pixel] == pytest.approx(of_scale(SCALE, region.depth_cm), abs=3)
        assert sigma[pixel] == pytest.approx(
            of_scale(RELATIVE_SIGMA, region.sigma_cm / region.depth_cm), abs=3
        )


def test_the_error_is_blue_where_depth_is_too_near_white_where_right_and_red_where_too_far():
    truth = np.zeros((240, 320))
    truth[:, :160], truth[:, 160:] = 75.0, 200.0
    truth[:90] = 0.0  # nothing is known there
    _, _, error = panels(NEAR, FAR, truth=truth)
    blue, _, red = error[100 * 2, 40 * 2]
    assert blue > red + 60
    assert error[100 * 2, 40 * 2] == pytest.approx(of_scale(RELATIVE_ERROR, 60 / 75 - 1), abs=3)
    blue, _, red = error[100 * 2, 270 * 2]
    assert red > blue + 60
    assert np.ptp(error[70 * 2, 40 * 2]) < 5, "grey where there is no truth"
    assert of_scale(RELATIVE_ERROR, 0.0).min() > 235


def test_a_region_without_depth_is_hatched_in_every_panel_and_its_reason_stands_below():
    plain, hatched = (
        draw_depth(GREY, snapshot(LEFT, RIGHT), report(NEAR, other), SCALE) for other in (FAR, NONE)
    )
    for panel in (0, WIDTH_PX + GAP_PX):
        inside = (slice(130, 350), slice(panel + 410, panel + 590))
        lines = (hatched[inside] == HATCH).all(axis=2)
        assert 0.08 < lines.mean() < 0.25
        assert not (plain[inside] == HATCH).all(axis=2).any()
    below = slice(480 + LEGEND_PX, 480 + LEGEND_PX + 60)
    assert (hatched[below] < 120).any() and not (plain[below] < 120).any()


def test_regions_of_like_reason_share_one_and_what_has_no_room_is_counted():
    loops = [LEFT * 0.05 + (k, 0) for k in range(40)]
    alike, unlike = (
        draw_depth(
            GREY,
            snapshot(*loops),
            report(
                *(
                    replace(NONE, method_note=f"reason {k % kinds} of a long list of reasons")
                    for k in range(40)
                )
            ),
            SCALE,
        )
        for kinds in (1, 40)
    )
    below = slice(480 + LEGEND_PX, 480 + LEGEND_PX + 70)
    ink = [(picture[below] < 120).sum() for picture in (alike, unlike)]
    assert alike.shape == unlike.shape
    assert 0 < 3 * ink[0] < ink[1]
    assert not (unlike[below, -10:] < 120).any(), "nothing runs out of the picture"


def test_a_moving_region_is_crossed_out_in_its_own_colour():
    moving = replace(NONE, moving=True, method_note="moves")
    depth, _ = panels(NEAR, moving)
    marked = (depth == MOVING).all(axis=2)
    assert marked[130:350, 410:590].mean() > 0.2
    assert not marked[:, :320].any()


def test_a_slanted_region_has_its_mean_depth_and_lies_on_its_plane():
    y, x = np.mgrid[60:181, 20:121]
    places = np.column_stack([x.ravel(), y.ravel()]).astype(float)
    slope = (2e-5, -3e-5)
    depths = depths_at(replace(NEAR, depth_cm=90.0, slope=slope), places)
    assert depths.mean() == pytest.approx(90.0, rel=1e-6)
    fit, residual, *_ = np.linalg.lstsq(np.column_stack([np.ones(len(places)), places]), 1 / depths)
    assert fit[1:] == pytest.approx(slope)
    assert residual == pytest.approx(0.0, abs=1e-12)


def test_a_plane_that_reaches_its_horizon_stays_finite_and_before_the_camera():
    places = np.column_stack([np.zeros(200), np.arange(200.0)])
    depths = depths_at(replace(FAR, slope=(0.0, 1e-4)), places)
    assert np.isfinite(depths).all() and (depths > 0).all()
    assert (np.diff(depths) <= 0).all()


def test_a_small_region_covers_the_larger_one_that_it_lies_in():
    inner = np.array([[140.0, 100], [180, 100], [180, 140], [140, 140]])
    for order in ((SQUARE, inner), (inner, SQUARE)):
        found = depth_map(snapshot(*order), report(NEAR, NEAR), (240, 320))
        small = next(k for k, loop in enumerate(order) if loop is inner)
        assert (found.region == small).sum() == 41 * 41
        assert (found.region >= 0).sum() == 121 * 81


def test_depth_colours_go_with_the_logarithm_between_round_numbers():
    scale = depth_scale(np.array([62.0, 80.0, 210.0]))
    assert (scale.ticks[0], scale.ticks[-1]) == (50.0, 300.0)
    middle = scale.colours(np.array(math.sqrt(50.0 * 300.0)))
    assert middle == pytest.approx(scale.table[len(scale.table) // 2], abs=6)
    assert (scale.colours(np.array(1.0)) == scale.colours(np.array(50.0))).all()
    assert (scale.colours(np.array(1e6)) == scale.colours(np.array(300.0))).all()


def test_one_depth_or_none_still_make_a_scale_that_a_legend_can_show():
    for depths in ([], [85.0], [10.0], [20.0, 5000.0]):
        scale = depth_scale(np.array(depths))
        assert scale.ticks[-1] >= 2 * scale.ticks[0]
        assert all(scale.ticks[0] <= d <= scale.ticks[-1] for d in depths)
        assert scale.legend(200, "depth, cm").shape == (LEGEND_PX, 200, 3)


def test_the_path_in_space_is_that_of_the_solved_camera_where_it_was_solved(
    sequence_folder: Path, tmp_path: Path
):
    def drawn(*motions: SolvedMotion | None) -> np.ndarray:
        pictures = SequencePictures(read_sequence(sequence_folder), tmp_path)
        for motion in motions:
            pictures.add(snapshot(LEFT), replace(report(NEAR), motion=motion))
        pictures.write(lambda: None)
        return cv2.imread(str(tmp_path / "vertices.png"))

    def solved(x_cm: float, z_cm: float) -> SolvedMotion:
        return SolvedMotion(Pose.planar(x_cm, z_cm, 0.0), 0.0, 0.0, 0.0)

    odometry = drawn(None, None, None, None)
    assert np.array_equal(odometry, drawn(*(solved(0.0, 2.0 * k) for k in range(4))))
    assert not np.array_equal(odometry, drawn(*(solved(2.0 * k, 2.0 * k) for k in range(4))))


# --- In space ---------------------------------------------------------------------------------------


def placed(xyz_cm: list[tuple[float, float, float]], sigma_cm: float = 1.0) -> DepthReport:
    vertices = VertexDepths(np.arange(len(xyz_cm)), np.array(xyz_cm), np.full(len(xyz_cm), sigma_cm))
    return DepthReport({}, vertices)


FACE = [(-10.0, -5, 80), (10, -5, 80), (10, 5, 80), (-10, 5, 80)]


def test_vertices_are_placed_in_the_world_by_the_last_pose():
    poses = [Pose.planar(0, 0, 0), Pose.planar(3, 20, math.pi / 2)]
    space = space_of(snapshot(SQUARE), placed(FACE), poses)
    assert space.points_cm[0] == pytest.approx((83, -5, 30))  # ahead is to the right now
    assert space.path_cm == pytest.approx(np.array([(0, 0, 0), (3, 0, 20)]))
    assert len(space.faces) == 1 and len(space.edges) == 4


def test_an_unsure_vertex_is_left_out_with_its_edges_and_counted():
    doubtful = placed(FACE)
    doubtful.vertices.sigma_cm[1] = 40.0
    doubtful.vertices.xyz_cm[2] = np.nan
    space = space_of(snapshot(SQUARE), doubtful, [Pose.planar(0, 0, 0)])
    assert (len(space.points_cm), space.left_out) == (2, 2)
    assert len(space.edges) == 1 and space.faces == ()


def test_an_edge_has_the_colour_of_the_smaller_region():
    space = space_of(snapshot(SQUARE, 0.5 * SQUARE), placed(FACE), [Pose.planar(0, 0, 0)])
    assert set(space.edges.values()) == {2}


def test_what_is_farther_to_the_right_or_higher_is_drawn_there():
    def drawn(point: tuple[float, float, float]) -> np.ndarray:
        corners = [(-60.0, 30, 40), (60, 30, 200), (-60, -30, 200), point]
        alone = VertexDepths(np.arange(10, 14), np.array(corners), np.full(4, 0.1))  # round no region
        picture = draw_space(space_of(snapshot(SQUARE), DepthReport({}, alone), [Pose.planar(0, 0, 0)]))
        return picture[: SIZE_PX[1], : SIZE_PX[0]].max(axis=2) < 90

    def step(before: tuple[float, float, float], after: tuple[float, float, float]) -> np.ndarray:
        one, other = drawn(before), drawn(after)
        return np.argwhere(other & ~one).mean(axis=0) - np.argwhere(one & ~other).mean(axis=0)

    right, up, far = (step((-20, 0, 100), b) for b in ((20, 0, 100), (-20, -20, 100), (-20, 0, 150)))
    assert right[1] > 100 and abs(right[0]) < 0.5 * right[1]
    assert up[0] < -50 and abs(up[1]) < 2
    assert far[0] < -30 and far[1] > 30


def test_a_scene_without_any_sure_vertex_still_shows_the_path():
    picture = draw_space(space_of(snapshot(SQUARE), placed(FACE, 80.0), [Pose.planar(0, 0, 0)] * 2))
    assert (np.abs(picture.astype(int) - PATH).max(axis=2) < 30).sum() > 50
