"""Turning in place to see more: floor beside the way, all round where nothing is open, a covered goal."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from host.nav.ahead import LEAST_ROOM_CM, ONTO_BLIND_CM, brakeable_cm_s, look_ahead, room_behind_cm
from host.nav.aim import SIDE_STEP_RAD
from host.nav.command import Command, by_degrees, turn_rad_s
from host.nav.config import NavConfig
from host.nav.intent import Plan, Stuck
from host.nav.map import ObstacleMap
from host.nav.plan import tightest
from host.nav.stand import AT_BORDER
from host.nav.yielding import BACK_CM_S
from host.pose import bearing, wrap

FACE_RAD = math.radians(25)  # of a goal that something covers, before that is believed
SEEN_FROM_CM = 60.0  # a goal that is covered is believed to be from here
BELIEVE_S = 1.5  # and so long it is looked at
STEP_BACK_CM = 30.0  # from there the camera sees what was below its picture
GLANCE_CM = 35.0  # it looks at all such floor within this: the camera sees what is farther on the way
IN_VIEW, IN_VIEW_S = 0.4, 0.8  # X/Z up to which a place is well in view; hidden if not seen in so long
NEXT_CM = 2.5  # or this far aside
NEW_SIGHT_CM = 10.0  # what is hidden from here is so from everywhere within this


def glance_aside(
    plan: Plan, obstacle_map: ObstacleMap, t_s: float, here: tuple[float, float], heading: float
) -> tuple[Command | None, Plan]:
    """Turn to where the way leads over floor never looked at; no command: there is none left."""
    glance = plan.glance
    assert glance is not None
    spots = obstacle_map.blind_spots(*here, glance.heading, GLANCE_CM)
    moved = math.dist(here, glance.here) > ONTO_BLIND_CM
    if moved or len(spots) == 0:
        return None, replace(plan, glance=None, piece_from=None)
    bearings = np.arctan2(spots[:, 0] - here[0], spots[:, 1] - here[1])
    aside = wrap(bearings - glance.heading)
    side = glance.side
    if side == 0.0 or not (aside * side > 0.0).any():
        turned = wrap(heading - glance.heading)
        sides = [s for s in (1.0, -1.0) if (aside * s > 0.0).any()] or [1.0]
        side = max(sides, key=lambda s: s * turned)
        glance = replace(glance, side=side, viewed_s=None)
    last = int((aside * side).argmax())
    off = wrap(float(bearings[last]) - heading)
    dx, dz = (spots - here).T
    depth = dx * math.sin(heading) + dz * math.cos(heading) - obstacle_map.body.camera_ahead_cm
    across = np.abs(dx * math.cos(heading) - dz * math.sin(heading))
    viewed = (depth > 0.0) & (across < np.maximum(IN_VIEW * depth, NEXT_CM))
    since = (t_s if glance.viewed_s is None else glance.viewed_s) if viewed[last] else None
    plan = replace(plan, glance=replace(glance, viewed_s=since), piece_from=None)
    if since is not None and t_s - since > IN_VIEW_S:
        plan = hide(plan, obstacle_map, here, tuple((x, z) for x, z in spots[viewed].tolist()))
        return None, replace(plan, glance=None, made_s=-math.inf, way=None, aim=None)
    reason = f"{by_degrees(off)}: never looked at the floor there"
    return Command(0.0, turn_rad_s(off, obstacle_map.config), reason), plan


def hide(
    plan: Plan,
    obstacle_map: ObstacleMap,
    here: tuple[float, float],
    spots: tuple[tuple[float, float], ...] = (),
) -> Plan:
    """What looking at it did not show is shut, and stays so until the robot looks from elsewhere."""
    if plan.hidden_from is None or math.dist(plan.hidden_from, here) > NEW_SIGHT_CM:
        plan = replace(plan, hidden=(), hidden_from=here)
    plan = replace(plan, hidden=plan.hidden + spots)
    obstacle_map.shut(np.reshape(plan.hidden, (-1, 2)))
    return plan


def get_unstuck(
    plan: Plan, config: NavConfig, here: tuple[float, float], heading: float, reason: str
) -> tuple[Command, Plan]:
    """Something is in the way at the rim: look all round; blocked where that was done already."""
    stuck = plan.stuck or Stuck(here, heading)
    if stuck.turned_rad >= 2 * math.pi:
        return Command(0.0, 0.0, f"blocked: no way on after looking around; {reason}", "blocked"), plan
    plan = replace(plan, stuck=stuck, hidden=(), hidden_from=None)
    return Command(0.0, config.turn_rad_s, f"looking around: {reason}"), plan


def turn_all_round(
    plan: Plan, obstacle_map: ObstacleMap, here: tuple[float, float], heading: float
) -> tuple[Command | None, Plan]:
    """No command once that is done or some heading is open; forgotten once the robot gets on."""
    stuck, (x, z) = plan.stuck, here
    assert stuck is not None
    if math.dist(stuck.here, here) > ONTO_BLIND_CM:
        return None, replace(plan, stuck=None)
    headings = np.arange(0.0, 2 * math.pi, SIDE_STEP_RAD).tolist()
    if any(look_ahead(obstacle_map, x, z, heading + way).room_cm > LEAST_ROOM_CM for way in headings):
        return None, replace(plan, stuck=replace(stuck, heading=heading))
    turned = stuck.turned_rad + abs(wrap(heading - stuck.heading))
    plan = replace(plan, stuck=replace(stuck, heading=heading, turned_rad=turned), made_s=-math.inf)
    if turned >= 2 * math.pi:
        return None, plan
    left = math.degrees(2 * math.pi - turned)
    turn_rad_s = obstacle_map.config.turn_rad_s
    return Command(0.0, turn_rad_s, f"looking around for another {left:.0f} deg: no way on"), plan


def step_back(
    plan: Plan, obstacle_map: ObstacleMap, here: tuple[float, float], heading: float
) -> tuple[Command | None, Plan]:
    """Back from what covers the goal with its foot below the picture; no command: far enough, or shut."""
    config = obstacle_map.config
    assert plan.back_from is not None
    open_cm = room_behind_cm(obstacle_map, *here, heading)
    left_cm = STEP_BACK_CM - math.dist(plan.back_from, here)
    v = min(BACK_CM_S, brakeable_cm_s(config, min(open_cm, left_cm)))
    if v <= 1.0:
        return None, replace(plan, back_from=None, made_s=-math.inf, lost_s=None)
    return Command(-10 * v, 0.0, "stepping back to see what covers the goal"), plan


def no_way(
    plan: Plan, t_s: float, heading: float, obstacle_map: ObstacleMap, here: tuple[float, float], goal_cm
) -> tuple[Command, Plan]:
    """At once where the goal itself is the reason, once that was looked at; else look around for a way."""
    config, body = obstacle_map.config, obstacle_map.body
    to_edge = obstacle_map.half_cm - max(abs(goal_cm[0]), abs(goal_cm[1]))
    if to_edge < tightest(obstacle_map) - config.goal_tolerance_cm:
        reason = f"blocked: the goal is {to_edge:.0f} cm from the edge of the map; set nav.map_half_cm"
        return Command(0.0, 0.0, reason, "blocked"), plan
    covered, below = _cover_of(obstacle_map, goal_cm)
    away = math.dist(here, goal_cm)
    if covered is not None and away < config.goal_tolerance_cm + 2 * body.radius_cm + SEEN_FROM_CM:
        error = wrap(bearing(here, goal_cm) - heading)
        lost = t_s if plan.lost_s is None else plan.lost_s
        plan = replace(plan, lost_s=lost, piece_from=None, last_heading=heading)
        if abs(error) > FACE_RAD:
            turn = Command(
                0.0, math.copysign(config.turn_rad_s, error), f"turn to the goal: {covered} covers it"
            )
            return turn, replace(plan, lost_s=t_s)
        if below and not plan.stepped_back:
            plan = replace(plan, back_from=here, stepped_back=True)
            back, plan = step_back(plan, obstacle_map, here, heading)
            if back is not None:
                return back, plan
            plan = replace(plan, lost_s=lost)
        reason = f"the goal is covered by {covered}, {away - body.radius_cm:.0f} cm from the rim"
        if t_s - lost < BELIEVE_S:
            return Command(0.0, 0.0, f"stop: {reason}"), plan
        return Command(0.0, 0.0, f"blocked: {reason}", "blocked"), plan
    return _look_around(plan, t_s, heading, obstacle_map, here)


def _cover_of(obstacle_map: ObstacleMap, goal_cm: tuple[float, float]) -> tuple[str | None, bool]:
    """What leaves no room for the robot within the tolerance of the goal, in words; None where there is.

    And whether its foot is below the picture, so that nobody knows where it stands, or if it does.
    """
    config = obstacle_map.config
    reach = config.goal_tolerance_cm + config.cell_cm / 2
    steps = np.arange(-reach, reach + 1e-9, config.cell_cm)
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    offsets = offsets[np.hypot(*offsets.T) <= reach]
    n = math.ceil((reach + obstacle_map.body.radius_cm) / config.cell_cm) + 2
    row, col = obstacle_map.cell_of(*goal_cm)
    window = slice(max(0, row - n), row + n + 1), slice(max(0, col - n), col + n + 1)
    rows, cols = np.nonzero(obstacle_map.lasting[window])
    if len(rows) == 0:
        return None, False
    rows, cols = rows + window[0].start, cols + window[1].start
    filled = np.column_stack([obstacle_map.centres_cm[cols], obstacle_map.centres_cm[rows]])
    gaps = np.hypot(*(np.add(goal_cm, offsets)[:, None] - filled[None]).transpose(2, 0, 1))
    if float(gaps.min(axis=1).max()) >= tightest(obstacle_map) + config.cell_cm / 2:
        return None, False
    k = int(np.hypot(*(filled - goal_cm).T).argmin())
    thing = obstacle_map.obstacle_at(int(rows[k]), int(cols[k]))
    return str(thing or "something remembered"), thing is not None and thing.how == AT_BORDER


def _look_around(
    plan: Plan, t_s: float, heading: float, obstacle_map: ObstacleMap, here: tuple[float, float]
) -> tuple[Command, Plan]:
    """No way known: turn on the spot to see more; after a full turn and a while the drive is blocked."""
    turned = 0.0 if plan.lost_s is None else abs(wrap(heading - plan.last_heading))
    lost = t_s if plan.lost_s is None else plan.lost_s
    looked = plan.looked_rad + turned
    plan = replace(plan, lost_s=lost, looked_rad=looked, last_heading=heading, piece_from=None)
    ahead = look_ahead(obstacle_map, here[0], here[1], heading)
    thing = f"; ahead {ahead.obstacle}" if ahead.obstacle else ""
    if plan.looked_rad >= 2 * math.pi and t_s - lost >= obstacle_map.config.give_up_s:
        return Command(0.0, 0.0, f"blocked: no way to the goal after looking around{thing}", "blocked"), plan
    return Command(0.0, obstacle_map.config.turn_rad_s, f"looking around: no way known{thing}"), plan
