"""Which things move: those whose foot wanders over the floor evenly, and too fast for an error."""

from __future__ import annotations

from collections import deque

import numpy as np

from host.nav.stand import AT_BORDER, Feet, Standing

OVER_S = 0.8  # a velocity is that over so long
LEAST_S = 0.4
LEAST_SIGHTINGS = 5
SLOWEST_CM_S = 6.0  # the feet of what stands still wander more slowly as the robot comes nearer
STRAY_CM = 2.0  # rms of the places about an even motion; where regions merge or split they jump
WIDTH_SHARE = 0.25  # and the width changes by more than this


class Tracks:
    """Where every thing has lately been seen to stand."""

    def __init__(self) -> None:
        self._seen: dict[int, deque[tuple[float, float, float, float]]] = {}  # t, x, z, width

    def velocity(self, standing: Standing, feet: Feet, t_s: float) -> tuple[float, float] | None:
        """(x, z) in cm/s of a thing that surely moves, None otherwise; told of every sighting once."""
        columns = standing.columns
        whole = columns[0] > 0 and columns[-1] < len(feet.region) - 1
        if standing.how == AT_BORDER or not whole or feet.cut[columns].any():
            self._seen.pop(standing.region, None)
            return None
        seen = self._seen.setdefault(standing.region, deque())
        depth = float(standing.depth_cm.min())
        place = feet.point(int(columns[len(columns) // 2]), depth)
        seen.append((t_s, *place, feet.width_cm(columns, depth)))
        while seen[-1][0] - seen[0][0] > OVER_S:
            seen.popleft()
        return _even_motion(np.array(seen))

    def forget(self, t_s: float) -> None:
        """What was not seen for a while."""
        self._seen = {k: seen for k, seen in self._seen.items() if t_s - seen[-1][0] < OVER_S}


def _even_motion(seen: np.ndarray) -> tuple[float, float] | None:
    if len(seen) < LEAST_SIGHTINGS or seen[-1, 0] - seen[0, 0] < LEAST_S:
        return None
    if np.ptp(seen[:, 3]) > WIDTH_SHARE * seen[:, 3].mean():
        return None
    t = seen[:, 0] - seen[:, 0].mean()
    places = seen[:, 1:3] - seen[:, 1:3].mean(axis=0)
    velocity = t @ places / (t @ t)
    stray = places - t[:, None] * velocity
    if float(np.hypot(*velocity)) < SLOWEST_CM_S or float(np.sqrt((stray**2).sum(axis=1).mean())) > STRAY_CM:
        return None
    return float(velocity[0]), float(velocity[1])
