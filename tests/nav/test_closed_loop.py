"""Odometry, map and steering together in a flat world: the goal is reached and nothing is touched."""

from __future__ import annotations

import pytest
from planar_world import LENS, Box, PlanarWorld, Shuttle, random_boxes

from host.nav.command import Command
from host.nav.config import NavConfig
from host.nav.intent import Plan
from host.nav.map import ObstacleMap
from host.nav.odometry import Odometry, WheelReading, body_of
from host.nav.steer import decide


def drive(
    world: PlanarWorld, goal_cm: tuple[float, float], max_s: float, plan: Plan | None = None
) -> tuple[Command, list[str]]:
    """Drive until the outcome or the time; the last command and all reasons."""
    odometry, obstacle_map, plan = Odometry(world.body), ObstacleMap(world.body, NavConfig()), plan or Plan()
    odometry.add(WheelReading(0.0, 0, 0, None, None))
    reasons = []
    while True:
        for reading in world.run(1 / world.fps):
            odometry.add(reading)
        pose = odometry.pose_at(world.t_s)
        x, z, _ = body_of(pose, world.body.camera_ahead_cm)
        obstacle_map.stand_on(x, z)
        obstacle_map.update(*world.see(), pose, LENS)
        command, plan = decide(plan, obstacle_map, pose, goal_cm)
        world.command = (command.v_mm_s / 10, command.omega_rad_s)
        reasons.append(command.reason)
        if command.outcome is not None or world.t_s > max_s:
            return command, reasons


@pytest.mark.parametrize("seed", range(1, 6))
def test_it_reaches_the_goal_between_random_boxes_and_touches_none(seed):
    world = PlanarWorld(random_boxes(seed), seed=seed)
    command, _ = drive(world, (0.0, 220.0), max_s=60.0)
    x, z = world.camera_xz()
    assert world.least_gap_cm > 1.0
    assert command.outcome == "goal"
    assert abs(x) < 12
    assert abs(z - 220) < 12


def test_with_a_crooked_wheel_and_depths_off_by_a_twentieth_nothing_is_touched():
    world = PlanarWorld(random_boxes(31, 8), seed=31, mismatch=0.03, depth_error=0.05)
    drive(world, (0.0, 220.0), max_s=60.0)
    assert world.least_gap_cm > 1.0


def test_behind_a_wall_from_side_to_side_the_goal_is_called_blocked_and_the_wall_not_touched():
    world = PlanarWorld([Box(-150, 120, 150, 130, 50)], seed=1, fps=6)
    command, reasons = drive(world, (0.0, 220.0), max_s=90.0)
    assert command.outcome == "blocked"
    assert world.least_gap_cm > 1.0
    assert any("region 10" in reason for reason in reasons)


@pytest.mark.parametrize(("begins_cm", "speed_cm_s"), [(-75.0, 9.0), (-90.0, 14.0)])
def test_what_crosses_ahead_is_given_way_to_and_then_the_robot_goes_on(begins_cm, speed_cm_s):
    shuttle = Shuttle(Box(begins_cm, 110, begins_cm + 16, 124, 30), 200.0, speed_cm_s)
    world = PlanarWorld([], seed=2, shuttles=(shuttle,), fps=15)
    command, reasons = drive(world, (0.0, 220.0), max_s=90.0)
    assert any("moving) at" in reason and "giving way" in reason for reason in reasons)
    assert command.outcome == "goal", reasons[-1]
    assert world.least_driving_gap_cm > 0.0


def test_what_stands_beside_the_camera_after_a_turn_is_looked_for_and_not_touched():
    world = PlanarWorld([Box(21, -60, 28, -21.5, 40)], room=(-150, -100, 260, 150), seed=3, fps=6)
    command, reasons = drive(world, (70.0, -12.0), max_s=30.0, plan=Plan(begun=True))
    assert world.least_gap_cm > 1.0
    assert command.outcome == "goal"
    assert any("never looked at the floor there" in reason for reason in reasons)
