"""The cheapest way over the map's grid: A* that keeps off obstacles and rather goes where floor was seen.

Blocks of cells are searched first, each standing for the best cell in it; only where the way found so does
not fit between them the cells themselves are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from host.nav import _nav
from host.nav.map import ObstacleMap
from host.pose import wrap

UNKNOWN_COST = 3.0  # where the robot would stand on floor not seen yet costs this many free cells
CROWDED_COST = 3.0  # extra for a cell at the hard limit, falling to nothing at the comfortable distance
HASTE = 1.3  # weight of the straight-line distance: fewer cells looked at, ways at most this much longer
SIDEWAYS = 0.75  # part of the clearance kept from what is passed
TURN_CM = 50.0  # cells up to here cost more the farther they lie from where the robot looks
TURN_COST = 2.5  # so much right behind it: a half turn takes as long as a metre ahead
COARSE = 2  # cells along the side of a block
LEGS = np.array([0.25, 0.5, 0.75])[:, None, None]  # of a leg from block to block, where it is checked


@dataclass(frozen=True)
class Room:
    """How far each cell's centre is from the border of the nearest cell of a kind, (N, N) float32, cm.

    What lies off the map counts as of either kind.
    """

    to_filled: np.ndarray  # what moves is not counted: it will be gone
    to_unseen: np.ndarray  # the nearest cell not known to be free, filled ones included


def room_around(obstacle_map: ObstacleMap) -> Room:
    """Distances over the whole map."""
    cell = obstacle_map.config.cell_cm
    return Room(_distance(~obstacle_map.lasting, cell), _distance(obstacle_map.free, cell))


def _distance(inside: np.ndarray, cell_cm: float) -> np.ndarray:
    padded = np.pad(inside.astype(np.uint8), 1)
    return cv2.distanceTransform(padded, cv2.DIST_L2, 5)[1:-1, 1:-1] * cell_cm - cell_cm / 2


@dataclass(frozen=True)
class Way:
    """Points (x, z) in cm from the robot's middle on, and whether they lead all the way to the goal."""

    points: tuple[tuple[float, float], ...]
    to_goal: bool


def find_way(
    obstacle_map: ObstacleMap,
    room: Room,
    start_cm: tuple[float, float],
    goal_cm: tuple[float, float],
    heading_rad: float,
) -> Way:
    """The cheapest way to within the goal's tolerance, or to the reachable place nearest to the goal.

    The disc of the robot and most of its clearance must fit everywhere,
    except right where it stands: it may always leave a place it has got into. Ways that begin in the
    direction it looks are preferred, or it would turn to and fro before a wide obstacle.
    """
    shut, cost = _terrain(obstacle_map, room, start_cm, heading_rad)
    way = _way_over(obstacle_map, shut, cost, start_cm, goal_cm, COARSE)
    reach = obstacle_map.config.goal_tolerance_cm
    just_off = not way.to_goal and math.dist(way.points[-1], goal_cm) < 2 * reach
    if not just_off and _fits(obstacle_map, room, way):
        return way
    return _way_over(obstacle_map, shut, cost, start_cm, goal_cm, 1)


def _terrain(
    obstacle_map: ObstacleMap, room: Room, start_cm: tuple[float, float], heading_rad: float
) -> tuple[np.ndarray, np.ndarray]:
    """(cells that are shut, cost of entering each cell), both (N, N)."""
    body, config = obstacle_map.body, obstacle_map.config
    hard, comfort = tightest(obstacle_map), config.comfort_cm
    shut = room.to_filled < hard
    if comfort > 0:
        crowded = np.clip((hard + comfort - room.to_filled) / np.float32(comfort), 0.0, 1.0)
        cost = 1.0 + CROWDED_COST * crowded**2
    else:
        cost = np.ones_like(room.to_filled)
    cost[room.to_unseen < body.radius_cm] *= UNKNOWN_COST

    start = obstacle_map.cell_of(*start_cm)
    near = _window(obstacle_map, start, TURN_CM)
    dx = obstacle_map.centres_cm[near[1]][None, :] - start_cm[0]
    dz = obstacle_map.centres_cm[near[0]][:, None] - start_cm[1]
    aside = np.abs(wrap(np.arctan2(dx, dz) - heading_rad))
    cost[near] += np.where(np.hypot(dx, dz) < TURN_CM, TURN_COST * aside / math.pi, 0.0)

    here = _window(obstacle_map, start, body.radius_cm)
    shut[here] = room.to_filled[here] <= 0.0  # the filled cells themselves
    cost[here] += 4.0 * np.clip((hard - room.to_filled[here]) / hard, 0.0, 1.0)
    shut[start] = False
    return shut, cost


def _window(obstacle_map: ObstacleMap, cell: tuple[int, int], around_cm: float) -> tuple[slice, slice]:
    """Rows and columns up to so far from a cell."""
    n = math.ceil(around_cm / obstacle_map.config.cell_cm)
    rows, cols = (slice(max(0, k - n), k + n + 1) for k in cell)
    return rows, cols


def _way_over(
    obstacle_map: ObstacleMap, shut: np.ndarray, cost: np.ndarray, start_cm, goal_cm, block: int
) -> Way:
    """The cheapest way over blocks of so many cells a side, each passed in its best cell."""
    config = obstacle_map.config
    step = block * config.cell_cm
    price = np.where(shut, np.float32(np.inf), cost)
    least = np.minimum.reduce([price[i::block, j::block] for i in range(block) for j in range(block)])
    opened = np.isfinite(least)
    middles = obstacle_map.centres_cm.reshape(-1, block).mean(axis=1).astype(np.float32)
    row, col = obstacle_map.cell_of(*start_cm)
    start = row // block, col // block
    _, parts = cv2.connectedComponents(opened.astype(np.uint8), connectivity=8)
    left = np.hypot(middles[None, :] - goal_cm[0], middles[:, None] - goal_cm[1])
    reachable = np.where(parts == parts[start], left, np.float32(np.inf))
    # half a cell of either kind, and the camera, which counts, is ahead of the middle
    reach = config.goal_tolerance_cm + (config.cell_cm / 2 if block == 1 else 0.0)
    to_goal = float(reachable.min()) <= reach
    if not to_goal:
        r, c = np.unravel_index(int(reachable.argmin()), left.shape)
        left, reach = np.hypot(middles[None, :] - middles[c], middles[:, None] - middles[r]), 0.0
    blocks = _search(~opened, least, start, left / step, reach / step)
    best = [_best_cell(price, at, block) for at in blocks[1:]]
    return Way(tuple(obstacle_map.point_of(*cell) for cell in [(row, col), *best]), to_goal)


def _best_cell(price: np.ndarray, at: tuple[int, int], block: int) -> tuple[int, int]:
    row, col = block * at[0], block * at[1]
    best = int(price[row : row + block, col : col + block].argmin())
    return row + best // block, col + best % block


def _fits(obstacle_map: ObstacleMap, room: Room, way: Way) -> bool:
    """Whether the legs of a way over blocks keep off what is filled; where it begins does not count."""
    points = np.array(way.points)
    legs = (points[None, :-1] + LEGS * (points[None, 1:] - points[None, :-1])).reshape(-1, 2)
    legs = legs[np.hypot(*(legs - points[0]).T) > obstacle_map.body.radius_cm]
    least = tightest(obstacle_map) - obstacle_map.config.cell_cm / 2
    return bool((at_points(obstacle_map, room.to_filled, legs) >= least).all())


def at_points(obstacle_map: ObstacleMap, layer: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(K,) of what lies over the map's cells, (N, N), at points (K, 2)."""
    cells = np.floor((points + obstacle_map.half_cm) / obstacle_map.config.cell_cm).astype(int)
    cells = np.clip(cells, 0, len(layer) - 1)
    return layer[cells[:, 1], cells[:, 0]]


def _search(
    shut: np.ndarray, cost: np.ndarray, start: tuple[int, int], left: np.ndarray, reach: float
) -> list[tuple[int, int]]:
    """Cells from the start to the first one with no more than `reach` cells `left`, which can be got to."""
    way = _nav.search(shut, cost, HASTE * left, left <= reach, *start)
    if len(way) == 0:
        raise ValueError(f"no way from {start} though the target is in the same open part of the map")
    rows, cols = np.divmod(way, shut.shape[1])
    return list(zip(rows.tolist(), cols.tolist(), strict=True))


def tightest(obstacle_map: ObstacleMap) -> float:
    """Least room in cm at which the robot's middle may pass a filled cell sideways."""
    return obstacle_map.body.radius_cm + obstacle_map.config.clearance_cm * SIDEWAYS
