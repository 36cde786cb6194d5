"""Which way to the goal is followed, and which point of it is gone to next, straight."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from host.nav import _nav
from host.nav.ahead import LEAST_ROOM_CM, look_ahead
from host.nav.intent import Plan
from host.nav.map import ObstacleMap
from host.nav.plan import Room, Way, at_points, find_way, room_around, tightest
from host.pose import bearing, wrap

PLAN_EVERY_S = 0.5
KEEP_WAY_S = 2.0  # a way that is still open is followed for so long before a better one is looked for
SAVES_S = 1.5  # and left only for one that takes less time by this
SAVES_SHARE = 0.2  # and by this part of what is left, for what is seen next may cost the new one as much
SETS_OUT_CM = 30.0  # a way sets out towards its point this far on
WAY_STEP_CM = 40.0  # points of the way that are looked at for what moves
WORTH_CM = 15.0  # a way that does not reach the goal must bring the robot this much nearer
SIDE_STEP_RAD = math.radians(15)  # headings tried where the way is shut right at the rim


def planned(
    plan: Plan, obstacle_map: ObstacleMap, t_s: float, here: tuple[float, float], heading: float, goal_cm
) -> Plan:
    """A fresh way when the last one is old, and the next aim on it at the end of a straight piece."""
    config = obstacle_map.config
    if t_s - plan.made_s < PLAN_EVERY_S:
        return plan
    room = room_around(obstacle_map)
    kept = _rest_of(plan, obstacle_map, room, here)
    if kept is None or t_s - plan.found_s > KEEP_WAY_S:
        found = find_way(obstacle_map, room, here, goal_cm, heading)
        way = _worth_changing(obstacle_map, room, heading, kept, found)
        plan = replace(plan, found_s=t_s)
    else:
        way = kept
    gain = math.dist(here, goal_cm) - math.dist(way.points[-1], goal_cm)
    if not way.to_goal and gain < WORTH_CM:
        return replace(plan, way=None, aim=None, piece_from=None, made_s=t_s)
    plan = replace(plan, way=way, made_s=t_s)
    aim = _aim_on(way, obstacle_map, room, here, goal_cm)
    old = plan.aim
    over_unseen = not is_clear(obstacle_map, room, here, aim, over_unseen=False)
    far = old is not None and math.dist(old, here) > 2 * config.cell_cm
    if old is not None and far and is_clear(obstacle_map, room, here, old, over_unseen):
        if plan.piece_from is None:  # turning: towards whichever of the two is nearer, so as not to dither
            aim = min(old, aim, key=lambda p: abs(wrap(bearing(here, p) - heading)))
        elif math.dist(plan.piece_from, here) < config.piece_cm:
            aim = old
    return replace(plan, aim=aim, unseen=over_unseen)


def meant(
    plan: Plan, here: tuple[float, float], goal_cm: tuple[float, float]
) -> tuple[tuple[float, float], ...]:
    """(x, z) that the plan leads by: its aim, and what is left of its way beyond that."""
    if plan.aim is None or plan.way is None:
        return ()
    aim, way = plan.aim, plan.way.points
    points = [aim]
    nearest = min(range(len(way)), key=lambda k: math.dist(way[k], aim))
    for point in way[nearest + 1 :]:
        if math.dist(point, points[-1]) > WAY_STEP_CM:
            points.append(point)
    if plan.way.to_goal and math.dist(points[-1], goal_cm) > WAY_STEP_CM / 4:
        points.append(goal_cm)
    return tuple(p for k, p in enumerate(points) if k or math.dist(p, here) > 5.0)


def _worth_changing(
    obstacle_map: ObstacleMap, room: Room, heading: float, kept: Way | None, found: Way
) -> Way:
    """The way that was kept, unless the one just found is clearly quicker."""
    if kept is None or not found.to_goal:
        return found
    kept_s, found_s = (_time_of(obstacle_map, room, heading, way) for way in (kept, found))
    return found if found_s < (1 - SAVES_SHARE) * kept_s - SAVES_S else kept


def _time_of(obstacle_map: ObstacleMap, room: Room, heading: float, way: Way) -> float:
    """Seconds a way takes, with the turn it begins with: slower over unseen floor and close to things."""
    config = obstacle_map.config
    points = np.array(way.points)
    legs_cm = np.hypot(*np.diff(points, axis=0).T)
    if len(legs_cm) == 0:
        return 0.0
    out = points[min(int(np.searchsorted(legs_cm.cumsum(), SETS_OUT_CM)) + 1, len(points) - 1)]
    turn = abs(wrap(bearing((points[0, 0], points[0, 1]), (out[0], out[1])) - heading))
    middles = (points[1:] + points[:-1]) / 2
    unseen = at_points(obstacle_map, room.to_unseen, middles) < obstacle_map.body.radius_cm
    snug = at_points(obstacle_map, room.to_filled, middles) < tightest(obstacle_map) + config.comfort_cm / 2
    speed_cm_s = np.where(unseen | snug, config.creep_cm_s, config.speed_cm_s)
    return float((legs_cm / speed_cm_s).sum()) + turn / config.turn_rad_s


def _rest_of(plan: Plan, obstacle_map: ObstacleMap, room: Room, here) -> Way | None:
    """What is left of the way, if it is still open; None where another one must be found."""
    if plan.way is None or not plan.way.to_goal:
        return None
    points = np.array(plan.way.points)
    away = np.hypot(*(points - here).T)
    nearest = int(away.argmin())
    rest = points[nearest + 1 :]
    if len(rest) == 0 or away[nearest] > 4 * obstacle_map.config.cell_cm:
        return None
    far = away[nearest + 1 :] > obstacle_map.body.radius_cm
    if not (at_points(obstacle_map, room.to_filled, rest[far]) >= tightest(obstacle_map)).all():
        return None
    return Way((here, *((px, pz) for px, pz in rest.tolist())), True)


def _aim_on(way: Way, obstacle_map: ObstacleMap, room: Room, here, goal_cm) -> tuple[float, float]:
    """The farthest point of the way that a straight line reaches, or a side step where that is shut."""
    points = [*way.points[1:], *([goal_cm] if way.to_goal else [])]
    points = [p for p in points if math.dist(p, here) > 2 * obstacle_map.config.cell_cm] or points[-1:]
    first = points[0] if points else goal_cm
    aim = first
    for over_unseen in (False, True):  # over floor that was seen, if any such piece begins here
        for point in points:
            if not is_clear(obstacle_map, room, here, point, over_unseen):
                break
            aim = point
        if aim != first:
            break
    return _side_step(obstacle_map, here, aim)


def _side_step(obstacle_map: ObstacleMap, here, aim) -> tuple[float, float]:
    """The aim itself, or where it is shut right at the rim a short piece along the nearest open heading."""
    wanted = bearing(here, aim)
    for k in range(2 * math.ceil(math.pi / SIDE_STEP_RAD)):
        heading = wanted + (k + 1) // 2 * (SIDE_STEP_RAD if k % 2 else -SIDE_STEP_RAD)
        ahead = look_ahead(obstacle_map, here[0], here[1], heading)
        room = ahead.room_cm
        if room > LEAST_ROOM_CM or (ahead.obstacle is not None and ahead.obstacle.moving):
            length = min(room, obstacle_map.config.piece_cm) if k else math.dist(here, aim)
            return here[0] + length * math.sin(heading), here[1] + length * math.cos(heading)
    return aim


def is_clear(obstacle_map: ObstacleMap, room: Room, start, end, over_unseen: bool) -> bool:
    """Whether the robot fits all along a straight line; where it stands does not count."""
    first, half, cell = obstacle_map.body.radius_cm, obstacle_map.half_cm, obstacle_map.config.cell_cm
    if _nav.least_along(room.to_filled, half, cell, start, end, first) < tightest(obstacle_map):
        return False
    return over_unseen or _nav.least_along(room.to_unseen, half, cell, start, end, first) >= first
