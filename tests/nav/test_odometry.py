"""Odometry: exact where wheels turn evenly, far below a count where they do not."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from planar_world import PlanarWorld

from host.nav.config import BodyConfig
from host.nav.odometry import Odometry, WheelReading, advance, heading_of
from host.nav.wheel import Wheel
from host.pose import Pose

BODY = BodyConfig()


def edge_before(travel_cm: float, speed: float, t_s: float, cell: float) -> tuple[int, float | None]:
    """Count and time of the last edge of a wheel that has turned evenly from mid-cell since time 0."""
    place = travel_cm / cell + 0.5
    count = math.floor(place)
    if speed > 0 and count >= 1:
        return count, (count - 0.5) * cell / speed
    if speed < 0 and count <= -1:
        return count, (count + 0.5) * cell / speed
    return count, None


def drive_evenly(left: float, right: float, seconds: float) -> Odometry:
    """Readings every 10 ms of two wheels at constant speed from mid-cell."""
    odometry = Odometry(BODY)
    for k in range(round(seconds * 100) + 1):
        t = k / 100
        count_left, edge_left = edge_before(left * t, left, t, BODY.cm_per_count)
        count_right, edge_right = edge_before(right * t, right, t, BODY.cm_per_count)
        odometry.add(WheelReading(t, count_left, count_right, edge_left, edge_right))
    return odometry


wheel_speeds = st.floats(5.0, 40.0).flatmap(lambda v: st.sampled_from([v, -v]))


@given(wheel_speeds, wheel_speeds, st.floats(1.5, 4.0), st.floats(0.15, 0.8), st.floats(0.15, 0.8))
@settings(max_examples=60, deadline=None)
def test_motion_on_an_arc_of_constant_wheel_speeds_is_exact(left, right, seconds, back_a, back_b):
    odometry = drive_evenly(left, right, seconds)
    t_a, t_b = seconds - max(back_a, back_b), seconds - min(back_a, back_b)
    a, b = odometry.pose_at(t_a), odometry.pose_at(t_b)
    rotation, way = b.relative_to(a)
    ahead = BODY.camera_ahead_cm
    x, z, heading = advance(0.0, -ahead, 0.0, left * (t_b - t_a), right * (t_b - t_a), BODY.track_cm)
    want = Pose.planar(x + ahead * math.sin(heading), z + ahead * math.cos(heading), heading)
    assert np.allclose(rotation, want.rotation, atol=1e-6)
    assert np.allclose(way, want.position_cm, atol=1e-6)


@given(st.floats(-30, 30), st.floats(-30, 30), st.integers(1, 9))
def test_an_arc_driven_in_pieces_ends_where_it_ends_in_one(left, right, pieces):
    whole = advance(3.0, -4.0, 0.5, left, right, 15.0)
    part = (3.0, -4.0, 0.5)
    for _ in range(pieces):
        part = advance(*part, left / pieces, right / pieces, 15.0)
    assert np.allclose(whole, part, atol=1e-9)


def test_a_faster_left_wheel_turns_to_the_right_towards_x():
    pose = drive_evenly(12.0, 10.0, 3.0).pose_at(3.0)
    assert heading_of(pose) > 0
    assert pose.position_cm[0] > 0


def test_turning_in_place_carries_the_camera_round_the_axle():
    pose = drive_evenly(6.0, -6.0, 2.0).pose_at(2.0)
    turn = 2 * 6.0 * 2.0 / BODY.track_cm
    want = [BODY.camera_ahead_cm * math.sin(turn), 0, BODY.camera_ahead_cm * (math.cos(turn) - 1)]
    assert np.allclose(pose.position_cm, want, atol=0.05)


def errors_on_a_random_drive(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Errors of travel (cm) and heading (rad) against the truth, frame by frame while moving."""
    world = PlanarWorld([], room=(-1e4, -1e4, 1e4, 1e4), seed=seed, fps=30)
    odometry = Odometry(world.body)
    odometry.add(WheelReading(0.0, 0, 0, None, None))
    random = np.random.default_rng(seed)
    world.command = (20.0, 0.0)
    travel, heading = [], []
    for k in range(300):
        if k % 60 == 59:
            world.command = (random.uniform(10, 30), random.uniform(-0.4, 0.4))
        for reading in world.run(1 / world.fps):
            odometry.add(reading)
        if k > 30:
            pose = odometry.pose_at(world.t_s)
            x, z = world.camera_xz()
            off = pose.position_cm - (x, 0.0, z)
            travel.append(off[0] * math.sin(world.heading) + off[2] * math.cos(world.heading))
            heading.append(heading_of(pose) - world.heading)
    return np.array(travel), np.array(heading)


def test_travel_between_frames_is_known_far_better_than_a_count():
    steps, turns = [], []
    for seed in range(4):
        travel, heading = errors_on_a_random_drive(seed)
        steps.append(np.diff(travel))
        turns.append(np.diff(heading))
    rms = math.sqrt(np.mean(np.concatenate(steps) ** 2))
    raw = BODY.cm_per_count / math.sqrt(6)  # of a difference of two rounded readings
    assert rms < raw / 4
    assert math.sqrt(np.mean(np.concatenate(turns) ** 2)) < 2 * raw / BODY.track_cm / 4


def test_the_stated_sigma_of_travel_covers_its_error():
    world = PlanarWorld([], seed=5, fps=30)
    odometry = Odometry(world.body)
    odometry.add(WheelReading(0.0, 0, 0, None, None))
    world.command = (20.0, 0.0)
    for _ in range(120):
        for reading in world.run(1 / world.fps):
            odometry.add(reading)
    pose = odometry.pose_at(world.t_s)
    travel = math.hypot(*(np.array(world.camera_xz()) - (0.0, 0.0)))
    assert abs(math.hypot(pose.position_cm[0], pose.position_cm[2]) - travel) < 3 * (
        pose.sigma_z_cm + BODY.cm_per_count / math.sqrt(12)
    )


def test_a_standing_robot_does_not_move():
    odometry = Odometry(BODY)
    for k in range(200):
        odometry.add(WheelReading(k / 100, 0, 0, None, None))
    assert np.allclose(odometry.pose_at(1.99).position_cm, 0.0)
    assert np.allclose(odometry.pose_at(2.05).rotation, np.eye(3))


def test_a_wheel_without_a_new_edge_stays_within_its_cell():
    wheel = Wheel(0.5, 0.0, 0)
    wheel.add(0.1, 1, 0.1)
    wheel.add(0.2, 2, 0.2)
    at_edge = wheel.travel(0.2)
    late = [wheel.travel(t) for t in np.linspace(0.2, 3.0, 50)]
    assert min(late) >= at_edge
    assert max(late) <= at_edge + 0.5


def test_an_edge_of_long_ago_is_no_news_when_the_clocks_move_its_time():
    odometry = Odometry(BODY)  # of a robot that has driven before
    for k in range(200):
        edge_s = -7.0 + 1e-7 * k - 0.0022 * (k >= 50) + 0.0015 * (k >= 90)
        odometry.add(WheelReading(k / 100, 168, 166, edge_s, edge_s, 1, -1))
    assert np.allclose(odometry.pose_at(1.99).position_cm, 0.0)
    assert np.allclose(odometry.pose_at(1.99).rotation, np.eye(3))
    standing = Wheel(0.5, 0.0, 0)
    for k in range(1, 300):
        standing.add(0.02 * k, min(k, 5), min(0.02 * k, 0.1) + 0.002 * (k > 100), 1)
    assert standing.edges == 5


@given(st.lists(st.tuples(st.integers(-1, 1), st.floats(-0.01, 0.01)), max_size=60))
def test_no_shift_of_the_clocks_stops_the_counting(steps):
    wheel, count, edge_s = Wheel(0.5, 0.0, 0), 0, -1.0
    for k, (step, shift_s) in enumerate(steps):
        count += step
        edge_s = (0.01 * k if step else edge_s) + shift_s
        wheel.add(0.01 * k, count, edge_s, step)
        assert math.isfinite(wheel.travel(0.01 * k + 0.05))
        assert 0.0 < wheel.sigma(0.01 * k + 0.05) <= 0.5


def test_a_wheel_that_stops_and_goes_on_is_right_again_at_the_next_edge():
    wheel = Wheel(0.5, 0.0, 0)
    for k in range(1, 6):
        wheel.add(0.1 * k, k, 0.1 * k)
    for k in range(60, 200):
        wheel.add(k / 100, 5, 0.5)
    wheel.add(2.01, 6, 2.0)
    assert wheel.travel(2.0) - wheel.travel(0.5) == 0.5


def test_after_a_restart_of_the_robot_the_path_goes_on_where_it_was():
    whole, cut = Odometry(BODY), Odometry(BODY)
    zero = before = 0
    for k in range(301):
        t = k / 100
        count, edge = edge_before(20.0 * t, 20.0, t, BODY.cm_per_count)
        whole.add(WheelReading(t, count, count, edge, edge))
        if k == 150:
            cut.restart()
            zero = before
        known = edge if k < 150 or count > zero else None  # the new start has seen no edge yet
        cut.add(WheelReading(t, count - zero, count - zero, known, known))
        before = count
    assert np.allclose(cut.pose_at(3.0).position_cm, whole.pose_at(3.0).position_cm, atol=1e-6)
    assert cut.rolled_cm == whole.rolled_cm


def test_the_direction_of_an_edge_tells_which_border_it_crossed():
    wheel = Wheel(0.5, 0.0, 0)
    wheel.add(0.1, 1, 0.1, 1)
    assert wheel.travel(0.1) == 0.25
    wheel.add(0.3, 1, 0.25, -1)  # on to 2 and back: the border between 1 and 2
    assert wheel.travel(0.25) == 0.75
    wheel.add(0.5, 0, 0.45, -1)
    assert wheel.travel(0.45) == 0.25
    wheel.add(0.7, -1, 0.6, 1)  # to -2 and back: the border between -2 and -1
    assert wheel.travel(0.6) == -0.75


def test_readings_out_of_order_are_ignored():
    odometry = drive_evenly(10.0, 10.0, 1.0)
    before = odometry.pose_at(1.0).position_cm
    odometry.add(WheelReading(0.5, 99, 99, 0.4, 0.4))
    assert np.array_equal(odometry.pose_at(1.0).position_cm, before)
