"""From the map to motion: turn in place, then a straight piece, and never into anything.

Depth comes from translation, so the robot drives straight pieces with the camera looking where it goes
and turns only between them. Whatever the plan says, the last word has the room ahead: nothing filled
nearer than the clearance while moving forward, no more speed than can be braked, a creep over floor that
was only looked over yet, and none where the camera never looked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from host.nav import _nav
from host.nav.config import NavConfig
from host.nav.crossing import Crossing, best_crossing
from host.nav.map import FREE, LOOKED, OCCUPIED, Obstacle, ObstacleMap
from host.nav.mover import Mover
from host.nav.odometry import body_of
from host.nav.plan import Room, Way, at_points, find_way, room_around, tightest
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
from host.pose import Pose, wrap

PLAN_EVERY_S = 0.5
KEEP_WAY_S = 2.0  # a way that is still open is followed for so long before a better one is looked for
SAVES_S = 1.5  # and left only for one that takes less time by this
SAVES_SHARE = 0.2  # and by this part of what is left, for what is seen next may cost the new one as much
SETS_OUT_CM = 30.0  # a way sets out towards its point this far on
SURE_SIGMAS = 2.0  # an obstacle may be nearer than measured by so many of its sigmas
FACE_RAD = math.radians(25)  # of a goal that something covers, before that is believed
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
WAY_STEP_CM = 40.0  # points of the way that are looked at for what moves
BELIEVE_S = 1.5  # and so long it is looked at
TURN_FROM_RAD = math.radians(18)  # off the aim by more than this: turn in place
TURN_TO_RAD = math.radians(2.5)
SLOWEST_TURN_RAD_S = 0.35  # slower turns stick, and their edges come too far apart to tell the heading
BEND_RAD_S = 0.25  # most a straight piece may bend
FIRST_CM = 5.0  # straight ahead before anything else: nothing has a depth yet
FIRST_ROOM_CM = 20.0  # if there is this much room
FIRST_LEAST_ROOM_CM = 10.0  # or this much where nobody set it down: standing it tells floor from nothing
WORTH_CM = 15.0  # a way that does not reach the goal must bring the robot this much nearer
LEAST_ROOM_CM = 8.0  # a heading with less room than this is no way on
SEEN_FROM_CM = 60.0  # a goal that is covered is believed to be from here
ALL_ROUND_RAD = math.radians(150)
ONTO_BLIND_CM = 3.0  # the rim goes no farther onto floor it never looked at
GLANCE_FROM_CM = 10.0  # before a straight piece that comes to such floor within this it looks there,
GLANCE_CM = 35.0  # and at all such floor within this: the camera sees what is farther on the way
IN_VIEW, IN_VIEW_S = 0.4, 0.8  # X/Z up to which a place is well in view; hidden if not seen in so long
NEXT_CM = 2.5  # or this far aside
NEW_SIGHT_CM = 10.0  # what is hidden from here is so from everywhere within this
SET_DOWN_CM = 20.0  # so much room about its rim has who sets it down
SIDE_STEP_RAD = math.radians(15)  # headings tried where the way is shut right at the rim


@dataclass(frozen=True)
class Command:
    """What the wheels should do until the next frame, and why."""

    v_mm_s: float
    omega_rad_s: float  # positive to the right
    reason: str
    outcome: str | None = None  # such as "goal" or "blocked", when the drive is over
    hands_off: bool = False  # send the robot nothing
    way: tuple[tuple[float, float], ...] = ()  # points (x, z) in cm that it leads along, for who looks on


@dataclass(frozen=True)
class Wait:
    """For something that moves to be gone, nobody knows where to."""

    since_s: float
    last_s: float  # when it last came too near
    reason: str


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


@dataclass(frozen=True)
class Cross:
    """A crossing of the line of something that moves, and how far it is."""

    crossing: Crossing
    found_s: float
    there: bool = False  # where it begins, waiting
    under_way: bool = False  # across

    @property
    def aim(self) -> tuple[float, float]:
        """(x, z) to go next."""
        return self.crossing.end if self.there or self.under_way else self.crossing.begin


@dataclass(frozen=True)
class Glance:
    """A look, by turning in place, at floor that the robot is about to go over and never looked at."""

    here: tuple[float, float]
    heading: float  # of the way
    side: float  # where it looks now: 1.0 right of the way, -1.0 left
    viewed_s: float | None = None  # since when what it has not seen there is well in view


@dataclass(frozen=True)
class Stuck:
    """Where all is shut right at the rim: it turns once all round to see that anew, and no more."""

    here: tuple[float, float]
    heading: float  # last
    turned_rad: float = 0.0


@dataclass(frozen=True)
class Plan:
    """What steering remembers from one decision to the next."""

    way: Way | None = None  # None: nothing leads nearer to the goal
    made_s: float = -math.inf
    found_s: float = -math.inf  # when the way was searched for
    wait: Wait | None = None  # for something that moves nobody knows where to
    v_cm_s: float = 0.0  # forward speed last told
    cross: Cross | None = None  # of the line of something that moves
    no_cross_s: float = -math.inf  # until then it does not look for another one: the last was shut
    unseen: bool = False  # the piece to the aim leads over floor that nobody has seen
    aim: tuple[float, float] | None = None
    piece_from: tuple[float, float] | None = None  # where the present straight piece began; None: turning
    glance: Glance | None = None  # under way
    hidden: tuple[tuple[float, float], ...] = ()  # (x, z) that did not come to sight from `hidden_from`
    hidden_from: tuple[float, float] | None = None
    stuck: Stuck | None = None
    lost_s: float | None = None  # since when there has been no way
    set_down: bool = True  # by somebody who has looked around it
    begun: bool = False  # the first steps, which nothing but the view ahead guides, are made
    start: tuple[float, float] | None = None  # where the axle's middle stood at the first decision
    looked_rad: float = 0.0  # turned while looking for a way
    last_heading: float = 0.0


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

    def __str__(self) -> str:
        return "the edge of the map" if self.edge else str(self.obstacle or "something remembered")


def look_ahead(
    obstacle_map: ObstacleMap, x: float, z: float, heading: float, reach_cm: float = 150.0
) -> Ahead:
    """What the disc of the robot meets when its middle goes straight along a heading.

    Beyond the map nothing is known and nothing can be: for the disc its edge is a wall.
    """
    config, radius = obstacle_map.config, obstacle_map.body.radius_cm
    half_cell = config.cell_cm / 2
    wide = tightest(obstacle_map)

    row0, col0 = obstacle_map.cell_of(x - reach_cm, z - reach_cm)
    row1, col1 = obstacle_map.cell_of(x + reach_cm, z + reach_cm)
    room, unseen, blind, row, col = _nav.meet(
        obstacle_map.evidence,
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

    points = _meant(plan, (x, z), goal_cm) if plan.cross is None else (plan.cross.aim,)
    held, wait = give_way(plan.wait, obstacle_map, camera, plan.v_cm_s, points, plan.cross)
    plan = replace(plan, wait=wait, v_cm_s=0.0)
    if held.command is not None:
        v_cm_s = held.command.v_mm_s / 10
        return held.command, replace(plan, piece_from=None, lost_s=None, v_cm_s=v_cm_s)
    if not plan.begun:
        if plan.start is None:
            if plan.set_down:
                obstacle_map.set_down(x, z, SET_DOWN_CM)
            plan = replace(plan, start=(x, z))
        ahead = look_ahead(obstacle_map, x, z, heading)
        first = math.dist(plan.start or (x, z), (x, z)) < FIRST_CM
        room = FIRST_ROOM_CM if plan.set_down else FIRST_LEAST_ROOM_CM
        v = min(config.creep_cm_s, speed_ahead(ahead, obstacle_map)[0])
        if first and ahead.room_cm > room and v > 0.0 and not held.stands:
            reason = f"creep: first steps to give depth its baseline, {ahead.room_cm:.0f} cm free ahead"
            return Command(10 * v, 0.0, reason), plan
        plan = replace(plan, begun=True)

    command, plan = _cross(plan, held, obstacle_map, camera.t_s, (x, z), heading)
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
        plan = _hide(plan, obstacle_map, here)
    if plan.stuck is not None:
        command, plan = _turn_all_round(plan, obstacle_map, here, heading)
        if command is not None:
            return command, plan
    if plan.glance is not None:
        command, plan = _glance(plan, obstacle_map, t_s, here, heading)
        if command is not None:
            return command, plan
    if plan.cross is None:
        plan = _planned(plan, obstacle_map, t_s, here, heading, goal_cm)
        if plan.way is None:
            return _no_way(plan, t_s, heading, obstacle_map, here, goal_cm)
    plan = replace(plan, lost_s=None, looked_rad=0.0)
    way = () if plan.way is None else plan.way.points

    aim = plan.cross.aim if plan.cross is not None else plan.aim or goal_cm
    error = wrap(_bearing((x, z), aim) - heading)
    if error < -ALL_ROUND_RAD:  # almost straight behind: always to the right, so as not to dither
        error += 2 * math.pi
    turning = plan.piece_from is None
    if abs(error) > (TURN_TO_RAD if turning else TURN_FROM_RAD):
        why = look_ahead(obstacle_map, x, z, heading)
        because = ", to look where the floor is not seen yet" if plan.unseen else ""
        if why.obstacle and why.room_cm < 60:
            because = f", {why.obstacle} is in the way"
        reason = f"{_by(error)} towards the aim{because}"
        return Command(0.0, _turn_rad_s(error, config), reason, way=way), replace(plan, piece_from=None)

    piece_from = plan.piece_from or (x, z)
    plan = replace(plan, piece_from=piece_from)
    ahead = look_ahead(obstacle_map, x, z, heading)
    if plan.cross is not None and plan.cross.under_way:  # it looked across all the while it waited
        sigma = 0.0 if ahead.brief else ahead.sigma_cm
        ahead = replace(ahead, blind_cm=math.inf, unseen_cm=ahead.room_cm, sigma_cm=sigma)
    v, reason = speed_ahead(ahead, obstacle_map)
    if _is_blind(ahead, config) or (turning and ahead.blind_cm < min(ahead.room_cm, GLANCE_FROM_CM)):
        looking = replace(plan, glance=Glance(here, heading, 0.0))
        command, looking = _glance(looking, obstacle_map, t_s, here, heading)
        if command is not None:
            return command, looking
    if v == 0.0 and ahead.obstacle is not None and ahead.obstacle.moving:  # it will be gone
        return Command(0.0, 0.0, reason), plan
    if v == 0.0:  # the plan must lead elsewhere
        no_cross_s = plan.no_cross_s if plan.cross is None else t_s + RENEW_S
        plan = replace(plan, made_s=-math.inf, way=None, aim=None, piece_from=None)
        plan = replace(plan, cross=None, no_cross_s=no_cross_s)
        if again:
            return _stuck(plan, config, here, heading, reason)
        return _go(plan, held, obstacle_map, t_s, here, heading, goal_cm, again=True)
    omega = max(-BEND_RAD_S, min(BEND_RAD_S, 1.0 * error))
    v *= 1 - 0.7 * min(1.0, abs(error) / TURN_FROM_RAD)  # so that the bend stays near the line
    v, reason = up_to(held, config, v, reason)
    return Command(10 * v, omega, reason, way=way), replace(plan, v_cm_s=v)


def _glance(
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
        plan = _hide(plan, obstacle_map, here, tuple((x, z) for x, z in spots[viewed].tolist()))
        return None, replace(plan, glance=None, made_s=-math.inf, way=None, aim=None)
    reason = f"{_by(off)}: never looked at the floor there"
    return Command(0.0, _turn_rad_s(off, obstacle_map.config), reason), plan


def _turn_rad_s(off: float, config: NavConfig) -> float:
    """How fast to turn in place towards what is so far off straight ahead."""
    return math.copysign(min(config.turn_rad_s, max(SLOWEST_TURN_RAD_S, 1.5 * abs(off))), off)


def _by(off: float) -> str:
    return f"turn {'right' if off > 0 else 'left'} by {abs(math.degrees(off)):.0f} deg"


def _hide(
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


def _stuck(
    plan: Plan, config: NavConfig, here: tuple[float, float], heading: float, reason: str
) -> tuple[Command, Plan]:
    """Something is in the way at the rim: look all round; blocked where that was done already."""
    stuck = plan.stuck or Stuck(here, heading)
    if stuck.turned_rad >= 2 * math.pi:
        return Command(0.0, 0.0, f"blocked: no way on after looking around; {reason}", "blocked"), plan
    plan = replace(plan, stuck=stuck, hidden=(), hidden_from=None)
    return Command(0.0, config.turn_rad_s, f"looking around: {reason}"), plan


def _turn_all_round(
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


def _is_blind(ahead: Ahead, config: NavConfig) -> bool:
    """Whether the robot stands before floor it never looked at, and before nothing else."""
    return brakeable_cm_s(config, ahead.blind_cm + ONTO_BLIND_CM) < 1.0 and ahead.blind_cm < ahead.room_cm


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
        behind = look_ahead(obstacle_map, x, z, wrap(heading + math.pi))
        crosses = cross is not None and (cross.there or cross.under_way)
        passing = ahead.obstacle is not None and (ahead.obstacle.moving or (crosses and ahead.brief))
        open_ahead = passing or (ahead.obstacle is None and not ahead.edge)
        room = math.inf if open_ahead else ahead.room_cm - config.clearance_cm
        back = min(behind.room_cm, behind.unseen_cm) - config.clearance_cm
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


def _cross(
    plan: Plan,
    held: Held,
    obstacle_map: ObstacleMap,
    t_s: float,
    here: tuple[float, float],
    heading: float,
) -> tuple[Command | None, Plan]:
    """Go to where a line that holds the robot up is best crossed, wait there, cross; no command: go on."""
    cross, movers = plan.cross, obstacle_map.movers
    if (cross is None and (not held.stands or t_s < plan.no_cross_s)) or not movers:
        return None, replace(plan, cross=None)
    if cross is not None and cross.under_way:
        if math.dist(here, cross.crossing.end) < THERE_CM:
            return None, replace(plan, cross=None, made_s=-math.inf, way=None, aim=None)
        if not held.stands:
            return None, plan
        cross = None
    if cross is not None and cross.there and held.verdict is None:
        return None, replace(plan, cross=replace(cross, under_way=True), piece_from=here)
    if cross is None or ((cross.there or held.stands) and t_s - cross.found_s > RENEW_S):
        found = _best_crossing(obstacle_map, here)
        if found is None:
            back = _back_off(held, obstacle_map, t_s, here, heading)
            command = back or _watch(held, heading, heading, obstacle_map)
            return command, replace(plan, cross=None, piece_from=None, v_cm_s=command.v_mm_s / 10)
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
    return _watch(held, heading, _bearing(here, cross.crossing.end), obstacle_map), plan


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


def _best_crossing(obstacle_map: ObstacleMap, here: tuple[float, float]) -> Crossing | None:
    """Of the line of what moves nearest."""
    near = {k: float(one.least_gap_cm(np.array([here]))[0]) for k, one in enumerate(obstacle_map.movers)}
    mover = obstacle_map.movers[min(near, key=lambda k: (not obstacle_map.movers[k].certain, near[k]))]
    room = room_around(obstacle_map)

    def is_open(start: tuple[float, float], end: tuple[float, float]) -> bool:
        return _clear(obstacle_map, room, start, end, over_unseen=True)

    return best_crossing(mover, here, obstacle_map.body, obstacle_map.config, is_open)


def _watch(held: Held, heading: float, across: float, obstacle_map: ObstacleMap) -> Command:
    """Stand outside the line of something that moves, and look across it."""
    off = wrap(across - heading)
    thing = "something" if held.verdict is None else str(held.verdict)
    if abs(off) > FACING_RAD:
        return Command(0.0, _turn_rad_s(off, obstacle_map.config), f"turn to watch {thing}, giving way")
    return Command(0.0, 0.0, f"stop: {thing} crosses ahead, giving way")


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


def _meant(
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


def _planned(
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
    over_unseen = not _clear(obstacle_map, room, here, aim, over_unseen=False)
    far = old is not None and math.dist(old, here) > 2 * config.cell_cm
    if old is not None and far and _clear(obstacle_map, room, here, old, over_unseen):
        if plan.piece_from is None:  # turning: towards whichever of the two is nearer, so as not to dither
            aim = min(old, aim, key=lambda p: abs(wrap(_bearing(here, p) - heading)))
        elif math.dist(plan.piece_from, here) < config.piece_cm:
            aim = old
    return replace(plan, aim=aim, unseen=over_unseen)


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
    turn = abs(wrap(_bearing((points[0, 0], points[0, 1]), (out[0], out[1])) - heading))
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
            if not _clear(obstacle_map, room, here, point, over_unseen):
                break
            aim = point
        if aim != first:
            break
    return _side_step(obstacle_map, here, aim)


def _side_step(obstacle_map: ObstacleMap, here, aim) -> tuple[float, float]:
    """The aim itself, or where it is shut right at the rim a short piece along the nearest open heading."""
    wanted = _bearing(here, aim)
    for k in range(2 * math.ceil(math.pi / SIDE_STEP_RAD)):
        heading = wanted + (k + 1) // 2 * (SIDE_STEP_RAD if k % 2 else -SIDE_STEP_RAD)
        ahead = look_ahead(obstacle_map, here[0], here[1], heading)
        room = ahead.room_cm
        if room > LEAST_ROOM_CM or (ahead.obstacle is not None and ahead.obstacle.moving):
            length = min(room, obstacle_map.config.piece_cm) if k else math.dist(here, aim)
            return here[0] + length * math.sin(heading), here[1] + length * math.cos(heading)
    return aim


def _clear(obstacle_map: ObstacleMap, room: Room, start, end, over_unseen: bool) -> bool:
    """Whether the robot fits all along a straight line; where it stands does not count."""
    first, half, cell = obstacle_map.body.radius_cm, obstacle_map.half_cm, obstacle_map.config.cell_cm
    if _nav.least_along(room.to_filled, half, cell, start, end, first) < tightest(obstacle_map):
        return False
    return over_unseen or _nav.least_along(room.to_unseen, half, cell, start, end, first) >= first


def _no_way(
    plan: Plan, t_s: float, heading: float, obstacle_map: ObstacleMap, here: tuple[float, float], goal_cm
) -> tuple[Command, Plan]:
    """At once where the goal itself is the reason, once that was looked at; else look around for a way."""
    config, body = obstacle_map.config, obstacle_map.body
    to_edge = obstacle_map.half_cm - max(abs(goal_cm[0]), abs(goal_cm[1]))
    if to_edge < tightest(obstacle_map) - config.goal_tolerance_cm:
        reason = f"blocked: the goal is {to_edge:.0f} cm from the edge of the map; set nav.map_half_cm"
        return Command(0.0, 0.0, reason, "blocked"), plan
    covered = _cover_of(obstacle_map, goal_cm)
    away = math.dist(here, goal_cm)
    if covered is not None and away < config.goal_tolerance_cm + 2 * body.radius_cm + SEEN_FROM_CM:
        error = wrap(_bearing(here, goal_cm) - heading)
        lost = t_s if plan.lost_s is None else plan.lost_s
        plan = replace(plan, lost_s=lost, piece_from=None, last_heading=heading)
        if abs(error) > FACE_RAD:
            turn = Command(
                0.0, math.copysign(config.turn_rad_s, error), f"turn to the goal: {covered} covers it"
            )
            return turn, replace(plan, lost_s=t_s)
        reason = f"the goal is covered by {covered}, {away - body.radius_cm:.0f} cm from the rim"
        if t_s - lost < BELIEVE_S:
            return Command(0.0, 0.0, f"stop: {reason}"), plan
        return Command(0.0, 0.0, f"blocked: {reason}", "blocked"), plan
    return _look_around(plan, t_s, heading, obstacle_map, here)


def _cover_of(obstacle_map: ObstacleMap, goal_cm: tuple[float, float]) -> str | None:
    """What leaves no room for the robot within the tolerance of the goal, in words; None where there is."""
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
        return None
    rows, cols = rows + window[0].start, cols + window[1].start
    filled = np.column_stack([obstacle_map.centres_cm[cols], obstacle_map.centres_cm[rows]])
    gaps = np.hypot(*(np.add(goal_cm, offsets)[:, None] - filled[None]).transpose(2, 0, 1))
    if float(gaps.min(axis=1).max()) >= tightest(obstacle_map) + config.cell_cm / 2:
        return None
    k = int(np.hypot(*(filled - goal_cm).T).argmin())
    return str(obstacle_map.obstacle_at(int(rows[k]), int(cols[k])) or "something remembered")


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


def _bearing(start: tuple[float, float], end: tuple[float, float]) -> float:
    """Heading from one point (x, z) to another, rad."""
    return math.atan2(end[0] - start[0], end[1] - start[1])
