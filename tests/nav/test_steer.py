"""Steering: to the goal, never forward into anything nearer than the clearance, and always with a reason."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from host.nav.ahead import ONTO_BLIND_CM, look_ahead, speed_ahead
from host.nav.config import BodyConfig, NavConfig
from host.nav.intent import Plan
from host.nav.look import STEP_BACK_CM
from host.nav.map import FREE, LIMIT, LOOKED_OVER, OCCUPIED, Obstacle, ObstacleMap
from host.nav.mover import Mover, Sight
from host.nav.odometry import body_of, heading_of
from host.nav.plan import find_way, room_around
from host.nav.stand import AT_BORDER
from host.nav.steer import decide
from host.pose import Pose

BODY, CONFIG = BodyConfig(), NavConfig()


def open_floor() -> ObstacleMap:
    """A map on which everything was seen to be free."""
    floor = ObstacleMap(BODY, CONFIG)
    floor.evidence[:] = 2 * FREE
    return floor


def put(obstacle_map: ObstacleMap, x0: float, z0: float, x1: float, z1: float, region: int = 7) -> None:
    """Fill a rectangle, as a region that was measured there."""
    row0, col0 = obstacle_map.cell_of(x0, z0)
    row1, col1 = obstacle_map.cell_of(x1, z1)
    obstacle_map.evidence[row0 : row1 + 1, col0 : col1 + 1] = LIMIT
    obstacle_map.region[row0 : row1 + 1, col0 : col1 + 1] = region
    obstacle_map.obstacles[region] = Obstacle(region, z0, 1.2, "area", (x0, z0), (x1, z0), 0.0)


def camera(x: float, z: float, heading: float, t_s: float = 0.0) -> Pose:
    """Pose of the camera when the axle's middle stands at (x, z)."""
    ahead = BODY.camera_ahead_cm
    return Pose.planar(x + ahead * math.sin(heading), z + ahead * math.cos(heading), heading, t_s=t_s)


def test_on_open_floor_it_drives_straight_at_full_speed():
    command, _ = decide(Plan(begun=True), open_floor(), camera(0, 0, 0), (0, 200))
    assert command.v_mm_s == 10 * CONFIG.speed_cm_s
    assert command.omega_rad_s == 0
    assert command.reason.startswith("straight")


def test_the_first_steps_go_straight_and_slowly_whatever_the_goal():
    command, plan = decide(Plan(), open_floor(), camera(0, 0, 0), (200, 0))
    assert command.v_mm_s == 10 * CONFIG.creep_cm_s
    assert command.omega_rad_s == 0
    command, plan = decide(plan, open_floor(), camera(0, 6, 0, 0.8), (200, 0))
    assert command.omega_rad_s > 0


def test_there_are_no_first_steps_towards_something_near():
    floor = open_floor()
    put(floor, -40, 28, 40, 40)
    command, _ = decide(Plan(), floor, camera(0, 0, 0), (0, 200))
    assert command.v_mm_s == 0


def test_over_floor_it_has_only_looked_over_it_creeps():
    looked_over = ObstacleMap(BODY, CONFIG)
    looked_over.evidence[:] = LOOKED_OVER
    command, _ = decide(Plan(begun=True), looked_over, camera(0, 0, 0), (0, 200))
    assert 0 < command.v_mm_s <= 10 * CONFIG.creep_cm_s
    assert command.reason.startswith("creep")


@pytest.mark.parametrize("side", [1, -1])
def test_where_it_never_looked_beside_its_way_it_turns_to_look_and_then_goes(side: int):
    floor = open_floor()
    floor.evidence[floor.cell_of(side * 9, 17)] = 0.0
    command, plan = decide(Plan(begun=True), floor, camera(0, 0, 0), (0, 200))
    assert command.v_mm_s == 0
    assert command.omega_rad_s * side > 0
    assert "never looked at the floor there" in command.reason
    floor.evidence[floor.cell_of(side * 9, 17)] = LOOKED_OVER
    for k in range(10):
        command, plan = decide(plan, floor, camera(0, 0, 0, 0.1 * k), (0, 200))
    assert command.v_mm_s > 0


def test_what_hides_floor_that_it_looks_right_at_counts_as_filled():
    floor, heading, plan = open_floor(), 0.0, Plan(begun=True)
    cell = floor.cell_of(9, 17)
    for k in range(60):
        floor.evidence[cell] = 0.0 if floor.evidence[cell] <= OCCUPIED else floor.evidence[cell]
        command, plan = decide(plan, floor, camera(0, 0, heading, 0.1 * k), (0, 200))
        heading += 0.1 * command.omega_rad_s
        assert command.v_mm_s == 0 or floor.evidence[cell] > OCCUPIED
        assert command.v_mm_s > 0 or command.omega_rad_s != 0  # it looks without standing about
    assert floor.evidence[cell] > OCCUPIED
    assert command.v_mm_s > 0  # another way


def test_what_stayed_hidden_is_not_looked_at_again_and_again_from_one_place():
    floor, heading, plan, t_s = open_floor(), 0.0, Plan(begun=True), 0.0
    x, z = np.meshgrid(floor.centres_cm, floor.centres_cm)
    away = np.hypot(x, z)
    ring = (away > BODY.radius_cm + CONFIG.cell_cm) & (away < 30) & ((z > 0) | (np.abs(x) > 20))
    command = None
    while t_s < 60 and (command is None or command.v_mm_s == 0):
        floor.evidence[ring] = 0.0  # who looks elsewhere sees that nothing stands there, and not the floor
        command, plan = decide(plan, floor, camera(0, 0, heading, t_s), (0, 200))
        heading += 0.1 * command.omega_rad_s
        t_s += 0.1
    assert command is not None and command.v_mm_s > 0
    assert abs(math.remainder(heading - math.pi, 2 * math.pi)) < math.radians(60)


def test_the_rim_never_goes_onto_floor_it_never_looked_at():
    floor = open_floor()
    row, col = floor.cell_of(0, 40)
    floor.evidence[row:] = 0.0
    border = float(floor.centres_cm[row]) - CONFIG.cell_cm / 2
    gap, v = 20.0, 1.0
    while v > 0.0:
        ahead = look_ahead(floor, float(floor.centres_cm[col]), border - BODY.radius_cm - gap, 0.0)
        v, reason = speed_ahead(ahead, floor)
        gap -= 0.1 * v
    assert -ONTO_BLIND_CM < gap < 0.0
    assert reason == "stop: never looked at the floor at the rim"


def test_where_nobody_set_it_down_the_first_steps_end_where_it_never_looked():
    floor, plan, z, command = ObstacleMap(BODY, CONFIG), Plan(set_down=False), 0.0, None
    floor.stand_on(0, 0)
    blind_cm = look_ahead(floor, 0, 0, 0.0).blind_cm
    for k in range(40):
        command, plan = decide(plan, floor, camera(0, z, 0, 0.05 * k), (0, 200))
        if command.v_mm_s <= 0:
            break
        assert "first steps" in command.reason
        z += 0.005 * command.v_mm_s
    assert 2.0 < z < blind_cm + ONTO_BLIND_CM + 0.1


def first_steps_cm(room_cm: float | None, how: str = AT_BORDER) -> float:
    """How far it goes before it turns elsewhere where nobody set it down; something stands so far on."""
    floor, plan, z = ObstacleMap(BODY, CONFIG), Plan(set_down=False), 0.0
    if room_cm is not None:
        put(floor, -20, BODY.radius_cm + room_cm, 20, BODY.radius_cm + room_cm + 20)
        floor.obstacles[7] = replace(floor.obstacles[7], how=how)
    for k in range(40):
        floor.stand_on(0, z)
        command, plan = decide(plan, floor, camera(0, z, 0, 0.05 * k), (200, 0))
        if command.v_mm_s <= 0:
            break
        z += 0.005 * command.v_mm_s
    return z


def test_where_nobody_set_it_down_the_first_steps_are_less_than_the_clearance_that_it_stopped_with():
    overrun_cm = 1.2  # until it stands
    assert 2.0 < first_steps_cm(None) + overrun_cm <= CONFIG.clearance_cm + 0.1
    assert first_steps_cm(17.0, "foot") > 2.0


def test_where_nobody_set_it_down_no_step_leads_towards_what_has_its_foot_below_the_picture():
    assert first_steps_cm(17.0) == 0.0


def test_where_it_is_shut_in_right_at_the_rim_it_looks_all_round_once_and_says_why_it_ends():
    floor, heading, plan, t_s, command = open_floor(), 0.0, Plan(begun=True), 0.0, None
    for x, z in [(-5, 20), (-10, 15), (0, 20), (15, 0), (15, -10), (-5, -15), (-15, 0), (10, 15)]:
        floor.evidence[floor.cell_of(x, z)] = LIMIT
    while t_s < 30 and (command is None or command.outcome is None):
        command, plan = decide(plan, floor, camera(0, 0, heading, t_s), (0, 200))
        assert command.v_mm_s == 0
        heading += 0.1 * command.omega_rad_s
        t_s += 0.1
    assert command is not None and command.outcome == "blocked"
    assert "looking around" in command.reason


def test_a_goal_to_the_right_is_turned_to_in_place_and_to_the_right():
    command, _ = decide(Plan(begun=True), open_floor(), camera(0, 0, 0), (200, 0))
    assert command.v_mm_s == 0
    assert command.omega_rad_s > 0


def test_the_goal_is_reached_when_the_camera_is_within_the_tolerance():
    command, _ = decide(Plan(begun=True), open_floor(), camera(0, 100, 0), (3, 117))
    assert command.outcome == "goal"
    assert command.v_mm_s == command.omega_rad_s == 0


def test_the_reason_names_region_depth_and_sigma():
    floor = open_floor()
    put(floor, -60, 40, 60, 50, region=12)
    command, _ = decide(Plan(begun=True), floor, camera(0, 0, 0), (0, 200))
    assert "region 12 at 40 ±1.2 cm (area)" in command.reason


def test_a_ring_without_a_gap_is_called_blocked_after_looking_all_round():
    floor = open_floor()
    for rectangle in [(-80, -80, 80, -70), (-80, 70, 80, 80), (-80, -80, -70, 80), (70, -80, 80, 80)]:
        put(floor, *rectangle)
    plan, heading, t, outcome, moved = Plan(begun=True), 0.0, 0.0, None, 0.0
    x = z = 0.0
    while outcome is None and t < 60:
        command, plan = decide(plan, floor, camera(x, z, heading, t), (0, 200))
        outcome = command.outcome
        t += 0.1
        heading += command.omega_rad_s * 0.1
        x += command.v_mm_s / 100 * math.sin(heading)
        z += command.v_mm_s / 100 * math.cos(heading)
        moved = max(moved, math.hypot(x, z))
    assert outcome == "blocked"
    assert "looking around" in command.reason
    assert moved < 70 - BODY.radius_cm


def test_a_side_once_chosen_is_kept_while_turning():
    floor = open_floor()
    put(floor, -30, 40, 30, 60)
    plan, heading, signs = Plan(begun=True), 0.0, []
    for k in range(40):
        command, plan = decide(plan, floor, camera(0, 0, heading, k / 10), (0, 200))
        if command.v_mm_s > 0:
            break
        signs.append(np.sign(command.omega_rad_s))
        heading += command.omega_rad_s / 10
    assert len(set(signs) - {0}) == 1


cells = st.tuples(st.floats(-90, 90), st.floats(-90, 90), st.floats(0, 40), st.floats(0, 40))


@given(
    st.lists(cells, min_size=1, max_size=8), st.floats(-math.pi, math.pi), st.floats(-150, 150),
    st.floats(20, 200),
)  # fmt: skip
@settings(max_examples=150, deadline=None)
def test_it_never_goes_forward_into_anything_nearer_than_the_clearance(boxes, heading, goal_x, goal_z):
    floor = open_floor()
    for x, z, w, d in boxes:
        put(floor, x, z, x + w, z + d)
    pose = camera(0, 0, heading)
    plan = Plan(begun=True)
    for k in range(3):
        pose = camera(0, 0, heading, t_s=k * 0.7)
        command, plan = decide(plan, floor, pose, (goal_x, goal_z))
        if command.v_mm_s <= 0:
            continue
        x, z, at = body_of(pose, BODY.camera_ahead_cm)
        points = floor.points_where(floor.occupied) - (x, z)
        along = points @ (math.sin(at), math.cos(at))
        aside = np.abs(points @ (math.cos(at), -math.sin(at)))
        # cells the disc would meet head-on; nearer than the clearance none may be, and it must brake in time
        met = (along > 0) & (aside < BODY.radius_cm)
        gap = along[met] - np.sqrt(BODY.radius_cm**2 - aside[met] ** 2)
        v = command.v_mm_s / 10
        brake = v * CONFIG.reaction_s + v * v / (2 * CONFIG.brake_cm_s2)
        if met.any():
            assert gap.min() > CONFIG.clearance_cm + brake - 1e-6


@given(st.floats(-math.pi, math.pi), st.floats(20, 120), st.floats(-0.9, 0.9))
@settings(max_examples=60)
def test_the_room_ahead_is_the_distance_the_rim_can_go(heading, distance, aside_share):
    floor = open_floor()
    aside = aside_share * BODY.radius_cm
    x = distance * math.sin(heading) + aside * math.cos(heading)
    z = distance * math.cos(heading) - aside * math.sin(heading)
    row, col = floor.cell_of(x, z)
    floor.evidence[row, col] = LIMIT
    room = look_ahead(floor, 0.0, 0.0, heading).room_cm
    cx, cz = floor.point_of(row, col)
    along = cx * math.sin(heading) + cz * math.cos(heading)
    off = abs(cx * math.cos(heading) - cz * math.sin(heading))
    assume(off < BODY.radius_cm)
    touch = along - math.sqrt(BODY.radius_cm**2 - off**2)
    assert touch - 1.5 * CONFIG.cell_cm - 6 <= room <= touch


def test_the_way_leads_through_a_gap_that_is_wide_enough_and_not_through_a_narrow_one():
    wide = open_floor()
    put(wide, -400, 100, -25, 105)
    put(wide, 25, 100, 400, 105)
    way = find_way(wide, room_around(wide), (0, 0), (0, 200), 0.0)
    assert way.to_goal
    crossing = [x for x, z in way.points if 95 < z < 110]
    assert max(map(abs, crossing)) < 12

    narrow = open_floor()
    put(narrow, -400, 100, -10, 105)
    put(narrow, 10, 100, 400, 105)
    way = find_way(narrow, room_around(narrow), (0, 0), (0, 200), 0.0)
    assert not way.to_goal
    assert way.points[-1][1] < 100 - BODY.radius_cm


def test_the_body_stands_behind_the_camera_it_carries():
    pose = camera(5.0, -3.0, 0.7)
    assert np.allclose(body_of(pose, BODY.camera_ahead_cm), (5.0, -3.0, 0.7))
    assert heading_of(pose) == np.float64(0.7) or math.isclose(heading_of(pose), 0.7)


def test_off_the_map_is_neither_seen_nor_open():
    half = open_floor().half_cm
    for heading in (0.0, math.pi / 2, math.pi, -math.pi / 2):
        ahead = look_ahead(
            open_floor(), (half - 50) * math.sin(heading), (half - 50) * math.cos(heading), heading
        )
        assert ahead.edge and str(ahead) == "the edge of the map"
        assert abs(ahead.room_cm - (50 - BODY.radius_cm)) < 1e-6
        assert abs(ahead.unseen_cm - ahead.room_cm) < 1e-6
    assert not look_ahead(open_floor(), 0, half - 50, math.pi).edge  # on the way back


def test_it_stops_before_the_edge_of_the_map_and_plans_no_way_along_it():
    half = open_floor().half_cm
    command, _ = decide(
        Plan(begun=True), open_floor(), camera(0, half - BODY.radius_cm - 2, 0), (60, half - 1)
    )
    assert command.v_mm_s == 0
    assert room_around(open_floor()).to_filled[-1].max() <= CONFIG.cell_cm


def drive_on(plan: Plan, floor: ObstacleMap, goal: tuple[float, float], seconds: float):
    """An ideal robot from the start over a map that does not change: its last command, and when it ended."""
    x = z = heading = t = 0.0
    command = None
    while t < seconds:
        command, plan = decide(plan, floor, camera(x, z, heading, t), goal)
        if command.outcome is not None:
            break
        t += 0.05
        heading += command.omega_rad_s * 0.05
        x += command.v_mm_s / 200 * math.sin(heading)
        z += command.v_mm_s / 200 * math.cos(heading)
    return command, t


def test_before_what_may_be_much_nearer_it_creeps_and_says_what_it_doubts():
    floor = open_floor()
    put(floor, -60, 60, 60, 70, region=12)
    sure, _ = speed_ahead(look_ahead(floor, 0.0, 0.0, 0.0), floor)
    floor.obstacles[12] = replace(floor.obstacles[12], sigma_cm=24.0)
    v, reason = speed_ahead(look_ahead(floor, 0.0, 0.0, 0.0), floor)
    assert sure == CONFIG.speed_cm_s
    assert v == CONFIG.creep_cm_s
    assert reason.startswith("creep: region 12 at 60 ±24.0 cm (area)") and "parallax" in reason


def test_a_covered_goal_is_called_blocked_by_what_covers_it_without_looking_all_around():
    floor = open_floor()
    put(floor, -30, 100, 30, 150, region=9)
    command, t = drive_on(Plan(begun=True), floor, (0, 125), 60.0)
    assert command.outcome == "blocked"
    assert "the goal is covered by region 9" in command.reason
    assert t < 12.0


def test_from_a_goal_covered_by_what_is_below_the_picture_it_steps_back_once_to_see_it():
    floor = open_floor()
    put(floor, -60, 62, 60, 120, region=9)
    floor.obstacles[9] = replace(floor.obstacles[9], how=AT_BORDER)
    plan, z, goal = Plan(begun=True), 39.5, (0, 90)
    command, plan = decide(plan, floor, camera(0, z, 0, 0.0), goal)
    for k in range(1, 200):
        if command.v_mm_s >= 0:
            break
        assert command.reason == "stepping back to see what covers the goal"
        z += command.v_mm_s / 200
        command, plan = decide(plan, floor, camera(0, z, 0, 0.05 * k), goal)
    assert 0.0 < z - (39.5 - STEP_BACK_CM) < 5.0

    command, _ = decide(replace(plan, made_s=-math.inf), floor, camera(0, 39.5, 0, 20.0), goal)
    assert command.v_mm_s == 0 and "covered by region 9" in command.reason  # no second time
    floor.evidence[floor.evidence > 0.0] = 2 * FREE  # from there it sees that nothing stands there
    command, _ = decide(replace(plan, made_s=-math.inf), floor, camera(0, z, 0, 20.0), goal)
    assert command.v_mm_s > 0


def test_a_goal_too_near_the_edge_of_the_map_is_called_blocked_by_the_edge():
    small = ObstacleMap(BODY, replace(CONFIG, map_half_cm=150.0))
    small.evidence[:] = 2 * FREE
    put(small, 100, 100, 130, 130)
    command, _ = drive_on(Plan(begun=True), small, (149, 149), 60.0)
    assert command.outcome == "blocked"
    assert "the edge of the map; set nav.map_half_cm" in command.reason


def test_a_way_is_found_over_blocks_as_well_as_over_cells_where_it_only_just_fits():
    for gap in (21.0, 23.0, 26.0, 31.0):
        floor = open_floor()
        put(floor, -400, 100, -gap, 140)
        put(floor, gap, 100, 400, 140)
        room = room_around(floor)
        way = find_way(floor, room, (0, 0), (0, 200), 0.0)
        inside = [room.to_filled[floor.cell_of(x, z)] for x, z in way.points if 95 < z < 145]
        assert way.to_goal
        assert min(inside) >= BODY.radius_cm


def moving(x: float, z: float, vx: float, vz: float) -> Mover:
    """Something 16 cm wide that was seen to move, last at time 0 here; nobody knows where it turns round."""
    speed = math.hypot(vx, vz)
    sight = Sight(0.0, x, z, (0.0, 1.0), z)
    return Mover(5, 0.0, (x, z), (vx / speed, vz / speed), 0.0, speed, 8.0, (sight,), (0.0, 0.0), seen=12)


def test_it_steps_back_from_what_comes_straight_at_it_and_stands_where_it_cannot():
    floor = open_floor()
    floor.movers = [moving(0, 63, 0.0, -15.0)]
    command, _ = decide(Plan(begun=True), floor, camera(0, 0, 0, 0.1), (0, 200))
    assert command.v_mm_s < 0 and "region 5" in command.reason and "stepping back" in command.reason
    put(floor, -40, -30, 40, -20)
    command, _ = decide(Plan(begun=True), floor, camera(0, 0, 0, 0.1), (0, 200))
    assert command.v_mm_s == 0 and "region 5" in command.reason and "giving way" in command.reason


def test_what_moves_where_the_robot_does_not_go_is_not_waited_for():
    floor = open_floor()
    floor.movers = [moving(100, 60, 0.0, 12.0)]
    command, _ = decide(Plan(begun=True), floor, camera(0, 0, 0, 0.1), (0, 200))
    assert command.v_mm_s == 10 * CONFIG.speed_cm_s


def test_before_the_line_of_what_has_left_the_view_it_stands_and_says_what_for():
    floor = open_floor()
    floor.movers = [moving(-40, 75, -15.0, 0.0)]  # it went off to the left, and may turn round at any time
    command, _ = decide(Plan(begun=True), floor, camera(0, 12, 0, 1.0), (0, 200))
    assert command.v_mm_s == 0 and "region 5 (foot, moving) at 15 cm/s crosses ahead" in command.reason


def test_what_moves_nobody_knows_where_to_is_waited_for_with_patience_that_ends():
    floor = open_floor()
    plan, went_s = Plan(begun=True), None
    for k in range(100):
        t_s = k / 15
        floor.obstacles[5] = Obstacle(5, 50.0, 1.0, "foot", (-8, 50), (8, 50), t_s, moving=True)
        command, plan = decide(plan, floor, camera(0, 0, 0, t_s), (0, 200))
        if command.v_mm_s > 0:
            went_s = t_s
            break
        assert "region 5" in command.reason and "giving way" in command.reason
    assert went_s is not None and 3.0 < went_s < 6.0


def test_a_way_once_chosen_is_left_only_for_one_that_is_clearly_quicker():
    for left_end, kept in ((-30, True), (-160, False)):  # left is hardly longer than right, or much longer
        floor, only_left = open_floor(), open_floor()
        put(floor, left_end, 60, 30, 80)
        put(only_left, left_end, 60, 400, 80)
        way = find_way(only_left, room_around(only_left), (0, 0), (10, 200), 0.0)
        assert way.to_goal and min(x for x, _ in way.points) < left_end
        _, plan = decide(Plan(begun=True, way=way), floor, camera(0, 0, 0, 5.0), (10, 200))
        assert plan.way is not None
        assert (min(x for x, _ in plan.way.points) < left_end) == kept


def test_what_moves_with_its_foot_below_the_picture_is_not_driven_up_to():
    """It shows at the border however near it is; a robot that went on as far as that touched it."""
    floor = open_floor()
    put(floor, -12, 45, 12, 50)
    at_border = Obstacle(7, 34.0, 8.5, AT_BORDER, (-12, 45), (12, 45), 0.0, moving=True)
    floor.obstacles[7] = at_border
    v, reason = speed_ahead(look_ahead(floor, 0.0, 0.0, 0.0), floor)
    assert v == 0.0 and "or nearer" in reason
    floor.obstacles[7] = replace(at_border, how="foot")
    assert speed_ahead(look_ahead(floor, 0.0, 0.0, 0.0), floor)[0] > 0.0
