"""UMBmark: wheel diameters and wheelbase from squares driven both ways. Pure maths, no robot.

J. Borenstein and L. Feng, "Measurement and Correction of Systematic Odometry Errors in Mobile Robots", IEEE
Transactions on Robotics and Automation 12(6), 1996. A square is driven several times clockwise and counter-
clockwise; a tape tells where the robot truly came back to, less where its odometry says. A wrong wheelbase
bends both squares inwards or both outwards, unequal wheels bend one in and the other out, which tells them
apart. Axes as in the paper: x along the first leg, y to its left.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

TURN_RAD = math.pi / 2


@dataclass(frozen=True)
class Return:
    """Where a square ended: true place less the odometry's, in mm."""

    clockwise: bool
    x_mm: float
    y_mm: float


@dataclass(frozen=True)
class Benchmark:
    """The paper's figures of a set of squares, in mm."""

    clockwise: tuple[float, float]  # centre of gravity of the returns
    counter: tuple[float, float]
    scatter_mm: float  # standard deviation of one return about its centre, along one axis
    runs: int  # in the direction driven less often

    @property
    def systematic_mm(self) -> float:
        """E_max,syst: how far the worse centre of gravity is off (eq. 3 and 4)."""
        return max(math.hypot(*self.clockwise), math.hypot(*self.counter))

    @property
    def sigma_mm(self) -> float:
        """Standard error of a centre of gravity along one axis."""
        return self.scatter_mm / math.sqrt(self.runs)

    def runs_needed(self, sigma_mm: float) -> int:
        """Squares in each direction after which that standard error is as asked."""
        return max(1, math.ceil((self.scatter_mm / sigma_mm) ** 2))


def benchmark(returns: Sequence[Return]) -> Benchmark:
    """Centres of gravity and scatter (eq. 2).

    Raises
    ------
    ValueError
        One direction was not driven.
    """
    centres, squares, degrees = [], 0.0, 0
    for clockwise in (True, False):
        of_way = np.array([(r.x_mm, r.y_mm) for r in returns if r.clockwise == clockwise])
        if not len(of_way):
            raise ValueError("squares of both directions are needed")
        centre = of_way.mean(axis=0)
        squares += float(((of_way - centre) ** 2).sum())
        degrees += 2 * (len(of_way) - 1)
        centres.append((float(centre[0]), float(centre[1])))
    runs = min(sum(r.clockwise == way for r in returns) for way in (True, False))
    return Benchmark(centres[0], centres[1], math.sqrt(squares / degrees) if degrees else math.nan, runs)


@dataclass(frozen=True)
class Ratios:
    """What UMBmark is after."""

    diameters: float  # E_d: right wheel over left wheel, as they truly are
    wheelbase: float  # E_b: true over nominal


def ratios(found: Benchmark, side_mm: float, wheelbase_mm: float) -> Ratios:
    """The two ratios by the paper's equations, which hold for small errors.

    With alpha missing in each turn and each leg bending by beta to the left, four legs of length L end at
    x = -2 L (alpha + beta), y = -2 L (alpha + beta) clockwise and x = -2 L (alpha - beta),
    y = 2 L (alpha - beta) counter-clockwise. Both axes say the same, and their mean is taken (eq. 8 to 12).
    """
    (x_cw, y_cw), (x_ccw, y_ccw) = found.clockwise, found.counter
    alpha = ((x_cw + x_ccw) + (y_cw - y_ccw)) / 2 / (-4 * side_mm)
    beta = ((x_cw - x_ccw) + (y_cw + y_ccw)) / 2 / (-4 * side_mm)
    # A leg that bends by beta lies on a circle of this radius (eq. 13); the wheels run at it -/+ b / 2.
    bend = 2 * math.sin(beta / 2) / side_mm  # 1 / radius, which may be straight
    diameters = (1 + bend * wheelbase_mm / 2) / (1 - bend * wheelbase_mm / 2)
    return Ratios(diameters, TURN_RAD / (TURN_RAD - alpha))  # eq. 14 and 11


@dataclass(frozen=True)
class Sizes:
    """What odometry is reckoned with."""

    um_left: float  # travel in one count
    um_right: float
    track_um: float


def corrected(sizes: Sizes, found: Ratios) -> Sizes:
    """Sizes after the paper's correction (eq. 15 and 17): the mean of the wheels stays."""
    mean = (sizes.um_left + sizes.um_right) / 2
    ratio = found.diameters * sizes.um_right / sizes.um_left
    return Sizes(mean * 2 / (1 + ratio), mean * 2 / (1 / ratio + 1), sizes.track_um * found.wheelbase)
