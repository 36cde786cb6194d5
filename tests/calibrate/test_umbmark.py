"""UMBmark's equations, and the fit that needs no small errors, against squares driven independently."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from squares import square

from host.calibrate.paths import Path, Taped, fit
from host.calibrate.umbmark import Ratios, Return, Sizes, benchmark, corrected, ratios
from host.calibrate.wheels import whole_sizes

NOMINAL = Sizes(5000.0, 5000.0, 150_000.0)
LABMATE = Sizes(5000.0, 5000.0, 340_000.0)  # the paper's robot is 34 cm wide


def returns(believed: Sizes, true: Sizes, side_mm: float) -> list[Return]:
    """One square each way."""
    out = []
    for clockwise in (True, False):
        path, ahead, right = square(side_mm, clockwise, believed, true)
        odometry_ahead, odometry_right, _ = path.end(believed)
        out.append(Return(clockwise, ahead - odometry_ahead, -(right - odometry_right)))
    return out


@pytest.mark.parametrize(
    ("diameters", "wheelbase"), [(1.001, 1.0), (1.0, 1.003), (0.9995, 0.998), (1.0008, 1.002)]
)
def test_the_papers_equations_find_small_errors(diameters: float, wheelbase: float) -> None:
    true = Sizes(5000 * 2 / (1 + diameters), 5000 * 2 / (1 / diameters + 1), 340_000 * wheelbase)
    found = ratios(benchmark(returns(LABMATE, true, 4000)), 4000, 340)
    # The equations leave out squares of the angles: of a turn's error and of what a leg bends by.
    left_out = (math.pi / 2 * abs(wheelbase - 1) + 4000 / 340 * abs(diameters - 1)) ** 2
    assert found.wheelbase == pytest.approx(wheelbase, abs=left_out)
    assert found.diameters == pytest.approx(diameters, abs=left_out * 340 / 4000)


@given(st.floats(-0.001, 0.001), st.floats(-0.004, 0.004))
@settings(max_examples=25, deadline=None)
def test_the_papers_correction_takes_nine_tenths_of_small_errors_away(uneven: float, wide: float) -> None:
    true = Sizes(5000 * (1 - uneven / 2), 5000 * (1 + uneven / 2), 340_000 * (1 + wide))
    before = benchmark(returns(LABMATE, true, 4000))
    if before.systematic_mm < 20:
        return
    better = corrected(LABMATE, ratios(before, 4000, 340))
    after = benchmark(returns(better, true, 4000))
    assert after.systematic_mm < before.systematic_mm / 10


def test_a_wide_track_and_unequal_wheels_show_as_the_paper_says() -> None:
    """Type A errors pull both squares to the same side of x; type B errors to opposite ones."""
    wide = benchmark(returns(LABMATE, Sizes(5000, 5000, 341_000), 4000))
    assert wide.clockwise[0] < 0 and wide.counter[0] < 0
    uneven = benchmark(returns(LABMATE, Sizes(4999, 5001, 340_000), 4000))
    assert uneven.clockwise[0] < 0 < uneven.counter[0]


def test_the_correction_keeps_the_mean_wheel() -> None:
    better = corrected(Sizes(5100.0, 4950.0, 150_000.0), Ratios(1.02, 0.97))
    assert better.um_left + better.um_right == pytest.approx(5100 + 4950)
    assert better.um_right / better.um_left == pytest.approx(1.02 * 4950 / 5100)
    assert better.track_um == pytest.approx(145_500)


def test_centres_scatter_and_the_runs_that_are_needed() -> None:
    told = [
        Return(True, 10.0, 0.0),
        Return(True, 14.0, 0.0),
        Return(False, 3.0, 4.0),
        Return(False, 3.0, 8.0),
    ]
    found = benchmark(told)
    assert found.clockwise == (12.0, 0.0) and found.counter == (3.0, 6.0)
    assert found.systematic_mm == 12.0
    assert found.scatter_mm == pytest.approx(2.0) and found.sigma_mm == pytest.approx(2 / math.sqrt(2))
    assert found.runs_needed(1.0) == 4 and found.runs_needed(100.0) == 1


def test_squares_of_one_direction_are_not_enough() -> None:
    with pytest.raises(ValueError, match="squares of both directions are needed"):
        benchmark([Return(True, 1.0, 2.0)])


# --- The fit ------------------------------------------------------------------------------------


def straight(way_mm: float, believed: Sizes, true: Sizes) -> Taped:
    """On a circle as a rule; its end by geometry."""
    counts = (
        np.linspace(0, way_mm * 1000 / believed.um_left, 50),
        np.linspace(0, way_mm * 1000 / believed.um_right, 50),
    )
    left, right = counts[0][-1] * true.um_left / 1000, counts[1][-1] * true.um_right / 1000
    turn = (left - right) / (true.track_um / 1000)
    radius = (left + right) / 2 / turn if turn else math.inf
    end = (radius * math.sin(turn), radius * (1 - math.cos(turn))) if turn else (left, 0.0)
    return Taped(Path(np.arange(50) * 0.1, *counts), *end)


@given(left=st.floats(0.97, 1.03), right=st.floats(0.97, 1.03), track=st.floats(0.95, 1.05))
@settings(max_examples=15, deadline=None)
def test_the_fit_finds_large_errors_exactly(left: float, right: float, track: float) -> None:
    true = Sizes(5000 * left, 5000 * right, 150_000 * track)
    taped = [straight(2000, NOMINAL, true)]
    # The wheels' ratio is known roughly before squares are driven, as in the calibration.
    start = Sizes(5000 * left * 1.001, 5000 * right * 0.999, 150_000.0)
    for clockwise in (True, False):
        path, ahead, right_mm = square(2000, clockwise, start, true)
        taped.append(Taped(path, ahead, right_mm))
    found, _ = fit(taped, start)
    assert found.um_left == pytest.approx(true.um_left, rel=1e-5)
    assert found.um_right == pytest.approx(true.um_right, rel=1e-5)
    assert found.track_um == pytest.approx(true.track_um, rel=1e-5)


def test_the_fits_errors_are_as_it_says() -> None:
    true = Sizes(5050.0, 4980.0, 152_000.0)
    start = Sizes(5045.0, 4985.0, 150_000.0)
    chance = np.random.default_rng(1)
    exact = [straight(2000, start, true)] * 2
    exact += [Taped(*square(2000, clockwise, start, true)) for clockwise in (True, False)]
    deviations = []
    for _ in range(40):
        taped = []
        for one in exact:
            turned = chance.normal(0.0, 0.01)
            ahead = one.ahead_mm * math.cos(turned) - one.right_mm * math.sin(turned)
            right = one.right_mm * math.cos(turned) + one.ahead_mm * math.sin(turned)
            taped.append(Taped(one.path, ahead + chance.normal(0, 2.0), right + chance.normal(0, 2.0)))
        found, sigmas = fit(taped, start)
        deviations.append([
            (found.um_left - true.um_left) / sigmas.um_left,
            (found.um_right - true.um_right) / sigmas.um_right,
            (found.track_um - true.track_um) / sigmas.track_um,
        ])  # fmt: skip
    spread = np.sqrt((np.array(deviations) ** 2).mean(axis=0))
    assert np.all((spread > 0.65) & (spread < 1.4)), spread  # 40 draws: within 3 of their 0.11


def test_straight_ways_alone_do_not_tell_the_track() -> None:
    with pytest.raises(ValueError, match="do not determine the sizes"):
        fit([straight(2000, NOMINAL, NOMINAL)], NOMINAL)


@given(st.floats(3000, 8000), st.floats(-0.05, 0.05), st.floats(100_000, 200_000))
def test_whole_micrometres_keep_the_ratios(mean: float, uneven: float, track: float) -> None:
    sizes = Sizes(mean * (1 + uneven / 2), mean * (1 - uneven / 2), track)
    left, right, whole_track = whole_sizes(sizes)
    # 11 pairs are tried; the best is a twentieth of a step off as a rule, and never more than half a step.
    assert right / left == pytest.approx(sizes.um_right / sizes.um_left, rel=0.5 / mean)
    assert left + right == pytest.approx(2 * mean, rel=0.003)
    assert whole_track / (left + right) == pytest.approx(track / (2 * mean), rel=1e-5)
