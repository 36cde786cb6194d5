"""What to do about what moves: go up to its line, stand and watch, get out of it, or cross it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from host.nav.ahead import SURE_SIGMAS, Ahead, brakeable_cm_s, look_ahead, room_behind_cm, speed_ahead
from host.nav.aim import is_clear
from host.nav.command import Command, turn_rad_s
from host.nav.config import NavConfig
from host.nav.crossing import Crossing, best_crossing
from host.nav.intent import Cross, Plan, Wait
from host.nav.map import ObstacleMap
from host.nav.mover import LONG_CM, Mover
from host.nav.odometry import body_of
from host.nav.plan import room_around
from host.nav.yielding import (
    BACK_CM_S,
    BERTH_CM,
    CROSSING_BERTH_CM,
    WAIT_CM,
    Course,
    Verdict,
    judge,
    unknown_mover,
)
from host.pose import Pose, bearing, wrap

LINGER_S = 0.7  # it must be out of the way for so long
PATIENCE_S = 4.0  # with what moves without a direction
STANDS_CM = 2.0  # with less room before the line of something that moves it stands
RENEW_S = 3.0  # where it waits it looks so often for a better place to cross,
BETTER_CM = 12.0  # and goes there if it is so far away
THERE_CM = 6.0  # it is where a crossing begins or ends
LOST_S, LOST_BACK_CM = 8.0, 35.0  # after so long without a sight of it, it steps back so far
BACK_FROM_CM = 10.0  # too near by more than this it steps back,
STEP_BACK_CM = 5.0  # if that leads away from the line
FACING_RAD = 0.15  # it looks across as straight as this
OUT_OF_VIEW_S = 2.0  # what it gives way to and has not seen for so long it turns to look for
STOOD_S = 0.7  # once its way has been shut for so long without a break


@dataclass(frozen=True)
class Held:
    """What something that moves leaves to the robot."""

    command: Command | None  # to be obeyed at once
    verdict: Verdict | None = None  # else it may go so far
    back_cm: float = 0.0  # so far it may go back

    @property
    def stands(self) -> bool:
        """Whether it has come as near as it may."""
        return self.verdict is not None and self.verdict.room_cm < STANDS_CM


def give_way(
    wait: Wait | None,
    obstacle_map: ObstacleMap,
    camera: Pose,
    v_cm_s: float,
    points: tuple[tuple[float, float], ...],
    cross: Cross | None = None,
) -> tuple[Held, Wait | None]:
    """What is left to do while something moves: all, to go up to its line, to stand, or to get out of it.

    For what only seems to move, and nobody knows where to, nobody waits for ever.

    Parameters
    ----------
    wait : what the last call left behind.
    v_cm_s : forward speed that was told last.
    points : (x, z) that the robot means to pass.
    cross : where it means to cross the line of something that moves, over floor that was seen to be free.
    """
    body, config, t_s = obstacle_map.body, obstacle_map.config, camera.t_s
    x, z, heading = body_of(camera, body.camera_ahead_cm)
    movers, things = obstacle_map.movers, list(obstacle_map.obstacles.values())
    if movers:
        ahead = look_ahead(obstacle_map, x, z, heading)
        crosses = cross is not None and (cross.there or cross.under_way)
        passing = ahead.obstacle is not None and (ahead.obstacle.moving or (crosses and ahead.brief))
        open_ahead = passing or (ahead.obstacle is None and not ahead.edge)
        room = math.inf if open_ahead else ahead.room_cm - config.clearance_cm
        back = room_behind_cm(obstacle_map, x, z, heading)
        sure = ahead.room_cm - SURE_SIGMAS * ahead.sigma_cm
        fast = math.inf if passing else sure if crosses else min(sure, ahead.unseen_cm)  # beyond, it creeps
        berth = CROSSING_BERTH_CM if cross is not None and cross.under_way else BERTH_CM
        course = Course((x, z), heading, v_cm_s, points, room, fast, back, berth)
        verdict = judge(movers, course, body, config, t_s)
        if verdict is not None:
            return Held(_leave(verdict, obstacle_map, ahead, back), verdict, back), None
    thing = unknown_mover(things, movers, (x, z), heading, body.radius_cm, t_s)
    since = t_s if wait is None else wait.since_s
    if thing is not None:
        reason = f"stop: {thing} crosses ahead, giving way"
        wait = Wait(since, t_s, reason)
        return Held(Command(0.0, 0.0, reason) if t_s - since <= PATIENCE_S else None), wait
    if wait is None or t_s - wait.last_s > LINGER_S or t_s - since > PATIENCE_S:
        return Held(None), None
    return Held(Command(0.0, 0.0, wait.reason)), wait


def _leave(verdict: Verdict, obstacle_map: ObstacleMap, ahead: Ahead, back_cm: float) -> Command | None:
    """On or back out of the line of something that moves; None where the robot may stay."""
    if verdict.leave == 0:
        return None
    config = obstacle_map.config
    v = speed_ahead(ahead, obstacle_map)[0] if verdict.leave > 0 else 0.0
    if v > 0.0:
        return Command(10 * v, 0.0, f"on, out of its way: {verdict} comes this way")
    v = min(BACK_CM_S, brakeable_cm_s(config, back_cm))
    if v > 1.0:
        return Command(-10 * v, 0.0, f"stepping back: {verdict} comes this way")
    return Command(0.0, 0.0, f"stop: {verdict} comes this way, giving way")


def up_to(held: Held, config: NavConfig, v_cm_s: float, reason: str) -> tuple[float, str]:
    """A forward speed and its reason, no faster than lets it stop before the line of something that moves."""
    if held.verdict is None:
        return v_cm_s, reason
    most = brakeable_cm_s(config, held.verdict.room_cm)
    if v_cm_s <= most:
        return v_cm_s, reason
    if most < 1.0:
        return 0.0, f"stop: {held.verdict} crosses ahead, giving way"
    return most, f"slow: {held.verdict} crosses ahead, giving way"


def cross_over(
    plan: Plan,
    held: Held,
    obstacle_map: ObstacleMap,
    t_s: float,
    here: tuple[float, float],
    heading: float,
) -> tuple[Command | None, Plan]:
    """Go to where a line that holds the robot up is best crossed, wait there, cross; no command: go on."""
    cross, movers = plan.cross, obstacle_map.movers
    shut_s, plan = plan.shut_s, replace(plan, shut_s=None)
    if (cross is None and (not held.stands or t_s < plan.no_cross_s)) or not movers:
        return None, replace(plan, cross=None)
    if cross is not None and cross.under_way:
        if math.dist(here, cross.crossing.end) < THERE_CM:
            return None, replace(plan, cross=None, made_s=-math.inf, way=None, aim=None)
        if not held.stands:
            return None, plan if _may_go_on(cross, obstacle_map, here) else _by_the_map(plan, t_s)
        cross = None
    if cross is not None and cross.there and held.verdict is None:
        if not _may_go_on(cross, obstacle_map, here):
            return None, _by_the_map(plan, t_s)
        return None, replace(plan, cross=replace(cross, under_way=True), piece_from=here)
    if cross is None or ((cross.there or held.stands) and t_s - cross.found_s > RENEW_S):
        found = _best_crossing(obstacle_map, here)
        if found is None:
            back = _back_off(held, obstacle_map, t_s, here, heading)
            shut_s = t_s if shut_s is None else shut_s
            stood = t_s - shut_s > STOOD_S  # else it turns to and fro between its way and the line
            towards = _to_its_line(held, t_s, here, heading) if stood else heading
            command = back or _watch(held, heading, towards, obstacle_map)
            plan = replace(plan, shut_s=shut_s, v_cm_s=command.v_mm_s / 10)
            return command, replace(plan, cross=None, piece_from=None)
        if cross is None or abs(found.aside_cm(cross.crossing.begin)) > BETTER_CM:
            cross = Cross(found, t_s)
        cross = replace(cross, found_s=t_s)
    aside = cross.crossing.aside_cm(here)
    if not cross.there and not held.stands and abs(aside) > THERE_CM:
        return None, replace(plan, cross=cross)
    cross = replace(cross, there=True)
    plan = replace(plan, cross=cross, piece_from=None)
    if (back := _back_off(held, obstacle_map, t_s, here, heading)) is not None:
        return back, replace(plan, v_cm_s=back.v_mm_s / 10)
    return _watch(held, heading, bearing(here, cross.crossing.end), obstacle_map), plan


def _back_off(
    held: Held, obstacle_map: ObstacleMap, t_s: float, here: tuple[float, float], heading: float
) -> Command | None:
    """Back to where the feet of what comes by are in the picture; None where it is there, or cannot."""
    if held.verdict is None or not isinstance(held.verdict.thing, Mover):
        return None
    step = np.array([[0.0], [STEP_BACK_CM]]) * (math.sin(heading), math.cos(heading))
    near, far = held.verdict.thing.least_gap_cm(here - step) - obstacle_map.body.radius_cm
    too_near = WAIT_CM - near
    seen_s = max((one.t_s for one in obstacle_map.movers), default=t_s)
    if t_s - seen_s > LOST_S:  # its line is nearer than it seemed: all that comes by is below the picture
        too_near += LOST_BACK_CM
    if too_near < BACK_FROM_CM or far - near < 0.8 * STEP_BACK_CM:
        return None
    v = min(BACK_CM_S, brakeable_cm_s(obstacle_map.config, min(too_near, held.back_cm)))
    return Command(-10 * v, 0.0, f"stepping back to see {held.verdict} come by") if v > 1.0 else None


def _to_its_line(held: Held, t_s: float, here: tuple[float, float], heading: float) -> float:
    """The heading to where on its line something out of view comes by nearest; else the one it has."""
    thing = None if held.verdict is None else held.verdict.thing
    if not isinstance(thing, Mover) or t_s - thing.t_s < OUT_OF_VIEW_S:
        return heading
    low, high = thing.extent_cm
    on = min(max(thing.along(*here)[0], low), high)
    x, z = thing.origin_cm[0] + on * thing.ahead[0], thing.origin_cm[1] + on * thing.ahead[1]
    return bearing(here, (x, z))


def _may_go_on(cross: Cross, obstacle_map: ObstacleMap, here: tuple[float, float]) -> bool:
    """Whether a crossing still leads out of all lines, and is open; once in one the robot must get out."""
    end, keep = cross.crossing.end, obstacle_map.body.radius_cm + BERTH_CM
    gaps = np.array([one.least_gap_cm(np.array([here, end])) for one in obstacle_map.movers])
    if gaps[:, 0].min() < keep:
        return True
    out = gaps[:, 1].min() > keep
    return bool(out) and is_clear(obstacle_map, room_around(obstacle_map), here, end, over_unseen=True)


def _by_the_map(plan: Plan, t_s: float) -> Plan:
    """Without a crossing: that is shut, and for a while another one will be too."""
    plan = replace(plan, cross=None, no_cross_s=t_s + RENEW_S)
    return replace(plan, made_s=-math.inf, way=None, aim=None, piece_from=None)


def _best_crossing(obstacle_map: ObstacleMap, here: tuple[float, float]) -> Crossing | None:
    """Of the line of what moves nearest."""
    near = {k: float(one.least_gap_cm(np.array([here]))[0]) for k, one in enumerate(obstacle_map.movers)}
    mover = obstacle_map.movers[min(near, key=lambda k: (not obstacle_map.movers[k].certain, near[k]))]
    if mover.gone_cm < LONG_CM:  # nobody knows yet which way is across
        return None
    room = room_around(obstacle_map)

    def is_open(start: tuple[float, float], end: tuple[float, float]) -> bool:
        return is_clear(obstacle_map, room, start, end, over_unseen=True)

    return best_crossing(mover, here, obstacle_map.body, obstacle_map.config, is_open)


def _watch(held: Held, heading: float, across: float, obstacle_map: ObstacleMap) -> Command:
    """Stand outside the line of something that moves, and look across it."""
    off = wrap(across - heading)
    thing = "something" if held.verdict is None else str(held.verdict)
    if abs(off) > FACING_RAD:
        return Command(0.0, turn_rad_s(off, obstacle_map.config), f"turn to watch {thing}, giving way")
    return Command(0.0, 0.0, f"stop: {thing} crosses ahead, giving way")
