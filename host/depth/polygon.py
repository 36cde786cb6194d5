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
        x, y = loop[:, 0], loop[:, 1]
        x1, y1 = np.append(x[1:], x[0]), np.append(y[1:], y[0])
        cross = x * y1 - x1 * y
        a = 0.5 * cross.sum()
        sign = (1.0 if k == 0 else -1.0) * (1.0 if a >= 0 else -1.0)
        area += sign * a
        first += sign * np.array([((x + x1) * cross).sum(), ((y + y1) * cross).sum()]) / 6
        xx = ((x * x + x * x1 + x1 * x1) * cross).sum() / 12
        yy = ((y * y + y * y1 + y1 * y1) * cross).sum() / 12
        xy = ((x * y1 + 2 * x * y + 2 * x1 * y1 + x1 * y) * cross).sum() / 24
        second += sign * np.array([xx, yy, xy])
    if area <= 0:
        return 0.0, np.zeros(2), np.zeros(3)
    centre = first / area
    spread = second / area - np.array([centre[0] ** 2, centre[1] ** 2, centre[0] * centre[1]])
    return area, centre, spread
