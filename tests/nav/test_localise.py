"""The pose is better than the wheels' own, says how good it is, and is not led astray by what moves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

from host.camera.lens import Lens
from host.depth.config import DepthConfig
from host.depth.report import Correction, DepthReport, RegionDepth, SolvedMotion, VertexDepths
from host.link.robot import Robot
from host.nav.config import BodyConfig, NavConfig
from host.nav.drive import drive
from host.nav.localise import Localiser
from host.nav.odometry import advance, heading_of
from host.nav.pilot import Pilot
from host.nav.task import Route
from host.pose import Pose, wrap
from host.rbdn import NetConfig
from host.rbdn.snapshot import OUTSIDE, Contour, Region, Snapshot, Vertices
from host.sim.body import BodyModel
from host.sim.session import Simulation

BODY = BodyConfig()
LENS = Lens(320, 240, 280.0, 280.0, 159.5, 119.5)
FRAME_S = 1 / 15
SPEED_CM_S, TURN_RAD_S = 20.0, 0.6


WALLS = 1000  # from which number on regions are floor and walls


def behind(number: int) -> Region:
    """One of floor or wall: it tells nothing but that the picture has more regions."""
    loop = np.array([(319.0, 0.0), (0.0, 0.0), (0.0, 239.0), (319.0, 239.0)])
    ids, beyond = (np.arange(4),), (np.full(4, OUTSIDE),)
    return Region(number, None, 0, 9000.0, 1.0, True, (128.0, 128.0, 128.0), (loop,), ids, beyond)


@dataclass
class Pillar:
    """A round thing on the floor, as the net would hand it out."""

    x: float
    z: float
    radius: float
    height: float
    rgb: tuple[float, float, float]
    shade_cm: float = 0.0  # on the floor before it, of its colour

    def region(self, number: int, pose: Pose, rng: np.random.Generator) -> Region | None:
        """Its region as the camera at a pose sees it, with half a pixel of noise; None where it does not."""
        at = pose.rotation.T @ (np.array([self.x, 0.0, self.z]) - pose.position_cm)
        away = math.hypot(at[0], at[2])
        if at[2] < 25 or away < 3 * self.radius:
            return None
        middle, half = math.atan2(at[0], at[2]), math.asin(self.radius / away)
        foot = BODY.camera_height_cm / (at[2] - self.radius - self.shade_cm)
        left, right = (LENS.cx + LENS.fx * math.tan(middle + s * half) for s in (-1, 1))
        low = LENS.cy + LENS.fy * foot
        top = LENS.cy + LENS.fy * (BODY.camera_height_cm - self.height) / at[2]
        left, right, low, top = np.array([left, right, low, top]) + rng.normal(0, 0.5, 4)
        if left < 3 or right > 316 or low > 236 or top < 3:
            return None
        loop = np.array([(right, top), (left, top), (left, low), (right, low)])
        area = (right - left) * (low - top)
        beyond = np.full(4, OUTSIDE)
        return Region(number, None, 0, area, 1.0, False, self.rgb, (loop,), (np.arange(4),), (beyond,))


def pillars(seed: int, count: int = 9, reach_cm: float = 150.0) -> list[Pillar]:
    rng = np.random.default_rng(seed)
    out = []
    for _ in range(count):
        x, z = rng.uniform(-reach_cm, reach_cm, 2)
        radius, height = rng.uniform(5, 12), rng.uniform(12, 40)
        r, g, b = rng.uniform(20, 220, 3)
        out.append(Pillar(x, z, radius, height, (r, g, b)))
    return out


class Robotic:
    """A robot with false wheels among pillars, and a localiser that hears and sees what it does."""

    def __init__(self, things: list[Pillar], wheels: float, track: float, seed: int = 0):
        self.things, self.wheels, self.track = things, wheels, track
        self.rng = np.random.default_rng(seed)
        self.true = self.thought = (0.0, -BODY.camera_ahead_cm, 0.0)
        self.localiser = Localiser(BODY, LENS)
        self.names: dict[int, int] = {}  # the net's, of what is in view
        self.named = 0
        self.moving: set[int] = set()  # pillars that are said to move
        self.turn_seen_rad: float | None = None  # how far off turns are that the net saw; None: it sees none
        self.turn_sigma_rad = 5e-4  # and how far off the net believes them to be
        self.looks_like_rad_s = 0.0  # how fast something that fills the picture goes to the side
        self.distracted = False  # by that
        self.behind = 6  # regions of floor and walls
        self.earlier: list[tuple[float, float, float]] = []  # time, true heading, heading told
        self.t_s = 0.0
        self.errors: list[float] = []
        self.by_wheels: list[float] = []
        self.chi2: list[float] = []
        self.look()

    def drive(self, way_cm: float, turn_rad: float) -> None:
        """Roll an arc, frame by frame."""
        frames = max(1, round(max(abs(way_cm) / SPEED_CM_S, abs(turn_rad) / TURN_RAD_S) / FRAME_S))
        way, turn = way_cm / frames, turn_rad / frames
        for _ in range(frames):
            wide = (1 + self.track) * BODY.track_cm
            left, right = way + turn * wide / 2, way - turn * wide / 2
            self.true = advance(*self.true, left, right, wide)
            self.thought = advance(
                *self.thought, left / (1 + self.wheels / 2), right / (1 - self.wheels / 2), BODY.track_cm
            )
            self.t_s += FRAME_S
            self.look()

    def slip(self, turn_rad: float) -> None:
        """A wheel slips: the robot turns and its wheels say that it did not."""
        x, z, heading = self.true
        self.true = x, z, heading + turn_rad

    def go_to(self, x: float, z: float) -> None:
        """Turn towards a place, in truth, and go there."""
        dx, dz = x - self.true[0], z - self.true[1]
        self.drive(0.0, wrap(math.atan2(dx, dz) - self.true[2]))
        self.drive(math.hypot(dx, dz), 0.0)

    def camera(self, axle: tuple[float, float, float]) -> Pose:
        x, z, heading = axle
        ahead = BODY.camera_ahead_cm
        place = x + ahead * math.sin(heading), z + ahead * math.cos(heading)
        return Pose.planar(*place, heading, t_s=self.t_s)

    def motion(self, smooth: Pose) -> SolvedMotion | None:
        """What the net saw of the turns since the last frames, on top of the poses that it was given."""
        if self.turn_seen_rad is None:
            return None
        told, since = heading_of(smooth), []
        for before_s, true, told_before in self.earlier:
            yaw = (self.true[2] - true) - (told - told_before) + self.rng.normal(0.0, self.turn_seen_rad)
            yaw += self.looks_like_rad_s * (self.t_s - before_s)
            since.append(Correction(before_s, yaw, self.turn_sigma_rad, 0.0, 1.0))
        self.earlier = [*self.earlier[-2:], (self.t_s, self.true[2], told)]
        return SolvedMotion(smooth, 0.0, 0.0, 0.0, tuple(since))

    def look(self) -> None:
        regions, still = [], {}
        for k, thing in enumerate(self.things):
            region = thing.region(self.names.get(k, self.named), self.camera(self.true), self.rng)
            if region is None:
                self.names.pop(k, None)
                continue
            if k not in self.names:
                self.names[k] = self.named
                self.named += 1
            regions.append(region)
            moves = k in self.moving
            still[region.id] = RegionDepth(None, None, None, "no motion yet", moving=moves)
        nothing = VertexDepths(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0))
        none, empty, ids = np.zeros((0, 2)), np.zeros(0), np.zeros(0, np.int64)
        contour = Contour(none, none, ids, ids, empty, empty)
        regions += [behind(WALLS + k) for k in range(self.behind)]
        snapshot = Snapshot(0, tuple(regions), Vertices(ids, none, empty), contour, (), 1, 0.0, 0.0)
        smooth = self.localiser.move(self.camera(self.thought))
        report = DepthReport(still, nothing, self.motion(smooth))
        pose = self.localiser.update(snapshot, report, self.distracted)
        truth, wheels = self.camera(self.true), self.camera(self.thought)
        off = pose.position_cm - truth.position_cm
        self.errors.append(float(np.linalg.norm(off)))
        self.by_wheels.append(float(np.linalg.norm(wheels.position_cm - truth.position_cm)))
        sigma_cm, sigma_rad = self.localiser.sigma
        turned = wrap(heading_of(pose) - heading_of(truth))
        self.chi2.append((self.errors[-1] / max(sigma_cm, 0.1)) ** 2 + (turned / max(sigma_rad, 1e-3)) ** 2)


def square(robot: Robotic, rounds: int, side_cm: float = 110.0) -> None:
    for _ in range(rounds):
        for x, z in ((0.0, side_cm), (side_cm, side_cm), (side_cm, 0.0), (0.0, 0.0)):
            robot.go_to(x, z)


@pytest.mark.parametrize(("wheels", "track"), [(0.03, 0.0), (-0.03, 0.0), (0.0, 0.04), (0.03, -0.04)])
@pytest.mark.parametrize("seed", [1, 3])
def test_after_20_m_it_is_five_times_nearer_the_truth_than_the_wheels(seed: int, wheels: float, track: float):
    robot = Robotic(pillars(seed), wheels, track)
    square(robot, 5)
    print(
        f"\nseed {seed}, wheels {wheels:+.0%}, track {track:+.0%}: off {robot.errors[-1]:.1f} cm,"
        f" {np.mean(robot.errors):.1f} in the mean; wheels alone {np.mean(robot.by_wheels):.0f} in the mean"
    )
    assert np.mean(robot.errors) < np.mean(robot.by_wheels) / 5
    ratio, _ = robot.localiser.wheel_ratio
    assert ratio == pytest.approx(wheels, abs=0.003)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_where_the_wheels_are_right_nothing_is_made_worse_than_a_few_centimetres(seed: int):
    robot = Robotic(pillars(seed), 0.0, 0.0)
    square(robot, 5)
    print(f"\nseed {seed}: off {np.mean(robot.errors):.1f} cm in the mean, {max(robot.errors):.1f} at most")
    assert np.mean(robot.errors) < 4.0


def test_its_standard_errors_are_honest():
    chi2 = []
    for seed in range(1, 9):
        robot = Robotic(pillars(seed), 0.02, 0.02, seed)
        square(robot, 2)
        chi2 += robot.chi2[100::10]
    within = float(np.mean(np.array(chi2) < 11.3))  # 99 % of what three numbers with honest sigmas give
    print(f"\n{within:.1%} within the 99 % that its standard errors promise")
    assert within > 0.9
    assert float(np.median(chi2)) > 0.05  # and they are no excuse


def test_one_metre_tells_the_wheel_ratio():
    ahead = [Pillar(x, 180.0, 8.0, 25.0, (120.0 + x, 60.0, 90.0 - x)) for x in (-50.0, 0.0, 60.0)]
    robot = Robotic(ahead, 0.03, 0.0)
    robot.go_to(0.0, 100.0)
    ratio, sigma = robot.localiser.wheel_ratio
    assert ratio == pytest.approx(0.03, abs=0.006)
    assert sigma < 0.006


def test_with_nothing_to_see_it_is_the_wheels_and_ever_less_sure():
    robot = Robotic([], 0.0, 0.0)
    square(robot, 1)
    first = robot.localiser.sigma[0]
    assert max(robot.errors) < 0.1
    square(robot, 1)
    assert robot.localiser.sigma[0] > first > 1.0


def test_the_smooth_pose_never_jumps():
    robot = Robotic(pillars(2), 0.03, 0.0)
    steps = []
    move = robot.localiser.move

    def listen(odometry: Pose) -> Pose:
        pose = move(odometry)
        steps.append(pose)
        return pose

    robot.localiser.move = listen
    square(robot, 2)
    ways = [math.dist(a.position_cm, b.position_cm) for a, b in pairwise(steps)]
    assert max(ways) < 1.2 * SPEED_CM_S * FRAME_S


def test_what_is_seen_again_after_a_round_is_the_same_landmark():
    robot = Robotic(pillars(5, count=5), 0.0, 0.0)
    square(robot, 3)
    marks = robot.localiser.landmarks
    assert sum(mark.returns for mark in marks) >= 5
    places = np.array([robot.localiser.landmark_cm(k) for k in range(len(marks))])
    true = np.array([(thing.x, thing.z) for thing in robot.things])
    nearest = np.linalg.norm(places[:, None] - true[None], axis=2).min(axis=1)
    print(f"\n{len(marks)} landmarks of {len(true)} things, off by {np.round(nearest, 1)} cm")
    assert np.all(nearest < 12.0)
    assert len(marks) <= len(true)  # none twice


def walk(robot: Robotic, mover: int, told: bool) -> None:
    """A thing walks along in view while the robot drives."""
    if told:
        robot.moving = {mover}
    for _ in range(40):
        robot.drive(1.3, 0.0)
        robot.things[mover].x += 1.0


def test_what_stands_three_times_as_far_is_not_taken_for_what_looked_so():
    """Its direction fits, for the robot may be off, and its colour does; its distance never can."""
    near, far = (Pillar(0.0, z, 8.0, 25.0, (180.0, 60.0, 90.0)) for z in (70.0, 260.0))
    robot = Robotic([near], 0.0, 0.0)
    robot.drive(12.0, 0.0)
    assert len(robot.localiser.landmarks) == 1
    robot.things = []
    robot.drive(4.0, 0.0)
    robot.things = [far]
    robot.names.clear()
    robot.drive(30.0, 0.0)
    assert robot.localiser.landmarks[0].returns == 0
    assert robot.localiser.landmark_cm(0) == pytest.approx((0.0, 70.0), abs=8.0)


def test_a_thing_said_to_move_never_becomes_a_landmark():
    robot = Robotic([Pillar(-20.0, 120.0, 8.0, 25.0, (200.0, 40.0, 40.0))], 0.0, 0.0)
    walk(robot, 0, told=True)
    assert robot.localiser.landmarks == []
    assert max(robot.errors) < 0.1


def test_a_landmark_that_begins_to_move_is_dropped():
    things = [Pillar(-30.0, 150.0, 8.0, 25.0, (200.0, 40.0, 40.0)), *pillars(3, 4)]
    robot = Robotic(things, 0.0, 0.0)
    robot.drive(25.0, 0.0)
    held = {mark.look.colours[0] for mark in robot.localiser.landmarks}
    assert any(abs(c[0] - 200.0) < 1 for c in held)
    robot.moving = {0}
    robot.drive(5.0, 0.0)
    assert not any(abs(mark.look.colours[0][0] - 200.0) < 1 for mark in robot.localiser.landmarks)


def test_a_mover_that_nobody_told_of_does_not_carry_the_pose_away_among_things_that_stand():
    things = [
        Pillar(-10.0, 160.0, 8.0, 25.0, (200.0, 40.0, 40.0)),
        Pillar(40.0, 190.0, 9.0, 30.0, (40.0, 140.0, 60.0)),
        Pillar(-45.0, 200.0, 7.0, 20.0, (30.0, 80.0, 160.0)),
        Pillar(10.0, 230.0, 10.0, 35.0, (120.0, 60.0, 140.0)),
    ]
    robot = Robotic(things, 0.0, 0.0)
    robot.drive(20.0, 0.0)
    walk(robot, 0, told=False)
    print(f"\noff {max(robot.errors):.1f} cm at most while a thing walked 40 cm")
    assert max(robot.errors) < 5.0


def test_what_stands_beside_the_camera_is_not_taken_for_what_is_seen_ahead():
    """There, where heading is in doubt, any direction would do."""
    rgb = (200.0, 40.0, 40.0)
    robot = Robotic([Pillar(0.0, 150.0, 8.0, 25.0, rgb), Pillar(150.0, -12.0, 8.0, 25.0, rgb)], 0.0, 0.0)
    robot.drive(12.0, 0.0)
    robot.localiser._cov[2, 2] += 0.1**2
    robot.drive(0.0, math.radians(83.0))
    off = wrap(heading_of(robot.localiser.pose()) - robot.true[2])
    assert sum(mark.returns for mark in robot.localiser.landmarks) == 0
    assert abs(off) < 0.02


def seen_again(things: list[Pillar], then: list[Pillar], slipped_rad: float = 0.0) -> Robotic:
    """What looks like one thing, or several, after it was out of view and the heading came in doubt."""
    robot = Robotic(things, 0.0, 0.0)
    robot.drive(12.0, 0.0)
    assert len(robot.localiser.landmarks) == len(things)
    robot.things = []
    robot.drive(4.0, 0.0)
    robot.slip(slipped_rad)
    robot.localiser._cov[2, 2] += 0.1**2
    robot.things = then
    robot.names.clear()
    robot.drive(30.0, 0.0)
    assert sum(mark.returns for mark in robot.localiser.landmarks) == len(then)
    return robot


@pytest.mark.parametrize("aside_cm", [10.0, -15.0])
def test_one_thing_taken_for_another_does_not_turn_the_robot(aside_cm: float):
    one, other = (Pillar(x, 150.0, 8.0, 25.0, (200.0, 40.0, 40.0)) for x in (0.0, aside_cm))
    robot = seen_again([one], [other])
    off = wrap(heading_of(robot.localiser.pose()) - robot.true[2])
    print(f"\n{aside_cm} cm aside: {math.degrees(off):.2f} deg off")
    assert abs(off) < 0.025


@pytest.mark.parametrize("slipped_rad", [0.08, -0.12])
def test_two_things_that_say_the_same_do(slipped_rad: float):
    things = [
        Pillar(x, z, 8.0, 25.0, rgb)
        for x, z, rgb in ((-20.0, 150.0, (200.0, 40.0, 40.0)), (25.0, 170.0, (40.0, 60.0, 200.0)))
    ]
    robot = seen_again(things, things, slipped_rad)
    off = wrap(heading_of(robot.localiser.pose()) - robot.true[2])
    print(f"\nslipped by {slipped_rad}: {math.degrees(off):.2f} deg off")
    assert abs(off) < 0.025


def test_put_elsewhere_it_finds_its_place_again_among_known_things():
    robot = Robotic(pillars(6, 8), 0.0, 0.0)
    square(robot, 1)
    robot.true = (60.0, 40.0, -2.0)  # carried there
    robot.names.clear()
    robot.localiser.lose_place()
    assert robot.localiser.astray
    assert robot.localiser.landmarks == []
    robot.drive(0.0, 2 * math.pi)
    robot.drive(20.0, 1.0)
    print(f"\noff {robot.errors[-1]:.1f} cm after it found its place")
    assert not robot.localiser.astray
    assert robot.errors[-1] < 12.0


def test_who_was_put_elsewhere_goes_where_all_fits_not_where_a_slip_explains_one_thing(monkeypatch):
    compare = Localiser._compare_places

    def one_alone_is_near(localiser, rows, before, near):
        pairs, now, then, fits, worth = compare(localiser, rows, before, near)
        if near.all():
            return pairs, now, then, fits, worth
        return pairs[:1], now[:1], then[:1], fits[:1], 2.0

    monkeypatch.setattr(Localiser, "_compare_places", one_alone_is_near)
    monkeypatch.setattr(Localiser, "_as_slipped", lambda localiser, pairs: True)
    robot = Robotic(pillars(6, 8), 0.0, 0.0)
    square(robot, 1)
    robot.true = (60.0, 40.0, -2.0)
    robot.names.clear()
    robot.localiser.lose_place()
    robot.drive(0.0, 2 * math.pi)
    robot.drive(20.0, 1.0)
    assert not robot.localiser.astray
    assert robot.errors[-1] < 12.0


def test_a_false_alarm_does_not_move_the_robot_on_the_map():
    """Wheels that were doubted for nothing: it is where it was, and knows things again as it sees them."""
    robot = Robotic(pillars(6, 8), 0.03, 0.0)
    square(robot, 1)
    begun = len(robot.errors)
    for _ in range(4):
        robot.names.clear()
        robot.localiser.lose_place()
        assert robot.localiser.astray
        robot.drive(30.0, 0.3)
    known = len(robot.localiser.landmarks)
    square(robot, 1)
    print(f"\noff {max(robot.errors[begun:]):.1f} cm at most; {known} landmarks known, then more")
    assert not robot.localiser.astray
    assert max(robot.errors[begun:]) < 6.0


def test_a_heading_in_doubt_stays_so_among_things_that_are_new():
    """Nothing tells it: whoever comes to believe otherwise turns away by the errors of what is seen."""
    for seed in range(5):
        robot = Robotic([], 0.0, 0.0, seed)
        robot.localiser.lose_place()
        doubt_rad = robot.localiser.sigma[1]
        rng = np.random.default_rng(seed)
        robot.things = [
            Pillar(x, 250.0, 8.0, 25.0, (120.0 + x, rng.uniform(20, 220), 90.0 - x), 30.0)
            for x in (10.0, 40.0, 70.0)
        ]
        robot.drive(160.0, 0.0)
        off = wrap(heading_of(robot.localiser.pose()) - robot.true[2])
        sigma_rad = robot.localiser.sigma[1]
        print(
            f"\nseed {seed}: off {robot.errors[-1]:.1f} cm, {math.degrees(off):.2f} deg;"
            f" doubt {math.degrees(doubt_rad):.2f}, then {math.degrees(sigma_rad):.2f} deg"
        )
        assert len(robot.localiser.landmarks) == 3
        assert sigma_rad > 0.99 * doubt_rad
        assert abs(off) < 0.03


@pytest.mark.parametrize(("shade_cm", "then_cm"), [(25.0, 0.0), (0.0, 25.0)])
def test_badly_known_distances_neither_move_the_robot_on_the_map_nor_keep_it_lost(shade_cm, then_cm):
    """A false alarm, and all seems farther or nearer afterwards, as light on the floor may have it."""
    for seed in range(5):
        robot = Robotic([], 0.0, 0.0, seed)
        robot.things = [
            Pillar(x, 270.0, 8.0, 25.0, (120.0 + x, 60.0, 90.0 - x), shade_cm) for x in (-60.0, 10.0, 70.0)
        ]
        robot.drive(30.0, 0.0)
        for thing in robot.things:
            thing.shade_cm = then_cm
        robot.names.clear()
        robot.localiser.lose_place()
        assert robot.localiser.astray
        robot.drive(30.0, 0.0)
        print(f"\nseed {seed}: off {max(robot.errors):.1f} cm at most")
        assert not robot.localiser.astray
        assert max(robot.errors) < 6.0


def test_turns_that_the_net_saw_tell_the_wheels_apart_before_any_landmark_does():
    for seed in range(5):
        robot = Robotic([], 0.03, 0.0, seed)
        robot.turn_seen_rad = 0.001
        robot.drive(100.0, 0.0)
        ratio, sigma = robot.localiser.wheel_ratio
        print(f"\nratio {ratio:.4f} ± {sigma:.4f}; off {robot.errors[-1]:.1f} cm, {robot.by_wheels[-1]:.1f}")
        assert abs(ratio - 0.03) < min(3 * sigma, 0.006)
        assert robot.errors[-1] < robot.by_wheels[-1] / 4


@pytest.mark.parametrize(
    ("turned", "sigma", "looks"), [(0.04, 5e-4, 10), (-0.09, 2.5e-3, 10), (0.06, 5e-4, 2)]
)
def test_after_a_wheel_slipped_the_heading_is_the_one_that_the_net_saw(turned, sigma, looks):
    robot = Robotic([], 0.0, 0.0)
    robot.turn_seen_rad = 0.001
    robot.drive(60.0, 0.0)
    robot.slip(turned)
    robot.turn_sigma_rad = sigma
    robot.drive(looks * 2 * FRAME_S * SPEED_CM_S, 0.0)
    robot.turn_seen_rad = None  # nothing to see there
    robot.drive(10.0, 0.0)
    off = wrap(heading_of(robot.localiser.pose()) - robot.true[2])
    print(f"\nslipped by {math.degrees(turned):.1f} deg: {math.degrees(off):.2f} off")
    assert abs(off) < 0.02
    assert robot.localiser.wheel_ratio[0] == pytest.approx(0.0, abs=0.003)  # it is no wheel's size
    assert robot.localiser.sigma[1] > abs(off) / 2


@pytest.mark.parametrize("looks", [0, 2])
def test_what_moves_before_the_camera_is_no_turn_of_the_robot(looks: int):
    robot = Robotic([], 0.0, 0.0)
    robot.turn_seen_rad = 0.001
    robot.drive(60.0, 0.0)
    robot.looks_like_rad_s = -0.3
    robot.drive(looks * 2 * FRAME_S * SPEED_CM_S, 0.0)
    robot.distracted = True
    robot.drive(20.0, 0.0)
    assert abs(wrap(heading_of(robot.localiser.pose()) - robot.true[2])) < 0.02
    assert robot.localiser.wheel_ratio[0] == pytest.approx(0.0, abs=0.003)


@pytest.mark.parametrize(("off_rad_s", "behind"), [(0.03, 3), (0.1, 3), (-0.1, 3), (0.3, 2)])
def test_what_one_thing_alone_seems_to_tell_of_turns_moves_nothing(off_rad_s: float, behind: int):
    # with wall and floor behind it, it may as well be nearer than thought: that errs alike for seconds
    robot = Robotic([], 0.0, 0.0)
    robot.turn_seen_rad = 0.0005
    robot.drive(30.0, 0.0)
    robot.behind = behind
    robot.looks_like_rad_s = off_rad_s
    robot.drive(60.0, 0.0)
    robot.behind, robot.looks_like_rad_s = 6, 0.0
    robot.drive(30.0, 0.0)
    off = wrap(heading_of(robot.localiser.pose()) - robot.true[2])
    print(f"\nturns seen off by {off_rad_s} rad/s: {math.degrees(off):.2f} deg off")
    assert abs(off) < 0.01
    assert robot.localiser.wheel_ratio[0] == pytest.approx(0.0, abs=0.003)


@pytest.mark.parametrize("turned", [0.05, -0.2])
def test_one_thing_alone_still_shows_a_wheel_that_slips(turned: float):
    robot = Robotic([], 0.0, 0.0)
    robot.behind = 3
    robot.turn_seen_rad = 0.001
    robot.drive(60.0, 0.0)
    robot.slip(turned)
    robot.drive(20.0, 0.0)
    assert abs(wrap(heading_of(robot.localiser.pose()) - robot.true[2])) < 0.02


def test_a_slip_that_nobody_saw_is_made_up_for_by_what_was_known_before():
    for seed in range(3, 7):
        robot = Robotic(pillars(seed, 8), 0.0, 0.0)
        square(robot, 1)
        robot.slip(0.1)
        robot.names.clear()
        robot.localiser.lose_place()
        square(robot, 1)
        off = wrap(heading_of(robot.localiser.pose()) - robot.true[2])
        print(f"\nseed {seed}: off {robot.errors[-1]:.1f} cm, {math.degrees(off):.1f} deg")
        assert not robot.localiser.astray
        assert abs(off) < 0.04


def test_another_room_is_not_taken_for_the_one_that_was_lost():
    taken = 0
    for seed in range(15):
        robot = Robotic(pillars(100 + seed, 8), 0.0, 0.0)
        robot.drive(20.0, 2 * math.pi)
        robot.things = pillars(200 + seed, 8)
        robot.names.clear()
        robot.localiser.lose_place()
        if not robot.localiser.astray:
            continue  # it knew nothing
        robot.drive(20.0, 2 * math.pi)
        taken += not robot.localiser.astray
    print(f"\n{taken} of 15 other rooms taken for the one that was lost")
    assert taken == 0


@pytest.mark.parametrize("camera", ["&rough=1"], ids=["rough"])
def test_a_whole_drive_with_false_wheels_knows_its_place_five_times_better_than_they_do(camera: str):
    body = BodyModel(left_wheel=1.015, right_wheel=0.985)
    simulation = Simulation(f"sim:room?seed=3{camera}", body=body)
    robot = Robot(simulation.transport, simulation.clock)
    robot.connect()
    goal = simulation.world.goal_cm
    pilot = Pilot(
        simulation.world.lens, Route([goal, (0.0, 0.0)]),
        net=NetConfig(), depth=DepthConfig(), body=BODY, nav=NavConfig(),
    )  # fmt: skip
    errors = []

    def watch(view, _log) -> None:
        truth = simulation.true_pose(view.pose.t_s).position_cm
        errors.append([math.dist(pose.position_cm, truth) for pose in (view.pose, view.dead_reckoning)])

    drive(
        simulation.camera, robot, simulation.clock, pilot, NavConfig(),
        max_time_s=33.0, max_wall_s=900.0, on_view=watch,
    )  # fmt: skip
    ours, wheels = np.mean(errors, axis=0)
    print(f"\n{simulation.body.distance_cm:.0f} cm: off {ours:.1f} cm in the mean, wheels alone {wheels:.1f}")
    assert wheels > 10.0  # it went far enough to tell
    assert ours < wheels / 5
