"""The scorer: it finds the errors that were put in, and none where there are none."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from host.depth.report import DepthReport, RegionDepth, VertexDepths
from host.nav.picture import STEP_PX
from host.nav.stand import AT_BORDER, Standing
from host.pose import Pose
from host.rbdn.snapshot import Contour, Region, Snapshot, Vertices
from host.sim.scoring import (
    LOOK_STEP_CM,
    DepthSample,
    Score,
    every_second,
    pose_difference,
    region_mask,
    score_depths,
    score_fronts,
    summarise,
)
from host.sim.session import Simulation

NONE_I, NONE_F, NONE_XY = np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 2))


def region(number: int, *loops: np.ndarray) -> Region:
    ids = tuple(np.arange(len(loop)) for loop in loops)
    return Region(number, None, 0, 1.0, 0.1, False, (0.0, 0.0, 0.0), loops, ids, ids)


def snapshot(*regions: Region) -> Snapshot:
    contour = Contour(NONE_XY, NONE_XY, NONE_I, NONE_I, NONE_F, NONE_F)
    return Snapshot(0, regions, Vertices(NONE_I, NONE_XY, NONE_F), contour, (), 0, 0.0, 0.0)


def report(depths: dict[int, float | None]) -> DepthReport:
    regions = {
        k: RegionDepth(d, None if d is None else 0.01 * d, None if d is None else "area", None)
        for k, d in depths.items()
    }
    return DepthReport(regions, VertexDepths(NONE_I, np.zeros((0, 3)), NONE_F))


def rectangle(left: float, top: float, right: float, bottom: float) -> np.ndarray:
    return np.array([[left, top], [right, top], [right, bottom], [left, bottom]])


# Front faces of the paper's boxes as sim:boxes shows them from the start, f = 371 px, Z = 85 cm.
def front(left: float, top: float, right: float, bottom: float) -> np.ndarray:
    scale = 371.0 / 85.0
    return rectangle(
        *(159.5 + scale * left, 119.5 - scale * top, 159.5 + scale * right, 119.5 - scale * bottom)
    )


RED, GREEN = front(-26.0, 16.25, -5.5, -8.7), front(8.5, 15.2, 23.5, -8.7)
WALL = rectangle(150.0, 5.0, 190.0, 40.0)  # at 200 cm


def test_a_mask_holds_the_pixels_whose_centres_lie_inside_and_not_those_in_holes() -> None:
    mask = region_mask([rectangle(1.5, 1.5, 5.5, 4.5), rectangle(2.5, 2.5, 3.5, 3.5)], (8, 8))
    wanted = np.zeros((8, 8), bool)
    wanted[2:5, 2:6] = True
    wanted[3, 3] = False
    assert np.array_equal(mask, wanted)


def test_masks_of_neighbours_cover_every_pixel_once_though_centres_lie_on_the_border() -> None:
    left, right = rectangle(-0.5, -0.5, 4.0, 7.5), rectangle(4.0, -0.5, 7.5, 7.5)
    both = region_mask([left], (8, 8)).astype(int) + region_mask([right], (8, 8))
    assert (both == 1).all()


def test_a_slanted_mask_agrees_with_the_exact_test_of_each_pixel() -> None:
    rng = np.random.default_rng(1)
    loop = rng.uniform(-5, 45, (7, 2))
    mask = region_mask([loop], (40, 40))
    contour = loop.astype(np.float32).reshape(-1, 1, 2)
    inside = [[cv2.pointPolygonTest(contour, (x, y), False) > 0 for x in range(40)] for y in range(40)]
    assert np.array_equal(mask, np.array(inside))


@pytest.fixture(scope="module")
def boxes() -> Simulation:
    return Simulation("sim:boxes")


def scored(boxes: Simulation, depths: dict[int, float | None]) -> list:
    regions = [region(n, loop) for n, loop in ((1, RED), (2, GREEN), (3, WALL))]
    truth = boxes.renderer.truth(boxes.true_pose(0.0))
    return score_depths(snapshot(*regions), report(depths), truth, boxes.renderer.background_ids)


def test_true_depths_score_zero(boxes: Simulation) -> None:
    samples = scored(boxes, {1: 85.0, 2: 85.0, 3: 200.0})
    names = [boxes.renderer.object_names[s.object_id] for s in samples]
    assert names == ["red_box", "green_box", "wall_front"]
    assert [s.background for s in samples] == [False, False, True]
    assert all(abs(s.error) < 1e-4 for s in samples)


def test_errors_put_in_come_out_with_their_sign(boxes: Simulation) -> None:
    errors = [s.error for s in scored(boxes, {1: 85.0 * 1.02, 2: 85.0 * 0.9, 3: 200.0})]
    assert errors == pytest.approx([0.02, -0.1, 0.0], abs=1e-4)


def test_regions_without_a_depth_are_not_counted(boxes: Simulation) -> None:
    assert [s.region for s in scored(boxes, {1: None, 3: 200.0})] == [3]


def test_only_the_object_most_pixels_show_counts(boxes: Simulation) -> None:
    """A red region that laps over the wall is held to the red box alone."""
    wide = RED + np.array([[0, -30], [0, -30], [0, 0], [0, 0]])
    truth = boxes.renderer.truth(boxes.true_pose(0.0))
    samples = score_depths(snapshot(region(1, wide)), report({1: 85.0}), truth, boxes.renderer.background_ids)
    assert len(samples) == 1 and abs(samples[0].error) < 1e-4


def test_a_front_is_held_to_the_nearest_that_its_region_shows_column_by_column(boxes: Simulation) -> None:
    outline = RED + np.array([[0, -30], [0, -30], [0, 0], [0, 0]])  # with some of the wall above
    truth = boxes.renderer.truth(boxes.true_pose(0.0))
    red = np.arange(int(np.ceil(RED[:, 0].min() / STEP_PX)) + 1, int(RED[:, 0].max() / STEP_PX) - 1)
    fronts = [
        Standing(1, red, np.full(len(red), 85.0 * 1.03), 90.0, 2.0, "foot", 1.0),
        Standing(2, red, np.full(len(red), 60.0), 60.0, 9.0, AT_BORDER, 0.25),
        Standing(9, red, np.full(len(red), 60.0), 60.0, 9.0, "foot", 0.5),
    ]
    regions = snapshot(region(1, outline), region(2, RED))
    (sample,) = score_fronts(fronts, regions, truth, boxes.renderer)
    assert (sample.region, sample.sigma_cm) == (1, 2.0) and not sample.background
    assert sample.error == pytest.approx(0.03, abs=1e-3)
    assert sample.depth_cm == pytest.approx(85.0 * 1.03)


def test_the_summary_is_of_absolute_errors_in_percent(boxes: Simulation) -> None:
    samples = scored(boxes, {1: 85.0 * 1.02, 2: 85.0 * 0.9, 3: 200.0 * 1.01})
    assert summarise(samples) == {
        "count": 3,
        "median_percent": pytest.approx(2.0, abs=0.01),
        "p90_percent": pytest.approx(8.4, abs=0.01),
    }
    assert summarise([]) == {"count": 0, "median_percent": None, "p90_percent": None}


def test_pose_differences_are_found_in_place_and_angle() -> None:
    truth = Pose.planar(10.0, 20.0, 0.3)
    off = pose_difference(Pose.planar(13.0, 24.0, 0.3 + math.radians(2.0)), truth)
    assert off == {"position_cm": 5.0, "heading_deg": 2.0}
    assert pose_difference(truth, truth) == {"position_cm": 0.0, "heading_deg": 0.0}


def test_the_score_looks_twice_a_second_and_tells_things_from_room() -> None:
    simulation = Simulation("sim:boxes")
    score = Score(simulation)
    seen = snapshot(region(1, RED), region(3, WALL))
    for t_s in (0.0, 0.2, 0.4, 0.6):  # nobody drives, so that every frame is the first one
        simulation.clock.sleep_s(t_s - simulation.clock.now_s())
        score.watch(t_s, seen, report({1: 85.0 * 1.04, 3: 200.0}))
    assert [s.t_s for s in score.samples] == [0.0, 0.0, 0.6, 0.6]
    summary = score.summary(Pose.planar(3.0, 4.0, 0.0, t_s=0.5))
    assert summary["depth_errors"]["count"] == 4
    assert summary["depth_errors"]["things"]["median_percent"] == pytest.approx(4.0, abs=0.01)
    assert summary["final_pose_error"] == {"position_cm": 5.0, "heading_deg": 0.0}
    assert summary["collisions"] == 0 and summary["true_distance_cm"] == 0.0
    assert summary["min_clearance_cm"] > 0
    assert score.summary(None)["final_pose_error"] is None


@pytest.mark.parametrize(("z_cm", "room_cm"), [(20.0, 53.0), (60.0, 13.0), (70.0, 3.0)])
def test_a_stop_is_false_where_nothing_stands_ahead(monkeypatch, z_cm: float, room_cm: float) -> None:
    simulation = Simulation("sim:boxes")  # front faces at 85 cm, the robot's rim 12 cm before its middle
    monkeypatch.setattr(type(simulation.body), "axle", (-16.0, z_cm, 0.0))
    score = Score(simulation)
    score.hear(moves=False, reason="not begun")
    assert score.stops == []
    score.hear(moves=True, reason="straight")
    score.hear(moves=False, reason="stop: region 3")
    score.hear(moves=False, reason="stop: region 3")
    (stop,) = score.stops
    assert stop.reason == "stop: region 3"
    assert stop.true_room_cm == pytest.approx(room_cm, abs=LOOK_STEP_CM)
    assert stop.is_false == (room_cm == 53.0)


@pytest.mark.parametrize("looks_across", [True, False])
def test_a_stop_before_the_line_of_what_truly_comes_by_is_not_false(monkeypatch, looks_across: bool) -> None:
    simulation = Simulation("sim:room?seed=3&movers=1")
    simulation.world = replace(simulation.world, things=())  # but for the mover
    (mover,) = simulation.world.movers
    begin, end = np.array([mover.thing.x_cm, mover.thing.z_cm]), np.array(mover.other_end_cm)
    along = (end - begin) / np.hypot(*(end - begin))
    middle, across = (begin + end) / 2, np.array([-along[1], along[0]])
    across *= np.sign(middle @ across)
    x, z = middle - 60.0 * across  # on the side where it set out from
    heading = math.atan2(*across) + (0.0 if looks_across else math.pi)
    monkeypatch.setattr(type(simulation.body), "axle", (x, z, heading))
    score = Score(simulation)
    score.hear(moves=True, reason="straight")
    score.hear(moves=False, reason="stop: it crosses ahead")
    (stop,) = score.stops
    assert stop.true_room_cm > 20.0
    assert stop.is_false == (not looks_across)


@pytest.mark.parametrize("ago_s", [0.3, 3.0])
def test_a_stop_because_a_wheel_truly_slipped_is_not_false(monkeypatch, ago_s: float) -> None:
    simulation = Simulation("sim:room?seed=3")
    simulation.clock.sleep_s(5.0)
    monkeypatch.setattr(type(simulation.body), "slipped_us", round(1e6 * (5.0 - ago_s)))
    score = Score(simulation)
    score.hear(moves=True, reason="straight")
    score.hear(moves=False, reason="stop: slipping")
    (stop,) = score.stops
    assert stop.true_room_cm > 20.0
    assert stop.is_false == (ago_s == 3.0)


def test_of_a_long_drive_whole_frames_are_let_go_every_second_one():
    samples = [
        DepthSample(0.5 * k, region, 1, False, 100.0, 1.0, 99.0) for k in range(5) for region in range(3)
    ]
    kept = every_second(samples)
    assert [(s.t_s, s.region) for s in kept] == [(t, region) for t in (0.0, 1.0, 2.0) for region in range(3)]
