"""The robot's body: motors that turn duties into wheel speeds, wheels that move it, walls that stop it."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from host.pose import Pose
from host.sim.board import Board, Side
from host.sim.world import World

STEP_US = 1000
STEP_S = STEP_US * 1e-6
TRACE_STEPS = 30_000  # poses of the last 30 s are kept: longer than a drive goes on blind
LOOK_CM = 0.5  # travel after which the clearance is measured anew
REST_STEPS = 10  # between two looks for movers while the robot stands
STANDS_CM_S = 1.0  # a robot that is slower drives into nobody who comes towards it
CONTACT_ENDS_CM = 0.5  # beyond this gap the next touch counts as another collision
LIFT_S = 0.4  # that a hand takes to lift the robot
LIFTED_CM = 22.0  # and how high
LIFTED_RAD = (0.5, 0.25, -0.2)  # by how much it turns it, nods it down and tips it to the left
SWAY_RAD, SWAY_S = 0.05, 1.7  # a hand is not still
FLOOR_CM = (140.0, 390.0)  # lengths over which a floor's grip varies
NEVER_US = -(10**9)  # long before a drive begins
GRIP_VARIES = 1 / 3  # by so much of the mean slip
REAL_SLIP_S, REAL_SLIP_SHARE = (0.05, 0.15), (0.2, 0.6)  # a crumb, a joint: how long, how much
PHASES = ((False, False), (True, False), (True, True), (False, True))  # pins A, B, rolling forward


@dataclass(frozen=True)
class BodyModel:
    """A small robot with two gear motors, as it truly is. The disc is centred on the axle's middle.

    `track_cm` and `cm_per_count` are what its maker believes; the ratios below them are hidden truth, such
    as tyres worn unequally, and a calibration has to find them.
    """

    track_cm: float = 15.0
    radius_cm: float = 12.0
    camera_ahead_cm: float = 12.0  # of the axle's middle
    cm_per_count: float = 0.5
    left_wheel: float = 1.0  # true size of the left wheel, relative to what cm_per_count says
    right_wheel: float = 1.0
    true_track: float = 1.0  # true distance between the wheels, relative to track_cm
    phase_error: float = 0.0  # counts by which an encoder's edges may lie off their even places, fixed ones
    full_speed_cm_s: float = 70.0  # at full duty and full battery
    dead_zone: float = 0.08  # duty below which a motor stands
    lag_s: float = 0.05  # time constant of a motor, driven or shorted
    coast_s: float = 0.4  # of one that is open, by friction
    mismatch: float = 0.03  # by how much the left motor is faster than the right at the same duty
    battery_mv: float = 7400.0  # without load
    sag_mv: float = 300.0  # less with both motors at full duty
    slowest_cm_s: float = 0.05  # an unpowered wheel slower than this is held by friction
    drain_mv_per_min: float = 0.0  # that the battery loses with both motors at full duty, in proportion else
    slip: float = 0.0  # share of a wheel's turning that moves nothing, on average; it varies by a third
    slip_per_cm_s2: float = 0.0  # and so much more of it while the wheel speeds up
    slips_per_m: float = 0.0  # rare short real slips of one wheel
    nod_rad: float = 0.0  # by which the camera looks down
    tip_rad: float = 0.0  # by which its right side is lower than its left
    aside_rad: float = 0.0  # by which it looks to the right of straight ahead
    raised_cm: float = 0.0  # by which it is higher than the world's makers meant


class Wheel:
    """One motor, its wheel, and the encoder on it."""

    def __init__(
        self,
        board: Board,
        side: Side,
        model: BodyModel,
        gain: float,
        size: float,
        phase: float,
        shifts: tuple[float, ...] = (0.0,) * len(PHASES),
    ) -> None:
        self.speed_cm_s = 0.0
        self._board, self._side = board, side
        self._model = model
        self._cm_per_count = size * model.cm_per_count
        self._gain = gain * size * model.full_speed_cm_s / (1.0 - model.dead_zone)
        self._counts = phase  # travel in counts; an edge comes at every whole number and its shift
        self._shifts = shifts  # of the edges, each under half a count, the same for every fourth
        self._cell = self._cell_at(phase)

    @property
    def duty(self) -> float:
        """What the board puts on the motor, -1 to 1."""
        return self._board.duty(self._side)

    def roll(self, duty: float, voltage: float, start_us: int) -> float:
        """Turn for one step; travel in cm. `voltage` is relative to a full battery's."""
        before = self.speed_cm_s
        open_motor = self._board.coasting(self._side)
        lag_s = self._model.coast_s if open_motor else self._model.lag_s
        aim = self._aim_cm_s(duty, voltage, before, open_motor)
        if aim == 0.0 and abs(before) < self._model.slowest_cm_s:
            self.speed_cm_s = 0.0
            return 0.0
        turning_s = STEP_S
        after = aim + (before - aim) * math.exp(-STEP_S / lag_s)
        if abs(duty) <= self._model.dead_zone and after * before < 0.0:  # friction only stops
            turning_s, after = lag_s * math.log(1.0 - before / aim), 0.0
        self.speed_cm_s = after
        travel = aim * turning_s + (before - aim) * lag_s * (1.0 - math.exp(-turning_s / lag_s))
        self._pass_edges(travel, before, aim, lag_s, start_us)
        return travel

    def _aim_cm_s(self, duty: float, voltage: float, speed: float, open_motor: bool) -> float:
        """The speed that a wheel tends to. The dead zone's friction also brakes one that rolls on."""
        friction = self._model.dead_zone
        push = abs(duty) - friction
        if push > 0.0:
            return math.copysign(push * self._gain * voltage, duty)
        if speed == 0.0 or open_motor:
            return 0.0
        return (duty - math.copysign(friction, speed)) * self._gain * voltage

    def _border(self, cell: int) -> float:
        """Where, in counts, a cell begins."""
        return cell + self._shifts[cell % len(PHASES)]

    def _cell_at(self, counts: float) -> int:
        cell = math.floor(counts)
        if counts < self._border(cell):
            return cell - 1
        return cell + (counts >= self._border(cell + 1))

    def _pass_edges(self, travel: float, before: float, aim: float, lag_s: float, start_us: int) -> None:
        start = self._counts
        self._counts = start + travel / self._cm_per_count
        cell = self._cell_at(self._counts)
        while self._cell != cell:
            forward = cell > self._cell
            border = self._border(self._cell + 1 if forward else self._cell)
            self._cell += 1 if forward else -1
            after_s = self._time_of((border - start) * self._cm_per_count, travel, before, aim, lag_s)
            a, b = PHASES[self._cell % 4]
            self._board.set_encoder_pins(self._side, a, b, start_us + round(after_s * 1e6))

    def _time_of(self, way: float, travel: float, before: float, aim: float, lag: float) -> float:
        """When within the step the wheel has gone `way` cm."""
        t = way / travel * STEP_S
        for _ in range(2):  # Newton: the speed hardly changes within a step
            fade = math.exp(-t / lag)
            speed = aim + (before - aim) * fade
            gone = aim * t + (before - aim) * lag * (1.0 - fade)
            t = min(max(t + (way - gone) / speed, 0.0), STEP_S) if speed else t
        return t


class Grip:
    """What of the wheels' turning moves the robot.

    A floor's part varies slowly along the way. More is lost while a wheel speeds up, and while it brakes the
    robot pushes on. Now and then one wheel truly slips for a moment.
    """

    def __init__(self, model: BodyModel, rng: np.random.Generator) -> None:
        self._model, self._rng = model, rng
        self._phases = rng.uniform(0.0, 2 * math.pi, (2, len(FLOOR_CM))).tolist()
        self._rolled_cm = [0.0, 0.0]
        self._left_until_slip_cm = self._draw_way()
        self._slips: list[tuple[float, int]] = [(0.0, 0), (0.0, 0)]  # share and end of each wheel's
        self._forced: list[tuple[float, int]] = [(0.0, 0), (0.0, 0)]
        self.slipped_us = NEVER_US  # when a wheel last truly slipped

    def force(self, left: float, right: float, until_us: int) -> None:
        """Let these shares be lost until then, whatever the floor."""
        self._forced = [(left, until_us), (right, until_us)]

    def moved(self, side: int, travel: float, gain_cm_s: float, now_us: int) -> float:
        """Way on the floor of a wheel that turned by `travel` in a step and got faster by `gain_cm_s`."""
        share, end_us = self._forced[side]
        if now_us < end_us:
            self.slipped_us = now_us
            return (1.0 - share) * travel
        model = self._model
        if model.slip == model.slip_per_cm_s2 == model.slips_per_m == 0.0:
            return travel
        rolled = self._rolled_cm[side] = self._rolled_cm[side] + abs(travel)
        wave = sum(
            math.sin(2 * math.pi * rolled / length + phase)
            for length, phase in zip(FLOOR_CM, self._phases[side], strict=True)
        )
        share = model.slip * (1.0 + GRIP_VARIES / len(FLOOR_CM) * wave)
        share += model.slip_per_cm_s2 * math.copysign(gain_cm_s / STEP_S, gain_cm_s * travel)
        self._slip_now_and_then(side, abs(travel), now_us)
        slip, end_us = self._slips[side]
        if now_us < end_us:
            self.slipped_us = now_us
            share = max(share, slip)
        return (1.0 - share) * travel

    def _slip_now_and_then(self, side: int, way_cm: float, now_us: int) -> None:
        self._left_until_slip_cm -= way_cm / 2  # of the two wheels' mean
        if self._left_until_slip_cm <= 0.0:
            lasts_s, share = self._rng.uniform(*REAL_SLIP_S), self._rng.uniform(*REAL_SLIP_SHARE)
            self._slips[side] = (share, now_us + round(1e6 * lasts_s))
            self._left_until_slip_cm = self._draw_way()

    def _draw_way(self) -> float:
        per_cm = self._model.slips_per_m / 100
        return float(self._rng.exponential(1 / per_cm)) if per_cm else math.inf


class Body:
    """Where the robot truly is.

    `step` moves it on by 1 ms at the duties the board puts out at the start of it and tells the board the
    encoder edges that come in between; the board must then be stepped by as much.

    Attributes
    ----------
    collisions : int
        Touches so far that the robot drove into; one that lasts counts once.
    run_into : int
        Touches so far by a mover that came to the robot while it stood or only turned.
    min_clearance_cm : float
        Least distance so far from the rim to anything, also while it stood.
    distance_cm : float
        Way of the axle's middle so far.
    """

    def __init__(self, world: World, board: Board, model: BodyModel, seed: int) -> None:
        rng = np.random.default_rng((0xB0D7, seed))
        self._world, self._board, self._model = world, board, model
        half = model.mismatch / 2
        phases = rng.random(2)
        shifts = model.phase_error * rng.uniform(-1.0, 1.0, (2, len(PHASES)))
        self._left = Wheel(
            board, Side.LEFT, model, 1.0 + half, model.left_wheel, float(phases[0]), tuple(shifts[0])
        )
        self._right = Wheel(
            board, Side.RIGHT, model, 1.0 - half, model.right_wheel, float(phases[1]), tuple(shifts[1])
        )
        self._track_cm = model.true_track * model.track_cm
        self._grip = Grip(model, rng)
        self._lifted_us: int | None = None  # since when it is in somebody's hand
        self._time_us = board.time_us  # up to which the motion is known
        self._x, self._z, self._heading = 0.0, -model.camera_ahead_cm, 0.0  # the camera starts at (0, 0)
        self._trace: deque[tuple[float, float, float, float]] = deque(maxlen=TRACE_STEPS)
        self._trace.append((self._x, self._z, self._heading, 0.0))  # the last is how far it is lifted, 0 to 1
        self._battery_mv = self._drained_mv = 0.0
        self._set_battery(model.battery_mv)
        self.collisions = self.run_into = 0
        self.distance_cm = 0.0
        self.min_clearance_cm = self._clearance_cm = self._gap_cm(self._x, self._z)
        fastest_cm_s = max((mover.speed_cm_s for mover in world.movers), default=0.0)
        self._approach_cm = STEP_S * fastest_cm_s  # of a mover in a step
        self._unseen_cm = 0.0  # that robot and movers can have come nearer since the clearance was measured
        self._touching = self._pressed = False  # by its own doing; by a mover's

    @property
    def time_us(self) -> int:
        """Up to when the motion is known."""
        return self._time_us

    @property
    def radius_cm(self) -> float:
        """Of the disc that holds the whole robot."""
        return self._model.radius_cm

    @property
    def speed_cm_s(self) -> float:
        """Forward speed."""
        return (self._left.speed_cm_s + self._right.speed_cm_s) / 2

    @property
    def wheel_speeds_cm_s(self) -> tuple[float, float]:
        """Of the rims, left and right."""
        return self._left.speed_cm_s, self._right.speed_cm_s

    @property
    def axle(self) -> tuple[float, float, float]:
        """Where the axle's middle is, x and z in cm, and the heading, in rad to the right, not wrapped."""
        return self._x, self._z, self._heading

    def step(self) -> None:
        """Move on by 1 ms."""
        left_duty, right_duty = self._left.duty, self._right.duty
        load = (abs(left_duty) + abs(right_duty)) / 2
        model, now_us = self._model, self._time_us
        self._drained_mv += model.drain_mv_per_min * load * STEP_S / 60
        self._set_battery(model.battery_mv - self._drained_mv - model.sag_mv * load)
        voltage = self._battery_mv / model.battery_mv
        before = self.wheel_speeds_cm_s
        left = self._left.roll(left_duty, voltage, now_us)
        right = self._right.roll(right_duty, voltage, now_us)
        if self._lifted_us is None:
            if left or right:
                left = self._grip.moved(0, left, self._left.speed_cm_s - before[0], now_us)
                right = self._grip.moved(1, right, self._right.speed_cm_s - before[1], now_us)
                self._move((left + right) / 2, (left - right) / self._track_cm)
            elif self._world.movers and now_us % (REST_STEPS * STEP_US) == 0:
                self._feel(self._gap_cm(self._x, self._z))
        self._time_us += STEP_US
        self._trace.append((self._x, self._z, self._heading, self._height()))

    @property
    def slipped_us(self) -> int:
        """When one of the wheels last truly slipped."""
        return self._grip.slipped_us

    # --- What may happen to a robot ---------------------------------------------------------------

    def slip(self, left: float, right: float, for_s: float) -> None:
        """For a while let these shares of the wheels' turning move nothing; the encoders count on.

        1 is a wheel that spins on the spot; below 0 the robot is pushed along.
        """
        self._grip.force(left, right, self._time_us + round(1e6 * for_s))

    def lift(self) -> None:
        """Take the robot up: in 0.4 s it is 22 cm higher, turned and tipped. Its wheels turn freely."""
        if self._lifted_us is None:
            self._lifted_us = self._time_us

    def put_down(self, x_cm: float, z_cm: float, heading_rad: float) -> None:
        """Set it, lifted or not, on the floor: the axle's middle there, heading as given.

        Raises
        ------
        ValueError
            Something stands there.
        """
        gap_cm = self._gap_cm(x_cm, z_cm)
        if gap_cm < 0.0:
            raise ValueError(f"the robot does not fit at ({x_cm:g}, {z_cm:g}): {-gap_cm:.1f} cm too close")
        self._x, self._z, self._heading = x_cm, z_cm, heading_rad
        self._lifted_us = None
        self._touching = self._pressed = False
        self._feel(gap_cm)

    def _height(self) -> float:
        if self._lifted_us is None:
            return 0.0
        part = min((self._time_us - self._lifted_us) * 1e-6 / LIFT_S, 1.0)
        return part * part * (3.0 - 2.0 * part)

    def pose_at(self, t_us: int) -> Pose:
        """True camera pose at a time of the last 30 s.

        Raises
        ------
        ValueError
            The time is further back, or yet to come.
        """
        steps_ago = (self._time_us - t_us) / STEP_US
        if not 0 <= steps_ago <= len(self._trace) - 1:
            raise ValueError(f"no pose is known at {t_us} us; it is {self._time_us} us")
        later = math.floor(steps_ago)
        b = self._trace[-1 - later]
        a = self._trace[-2 - later] if steps_ago > later else b
        part = steps_ago - later
        if a[3] > 0.0 and b[3] == 0.0:  # put down elsewhere: nowhere in between
            a = b
        x, z, heading, height = (q + (p - q) * part for p, q in zip(a, b, strict=True))
        ahead = self._model.camera_ahead_cm
        pose = Pose.planar(
            x + ahead * math.sin(heading), z + ahead * math.cos(heading), heading, t_s=t_us * 1e-6
        )
        pose = _mounted(pose, self._model)
        return pose if height == 0.0 else _in_hand(pose, height)

    # --- Motion ---------------------------------------------------------------------------------

    def _move(self, forward: float, turn: float) -> None:
        middle = self._heading + turn / 2
        x, z = self._x + forward * math.sin(middle), self._z + forward * math.cos(middle)
        self._heading += turn
        if self._blocked(x, z, abs(forward)):
            return
        self._x, self._z = x, z
        self.distance_cm += abs(forward)

    def _blocked(self, x: float, z: float, step: float) -> bool:
        """Would the robot, there, stand deeper in something than it does now?

        The wheels then slip on the spot, and the encoders go on counting.
        """
        self._unseen_cm += step + self._approach_cm
        # The gap shrinks by no more than both ways, so that far from everything nobody needs to look.
        if self._unseen_cm < min(LOOK_CM, self._clearance_cm):
            return False
        gap = self._gap_cm(x, z)
        if gap < 0.0 and gap < (here := self._gap_cm(self._x, self._z)):
            if here < 0.0 and step < STANDS_CM_S * STEP_S:
                self._feel(here)
                return True
            self.collisions += not self._touching
            self._touching = True
            self.min_clearance_cm = self._clearance_cm = 0.0
            return True
        self._feel(gap)
        return False

    def _feel(self, gap: float) -> None:
        """Take in the gap where the robot is; below zero somebody has run into it."""
        self._unseen_cm, self._clearance_cm = 0.0, max(gap, 0.0)
        self.min_clearance_cm = min(self.min_clearance_cm, self._clearance_cm)
        if gap < 0.0:
            self.run_into += not (self._touching or self._pressed)
            self._pressed = True
        self._touching &= gap < CONTACT_ENDS_CM
        self._pressed &= gap < CONTACT_ENDS_CM

    def _gap_cm(self, x: float, z: float) -> float:
        world = self._world.at(self._time_us * 1e-6)
        return float(world.distance_cm(np.array([[x, z]]))[0]) - self._model.radius_cm

    def _set_battery(self, mv: float) -> None:
        if abs(mv - self._battery_mv) >= 1.0:
            self._battery_mv = mv
            self._board.set_battery_mv(round(mv))


def _mounted(pose: Pose, model: BodyModel) -> Pose:
    """Where the camera is that does not sit as it was meant to."""
    if model.nod_rad == model.tip_rad == model.aside_rad == model.raised_cm == 0.0:
        return pose
    rotation = pose.rotation @ _turned(model.aside_rad, model.nod_rad, model.tip_rad)
    return replace(
        pose, rotation=rotation, position_cm=pose.position_cm - np.array([0.0, model.raised_cm, 0.0])
    )


def _in_hand(pose: Pose, part: float) -> Pose:
    """Where the camera is once the hand has lifted it so far, 0 to 1."""
    sway = SWAY_RAD * math.sin(2 * math.pi * pose.t_s / SWAY_S)
    yaw, pitch, roll = (part * (angle + sway) for angle in LIFTED_RAD)
    position = pose.position_cm - np.array([0.0, part * LIFTED_CM, 0.0])
    return replace(pose, rotation=pose.rotation @ _turned(yaw, pitch, roll), position_cm=position)


def _turned(yaw: float, pitch: float, roll: float) -> np.ndarray:
    """(3, 3) of a camera turned to the right, nodded down and tipped clockwise."""
    cy, sy, cp, sp, cr, sr = (f(a) for a in (yaw, pitch, roll) for f in (math.cos, math.sin))
    turned = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    nodded = np.array([[1.0, 0.0, 0.0], [0.0, cp, sp], [0.0, -sp, cp]])
    tipped = np.array([[cr, -sr, 0.0], [sr, cr, 0.0], [0.0, 0.0, 1.0]])
    return turned @ nodded @ tipped
