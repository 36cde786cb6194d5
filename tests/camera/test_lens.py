"""The lens: pixels to rays and back."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from host.camera.lens import Lens

WIDE = (-0.28, 0.07, 0.001, -0.001, 0.0)
CURLED = (0.2624, -0.9531, -0.0054, 0.0026, 1.1633)


@pytest.mark.parametrize("distortion", [(0.0,) * 5, WIDE, CURLED], ids=["none", "wide", "curled"])
def test_pixels_go_to_rays_and_back_within_a_thousandth_even_in_the_corners(distortion: tuple[float, ...]):
    lens = Lens(320, 240, 280.0, 281.0, 158.0, 121.0, distortion)
    x, y = np.meshgrid(np.linspace(0, 319, 30), np.linspace(0, 239, 20))
    points = np.column_stack([x.ravel(), y.ravel()])
    assert np.abs(lens.to_pixels(lens.to_rays(points)) - points).max() < 1e-3


def test_no_points_give_no_rays():
    assert Lens(320, 240, 280.0, 280.0, 159.5, 119.5, WIDE).to_rays(np.zeros((0, 2))).shape == (0, 2)


def test_rays_bend_to_the_last_bit_as_opencv_bends_them():
    lens = Lens(320, 240, 280.0, 281.0, 158.0, 121.0, CURLED)
    rays = np.random.default_rng(0).uniform(-2, 2, (1000, 2))
    zero, space = np.zeros(3), np.column_stack([rays, np.ones(len(rays))])
    expected, _ = cv2.projectPoints(space, zero, zero, lens.matrix, np.array(lens.distortion))
    assert np.array_equal(lens.to_pixels(rays), expected.reshape(-1, 2))
