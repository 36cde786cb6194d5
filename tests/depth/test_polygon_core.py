"""Plane geometry of outlines in the depth engine, against OpenCV, brute force and what must hold."""

from __future__ import annotations

import cv2
import numpy as np
import parts
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

SQUARE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
HOLE = np.array([[1.0, 1.0], [1.0, 3.0], [3.0, 3.0], [3.0, 1.0]])

seeds = st.integers(0, 2**32 - 1)


def star(seed: int, corners: int = 12) -> np.ndarray:
    """A simple polygon (N, 2) about somewhere in an image."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, corners))
    radius = rng.uniform(10, 60, corners)
    return rng.uniform(80, 240, 2) + radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


def inside(loops: list[np.ndarray], step: float) -> np.ndarray:
    """Points (N, 2) of a grid inside the first loop and outside the others."""
    low, high = loops[0].min(axis=0), loops[0].max(axis=0)
    x, y = (np.arange(a + step / 2, b, step) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    odd = np.zeros(len(grid), bool)
    for loop in loops:
        for a, b in zip(loop, np.roll(loop, -1, axis=0), strict=True):
            crosses = (a[1] > grid[:, 1]) != (b[1] > grid[:, 1])
            with np.errstate(all="ignore"):
                at = a[0] + (grid[:, 1] - a[1]) * (b[0] - a[0]) / (b[1] - a[1])
            odd ^= crosses & (grid[:, 0] < at)
    return grid[odd]


def test_moments_of_a_square_with_a_hole():
    area, centre, spread = parts.polygon_moments([SQUARE, HOLE])
    assert area == pytest.approx(12.0)
    assert centre == pytest.approx([2.0, 2.0])
    assert spread == pytest.approx([(4**4 - 2**4) / 144] * 2 + [0.0])


def test_area_and_length_do_not_mind_which_way_a_loop_turns():
    for loops in ([SQUARE, HOLE], [SQUARE[::-1], HOLE], [SQUARE, HOLE[::-1]]):
        assert parts.polygon_area(loops) == pytest.approx(12.0)
        assert parts.outline_length(loops) == pytest.approx(24.0)


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_moments_agree_with_counting(seed: int):
    loop = star(seed)
    points = inside([loop], 0.5)
    area, centre, spread = parts.polygon_moments([loop])
    assert area == pytest.approx(len(points) * 0.25, rel=0.02)
    assert centre == pytest.approx(points.mean(axis=0), abs=0.2)
    counted = np.cov(points.T, bias=True)
    size = counted.trace()
    assert spread == pytest.approx([counted[0, 0], counted[1, 1], counted[0, 1]], abs=0.02 * size)


@settings(max_examples=40, deadline=None)
@given(seeds, st.integers(3, 60))
def test_hulls_are_those_of_opencv(seed: int, count: int):
    points = np.random.default_rng(seed).normal(100, 30, (count, 2))
    theirs = cv2.convexHull(points.astype(np.float32), returnPoints=False)[:, 0]
    ours = parts.convex_hull(points)
    assert {tuple(p) for p in ours} == {tuple(p) for p in points[theirs]}
    assert parts.is_convex(ours)


def test_a_hull_has_no_three_points_on_a_line():
    grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(4.0)), axis=-1).reshape(-1, 2)
    assert {tuple(p) for p in parts.convex_hull(grid)} == {(0, 0), (4, 0), (4, 3), (0, 3)}


@settings(max_examples=40, deadline=None)
@given(seeds, st.integers(3, 60))
def test_no_turned_rectangle_is_smaller(seed: int, count: int):
    points = np.random.default_rng(seed).normal(100, 30, (count, 2))
    width, height = parts.smallest_rectangle(points)
    # one side of the smallest lies on an edge of the hull
    hull = parts.convex_hull(points)
    edges = np.roll(hull, -1, axis=0) - hull
    angles = np.concatenate([np.arctan2(edges[:, 1], edges[:, 0]), np.linspace(0, np.pi / 2, 200)])
    ways = np.stack([np.column_stack([np.cos(angles), np.sin(angles)]),
                     np.column_stack([-np.sin(angles), np.cos(angles)])])  # fmt: skip
    least = np.ptp(ways @ points.T, axis=2).prod(axis=0).min()
    assert width * height == pytest.approx(least, rel=1e-9)


@settings(max_examples=40, deadline=None)
@given(seeds, st.floats(0.5, 10.0))
def test_simplified_outlines_stay_within_the_tolerance(seed: int, tolerance: float):
    corners = star(seed, 20)
    at = np.linspace(0, 1, 7, endpoint=False)[None, :, None]
    loop = (corners[:, None] + at * (np.roll(corners, -1, axis=0) - corners)[:, None]).reshape(-1, 2)
    few = parts.simplified(loop, tolerance)
    assert {tuple(p) for p in few} <= {tuple(p) for p in loop}
    assume(len(few) >= 3)
    a, b = few, np.roll(few, -1, axis=0)
    way = b - a
    along = np.clip(((loop[:, None] - a) * way).sum(2) / (way**2).sum(1), 0, 1)
    off = np.linalg.norm(loop[:, None] - a - along[..., None] * way, axis=2).min(axis=1)
    assert off.max() <= tolerance + 1e-9


def test_points_on_straight_sides_are_left_out():
    dense = np.concatenate([np.linspace(a, b, 20, endpoint=False) for a, b in
                            zip(SQUARE, np.roll(SQUARE, -1, axis=0), strict=True)])  # fmt: skip
    assert sorted(map(tuple, parts.simplified(dense, 0.01))) == sorted(map(tuple, SQUARE))


def test_convexity():
    assert parts.is_convex(SQUARE) and parts.is_convex(SQUARE[::-1])
    assert not parts.is_convex(np.array([[0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [0.0, 4.0]]))
    twice = np.tile(SQUARE, (2, 1))
    assert not parts.is_convex(twice)


@settings(max_examples=40, deadline=None)
@given(seeds, st.floats(0, 2 * np.pi), st.floats(0, 0.9))
def test_mean_of_the_inverse_of_a_plane_agrees_with_brute_force(seed: int, way: float, share: float):
    loop = star(seed)
    hole = loop.mean(axis=0) + 0.02 * (star(seed + 1) - star(seed + 1).mean(axis=0))
    assume((np.linalg.norm(loop - loop.mean(axis=0), axis=1) > 4).all())
    loops = [loop, hole[::-1]]
    points = inside(loops, 0.5)
    slope = np.array([np.cos(way), np.sin(way)])
    # the plane is `share` of the way to vanishing at the outline's farthest point
    reach = -((loop - loop.mean(axis=0)) @ slope).min()
    b, c = 0.01 * share / reach * slope
    a = 0.01 - b * loop.mean(axis=0)[0] - c * loop.mean(axis=0)[1]
    counted = (1 / (a + points @ (b, c))).mean()
    assert parts.mean_of_inverse(loops, a, b, c) == pytest.approx(counted, rel=0.02)


@pytest.mark.parametrize("slope", [1e-14, 1e-11, 1e-9, 1e-7, 1e-5, 1e-3])
def test_mean_of_the_inverse_is_exact_however_small_the_slope(slope: float):
    """1/(a + b x) over a rectangle from x0 to x1 has the mean ln(L1/L0) / (L1 - L0)."""
    x0, x1 = 200.0, 260.0
    loop = np.array([[x0, 50.0], [x1, 50.0], [x1, 90.0], [x0, 90.0]])
    l0, l1 = 1 + slope * x0, 1 + slope * x1
    exact = np.log1p(slope * (x1 - x0) / l0) / (slope * (x1 - x0))
    assert l1 > l0
    assert parts.mean_of_inverse([loop], 1.0, slope, 0.0) == pytest.approx(exact, rel=1e-12)


def test_a_plane_that_reaches_the_camera_has_no_mean():
    assert np.isnan(parts.mean_of_inverse([SQUARE], 1.0, -0.5, 0.0))
    assert np.isnan(parts.mean_of_inverse([SQUARE, SQUARE], 1.0, 0.0, 0.0))
