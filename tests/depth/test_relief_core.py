"""From silhouettes to surfaces, on things whose outlines and surfaces are known in closed form."""

from __future__ import annotations

from functools import cache

import numpy as np
import parts
import pytest
from solid_scene import Ball
from solid_things import KINDS, Seen, seen, thing

NOISE_PX = 0.2  # of the outline's points


@cache
def many(kind: str) -> list[Seen]:
    rng = np.random.default_rng(KINDS.index(kind))
    out = [seen(thing(kind, rng)) for _ in range(260)]
    return [s for s in out if s is not None]


@cache
def judged(kind: str) -> np.ndarray:
    """(N, 4): true relief, relief and its sigma told from a noisy outline, width over depth."""
    rng = np.random.default_rng(17)
    rows = []
    for s in many(kind):
        rough = s.loop[::3]
        k, sigma = parts.relief_of(rough + rng.normal(0, NOISE_PX, rough.shape))
        rows.append((s.relief, k, sigma, s.width))
    return np.array(rows)


def test_a_far_ball_has_two_thirds_of_its_radius_over_the_side_of_its_disc():
    far = seen(Ball(7, np.array([0.0, 0.0, 900.0]), 25.0))
    assert far is not None
    assert far.relief == pytest.approx(2 / 3 / np.sqrt(np.pi), rel=0.03)


@pytest.mark.parametrize(
    ("kind", "low", "high"),
    [("ball", 0.25, 0.33), ("post", 0.12, 0.26), ("block", 0.05, 0.2), ("face", -0.15, 0.07)],
)
def test_things_have_the_relief_that_the_header_tells(kind: str, low: float, high: float):
    assert low < judged(kind)[:, 0].mean() < high


@pytest.mark.parametrize("kind", ["ball", "post", "block"])
def test_surfaces_are_told_better_than_silhouettes(kind: str):
    true, told, _, width = judged(kind).T
    before, after = np.median(np.abs(true * width)), np.median(np.abs((told - true) * width))
    assert after < 0.65 * before
    assert after < 0.015


def test_sigma_of_the_relief_is_worth_what_it_says():
    rows = np.concatenate([judged(kind) for kind in ("block", "block", *KINDS)])
    off = np.abs(rows[:, 1] - rows[:, 0]) / rows[:, 2]
    assert 0.55 < (off < 1).mean() < 0.85
    assert (off < 2).mean() > 0.9


def test_a_cut_outline_tells_nothing():
    told = {parts.relief_of(many(kind)[0].loop, cut=True) for kind in KINDS}
    assert len(told) == 1
    assert told.pop()[1] > 0.2


def test_what_is_hollow_has_no_relief_that_is_known():
    chair = np.array([[0, 0], [60, 0], [60, 80], [50, 80], [50, 40], [10, 40], [10, 80], [0, 80]], float)
    k, sigma = parts.relief_of(chair + 100.0)
    assert k == 0.0 and sigma >= 0.2


@pytest.mark.parametrize(
    "points", [np.zeros((1, 2)), np.zeros((5, 2)), np.array([[0, 0], [9, 9], [4, 4]], float)]
)
def test_an_outline_without_area_is_no_trouble(points: np.ndarray):
    assert parts.relief_of(points)[1] > 0.2
    assert not parts.may_be_one_face(np.zeros((5, 2)))


def test_only_outlines_of_three_or_four_straight_sides_may_be_one_face():
    def share(kind: str) -> float:
        return float(np.mean([parts.may_be_one_face(s.loop) for s in many(kind)]))

    assert share("face") > 0.95
    assert share("ball") == 0.0
    assert share("block") < 0.6
