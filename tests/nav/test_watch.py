"""Pictures that must not be driven on are told from those that may."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from host.camera.frame import Frame
from host.nav.config import NavConfig
from host.nav.watch import FrameWatch

NOISE = np.random.default_rng(1)


SCENE = cv2.resize(NOISE.integers(0, 255, (12, 16, 3), np.uint8), (320, 240), interpolation=cv2.INTER_NEAREST)


def grainy(image: np.ndarray, levels: float = 2.0) -> np.ndarray:
    """As a sensor delivers it: no two pictures are alike."""
    return np.clip(image + NOISE.normal(0.0, levels, image.shape), 0, 255).astype(np.uint8)


def frame(t_s: float = 1.0, image: np.ndarray | None = None) -> Frame:
    return Frame(NOISE.integers(0, 255, (60, 80, 3), np.uint8) if image is None else image, t_s, 0)


def test_a_fresh_textured_picture_may_be_driven_on():
    assert FrameWatch(NavConfig()).objection(frame(1.0), 1.05, 0.0) is None


@pytest.mark.parametrize(("age", "allowed"), [(0.29, True), (0.31, False), (5.0, False)])
def test_three_hundred_milliseconds_is_the_limit_of_age(age, allowed):
    said = FrameWatch(NavConfig()).objection(frame(1.0), 1.0 + age, 0.0)
    assert (said is None) == allowed


@pytest.mark.parametrize(("level", "word"), [(0, "black"), (3, "black"), (255, "even"), (120, "even")])
def test_black_and_even_pictures_are_refused(level, word):
    image = np.full((60, 80, 3), level, np.uint8)
    assert word in (FrameWatch(NavConfig()).objection(frame(1.0, image), 1.0, 0.0) or "")


def test_an_unchanged_picture_is_frozen_only_once_the_wheels_have_turned():
    watch, image = FrameWatch(NavConfig()), frame().image
    assert watch.objection(frame(1.0, image), 1.0, 10.0) is None
    assert watch.objection(frame(9.0, image), 9.0, 10.0) is None
    assert "has not changed" in (watch.objection(frame(9.1, image), 9.1, 12.0) or "")
    assert watch.objection(frame(9.2), 9.2, 12.5) is None


def test_pictures_given_out_in_turn_are_found_to_repeat_once_the_wheels_have_turned():
    watch, images = FrameWatch(NavConfig()), [frame().image for _ in range(3)]
    for k in range(3):
        assert watch.objection(frame(1.0, images[k]), 1.0, 0.4 * k) is None
    assert watch.objection(frame(1.0, images[0]), 1.0, 1.2) is None
    assert "was seen before" in (watch.objection(frame(1.0, images[1]), 1.0, 2.0) or "")
    assert watch.objection(frame(1.0), 1.0, 2.4) is None


@pytest.mark.parametrize(("sigma_px", "refused"), [(0.7, False), (1.5, False), (8.0, True), (20.0, True)])
@pytest.mark.parametrize("levels", [0.0, 2.0])
def test_a_picture_that_loses_its_focus_is_refused_until_it_has_it_again(sigma_px, refused, levels):
    def look(sigma_px: float) -> str:
        image = grainy(cv2.GaussianBlur(SCENE, (0, 0), sigma_px), levels)
        return watch.objection(frame(1.0, image), 1.0, 5.0) or ""

    watch = FrameWatch(NavConfig())
    assert look(0.7) == ""
    for _ in range(3):
        assert ("blurred" in look(sigma_px)) == refused
    assert look(0.7) == ""


def test_things_that_are_soft_themselves_are_no_blur():
    watch = FrameWatch(NavConfig())
    ramp = np.repeat(np.linspace(60, 200, 320).astype(np.uint8)[None, :, None], 240, axis=0).repeat(3, axis=2)
    soft = cv2.GaussianBlur(SCENE, (0, 0), 8.0)
    for travel_cm, image in ((0.0, ramp), (1.0, soft), (2.0, SCENE), (6.0, soft)):
        assert watch.objection(frame(1.0, grainy(image)), 1.0, travel_cm) is None


def test_a_picture_that_ends_half_way_down_is_torn():
    image = grainy(SCENE)
    image[150:] = 128
    assert "nothing below row 152" in (FrameWatch(NavConfig()).objection(frame(1.0, image), 1.0, 0.0) or "")


@pytest.mark.parametrize(("travel_cm", "refused"), [(1.0, True), (0.0, False)])
def test_rows_of_the_last_picture_in_the_present_one_are_torn_where_the_robot_moves(travel_cm, refused):
    watch, image = FrameWatch(NavConfig()), grainy(SCENE)
    assert watch.objection(frame(1.0, image), 1.0, 5.0) is None
    torn = grainy(SCENE)
    torn[120:] = image[120:]
    assert ("torn" in (watch.objection(frame(1.1, torn), 1.1, 5.0 + travel_cm) or "")) == refused
    assert watch.objection(frame(1.2, grainy(SCENE)), 1.2, 6.5) is None
