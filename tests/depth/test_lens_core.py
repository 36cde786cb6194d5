"""The depth engine's way to take a lens's distortion out of many points, beside the lens that bends them."""

from __future__ import annotations

import ctypes

import numpy as np
import parts
import pytest

from host.camera.lens import Lens

MILD, WIDE = (-0.1, 0.02, 0.001, -0.001, 0.0), (-0.35, 0.12, 0.001, 0.002, -0.02)


@pytest.mark.parametrize("terms", [MILD, WIDE, (0.0,) * 5])
@pytest.mark.parametrize("count", [0, 1, 3, 4, 5, 8, 1001])
def test_what_a_lens_bends_is_straight_again(terms: tuple[float, ...], count: int):
    straight = np.random.default_rng(count).uniform((20, 20), (300, 220), (count, 2))
    focal, centre = (280.0, 275.0), (158.0, 121.0)
    bent = Lens(320, 240, *focal, *centre, terms).to_pixels((straight - centre) / focal)
    assert np.allclose(ideal(terms, bent), straight, atol=1e-5)


def ideal(terms: tuple[float, ...], points: np.ndarray) -> np.ndarray:
    """(N, 2) where a camera without distortion would see points (N, 2)."""
    flat = (ctypes.c_double * (2 * len(points) + 2))(*np.ascontiguousarray(points).ravel())
    out = (ctypes.c_double * (2 * len(points) + 2))()
    parts.library().probe_ideal((ctypes.c_double * 5)(*terms), flat, len(points), out)
    return np.array(out[: 2 * len(points)]).reshape(-1, 2)
