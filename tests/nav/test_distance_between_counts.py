"""How well the host knows a wheel's travel between two counts: firmware, line and many motors simulated.

Raw counts of 0.5 cm are off by 0.5 / sqrt(12) = 0.14 cm. It is the present that counts, not what is known
once the next edge has come. Where in its cell a wheel stood at first shifts all travel alike and is left out.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from host.link.faults import Faults, FaultyLine
from host.link.protocol import Telemetry
from host.link.robot import Robot
from host.nav.odometry import WheelReading
from host.nav.wheel import Wheel
from host.sim.body import BodyModel
from host.sim.rolling import RollingRobot

CELL_CM = 0.5
SPEEDS_CM_S = (10, 15, 20, 30, 40, 50)
SEEDS = range(3)
SETTLE_S, MEASURE_S = 3.0, 4.0
DRIVE_EVERY = 5  # polls of 10 ms


def any_body(seed: int, phase_error: float) -> BodyModel:
    chance = np.random.default_rng(seed)
    return BodyModel(
        phase_error=phase_error,
        mismatch=float(chance.uniform(-0.15, 0.15)),
        lag_s=float(chance.uniform(0.03, 0.09)),
        dead_zone=float(chance.uniform(0.05, 0.15)),
        battery_mv=float(chance.uniform(6800, 8400)),
    )


class Rolled:
    """The true travel of both wheels, kept while time passes."""

    def __init__(self, robot: RollingRobot) -> None:
        self.cm = np.zeros(2)
        self._robot, self._before = robot, np.zeros(2)
        robot.watchers.append(self._add)

    def _add(self) -> None:
        now = np.array(self._robot.body.wheel_speeds_cm_s)
        self.cm += (now + self._before) / 2 * 1e-3
        self._before = now


def errors(
    speed_cm_s: float, seed: int, phase_error: float, jitter_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Mean squared errors of both wheels' travel, by edges and by counts alone, on steady motion."""
    sim = RollingRobot(any_body(seed, phase_error), seed=seed)
    rolled = Rolled(sim)
    line = FaultyLine(sim.line(), sim.clock, Faults(jitter_s=jitter_s), Faults(jitter_s=jitter_s), seed)
    sim.watchers.append(line.pump)
    robot = Robot(line, sim.clock)
    robot.connect()
    wheels: list[Wheel] = []
    by_edges, by_counts = [], []
    for step in range(round((SETTLE_S + MEASURE_S) * 100)):
        if step % DRIVE_EVERY == 0:
            robot.drive(10 * speed_cm_s, 0)
        sim.clock.sleep_s(0.01)
        for report in robot.poll():
            wheels = wheels or [Wheel(CELL_CM, sim.clock.now_s(), n) for n in counts(report)]
            r = WheelReading.of(report, robot.host_time_s(report.mcu_time_us))
            wheels[0].add(r.t_s, r.count_left, r.edge_left_s, r.direction_left)
            wheels[1].add(r.t_s, r.count_right, r.edge_right_s, r.direction_right)
        if step >= SETTLE_S * 100:
            assert robot.latest is not None
            by_edges.append([wheel.travel(sim.clock.now_s()) for wheel in wheels] - rolled.cm)
            by_counts.append(CELL_CM * np.array(counts(robot.latest)) - rolled.cm)
    assert rolled.cm.min() > 0.9 * MEASURE_S * speed_cm_s
    return np.var(by_edges, axis=0), np.var(by_counts, axis=0)


def counts(report: Telemetry) -> tuple[int, int]:
    return report.count_left, report.count_right


@pytest.mark.parametrize(
    ("phase_error", "jitter_s"),
    [(0.0, 0.0), (0.4, 0.0), (0.4, 0.005)],
    ids=["even edges", "edges off by a tenth of a cycle", "and 5 ms of jitter each way"],
)
def test_travel_between_counts_is_known_to_half_a_millimetre_rms(phase_error: float, jitter_s: float):
    print(f"\nedges off by up to {phase_error:g} counts, jitter {1e3 * jitter_s:g} ms; cm rms:")
    for speed_cm_s in SPEEDS_CM_S:
        pairs = [errors(speed_cm_s, seed, phase_error, jitter_s) for seed in SEEDS]
        fine, raw = (math.sqrt(np.mean([pair[k] for pair in pairs])) for k in (0, 1))
        worst = math.sqrt(np.max([pair[0] for pair in pairs]))
        print(f"  {speed_cm_s} cm/s: {fine:.4f}, worst wheel {worst:.4f}; by counts {raw:.3f}")
        assert worst <= 0.05
