"""Who gives way: who knows of something that moves crosses its line only where that is sure to go well.

The way ahead is driven in thought against where the mover can be meanwhile. If the two cannot meet, the robot
goes; if they can, it goes only as near to the line as it can wait and watch. Caught in the line, it leaves
on the side where there is more room.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from host.nav.config import BodyConfig, NavConfig
from host.nav.map import Obstacle
from host.nav.mover import NAMELESS, Mover
from host.pose import bearing

FORESIGHT_S = 8.0
LEAVE_S = 5.0  # who stands in a line looks so far ahead
STEP_S = 0.2
BERTH_CM = 4.0  # the rim keeps this far from where it can be
CROSSING_BERTH_CM = 1.0  # once it is on its way across
ON_LINE_CM = 3.0  # who is nearer to where it may ever come stands in its line
WAIT_CM = 45.0  # it waits with its rim this far off: there it sees the feet of what comes
GAIN_CM_S2 = 40.0  # the robot gains speed like this
SLOWER = 0.85  # and may be slower than it is told by this factor
ACTS_S = 0.15  # until a command takes effect
BACK_CM_S = 10.0
TURN_FROM_RAD = math.radians(18)  # off its heading by more than this it turns first
AFTER_TURN_S = 0.4
WATCH_CM = 45.0  # what moves nobody knows where to is waited for when it is nearer than this
BELIEVED_S = 1.0  # so long after it was last seen
LOOK_CM = 2.0  # steps in which a place to wait at is looked for
FAR_CM = 150.0


@dataclass(frozen=True)
class Course:
    """What the robot is about to do: where it stands, how fast it goes, the way it means to go."""

    here: tuple[float, float]  # x, z of the middle
    heading: float
    v_cm_s: float
    points: tuple[tuple[float, float], ...]  # that it means to pass, each after a turn in place
    room_cm: float  # straight ahead the rim can go this far
    fast_cm: float  # and this far at full speed: over floor that was seen, to nothing that is in doubt
    back_cm: float  # and this far back
    berth_cm: float = BERTH_CM  # that it keeps from where something can be


@dataclass(frozen=True)
class Verdict:
    """What something that moves leaves to the robot."""

    thing: Mover | Obstacle
    room_cm: float  # the rim may go straight on so far
    leave: int = 0  # 1: on, -1: back, out of its line; 0: it may stay

    def __str__(self) -> str:
        if isinstance(self.thing, Mover):
            name = "something" if self.thing.region == NAMELESS else f"region {self.thing.region}"
            return f"{name} (foot, moving) at {abs(self.thing.speed_cm_s):.0f} cm/s"
        return str(self.thing)


def judge(
    movers: Sequence[Mover], course: Course, body: BodyConfig, config: NavConfig, t_s: float
) -> Verdict | None:
    """The mover that leaves the robot least, None where all leave it free."""
    if not movers:
        return None
    after = np.arange(0.0, FORESIGHT_S + 1e-9, STEP_S)
    ways = [_driven(course, config, after, part) for part in (1.0, SLOWER)]
    verdicts = [_against(mover, course, body, config, t_s, after, ways) for mover in movers]
    held = [one for one in verdicts if one is not None]
    return min(held, key=lambda one: (one.leave == 0, one.room_cm), default=None)


def _against(
    mover: Mover,
    course: Course,
    body: BodyConfig,
    config: NavConfig,
    t_s: float,
    after: np.ndarray,
    ways: list[tuple[np.ndarray, bool]],
) -> Verdict | None:
    here = np.array([course.here])
    driving = min(float(mover.gap_cm(way, t_s + after).min()) for way, _ in ways) - body.radius_cm
    off = float(mover.least_gap_cm(here)[0]) - body.radius_cm
    if off >= ON_LINE_CM:  # who would be held up in its line does not set out
        stuck = [float(mover.least_gap_cm(way[-1:])[0]) for way, held_up in ways if held_up]
        driving = min([driving, *(gap - body.radius_cm for gap in stuck)])
    if driving > course.berth_cm:
        return None
    if off < ON_LINE_CM:
        leave = _way_out(mover, course, body, t_s, after[after <= LEAVE_S], ways[0][0])
        if leave is not None:
            return Verdict(mover, 0.0, leave)
    steps = np.arange(0.0, FAR_CM, LOOK_CM)
    heading = bearing(course.here, course.points[0]) if course.points else course.heading
    ahead = here + steps[:, None] * np.array([math.sin(heading), math.cos(heading)])
    gaps = mover.least_gap_cm(ahead) - body.radius_cm
    shut = gaps < min(WAIT_CM, off) - LOOK_CM / 2
    if not shut.any():
        return None
    return Verdict(mover, float(max(0.0, steps[int(shut.argmax())] - LOOK_CM)))


def _way_out(
    mover: Mover, course: Course, body: BodyConfig, t_s: float, after: np.ndarray, driven: np.ndarray
) -> int | None:
    """On, back, or to stay, whichever it keeps farthest off in the next seconds; on and back alike: on."""
    stays = np.broadcast_to(np.array(course.here), (len(after), 2))
    along = np.array([math.sin(course.heading), math.cos(course.heading)])
    back_cm = np.minimum(BACK_CM_S * np.maximum(after - ACTS_S, 0.0), max(0.0, course.back_cm))
    backs = stays - back_cm[:, None] * along

    def worth(way: np.ndarray) -> float:
        gaps = mover.gap_cm(way, t_s + after) - body.radius_cm
        if (gaps < 0.0).any():  # the later the better
            return float(after[int((gaps < 0.0).argmax())]) - 2 * LEAVE_S
        ends = float(mover.least_gap_cm(way[-1:])[0]) - body.radius_cm  # and out of it at last
        return min(2 * BERTH_CM, float(gaps.min())) + min(0.0, ends - BERTH_CM) / 10

    chosen = {1: worth(driven[: len(after)]), -1: worth(backs), 0: worth(stays)}
    best = max(chosen, key=lambda way: chosen[way])
    return best if best != 0 else None


def _driven(course: Course, config: NavConfig, after: np.ndarray, part: float) -> tuple[np.ndarray, bool]:
    """Where the robot is at times from now on if it goes its way, at this part of the speed it is told.

    And whether it ends where something holds it up, before all that it means to pass.
    """
    x, z = course.here
    heading, v, gone = course.heading, course.v_cm_s, 0.0
    points = list(course.points)
    turns_s = 0.0  # it turns for so long yet
    room = course.room_cm
    places = []
    for now_s in after.tolist():
        places.append((x, z))
        if points:
            onto = bearing((x, z), points[0])
            turn = abs(math.remainder(onto - heading, 2 * math.pi))
            heading = onto
            if turn > TURN_FROM_RAD:
                turns_s, v = turn / config.turn_rad_s + AFTER_TURN_S, 0.0
                room = math.inf  # straight ahead, where it no longer goes
        if turns_s > 0.0:
            turns_s -= STEP_S
            continue
        most = part * min(config.speed_cm_s, config.creep_cm_s + 2 * max(0.0, course.fast_cm - gone))
        if now_s >= ACTS_S:
            v = min(most, v + GAIN_CM_S2 * STEP_S)
        step = min(v * STEP_S, room - gone)
        while points and math.dist(points[0], (x, z)) <= step:
            points.pop(0)
            if not points:
                room = gone
                step = 0.0
        x, z, gone = x + step * math.sin(heading), z + step * math.cos(heading), gone + step
    return np.array(places), bool(points) and gone >= room


def leads_into_a_line(
    movers: Sequence[Mover], here: tuple[float, float], heading: float, back_cm: float, radius_cm: float
) -> bool:
    """Whether so far straight back the robot would stand in the line of something that moves."""
    back = here[0] - back_cm * math.sin(heading), here[1] - back_cm * math.cos(heading)
    gaps = [mover.least_gap_cm(np.array([here, back])) - radius_cm for mover in movers]
    return any(bool(end < min(BERTH_CM, start)) for start, end in gaps)


def unknown_mover(
    obstacles: Sequence[Obstacle],
    movers: Sequence[Mover],
    here: tuple[float, float],
    heading: float,
    radius_cm: float,
    t_s: float,
) -> Obstacle | None:
    """Something near ahead whose outline moves as nothing does that stands; nobody knows where to."""
    tracked = {mover.region for mover in movers}
    nearest, thing = WATCH_CM, None
    for one in obstacles:
        if not one.moving or t_s - one.t_s > BELIEVED_S or one.region in tracked:
            continue
        if movers and one.velocity_cm_s is not None:  # it is one of them, below the picture
            continue
        left, right = np.array(one.left_cm), np.array(one.right_cm)
        middle = (left + right) / 2 - here
        gap = float(np.hypot(*middle)) - float(np.hypot(*(right - left))) / 2 - radius_cm
        ahead = float(middle @ (math.sin(heading), math.cos(heading))) > 0
        if ahead and gap < nearest:
            nearest, thing = gap, one
    return thing
