"""Depth from growing areas."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from board_scene import LENS, Board, Camera, disc, rectangle, straight_path, turned

from host.depth.area import AreaMethod
from host.depth.config import DepthConfig
from host.depth.motion import first_station, next_station
from host.depth.polygon import polygon_moments
from host.depth.report import Declined, Estimate
from host.pose import Pose
from host.rbdn.snapshot import Event, Snapshot


def answers(frames: list[tuple[Snapshot, Pose]], own_share: float = 1.0) -> list[Estimate | Declined]:
    """What the method says of region 7 after each frame."""
    config = DepthConfig()
    method, station, out = AreaMethod(LENS, config), None, []
    for snapshot, pose in frames:
        station = (
            first_station(snapshot.seq, pose, config)
            if station is None
            else next_station(station, snapshot.seq, pose, config)
        )
        shares = {r.id: own_share for r in snapshot.regions}
        out.append(method.update(snapshot, station, shares)[7])
    return out


def watch(board: Board, path: list[Pose], **camera: float) -> list[tuple[Snapshot, Pose]]:
    """What a camera sees of one board along a path."""
    eye = Camera([board], **camera)
    return [(eye.look(pose), pose) for pose in path]


def depth(answer: Estimate | Declined) -> float:
    assert isinstance(answer, Estimate), answer
    return answer.depth_cm


def reason(answer: Estimate | Declined) -> str:
    assert isinstance(answer, Declined), answer
    return answer.reason


BOX = rectangle(7, (8.0, 4.0, 85.0), (20.0, 16.0))


def test_a_frontal_board_is_where_its_growth_says():
    last = answers(watch(BOX, straight_path(11, 1.0)))[-1]
    assert depth(last) == pytest.approx(75.0, rel=1e-3)


def test_two_frames_give_equation_16():
    (first, _), (second, _) = frames = watch(BOX, straight_path(2, 5.0))
    ratio = np.sqrt(first.regions[0].area_px / second.regions[0].area_px)
    at_the_first_frame = 5.0 / (1 - ratio)
    assert depth(answers(frames)[-1]) == pytest.approx(at_the_first_frame - 5.0, rel=1e-9)


def test_a_camera_that_turns_on_its_way_changes_nothing():
    path = [turned(p, 0.02 * k, -0.03 * k) for k, p in enumerate(straight_path(6, 2.0))]
    last = path[-1]
    true_depth = ((np.array([8.0, 4.0, 85.0]) - last.position_cm) @ last.rotation)[2]
    assert depth(answers(watch(BOX, path))[-1]) == pytest.approx(true_depth, rel=5e-3)


def test_sideways_travel_alone_says_nothing():
    assert "motion" in reason(answers(watch(BOX, straight_path(8, 1.0, (1, 0, 0))))[-1])


def test_a_region_cut_by_the_border_declines():
    half_out = rectangle(7, (36.0, 4.0, 85.0), (20.0, 16.0))
    assert reason(answers(watch(half_out, straight_path(5, 1.0)))[-1]) == "cut by the image border"


def test_a_region_behind_a_nearer_one_declines():
    assert "hidden" in reason(answers(watch(BOX, straight_path(5, 1.0)), own_share=0.8)[-1])


def test_a_change_of_shape_is_no_growth():
    frames = watch(BOX, straight_path(6, 1.0))
    wider = []
    for k, (snapshot, pose) in enumerate(frames):
        box = snapshot.regions[0]
        stretched = box.loops[0] * (1 + 0.03 * k, 1.0)
        region = dataclasses.replace(box, loops=(stretched,), area_px=box.area_px * (1 + 0.03 * k))
        wider.append((dataclasses.replace(snapshot, regions=(region,)), pose))
    assert "shape" in reason(answers(wider)[-1])


def test_after_a_jump_of_the_area_a_new_baseline_begins():
    frames = watch(BOX, straight_path(20, 1.0), noise_px=0.02)
    # from frame 8 on the net takes half as much again for the same thing
    larger = watch(rectangle(7, (8.0, 4.0, 85.0), (24.5, 19.6)), straight_path(20, 1.0), noise_px=0.02)
    said = answers(frames[:8] + larger[8:])
    assert depth(said[7]) == pytest.approx(78.0, rel=0.03)
    assert "jumped" in reason(said[9])
    assert depth(said[-1]) == pytest.approx(66.0, rel=0.03)


def test_one_bad_frame_is_outvoted():
    frames = watch(BOX, straight_path(12, 1.0), noise_px=0.02)
    snapshot, pose = frames[6]
    box = dataclasses.replace(snapshot.regions[0], area_px=1.2 * snapshot.regions[0].area_px)
    frames[6] = dataclasses.replace(snapshot, regions=(box, *snapshot.regions[1:])), pose
    assert depth(answers(frames)[-1]) == pytest.approx(74.0, rel=0.02)


def test_a_split_ends_the_history():
    camera = Camera([BOX])
    path = straight_path(6, 2.0)
    frames = [(camera.look(p, (Event("split", 9, 7),) if k == 5 else ()), p) for k, p in enumerate(path)]
    said = answers(frames)
    assert isinstance(said[4], Estimate)
    assert "motion" in reason(said[5])


def test_a_longer_way_makes_surer():
    said = answers(watch(BOX, straight_path(11, 1.0), noise_px=0.1))
    early, late = said[4], said[10]
    assert isinstance(early, Estimate) and isinstance(late, Estimate)
    assert late.sigma_cm < 0.7 * early.sigma_cm


def test_doubt_about_the_travelled_distance_is_doubt_about_the_depth():
    sure = answers(watch(BOX, straight_path(11, 1.0)))[-1]
    unsure = answers(watch(BOX, straight_path(11, 1.0, sigma_z_cm=0.5)))[-1]
    assert isinstance(sure, Estimate) and isinstance(unsure, Estimate)
    # two readings of 0.5 cm each in 10 cm
    assert unsure.sigma_cm == pytest.approx(75 * np.hypot(sure.sigma_cm / 75, 0.0707), rel=0.05)


def test_moments_of_a_square_with_a_hole():
    square = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    hole = np.array([[1.0, 1.0], [1.0, 3.0], [3.0, 3.0], [3.0, 1.0]])
    area, centre, spread = polygon_moments([square, hole])
    assert area == pytest.approx(12.0)
    assert centre == pytest.approx([2.0, 2.0])
    assert spread == pytest.approx([(4**4 - 2**4) / 144] * 2 + [0.0])


def test_a_round_thing_is_measured_as_well():
    assert depth(answers(watch(disc(7, (-9, 5, 60), 6.0), straight_path(8, 1.0)))[-1]) == pytest.approx(
        53.0, rel=1e-3
    )
