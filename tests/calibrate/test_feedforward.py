"""The duties of a motor, found again from what a modelled one does."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from host.calibrate.feedforward import (
    MotorFit,
    Start,
    Steady,
    acceleration_q8,
    fit_acceleration,
    fit_steady,
    static_duty,
    velocity_q8,
)
from host.calibrate.wheels import RawStart


@given(static=st.floats(0.02, 0.3), velocity=st.floats(1e-4, 5e-3), seed=st.integers(0, 1000))
def test_both_constants_are_found_in_either_direction(static: float, velocity: float, seed: int) -> None:
    speeds = np.random.default_rng(seed).permutation(
        [-400.0, -300.0, -200.0, -100.0, 100.0, 200.0, 300.0, 400.0]
    )
    fit = fit_steady([Steady(v, math.copysign(static + velocity * abs(v), v)) for v in speeds])
    assert fit.static == pytest.approx(static, rel=1e-9) and fit.velocity == pytest.approx(velocity, rel=1e-9)
    assert fit.residual < 1e-9 and abs(fit.asymmetry) < 1e-9


def test_a_motor_that_is_weaker_backwards_is_told() -> None:
    samples = [Steady(v, 0.1 + 0.001 * v) for v in (100.0, 300.0)]
    samples += [Steady(-v, -(0.1 + 0.0011 * v)) for v in (100.0, 300.0)]
    fit = fit_steady(samples)
    assert fit.asymmetry == pytest.approx(1 / 1.1 - 1) and fit.residual > 0.001


def test_one_speed_is_not_enough() -> None:
    with pytest.raises(ValueError, match="at least two different speeds"):
        fit_steady([Steady(100.0, 0.2), Steady(-100.0, -0.2)])


@given(lag_s=st.floats(0.02, 0.12), speed=st.floats(50.0, 500.0), ramp_s=st.floats(0.0, 0.5))
def test_the_lag_is_found_from_a_start_however_steep(lag_s: float, speed: float, ramp_s: float) -> None:
    """A motor of one time constant, pushed up a ramp to an even duty."""
    static, velocity, step_s = 0.1, 0.001, 0.0005
    t_s = np.arange(0.0, 2.0, step_s)
    aims = speed * np.minimum(1.0, t_s / max(ramp_s, step_s))
    v, way = 0.0, 0.0
    for aim in aims[:-1]:
        before = v
        v = aim + (v - aim) * math.exp(-step_s / lag_s)
        way += aim * step_s + (before - aim) * lag_s * (1 - math.exp(-step_s / lag_s))
    raw = RawStart(way, v, t_s, static + velocity * aims)
    fit = MotorFit(static, velocity, 0.0, 0.0, 0.0)
    assert fit_acceleration([raw.above(static)], fit) / velocity == pytest.approx(lag_s, rel=0.02)


def test_a_start_that_pushes_less_than_it_travels_has_no_acceleration() -> None:
    assert fit_acceleration([Start(100.0, 200.0, 0.05)], MotorFit(0.1, 0.001, 0.0, 0.0, 0.0)) == 0.0
    with pytest.raises(ValueError, match="at least one start"):
        fit_acceleration([], MotorFit(0.1, 0.001, 0.0, 0.0, 0.0))


def test_parameters_are_in_the_firmwares_units() -> None:
    """A duty of 8 % to start and all of it at 0.7 m/s, which are the firmware's defaults."""
    fit = MotorFit(0.08, 0.92 / 700, 0.0, 0.0, 0.0)
    assert static_duty(fit) == 2621
    assert velocity_q8(fit, 1.0) == 689
    assert velocity_q8(MotorFit(0.08, 0.92 / 140, 0.0, 0.0, 0.0), 5.0) == 689  # in counts of 5 mm
    # 50 ms: in one tick of 5 ms a speed gained of 1/16 mm/s is an acceleration of 12.5 mm/s^2.
    assert acceleration_q8(0.05 * 0.92 / 700, 1.0) == round(0.05 * 12.5 * 0.92 / 700 * 32767 * 256)


def test_parameters_stay_within_16_bits() -> None:
    assert velocity_q8(MotorFit(0.0, 1.0, 0.0, 0.0, 0.0), 1.0) == 32767
    assert static_duty(MotorFit(-0.01, 1.0, 0.0, 0.0, 0.0)) == 0
