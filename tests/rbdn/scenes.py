"""Synthetic images with exactly known regions: analytic edge coverage, blurred, with noise."""

from __future__ import annotations

from math import erf, sqrt

import cv2
import numpy as np

_erf = np.vectorize(erf)


def _ramp(coordinates: np.ndarray, low: float, high: float, blur_px: float) -> np.ndarray:
    """Coverage of [low, high] seen by unit pixels centred at `coordinates` through a Gaussian blur."""

    def integral(x: np.ndarray) -> np.ndarray:
        u = x / blur_px
        return x * 0.5 * (1 + _erf(u / sqrt(2))) + blur_px * np.exp(-0.5 * u * u) / sqrt(2 * np.pi)

    def up(edge: float) -> np.ndarray:
        return integral(coordinates + 0.5 - edge) - integral(coordinates - 0.5 - edge)

    return up(low) - up(high)


def rectangle_coverage(
    shape: tuple[int, int], box: tuple[float, float, float, float], blur_px: float
) -> np.ndarray:
    """(H, W) coverage of the box (x0, y0, x1, y1), integer coordinate = pixel centre."""
    x0, y0, x1, y1 = box
    across = _ramp(np.arange(shape[1], dtype=float), x0, x1, blur_px)
    down = _ramp(np.arange(shape[0], dtype=float), y0, y1, blur_px)
    return down[:, None] * across[None, :]


def ellipse_coverage(
    shape: tuple[int, int], centre: tuple[float, float], axes: tuple[float, float]
) -> np.ndarray:
    """(H, W) coverage of an ellipse, 32x32 samples a pixel."""
    n = 32
    step = (np.arange(n) + 0.5) / n - 0.5
    y = (np.arange(shape[0])[:, None] + step).ravel()
    x = (np.arange(shape[1])[:, None] + step).ravel()
    inside = ((x[None, :] - centre[0]) / axes[0]) ** 2 + ((y[:, None] - centre[1]) / axes[1]) ** 2 <= 1
    return inside.reshape(shape[0], n, shape[1], n).mean((1, 3))


def compose(shape: tuple[int, int], background: tuple[int, int, int], layers: list) -> np.ndarray:
    """Linear-light mixture of (coverage, BGR) layers over a background, as 8-bit sRGB."""
    image = np.broadcast_to(_to_linear(background), (*shape, 3)).copy()
    for coverage, colour in layers:
        image += coverage[:, :, None] * (_to_linear(colour) - image)
    return _to_srgb(image)


def add_noise(image: np.ndarray, sigma: float, seed: int) -> np.ndarray:
    noisy = image + np.random.default_rng(seed).normal(0, sigma, image.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def random_scene(seed: int, shape: tuple[int, int] = (120, 160)) -> np.ndarray:
    """A few overlapping shapes in random colours, with noise; nothing is promised about them."""
    rng = np.random.default_rng(seed)
    image = np.full((*shape, 3), rng.integers(0, 256, 3), np.uint8)
    for _ in range(rng.integers(1, 7)):
        colour = tuple(int(c) for c in rng.integers(0, 256, 3))
        points = rng.integers(-20, 180, (rng.integers(3, 7), 2)).astype(np.int32)
        if rng.random() < 0.5:
            cv2.fillPoly(image, [points], colour, lineType=cv2.LINE_AA)
        else:
            cv2.circle(
                image, tuple(int(c) for c in points[0]), int(rng.integers(3, 50)), colour, -1, cv2.LINE_AA
            )
    return add_noise(image, rng.uniform(0, 12), seed)


def _to_linear(srgb) -> np.ndarray:
    s = np.asarray(srgb, float) / 255
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)


def _to_srgb(linear: np.ndarray) -> np.ndarray:
    s = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055)
    return np.clip(np.rint(255 * s), 0, 255).astype(np.uint8)
