"""How a wheel follows its setpoint, on motors the firmware knows nothing of; how well its speed is known."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from motion import LEFT, RIGHT, TICK_S, Motion, Rig, Robot, any_robots

RAMP_MM_S = 5.0  # a tick: 1 m/s^2, the default


@pytest.fixture(scope="module")
def motion(tmp_path_factory: pytest.TempPathFactory) -> Motion:
    """Compiled once."""
    return Motion(Path(tmp_path_factory.mktemp("motion")))


def share(errors: list[float], part: float) -> float:
    """What this part of them kept."""
    return sorted(errors)[math.ceil(part * len(errors)) - 1]


def peaks(rig: Rig, mm_s: float, seconds: float, ramp: bool) -> list[float]:
    """Fastest either wheel was on the way to this speed."""
    told, most = (0.0 if ramp else mm_s), [0.0, 0.0]
    for _ in range(round(seconds / TICK_S)):
        told = min(mm_s, told + RAMP_MM_S)
        rig.drive(told, told)
        most = [max(most[side], rig.speed_mm_s(side)) for side in (LEFT, RIGHT)]
    return most


def overshoots(motion: Motion, mm_s: float, held_s: float) -> list[float]:
    """By what share of the setpoint wheels were too fast after a start, or after they were held."""
    shares = []
    for robot in any_robots(100):
        rig = motion.rig(robot)
        if held_s:
            rig.hold(True)
            peaks(rig, mm_s, held_s, ramp=True)
            rig.hold(False)
        shares += [most / mm_s - 1 for most in peaks(rig, mm_s, 2.0, ramp=not held_s)]
    what = f"held {held_s} s" if held_s else "start"
    half, most = share(shares, 0.5), share(shares, 0.95)
    print(f"{mm_s} mm/s, {what}: overshoot p50 {half:.3f} p95 {most:.3f} max {max(shares):.3f}")
    return shares


@pytest.mark.parametrize("mm_s", [100, 200, 400])
def test_a_start_overshoots_by_less_than_5_per_cent_on_nearly_any_motor(motion: Motion, mm_s: float) -> None:
    shares = overshoots(motion, mm_s, 0)
    assert share(shares, 0.95) <= 0.05
    assert max(shares) <= 0.1


@pytest.mark.parametrize("mm_s", [200, 400])
def test_a_wheel_let_loose_after_2_s_overshoots_by_what_its_motor_is_better_than_believed(
    motion: Motion, mm_s: float
) -> None:
    shares = overshoots(motion, mm_s, 2)
    assert share(shares, 0.8) <= 0.05
    assert max(shares) <= 0.15


def test_a_motor_as_it_is_believed_to_be_does_not_overshoot_at_all(motion: Motion) -> None:
    for mm_s in (100.0, 300.0):
        assert max(peaks(motion.rig(Robot()), mm_s, 2.0, ramp=True)) <= 1.02 * mm_s


@pytest.mark.parametrize("mm_s", [50, 100, 300])
def test_any_motor_comes_to_its_speed_and_keeps_it(motion: Motion, mm_s: float) -> None:
    for robot in any_robots(60):
        rig = motion.rig(robot)
        peaks(rig, mm_s, 3.0, ramp=True)
        ways = rig.way_mm
        rig.drive(mm_s, mm_s, ticks=400)
        assert (rig.way_mm - ways) / 2.0 == pytest.approx(mm_s, rel=0.02)


@pytest.mark.parametrize(("mm_s", "most"), [(100, 0.02), (30, 0.05)])
def test_the_speed_told_is_right_on_any_motor_and_with_uneven_edges(
    motion: Motion, mm_s: float, most: float
) -> None:
    squares = []
    for robot in any_robots(40):
        rig = motion.rig(robot)
        peaks(rig, mm_s, 4.0, ramp=True)
        window: list[float] = []
        for _ in range(800):
            rig.drive(mm_s, mm_s)
            window.append(rig.speed_mm_s(LEFT))
            # Against the mean of the time the estimate can know of: four counts.
            over = window[-max(1, round(20 / mm_s / TICK_S)) :]
            squares.append((rig.told_mm_s(LEFT) / (sum(over) / len(over)) - 1) ** 2)
    rms = math.sqrt(sum(squares) / len(squares))
    print(f"{mm_s} mm/s: speed told is off by {rms:.2%} rms")
    assert rms <= most


def test_a_wheel_whose_encoder_dies_runs_little_faster_than_told(motion: Motion) -> None:
    worst = 0.0
    for robot in any_robots(60):
        rig = motion.rig(robot)
        peaks(rig, 200, 1.0, ramp=True)
        rig.break_encoder(LEFT)
        worst = max(worst, *peaks(rig, 200, 2.0, ramp=False))
    print(f"encoder dead at 200 mm/s: {worst:.0f} mm/s at most")
    assert worst <= 200 * 1.5 + 100


def test_unequal_wheels_meet_their_ramps_together(motion: Motion) -> None:
    worst = 0.0
    for robot in any_robots(60):
        rig = motion.rig(robot)
        peaks(rig, 300, 1.5, ramp=True)
        worst = max(worst, abs(rig.heading_deg))
    print(f"to 300 mm/s and 1.5 s on: {worst:.1f} degrees askew at most, without heading hold")
    assert worst <= 15
