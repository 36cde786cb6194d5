"""The table of many worlds counts what is true, not what the robot says of itself."""

from __future__ import annotations

from typing import Any

import pytest

from bench.nav import THERE_CM, figures_of_worlds


def drive(outcome: str, off_cm: float | None, has_path: bool = True) -> dict[str, Any]:
    return {
        "outcome": outcome,
        "has_path": has_path,
        "final_pose_error": None if off_cm is None else {"position_cm": off_cm, "heading_deg": 0.0},
        "true_distance_cm": 200.0,
        "duration_s": 20.0,
        "stops": [],
        "collisions": 0,
        "min_clearance_cm": 5.0,
        "refused_frames": 0,
        "depths": [],
        "fronts": [],
    }


def test_a_goal_that_the_robot_is_not_at_is_not_reached_whatever_it_says():
    drives = [drive("goal", 2.0), drive("goal", THERE_CM + 1), drive("time", 1.0), drive("goal", None)]
    figures = figures_of_worlds(drives)
    assert figures["reached_percent"] == 25.0
    assert figures["elsewhere"] == 2


def test_a_world_without_a_way_counts_for_collisions_alone():
    figures = figures_of_worlds([drive("goal", 1.0), drive("blocked", 1.0, has_path=False)])
    assert figures["drives"] == 2
    assert figures["with_a_way"] == 1
    assert figures["reached_percent"] == 100.0


def test_depths_driven_by_are_those_on_the_map_and_walls_and_mere_motion_are_told_apart():
    def sample(true_cm: float, depth_cm: float, sigma_cm: float, background: bool = False) -> dict[str, Any]:
        error = 100 * (depth_cm / true_cm - 1)
        return {"background": background, "depth_cm": depth_cm, "sigma_cm": sigma_cm, "true_cm": true_cm,
                "error_percent": error}  # fmt: skip

    one = drive("goal", 1.0)
    one["fronts"] = [sample(100, 102, 1.5), sample(100, 110, 20), sample(100, 120, 5, background=True),
                     sample(100, 150, 60), sample(310, 305, 5)]  # fmt: skip
    one["depths"] = [sample(100, 130, 3)]
    figures = figures_of_worlds([one])
    assert [figures[key] for key in ("depths", "walls", "motions")] == [2, 1, 1]  # too vague, too far
    assert figures["depth_median_percent"] == pytest.approx(6.0)
    assert figures["depth_within_8_percent"] == 50.0
    assert figures["depth_within_1_sigma_percent"] == 50.0
    assert figures["depth_within_2_sigma_percent"] == 100.0
    assert figures["motion_median_percent"] == pytest.approx(30.0)
