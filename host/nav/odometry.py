"""Where the camera was at any time of the last second, by the wheels, and how sure that is.

Errors are of three kinds. Wheels and track are not exactly as long as they are taken for: that grows with all
the way and all the turning, always alike. Wheels slip a little: that grows like a random walk. And where in
its cell a wheel stands, now and at the start, is known to a part of a count only: that does not grow.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from host.link.protocol import NO_EDGE_US, Telemetry
from host.nav.config import BodyConfig
from host.nav.wheel import REST_SIGMA_COUNTS, Wheel
from host.pose import Pose

HISTORY_S = 1.0  # poses can be asked for this far back
START_EDGES = 8  # the start is over when a wheel has turned this far
START_CELLS = 1.2  # wheels that differ by less than this many may have gone equally far
EVEN_START = 0.1  # wheel speeds that differ by less than this part are a straight start
EVEN_START_COUNTS = 0.2  # by which wheels may differ after a straight start
SLIP_CM2_PER_CM = 1e-4  # variance of a wheel's way that its turning does not tell: 1 mm over 1 m
GROWN_CM = 5.0  # the covariance is carried on in steps of this way of a wheel


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
    duty_left: float | None = None  # that its motor is driven with, -1 to 1; None: not known
    duty_right: float | None = None

    @staticmethod
    def of(report: Telemetry, t_s: float) -> WheelReading:
        """What a telemetry message says, which held at host time ``t_s``."""
        ages = (report.edge_age_left_us, report.edge_age_right_us)
        left, right = (None if age == NO_EDGE_US else t_s - 1e-6 * age for age in ages)
        counts, directions = (
            (report.count_left, report.count_right),
            (report.direction_left, report.direction_right),
        )
        duties = (report.duty_left_permille / 1000, report.duty_right_permille / 1000)
        return WheelReading(t_s, *counts, left, right, *directions, *duties)


@dataclass(frozen=True)
class Motion:
    """How the camera moved between two times, in its own frame at the first of them."""

    x_cm: float  # to the right
    z_cm: float  # ahead
    heading_rad: float  # turned to the right
    noise: np.ndarray  # (3, 3) of x, z, heading: slip, and where the wheels stand within their cells
    by_wheels: np.ndarray  # (3, 3) d(x, z, heading) / d(relative size of both wheels, their ratio, track)
    wheels: np.ndarray  # (3, 3) covariance of these three

    @property
    def covariance(self) -> np.ndarray:
        """(3, 3) of x, z, heading; what the wheels' sizes cause is the same error in every motion."""
        return self.noise + self.by_wheels @ self.wheels @ self.by_wheels.T


def advance(x: float, z: float, heading: float, ds_left: float, ds_right: float, track: float):
    """Roll both wheels evenly: exact along the arc. Heading grows to the right."""
    turn = (ds_left - ds_right) / track
    way = 0.5 * (ds_left + ds_right)
    chord = way * (math.sin(turn / 2) / (turn / 2) if abs(turn) > 1e-9 else 1.0)
    middle = heading + turn / 2
    return x + chord * math.sin(middle), z + chord * math.cos(middle), heading + turn


class _Node(NamedTuple):
    """The middle of the axle at a time up to which nothing changes any more."""

    t_s: float
    left_cm: float  # travels, as the counts say
    right_cm: float
    x: float
    z: float
    heading: float


class Trail:
    """The way of the axle's middle through what is settled, with its covariance."""

    def __init__(self, body: BodyConfig) -> None:
        ratio = body.wheel_ratio
        self._larger, self._smaller = (
            2 * ratio / (1 + ratio),
            2 / (1 + ratio),
        )  # left and right, over their mean
        self._track = body.track_cm
        self._nodes = [_Node(-math.inf, 0.0, 0.0, 0.0, -body.camera_ahead_cm, 0.0)]
        self._times = [-math.inf]
        self._wheels = np.diag([body.size_sigma, body.ratio_sigma, body.track_sigma]) ** 2
        self._grown = np.zeros((6, 6))  # covariance of x, z, heading and the wheels' three, at a node
        self._grown[3:, 3:] = self._wheels
        self._grown_at = self._nodes[0]

    @property
    def wheels(self) -> np.ndarray:
        """(3, 3) covariance of the wheels' relative size, ratio and track."""
        return self._wheels

    @property
    def last(self) -> _Node:
        """The newest node."""
        return self._nodes[-1]

    def step(self, node: _Node, t_s: float, left_cm: float, right_cm: float) -> _Node:
        """Where both wheels, rolling evenly on from a node to these travels, take the axle."""
        left, right = left_cm - node.left_cm, right_cm - node.right_cm
        if left == 0.0 and right == 0.0:
            return _Node(t_s, left_cm, right_cm, node.x, node.z, node.heading)
        return _Node(t_s, left_cm, right_cm, *self._roll(node, left, right))

    def _roll(self, node: _Node, left_cm: float, right_cm: float) -> tuple[float, float, float]:
        """(x, z, heading) when both wheels have turned so far since a node."""
        left, right = self._larger * left_cm, self._smaller * right_cm
        return advance(node.x, node.z, node.heading, left, right, self._track)

    def append(self, t_s: float, left_cm: float, right_cm: float) -> None:
        """Settled up to here."""
        node = self.step(self.last, t_s, left_cm, right_cm)
        self._nodes.append(node)
        self._times.append(t_s)
        since = self._grown_at
        if max(abs(left_cm - since.left_cm), abs(right_cm - since.right_cm)) > GROWN_CM:
            self._grown = self._growth(self._grown, since, node)
            self._grown_at = node

    def begin(self, sigma_way_cm: float, sigma_heading_rad: float) -> None:
        """How far the place where the axle is taken to have been at first may be off."""
        self._grown[1, 1], self._grown[2, 2] = sigma_way_cm**2, sigma_heading_rad**2

    def at(self, t_s: float) -> _Node:
        """At a time up to the newest node's; before the oldest, the oldest."""
        k = bisect_right(self._times, t_s)
        if k == 0:
            return self._nodes[0]
        if k == len(self._times):
            return self._nodes[-1]
        before, after = self._nodes[k - 1], self._nodes[k]
        if before.left_cm == after.left_cm and before.right_cm == after.right_cm:
            return before
        part = (t_s - before.t_s) / (after.t_s - before.t_s)
        left = part * (after.left_cm - before.left_cm)
        right = part * (after.right_cm - before.right_cm)
        return _Node(t_s, before.left_cm + left, before.right_cm + right, *self._roll(before, left, right))

    def forget(self, t_s: float) -> None:
        """Nobody will ask for times before this one."""
        keep = max(0, bisect_right(self._times, t_s) - 1)
        del self._nodes[:keep], self._times[:keep]

    def covariance(self, node: _Node) -> np.ndarray:
        """(3, 3) of x, z, heading of the axle there, without what the wheels' cells leave open."""
        return self._growth(self._grown, self._grown_at, node)[:3, :3]

    def _growth(self, grown: np.ndarray, a: _Node, b: _Node) -> np.ndarray:
        noise, by_wheels = self.between(a, b)
        move = np.eye(6)
        move[0, 2], move[1, 2] = b.z - a.z, a.x - b.x
        c, s = math.cos(a.heading), math.sin(a.heading)
        turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        move[:3, 3:] = turn @ by_wheels
        out = move @ grown @ move.T
        out[:3, :3] += turn @ noise @ turn.T
        return out

    def between(self, a: _Node, b: _Node) -> tuple[np.ndarray, np.ndarray]:
        """(noise by slip, derivatives by the wheels) of the axle's motion from one node to another.

        Both (3, 3) of x to the right, z ahead, heading, as seen at the first.
        """
        left, right = self._larger * (b.left_cm - a.left_cm), self._smaller * (b.right_cm - a.right_cm)
        way, turn = (left + right) / 2, (left - right) / self._track
        c, s = math.cos(turn / 2), math.sin(turn / 2)

        def moved(d_way: float, d_turn: float) -> tuple[float, float, float]:
            return s * d_way + 0.5 * c * way * d_turn, c * d_way - 0.5 * s * way * d_turn, d_turn

        one_left, one_right = (np.array(moved(0.5, sign / self._track)) for sign in (1, -1))
        noise = SLIP_CM2_PER_CM * (
            abs(left) * np.outer(one_left, one_left) + abs(right) * np.outer(one_right, one_right)
        )
        by_size = moved(way, turn)
        by_ratio = moved((left - right) / 4, way / self._track)
        by_track = moved(0.0, -turn)
        return noise, np.column_stack([by_size, by_ratio, by_track])


class Odometry:
    """The planar path of the robot; gives the camera's pose. World: the camera at the start."""

    def __init__(self, body: BodyConfig):
        self._body = body
        self._left: Wheel | None = None
        self._right: Wheel | None = None
        self._phase_known = False
        self._trail = Trail(body)
        self._begun = False
        self._start_sigma_cm = 0.0  # of the mean travel, since it began within a cell
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

    @property
    def settled_s(self) -> float:
        """Up to here no later reading changes the path."""
        return self._trail.last.t_s

    def rolled_at(self, t_s: float) -> tuple[float, float]:
        """(heading in rad, way of the axle in cm, back again counting less) at a time, as `pose_at`."""
        node = self._axle(t_s)
        return node.heading, (node.left_cm + node.right_cm) / 2

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
        t_s = reading.t_s
        left, right = reading.count_left + self._zeros[0], reading.count_right + self._zeros[1]
        if self._left is None or self._right is None:
            cell = self._body.cm_per_count
            self._left, self._right = Wheel(cell, t_s, left), Wheel(cell, t_s, right)
        if t_s <= self._newest_s:
            return
        self._newest_s = t_s
        before_left, before_right = self._counts or (left, right)
        self._rolled[0] += abs(left - before_left)
        self._rolled[1] += abs(right - before_right)
        self._counts = left, right
        self._left.add(t_s, left, reading.edge_left_s, reading.direction_left, reading.duty_left)
        self._right.add(t_s, right, reading.edge_right_s, reading.direction_right, reading.duty_right)
        self._settle()
        self._find_phase()
        for part in (self._trail, self._left, self._right):
            part.forget(t_s - HISTORY_S)

    def _settle(self) -> None:
        assert self._left is not None and self._right is not None
        until_s = min(self._left.settled_s, self._right.settled_s)
        for t_s in self._bends(self._trail.last.t_s, until_s):
            self._trail.append(t_s, *self._travels(t_s))
        if not self._begun and self._left.edges + self._right.edges > 0:
            self._begin(self._body.cm_per_count * REST_SIGMA_COUNTS / math.sqrt(2))

    def _bends(self, after_s: float, until_s: float) -> list[float]:
        """Times at which either wheel changes its speed, and the last."""
        assert self._left is not None and self._right is not None
        if not until_s > after_s:
            return []
        return sorted({*self._left.knots(after_s, until_s), *self._right.knots(after_s, until_s), until_s})

    def _begin(self, sigma_way_cm: float, sigma_difference_cm: float | None = None) -> None:
        """The wheels have moved: the camera began where it was, but within their cells they did anywhere."""
        sigma = 2 * sigma_way_cm if sigma_difference_cm is None else sigma_difference_cm
        self._begun, self._start_sigma_cm = True, sigma_way_cm
        self._trail.begin(sigma_way_cm, sigma / self._body.track_cm)

    def _find_phase(self) -> None:
        """Where in its cell each wheel began: from how it started; on a straight start both much alike."""
        left, right = self._left, self._right
        assert left is not None and right is not None
        if self._phase_known or min(left.edges, right.edges) < 3:
            return
        fast = max(abs(left.velocity()), abs(right.velocity()))
        even = abs(left.velocity() - right.velocity()) < EVEN_START * fast
        starts = left.lead_in(), right.lead_in()
        by_motors = all(start.by_motor for start in starts)
        self._phase_known = even or by_motors or max(left.edges, right.edges) > START_EDGES
        if not even and not by_motors:
            return
        t, cell = self._newest_s, self._body.cm_per_count
        difference = left.travel(t) - right.travel(t)
        if even and abs(difference) >= cell:
            return
        a, b = (start.sigma_cm**2 for start in starts)
        alike = (EVEN_START_COUNTS * cell) ** 2 if even else math.inf
        unlike = difference + starts[0].back_cm - starts[1].back_cm
        left.shift(starts[0].back_cm - unlike * a / (a + b + alike))
        right.shift(starts[1].back_cm + unlike * b / (a + b + alike))
        # what the path then lacks, the next step makes up for
        both = (a + b) / (1 + (a + b) / alike)  # variances: of their difference, and of their mean
        mean = (a + b) / 4 - (a - b) ** 2 / (4 * (a + b + alike))
        self._begin(math.sqrt(mean), math.sqrt(both))

    def _travels(self, t_s: float) -> tuple[float, float]:
        """Travel of both wheels; equal for a straight start, until the phases are known."""
        assert self._left is not None and self._right is not None
        left, right = self._left.travel(t_s), self._right.travel(t_s)
        alike = left * right >= 0.0 and abs(left - right) < START_CELLS * self._body.cm_per_count
        if alike and not self._phase_known:
            return (left + right) / 2, (left + right) / 2
        return left, right

    def _axle(self, t_s: float) -> _Node:
        node = self._trail.last
        if t_s <= node.t_s or self._left is None:
            return self._trail.at(t_s)
        for when in self._bends(node.t_s, t_s):
            node = self._trail.step(node, when, *self._travels(when))
        return node

    def pose_at(self, t_s: float) -> Pose:
        """Pose of the camera at a time between one second before the newest reading and shortly after it.

        ``sigma_z_cm`` and ``sigma_rot_rad`` hold what the wheels' cells leave open, now and at the start; a
        wrong wheel size scales all travel alike and is not in them (see `covariance_at`). Times before the
        history give its oldest pose.
        """
        node = self._axle(t_s)
        if not self._begun or self._left is None or self._right is None:
            return self._camera(node, t_s)
        both = math.hypot(self._left.sigma(t_s), self._right.sigma(t_s))
        return self._camera(
            node,
            t_s,
            sigma_z_cm=math.hypot(both / 2, self._start_sigma_cm),
            sigma_rot_rad=math.sqrt(2) * both / self._body.track_cm,
        )

    def _camera(self, node: _Node, t_s: float, **more: float) -> Pose:
        x, z = self._lens(node)
        return Pose.planar(x, z, node.heading, t_s=t_s, **more)

    def _lens(self, node: _Node) -> tuple[float, float]:
        ahead = self._body.camera_ahead_cm
        return node.x + ahead * math.sin(node.heading), node.z + ahead * math.cos(node.heading)

    def covariance_at(self, t_s: float) -> np.ndarray:
        """(3, 3) of x, z, heading of the camera's pose since the start, in cm and rad; it only grows."""
        node = self._axle(t_s)
        if not self._begun:
            return np.zeros((3, 3))
        lever = self._lever(node.heading)
        return lever @ (self._trail.covariance(node) + self._cells(t_s, node.heading)) @ lever.T

    def motion(self, from_s: float, to_s: float) -> Motion:
        """How the camera moved between two times of the last second."""
        a, b = self._axle(from_s), self._axle(to_s)
        (xa, za), (xb, zb) = self._lens(a), self._lens(b)
        c, s = math.cos(a.heading), math.sin(a.heading)
        noise, by_wheels = self._trail.between(a, b)
        turn = b.heading - a.heading
        if a.left_cm != b.left_cm or a.right_cm != b.right_cm:
            noise = noise + self._cells(from_s, 0.0) + self._cells(to_s, turn)
        # the camera stands ahead of the axle: what a wrong turn does to it, seen from where it was
        lever = self._lever(turn)
        return Motion(
            c * (xb - xa) - s * (zb - za),
            s * (xb - xa) + c * (zb - za),
            turn,
            lever @ noise @ lever.T,
            lever @ by_wheels,
            self._trail.wheels,
        )

    def _lever(self, heading: float) -> np.ndarray:
        ahead = self._body.camera_ahead_cm
        lever = np.eye(3)
        lever[0, 2], lever[1, 2] = ahead * math.cos(heading), -ahead * math.sin(heading)
        return lever

    def _cells(self, t_s: float, heading: float) -> np.ndarray:
        """(3, 3) of the axle's x, z, heading: where in their cells the wheels stand."""
        if self._left is None or self._right is None:
            return np.zeros((3, 3))
        out = np.zeros((3, 3))
        for wheel, sign in ((self._left, 1), (self._right, -1)):
            one = np.array([math.sin(heading) / 2, math.cos(heading) / 2, sign / self._body.track_cm])
            out += wheel.sigma(t_s) ** 2 * np.outer(one, one)
        return out


def heading_of(pose: Pose) -> float:
    """Planar heading of a pose, rad, positive to the right."""
    return math.atan2(pose.rotation[0, 2], pose.rotation[2, 2])


def body_of(camera: Pose, ahead_cm: float) -> tuple[float, float, float]:
    """(x, z, heading) of the axle's middle behind a camera pose."""
    heading = heading_of(camera)
    x, z = float(camera.position_cm[0]), float(camera.position_cm[2])
    return x - ahead_cm * math.sin(heading), z - ahead_cm * math.cos(heading), heading
