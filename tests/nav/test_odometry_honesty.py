"""Is odometry as sure as it says? Many bodies with wrong wheels, slip and cells entered anywhere."""

from __future__ import annotations

import math
import tracemalloc

import numpy as np
import pytest

from host.nav.config import BodyConfig
from host.nav.odometry import SLIP_CM2_PER_CM, Odometry, WheelReading, heading_of

BODY = BodyConfig()
CALIBRATED = BodyConfig(size_sigma=0.005, ratio_sigma=0.002, track_sigma=0.005)
STEP_S, READ_EVERY = 0.002, 5
BODIES = 40


class Drive:
    """One body on a random way: wheel speeds that ramp to a new aim now and then."""

    def __init__(self, seed: int, seconds: float, body: BodyConfig = BODY) -> None:
        rng = np.random.default_rng((0x0D0, seed))
        n = round(seconds / STEP_S)
        aims = np.repeat(rng.uniform((4, -0.6), (25, 0.6), (n // 1000 + 1, 2)), 1000, axis=0)[:n]
        aims[:100], aims[-250:] = 0.0, 0.0  # stands at first, and in the end
        wheels = aims[:, :1] + aims[:, 1:] * BODY.track_cm / 2 * np.array([1, -1])
        speed = np.zeros((n, 2))
        for k in range(1, n):
            speed[k] = speed[k - 1] + np.clip(wheels[k] - speed[k - 1], -0.16, 0.16)
        size, ratio, track = rng.standard_normal(3) * (body.size_sigma, body.ratio_sigma, body.track_sigma)
        sizes = (1 + size) * np.array([1 + ratio / 2, 1 - ratio / 2])
        track_cm = (1 + track) * body.track_cm
        self.t_s = np.arange(1, n + 1) * STEP_S
        turned = np.cumsum(speed, axis=0) * STEP_S  # as a wheel of the size it is taken for
        self.places = turned / BODY.cm_per_count + rng.random(2)  # in counts
        steps = np.diff(turned, axis=0, prepend=0.0)
        rolled = steps * sizes
        rolled = rolled + np.sqrt(SLIP_CM2_PER_CM * np.abs(steps)) * rng.standard_normal(steps.shape)
        turn = (rolled[:, 0] - rolled[:, 1]) / track_cm
        self.heading = np.cumsum(turn)
        middle = self.heading - turn / 2
        way = rolled.mean(1)
        ahead = BODY.camera_ahead_cm
        self.x = np.cumsum(way * np.sin(middle)) + ahead * np.sin(self.heading)
        self.z = np.cumsum(way * np.cos(middle)) + ahead * (np.cos(self.heading) - 1)

    def readings(self) -> list[WheelReading]:
        counts = np.floor(self.places).astype(int)
        rows = []
        edges: list[list[float]] = [[], []]
        for side in (0, 1):
            where = self.places[:, side]
            borders = np.arange(counts[0, side] + 1, counts[-1, side] + 1)
            moving = np.concatenate([[True], np.diff(where) > 0])
            edges[side] = np.interp(borders, where[moving], self.t_s[moving]).tolist()
        for k in range(READ_EVERY - 1, len(self.t_s), READ_EVERY):
            left, right = counts[k] - counts[0]
            last = [edges[i][n - 1] if n > 0 else None for i, n in enumerate((left, right))]
            rows.append(WheelReading(float(self.t_s[k]), int(left), int(right), last[0], last[1]))
        return rows

    def off(self, odometry: Odometry, t_s: float) -> np.ndarray:
        """Error of x, z, heading."""
        k = round(t_s / STEP_S) - 1
        pose = odometry.pose_at(t_s)
        turn = heading_of(pose) - self.heading[k]
        turn = (turn + math.pi) % (2 * math.pi) - math.pi
        return np.array([pose.position_cm[0] - self.x[k], pose.position_cm[2] - self.z[k], turn])


def normalised(error: np.ndarray, covariance: np.ndarray) -> float:
    """Squared error in units of its covariance: 3 on the average, if that is honest."""
    return float(error @ np.linalg.solve(covariance, error))


@pytest.mark.parametrize(
    ("seconds", "body"),
    [(2.0, BODY), (8.0, BODY), (25.0, CALIBRATED)],
    ids=["2 s", "8 s", "25 s, measured before"],
)
def test_the_pose_is_as_sure_as_it_says(seconds, body):
    """As long as the heading is known to some 15 degrees: beyond, errors are no longer in proportion."""
    squares = []
    for seed in range(BODIES):
        drive, odometry = Drive(seed, seconds, body), Odometry(body)
        for reading in drive.readings():
            odometry.add(reading)
        t_s = float(drive.t_s[-1]) - 0.04
        squares.append(normalised(drive.off(odometry, t_s), odometry.covariance_at(t_s)))
    print(f"\n{seconds:g} s: {np.mean(squares):.2f} of 3")
    assert 1.8 < np.mean(squares) < 4.2
    assert np.mean(np.array(squares) < 7.81) > 0.85  # 95 % of a chi-squared of 3


@pytest.mark.parametrize("apart_s", [0.066, 0.4])
def test_the_motion_between_two_frames_is_as_sure_as_it_says(apart_s):
    squares = []
    for seed in range(BODIES // 2):
        drive, odometry = Drive(seed, 9.0), Odometry(BODY)
        for k, reading in enumerate(drive.readings()):
            odometry.add(reading)
            if k % 23 == 0 and reading.t_s > 1.0:
                to_s = reading.t_s - 0.03
                at = [round((s) / STEP_S) - 1 for s in (to_s - apart_s, to_s)]
                motion = odometry.motion(float(drive.t_s[at[0]]), float(drive.t_s[at[1]]))
                dx, dz = (v[at[1]] - v[at[0]] for v in (drive.x, drive.z))
                c, s = math.cos(drive.heading[at[0]]), math.sin(drive.heading[at[0]])
                true = np.array(
                    [c * dx - s * dz, s * dx + c * dz, drive.heading[at[1]] - drive.heading[at[0]]]
                )
                error = np.array([motion.x_cm, motion.z_cm, motion.heading_rad]) - true
                squares.append(normalised(error, motion.covariance + 1e-9 * np.eye(3)))
    print(f"\n{apart_s:g} s: mean {np.mean(squares):.2f} of 3, median {np.median(squares):.2f} of 2.37")
    assert np.mean(squares) < 4.5
    assert np.median(squares) > 0.2
    assert np.mean(np.array(squares) < 7.81) > 0.85


def test_motions_between_frames_add_up_to_the_pose():
    drive, odometry = Drive(3, 6.0), Odometry(BODY)
    x = z = heading = 0.0
    last_s = 0.1
    for reading in drive.readings():
        odometry.add(reading)
        now_s = reading.t_s - 0.3  # settled
        if reading.t_s > 0.5 and now_s - last_s > 0.06:
            m = odometry.motion(last_s, now_s)
            c, s = math.cos(heading), math.sin(heading)
            x, z, heading = x + c * m.x_cm + s * m.z_cm, z - s * m.x_cm + c * m.z_cm, heading + m.heading_rad
            last_s = now_s
    pose = odometry.pose_at(last_s)
    assert (
        np.hypot(x - pose.position_cm[0], z - pose.position_cm[2]) < 0.4
    )  # the start's cell, found on the way
    assert abs(heading - heading_of(pose)) < 0.02


def test_uncertainty_only_grows():
    drive, odometry = Drive(5, 12.0), Odometry(BODY)
    before = 0.0
    for k, reading in enumerate(drive.readings()):
        odometry.add(reading)
        if k % 100 == 99 and reading.t_s > 2.0:
            now = odometry.covariance_at(reading.t_s)[2, 2]
            assert now > 0.8 * before
            before = now
    assert before > 1e-4


def test_memory_stays_flat():
    drive, odometry = Drive(7, 40.0), Odometry(BODY)
    readings = drive.readings()
    tracemalloc.start()
    for reading in readings[:1500]:
        odometry.add(reading)
    first = tracemalloc.get_traced_memory()[0]
    for reading in readings[1500:3400]:
        odometry.add(reading)
    grown = tracemalloc.get_traced_memory()[0] - first
    tracemalloc.stop()
    assert grown < 20_000
