"""Pictures that must not be driven on are told from those that may."""

from __future__ import annotations

import numpy as np
import pytest

from host.camera.frame import Frame
from host.nav.config import NavConfig
from host.nav.watch import FrameWatch

NOISE = np.random.default_rng(1)


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
