"""What a browser gets of one picture."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from host.camera.frame import Frame
from host.link.robot import Robot
from host.nav.config import BodyConfig
from host.nav.map import FREE, OCCUPIED
from host.view.page.packing import EVIDENCE_STEPS, WIDEST_PX, jpeg_of, packed
from host.view.page.shot import Job, Shot
from tests.view.watching import Seen, parted, seen


def shot_of(it: Seen) -> Shot:
    frame, grid = it.view.frame, it.map
    return Shot(7, 10.0, 10.025, frame, it.view, it.log, grid.evidence, (), grid.half_cm, grid.config.cell_cm)


def job_of(it: Seen) -> Job:
    return Job("driving somewhere", (it.goal_cm,), BodyConfig(), it.robot)


@pytest.fixture(scope="module")
def told() -> tuple[dict, bytes, bytes]:
    return parted(packed(shot_of(seen()), job_of(seen())))


def test_every_region_is_there_with_its_outline_and_its_depth_and_sigma(told):
    view, regions = seen().view, told[0]["picture"]["regions"]
    assert len(regions) == len(view.snapshot.regions) > 3
    for sent, region in zip(regions, view.snapshot.regions, strict=True):
        assert sent["id"] == region.id
        for loop, flat in zip(region.loops, sent["loops"], strict=True):
            assert np.abs(np.reshape(flat, (-1, 2)) - loop).max() <= 0.051
        depth = view.depths.regions[region.id]
        assert (sent["depth_cm"] is None) == (depth.depth_cm is None)
        if depth.depth_cm is not None:
            assert sent["depth_cm"] == pytest.approx(depth.depth_cm, abs=0.051)
            assert sent["sigma_cm"] == pytest.approx(depth.sigma_cm, abs=0.051)
    assert any(sent["depth_cm"] is not None for sent in regions)


def test_the_picture_is_the_frame(told):
    image = cv2.imdecode(np.frombuffer(told[1], np.uint8), cv2.IMREAD_COLOR)
    assert image.shape == seen().view.frame.image.shape
    assert np.abs(image.astype(int) - seen().view.frame.image).mean() < 4


def test_the_cells_show_what_is_free_and_what_is_taken_where_it_is(told):
    content, _, cells = told
    place, it = content["map"], seen().map
    grid = np.frombuffer(cells, np.int8).reshape(place["rows"], place["cols"])
    for mask, sign, least in ((it.free, -1, -FREE), (it.occupied, 1, OCCUPIED)):
        points = it.points_where(mask)
        assert len(points) > 10
        cols = ((points[:, 0] - place["x_cm"]) // place["cell_cm"]).astype(int)
        rows = ((points[:, 1] - place["z_cm"]) // place["cell_cm"]).astype(int)
        assert (sign * grid[rows, cols].astype(int) >= round(least * EVIDENCE_STEPS) - 1).all()


def test_state_and_reason_wheels_timing_and_link_are_there(told):
    content = told[0]
    assert content["task"] == "driving somewhere"
    assert content["reason"] == seen().log.decisions[-1].reason == content["reasons"][-1][1]
    assert set(content["stages"]) == {"wheels", "watch", "localise", "net", "depth", "map", "steer"}
    assert content["state"] == "driving"
    assert content["wheels"]["wanted"][0] > 1
    assert content["wheels"]["real"][0] > 1
    assert content["link"]["lost"] == content["link"]["crc"] == [0, 0]
    assert 6 < content["link"]["battery_v"] < 9
    assert 0.5 < content["link"]["round_trip_ms"] < 5
    assert content["map"]["goals"] == [list(seen().goal_cm)]
    x, z, heading = content["map"]["here"]
    assert abs(x) < 5 and z < 20 and abs(heading) < 0.2
    assert content["map"]["path"][-2:] == [round(x, 1), round(z, 1)]


def test_a_turn_to_the_right_wants_the_left_wheel_to_be_the_quicker():
    it = seen()
    command = replace(it.view.command, v_mm_s=100.0, omega_rad_s=1.0)
    shot = replace(shot_of(it), view=replace(it.view, command=command))
    assert parted(packed(shot, job_of(it)))[0]["wheels"]["wanted"] == [17.5, 2.5]


def test_what_moves_is_shown_where_it_is_by_now_and_where_to():
    it = seen()
    t_s = it.view.pose.t_s
    mover = SimpleNamespace(
        origin_cm=(10, 100), ahead=(1, 0), at_cm=20, speed_cm_s=-8, half_cm=6, t_s=t_s - 0.5
    )
    content = parted(packed(replace(shot_of(it), movers=(mover,)), job_of(it)))[0]
    assert content["map"]["movers"] == [[26, 100, -8, 0, 6]]


def test_a_frame_that_was_not_driven_on_is_shown_without_a_net():
    content = parted(packed(replace(shot_of(seen()), view=None), job_of(seen())))[0]
    assert content["refused"] is True
    assert content["picture"]["regions"] == []
    assert content["wheels"]["wanted"] == [0, 0]


def test_no_frame_and_nothing_known_yet_can_be_told_as_well():
    it = seen()
    shot = replace(shot_of(it), frame=None, view=None, evidence=np.zeros((20, 20), np.float32))
    job = replace(job_of(it), goals_cm=(), robot=Robot(None, None))  # type: ignore[arg-type]
    content, image, cells = parted(packed(shot, job))
    assert (image, cells, content["picture"]) == (b"", b"", None)
    assert content["state"] == "no word"


def test_depths_that_are_no_numbers_are_told_as_none():
    it = seen()
    known = next(key for key, depth in it.view.depths.regions.items() if depth.depth_cm is not None)
    odd = replace(it.view.depths.regions[known], depth_cm=float("inf"), sigma_cm=float("nan"))
    depths = replace(it.view.depths, regions={**it.view.depths.regions, known: odd})
    content = parted(packed(replace(shot_of(it), view=replace(it.view, depths=depths)), job_of(it)))[0]
    sent = next(region for region in content["picture"]["regions"] if region["id"] == known)
    assert sent["depth_cm"] is sent["sigma_cm"] is None


def test_the_cameras_own_bytes_go_on_as_they_are():
    image = np.zeros((240, 320, 3), np.uint8)
    assert jpeg_of(Frame(image, 0.0, 0, b"as it came")) == b"as it came"


def test_large_pictures_are_made_smaller():
    image = np.zeros((720, 1280, 3), np.uint8)
    sent = cv2.imdecode(np.frombuffer(jpeg_of(Frame(image, 0.0, 0, b"large")), np.uint8), cv2.IMREAD_COLOR)
    assert sent.shape == (360, WIDEST_PX, 3)
