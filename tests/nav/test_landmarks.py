"""What is known again, and above all what is not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from host.camera.lens import Lens
from host.depth.report import DepthReport, RegionDepth, VertexDepths
from host.nav.landmarks import CLEARLY, UNLIKE, Look, recognise, sightings_of
from host.rbdn.snapshot import OUTSIDE, Contour, Region, Snapshot, Vertices

LENS = Lens(320, 240, 280.0, 280.0, 159.5, 119.5)
HEIGHT_CM = 15.0
RED, BLUE, GREY = (200.0, 40.0, 40.0), (30.0, 80.0, 160.0), (210.0, 210.0, 205.0)


def region(number: int, outline, rgb=RED, beyond=None) -> Region:
    """A region of that outline, given as the net hands it out: up along its right side."""
    loop = np.array(outline, float)
    n = len(loop)
    after = np.roll(loop, -1, axis=0)
    area = 0.5 * abs(float(np.sum(loop[:, 0] * after[:, 1] - loop[:, 1] * after[:, 0])))
    cut = bool((loop[:, 0] < 0).any() or (loop[:, 0] > 319).any() or (loop < 0).any() or (loop > 239).any())
    neighbours = np.full(n, OUTSIDE) if beyond is None else np.array(beyond)
    return Region(number, None, 0, area, 1.0, cut, rgb, (loop,), (np.arange(n),), (neighbours,))


def block(number: int, left: float, right: float, top: float, low: float, rgb=RED) -> Region:
    return region(number, [(right, top), (left, top), (left, low), (right, low)], rgb)


def snapshot(*regions: Region) -> Snapshot:
    none = np.zeros((0, 2))
    empty = np.zeros(0)
    ids = np.zeros(0, np.int64)
    contour = Contour(none, none, ids, ids, empty, empty)
    return Snapshot(0, tuple(regions), Vertices(ids, none, empty), contour, (), 1, 0.0, 0.0)


def report(*regions: Region, depth_cm: float | None = None, moving: bool = False) -> DepthReport:
    sigma = None if depth_cm is None else 0.02 * depth_cm
    one = RegionDepth(depth_cm, sigma, "outline", None, silhouette_cm=depth_cm, moving=moving)
    nothing = VertexDepths(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0))
    return DepthReport({r.id: one for r in regions}, nothing)


def seen(*regions: Region, **more):
    return sightings_of(snapshot(*regions), report(*regions, **more), LENS, HEIGHT_CM)


def test_a_thing_on_the_floor_is_sighted_where_its_middle_is():
    # 20 cm wide and 30 cm high, its foot 100 cm away, its middle 5 cm to the right
    low = LENS.cy + LENS.fy * HEIGHT_CM / 100
    (one,) = seen(block(1, 159.5 - 14, 159.5 + 42, low - 84, low))
    assert one.across == pytest.approx(math.tan(0.5 * (math.atan(0.15) - math.atan(0.05))), abs=1e-9)
    assert 1 / one.near == pytest.approx(109, abs=1)
    height, width = one.look.size_cm or (0, 0)
    assert (height, width) == pytest.approx((32.7, 21.8), rel=0.01)


def test_depth_from_motion_makes_it_surer():
    low = LENS.cy + LENS.fy * HEIGHT_CM / 100
    box = block(1, 150, 190, low - 60, low)
    (by_foot,), (by_both,) = seen(box), seen(box, depth_cm=106.0)
    assert by_both.sigma_near < 0.8 * by_foot.sigma_near
    assert 1 / by_both.near == pytest.approx(106, abs=2)


def test_what_moves_is_no_landmark():
    assert seen(block(1, 150, 190, 100, 160))
    assert not seen(block(1, 150, 190, 100, 160), moving=True)


@pytest.mark.parametrize(
    ("box", "depth_cm"),
    [
        (block(1, -0.5, 60, 100, 160), None),  # cut by the border: where its middle is nobody knows
        (block(1, 150, 190, 40, 121), None),  # hangs, or its foot is hidden
        (block(1, 150, 190, 100, 160), 250.0),  # not where its foot would be
        (block(1, 10, 300, 100, 160), None),  # a wall
        (block(1, 150, 156, 150, 156), None),  # a speck
    ],
    ids=["cut", "hanging", "elsewhere", "wall", "speck"],
)
def test_what_tells_no_place_is_no_landmark(box, depth_cm):
    assert not seen(box, depth_cm=depth_cm)


def corner(at_px: float, lean_px: float = 0.0, left_rgb=GREY, right_rgb=BLUE) -> tuple[Region, Region]:
    """Two walls that meet in an upright edge with its foot at row 150."""
    left = region(
        1,
        [(at_px + lean_px, -0.5), (-0.5, -0.5), (-0.5, 170), (at_px, 150)],
        left_rgb,
        [OUTSIDE, OUTSIDE, 9, 2],
    )
    right = region(
        2,
        [(319.5, -0.5), (at_px + lean_px, -0.5), (at_px, 150), (319.5, 170)],
        right_rgb,
        [OUTSIDE, 1, 9, OUTSIDE],
    )
    return left, right


def test_an_upright_edge_between_walls_is_a_landmark_and_a_leaning_one_is_none():
    (edge,) = seen(*corner(200.0))
    assert edge.key == (1, 2)
    assert edge.across == pytest.approx((200 - 159.5) / 280)
    assert 1 / edge.near == pytest.approx(15 * 280 / 30.5, rel=1e-6)
    assert not seen(*corner(200.0, lean_px=15.0))


@pytest.mark.parametrize("lowest", [151.0, 200.0])
def test_the_side_of_a_thing_before_a_wall_is_no_edge_that_stands_where_the_wall_does(lowest: float):
    wall, _ = corner(200.0)
    outline = [(319.5, -0.5), (200.0, -0.5), (200.0, 150.0), (200.0, lowest), (319.5, lowest + 20.0)]
    thing = region(2, outline, BLUE, [OUTSIDE, 1, 9, 9, OUTSIDE])
    assert bool(seen(wall, thing)) == (lowest == 151.0)  # as good as a corner of the room


def test_an_edge_of_something_that_moves_is_no_landmark():
    assert not seen(*corner(200.0), moving=True)


LOOK = Look((RED,), (30.0, 20.0))


@pytest.mark.parametrize(
    "other",
    [
        Look((BLUE,), (30.0, 20.0)),
        Look((RED,), (60.0, 20.0)),
        Look((RED,), (30.0, 70.0)),
        Look((RED, RED)),
    ],
    ids=["colour", "height", "width", "edge"],
)
def test_other_things_look_other(other):
    assert LOOK.unlike(other) > UNLIKE
    assert other.unlike(LOOK) > UNLIKE


def test_the_same_thing_in_other_light_and_from_another_side_looks_alike():
    shaded = tuple(0.8 * c for c in RED)
    assert LOOK.unlike(Look((shaded,), (31.5, 25.0))) < 4


def test_an_edge_seen_the_other_way_round_is_another():
    one, other = Look((RED, GREY)), Look((GREY, RED))
    assert one.unlike(one) == 0
    assert one.unlike(other) > UNLIKE + CLEARLY


def test_of_two_that_may_be_it_neither_is():
    far = UNLIKE + CLEARLY + 1
    assert recognise(np.array([[1.0, far], [far, 2.0]])) == {0: 0, 1: 1}
    assert recognise(np.array([[1.0, 3.0]])) == {}  # one thing now, two known
    assert recognise(np.array([[1.0], [3.0]])) == {}  # two now, one known
    assert recognise(np.array([[UNLIKE + 0.1]])) == {}
    assert recognise(np.zeros((2, 0))) == {}


def test_a_known_thing_is_found_among_others():
    rng = np.random.default_rng(4)
    found = 0
    for _ in range(100):
        known = [
            Look((tuple(rng.uniform(20, 220, 3)),), (rng.uniform(12, 55), rng.uniform(10, 36)))
            for _ in range(6)
        ]
        height, width = known[2].size_cm or (1, 1)
        again = replace(known[2], size_cm=(height * rng.normal(1, 0.05), width * rng.normal(1, 0.15)))
        match = recognise(np.array([[again.unlike(k) for k in known]]))
        assert match.get(0, 2) == 2
        found += match.get(0) == 2
    assert found >= 90
