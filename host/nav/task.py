"""What a drive is for: a route of goals, exploring, approaching what is ahead, or only measuring.

A task turns map and pose into one command a frame; `steer` does the driving.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Protocol

import cv2
import numpy as np

from host.nav.ahead import REACH_CM, SURE_SIGMAS, Ahead, brakeable_cm_s, look_ahead, speed_ahead
from host.nav.command import Command
from host.nav.front import Met, Profile
from host.nav.give_way import give_way, up_to
from host.nav.intent import Plan, Wait
from host.nav.map import OCCUPIED, Obstacle, ObstacleMap
from host.nav.odometry import body_of
from host.nav.plan import at_points, room_around, tightest
from host.nav.stand import AT_BORDER
from host.nav.steer import FIRST_CM, FIRST_ROOM_CM, decide
from host.pose import Pose, wrap

FRONTIER_CELLS = 6  # fewer at a place are gaps between pixels, not a part of the room
NEAR_CM = 25.0  # frontiers nearer than this are below the camera's view
GAIN_CM = 60.0  # a frontier's cells up to here from the place to go are seen from there
ENOUGH_CELLS = 40  # and more than so many are not worth more
AT_MOST_S = 25.0  # on the way to one frontier
DONE_WITH_CM = 25.0  # around a place that was reached, or cannot be
HOLD_GAIN = 2.0  # turn rate per heading error while approaching, 1/s
HOLD_RAD_S = 0.3
ARRIVED_CM = 0.4
SLOWEST_CM_S = 1.5  # creeping up to where it is to stop
BELOW_CM = 24.0  # what is nearer to the rim has its foot below the picture, and is only remembered
COARSE_CELLS = 2.0  # by so much a thing's filled cells may lie before where it was last seen to stand
STEP_BACK_CM = 40.0  # from there the camera sees what was below its picture
LOOK_S = 1.0  # and so long it looks
SETTLE_S = 1.0  # stands this long before something remembered, which may yet be seen to be gone


class Task(Protocol):
    """Decides; told of every frame once."""

    def decide(self, obstacle_map: ObstacleMap, camera: Pose) -> Command:
        """The command at the time of the pose, ``outcome`` set when the task is over."""
        ...


class Route:
    """One goal after the other; over at the last, or where one cannot be reached.

    Where nobody `set_down` the robot, but it stands where another drive ended, there may be things beside it.
    """

    def __init__(self, goals_cm: list[tuple[float, float]], set_down: bool = True) -> None:
        self.goals_cm = tuple(goals_cm)  # all of them, whatever was reached
        self._goals = list(goals_cm)
        self._plan = Plan(set_down=set_down)

    def decide(self, obstacle_map: ObstacleMap, camera: Pose) -> Command:
        command, self._plan = decide(self._plan, obstacle_map, camera, self._goals[0])
        if command.outcome != "goal" or len(self._goals) == 1:
            return command
        self._goals.pop(0)
        self._plan = Plan(begun=True)
        x, z = self._goals[0]
        return replace(command, reason=f"{command.reason}; on to {x:.0f},{z:.0f}", outcome=None)


class Explore:
    """Goes to borders between floor seen and what was never seen, until there are none.

    Where nobody `set_down` the robot, but it stands where another drive ended, there may be things beside it.
    """

    def __init__(self, set_down: bool = True) -> None:
        self._plan = Plan(set_down=set_down)
        self._target: tuple[float, float] | None = None
        self._chosen_s = -math.inf
        self._done_with: list[tuple[float, float]] = []
        self._floor: np.ndarray | None = None  # cells that when last seen were floor, though evidence fades
        self._known: np.ndarray | None = None  # and these, or were filled
        self._turned_rad = 0.0  # looking round for more
        self._last_heading: float | None = None

    def decide(self, obstacle_map: ObstacleMap, camera: Pose) -> Command:
        x, z, heading = body_of(camera, obstacle_map.body.camera_ahead_cm)
        if self._floor is None or self._known is None:
            self._floor = self._known = np.zeros_like(obstacle_map.free)
        self._floor = (self._floor | obstacle_map.free) & ~obstacle_map.occupied
        self._known = self._known | obstacle_map.free | obstacle_map.occupied
        if self._target is not None and camera.t_s - self._chosen_s > AT_MOST_S:
            self._done_with.append(self._target)
            self._target = None
        if self._target is None:
            self._choose(obstacle_map, camera.t_s, (x, z), heading)
        if self._target is None:
            return self._look_round(obstacle_map, heading)
        self._turned_rad, self._last_heading = 0.0, None
        command, self._plan = decide(self._plan, obstacle_map, camera, self._target)
        if command.outcome is None:
            tx, tz = self._target
            return replace(command, reason=f"exploring towards {tx:.0f},{tz:.0f}: {command.reason}")
        self._done_with.append(self._target)
        self._target = None
        return Command(0.0, 0.0, f"exploring: {command.reason}")

    def _choose(
        self, obstacle_map: ObstacleMap, t_s: float, here: tuple[float, float], heading: float
    ) -> None:
        assert self._floor is not None and self._known is not None
        target = best_frontier(obstacle_map, self._floor, self._known, here, heading, self._done_with)
        if target != self._target:
            self._plan = replace(self._plan, way=None, made_s=-math.inf, aim=None, piece_from=None)
        self._target, self._chosen_s = target, t_s

    def _look_round(self, obstacle_map: ObstacleMap, heading: float) -> Command:
        if self._last_heading is not None:
            self._turned_rad += abs(wrap(heading - self._last_heading))
        self._last_heading = heading
        if self._turned_rad >= 2 * math.pi:
            return Command(0.0, 0.0, "explored: nothing unseen can be reached any more", "explored")
        turn = obstacle_map.config.turn_rad_s
        return Command(0.0, turn, f"exploring: looking round, {math.degrees(self._turned_rad):.0f} deg")


def beside(cells: np.ndarray) -> np.ndarray:
    """The cells themselves and their neighbours, both (N, N) bool."""
    return cv2.dilate(cells.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)


def best_frontier(
    obstacle_map: ObstacleMap,
    floor: np.ndarray,
    known: np.ndarray,
    here: tuple[float, float],
    heading_rad: float,
    done_with: list[tuple[float, float]],
) -> tuple[float, float] | None:
    """(x, z) of floor beside what was never seen, that the robot can get to; None without any.

    The one that shows most for the time it takes to get there.
    """
    fits = (floor | ~known) & (room_around(obstacle_map).to_filled >= tightest(obstacle_map))
    row, col = obstacle_map.cell_of(*here)
    fits[row, col] = True
    _, parts = cv2.connectedComponents(fits.astype(np.uint8), connectivity=8)
    border = floor & beside(~known) & fits & (parts == parts[row, col])
    count, patches, stats, _ = cv2.connectedComponentsWithStats(border.astype(np.uint8), connectivity=8)
    large = np.nonzero(stats[:count, cv2.CC_STAT_AREA] >= FRONTIER_CELLS)[0]
    points = obstacle_map.points_where(border & np.isin(patches, large[large > 0]))
    if len(points) == 0:
        return None
    config = obstacle_map.config
    away = np.hypot(points[:, 0] - here[0], points[:, 1] - here[1])
    aside = np.abs(wrap(np.arctan2(points[:, 0] - here[0], points[:, 1] - here[1]) - heading_rad))
    time_s = away / config.speed_cm_s + aside / config.turn_rad_s
    gain = np.minimum(_others_within(border, points, obstacle_map), ENOUGH_CELLS)
    cost = (time_s + SETTLE_S) / gain
    usable = away > NEAR_CM
    for place in done_with:
        usable &= np.hypot(points[:, 0] - place[0], points[:, 1] - place[1]) > DONE_WITH_CM
    if not usable.any():
        return None
    x, z = points[int(np.argmin(np.where(usable, cost, np.inf)))]
    return float(x), float(z)


def _others_within(border: np.ndarray, points: np.ndarray, obstacle_map: ObstacleMap) -> np.ndarray:
    """(K,) how many cells of a border (N, N) lie about each of its points."""
    side = 2 * math.ceil(GAIN_CM / obstacle_map.config.cell_cm) + 1
    around = cv2.boxFilter(border.astype(np.float32), -1, (side, side), normalize=False)
    return at_points(obstacle_map, around, points)


class Approach:
    """Straight on, until the rim is a given distance before what is ahead, seen or remembered."""

    def __init__(self, stop_cm: float) -> None:
        self.stop_cm = stop_cm
        self._heading: float | None = None
        self._profile: Profile | None = None
        self._map: ObstacleMap | None = None  # that the profile goes with
        self._sight_s = -math.inf  # of the newest that the profile knows
        self._start: tuple[float, float] | None = None
        self._stands_s: float | None = None  # since when
        self._wait: Wait | None = None
        self._v_cm_s = 0.0  # forward speed last told
        self._back_from: tuple[float, float] | None = None  # where it began to step back for a better look
        self._back_s: float | None = None  # when it had
        self._doubted_cm: float | None = None  # along the way; there it looked again

    def decide(self, obstacle_map: ObstacleMap, camera: Pose) -> Command:
        config = obstacle_map.config
        x, z, heading = body_of(camera, obstacle_map.body.camera_ahead_cm)
        self._heading = heading if self._heading is None else self._heading
        self._start = self._start or (x, z)
        omega = max(-HOLD_RAD_S, min(HOLD_RAD_S, HOLD_GAIN * wrap(self._heading - heading)))
        profile = self._seen(obstacle_map, (x, z))
        held, self._wait = give_way(self._wait, obstacle_map, camera, self._v_cm_s, ())
        self._v_cm_s = 0.0
        if held.command is not None:
            return held.command
        if held.verdict is not None and held.stands:
            return Command(0.0, 0.0, f"stop: {held.verdict} crosses ahead, giving way")
        if (back := self._step_back(obstacle_map, camera.t_s, (x, z), heading)) is not None:
            return back
        ahead, met = self._ahead(obstacle_map, profile, (x, z), heading)
        ahead = replace(ahead, blind_cm=math.inf)  # it looks where it goes, straight from its start
        if met and ahead.room_cm - self.stop_cm < ARRIVED_CM:
            if not met.firm and not self._looked_again((x, z)):  # it may be a fleck of the floor
                self._back_from = (x, z)
                return Command(0.0, 0.0, f"stop: {ahead.room_cm:.1f} cm before {ahead}, seen too briefly")
            return Command(0.0, 0.0, f"{ahead.room_cm:.1f} cm before {ahead}", "approached")
        first = not met and math.dist(self._start, (x, z)) < FIRST_CM
        if first and ahead.room_cm > max(FIRST_ROOM_CM, self.stop_cm):
            reason = "creep: first steps to give depth its baseline"
            return Command(10 * config.creep_cm_s, omega, reason)
        v, reason = speed_ahead(ahead, obstacle_map, config.clearance_cm if ahead.edge else self.stop_cm)
        if met and v == 0.0:
            v, reason = SLOWEST_CM_S, f"creep: {ahead}, {ahead.room_cm:.1f} cm from the rim"
        too_near = ahead.obstacle is not None and ahead.obstacle.how == AT_BORDER
        if self._looked_again((x, z)) and v > config.creep_cm_s:  # to see long what it may have to stop for
            v, reason = config.creep_cm_s, f"creep: {ahead.room_cm:.0f} cm free ahead, where it was in doubt"
        if v > 0.0 and not too_near:
            self._stands_s = None
            v, reason = up_to(held, config, v, reason)
            self._v_cm_s = v
            return Command(10 * v, omega, reason)
        self._stands_s = camera.t_s if self._stands_s is None else self._stands_s
        if camera.t_s - self._stands_s < SETTLE_S:
            return Command(0.0, 0.0, f"stop: {ahead}")
        if ahead.edge:
            return Command(0.0, 0.0, "at the edge of the map; set nav.map_half_cm", "blocked")
        if not self._looked_again((x, z)):  # cells say so, and no thing that is known to stand there
            self._back_from = (x, z)
            return Command(0.0, 0.0, f"stop: {ahead.room_cm:.0f} cm before {ahead}, in doubt")
        if too_near:
            return Command(0.0, 0.0, f"{ahead} or nearer: its foot is below the picture", "blocked")
        return Command(0.0, 0.0, f"{ahead.room_cm:.0f} cm before {ahead}", "approached")

    def _seen(self, obstacle_map: ObstacleMap, here: tuple[float, float]) -> Profile:
        """What the newest frame adds to what is known of the way ahead."""
        assert self._heading is not None
        if self._profile is None or obstacle_map is not self._map:  # a new map: the robot is elsewhere
            self._profile, self._map = Profile(*here, self._heading), obstacle_map
            self._doubted_cm = None
        sight = obstacle_map.sight
        if sight is not None and sight.t_s > self._sight_s:
            self._profile.see(sight)
            self._sight_s = sight.t_s
        return self._profile

    def _ahead(
        self, obstacle_map: ObstacleMap, profile: Profile, here: tuple[float, float], heading: float
    ) -> tuple[Ahead, Met | None]:
        """What is ahead, and its front if that was seen: then that counts and not the cells it filled.

        Cells are coarse, and some are filled by what was seen badly from afar. Where floor was seen from near
        they say nothing, unless of what moves or has appeared below the picture. What appears there again, where
        the robot looked once more and saw floor, is a fleck of that.
        """
        radius, cell = obstacle_map.body.radius_cm, obstacle_map.config.cell_cm
        ahead = look_ahead(obstacle_map, *here, heading, passed=self._flanks(obstacle_map, profile, here))
        met = profile.met(*here, radius)
        clear = profile.clear_cm(*here, radius)
        if clear > ahead.unseen_cm:
            ahead = replace(ahead, unseen_cm=clear)
        thing = ahead.obstacle
        appeared = thing is not None and thing.how == AT_BORDER and not self._looked_again(here)
        fleeting = appeared or (thing is not None and thing.moving)
        bulges = ahead.cell_cm is not None and profile.may_hang_over(ahead.cell_cm, here, radius)
        passed = not fleeting and not bulges and ahead.room_cm + cell < clear
        if met is not None:
            doubt = met.sigma_cm
            if met.firm and thing is not None and thing.region == met.region:
                doubt += SURE_SIGMAS * ahead.sigma_cm
            near = met.room_cm - ahead.room_cm < COARSE_CELLS * cell + doubt
            below = met.room_cm < BELOW_CM
            if near or passed or below:
                thing, sigma = _met(obstacle_map, met), met.sigma_cm
                return replace(ahead, room_cm=met.room_cm, obstacle=thing, edge=False, sigma_cm=sigma), met
        elif not ahead.edge and passed:
            return replace(ahead, room_cm=clear, obstacle=None), None
        return ahead, None

    def _flanks(
        self, obstacle_map: ObstacleMap, profile: Profile, here: tuple[float, float]
    ) -> np.ndarray | None:
        """Cells that stick into the way from what stands beside it, for they are coarse; None without any."""
        radius = obstacle_map.body.radius_cm
        r0, c0 = obstacle_map.cell_of(here[0] - REACH_CM, here[1] - REACH_CM)
        r1, c1 = obstacle_map.cell_of(here[0] + REACH_CM, here[1] + REACH_CM)
        rows, cols = np.nonzero(obstacle_map.evidence[r0 : r1 + 1, c0 : c1 + 1] > OCCUPIED)
        centres = obstacle_map.centres_cm
        points = np.column_stack([centres[cols + c0], centres[rows + r0]])
        flank = profile.is_flank(points, here, radius)
        if not flank.any():
            return None
        cells = np.zeros_like(obstacle_map.free)
        cells[rows[flank] + r0, cols[flank] + c0] = True
        return cells & ~obstacle_map.brief

    def _step_back(
        self, obstacle_map: ObstacleMap, t_s: float, here: tuple[float, float], heading: float
    ) -> Command | None:
        """Once at a place, to look again at what is remembered below the picture; None when that is done."""
        if self._back_from is None:
            return None
        gone = math.dist(self._back_from, here)
        behind = look_ahead(obstacle_map, *here, wrap(heading + math.pi))
        come = self._along_cm(here)  # straight to here
        free = min(behind.room_cm, behind.unseen_cm)
        if behind.obstacle is None or not behind.obstacle.moving:
            free = max(free, come)  # whatever is remembered beside it, it came along there
        room = free - obstacle_map.config.clearance_cm
        if self._back_s is None and gone < STEP_BACK_CM and room > 1.0:
            v = min(obstacle_map.config.creep_cm_s, brakeable_cm_s(obstacle_map.config, room))
            return Command(-10 * v, 0.0, f"stepping back {STEP_BACK_CM - gone:.0f} cm to look again")
        self._back_s = t_s if self._back_s is None else self._back_s
        if t_s - self._back_s < LOOK_S:
            return Command(0.0, 0.0, "stop: looking again at what is remembered ahead")
        self._doubted_cm = self._along_cm(self._back_from)
        self._back_from, self._back_s, self._stands_s = None, None, None
        return None

    def _looked_again(self, here: tuple[float, float]) -> bool:
        """Whether it is about where it was in doubt and looked twice already."""
        return self._doubted_cm is not None and self._along_cm(here) < self._doubted_cm + STEP_BACK_CM

    def _along_cm(self, place: tuple[float, float]) -> float:
        assert self._profile is not None
        return self._profile.place_of(*place)[0]


def _met(obstacle_map: ObstacleMap, met: Met) -> Obstacle:
    """As an obstacle, for those who ask why."""
    known = obstacle_map.obstacles.get(met.region)
    how = "foot" if met.by_foot or known is None else known.how
    depth = met.along_cm - obstacle_map.body.camera_ahead_cm
    nowhere, t_s = (math.nan, math.nan), math.nan if known is None else known.t_s
    return Obstacle(met.region, depth, met.sigma_cm, how, nowhere, nowhere, t_s)


def front_ahead(
    obstacle_map: ObstacleMap, here: tuple[float, float], heading: float
) -> tuple[Obstacle | None, float]:
    """The nearest thing known to stand somewhere that a straight drive meets, and the rim's way to it, cm."""
    radius = obstacle_map.body.radius_cm
    nearest, thing = math.inf, None
    for obstacle in obstacle_map.standing():
        if obstacle.how == AT_BORDER:  # which is no place
            continue
        ends = np.array([obstacle.left_cm, obstacle.right_cm]) - here
        points = ends[0] + np.linspace(0.0, 1.0, 25)[:, None] * (ends[1] - ends[0])
        along = points[:, 0] * math.sin(heading) + points[:, 1] * math.cos(heading)
        aside = np.abs(points[:, 0] * math.cos(heading) - points[:, 1] * math.sin(heading))
        met = (along > 0) & (aside < radius)
        if met.any():
            way = float((along[met] - np.sqrt(radius**2 - aside[met] ** 2)).min())
            if way < nearest:
                nearest, thing = way, obstacle
    return thing, nearest


class MeasureOnly:
    """Drives nothing: somebody else moves the robot."""

    def decide(self, obstacle_map: ObstacleMap, camera: Pose) -> Command:
        x, z, heading = body_of(camera, obstacle_map.body.camera_ahead_cm)
        thing, gap = front_ahead(obstacle_map, (x, z), heading)
        ahead = "nothing known ahead" if thing is None else f"{thing} ahead, {gap:.0f} cm from the rim"
        return Command(0.0, 0.0, f"measuring only: {ahead}", hands_off=True)
