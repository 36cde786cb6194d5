"""The paper's formulas, its Table 1 solved from its own measurements, and two frames with an unknown turn."""

from __future__ import annotations

import numpy as np
import pytest

from host.depth.two_frames import (
    TwoViews,
    area_depth_cm,
    area_growth_px2,
    area_sensitivity,
    place_cm,
    solve_two_views,
    vertex_depth_cm,
    vertex_sensitivity,
)
from host.experiments.published import FOCAL_PX, TABLE_1, TABLE_1_TRAVEL_CM, table_1_views
from host.pose import Pose

TRAVEL_CM = 10.0
CORNERS_CM = np.array(
    [[x, y, 85] for x, y in ((-26, -16), (-5, -16), (-5, 9), (-26, 9))]
    + [[x, y, 110] for x, y in ((8, -15), (24, -15), (24, 9), (8, 9))],
    float,
)
FACE = np.array([0] * 4 + [1] * 4)


def _seen_px(points_cm: np.ndarray, rotation: np.ndarray, ahead_cm: float) -> np.ndarray:
    camera = (points_cm - [0, 0, ahead_cm]) @ rotation
    return FOCAL_PX * camera[:, :2] / camera[:, 2:]


def _rotation(pitch_deg: float, yaw_deg: float) -> np.ndarray:
    c, s = np.cos(np.radians(pitch_deg)), np.sin(np.radians(pitch_deg))
    return Pose.planar(0, 0, np.radians(yaw_deg)).rotation @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def _area_px2(corners_px: np.ndarray) -> float:
    x, y = corners_px.T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2


def _views(pitch_deg: float = 0.0, yaw_deg: float = 0.0, noise_px: float = 0.0, seed: int = 0) -> TwoViews:
    rng = np.random.default_rng(seed)
    first = _seen_px(CORNERS_CM, np.eye(3), 0.0)
    last = _seen_px(CORNERS_CM, _rotation(pitch_deg, yaw_deg), TRAVEL_CM)
    first, last = (p + noise_px * rng.standard_normal(p.shape) for p in (first, last))
    areas = [np.array([_area_px2(p[m == FACE]) for m in range(2)]) for p in (first, last)]
    return TwoViews(first, last, FACE, *areas)


def test_the_published_formulas_find_exact_depths_of_exact_measurements() -> None:
    views = _views()
    depth = vertex_depth_cm(views.first_px[:, 1], views.last_px[:, 1], TRAVEL_CM)
    assert depth == pytest.approx(CORNERS_CM[:, 2], rel=1e-12)
    assert place_cm(views.first_px, depth, FOCAL_PX) == pytest.approx(CORNERS_CM, rel=1e-12)
    assert area_depth_cm(views.area_first_px2, views.area_last_px2, TRAVEL_CM) == pytest.approx([85, 110])


def test_no_depth_is_made_up_where_nothing_moves_outwards() -> None:
    assert np.isnan(vertex_depth_cm([5.0, 0.0, 4.0, -4.0], [5.0, 0.0, 3.0, 3.0], TRAVEL_CM)[:3]).all()
    assert np.isnan(area_depth_cm([100.0, 100.0], [100.0, 90.0], TRAVEL_CM)).all()


def test_sensitivities_are_the_slopes_of_what_they_speak_of() -> None:
    views, step = _views(), 1e-4
    nearer = _seen_px(CORNERS_CM, np.eye(3), TRAVEL_CM + step)
    slope = np.abs(nearer - views.last_px)[:, 1] / step
    at_last = CORNERS_CM[:, 2] - TRAVEL_CM
    assert vertex_sensitivity(views.last_px[:, 1], at_last) == pytest.approx(slope, rel=1e-4)
    grown = np.array([_area_px2(nearer[m == FACE]) for m in range(2)]) - views.area_last_px2
    assert area_sensitivity(views.area_last_px2, at_last[[0, 4]]) == pytest.approx(grown / step, rel=1e-4)
    growth = area_growth_px2(views.area_last_px2, [85, 110], TRAVEL_CM)
    assert growth == pytest.approx(views.area_last_px2 - views.area_first_px2)


def test_published_errors_follow_from_the_published_values() -> None:
    for corner in TABLE_1:
        off = 100 * abs(corner.vertex_cm[2] / corner.real_cm[2] - 1)
        assert off == pytest.approx(corner.vertex_error[2], abs=0.2)
    views = table_1_views()
    depth = vertex_depth_cm(views.first_px[:, 1], views.last_px[:, 1], TABLE_1_TRAVEL_CM)
    assert depth == pytest.approx([corner.vertex_cm[2] for corner in TABLE_1])
    # the growths were not used to find the measurements
    growth = np.abs(views.last_px - views.first_px)[:, 1]
    assert growth == pytest.approx([corner.vertex_growth_px for corner in TABLE_1], abs=0.06)


def test_the_papers_own_measurements_give_good_depths_once_the_common_shift_is_solved_for() -> None:
    found = solve_two_views(table_1_views(), FOCAL_PX, TABLE_1_TRAVEL_CM)
    real = np.array([corner.real_cm[2] for corner in TABLE_1])  # to score alone
    assert np.abs(found.face_depth_cm / real[[0, 4]] - 1).max() < 0.025
    off = np.abs(found.corner_depth_cm / real - 1)
    assert np.median(off) < 0.025
    assert off.max() < 0.05
    assert abs(found.shift_px[1]) == pytest.approx(3.5, abs=0.3)  # half a degree


@pytest.mark.parametrize("corner_sigma_px", [0.3, 0.5, 0.8])
@pytest.mark.parametrize("relief_share", [0.05, 0.15, 0.3])
def test_that_result_does_not_hang_on_a_lucky_setting(corner_sigma_px: float, relief_share: float) -> None:
    found = solve_two_views(
        table_1_views(), FOCAL_PX, TABLE_1_TRAVEL_CM, corner_sigma_px, relief_share=relief_share
    )
    assert np.abs(found.face_depth_cm / 85 - 1).max() < 0.025
    assert np.median(np.abs(found.corner_depth_cm / 85 - 1)) < 0.025


@pytest.mark.parametrize(("pitch_deg", "yaw_deg"), [(0.5, 0.0), (0.0, -0.5), (0.7, 1.0), (-1.0, 0.6)])
def test_a_turn_between_the_frames_is_told_from_depth(pitch_deg: float, yaw_deg: float) -> None:
    views = _views(pitch_deg, yaw_deg)
    found = solve_two_views(views, FOCAL_PX, TRAVEL_CM, corner_sigma_px=0.01)
    # a camera that turns right moves its image left, one that turns up moves it down
    turned = FOCAL_PX * np.radians([-yaw_deg, pitch_deg])
    assert found.shift_px == pytest.approx(turned, abs=0.2)
    assert found.face_depth_cm == pytest.approx([85, 110], rel=0.01)
    wrong = vertex_depth_cm(views.first_px[:, 1], views.last_px[:, 1], TRAVEL_CM)
    assert found.corner_depth_cm == pytest.approx(CORNERS_CM[:, 2], rel=0.015)
    if pitch_deg:
        assert np.nanmax(np.abs(wrong / CORNERS_CM[:, 2] - 1)) > 0.3


def test_stated_sigmas_cover_the_errors() -> None:
    within = []
    for seed in range(200):
        corners, areas = _views(0.3, -0.4, 0.3, seed), _views(0.3, -0.4, 0.3, 1000 + seed)
        views = TwoViews(corners.first_px, corners.last_px, FACE, areas.area_first_px2, areas.area_last_px2)
        found = solve_two_views(views, FOCAL_PX, TRAVEL_CM, 0.3, relief_share=0.02)
        within.append(np.abs(found.face_depth_cm - [85, 110]) < found.face_sigma_cm)
    assert 0.62 < np.mean(within) < 0.8


def test_corners_alone_will_do_and_areas_alone_too() -> None:
    views = _views(0.5, 0.0)
    unknown = np.full(2, np.nan)
    corners = TwoViews(views.first_px, views.last_px, FACE, unknown, unknown)
    assert solve_two_views(corners, FOCAL_PX, TRAVEL_CM, 0.01).face_depth_cm == pytest.approx(
        [85, 110], rel=0.02
    )
    nothing = np.full_like(views.first_px, np.nan)
    areas = TwoViews(nothing, nothing, FACE, views.area_first_px2, views.area_last_px2)
    assert solve_two_views(areas, FOCAL_PX, TRAVEL_CM).face_depth_cm == pytest.approx([85, 110], rel=0.03)
    with pytest.raises(ValueError, match="face"):
        solve_two_views(TwoViews(nothing, nothing, FACE, unknown, unknown), FOCAL_PX, TRAVEL_CM)
