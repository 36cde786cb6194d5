"""By how much the pictures' times are late or early against the wheels', learnt while driving.

Where the robot begins or ends to turn, or to drive, the pictures show it at another time than the encoders
do, if their clocks differ: the turn between two pictures is off by the delay times the change of the turning
rate, and the way by the delay times the change of the speed. Elsewhere nothing is to be learnt.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from host.depth.report import Correction, SolvedMotion
from host.nav.config import BodyConfig
from host.nav.localise import Localiser
from host.nav.odometry import Odometry, heading_of
from host.pose import Pose, wrap

MOST_S = 0.1  # late or early; more is not looked for
USUAL_S = 0.03  # standard deviation of what is expected before anything is seen
FRESH_SIGMA_S = 0.002  # as if known so well from the newest alone: older comparisons count less and less
ALIKE_SIGMA_S = 0.004  # in all starts and stops, of what edges tell of them, and by the order of rows
RATE_S = 0.025  # to either side, over which speeds are taken
EVERY_S = 0.06  # pictures nearer to the last one are not looked at
LONGEST_S = 0.7  # between two pictures compared
KEPT = 16  # pictures
LEAST_TURN_RAD_S, LEAST_SPEED_CM_S = 0.15, 4.0  # changes that tell of a delay
TURN_SIGMA_RAD, WAY_SIGMA_CM = 0.003, 0.1  # of what sight and wheels differ by for other reasons
CELLS_SIGMA_COUNTS = 0.2  # of where a wheel stands within its cell
STRAIGHT_RAD = 0.02  # turned further, the camera's way is not that of the wheels
SEEN_SHARE = 0.7  # of what a way is off by shows, for what is solved of it leans on the wheels
HEAVY = 4.0  # degrees of freedom of the errors' distribution: some pictures are far off
TURN_COUNTS, WAY_COUNTS = 0.2, 0.25  # of each comparison, as all of one start or halt share what is wrong
DOUBT = 2.0  # standard errors that a delay may be from none without being believed
SLEW = 0.01  # most that the delay in use changes by in a second, s


@dataclass(frozen=True)
class _Place:
    """Where and how fast the wheels were when a picture was thought to be taken."""

    used_s: float  # the delay thought then
    pose: Pose  # that the net's motion was solved on top of
    heading: float
    way_cm: float
    turn_rad_s: float
    speed_cm_s: float


class Delay:
    """What a picture's time must be taken back by.

    Attributes
    ----------
    late_s : float
        In use: pictures are stamped so much after they were exposed; 0 until it is clear that they are.
    estimate : tuple of two floats
        The best there is, believed or not, and its standard error, s.
    """

    def __init__(self, body: BodyConfig) -> None:
        self.late_s = 0.0
        self.estimate = (0.0, USUAL_S)
        self._information, self._sum = 1 / USUAL_S**2, 0.0
        self._places: deque[_Place] = deque(maxlen=KEPT)
        self._waiting: deque[tuple[float, Pose, tuple[Correction, ...]]] = deque(maxlen=KEPT)
        self._asked_s = -math.inf  # stamp of the last picture
        self._rest_rad = math.sqrt(2) * CELLS_SIGMA_COUNTS * body.cm_per_count / body.track_cm

    def exposed_s(self, stamp_s: float) -> float:
        """When a picture with this time was taken, by the clock of the wheels; to be asked once for each."""
        mean, sigma = self.estimate
        believed = mean * max(0.0, 1.0 - (DOUBT * sigma / mean) ** 2) if mean else 0.0
        most = SLEW * min(max(0.0, stamp_s - self._asked_s), 0.1)
        self.late_s += min(max(believed - self.late_s, -most), most)
        self._asked_s = stamp_s
        return stamp_s - self.late_s

    def learn(
        self, pose: Pose, motion: SolvedMotion | None, odometry: Odometry, localiser: Localiser
    ) -> None:
        """Take in what the net saw of the motion up to the picture asked for last.

        Parameters
        ----------
        pose : what the motion was solved on top of, at the time the picture was thought to be taken.
        motion : None where nothing was solved.
        odometry : knows the wheels up to now; pictures wait until it knows enough.
        localiser : knows what was learnt of the wheels.
        """
        self._waiting.append((self.late_s, pose, motion.since if motion is not None else ()))
        while self._waiting and odometry.settled_s >= self._waiting[0][1].t_s + RATE_S:
            used_s, pose, since = self._waiting.popleft()
            too_soon = bool(self._places) and pose.t_s - self._places[-1].pose.t_s < EVERY_S
            if too_soon or odometry.newest_s - pose.t_s > LONGEST_S:
                continue
            before, after = odometry.rolled_at(pose.t_s - RATE_S), odometry.rolled_at(pose.t_s + RATE_S)
            heading, way_cm = odometry.rolled_at(pose.t_s)
            turn, speed = ((b - a) / (2 * RATE_S) for a, b in zip(before, after, strict=True))
            now = _Place(used_s, pose, heading, way_cm, turn, speed)
            self._compare(now, since, localiser)
            self._places.append(now)

    def _compare(self, now: _Place, since: tuple[Correction, ...], localiser: Localiser) -> None:
        known = {place.pose.t_s: place for place in self._places}
        for one in reversed(since):
            then = known.get(one.since_s)
            if then is not None and now.pose.t_s - then.pose.t_s < LONGEST_S:
                self._turned(then, now, one, localiser)
                self._came(then, now, one)

    def _turned(self, then: _Place, now: _Place, seen: Correction, localiser: Localiser) -> None:
        change = now.turn_rad_s - then.turn_rad_s
        if abs(change) < LEAST_TURN_RAD_S:
            return
        turn, way = now.heading - then.heading, now.way_cm - then.way_cm
        by_wheels, sigma_wheels = localiser.turn_as_learnt(way, turn)
        turned = heading_of(now.pose) - heading_of(then.pose) + seen.yaw_rad
        shift = now.used_s * now.turn_rad_s - then.used_s * then.turn_rad_s
        sigma = math.hypot(seen.sigma_yaw_rad, TURN_SIGMA_RAD, sigma_wheels, self._rest_rad)
        self._add(shift - wrap(turned - by_wheels), change, sigma, TURN_COUNTS)

    def _came(self, then: _Place, now: _Place, seen: Correction) -> None:
        change = now.speed_cm_s - then.speed_cm_s
        if abs(change) < LEAST_SPEED_CM_S or abs(now.heading - then.heading) > STRAIGHT_RAD:
            return
        moved = float(then.pose.rotation[:, 2] @ (now.pose.position_cm - then.pose.position_cm))
        off = moved + seen.travel_cm / SEEN_SHARE - (now.way_cm - then.way_cm)
        shift = now.used_s * now.speed_cm_s - then.used_s * then.speed_cm_s
        sigma = math.hypot(seen.sigma_travel_cm, WAY_SIGMA_CM) / math.sqrt(SEEN_SHARE)
        self._add(shift - off, change, sigma, WAY_COUNTS)

    def _add(self, off: float, change: float, sigma: float, counts: float) -> None:
        """The delay times ``change`` is ``off``, give or take ``sigma``; far off counts little."""
        far = (off - change * self.estimate[0]) / math.hypot(sigma, change * self.estimate[1])
        weight = counts / sigma**2 * (HEAVY + 1) / (HEAVY + far * far)
        news = weight * change * change
        kept = math.exp(-news * FRESH_SIGMA_S**2)
        self._information = kept * self._information + news
        self._sum = kept * self._sum + weight * change * off
        mean = self._sum / self._information
        self.estimate = (
            min(max(mean, -MOST_S), MOST_S),
            math.hypot(1 / math.sqrt(self._information), ALIKE_SIGMA_S),
        )
