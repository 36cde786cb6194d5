"""Where the camera was at any time of the last second, from encoder counts and the times of their edges.

A count says that a wheel is somewhere within one cell of 0.5 cm; the time of an edge says when it stood
exactly on a cell's border. Between edges a wheel is taken to turn evenly, so that on steady motion the
travel is known to a small part of a count; where the borders lie, if not evenly, is learnt (see marks.py).
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, replace

from host.link.protocol import NO_EDGE_US, Telemetry
from host.nav.config import BodyConfig
from host.nav.marks import Marks
from host.pose import Pose

HISTORY_S = 1.0  # poses can be asked for this far back
AHEAD_S = 0.1  # a pose may be asked for this long after the newest reading
SAME_EDGE_S = 0.001  # an edge's time may shift by less than this as the clocks are compared anew
REST_S = 0.25  # a wheel without an edge for this long, and four times its last period, stands
START_EDGES = 8  # the start is over when a wheel has turned this far
START_CELLS = 1.2  # wheels that differ by less than this many may have gone equally far
EVEN_START = 0.1  # wheel speeds that differ by less than this part are a straight start
EVEN_SIGMA_COUNTS = 0.01  # interpolation error of a wheel that turns evenly
CHANGE_SIGMA_COUNTS = 0.25  # and for each unit by which the last two periods differ, relatively
REST_SIGMA_COUNTS = 1 / math.sqrt(12)  # a standing wheel is anywhere within its cell


@dataclass(frozen=True)
class WheelReading:
    """What telemetry says of both wheels at one time, on the host's clock."""

    t_s: float
    count_left: int
    count_right: int
    edge_left_s: float | None  # time of the wheel's last edge; None before the first one
    edge_right_s: float | None
    direction_left: int = 0  # of that edge: 1 forward, -1 backward, 0 not known
    direction_right: int = 0

    @staticmethod
    def of(report: Telemetry, t_s: float) -> WheelReading:
        """What a telemetry message says, which held at host time ``t_s``."""
        ages = (report.edge_age_left_us, report.edge_age_right_us)
        left, right = (None if age == NO_EDGE_US else t_s - 1e-6 * age for age in ages)
        counts, directions = (
            (report.count_left, report.count_right),
            (report.direction_left, report.direction_right),
        )
        return WheelReading(t_s, *counts, left, right, *directions)


class Wheel:
    """Travel of one wheel as a piecewise linear function of time through its encoder edges."""

    def __init__(self, cm_per_count: float, t_s: float, count: int):
        self._cell = cm_per_count
        self._zero = count + 0.5  # at the start the wheel is taken to stand in the middle of its cell
        self._count = count
        self._border = count  # of the last edge
        self._marks = Marks()
        self._edge_s: float | None = None
        self._sign = 1
        self._t = [t_s]  # knots: time, travel
        self._s = [0.0]
        self._resting = True  # the last knot says where the wheel stands, and moves on in time
        self._heard_s = t_s  # up to here it is known that no further edge has come
        self.edges = 0

    def add(self, t_s: float, count: int, edge_s: float | None, direction: int = 0) -> None:
        """One reading; an edge without a count is the one known already, or there and back again."""
        self._heard_s = t_s
        known = self._edge_s is not None and edge_s is not None and abs(edge_s - self._edge_s) < SAME_EDGE_S
        if edge_s is not None and (count != self._count or not known):
            self._add_edge(edge_s, count, direction)
        elif self._resting:
            self._t[-1] = max(self._t[-1], t_s)
        elif t_s - self._t[-1] > max(REST_S, 4 * self._cell / max(self._speed(), 1e-9)):
            middle = self._s[-1] + 0.5 * self._sign * self._cell
            for when in (self._t[-1] + REST_S / 2, t_s):
                self._t.append(when)
                self._s.append(middle)
            self._resting = True

    def _add_edge(self, edge_s: float, count: int, direction: int) -> None:
        if direction == 0 and count == self._count:  # there and back, whichever came last
            border = round(self._s[-1] / self._cell + self._zero)
            direction = 1 if border == count else -1
        direction = direction or (1 if count > self._count else -1)
        border = count if direction > 0 else count + 1
        self._marks.hear(edge_s, border)
        travel = (self._marks.place(border) - self._zero) * self._cell
        self._border, self._sign = border, direction
        self._count, self._edge_s = count, edge_s
        self._resting = False
        self.edges += 1
        while len(self._t) > 1 and self._t[-1] >= edge_s:  # a rest that the late edge contradicts
            self._t.pop()
            self._s.pop()
        if edge_s > self._t[-1]:
            self._t.append(edge_s)
            self._s.append(travel)
        else:
            self._s[-1] = travel

    def _speed(self) -> float:
        """Speed over the last full cell, cm/s, without sign."""
        if len(self._t) < 2 or self._s[-1] == self._s[-2]:
            return 0.0
        return abs(self._s[-1] - self._s[-2]) / (self._t[-1] - self._t[-2])

    def _to_next(self) -> float:
        """Counts from the last edge to the next one in the same direction; about 1."""
        return abs(self._marks.place(self._border + self._sign) - self._marks.place(self._border))

    def velocity(self) -> float:
        return self._sign * self._speed()

    def restart(self) -> None:
        """The counts go on, but what was learnt of the single edges is no longer true."""
        self._marks.forget()

    def shift(self, cm: float) -> None:
        """Correct where in its cell the wheel stood at the start."""
        self._zero -= cm / self._cell
        self._s[1:] = [s + cm for s in self._s[1:]]

    def travel(self, t_s: float) -> float:
        """Travel at a time, cm; beyond the last edge it goes on, short of an edge that did not come."""
        if t_s >= self._t[-1]:
            if self._resting:
                return self._s[-1]
            cell = self._cell * self._to_next()
            speed = self._speed() / cell  # cells a second
            u = speed * (min(t_s, self._heard_s) - self._t[-1])
            if u > 1:
                speed, u = speed / u**2, 0.5 + 0.5 / u
            u += speed * min(max(0.0, t_s - self._heard_s), AHEAD_S)
            return self._s[-1] + self._sign * cell * u
        k = bisect_right(self._t, t_s)
        if k == 0:
            return self._s[0]
        part = (t_s - self._t[k - 1]) / (self._t[k] - self._t[k - 1])
        return self._s[k - 1] + part * (self._s[k] - self._s[k - 1])

    def sigma(self, t_s: float) -> float:
        """Standard error of the travel within its cell, cm; small before it first moves, as that is 0."""
        if self.edges == 0:
            return self._cell * EVEN_SIGMA_COUNTS
        late = t_s > self._t[-1] + 2 * self._cell / max(self._speed(), 1e-9)
        if self._resting or late or len(self._t) < 3:
            return self._cell * REST_SIGMA_COUNTS
        (a, b, c), (p, q, r) = self._t[-3:], self._s[-3:]
        before, last = abs((q - p) / (b - a)), abs((r - q) / (c - b))
        change = abs(last - before) / max(last, before, 1e-9)
        return self._cell * min(REST_SIGMA_COUNTS, EVEN_SIGMA_COUNTS + CHANGE_SIGMA_COUNTS * change)

    def knots(self, t0: float, t1: float) -> list[float]:
        return self._t[bisect_right(self._t, t0) : bisect_right(self._t, t1)]

    def forget(self, t_s: float) -> None:
        keep = max(0, bisect_right(self._t, t_s) - 2)
        del self._t[:keep], self._s[:keep]


def advance(x: float, z: float, heading: float, ds_left: float, ds_right: float, track: float):
    """Roll both wheels evenly: exact along the arc. Heading grows to the right."""
    turn = (ds_left - ds_right) / track
    way = 0.5 * (ds_left + ds_right)
    chord = way * (math.sin(turn / 2) / (turn / 2) if abs(turn) > 1e-9 else 1.0)
    middle = heading + turn / 2
    return x + chord * math.sin(middle), z + chord * math.cos(middle), heading + turn


class Odometry:
    """The planar path of the robot; gives the camera's pose. World: the camera at the start."""

    def __init__(self, body: BodyConfig):
        self._body = body
        self._left: Wheel | None = None
        self._right: Wheel | None = None
        self._phase_known = False
        self._base = (0.0, 0.0, -body.camera_ahead_cm, 0.0)  # time, x, z, heading of the axle's middle
        self._newest_s = -math.inf
        self._counts: tuple[int, int] | None = None
        self._zeros = (0, 0)  # where the robot's counts began, on the odometry's
        self._rolled = [0, 0]

    @property
    def rolled_cm(self) -> float:
        """Path of the wheel that has turned most, forwards and backwards alike."""
        return max(self._rolled) * self._body.cm_per_count

    @property
    def newest_s(self) -> float:
        """Time of the newest reading; -inf before the first."""
        return self._newest_s

    def restart(self) -> None:
        """The robot restarted: its counts begin at zero again, where the wheels were at the last reading.

        What they turned until its firmware ran again, nobody has counted.
        """
        self._zeros = self._counts or (0, 0)
        for wheel in (self._left, self._right):
            if wheel is not None:
                wheel.restart()

    def add(self, reading: WheelReading) -> None:
        """Take one reading; readings out of order are ignored."""
        left, right = self._zeros
        r = replace(reading, count_left=reading.count_left + left, count_right=reading.count_right + right)
        if self._left is None or self._right is None:
            cell = self._body.cm_per_count
            self._left = Wheel(cell, r.t_s, r.count_left)
            self._right = Wheel(cell, r.t_s, r.count_right)
            self._base = (r.t_s, *self._base[1:])
        if r.t_s <= self._newest_s:
            return
        self._newest_s = r.t_s
        counts = (r.count_left, r.count_right)
        before = self._counts or counts
        self._rolled = [n + abs(b - a) for n, a, b in zip(self._rolled, before, counts, strict=True)]
        self._counts = counts
        self._left.add(r.t_s, r.count_left, r.edge_left_s, r.direction_left)
        self._right.add(r.t_s, r.count_right, r.edge_right_s, r.direction_right)
        self._find_phase()
        if r.t_s - HISTORY_S > self._base[0]:
            base_t = r.t_s - HISTORY_S
            self._base = (base_t, *self._integrate(base_t))
            self._left.forget(base_t)
            self._right.forget(base_t)

    def _find_phase(self) -> None:
        """On a straight start both wheels have gone equally far: that tells where in its cell each began."""
        left, right = self._left, self._right
        assert left is not None and right is not None
        if self._phase_known or min(left.edges, right.edges) < 3:
            return
        fast = max(abs(left.velocity()), abs(right.velocity()))
        even = abs(left.velocity() - right.velocity()) < EVEN_START * fast
        self._phase_known = even or max(left.edges, right.edges) > START_EDGES
        if not even:
            return
        t = self._newest_s
        difference = left.travel(t) - right.travel(t)
        if abs(difference) < self._body.cm_per_count:
            left.shift(-difference / 2)
            right.shift(difference / 2)

    def _integrate(self, t_s: float) -> tuple[float, float, float]:
        t0, x, z, heading = self._base
        left, right = self._left, self._right
        assert left is not None and right is not None
        times = [t0, *sorted({*left.knots(t0, t_s), *right.knots(t0, t_s)} - {t0}), t_s]
        s_left, s_right = self._travels(t0)
        for t in times[1:]:
            now_left, now_right = self._travels(t)
            x, z, heading = advance(
                x, z, heading, now_left - s_left, now_right - s_right, self._body.track_cm
            )
            s_left, s_right = now_left, now_right
        return x, z, heading

    def _travels(self, t_s: float) -> tuple[float, float]:
        """Travel of both wheels; equal for a straight start, until the phases are known."""
        assert self._left is not None and self._right is not None
        left, right = self._left.travel(t_s), self._right.travel(t_s)
        if not self._phase_known and abs(left - right) < START_CELLS * self._body.cm_per_count:
            return (left + right) / 2, (left + right) / 2
        return left, right

    def pose_at(self, t_s: float) -> Pose:
        """Pose of the camera at a time between one second before the newest reading and shortly after it.

        ``sigma_z_cm`` and ``sigma_rot_rad`` hold the part that differs from frame to frame (where the
        wheels stand within their cells); a wrong wheel size scales all travel alike and is not in them.
        Times before the history give its oldest pose.
        """
        ahead = self._body.camera_ahead_cm
        if self._left is None or self._right is None:
            return Pose.planar(0.0, 0.0, 0.0, t_s=t_s)
        x, z, heading = self._integrate(max(t_s, self._base[0]))
        sigma_left, sigma_right = self._left.sigma(t_s), self._right.sigma(t_s)
        both = math.hypot(sigma_left, sigma_right)
        return Pose.planar(
            x + ahead * math.sin(heading),
            z + ahead * math.cos(heading),
            heading,
            t_s=t_s,
            sigma_z_cm=both / 2,
            sigma_rot_rad=math.sqrt(2) * both / self._body.track_cm,
        )


def heading_of(pose: Pose) -> float:
    """Planar heading of a pose, rad, positive to the right."""
    return math.atan2(pose.rotation[0, 2], pose.rotation[2, 2])
