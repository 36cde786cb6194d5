"""What the net says of regions that come, part, join and go."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np
import pytest
from scenes import add_noise, compose, random_scene, rectangle_coverage

from host.camera.lens import Lens
from host.rbdn import Event, Net, NetConfig, Snapshot

SHAPE = (120, 160)
WALL, RED, GREEN, BLUE = (200, 205, 210), (40, 40, 190), (60, 150, 60), (170, 70, 40)
Box = tuple[float, float, float, float]


def boxes(*layers: tuple[Box, tuple[int, int, int]], seed: int = 0) -> np.ndarray:
    """Boxes (x0, y0, x1, y1) in their colours on a wall, the last one in front."""
    drawn = [(rectangle_coverage(SHAPE, box, 0.7), colour) for box, colour in layers]
    return add_noise(compose(SHAPE, WALL, drawn), 3, seed)


def follow(images: Iterable[np.ndarray]) -> tuple[list[Snapshot], list[Event]]:
    net = Net()
    snapshots = [net.track(image) for image in images]
    return snapshots, [event for snapshot in snapshots for event in snapshot.events]


def region_like(snapshot: Snapshot, bgr: tuple[int, int, int]) -> int:
    """Id of the region whose mean is nearest to a colour."""
    rgb = np.array(bgr[::-1])
    return min(snapshot.regions, key=lambda region: float(np.linalg.norm(region.mean_rgb - rgb))).id


def test_the_first_frame_has_no_events():
    snapshots, events = follow([boxes(((30, 30, 70, 80), RED))])
    assert len(snapshots[0].regions) == 2 and events == []


def test_a_thing_that_comes_in_is_born_in_the_region_that_was_there():
    snapshots, events = follow(boxes(((6.0 * k - 50, 30, 6.0 * k, 80), RED), seed=k) for k in range(8))
    wall, red = region_like(snapshots[0], WALL), region_like(snapshots[-1], RED)
    assert events == [Event("birth", red, wall)]
    thing = next(region for region in snapshots[-1].regions if region.id == red)
    assert thing.parent == wall, "known as long as the region lives"
    assert 0 < thing.born_seq < 7


def test_a_thing_that_leaves_the_image_ends():
    snapshots, events = follow(boxes(((30 - 6.0 * k, 30, 70 - 6.0 * k, 80), RED), seed=k) for k in range(14))
    assert events == [Event("end", region_like(snapshots[0], RED), None)]


def test_a_thing_that_is_hidden_ends():
    snapshots, events = follow(
        boxes(((90, 45, 115, 75), RED), ((10 + 5.0 * k, 20, 70 + 5.0 * k, 100), GREEN), seed=k)
        for k in range(13)
    )
    assert events == [Event("end", region_like(snapshots[0], RED), None)]


def test_a_thing_cut_in_two_by_what_passes_in_front_splits():
    snapshots, events = follow(
        boxes(((30, 50, 130, 90), RED), ((70, -100, 90, 35 + 4.0 * k), BLUE), seed=k) for k in range(18)
    )
    red = region_like(snapshots[0], RED)
    splits = [event for event in events if event.kind == "split"]
    assert len(splits) == 1 and splits[0].parent == red
    both = {region.id for region in snapshots[-1].regions} & {red, splits[0].id}
    assert both == {red, splits[0].id}


def test_a_thing_that_takes_on_the_colour_around_it_merges():
    fading = [np.array(GREEN) + (np.array(WALL) - GREEN) * min(1.0, 0.05 * k) for k in range(22)]
    snapshots, events = follow(
        boxes(((40, 30, 110, 90), tuple(int(c) for c in colour)), seed=k) for k, colour in enumerate(fading)
    )
    assert events == [Event("merge", region_like(snapshots[0], GREEN), region_like(snapshots[0], WALL))]


def test_a_thing_that_jumps_is_not_said_to_have_merged():
    _, events = follow([boxes(((20, 30, 50, 60), RED)), boxes(((110, 60, 140, 90), RED), seed=1)])
    assert sorted(event.kind for event in events) == ["birth", "end"]


def test_what_a_turn_brings_in_has_no_parent():
    lens = Lens(160, 120, 180.0, 180.0, 79.5, 59.5)
    net = Net(lens=lens)
    angle = np.radians(12)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    wide = np.full((120, 260, 3), WALL, np.uint8)
    cv2.rectangle(wide, (175, 30), (195, 90), RED, -1)
    net.track(np.ascontiguousarray(wide[:, :160]))
    snapshot = net.track(np.ascontiguousarray(wide[:, 38:198]), rotation=turn)
    assert snapshot.events == (Event("birth", region_like(snapshot, RED), None),)


@pytest.mark.parametrize("edge", ["left", "right", "top", "bottom"])
def test_a_region_is_flagged_in_the_very_frame_in_which_the_border_cuts_it(edge):
    net = Net()
    dx, dy = {"left": (-4, 0), "right": (4, 0), "top": (0, -4), "bottom": (0, 4)}[edge]
    cut = []
    for k in range(18):
        x, y = 55.0 + dx * k, 35.0 + dy * k
        snapshot = net.track(boxes(((x, y, x + 50, y + 50), RED), seed=k))
        red = next(r for r in snapshot.regions if r.id == region_like(snapshot, RED))
        truly = x < -0.5 or y < -0.5 or x + 50 > 159.5 or y + 50 > 119.5
        assert red.touches_border == truly, k
        cut.append(truly)
    assert cut[0] is False and cut[-1] is True


@pytest.mark.parametrize("seed", range(6))
def test_events_account_for_every_id_that_comes_or_goes(seed):
    net = Net(NetConfig(refresh_frames=3))
    rng = np.random.default_rng(seed)
    present: set[int] = set()
    for k in range(25):
        snapshot = net.track(random_scene(int(rng.integers(4)) if k % 3 == 0 else seed))
        ids = {region.id for region in snapshot.regions}
        came = {e.id for e in snapshot.events if e.kind in ("birth", "split", "return")}
        went = {e.id for e in snapshot.events if e.kind in ("merge", "end")}
        assert len(came) + len(went) == len(snapshot.events)
        if k > 0:
            assert (came, went) == (ids - present, present - ids)
        for event in snapshot.events:
            assert event.kind != "merge" or event.parent in ids
            assert event.kind != "split" or event.parent in present
            assert event.kind != "end" or event.parent is None
        present = ids
