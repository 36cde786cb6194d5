"""The first frame finds what is there: on exact flat scenes, however spoiled, and in the light of rooms."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from bench.flat_scenes import DISTURBANCES, FlatScene, Score, coverage, labels_of, score
from host.rbdn import Net

WIDTH, HEIGHT = 320, 240
SCENES = range(16)

WALL, FLOOR, BOX = (196, 203, 208), (74, 110, 150), (60, 130, 70)


@pytest.mark.parametrize("disturbance", DISTURBANCES)
def test_regions_of_flat_scenes_are_found_and_little_else(disturbance):
    total = Score()
    for seed in SCENES:
        image, truth = FlatScene(seed).draw(WIDTH, HEIGHT, disturbance=DISTURBANCES[disturbance])
        total += score(truth, labels_of(Net().track(image), WIDTH, HEIGHT))
    assert total.found >= 0.94 * total.true
    assert total.excess <= 0.25 * len(SCENES)


def test_an_object_of_its_grounds_hue_is_found_by_its_lightness_and_kept():
    net = Net()
    for k in range(6):
        truth = np.zeros((HEIGHT, WIDTH), int)
        truth[80:160, 100 + 2 * k : 180 + 2 * k] = 1
        image = np.array([(143, 175, 189), (109, 142, 158)], float)[truth]  # CIELAB 72, 0, 18 and 60, 1, 20
        found = score(truth, labels_of(net.track(_noisy(image, k)), WIDTH, HEIGHT))
        assert found == Score(found=2, true=2, excess=0), k


def test_coverage_of_a_turned_square_is_exact():
    square = np.array([[-4.3, -4.3], [4.3, -4.3], [4.3, 4.3], [-4.3, 4.3]])
    cos, sin = np.cos(0.3), np.sin(0.3)
    turned = square @ np.array([[cos, sin], [-sin, cos]]) + (12.4, 9.7)
    share = coverage([turned], 30, 20)
    assert share.sum() == pytest.approx(8.6**2, abs=1e-9)
    y, x = np.mgrid[0:20, 0:30] + 0.5
    assert (share * x).sum() / share.sum() == pytest.approx(12.4, abs=0.02)
    assert (share * y).sum() / share.sum() == pytest.approx(9.7, abs=0.02)


def test_coverage_leaves_holes_open_and_cuts_at_the_border():
    outer = np.array([[-5.0, 2.0], [8.0, 2.0], [8.0, 12.0], [-5.0, 12.0]])
    hole = np.array([[2.0, 4.0], [2.0, 6.5], [4.0, 6.5], [4.0, 4.0]])
    assert coverage([outer, hole], 20, 10).sum() == pytest.approx(8 * 8 - 2 * 2.5)


def test_a_region_that_is_missed_and_one_that_is_made_up_are_both_counted():
    truth = np.zeros((100, 100), int)
    truth[20:50, 20:50] = 1
    found = np.zeros((100, 100), int)
    found[70:90, 70:90] = 1
    assert score(truth, truth) == Score(found=2, true=2, excess=0)
    assert score(truth, found) == Score(found=0, true=2, excess=1)


def test_a_wooden_floor_is_not_cut_along_its_grain():
    image, truth = _room()
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    grain = 9 * np.sin(y / 3.0 + 2 * np.sin(x / 70.0)) + 6 * np.sin(y / 1.3 + np.sin(x / 31.0))
    image = np.where(truth[:, :, None] == 1, image + grain[:, :, None], image)
    _assert_found(_noisy(image, 1), truth)


def test_a_soft_shadow_neither_becomes_slivers_nor_swallows_the_object_that_casts_it():
    image, truth = _room()
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    shadow = 1 - 0.35 * np.exp(-(((x - 205) / 45.0) ** 2) - ((y - 195) / 14.0) ** 2)
    image = np.where(truth[:, :, None] == 1, image * shadow[:, :, None], image)
    _assert_found(_noisy(image, 2), truth)


def test_a_wall_lit_from_one_side_stays_one_region():
    image, truth = _room()
    light = np.linspace(0.75, 1.2, WIDTH)[None, :, None]
    _assert_found(_noisy(image * light, 3), truth)


def test_regions_keep_their_ids_while_the_exposure_drifts():
    net = Net()
    seen = []
    for k in range(16):
        image, truth = _room()
        snapshot = net.track(_noisy(image * (0.8 + 0.03 * k), 10 + k))
        labels = labels_of(snapshot, WIDTH, HEIGHT)
        assert score(truth, labels) == Score(found=3, true=3, excess=0), k
        ids = [snapshot.regions[labels[y, x]].id for x, y in ((20, 20), (20, 220), (150, 150))]
        seen.append(tuple(ids))
    assert set(seen) == {seen[0]}


def _room() -> tuple[np.ndarray, np.ndarray]:
    """A box before a wall on a floor: image and labels (wall 0, floor 1, box 2)."""
    truth = np.zeros((HEIGHT, WIDTH), int)
    truth[130:] = 1
    truth[95:190, 110:190] = 2
    return np.array([WALL, FLOOR, BOX], float)[truth], truth


def _noisy(image: np.ndarray, seed: int) -> np.ndarray:
    soft = cv2.GaussianBlur(image.astype(np.float32), (0, 0), 0.7)
    noise = np.random.default_rng(seed).normal(0, 3, image.shape)
    return np.clip(np.rint(soft + noise), 0, 255).astype(np.uint8)


def _assert_found(image: np.ndarray, truth: np.ndarray) -> None:
    found = score(truth, labels_of(Net().track(image), WIDTH, HEIGHT))
    assert found == Score(found=3, true=3, excess=0)
