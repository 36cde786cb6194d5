"""The body: motors that lag and differ, encoders that count every half centimetre, walls that stop it."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from host.camera.lens import Lens
from host.sim.board import Side
from host.sim.body import PHASES, STEP_US, Body, BodyModel
from host.sim.scenes import world_from_uri
from host.sim.things import Box, Material, Mover
from host.sim.world import Room, World

GREY = Material((128.0, 128.0, 128.0))
EQUAL = BodyModel(mismatch=0.0, sag_mv=0.0)


class FakeBoard:
    """Duties in, encoder edges out, without firmware."""

    def __init__(self) -> None:
        self.time_us = 0
        self.duties = {Side.LEFT: 0.0, Side.RIGHT: 0.0}
        self.edges: dict[Side, list[tuple[int, bool, bool]]] = {Side.LEFT: [], Side.RIGHT: []}
        self.battery_mv: list[int] = []
        self.open = False  # both motors, instead of shorted

    def coasting(self, side: Side) -> bool:
        return self.open

    def duty(self, side: Side) -> float:
        return self.duties[side]

    def set_encoder_pins(self, side: Side, a: bool, b: bool, at_us: int) -> None:
        self.edges[side].append((at_us, a, b))

    def set_battery_mv(self, mv: int) -> None:
        self.battery_mv.append(mv)

    def drive(self, body: Body, left: float, right: float, ms: int) -> None:
        self.duties = {Side.LEFT: left, Side.RIGHT: right}
        for _ in range(ms):
            body.step()
            self.time_us += STEP_US

    def counts(self, side: Side) -> int:
        """What an ideal decoder counts; every edge must be a step to a neighbouring phase."""
        count, phase = 0, 0
        for _, a, b in self.edges[side]:
            turn = (PHASES.index((a, b)) - phase) % 4
            assert turn in (1, 3)
            count += 1 if turn == 1 else -1
            phase = (phase + turn) % 4
        return count


def hall(*things: Box) -> World:
    """10 m wide and 20 m long, with nothing near the start but what is given."""
    room = Room(-500, 500, -300, 1700, 250, GREY, GREY, GREY, GREY, GREY, GREY, (0.0, 200.0, 0.0))
    return World("hall", room, things, 15.0, Lens(320, 240, 371.0, 371.0, 159.5, 119.5), (0.0, 200.0), 0)


def body_in(world: World, model: BodyModel = EQUAL, seed: int = 0) -> tuple[Body, FakeBoard]:
    board = FakeBoard()
    return Body(world, board, model, seed), board  # type: ignore[arg-type]


def test_speed_settles_at_what_the_duty_is_worth() -> None:
    body, board = body_in(hall())
    board.drive(body, 0.54, 0.54, 1000)
    assert body.speed_cm_s == pytest.approx(35.0, rel=1e-6)  # half of what lies above the dead zone


def test_a_motor_has_done_63_percent_of_a_change_after_its_time_constant() -> None:
    body, board = body_in(hall())
    board.drive(body, 0.54, 0.54, 50)
    assert body.speed_cm_s == pytest.approx(35.0 * (1 - math.exp(-1)), rel=1e-9)


@pytest.mark.parametrize("duty", [0.079, -0.079])
def test_duty_within_the_dead_zone_moves_nothing(duty: float) -> None:
    body, board = body_in(hall())
    board.drive(body, duty, duty, 500)
    assert body.distance_cm == 0.0 and not board.edges[Side.LEFT]


def test_a_wheel_without_power_comes_to_rest_for_good() -> None:
    body, board = body_in(hall())
    board.drive(body, 0.5, 0.5, 500)
    board.drive(body, 0.0, 0.0, 600)
    assert body.speed_cm_s == 0.0


def test_the_left_motor_is_three_percent_faster_at_equal_duty() -> None:
    body, board = body_in(hall(), BodyModel(sag_mv=0.0))
    board.drive(body, 0.3, 0.3, 3000)
    left, right = board.counts(Side.LEFT), board.counts(Side.RIGHT)
    assert left / right == pytest.approx(1.03, abs=0.015)  # a count of some 100 may be missing on each
    heading = math.asin(body.pose_at(board.time_us).rotation[0, 2])
    assert heading > 0  # to the right


def test_the_battery_sags_with_the_load_and_slows_the_motors() -> None:
    body, board = body_in(hall(), replace(EQUAL, sag_mv=300.0))
    board.drive(body, 1.0, 1.0, 1000)
    assert board.battery_mv[0] == 7400 and board.battery_mv[-1] == 7100
    assert body.speed_cm_s == pytest.approx(70.0 * 7100 / 7400, rel=1e-3)
    board.drive(body, 0.0, 0.0, 1)
    assert board.battery_mv[-1] == 7400


@pytest.mark.parametrize("seed", range(5))
def test_encoder_counts_are_the_distance_in_half_centimetres(seed: int) -> None:
    body, board = body_in(hall(), seed=seed)
    board.drive(body, 0.4, 0.4, 4000)
    assert body.distance_cm > 50
    for side in Side:
        assert abs(board.counts(side) - body.distance_cm / 0.5) < 1.0


def test_there_and_back_leaves_the_counts_where_the_wheels_are() -> None:
    body, board = body_in(hall())
    board.drive(body, 0.4, 0.3, 1300)
    board.drive(body, -0.5, -0.25, 1100)
    pose = body.pose_at(board.time_us)
    # Wheels alone say how far it turned: the difference of their ways over the track.
    heading = math.atan2(pose.rotation[0, 2], pose.rotation[2, 2])
    turned_cm = heading * EQUAL.track_cm
    assert abs(0.5 * (board.counts(Side.LEFT) - board.counts(Side.RIGHT)) - turned_cm) < 1.0


def test_edges_come_at_the_moment_the_wheel_is_there() -> None:
    body, board = body_in(hall())
    board.drive(body, 0.54, 0.54, 3000)
    steady = [t for t, _, _ in board.edges[Side.LEFT] if t > 1_000_000]
    gaps = [b - a for a, b in pairwise(steady)]
    assert len(gaps) > 100
    assert all(abs(gap - 0.5 / 35.0 * 1e6) <= 1.5 for gap in gaps)  # each edge is rounded to a microsecond


def test_edges_while_speeding_up_follow_the_motors_equation() -> None:
    body, board = body_in(hall())
    board.drive(body, 0.54, 0.54, 300)
    lag = EQUAL.lag_s

    def way(t: float) -> float:
        return 35.0 * (t - lag * (1 - math.exp(-t / lag)))

    ways = [way(t * 1e-6) for t, _, _ in board.edges[Side.LEFT]]
    assert len(ways) > 10
    assert all(b - a == pytest.approx(0.5, abs=1e-4) for a, b in pairwise(ways))


def test_edges_never_lie_before_the_board_has_got_there() -> None:
    body, board = body_in(hall())
    for _ in range(400):
        before = len(board.edges[Side.LEFT])
        now_us = board.time_us
        board.drive(body, 0.6, -0.6, 1)
        assert all(now_us <= t <= now_us + STEP_US for t, _, _ in board.edges[Side.LEFT][before:])


def test_turning_on_the_spot_swings_the_camera_round_the_axle() -> None:
    body, board = body_in(hall())
    board.drive(body, 0.3, -0.3, 500)
    pose = body.pose_at(board.time_us)
    heading = math.atan2(pose.rotation[0, 2], pose.rotation[2, 2])
    assert heading > 0.1 and body.distance_cm == pytest.approx(0.0, abs=1e-9)
    assert pose.position_cm == pytest.approx([12 * math.sin(heading), 0, 12 * math.cos(heading) - 12])


def test_poses_between_steps_lie_between_them() -> None:
    body, board = body_in(hall())
    board.drive(body, 0.54, 0.54, 1000)
    a, b, c = (body.pose_at(900_000 + us).position_cm[2] for us in (0, 500, 1000))
    assert a < b < c and b == pytest.approx((a + c) / 2, abs=1e-6)


@pytest.mark.parametrize("t_us", [-1, 500_001, 1_000_000])
def test_a_pose_of_no_known_time_is_refused(t_us: int) -> None:
    body, board = body_in(hall())
    board.drive(body, 0.0, 0.0, 500)
    with pytest.raises(ValueError, match="no pose is known"):
        body.pose_at(t_us)


def test_a_box_ahead_stops_the_body_at_its_rim_and_counts_once() -> None:
    body, board = body_in(hall(Box("box", 0.0, 60.0, 40.0, 20.0, 30.0, 0.0, GREY)))
    board.drive(body, 0.4, 0.4, 6000)
    centre_z = body.pose_at(board.time_us).position_cm[2] - EQUAL.camera_ahead_cm
    assert body.collisions == 1
    assert centre_z == pytest.approx(50 - EQUAL.radius_cm, abs=0.1)  # front face at 50 cm
    assert body.min_clearance_cm == 0.0


def test_backing_off_is_free_and_the_next_touch_counts_again() -> None:
    body, board = body_in(hall(Box("box", 0.0, 60.0, 40.0, 20.0, 30.0, 0.0, GREY)))
    board.drive(body, 0.4, 0.4, 5000)
    board.drive(body, -0.4, -0.4, 1000)
    assert body.pose_at(board.time_us).position_cm[2] < 45
    board.drive(body, 0.4, 0.4, 3000)
    assert body.collisions == 2


def test_passing_by_measures_the_clearance_to_a_millimetre() -> None:
    body, board = body_in(hall(Box("box", 30.0, 40.0, 20.0, 20.0, 30.0, 0.0, GREY)))
    board.drive(body, 0.5, 0.5, 4000)
    assert body.pose_at(board.time_us).position_cm[2] > 80
    assert body.collisions == 0
    assert body.min_clearance_cm == pytest.approx(20 - EQUAL.radius_cm, abs=0.1)  # its side is at x = 20


@pytest.mark.parametrize("seed", range(20))
def test_no_room_can_be_left_through_its_walls(seed: int) -> None:
    world = world_from_uri(f"sim:room?seed={seed}")
    body, board = body_in(world, seed=seed)
    board.drive(body, 1.0, 0.9, 8000)
    pose = body.pose_at(board.time_us)
    centre = pose.position_cm - EQUAL.camera_ahead_cm * pose.rotation[:, 2]
    assert body.collisions >= 1
    assert world.distance_cm(centre[[0, 2]])[0] >= EQUAL.radius_cm - 0.1


def test_wheels_of_hidden_sizes_roll_further_than_the_counts_say() -> None:
    body, board = body_in(hall(), replace(EQUAL, left_wheel=1.02, right_wheel=0.99, true_track=1.04))
    board.drive(body, 0.5, 0.4, 2000)
    left, right = (0.5 * board.counts(side) for side in Side)  # cm, as the robot believes
    _, _, heading = body.axle
    assert body.distance_cm == pytest.approx((1.02 * left + 0.99 * right) / 2, abs=0.5)
    assert heading == pytest.approx((1.02 * left - 0.99 * right) / (1.04 * 15), abs=1 / 15)


def test_a_larger_wheel_on_the_same_motor_is_as_much_faster() -> None:
    body, board = body_in(hall(), replace(EQUAL, left_wheel=1.05))
    board.drive(body, 0.54, 0.54, 1000)
    assert body.wheel_speeds_cm_s == pytest.approx((1.05 * 35.0, 35.0))
    assert abs(board.counts(Side.LEFT) - board.counts(Side.RIGHT)) <= 1  # the motors turn alike


def test_edges_off_their_places_are_off_alike_at_every_fourth() -> None:
    body, board = body_in(hall(), replace(EQUAL, phase_error=0.1))
    board.drive(body, 0.54, 0.54, 3000)
    steady = [t for t, _, _ in board.edges[Side.LEFT] if t > 1_000_000]
    gaps = [(b - a) * 35e-6 / 0.5 for a, b in pairwise(steady)]  # in counts
    assert max(gaps) - min(gaps) > 0.05 and all(0.8 <= gap <= 1.2 for gap in gaps)
    assert all(a == pytest.approx(b, abs=1e-3) for a, b in zip(gaps, gaps[4:], strict=False))


def test_edges_off_their_places_are_the_same_ones_there_and_back() -> None:
    body, board = body_in(hall(), replace(EQUAL, phase_error=0.3, mismatch=0.0))
    board.drive(body, 0.4, 0.4, 700)
    board.drive(body, -0.4, -0.4, 1500)
    assert abs(board.counts(Side.LEFT) - body.axle[1] / 0.5 - 24) < 1.6  # it began at z = -12 cm


def test_an_open_motor_rolls_on_where_a_shorted_one_stops() -> None:
    ways = {}
    for coasts in (False, True):
        body, board = body_in(hall())
        board.drive(body, 0.6, 0.6, 1000)
        speed, before = body.speed_cm_s, body.distance_cm
        board.open = coasts
        board.drive(body, 0.0, 0.0, 4000)
        assert body.speed_cm_s == 0.0
        ways[coasts] = body.distance_cm - before
        lag_s = EQUAL.coast_s if coasts else EQUAL.lag_s
        # A shorted one: dv/dt = -(v + f) / lag until it stands; f is the speed that the dead zone takes.
        f = 0.0 if coasts else EQUAL.full_speed_cm_s * EQUAL.dead_zone / (1.0 - EQUAL.dead_zone)
        way = lag_s * (speed - (f * math.log(1.0 + speed / f) if f else 0.0))
        assert ways[coasts] == pytest.approx(way, rel=0.02)
    assert ways[True] > 5 * ways[False]


def test_a_shorted_motor_stands_still_within_a_tenth_of_a_second() -> None:
    body, board = body_in(hall())
    board.drive(body, 0.35, 0.35, 1000)
    assert 15.0 < body.speed_cm_s < 25.0
    board.drive(body, 0.0, 0.0, 100)
    assert body.speed_cm_s == 0.0


def hall_with_mover(nearest_z_cm: float) -> World:
    """A box comes from 1 m ahead, its front no further than given, and goes back again, at 20 cm/s."""
    box = Box("box", 0.0, 105.0, 10.0, 10.0, 30.0, 0.0, GREY)
    return replace(hall(), movers=(Mover(box, (0.0, nearest_z_cm + 5.0), 20.0),))


def test_the_clearance_is_measured_also_while_the_robot_stands() -> None:
    body, board = body_in(hall_with_mover(3.0))
    board.drive(body, 0.0, 0.0, 6000)
    assert (body.collisions, body.run_into) == (0, 0)
    assert body.min_clearance_cm == pytest.approx(3.0, abs=0.25)


@pytest.mark.parametrize("duty", [0.0, 0.3])
def test_a_mover_that_runs_into_a_robot_that_stands_or_turns_is_not_its_collision(duty: float) -> None:
    body, board = body_in(hall_with_mover(-8.0))
    board.drive(body, duty, -duty, 9000)
    assert (body.collisions, body.run_into) == (0, 1)
    assert body.min_clearance_cm == 0.0
    board.drive(body, duty, -duty, 9000)  # it comes again
    assert (body.collisions, body.run_into) == (0, 2)


def test_a_robot_that_drives_into_a_mover_collides() -> None:
    body, board = body_in(hall_with_mover(30.0))
    board.drive(body, 0.4, 0.4, 3000)
    assert (body.collisions, body.run_into) == (1, 0)


def test_a_robot_that_drives_on_into_who_has_run_into_it_collides() -> None:
    body, board = body_in(hall_with_mover(-8.0))
    board.drive(body, 0.0, 0.0, 5200)
    assert (body.collisions, body.run_into) == (0, 1)
    board.drive(body, 0.4, 0.4, 300)
    assert (body.collisions, body.run_into) == (1, 1)


# --- Slip ------------------------------------------------------------------------------------------


def test_a_wheel_that_slips_counts_on_and_moves_less() -> None:
    body, board = body_in(hall())
    board.drive(body, 0.4, 0.4, 1000)
    z, heading, counted = body.axle[1], body.axle[2], board.counts(Side.LEFT)
    body.slip(1.0, 1.0, for_s=0.5)
    board.drive(body, 0.4, 0.4, 500)
    assert (body.axle[1], body.axle[2]) == (z, heading)
    assert board.counts(Side.LEFT) - counted > 20
    board.drive(body, 0.4, 0.4, 500)
    assert body.time_us - body.slipped_us == pytest.approx(500_000, abs=2000)
    assert body.axle[1] - z == pytest.approx(0.5 * body.speed_cm_s, rel=1e-6)
    body.slip(0.5, 0.0, for_s=0.2)
    board.drive(body, 0.4, 0.4, 200)
    assert body.axle[2] - heading == pytest.approx(-0.5 * 0.2 * body.speed_cm_s / EQUAL.track_cm, rel=1e-6)


def lost(model: BodyModel, seed: int, ms: int = 20_000) -> list[float]:
    """Share of the left wheel's turning that moved nothing, in each second."""
    body, board = body_in(hall(), replace(model, track_cm=1e9), seed)  # so that it goes straight on
    shares = []
    for _ in range(ms // 1000):
        z, turned = body.axle[1], body._left._counts
        board.drive(body, 0.4, 0.4, 1000)
        shares.append(1 - (body.axle[1] - z) / (0.5 * (body._left._counts - turned)))
    return shares


def test_a_floor_takes_its_part_which_varies_slowly_by_a_third() -> None:
    every = [share for seed in range(8) for share in lost(replace(EQUAL, slip=0.0075), seed)]
    assert 0.0049 < min(every) < 0.0065 and 0.0085 < max(every) < 0.0101
    assert sum(every) / len(every) == pytest.approx(0.0075, abs=0.0006)
    one = lost(replace(EQUAL, slip=0.0075), 1)
    assert max(abs(b - a) for a, b in pairwise(one)) < 0.0025


def test_more_is_lost_while_a_wheel_speeds_up_and_the_robot_pushes_on_while_it_brakes() -> None:
    body, board = body_in(hall(), replace(EQUAL, slip_per_cm_s2=3e-5))
    board.drive(body, 0.6, 0.6, 300)
    begun = body_in(hall())[0]._left._counts
    assert body.axle[1] + 12.0 < 0.5 * (body._left._counts - begun)
    z, turned = body.axle[1], body._left._counts
    board.drive(body, 0.0, 0.0, 600)
    assert body.axle[1] - z > 0.5 * (body._left._counts - turned)


def test_real_slips_are_rare_short_and_of_one_wheel() -> None:
    kicks, way_m = 0, 0.0
    for seed in range(4):
        body, board = body_in(hall(), replace(EQUAL, slips_per_m=2.0), seed)
        heading, calm = 0.0, True
        for _ in range(1000):
            board.drive(body, 0.3, 0.3, 10)
            turned = abs(body.axle[2] - heading) > 1e-9
            kicks += turned and calm
            heading, calm = body.axle[2], not turned
        way_m += body.distance_cm / 100
        assert 0.01 < abs(heading) < 0.5
    assert 1.0 < kicks / way_m < 3.0


def test_the_battery_drains_with_use_alone() -> None:
    body, board = body_in(hall(), replace(EQUAL, drain_mv_per_min=600.0))
    board.drive(body, 0.0, 0.0, 1000)
    assert board.battery_mv[-1] == 7400
    board.drive(body, 0.5, 0.5, 10_000)
    assert board.battery_mv[-1] == pytest.approx(7350, abs=2)
    assert body.speed_cm_s < 0.995 * 70 * (0.5 - 0.08) / 0.92


# --- A hand that takes it up -----------------------------------------------------------------------


def test_a_lifted_robot_goes_nowhere_while_its_wheels_turn_and_its_camera_sees_from_elsewhere() -> None:
    body, board = body_in(hall())
    board.drive(body, 0.4, 0.4, 1000)
    axle, counted, way = body.axle, board.counts(Side.LEFT), body.distance_cm
    on_the_floor = body.pose_at(board.time_us)
    body.lift()
    board.drive(body, 0.4, 0.4, 1000)
    assert (body.axle, body.distance_cm) == (axle, way)
    assert board.counts(Side.LEFT) - counted > 40
    lifted = body.pose_at(board.time_us)
    assert lifted.position_cm[1] == pytest.approx(-22.0)
    assert lifted.rotation @ lifted.rotation.T == pytest.approx(np.eye(3))
    assert np.arccos((np.trace(lifted.rotation.T @ on_the_floor.rotation) - 1) / 2) > 0.4
    assert lifted.rotation[1, 2] > 0.1  # it looks down
    half_way = body.pose_at(board.time_us - 800_000)
    assert -21.0 < half_way.position_cm[1] < -1.0


def test_a_robot_put_down_stands_there_at_once_and_drives_on_from_there() -> None:
    body, board = body_in(hall())
    board.drive(body, 0.4, 0.4, 500)
    body.lift()
    board.drive(body, 0.0, 0.0, 1000)
    way = body.distance_cm
    body.put_down(50.0, 80.0, math.pi / 2)
    assert (body.axle, body.distance_cm) == ((50.0, 80.0, math.pi / 2), way)
    board.drive(body, 0.4, 0.4, 1000)
    x, z, _ = body.axle
    assert x > 60 and z == pytest.approx(80.0)
    pose = body.pose_at(board.time_us - 999_500)  # half a millisecond after it was put down
    assert pose.position_cm[1] == 0.0 and pose.position_cm[0] == pytest.approx(62.0, abs=0.1)
    assert body.collisions == 0


def test_nobody_puts_a_robot_into_something() -> None:
    body, _ = body_in(hall(Box("box", 50.0, 80.0, 20.0, 20.0, 20.0, 0.0, GREY)))
    with pytest.raises(ValueError, match="does not fit at"):
        body.put_down(45.0, 80.0, 0.0)
    assert body.axle == (0.0, -12.0, 0.0)
