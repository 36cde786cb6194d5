"""Where the line of something that goes to and fro is best crossed: straight, and where it is longest away.

Where it turns round on one side, it is away for longer the farther that is from where the robot crosses.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from host.nav.config import BodyConfig, NavConfig
from host.nav.mover import Mover
from host.nav.yielding import BERTH_CM, GAIN_CM_S2, WAIT_CM

PLENTY = 2.0  # times as long as crossing takes is long enough
WORTH_CM = 300.0  # so much way is worth as much as never having time, or plenty
STEP_CM = 6.0
BEYOND_CM = 40.0  # of where it turns round: there nobody needs to wait
ACROSS_CM = 10.0  # beyond its line a crossing ends
SPARE_CM = 12.0  # and there may be room for so much more: what stands there may be nearer than it seems

Place = tuple[float, float]


@dataclass(frozen=True)
class Crossing:
    """From where to where (x, z), both outside its line, and at right angles to it."""

    begin: Place
    end: Place
    heading: float

    def aside_cm(self, place: Place) -> float:
        """How far a place is beside the straight line across, to the right."""
        dx, dz = place[0] - self.begin[0], place[1] - self.begin[1]
        return dx * math.cos(self.heading) - dz * math.sin(self.heading)


def best_crossing(
    mover: Mover,
    here: Place,
    body: BodyConfig,
    config: NavConfig,
    is_open: Callable[[Place, Place], bool],
) -> Crossing | None:
    """The quickest place to cross, waiting included; None where nothing leads across.

    Parameters
    ----------
    is_open : whether the robot fits along a straight line between two places.
    """
    rel = np.array(here) - mover.origin_cm
    on, off = float(rel @ mover.ahead), float(rel @ (mover.ahead[1], -mover.ahead[0]))
    side = math.copysign(1.0, off)
    normal = np.array([mover.ahead[1], -mover.ahead[0]]) * side
    keep = mover.half_cm + body.radius_cm + BERTH_CM
    low, high = mover.been_cm
    known = mover.low_cm is not None and mover.high_cm is not None
    here_cm = keep + WAIT_CM
    reach = BEYOND_CM + keep
    places = [on, *np.arange(low - reach, high + reach, STEP_CM).tolist()] if known else [on]
    worth = {}
    for at in places:
        foot = np.array(mover.origin_cm) + at * np.array(mover.ahead)
        begin, end = foot + here_cm * normal, foot - (keep + ACROSS_CM) * normal
        way = math.dist(here, begin)
        time = min(PLENTY, _away_s(mover, at, keep) / _takes_s(keep, config))
        cost = way + WORTH_CM * (1.0 - time / PLENTY)
        worth[cost] = (float(begin[0]), float(begin[1])), (float(end[0]), float(end[1]))
    for spare in (SPARE_CM, 0.0):
        for cost in sorted(worth):
            begin, end = worth[cost]
            beyond = end[0] - spare * float(normal[0]), end[1] - spare * float(normal[1])
            if is_open(begin, beyond) and (math.dist(here, begin) < STEP_CM or is_open(here, begin)):
                return Crossing(begin, end, math.atan2(end[0] - begin[0], end[1] - begin[1]))
    return None


def _away_s(mover: Mover, at_cm: float, keep_cm: float) -> float:
    """How long it stays away from a place on its line at a time, at most."""
    low, high = mover.been_cm
    if at_cm + keep_cm < low or at_cm - keep_cm > high:
        return math.inf
    away_cm = 2 * max(at_cm - keep_cm - low, high - at_cm - keep_cm)
    return max(0.0, away_cm) / max(abs(mover.speed_cm_s), 1.0)


def _takes_s(keep_cm: float, config: NavConfig) -> float:
    """How long the robot is within so much of a line that it crosses."""
    return 2 * keep_cm / config.speed_cm_s + config.speed_cm_s / (2 * GAIN_CM_S2)
