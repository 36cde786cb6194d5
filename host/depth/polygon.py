"""Area, centre and spread of a polygon with holes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def polygon_moments(loops: Sequence[np.ndarray]) -> tuple[float, np.ndarray, np.ndarray]:
    """Area, centroid (2,) and central second moments (3,) = xx, yy, xy of loops with holes.

    The first loop is the outer one; the rest are taken away from it whatever way they turn.
    """
    area, first, second = 0.0, np.zeros(2), np.zeros(3)
    for k, loop in enumerate(loops):
        x, y, x1, y1, cross = _edges(loop)
        a = 0.5 * cross.sum()
        sign = (1.0 if k == 0 else -1.0) * (1.0 if a >= 0 else -1.0)
        area += sign * a
        first += sign / 6 * np.array([(x + x1) @ cross, (y + y1) @ cross])
        xx, yy = (x * x + x * x1 + x1 * x1) @ cross / 12, (y * y + y * y1 + y1 * y1) @ cross / 12
        xy = (x * y1 + 2 * x * y + 2 * x1 * y1 + x1 * y) @ cross / 24
        second += sign * np.array([xx, yy, xy])
    if area <= 0:
        return 0.0, np.zeros(2), np.zeros(3)
    centre = first / area
    spread = second / area - np.array([centre[0] ** 2, centre[1] ** 2, centre[0] * centre[1]])
    return area, centre, spread


def polygon_area(loops: Sequence[np.ndarray]) -> float:
    """Area of the first loop less that of the others."""
    areas = [abs(0.5 * _edges(loop)[4].sum()) for loop in loops]
    return float(areas[0] - sum(areas[1:]))


def outline_length(loops: Sequence[np.ndarray]) -> float:
    """Length of all loops together."""
    return float(sum(np.hypot(x1 - x, y1 - y).sum() for x, y, x1, y1, _ in map(_edges, loops)))


def _edges(loop: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Both ends of every edge, and their cross product."""
    x, y = loop[:, 0], loop[:, 1]
    x1, y1 = np.append(x[1:], x[:1]), np.append(y[1:], y[:1])
    return x, y, x1, y1, x * y1 - x1 * y
