"""What duty a motor needs for a speed: a constant part, one that grows with speed, one with acceleration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

DUTY_FULL = 32767
TICK_S = 0.005  # of the firmware's control
Q4, Q8 = 16, 256  # fixed point of speeds in mm/s, and of the gains


@dataclass(frozen=True)
class Steady:
    """A wheel at even speed."""

    speed: float  # in any unit, signed
    duty: float  # share of a full battery's voltage, signed


@dataclass(frozen=True)
class Start:
    """A wheel from rest to even speed."""

    way: float  # travelled in it, without sign, in the unit of speeds times seconds
    speed: float  # reached, without sign
    push_s: float  # integral over time of what the duty exceeds the static one by; a share times seconds


@dataclass(frozen=True)
class MotorFit:
    """duty = static + velocity * speed, both in the direction of travel."""

    static: float  # share of a full battery's voltage
    velocity: float  # per unit of speed
    velocity_sigma: float
    asymmetry: float  # forward over backward slope, less one
    residual: float  # rms of the duties about the line


def fit_steady(samples: Sequence[Steady]) -> MotorFit:
    """A line through speed and duty, both directions folded together.

    Raises
    ------
    ValueError
        Fewer than two different speeds.
    """
    speed = np.array([abs(s.speed) for s in samples])
    duty = np.array([s.duty * np.sign(s.speed) for s in samples])
    if len(np.unique(np.round(speed / max(speed.max(initial=0.0), 1e-9), 2))) < 2:
        raise ValueError("at least two different speeds are needed")
    static, velocity = _line(speed, duty)
    left = duty - static - velocity * speed
    residual = float(np.sqrt((left**2).mean()))
    spread = speed - speed.mean()
    sigma = float(np.sqrt((left @ left) / max(len(speed) - 2, 1) / (spread @ spread)))
    slopes = []
    for forward in (True, False):
        way = np.array([(s.speed > 0) == forward for s in samples])
        slopes.append(_line(speed[way], duty[way])[1] if way.sum() > 1 else velocity)
    return MotorFit(static, velocity, sigma, slopes[0] / slopes[1] - 1, residual)


def _line(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    spread = x - x.mean()
    if not (spread @ spread):
        return float(y.mean()), 0.0
    slope = float((spread @ y) / (spread @ spread))
    return float(y.mean() - slope * x.mean()), slope


def fit_acceleration(starts: Sequence[Start], fit: MotorFit) -> float:
    """Duty per speed gained in a second: what was pushed beyond what the way took, over the speed reached."""
    if not starts:
        raise ValueError("at least one start from rest is needed")
    speed = np.array([s.speed for s in starts])
    extra = np.array([s.push_s - fit.velocity * s.way for s in starts])
    return max(0.0, float((extra @ speed) / (speed @ speed)))


def static_duty(fit: MotorFit) -> int:
    """STATIC_DUTY of the parameters."""
    return min(max(round(fit.static * DUTY_FULL), 0), DUTY_FULL)


def velocity_q8(fit: MotorFit, mm_per_unit: float) -> int:
    """VELOCITY_Q8 of the parameters, if one unit of speed is so many mm/s."""
    return min(max(round(fit.velocity / mm_per_unit * DUTY_FULL * Q8 / Q4), 0), DUTY_FULL)


def acceleration_q8(per_unit: float, mm_per_unit: float) -> int:
    """ACCELERATION_Q8 of the parameters, from duty per unit of speed gained in a second."""
    return min(max(round(per_unit / mm_per_unit * DUTY_FULL * Q8 / (Q4 * TICK_S)), 0), DUTY_FULL)
