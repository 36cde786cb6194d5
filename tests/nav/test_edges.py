"""Feet on straight edges: where they are filled in, and what ends in points instead of standing upright."""

from __future__ import annotations

import numpy as np
import pytest

from host.nav import _nav

WIDTH, HEIGHT, KIND, RMS = 160, 120, 1, 0.004
INNER = slice(2, -2)  # the outermost feet are evened with those beside them
NOISE = 0.001 * np.random.default_rng(3).standard_normal(WIDTH)


def edges(slopes: np.ndarray, first: int, high: np.ndarray | int = 60, cut: int = 0) -> np.ndarray | None:
    """Of a thing from a column on, so many pixels high, its feet in the last columns below the picture."""
    return edges_of(shape_of(slopes, first, high, cut))


def stance_of(shape: tuple, rms: float = RMS) -> tuple:
    """Of something narrow."""
    return _nav.stance(*shape, np.zeros(WIDTH), 15.0, rms)


def edges_of(shape: tuple, rms: float = RMS) -> np.ndarray | None:
    return stance_of(shape, rms)[4]


def shape_of(
    slopes: np.ndarray, first: int, high: np.ndarray | int, cut: int = 0
) -> tuple[np.ndarray, int, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    columns = np.arange(first, first + len(slopes))
    labels = np.zeros((WIDTH, HEIGHT), np.uint16)
    for column, pixels in zip(columns, np.broadcast_to(high, len(columns)), strict=True):
        labels[column, 20 : 20 + pixels] = KIND
    feet, below = np.zeros(WIDTH), np.zeros(WIDTH, bool)
    feet[columns] = slopes
    below[columns[len(columns) - cut :]] = True
    return labels, KIND, feet, below, columns[: len(columns) - cut], columns


def test_noise_and_a_sliver_of_something_nearer_change_no_edge():
    true = np.linspace(0.10, 0.20, 30)
    found = edges(true + NOISE[:30], 40)
    assert found is not None
    assert found[INNER] == pytest.approx(true[INNER], abs=0.002)
    with_sliver = true.copy()
    with_sliver[-2:] = 0.3
    found = edges(with_sliver, 40)
    assert found is not None
    assert found[2:-4] == pytest.approx(true[2:-4], abs=0.002)
    assert found[-2:] == pytest.approx(0.3)  # which stays as near as it was seen


@pytest.mark.parametrize("sign", [1, -1], ids=["outwards", "inwards"])
def test_two_edges_meet_in_a_corner_that_points_outwards_or_inwards(sign):
    true = 0.15 - sign * 0.003 * np.abs(np.arange(40) - 22)
    found = edges(true + NOISE[:40], 30)
    assert found is not None
    assert found[INNER] == pytest.approx(true[INNER], abs=0.005)


def test_what_is_level_curved_or_not_upright_at_its_ends_has_no_slanted_edge():
    true = np.linspace(0.10, 0.20, 30)
    assert edges(np.full(30, 0.2), 40) is None
    assert edges(0.1 + 0.1 * np.sin(np.linspace(0, np.pi, 30)), 40) is None
    arc = np.sqrt(1 - np.linspace(-0.98, 0.98, 30) ** 2)
    assert edges(true, 40, np.rint(60 * arc).astype(int)) is None


def test_below_the_picture_an_edge_goes_on_and_elsewhere_no_farther_than_a_foot_was_seen():
    true = np.linspace(0.10, 0.20, 30)
    found = edges(true, 40, cut=6)
    assert found is not None
    assert found[-6:] == pytest.approx(true[-6:], abs=0.001)
    labels, kind, slopes, below, feet, covered = shape_of(true, 40, 60)
    seen = feet[5:-5]  # something else stands before both ends
    found = edges_of((labels, kind, slopes, below, seen, covered))
    assert found is not None
    assert found.min() == pytest.approx(true[7], abs=0.001)
    assert found.max() == pytest.approx(true[-8], abs=0.001)


def test_a_ball_ends_in_points_where_its_feet_are_higher_and_a_box_does_not():
    across = np.linspace(-0.98, 0.98, 30)
    arc = np.sqrt(1 - across**2)
    ball, high = 0.13 + 0.12 * arc, np.rint(60 * arc).astype(int)
    assert _nav.tapers(*shape_of(ball, 40, high))
    assert not _nav.tapers(*shape_of(ball, 40, 60))
    assert not _nav.tapers(*shape_of(np.full(30, 0.2), 40, high))


def test_half_a_ball_ends_in_a_point_where_it_is_in_sight_and_has_no_slanted_edge():
    arc = np.sqrt(1 - np.linspace(-0.98, 0.98, 30) ** 2)
    ball, high = 0.13 + 0.12 * arc, np.rint(30 * arc).astype(int)
    at_border = shape_of(ball[:12], WIDTH - 12, high[:12])
    assert _nav.tapers(*at_border)
    assert edges_of(at_border, 0.02) is None  # though an edge that rough would do
    labels, kind, slopes, *rest = shape_of(ball[12:], 40, high[12:])
    assert not _nav.tapers(labels, kind, slopes, *rest)  # nothing hides its other half: it is no ball
    slopes[39] = 0.35
    assert _nav.tapers(labels, kind, slopes, *rest)


def test_the_far_end_of_a_slanted_front_is_no_half_ball():
    slanted = np.linspace(0.1, 0.2, 18)
    box = shape_of(slanted, WIDTH - 18, np.linspace(36, 60, 18).astype(int))
    door = shape_of(slanted, WIDTH - 18, np.linspace(25, 100, 18).astype(int))  # out of the picture
    slender = shape_of(slanted, WIDTH - 18, np.linspace(25, 70, 18).astype(int))
    for shape in (box, door, slender):
        assert not _nav.tapers(*shape)
    assert edges_of(box) is not None


def test_the_nearest_foot_is_not_drawn_nearer_by_the_steps_that_feet_are_told_in():
    def nearest(slopes: np.ndarray) -> float:
        return stance_of(shape_of(slopes, 40, 60))[0]

    frontal = np.tile([0.100, 0.104], 20)  # truly 0.102
    assert nearest(frontal) == pytest.approx(0.102, abs=0.0005)
    corner = 0.15 - 0.05 * np.abs(np.linspace(-1, 1, 41))
    assert nearest(corner) == pytest.approx(np.quantile(corner, 0.9), abs=0.001)
    assert nearest(np.array([0.1, 0.12, 0.11])) == pytest.approx(0.118)


def test_what_is_nearer_at_one_end_is_a_slanted_front_and_hangs_over_nowhere():
    high = np.linspace(30, 60, 40).astype(int)  # not upright, so that it has no edges
    ends = np.abs(np.linspace(-1, 1, 40))
    flat_at = {"one end": np.linspace(0.05, 0.15, 40), "both ends": 0.15 - 0.1 * ends}
    hangs = {where: stance_of(shape_of(feet, 9, high))[5] for where, feet in flat_at.items()}
    assert hangs == {"one end": False, "both ends": True}
