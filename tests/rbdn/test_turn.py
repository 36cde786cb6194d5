"""Which pixel a turned camera saw where: worked out at some pixels, interpolated between them."""

from __future__ import annotations

import numpy as np
import pytest

from host.camera.lens import Lens
from host.rbdn.turn import TurnedView

WIDE = (-0.28, 0.07, 0.001, -0.001, 0.0)


def turn(yaw_rad: float, pitch_rad: float) -> np.ndarray:
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    about_y = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    c, s = np.cos(pitch_rad), np.sin(pitch_rad)
    return about_y @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def exact_places(lens: Lens, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of every pixel where the last image showed it, (H, W, 2), and whether that lies before the camera."""
    x, y = np.meshgrid(np.arange(lens.width), np.arange(lens.height))
    rays = lens.to_rays(np.column_stack([x.ravel(), y.ravel()]))
    space = np.column_stack([rays, np.ones(len(rays))]) @ rotation.T
    shape = (lens.height, lens.width)
    return lens.to_pixels(space[:, :2] / space[:, 2:]).reshape(*shape, 2), (space[:, 2] > 0.1).reshape(shape)


@pytest.mark.parametrize("distortion", [(0.0,) * 5, WIDE], ids=["straight", "bent"])
@pytest.mark.parametrize("size", [(320, 240), (161, 123)])
@pytest.mark.parametrize("rotation", [turn(0.1, 0.0), turn(-0.3, 0.05), turn(0.0, 0.2)])
def test_every_pixel_finds_the_nearest_one_that_saw_the_same(distortion, size, rotation):
    lens = Lens(*size, 280.0, 281.0, 0.5 * size[0] - 1, 0.5 * size[1] + 1, distortion)
    source = TurnedView(lens).source(rotation)
    assert source is not None
    source = source.reshape(lens.height, lens.width)
    places, before = exact_places(lens, rotation)
    x, y = places[..., 0], places[..., 1]
    well_inside = before & (x > 0) & (y > 0) & (x < size[0] - 1) & (y < size[1] - 1)
    assert (source[well_inside] >= 0).all() and well_inside.mean() > 0.2
    off = np.hypot(source % size[0] - x, source // size[0] - y)[well_inside]
    assert off.max() < np.sqrt(0.5) + 0.05  # half a pixel each way, and what interpolation bends
    far_outside = before & ((x < -1) | (y < -1) | (x > size[0]) | (y > size[1]))
    assert (source[far_outside] == -1).all() and far_outside.any()


def test_a_turn_of_a_pixel_or_two_is_none():
    lens = Lens(320, 240, 280.0, 280.0, 159.5, 119.5)
    assert TurnedView(lens).source(turn(0.005, 0.0)) is None
    assert TurnedView(lens).source(turn(0.02, 0.0)) is not None


def test_what_lies_behind_the_camera_was_not_seen():
    lens = Lens(320, 240, 280.0, 280.0, 159.5, 119.5, WIDE)
    source = TurnedView(lens).source(turn(np.pi, 0.0))
    assert source is not None and (source == -1).all()
