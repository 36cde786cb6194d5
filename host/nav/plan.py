"""The cheapest way over the map's grid: A* that keeps off obstacles and rather goes where floor was seen."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

import cv2
import numpy as np

from host.nav.map import ObstacleMap

UNKNOWN_COST = 3.0  # where the robot would stand on floor not seen yet costs this many free cells
CROWDED_COST = 3.0  # extra for a cell at the hard limit, falling to nothing at the comfortable distance
HASTE = 1.3  # weight of the straight-line distance: fewer cells looked at, ways at most this much longer
SIDEWAYS = 0.75  # part of the clearance kept from what is passed
TURN_CM = 50.0  # cells up to here cost more the farther they lie from where the robot looks
TURN_COST = 2.5  # so much right behind it: a half turn takes as long as a metre ahead
STEPS = [(dr, dc, math.hypot(dr, dc)) for dr in (-1, 0, 1) for dc in (-1, 0, 1) if dr or dc]


@dataclass(frozen=True)
class Room:
    """How far each cell's centre is from the border of the nearest cell of a kind, (N, N) float32, cm.

    What lies off the map counts as of either kind.
    """

    to_filled: np.ndarray
    to_unseen: np.ndarray  # the nearest cell not known to be free, filled ones included


def room_around(obstacle_map: ObstacleMap) -> Room:
    """Distances over the whole map."""
    cell = obstacle_map.config.cell_cm
    return Room(_distance(~obstacle_map.occupied, cell), _distance(obstacle_map.free, cell))


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
    start = obstacle_map.cell_of(*start_cm)
    _, parts = cv2.connectedComponents((~shut).astype(np.uint8), connectivity=8)
    rows, cols = np.nonzero(parts == parts[start])
    goal_row, goal_col = obstacle_map.cell_of(*goal_cm)
    off = np.hypot(rows - goal_row, cols - goal_col)
    nearest = int(np.argmin(off))
    reach = obstacle_map.config.goal_tolerance_cm / obstacle_map.config.cell_cm
    to_goal = bool(off[nearest] <= reach)
    target = (goal_row, goal_col) if to_goal else (int(rows[nearest]), int(cols[nearest]))
    cells = _search(shut, cost, start, target, reach if to_goal else 0.0)
    return Way(tuple(obstacle_map.point_of(*cell) for cell in cells), to_goal)


def _terrain(
    obstacle_map: ObstacleMap, room: Room, start_cm: tuple[float, float], heading_rad: float
) -> tuple[np.ndarray, np.ndarray]:
    """(cells that are shut, cost of entering each cell), both (N, N)."""
    body, config = obstacle_map.body, obstacle_map.config
    hard, comfort = tightest(obstacle_map), config.comfort_cm
    cost = 1.0 + CROWDED_COST * np.clip((hard + comfort - room.to_filled) / comfort, 0.0, 1.0) ** 2
    cost[room.to_unseen < body.radius_cm] *= UNKNOWN_COST
    shut = room.to_filled < hard
    start = obstacle_map.cell_of(*start_cm)
    leave = math.ceil(body.radius_cm / config.cell_cm)
    rows = slice(max(0, start[0] - leave), start[0] + leave + 1)
    cols = slice(max(0, start[1] - leave), start[1] + leave + 1)
    shut[rows, cols] = obstacle_map.occupied[rows, cols]
    dx = obstacle_map.centres_cm[None, :] - start_cm[0]
    dz = obstacle_map.centres_cm[:, None] - start_cm[1]
    aside = np.arccos(np.clip(np.cos(np.arctan2(dx, dz) - heading_rad), -1.0, 1.0))
    cost += np.where(np.hypot(dx, dz) < TURN_CM, TURN_COST * aside / math.pi, 0.0)
    cost[rows, cols] += 4.0 * np.clip((hard - room.to_filled[rows, cols]) / hard, 0.0, 1.0)
    shut[start] = False
    return shut, cost


def _search(shut: np.ndarray, cost: np.ndarray, start, target, reach: float) -> list[tuple[int, int]]:
    """Cells from the start to within reach of a target that is known to be connected with it."""
    side = shut.shape[0] + 2  # a shut rim spares the test for the border
    closed = np.pad(shut, 1, constant_values=True).ravel().tolist()
    price = np.pad(cost, 1, constant_values=1.0).ravel().tolist()
    rows, cols = np.divmod(np.arange(side * side), side)
    left = np.hypot(rows - 1 - target[0], cols - 1 - target[1])
    ahead = (HASTE * left).tolist()
    there = (left <= reach).tolist()
    steps = [(dr * side + dc, length) for dr, dc, length in STEPS]
    first = (start[0] + 1) * side + start[1] + 1
    best, came, queue = {first: 0.0}, {first: first}, [(0.0, first)]
    while queue:
        _, cell = heapq.heappop(queue)
        if closed[cell] and cell != first:
            continue
        if there[cell]:
            way = [cell]
            while way[-1] != first:
                way.append(came[way[-1]])
            return [(c // side - 1, c % side - 1) for c in reversed(way)]
        closed[cell] = True
        so_far = best[cell]
        for step, length in steps:
            other = cell + step
            if closed[other]:
                continue
            new = so_far + length * price[other]
            if new < best.get(other, math.inf):
                best[other] = new
                came[other] = cell
                heapq.heappush(queue, (new + ahead[other], other))
    raise ValueError(f"no way from {start} to {target} though both are in one open part of the map")


def tightest(obstacle_map: ObstacleMap) -> float:
    """Least room in cm at which the robot's middle may pass a filled cell sideways."""
    return obstacle_map.body.radius_cm + obstacle_map.config.clearance_cm * SIDEWAYS
