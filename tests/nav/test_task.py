"""What a drive is for: routes, exploring, approaching, measuring only, in a flat world."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from planar_world import LENS, Box, PlanarWorld, random_boxes
from test_front import Columns

from host.nav.command import Command
from host.nav.config import BodyConfig, NavConfig
from host.nav.front import Sight
from host.nav.map import FREE, LIMIT, Obstacle, ObstacleMap
from host.nav.odometry import Odometry, WheelReading, body_of
from host.nav.picture import NO_REGION
from host.nav.stand import AT_BORDER
from host.nav.task import Approach, Explore, MeasureOnly, Route, Task
from host.pose import Pose


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


@pytest.mark.parametrize("seed", [1])
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


def obeyed(
    obstacle_map: ObstacleMap, task: Approach, x: float = 0.0, z: float = 0.0, most: int = 2400
) -> Iterator[tuple[Command, float]]:
    """Commands to an ideal robot that does as told, and where it is after each."""
    for k in range(most):
        command = task.decide(obstacle_map, Pose.planar(x, z, 0.0, t_s=k / 20))
        if command.outcome is None:
            z += command.v_mm_s / 10 / 20
        yield command, z
        if command.outcome is not None:
            return


def straight_on(obstacle_map: ObstacleMap, task: Approach, z: float) -> tuple[Command, float]:
    """The last command over a map that does not change, and where the robot is then."""
    *_, last = obeyed(obstacle_map, task, z=z, most=1200)
    return last


def seen_floor() -> ObstacleMap:
    floor = ObstacleMap(BodyConfig(), NavConfig())
    floor.evidence[:] = 2 * FREE
    return floor


def test_approaching_ends_at_the_edge_of_the_map_and_says_so():
    floor = seen_floor()
    command, z = straight_on(floor, Approach(20.0), floor.half_cm - 100)
    assert command.outcome == "blocked"
    assert command.reason == "at the edge of the map; set nav.map_half_cm"
    assert z < floor.half_cm


def fill(obstacle_map: ObstacleMap, front_cm: float, region: int) -> None:
    """Something 40 cm wide right ahead."""
    row, left = obstacle_map.cell_of(-20.0, front_cm)
    _, right = obstacle_map.cell_of(20.0, front_cm)
    obstacle_map.evidence[row : row + 3, left : right + 1] = LIMIT
    obstacle_map.region[row : row + 3, left : right + 1] = region


def test_approaching_stops_before_what_only_the_map_remembers():
    floor = seen_floor()
    fill(floor, 100.0, region=7)
    command, z = straight_on(floor, Approach(20.0), 0.0)
    assert command.outcome == "approached" and "something remembered" in command.reason
    assert 100 - z == pytest.approx(20, abs=1.5)


def test_what_is_only_known_to_be_nearer_than_the_border_is_no_place_to_approach():
    floor = seen_floor()
    fill(floor, 100.0, region=7)
    floor.obstacles[7] = Obstacle(7, 36.0, 9.0, AT_BORDER, (-20.0, 100.0), (20.0, 100.0), 0.0)
    command, z = straight_on(floor, Approach(20.0), 60.0)
    assert command.outcome == "blocked" and "foot is below the picture" in command.reason
    assert z < 66  # no further than the first steps


@pytest.mark.parametrize("half_width", [12.0, 14.0, 20.0])
def test_a_front_whose_foot_is_below_the_picture_does_not_move_along_with_the_robot(half_width):
    """Its far sides still show feet: they are no news of the front."""
    world = PlanarWorld([Box(-half_width, 100, half_width, 101, 60)], seed=1, depth_error=0.01)
    world.first_seen[10] = math.inf  # it never gets a depth of its own
    command, _, _, _ = drive(world, Approach(12.0), max_s=40.0)
    assert command.outcome == "approached"
    assert 100 - world.camera_xz()[1] == pytest.approx(12.0, abs=4.0)


def test_a_remembered_thing_that_is_gone_when_looked_at_again_does_not_end_an_approach():
    floor, task = seen_floor(), Approach(20.0)
    fill(floor, 100.0, region=7)
    z, farthest, reasons, command = 0.0, 0.0, [], Command(0.0, 0.0, "")
    for command, z in obeyed(floor, task):
        reasons.append(command.reason)
        farthest = max(farthest, z)
        if z < farthest - 25.0:  # now the camera sees that nothing stands there
            floor.evidence[:] = 2 * FREE
            fill(floor, 180.0, region=8)
    assert command.outcome == "approached"
    assert any("to look again" in reason for reason in reasons)
    assert 180 - z == pytest.approx(20, abs=1.5)


def test_an_approach_in_doubt_at_two_places_looks_again_at_each_and_creeps_there():
    floor, task, flecks_cm, doubted_cm = seen_floor(), Approach(20.0), [100.0, 200.0], []
    fill(floor, flecks_cm[0], region=7)
    z, farthest, said, command = 0.0, 0.0, [], Command(0.0, 0.0, "")
    for command, z in obeyed(floor, task):
        said.append(command.reason)
        if any(abs(z - place) < 35.0 for place in doubted_cm):
            assert command.v_mm_s <= 10 * NavConfig().creep_cm_s
        farthest = max(farthest, z)
        if flecks_cm and z < farthest - 25.0:  # now the camera sees that nothing stands there
            flecks_cm.pop(0)
            doubted_cm.append(farthest)
            farthest = z
            floor.evidence[:] = 2 * FREE
            fill(floor, flecks_cm[0] if flecks_cm else 280.0, region=7)
    assert command.outcome == "approached"
    assert 280 - z == pytest.approx(20, abs=1.5)
    began = [b for a, b in pairwise(said) if "look again" in b and "look again" not in a]
    assert len(began) == 3  # the last time it is there


def test_what_is_remembered_beside_the_robot_does_not_keep_it_from_stepping_back_the_way_it_came():
    floor, task, x = seen_floor(), Approach(20.0), 0.3
    fill(floor, 100.0, region=7)
    farthest, least = 0.0, math.inf
    for command, z in obeyed(floor, task, x, most=600):
        if "in doubt" in command.reason:
            for beside_z in range(int(z) - 20, int(z) + 10, 5):
                floor.evidence[floor.cell_of(17.5, beside_z)] = LIMIT
        farthest = max(farthest, z)
        if "look" in command.reason:
            least = min(least, z)
    assert farthest - least == pytest.approx(40.0, abs=2.0)


def test_what_appears_below_the_picture_again_where_looking_again_showed_floor_is_a_fleck_of_it():
    floor, task = seen_floor(), Approach(20.0)
    fill(floor, 100.0, region=7)
    floor.obstacles[7] = Obstacle(7, 36.0, 9.0, AT_BORDER, (-20.0, 100.0), (20.0, 100.0), 0.0)
    bare, nowhere = np.zeros(160, bool), np.full(160, NO_REGION)
    columns = Columns(np.full(160, 500.0), nowhere, bare)
    said, z = [], 0.0
    for k, (command, z) in enumerate(obeyed(floor, task)):
        said.append(command.reason)
        assert command.outcome is None
        camera = 0.0, z + floor.body.camera_ahead_cm
        floor.sight = Sight(columns, (), camera, 0.0, k / 20)  # type: ignore[arg-type]
        if z > 110.0:
            break
    assert z > 110.0
    assert any("looking again" in reason for reason in said)
