"""By how much the pictures' times are late or early against the wheels', learnt while driving.

Where the robot begins or ends to turn, or to drive, the pictures show it at another time than the encoders
do, if their clocks differ. For every delay that may be, the turn and the way between two pictures are looked
up in the odometry and compared with what the net saw; what was compared is kept as one cost for each delay.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from host.depth.report import Correction, SolvedMotion
from host.nav.odometry import Odometry, heading_of
from host.pose import Pose, wrap

MOST_S = 0.08  # late or early
GRID_S = np.linspace(-MOST_S, MOST_S, 41)
USUAL_S = 0.03  # standard deviation of what is expected before anything is seen
ROWS_SIGMA_S = 0.002  # rows are exposed one after another, and what is seen best may lie above or below
PAIRS = 3  # a picture is compared with so many earlier ones
LONGEST_S = 0.7  # between two pictures compared
KEPT = 48  # pictures
LEAST_TURN_RAD, LEAST_WAY_CM = 0.002, 0.1  # by which a delay must matter for two pictures to be compared
TURN_SIGMA_RAD = 0.001  # of what sight and wheels differ by for other reasons
WHEELS_SIGMA = 0.02  # relative, of the wheels' ratio and of the track
FADE = 0.998  # of what was learnt of these, from comparison to comparison
TRACK_CM = 15.0  # about: a way by so much turns the robot by what the wheels differ in size
WAY_SIGMA_CM, WAY_SHARE = 0.05, 0.1  # the scale of what is seen may be off
STRAIGHT_RAD = 0.02  # turned further, the camera's way is not that of the wheels
HEAVY = 4.0  # degrees of freedom of the errors' distribution: some pictures are far off
COMMON = 0.5  # of each comparison counts, as neighbouring ones share a picture
MEMORY_S = 120.0
DOUBT = 2.0  # standard errors that a delay may be from none without being believed
SLEW_S = 0.001  # most that the delay in use changes from picture to picture


class Wheels:
    """By how much of the turn and of the way the wheels' headings are wrong, learnt beside the delay."""

    def __init__(self) -> None:
        self._information = (1 / WHEELS_SIGMA**2, 0.0, 1 / WHEELS_SIGMA**2)  # turn, both, way
        self._sum = (0.0, 0.0)

    def expect(self, turned_rad: float, way_cm: float) -> tuple[float, float]:
        """(error of a turn by the wheels, its standard error), rad."""
        (tt, tw, ww), (t, w) = self._information, self._sum
        across = way_cm / TRACK_CM
        size = tt * ww - tw * tw
        a, b = (ww * turned_rad - tw * across) / size, (tt * across - tw * turned_rad) / size
        return a * t + b * w, math.sqrt(a * turned_rad + b * across)

    def learn(self, turned_rad: float, way_cm: float, off_rad: float, sigma_rad: float) -> None:
        """What sight told of such a turn; far off counts little."""
        expected, share = self.expect(turned_rad, way_cm)
        far = (off_rad - expected) / math.hypot(sigma_rad, share)
        weight = COMMON / sigma_rad**2 / (1 + far * far / HEAVY)
        (tt, tw, ww), (t, w) = self._information, self._sum
        across, usual = way_cm / TRACK_CM, (1 - FADE) / WHEELS_SIGMA**2
        self._information = (
            FADE * tt + usual + weight * turned_rad * turned_rad,
            FADE * tw + weight * turned_rad * across,
            FADE * ww + usual + weight * across * across,
        )
        self._sum = FADE * t + weight * off_rad * turned_rad, FADE * w + weight * off_rad * across


@dataclass
class _Picture:
    stamp_s: float
    pose: Pose  # that the net's motion was solved on top of
    since: tuple[Correction, ...]
    headings: np.ndarray | None = None  # by the wheels, for each delay; None until they are known
    ways: np.ndarray | None = None
    sigma_heading: float = 0.0  # what the wheels' cells leave open
    sigma_way: float = 0.0


class Delay:
    """What a picture's time must be taken back by. Beyond `MOST_S` nothing is found.

    Attributes
    ----------
    late_s : float
        In use: pictures are stamped so much after they were exposed; 0 until it is clear that they are.
    estimate : tuple of two floats
        The best there is, believed or not, and its standard error, s.
    """

    def __init__(self) -> None:
        self.late_s = 0.0
        self.estimate = (0.0, USUAL_S)
        self._prior = 0.5 * (GRID_S / USUAL_S) ** 2
        self._cost = np.zeros(len(GRID_S))
        self._pictures: deque[_Picture] = deque(maxlen=KEPT)
        self._waiting: deque[_Picture] = deque(maxlen=KEPT)
        self._wheels = Wheels()
        self._learnt_s = -math.inf

    def exposed_s(self, stamp_s: float) -> float:
        """When a picture with this time was taken, by the clock of the wheels."""
        return stamp_s - self.late_s

    def _estimate(self) -> tuple[float, float]:
        cost = self._cost + self._prior
        weight = np.exp(cost.min() - cost)
        weight /= weight.sum()
        mean = float(weight @ GRID_S)
        spread = float(weight @ (GRID_S - mean) ** 2)
        return mean, math.hypot(math.sqrt(spread), ROWS_SIGMA_S)

    def learn(self, stamp_s: float, pose: Pose, motion: SolvedMotion | None, odometry: Odometry) -> None:
        """Take in what the net saw of the motion.

        Parameters
        ----------
        stamp_s : the picture's time, as the camera has it.
        pose : what the motion was solved on top of.
        motion : None where nothing was solved.
        odometry : knows the wheels up to now; pictures wait until it knows enough.
        """
        self._waiting.append(_Picture(stamp_s, pose, motion.since if motion is not None else ()))
        heard = False
        while self._waiting and odometry.settled_s >= self._waiting[0].stamp_s + MOST_S:
            picture = self._waiting.popleft()
            picture.headings, picture.ways = odometry.turned_and_rolled(picture.stamp_s - GRID_S)
            cells = odometry.cell_sigmas(picture.stamp_s - self.estimate[0])
            picture.sigma_way, picture.sigma_heading = cells
            self._forget(picture.stamp_s)
            heard |= self._compare(picture)
            self._pictures.append(picture)
        if heard:
            mean, sigma = self.estimate = self._estimate()
            believed = mean * max(0.0, 1.0 - (DOUBT * sigma / mean) ** 2) if mean else 0.0
            self.late_s += min(max(believed - self.late_s, -SLEW_S), SLEW_S)

    def _forget(self, t_s: float) -> None:
        if math.isfinite(self._learnt_s):
            self._cost *= math.exp(-max(0.0, t_s - self._learnt_s) / MEMORY_S)
        self._learnt_s = t_s

    def _compare(self, now: _Picture) -> bool:
        known = {picture.pose.t_s: picture for picture in self._pictures}
        compared = 0
        for one in reversed(now.since):
            then = known.get(one.since_s)
            if then is None or now.stamp_s - then.stamp_s > LONGEST_S or compared == PAIRS:
                continue
            compared += 1
            self._compare_two(then, now, one)
        return compared > 0

    def _compare_two(self, then: _Picture, now: _Picture, seen: Correction) -> None:
        assert now.headings is not None and now.ways is not None
        assert then.headings is not None and then.ways is not None
        turned = heading_of(now.pose) - heading_of(then.pose) + seen.yaw_rad
        turns, ways = now.headings - then.headings, now.ways - then.ways
        if np.ptp(turns) > LEAST_TURN_RAD:
            off = wrap(turned - turns)
            cells = math.hypot(then.sigma_heading, now.sigma_heading)
            sigma = math.hypot(seen.sigma_yaw_rad, TURN_SIGMA_RAD, cells)
            wheels, share = self._wheels.expect(turned, float(ways.mean()))
            self._add(off - wheels, math.hypot(sigma, share))
            self._wheels.learn(
                turned, float(ways.mean()), float(np.interp(self.estimate[0], GRID_S, off)), sigma
            )
        if np.ptp(ways) > LEAST_WAY_CM and abs(turned) < STRAIGHT_RAD:
            ahead = then.pose.rotation[:, 2]
            came = float(ahead @ (now.pose.position_cm - then.pose.position_cm)) + seen.travel_cm
            share = WAY_SHARE * abs(came)
            cells = math.hypot(then.sigma_way, now.sigma_way)
            self._add(came - ways, math.hypot(seen.sigma_travel_cm, WAY_SIGMA_CM, share, cells))

    def _add(self, off: np.ndarray, sigma: float) -> None:
        """The cost of errors of Student's distribution."""
        self._cost += COMMON * (HEAVY + 1) / 2 * np.log1p((off / sigma) ** 2 / HEAVY)
