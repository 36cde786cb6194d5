"""What a drive is for: routes, exploring, approaching, measuring only, in a flat world."""

from __future__ import annotations

import math

import numpy as np
import pytest
from planar_world import LENS, Box, PlanarWorld, random_boxes

from host.nav.config import NavConfig
from host.nav.map import ObstacleMap
from host.nav.odometry import Odometry, WheelReading
from host.nav.steer import Command, body_of
from host.nav.task import Approach, Explore, MeasureOnly, Route, Task


def drive(world: PlanarWorld, task: Task, max_s: float) -> tuple[Command, list[str], ObstacleMap, np.ndarray]:
    """Drive until the outcome or the time; the last command, all reasons, the map, floor ever seen."""
    odometry, obstacle_map = Odometry(world.body), ObstacleMap(world.body, NavConfig())
    odometry.add(WheelReading(0.0, 0, 0, None, None))
    reasons, floor = [], obstacle_map.free
    while True:
        for reading in world.run(1 / world.fps):
            odometry.add(reading)
        pose = odometry.pose_at(world.t_s)
        x, z, _ = body_of(pose, world.body.camera_ahead_cm)
        obstacle_map.stand_on(x, z)
        obstacle_map.update(*world.see(), pose, LENS)
        floor = floor | obstacle_map.free
        command = task.decide(obstacle_map, pose)
        world.command = (command.v_mm_s / 10, command.omega_rad_s)
        reasons.append(command.reason)
        if command.outcome is not None or world.t_s > max_s:
            world.command = (0.0, 0.0)
            list(world.run(0.6))
            return command, reasons, obstacle_map, floor


def test_a_route_goes_to_its_goals_in_order_and_ends_at_the_last():
    world = PlanarWorld([Box(-20, 90, 10, 110)], seed=3)
    command, reasons, _, _ = drive(world, Route([(60.0, 120.0), (-60.0, 200.0)]), max_s=90.0)
    x, z = world.camera_xz()
    assert command.outcome == "goal"
    assert math.hypot(x + 60, z - 200) < 14
    assert sum("on to -60,200" in reason for reason in reasons) == 1
    assert world.least_gap_cm > 1.0


@pytest.mark.parametrize("seed", range(2))
def test_exploring_sees_nearly_all_floor_that_can_be_reached_and_touches_nothing(seed):
    world = PlanarWorld(random_boxes(40 + seed, 4), room=(-120.0, -60.0, 120.0, 220.0), seed=seed)
    command, _, obstacle_map, ever = drive(world, Explore(), max_s=240.0)
    assert world.least_gap_cm > 1.0
    assert command.outcome == "explored"
    x0, z0, x1, z1 = world.room
    reachable = [
        (x, z)
        for x in np.arange(x0 + 20, x1 - 20, 5.0)
        for z in np.arange(z0 + 20, z1 - 20, 5.0)
        if min(box.distance(x, z) for box in world.boxes) > 20
    ]
    seen = np.mean([ever[obstacle_map.cell_of(x, z)] for x, z in reachable])
    print(f"seed {seed}: {100 * seen:.0f} % of the floor seen in {world.t_s:.0f} s")
    assert seen > 0.9


@pytest.mark.parametrize("seed", range(8))
def test_approaching_stops_the_asked_distance_before_what_is_ahead(seed):
    rng = np.random.default_rng(seed)
    front, wanted = rng.uniform(70, 160), rng.uniform(12, 40)
    side = rng.uniform(-8, 8)
    world = PlanarWorld([Box(side - 18, front, side + 18, front + 20, 40)], seed=seed, depth_error=0.01)
    command, reasons, _, _ = drive(world, Approach(wanted), max_s=40.0)
    assert command.outcome == "approached", reasons[-1]
    _, z = world.camera_xz()
    rim = z - world.body.camera_ahead_cm + world.body.radius_cm
    assert front - rim == pytest.approx(wanted, abs=3.0)


def test_measuring_only_moves_nothing_and_names_what_is_ahead():
    world = PlanarWorld([Box(-20, 90, 20, 110)], seed=3)
    task, commands = MeasureOnly(), []
    odometry, obstacle_map = Odometry(world.body), ObstacleMap(world.body, NavConfig())
    odometry.add(WheelReading(0.0, 0, 0, None, None))
    for n in range(40):
        world.command = (10.0 if n < 20 else 0.0, 0.0)  # pushed by hand
        for reading in world.run(1 / world.fps):
            odometry.add(reading)
        pose = odometry.pose_at(world.t_s)
        obstacle_map.update(*world.see(), pose, LENS)
        commands.append(task.decide(obstacle_map, pose))
    assert all(one.v_mm_s == one.omega_rad_s == 0 and one.outcome is None for one in commands)
    assert "region 10 at" in commands[-1].reason and "cm from the rim" in commands[-1].reason
