"""Where a wheel is before the first edge of a start, and after the last of a stop, by its motor's duty."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from host.link.robot import Robot
from host.nav.config import BodyConfig
from host.nav.motor import Duties, lead_in
from host.nav.odometry import Odometry, WheelReading, heading_of
from host.nav.wheel import Wheel
from host.pose import wrap
from host.sim.rolling import open_rolling

SEEDS = range(1, 13)
STAND_S, WAY_CM = 0.4, 9.0


class Driven:
    """A simulated robot driven straight or in a turn from rest to rest, and what its odometry makes of it."""

    def __init__(self, uri: str) -> None:
        self._sim = open_rolling(uri)
        self._robot = Robot(self._sim.line(), self._sim.clock)
        self._robot.connect()
        self.odometry = Odometry(BodyConfig())
        self.way_errors_cm: list[float] = []  # every 10 ms, of the camera's way ahead as known then

    def run(self, seconds: float, v_mm_s: float = 0.0, omega_rad_s: float = 0.0, brake: bool = False) -> None:
        for step in range(round(100 * seconds)):
            if brake:
                self._robot.stop()
            elif step % 5 == 0:
                self._robot.drive(v_mm_s, omega_rad_s)
            self._sim.clock.sleep_s(0.01)
            for report in self._robot.poll():
                self.odometry.add(WheelReading.of(report, self._robot.host_time_s(report.mcu_time_us)))
            pose, true = self.odometry.pose_at(self._sim.clock.now_s()), self._true()
            self.way_errors_cm.append(float(pose.position_cm[2] - true.position_cm[2]))

    def heading_error_rad(self) -> float:
        return wrap(heading_of(self.odometry.pose_at(self._sim.clock.now_s())) - heading_of(self._true()))

    def _true(self):
        return self._sim.body.pose_at(self._sim.board.time_us)


@pytest.mark.parametrize("brake", [False, True], ids=["slowed down", "braked at once"])
@pytest.mark.parametrize("speed_cm_s", [5, 10, 20])
def test_the_way_from_rest_to_rest_is_known_without_bias_also_while_it_stops(speed_cm_s: int, brake: bool):
    ends, on_the_way = [], []
    for seed in SEEDS:
        driven = Driven(f"sim:?seed={seed}")
        driven.run(STAND_S)
        driven.run(WAY_CM / speed_cm_s + 0.037 * seed, 10 * speed_cm_s)  # stops anywhere in a count
        moving = len(driven.way_errors_cm)
        driven.run(1.0, brake=brake)
        ends.append(driven.way_errors_cm[-1])
        on_the_way.append(driven.way_errors_cm[moving:-1])
    assert abs(np.mean(ends)) < 0.04
    assert math.sqrt(np.mean(np.square(ends))) < 0.06
    assert np.abs(np.mean(on_the_way, axis=0)).max() < 0.06


def test_a_start_in_a_turn_leaves_the_heading_right_to_a_third_of_a_degree():
    errors = []
    for seed in SEEDS:
        driven = Driven(f"sim:?seed={seed}")
        driven.run(STAND_S)
        driven.run(1.0, omega_rad_s=0.8)
        errors.append(driven.heading_error_rad())
    assert math.degrees(math.sqrt(np.mean(np.square(errors)))) < 0.35


def test_motors_that_are_unlike_start_a_straight_way_with_a_turn_and_the_heading_follows():
    errors = []
    for seed in SEEDS:
        driven = Driven(f"sim:?seed={seed}&motors=15")
        driven.run(STAND_S)
        driven.run(0.8, 200)
        errors.append(driven.heading_error_rad())
    assert math.degrees(math.sqrt(np.mean(np.square(errors)))) < 0.35


def test_after_lost_readings_the_duty_before_them_is_not_known():
    duties = Duties()
    for t_s in (0.0, 0.01, 0.02):
        duties.add(t_s, 0.0)
    edges = np.array([0.15, 0.2, 0.24])
    for t_s in np.arange(0.1, 0.26, 0.01):
        duties.add(float(t_s), 0.2)
    assert lead_in(duties, edges, np.array([0.0, 0.5, 1.0]), 0.5, 1) is None


readings = st.tuples(st.integers(-1, 1), st.floats(-0.01, 0.01), st.sampled_from([-1.0, 0.0, 0.0, 0.1, 0.3]))


@given(st.lists(readings, max_size=60))
def test_no_duties_stop_the_counting(steps):
    wheel, count, edge_s = Wheel(0.5, 0.0, 0), 0, -1.0
    for k, (step, shift_s, duty) in enumerate(steps):
        count += step
        edge_s = (0.01 * k if step else edge_s) + shift_s
        wheel.add(0.01 * k, count, edge_s, step, duty)
        assert math.isfinite(wheel.travel(0.01 * k + 0.05))
        assert 0.0 < wheel.sigma(0.01 * k + 0.05) <= 0.5
        assert math.isfinite(wheel.lead_in().back_cm)
