"""Who gives way: a robot that sees something move waits beside its way, and steps back out of it.

What moves is taken to go on as it does. Against that the robot's own choices are tried out for the next few
seconds: to drive on, to stand, to go back over floor it knows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from host.nav.map import Obstacle, ObstacleMap

FORESIGHT_S = 3.0
STEP_S = 0.2
BELIEVED_S = 2.0  # so long after it was last seen something is taken to go on moving
BERTH_CM = 8.0  # the rim keeps this far from where it will be
SPREAD_CM_S = 3.0  # and this much more for every second ahead, for nobody knows its mind
BACK_CM_S = 10.0
ASIDE_CM_S = 6.0  # who moves across the view faster than this does move
TOWARDS_CM_S = 10.0  # along it only who is faster: there errors of depth wander, too
SURE_SHARE = 0.2  # and whose place is known to this part of what it goes in a second
WATCH_CM = 45.0  # what moves nobody knows where to is waited for when it is nearer than this


@dataclass(frozen=True)
class Threat:
    """Something that moves, and how near the rim it would come, cm, by what the robot does."""

    obstacle: Obstacle
    driving_cm: float
    standing_cm: float
    back_cm: float

    def __str__(self) -> str:
        if self.obstacle.velocity_cm_s is None:
            return str(self.obstacle)
        return f"{self.obstacle} at {math.hypot(*self.obstacle.velocity_cm_s):.0f} cm/s"


def nearest_threat(
    obstacle_map: ObstacleMap, x: float, z: float, heading: float, t_s: float, speed_cm_s: float
) -> Threat | None:
    """What moves and would come nearest to the robot if it drove on; None where nothing comes too near."""
    threats = [
        _threat(obstacle_map, thing, (x, z), heading, t_s, speed_cm_s)
        for thing in obstacle_map.obstacles.values()
        if thing.moving and t_s - thing.t_s < BELIEVED_S and _surely(thing, (x, z))
    ]
    near = [t for t in threats if min(t.driving_cm, t.standing_cm) < BERTH_CM]
    return min(near, key=lambda t: min(t.driving_cm, t.standing_cm), default=None)


def _surely(thing: Obstacle, here: tuple[float, float]) -> bool:
    """Whether a motion is more than errors of depth that wander."""
    if thing.velocity_cm_s is None:
        return True
    front = (np.array(thing.left_cm) + thing.right_cm) / 2 - here
    towards = front / max(float(np.hypot(*front)), 1e-6)
    velocity = np.array(thing.velocity_cm_s)
    along = float(velocity @ towards)
    aside = abs(float(velocity[0] * towards[1] - velocity[1] * towards[0]))
    sure = thing.sigma_cm < SURE_SHARE * float(np.hypot(*velocity))
    return sure and (aside > ASIDE_CM_S or abs(along) > TOWARDS_CM_S)


def _threat(
    obstacle_map: ObstacleMap, thing: Obstacle, here, heading: float, t_s: float, speed_cm_s: float
) -> Threat:
    along = np.array([math.sin(heading), math.cos(heading)])
    middle, half = _disc_of(thing, here)
    if thing.velocity_cm_s is None:
        gap = math.dist(middle, here) - half - obstacle_map.body.radius_cm
        ahead = float(np.dot(middle - here, along)) > 0
        near = BERTH_CM - 1.0 if ahead and gap < WATCH_CM else math.inf
        return Threat(thing, near, gap, gap)
    after = np.arange(0.0, FORESIGHT_S + 1e-9, STEP_S)
    places = middle + (after[:, None] + (t_s - thing.t_s)) * np.array(thing.velocity_cm_s)
    keep = half + obstacle_map.body.radius_cm + SPREAD_CM_S * after

    def nearest(v_cm_s: float) -> float:
        robot = np.array(here) + v_cm_s * after[:, None] * along
        return float((np.hypot(*(places - robot).T) - keep).min())

    return Threat(thing, nearest(speed_cm_s), nearest(0.0), nearest(-BACK_CM_S))


def _disc_of(thing: Obstacle, here) -> tuple[np.ndarray, float]:
    """Middle and radius of something as round as it is wide, its front towards the robot."""
    left, right = np.array(thing.left_cm), np.array(thing.right_cm)
    half = float(np.hypot(*(right - left))) / 2
    front = (left + right) / 2
    away = front - here
    return front + half * away / max(float(np.hypot(*away)), 1e-6), half
