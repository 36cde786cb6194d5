"""A robot, and something that goes to and fro across its way, without pictures: many cases in a minute.

What moves is seen where the camera would see its foot: within the view, neither too near nor too far, late,
its distance off by a common error and by whole pixels. All else is as in a drive: what is remembered of it,
and steering. A tool of the tests.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from host.nav.config import BodyConfig, NavConfig
from host.nav.intent import Plan
from host.nav.map import ObstacleMap
from host.nav.mover import Sight
from host.nav.steer import decide
from host.nav.tracks import Movers
from host.pose import Pose

FRAME_S = 1 / 15
LATE_FRAMES = 3  # from a picture until the wheels do what was made of it
STEPS = 7  # of the motion from picture to picture
VIEW = 0.56  # x/z at the picture's border
NEAREST_CM, FARTHEST_CM = 36.0, 200.0  # feet that are seen
HEIGHT_CM = 15.0
PIXEL = 0.0036  # slope of a row
RADIUS_CM = 12.0
TOUCH_ENDS_CM = 0.5
MOVER = 7


@dataclass(frozen=True)
class Outcome:
    """How a drive went."""

    arrived: bool
    seconds: float
    touched_driving: int
    touched_standing: int
    least_gap_cm: float
    seen_before_s: float  # the first touch; infinite without any, 0 where nobody knew that something moves


@dataclass
class CrossingWorld:
    """Open floor, in a corridor or not, and one round thing that crosses."""

    seed: int
    corridor: bool = False
    rough: bool = False  # with the mistakes that a net makes

    def __post_init__(self) -> None:
        rng = self.rng = np.random.default_rng(self.seed)
        self.radius, self.speed = rng.uniform(6, 11), rng.uniform(10, 20)
        self.line_z = rng.uniform(70, 200)
        self.tilt = 0.0 if self.corridor else rng.uniform(-0.3, 0.3)
        self.half_width = rng.uniform(55, 85) if self.corridor else 200.0
        most = min(60.0, self.half_width - self.radius - 4.0)
        self.low, self.high = -rng.uniform(22, most), rng.uniform(22, most)
        self.phase = rng.uniform(0, 240)
        self.slope_off = rng.normal(0, 0.006)
        self.goal = rng.uniform(-25, 25), self.line_z + rng.uniform(60, 100)
        self.x, self.z, self.heading = 0.0, -12.0, 0.0
        self.v = 0.0
        self.map = ObstacleMap(BodyConfig(), NavConfig())
        self.map.evidence[:] = -4.0
        self.map.evidence[:, np.abs(self.map.centres_cm) > self.half_width] = 4.0
        self.movers = Movers()
        self._places: list[tuple[float, float, float]] = []
        self.mistakes = np.random.default_rng(self.seed + 7000)
        self._name, self._next_s = MOVER, self.mistakes.exponential(4.0)
        self._gap_until_s = self._false_until_s = -math.inf
        self._false_x = 0.0

    def mover_at(self, t_s: float) -> np.ndarray:
        """Where its middle is, x and z."""
        length = self.high - self.low
        gone = (self.speed * t_s + self.phase) % (2 * length)
        on = self.low + min(gone, 2 * length - gone)
        return np.array([on * math.cos(self.tilt), self.line_z + on * math.sin(self.tilt)])

    def gap_cm(self, t_s: float) -> float:
        """Between robot and mover."""
        x, z = self.mover_at(t_s)
        return math.hypot(x - self.x, z - self.z) - self.radius - RADIUS_CM

    def drive(self, max_s: float = 110.0) -> Outcome:
        """To the goal, with the steering of real drives."""
        plan, t_s = Plan(), 0.0
        late = [(0.0, 0.0)] * LATE_FRAMES
        touching, driving, standing, least, known_s = False, 0, 0, math.inf, math.inf
        known_since = None
        while t_s < max_s:
            self._see(t_s)
            self.map.movers = self.movers.sure
            if known_since is None and self.map.movers:
                known_since = t_s
            eye = self._eye()
            camera = Pose.planar(eye[0], eye[1], self.heading, t_s=t_s)
            command, plan = decide(plan, self.map, camera, self.goal)
            if command.outcome is not None:
                arrived = command.outcome == "goal"
                return Outcome(arrived, t_s, driving, standing, least, known_s)
            late.append((command.v_mm_s / 10, command.omega_rad_s))
            v, omega = late[-LATE_FRAMES]
            for _ in range(STEPS):
                dt = FRAME_S / STEPS
                self.v += max(-80 * dt, min(60 * dt, v - self.v))
                self.heading += omega * dt
                self.x += self.v * dt * math.sin(self.heading)
                self.z += self.v * dt * math.cos(self.heading)
                t_s += dt
                gap = self.gap_cm(t_s)
                least = min(least, gap)
                if gap < 0.0 and not touching:
                    touching = True
                    driving += abs(self.v) > 1.0
                    standing += abs(self.v) <= 1.0
                    known_s = min(known_s, 0.0 if known_since is None else t_s - known_since)
                touching &= gap < TOUCH_ENDS_CM
        return Outcome(False, t_s, driving, standing, least, known_s)

    def _eye(self) -> np.ndarray:
        return np.array([self.x, self.z]) + RADIUS_CM * np.array(
            [math.sin(self.heading), math.cos(self.heading)]
        )

    def _see(self, t_s: float) -> None:
        self.movers.forget(t_s)
        if self.rough:
            self._mistake(t_s)
        if t_s >= self._gap_until_s:
            self._see_mover(t_s)
        self.movers.look_for(t_s, lambda places, half_cm: self._seen_free(t_s, places, half_cm))

    def _mistake(self, t_s: float) -> None:
        """Now and then the net loses it, calls it something else, and its old name something that stands."""
        rng = self.mistakes
        if t_s > self._next_s:
            self._next_s = t_s + rng.exponential(4.0)
            self._gap_until_s = t_s + 0.4
            self._false_until_s = t_s + (0.6 if rng.random() < 0.5 else 0.0)
            self._false_x, self._name, self._places = rng.uniform(-25, 25), self._name + 1, []
        eye, ahead = self._eye(), np.array([math.sin(self.heading), math.cos(self.heading)])
        rel = np.array([self._false_x, self.line_z]) - eye
        away, forward = float(np.hypot(*rel)), float(rel @ ahead)
        if t_s < self._false_until_s and 0.87 * away < forward and 40.0 < forward < FARTHEST_CM:
            ray = float(rel[0]) / away, float(rel[1]) / away
            place = Sight(t_s, self._false_x, self.line_z + float(rng.normal(0, 3)), ray, away)
            self.movers.glimpse(self._name - 1, place)

    def _seen_free(self, t_s: float, places: np.ndarray, half_cm: float) -> np.ndarray:
        """Where nothing would stand in the view of what is there, and it is not there."""
        ahead = np.array([math.sin(self.heading), math.cos(self.heading)])
        rel = places - self._eye()
        forward, aside = rel @ ahead, np.abs(rel @ (ahead[1], -ahead[0]))
        seen = (forward - half_cm > NEAREST_CM) & (forward < FARTHEST_CM)
        seen &= (aside + half_cm) < VIEW * forward
        return seen & (np.hypot(*(places - self.mover_at(t_s)).T) > half_cm + self.radius)

    def _see_mover(self, t_s: float) -> None:
        eye, ahead = self._eye(), np.array([math.sin(self.heading), math.cos(self.heading)])
        across = np.array([ahead[1], -ahead[0]])
        rel = self.mover_at(t_s) - eye
        forward, aside = float(rel @ ahead), float(rel @ across)
        depth = forward - self.radius
        self._places = [place for place in self._places if t_s - place[0] < 0.7]
        if not NEAREST_CM < depth < FARTHEST_CM:
            return
        left, right = (aside - self.radius) / forward, (aside + self.radius) / forward
        if right < -VIEW or left > VIEW or (left < -VIEW and right > VIEW):
            return
        whole = left > -VIEW and right < VIEW
        slope = HEIGHT_CM / depth + self.slope_off + self.rng.normal(0, 0.001)
        seen_cm = HEIGHT_CM / (round(slope / PIXEL) * PIXEL)
        middle = seen_cm + self.radius
        side = aside / forward * middle + self.rng.normal(0, 0.4)
        x, z = eye + middle * ahead + side * across
        away = float(np.hypot(*rel))
        sight = Sight(t_s, float(x), float(z), (float(rel[0] / away), float(rel[1] / away)), seen_cm)
        self._places.append((t_s, float(x), float(z)))
        velocity = self._velocity(seen_cm, across, whole)
        if velocity is None:
            self.movers.glimpse(self._name, sight)
        else:
            self.movers.note(self._name, sight, velocity, self.radius)

    def _velocity(self, seen_cm: float, across: np.ndarray, whole: bool) -> tuple[float, float] | None:
        """What edges that are seen tell; one alone only what goes far."""
        places = np.array(self._places)
        if len(places) < 6 or places[-1, 0] - places[0, 0] < 0.33:
            return None
        if not whole and np.hypot(*(places[-1, 1:] - places[0, 1:])) < max(7.0, 0.08 * seen_cm):
            return None
        t = places[:, 0] - places[:, 0].mean()
        vx, vz = t @ (places[:, 1:] - places[:, 1:].mean(axis=0)) / (t @ t)
        if abs(vx * across[0] + vz * across[1]) < max(6.0, 0.06 * seen_cm):
            return None
        return float(vx), float(vz)
