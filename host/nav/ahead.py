"""What a straight drive would meet, and how fast the robot may go towards it.

Whatever a plan says, this has the last word: nothing filled nearer than the clearance while moving forward,
no more speed than can be braked, a creep over floor that was only looked over yet, and none where the
camera never looked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from host.nav import _nav
from host.nav.config import NavConfig
from host.nav.map import FREE, LOOKED, OCCUPIED, Obstacle, ObstacleMap
from host.nav.plan import tightest
from host.nav.stand import AT_BORDER
from host.pose import wrap

REACH_CM = 150.0  # what is farther ahead is of no interest
SURE_SIGMAS = 2.0  # an obstacle may be nearer than measured by so many of its sigmas
ONTO_BLIND_CM = 3.0  # the rim goes no farther onto floor it never looked at
LEAST_ROOM_CM = 8.0  # a heading with less room than this is no way on


@dataclass(frozen=True)
class Ahead:
    """What a straight drive along one heading would meet."""

    room_cm: float  # the rim can go this far before it touches something
    unseen_cm: float  # and this far before it leaves floor known to be free
    blind_cm: float  # or before it comes to where it never looked
    obstacle: Obstacle | None  # what it would touch
    cell_cm: tuple[float, float] | None = None  # where, (x, z)
    edge: bool = False  # it would come to the edge of the map first
    sigma_cm: float = 0.0  # of the room, as far as the obstacle's place is in doubt
    brief: bool = False  # it moves, or stands somewhere below the picture

    @property
    def hides_below(self) -> bool:
        """What it would touch moves, and is nobody knows how much nearer than the picture's lower border."""
        return self.obstacle is not None and self.obstacle.moving and self.obstacle.how == AT_BORDER

    def __str__(self) -> str:
        return "the edge of the map" if self.edge else str(self.obstacle or "something remembered")


def look_ahead(
    obstacle_map: ObstacleMap,
    x: float,
    z: float,
    heading: float,
    reach_cm: float = REACH_CM,
    passed: np.ndarray | None = None,
) -> Ahead:
    """What the disc of the robot meets when its middle goes straight along a heading.

    Cells `passed`, (N, N) bool, are taken for floor: it is known better that it goes past what they hold.
    Beyond the map nothing is known and nothing can be: for the disc its edge is a wall.
    """
    config, radius = obstacle_map.config, obstacle_map.body.radius_cm
    half_cell = config.cell_cm / 2
    wide = tightest(obstacle_map)

    row0, col0 = obstacle_map.cell_of(x - reach_cm, z - reach_cm)
    row1, col1 = obstacle_map.cell_of(x + reach_cm, z + reach_cm)
    room, unseen, blind, row, col = _nav.meet(
        obstacle_map.evidence if passed is None else np.where(passed, 2 * FREE, obstacle_map.evidence),
        obstacle_map.centres_cm,
        (row0, row1, col0, col1),
        x,
        z,
        heading,
        radius,
        wide + half_cell,
        (OCCUPIED, FREE, LOOKED),
        half_cell,
        reach_cm,
    )
    obstacle, cell, brief = None, None, False
    if row >= 0:
        brief = bool(obstacle_map.brief[row, col])
        obstacle, cell = obstacle_map.obstacle_at(row, col), obstacle_map.point_of(row, col)
    to_edge = _room_on_map(obstacle_map, x, z, heading)
    unseen = max(0.0, min(unseen, to_edge))
    if to_edge < room:
        return Ahead(to_edge, unseen, blind, None, None, edge=True)
    sigma = 0.0 if obstacle is None or cell is None else obstacle_map.sigma_at(obstacle, cell)
    return Ahead(room, unseen, blind, obstacle, cell, sigma_cm=sigma, brief=brief)


def _room_on_map(obstacle_map: ObstacleMap, x: float, z: float, heading: float) -> float:
    """How far the middle can go until the disc leaves the map, cm."""
    most = obstacle_map.half_cm - obstacle_map.body.radius_cm
    ways = [
        (most - math.copysign(1.0, part) * place) / abs(part)
        for place, part in ((x, math.sin(heading)), (z, math.cos(heading)))
        if abs(part) > 1e-9
    ]
    return min(ways)


def room_behind_cm(obstacle_map: ObstacleMap, x: float, z: float, heading: float) -> float:
    """How far the robot may go straight back, over floor that was seen; the clearance is left."""
    behind = look_ahead(obstacle_map, x, z, wrap(heading + math.pi))
    return min(behind.room_cm, behind.unseen_cm) - obstacle_map.config.clearance_cm


def brakeable_cm_s(config: NavConfig, distance_cm: float) -> float:
    """The speed from which the robot still stops within a distance."""
    a, tau = config.brake_cm_s2, config.reaction_s
    return -a * tau + math.sqrt((a * tau) ** 2 + 2 * a * max(0.0, distance_cm))


def speed_ahead(ahead: Ahead, obstacle_map: ObstacleMap, keep_cm: float | None = None) -> tuple[float, str]:
    """Forward speed in cm/s that the room ahead allows, and the line that explains it.

    `keep_cm` is left of the room, the clearance where nothing is given.
    """
    config = obstacle_map.config
    keep = config.clearance_cm if keep_cm is None else keep_cm
    fast = brakeable_cm_s(config, ahead.room_cm - keep)
    sure = brakeable_cm_s(config, ahead.room_cm - SURE_SIGMAS * ahead.sigma_cm - keep)
    doubted = min(fast, max(sure, config.creep_cm_s))
    blind = config.creep_cm_s + brakeable_cm_s(config, ahead.unseen_cm)
    never = brakeable_cm_s(config, ahead.blind_cm + ONTO_BLIND_CM)
    v = min(config.speed_cm_s, doubted, blind, never)
    if ahead.hides_below:
        return 0.0, f"stop: {ahead} or nearer"
    if fast < 1.0:
        return 0.0, f"stop: {ahead}, {ahead.room_cm:.0f} cm from the rim"
    if never < 1.0:
        return 0.0, "stop: never looked at the floor at the rim"
    if v == config.speed_cm_s:
        then = f", then {ahead}" if ahead.obstacle else ""
        return v, f"straight: {ahead.room_cm:.0f} cm free ahead{then}"
    if never < min(blind, doubted):
        return v, f"slow: never looked at the floor {max(0.0, ahead.blind_cm):.0f} cm ahead"
    if blind < doubted:
        return v, f"creep: floor seen only {ahead.unseen_cm:.0f} cm ahead, looking for depth"
    if doubted < min(fast, config.speed_cm_s):
        return v, f"creep: {ahead}, {ahead.room_cm:.0f} cm from the rim, in doubt: looking for parallax"
    return v, f"slow: {ahead}, {ahead.room_cm:.0f} cm from the rim"


def is_blind(ahead: Ahead, config: NavConfig) -> bool:
    """Whether the robot stands before floor it never looked at, and before nothing else."""
    return brakeable_cm_s(config, ahead.blind_cm + ONTO_BLIND_CM) < 1.0 and ahead.blind_cm < ahead.room_cm
