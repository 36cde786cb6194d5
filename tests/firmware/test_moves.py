"""How far from its end a MOVE or TURN truly ends, on motors the firmware knows nothing about."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import pytest
from motion import Motion, Robot, any_robots, unequal_robots

A_COUNT_DEG = math.degrees(5 / 150)  # heading, for a count of one wheel: 1.9


@pytest.fixture(scope="module")
def motion(tmp_path_factory: pytest.TempPathFactory) -> Motion:
    """Compiled once."""
    return Motion(Path(tmp_path_factory.mktemp("motion")))


class Ends:
    """How far off many moves ended."""

    def __init__(self) -> None:
        self.way_mm: list[float] = []
        self.heading_deg: list[float] = []
        self.seconds: list[float] = []

    def add(self, way_mm: float, heading_deg: float, seconds: float | None) -> None:
        """One more."""
        assert seconds is not None, "a move that does not end"
        self.way_mm.append(abs(way_mm))
        self.heading_deg.append(abs(heading_deg))
        self.seconds.append(seconds)

    def share(self, errors: list[float], share: float) -> float:
        """What this share of the moves kept."""
        return sorted(errors)[math.ceil(share * len(errors)) - 1]

    def table(self, name: str) -> None:
        """For the record."""
        for what, errors in (("mm", self.way_mm), ("deg", self.heading_deg)):
            rms = math.sqrt(sum(error**2 for error in errors) / len(errors))
            print(f"{name}: {what} rms {rms:.2f} p95 {self.share(errors, 0.95):.2f} max {max(errors):.2f}")
        print(f"{name}: median {self.share(self.seconds, 0.5):.2f} s, longest {max(self.seconds):.2f} s")


def moves(motion: Motion, robots: Iterable[Robot], distance_mm: int, speed_mm_s: int) -> Ends:
    """A MOVE each."""
    ends = Ends()
    for robot in robots:
        rig = motion.rig(robot)
        seconds = rig.move(distance_mm, speed_mm_s)
        ends.add(rig.way_mm - distance_mm, rig.heading_deg, seconds)
    ends.table(f"MOVE {distance_mm} mm at {speed_mm_s} mm/s")
    return ends


def turns(motion: Motion, robots: Iterable[Robot], angle_mrad: int, rate_mrad_s: int) -> Ends:
    """A TURN each."""
    ends = Ends()
    for robot in robots:
        rig = motion.rig(robot)
        seconds = rig.turn(angle_mrad, rate_mrad_s)
        ends.add(rig.way_mm, rig.heading_deg - math.degrees(angle_mrad / 1000), seconds)
    ends.table(f"TURN {angle_mrad} mrad at {rate_mrad_s} mrad/s")
    return ends


@pytest.mark.parametrize("speed_mm_s", [200, 300, 600])
@pytest.mark.parametrize("distance_mm", [1000, -1000])
def test_a_metre_on_unequal_motors_ends_within_5_mm_and_1_degree(
    motion: Motion, distance_mm: int, speed_mm_s: int
) -> None:
    ends = moves(motion, unequal_robots(100), distance_mm, speed_mm_s)
    assert max(ends.way_mm) <= 5
    assert max(ends.heading_deg) <= 1


@pytest.mark.parametrize("rate_mrad_s", [2000, 4000])
@pytest.mark.parametrize("angle_mrad", [1571, -1571])
def test_a_quarter_turn_on_unequal_motors_ends_within_5_mm_and_97_of_100_times_within_a_degree(
    motion: Motion, angle_mrad: int, rate_mrad_s: int
) -> None:
    ends = turns(motion, unequal_robots(200), angle_mrad, rate_mrad_s)
    assert max(ends.way_mm) <= 5
    assert ends.share(ends.heading_deg, 0.97) <= 1
    assert max(ends.heading_deg) <= A_COUNT_DEG


def test_on_any_motors_a_metre_ends_within_5_mm_and_less_than_a_count_askew(motion: Motion) -> None:
    ends = moves(motion, any_robots(300), 1000, 300)
    assert max(ends.way_mm) <= 5
    assert ends.share(ends.heading_deg, 0.68) <= A_COUNT_DEG / 3
    assert max(ends.heading_deg) <= A_COUNT_DEG


def test_on_any_motors_a_quarter_turn_ends_within_5_mm_and_less_than_a_count_off(motion: Motion) -> None:
    ends = turns(motion, any_robots(300), 1571, 2000)
    assert max(ends.way_mm) <= 5
    assert ends.share(ends.heading_deg, 0.68) <= A_COUNT_DEG / 2.5
    assert max(ends.heading_deg) <= A_COUNT_DEG


@pytest.mark.parametrize("distance_mm", [10, -10, 30, -100])
def test_a_short_move_ends_within_5_mm_on_any_motors(motion: Motion, distance_mm: int) -> None:
    ends = moves(motion, any_robots(100), distance_mm, 300)
    assert max(ends.way_mm) <= 5
    assert max(ends.seconds) <= 8


@pytest.mark.parametrize("angle_mrad", [87, -87, 300])
def test_a_small_turn_ends_on_any_motors_with_either_wheel_within_a_count(
    motion: Motion, angle_mrad: int
) -> None:
    ends = turns(motion, any_robots(100), angle_mrad, 1000)
    assert max(ends.way_mm) <= 5
    assert max(ends.heading_deg) <= math.degrees(2 * 5 / 150)
    assert max(ends.seconds) <= 8


@pytest.mark.parametrize("speed_mm_s", [1, 5, 15])
def test_a_move_slower_than_creeping_and_deep_in_the_dead_zone_ends(motion: Motion, speed_mm_s: int) -> None:
    ends = moves(motion, any_robots(20), 12, speed_mm_s)
    assert max(ends.way_mm) <= 5


def test_a_paused_move_ends_where_it_would_have(motion: Motion) -> None:
    for pause_at in (20, 150, 400):
        ends = Ends()
        for robot in unequal_robots(40):
            rig = motion.rig(robot)
            seconds = rig.move(500, 300, pause_at)
            ends.add(rig.way_mm - 500, rig.heading_deg, seconds)
        ends.table(f"paused at tick {pause_at}")
        assert max(ends.way_mm) <= 5
        assert max(ends.heading_deg) <= A_COUNT_DEG


def test_out_and_back_ends_where_it_began(motion: Motion) -> None:
    ends = Ends()
    for robot in unequal_robots(60):
        rig = motion.rig(robot)
        seconds = [rig.move(400, 300), rig.turn(3142, 2000), rig.turn(-3142, 2000), rig.move(-400, 300)]
        assert None not in seconds
        ends.add(rig.way_mm, rig.heading_deg, seconds[-1])
    ends.table("out and back")
    assert max(ends.way_mm) <= 5
    assert max(ends.heading_deg) <= 1  # after four moves
