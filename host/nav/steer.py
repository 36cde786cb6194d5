"""From the map to motion: turn in place, then a straight piece, and never into anything.

Depth comes from translation, so the robot drives straight pieces with the camera looking where it goes
and turns only between them.
"""

from __future__ import annotations

import math
from dataclasses import replace

from host.nav.ahead import is_blind, look_ahead, speed_ahead
from host.nav.aim import meant, planned
from host.nav.command import Command, by_degrees, turn_rad_s
from host.nav.give_way import RENEW_S, Held, cross_over, give_way, up_to
from host.nav.intent import Glance, Plan
from host.nav.look import get_unstuck, glance_aside, hide, no_way, step_back, turn_all_round
from host.nav.map import ObstacleMap
from host.nav.odometry import body_of
from host.nav.stand import AT_BORDER
from host.pose import Pose, bearing, wrap

TURN_FROM_RAD = math.radians(18)  # off the aim by more than this: turn in place
TURN_TO_RAD = math.radians(2.5)
BEND_RAD_S = 0.25  # most a straight piece may bend
FIRST_CM = 5.0  # straight ahead before anything else: nothing has a depth yet
FIRST_ROOM_CM = 20.0  # if there is this much room
FIRST_LEAST_CM = 2.5  # so far where nobody set it down: who stopped there kept the clearance, and no more
FIRST_LEAST_ROOM_CM = 10.0  # and if there is this much: standing it tells floor from nothing
ALL_ROUND_RAD = math.radians(150)
GLANCE_FROM_CM = 10.0  # before a piece with floor never looked at within this it looks there
SET_DOWN_CM = 20.0  # so much room about its rim has who sets it down


def decide(
    plan: Plan, obstacle_map: ObstacleMap, camera: Pose, goal_cm: tuple[float, float]
) -> tuple[Command, Plan]:
    """One decision, at the time of the pose.

    Parameters
    ----------
    plan : what the last decision left behind; ``Plan()`` at the start.
    camera : present pose of the camera.
    goal_cm : (x, z) in the odometry frame; reached when the camera is within the tolerance.
    """
    config = obstacle_map.config
    x, z, heading = body_of(camera, obstacle_map.body.camera_ahead_cm)
    to_goal = math.hypot(goal_cm[0] - camera.position_cm[0], goal_cm[1] - camera.position_cm[2])
    if to_goal <= config.goal_tolerance_cm:
        return Command(0.0, 0.0, f"goal reached, {to_goal:.0f} cm off", "goal"), plan

    points = meant(plan, (x, z), goal_cm) if plan.cross is None else (plan.cross.aim,)
    held, wait = give_way(plan.wait, obstacle_map, camera, plan.v_cm_s, points, plan.cross)
    plan = replace(plan, wait=wait, v_cm_s=0.0)
    if held.command is not None:
        v_cm_s = held.command.v_mm_s / 10
        return held.command, replace(plan, piece_from=None, lost_s=None, shut_s=None, v_cm_s=v_cm_s)
    if not plan.begun:
        if plan.start is None:
            if plan.set_down:
                obstacle_map.set_down(x, z, SET_DOWN_CM)
            plan = replace(plan, start=(x, z))
        ahead = look_ahead(obstacle_map, x, z, heading)
        most, room = (FIRST_CM, FIRST_ROOM_CM) if plan.set_down else (FIRST_LEAST_CM, FIRST_LEAST_ROOM_CM)
        first = math.dist(plan.start or (x, z), (x, z)) < most
        v = min(config.creep_cm_s, speed_ahead(ahead, obstacle_map)[0])
        thing = ahead.obstacle  # with its foot below the picture it may stand right at the rim
        hidden = not plan.set_down and thing is not None and thing.how == AT_BORDER
        if first and ahead.room_cm > room and v > 0.0 and not held.stands and not hidden:
            reason = f"creep: first steps to give depth its baseline, {ahead.room_cm:.0f} cm free ahead"
            return Command(10 * v, 0.0, reason), plan
        plan = replace(plan, begun=True)

    command, plan = cross_over(plan, held, obstacle_map, camera.t_s, (x, z), heading)
    if command is not None:
        return command, plan
    return _go(plan, held, obstacle_map, camera.t_s, (x, z), heading, goal_cm)


def _go(
    plan: Plan,
    held: Held,
    obstacle_map: ObstacleMap,
    t_s: float,
    here: tuple[float, float],
    heading: float,
    goal_cm: tuple[float, float],
    again: bool = False,
) -> tuple[Command, Plan]:
    """Turn towards the next aim, or on towards it; where that is shut, at once towards another one."""
    config, (x, z) = obstacle_map.config, here
    if plan.hidden:
        plan = hide(plan, obstacle_map, here)
    if plan.stuck is not None:
        command, plan = turn_all_round(plan, obstacle_map, here, heading)
        if command is not None:
            return command, plan
    if plan.glance is not None:
        command, plan = glance_aside(plan, obstacle_map, t_s, here, heading)
        if command is not None:
            return command, plan
    if plan.back_from is not None:
        command, plan = step_back(plan, obstacle_map, here, heading)
        if command is not None:
            return command, plan
    if plan.cross is None:
        plan = planned(plan, obstacle_map, t_s, here, heading, goal_cm)
        if plan.way is None:
            return no_way(plan, t_s, heading, obstacle_map, here, goal_cm)
    plan = replace(plan, lost_s=None, looked_rad=0.0)
    way = () if plan.way is None else plan.way.points

    aim = plan.cross.aim if plan.cross is not None else plan.aim or goal_cm
    error = wrap(bearing((x, z), aim) - heading)
    if error < -ALL_ROUND_RAD:  # almost straight behind: always to the right, so as not to dither
        error += 2 * math.pi
    turning = plan.piece_from is None
    if abs(error) > (TURN_TO_RAD if turning else TURN_FROM_RAD):
        why = look_ahead(obstacle_map, x, z, heading)
        because = ", to look where the floor is not seen yet" if plan.unseen else ""
        if why.obstacle and why.room_cm < 60:
            because = f", {why.obstacle} is in the way"
        reason = f"{by_degrees(error)} towards the aim{because}"
        return Command(0.0, turn_rad_s(error, config), reason, way=way), replace(plan, piece_from=None)

    piece_from = plan.piece_from or (x, z)
    plan = replace(plan, piece_from=piece_from)
    ahead = look_ahead(obstacle_map, x, z, heading)
    if plan.cross is not None and plan.cross.under_way:  # it looked across all the while it waited
        sigma = 0.0 if ahead.brief else ahead.sigma_cm
        ahead = replace(ahead, blind_cm=math.inf, unseen_cm=ahead.room_cm, sigma_cm=sigma)
    v, reason = speed_ahead(ahead, obstacle_map)
    if is_blind(ahead, config) or (turning and ahead.blind_cm < min(ahead.room_cm, GLANCE_FROM_CM)):
        looking = replace(plan, glance=Glance(here, heading, 0.0))
        command, looking = glance_aside(looking, obstacle_map, t_s, here, heading)
        if command is not None:
            return command, looking
    if v == 0.0 and ahead.obstacle is not None and ahead.obstacle.moving:  # it will be gone
        return Command(0.0, 0.0, reason), plan
    if v == 0.0:  # the plan must lead elsewhere
        no_cross_s = plan.no_cross_s if plan.cross is None else t_s + RENEW_S
        plan = replace(plan, made_s=-math.inf, way=None, aim=None, piece_from=None)
        plan = replace(plan, cross=None, no_cross_s=no_cross_s)
        if again:
            return get_unstuck(plan, config, here, heading, reason)
        return _go(plan, held, obstacle_map, t_s, here, heading, goal_cm, again=True)
    omega = max(-BEND_RAD_S, min(BEND_RAD_S, 1.0 * error))
    v *= 1 - 0.7 * min(1.0, abs(error) / TURN_FROM_RAD)  # so that the bend stays near the line
    v, reason = up_to(held, config, v, reason)
    return Command(10 * v, omega, reason, way=way), replace(plan, v_cm_s=v)
