"""A square driven by two wheels in a thousand small steps a leg: written without the code under test."""

from __future__ import annotations

import math

import numpy as np

from host.calibrate.paths import Path
from host.calibrate.umbmark import Sizes

STEPS = 400


def square(side_mm: float, clockwise: bool, believed: Sizes, true: Sizes) -> tuple[Path, float, float]:
    """What the encoders counted, and where the robot truly ended: mm ahead and to the right."""
    ways: list[tuple[float, float]] = []  # of the left and right wheel, mm, as the robot believes
    half = believed.track_um / 1000 * math.pi / 4 * (1 if clockwise else -1)
    for _ in range(4):
        ways += [(side_mm, side_mm), (half, -half)]
    x = z = heading = 0.0
    left, right = [0.0], [0.0]
    for way_left, way_right in ways:
        for _ in range(STEPS):
            count_left = way_left / STEPS / believed.um_left * 1000
            count_right = way_right / STEPS / believed.um_right * 1000
            left.append(left[-1] + count_left)
            right.append(right[-1] + count_right)
            roll_left, roll_right = count_left * true.um_left / 1000, count_right * true.um_right / 1000
            turn = (roll_left - roll_right) / (true.track_um / 1000)
            x += (roll_left + roll_right) / 2 * math.sin(heading + turn / 2)
            z += (roll_left + roll_right) / 2 * math.cos(heading + turn / 2)
            heading += turn
    return Path(np.arange(len(left)) * 0.01, np.array(left), np.array(right)), z, x
