"""Worlds: what their URIs mean, and that every room can be driven through."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from host.errors import UsageError
from host.sim.drive_scenes import PATH_WIDTH_CM, boxes, clutter, corridor, room
from host.sim.render import WebcamModel
from host.sim.scenes import webcam_from_uri, world_from_uri
from host.sim.things import Ball, Board, Box, Cone, Cylinder, Ellipsoid, Group, Material
from host.sim.world import Room, World

SEEDS = range(60)


def drawn_free(world: World) -> tuple[np.ndarray, float, float]:
    """Free floor at 1 cm a pixel as OpenCV draws it, and the place of pixel (0, 0): not world.distance_cm."""
    shell = world.room
    x0, z0 = math.floor(shell.left_cm) - 1.0, math.floor(shell.back_cm) - 1.0
    free = np.zeros((int(shell.front_cm - z0) + 3, int(shell.right_cm - x0) + 3), np.uint8)
    inner = [round(shell.left_cm - x0), round(shell.back_cm - z0)]
    outer = [round(shell.right_cm - x0), round(shell.front_cm - z0)]
    cv2.rectangle(free, inner, outer, 255, cv2.FILLED)
    for thing in world.things:
        centre = (thing.x_cm - x0, thing.z_cm - z0)
        if isinstance(thing, Box):
            # OpenCV's angle turns from its x to its y, here from x to z; yaw turns from z to x
            size = (thing.width_cm, thing.depth_cm)
            corners = cv2.boxPoints((centre, size, -math.degrees(thing.yaw_rad)))
            cv2.fillPoly(free, [np.round(corners).astype(np.int32)], 0)
        elif isinstance(thing, Board):
            half = thing.width_cm / 2 * np.array([math.cos(thing.yaw_rad), -math.sin(thing.yaw_rad)])
            begin, end = np.round([centre - half, centre + half]).astype(int).tolist()
            cv2.line(free, begin, end, 0)
        else:
            cv2.circle(free, [round(c) for c in centre], round(thing.reach_cm), 0, cv2.FILLED)
    return free, x0, z0


@pytest.mark.parametrize("seed", SEEDS)
def test_every_room_has_a_way_forty_centimetres_wide_to_its_goal(seed):
    world = room(seed)
    free, x0, z0 = drawn_free(world)
    wide = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) > 19.0  # drawing rounds to 1 cm
    _, piece = cv2.connectedComponents(wide.astype(np.uint8))
    start = piece[round(-z0), round(-x0)]
    goal = piece[round(world.goal_cm[1] - z0), round(world.goal_cm[0] - x0)]
    assert start == goal != 0


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_distances_agree_with_those_on_a_drawn_map(seed):
    world = room(seed)
    free, x0, z0 = drawn_free(world)
    drawn = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    rows, columns = np.nonzero(drawn > 3)
    exact = world.distance_cm(np.column_stack([columns + x0, rows + z0]))
    assert np.abs(exact - drawn[rows, columns]).max() < 2.0


def test_distance_is_negative_inside_things_and_beyond_walls():
    world = boxes()
    assert world.distance_cm(np.array([-15.75, 91.0]))[0] == pytest.approx(-6.0)
    assert world.distance_cm(np.array([0.0, 203.0]))[0] == pytest.approx(-3.0)
    assert world.distance_cm(np.array([1.5, 91.0]))[0] == pytest.approx(7.0)  # midway between the boxes


def test_things_of_every_shape_are_obstacles_where_they_stand():
    plain = Material((200, 200, 200))
    things = (
        Cone("pot", 30.0, 60.0, 4.0, 7.0, 10.0, plain),
        Ellipsoid("egg", -30.0, 60.0, (6.0, 3.0, 3.0), 0.5, plain),
        Board("ramp", 0.0, 80.0, 20.0, 10.0, 0.0, plain, lean_rad=math.pi / 2),
        Group("pair", (Ball("a", 0.0, 120.0, 5.0, plain), Ball("b", 20.0, 120.0, 5.0, plain))),
    )
    world = replace(boxes(), things=things)
    x = (30.0, -30.0, 0.0, 0.0, 0.0, 20.0, 10.0)
    z = (50.0, 50.0, 75.0, 93.0, 85.0, 110.0, 120.0)
    assert world.distance_cm(np.column_stack([x, z])) == pytest.approx([3.0, 4.0, 5.0, 3.0, -5.0, 5.0, 5.0])


def test_rooms_are_about_three_by_five_metres_with_a_goal_two_to_three_ahead_and_something_in_the_way():
    blocked = 0
    for seed in SEEDS:
        world = room(seed)
        shell = world.room
        assert 270 <= shell.right_cm - shell.left_cm <= 340
        assert 440 <= shell.front_cm - shell.back_cm <= 560
        assert 200 <= world.goal_cm[1] <= 290
        assert len(world.things) >= 5
        straight = np.linspace((0.0, 0.0), world.goal_cm, 100)
        blocked += bool(world.distance_cm(straight).min() < 20.0)
        assert world.distance_cm(np.array([(0.0, 0.0), world.goal_cm])).min() > 20
    assert blocked > 0.6 * len(SEEDS)


def test_rooms_differ_by_seed_and_agree_with_themselves():
    assert room(7) == room(7)
    assert room(7).things != room(8).things
    assert len([thing for thing in room(7, objects=2).things if not isinstance(thing, Board)]) == 2
    assert room(7, objects=0).things == ()


def test_a_room_divided_in_two_has_no_path():
    plain = Material((200, 200, 200))
    shell = Room(-100, 100, -50, 300, 250, plain, plain, plain, plain, plain, plain, (0, 230, 100))
    wall = Box("wall", -10.0, 120.0, 145.0, 10.0, 40.0, 0.0, plain)
    post = Cylinder("post", 85.0, 120.0, 8.0, 40.0, plain)  # 14 cm from one wall, 7 from the other
    lens = boxes().lens
    open_world = World("test", shell, (wall,), 15.0, lens, (0.0, 250.0), 0)
    closed_world = World("test", shell, (wall, post), 15.0, lens, (0.0, 250.0), 0)
    assert open_world.has_path(25.0)
    assert not closed_world.has_path(25.0)
    on_start = World("test", shell, (Ball("ball", 5.0, 0.0, 10.0, plain),), 15.0, lens, (0.0, 250.0), 0)
    assert not on_start.has_path(25.0)


def test_uris_choose_scene_seed_and_number_of_objects():
    assert world_from_uri("sim:room?seed=3") == room(3)
    assert world_from_uri("sim:room") == room(0)
    assert world_from_uri("sim:room?seed=3&objects=4") == room(3, objects=4)
    assert world_from_uri("sim:boxes") == boxes()


@pytest.mark.parametrize(
    ("uri", "words"),
    [
        ("sim:hall", ["'sim:hall'", "sim:room", "sim:boxes"]),
        ("sim:", ["sim:room", "sim:boxes"]),
        ("room", ["sim:room", "sim:boxes"]),
        ("sim:room?sead=1", ["'sead'", "seed", "objects"]),
        ("sim:boxes?objects=1", ["'objects'", "seed"]),
        ("sim:room?seed=one", ["seed", "whole number", "'one'"]),
        ("sim:room?seed=-1", ["seed", "whole number", "'-1'"]),
        ("sim:room?seed=", ["seed", "whole number", "''"]),
        ("sim:room?objects=99999", ["objects", "30"]),
        ("sim:room?seed=²", ["seed", "whole number"]),
    ],
)
def test_a_uri_that_names_nothing_is_refused_in_one_line_with_what_is_known(uri, words):
    with pytest.raises(UsageError) as refusal:
        world_from_uri(uri)
    message = str(refusal.value)
    assert "\n" not in message
    assert all(word in message for word in words)


# --- Corridors and clutter -------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
def test_every_corridor_can_be_driven_through_and_has_doors(seed):
    world = corridor(seed)
    assert world.has_path(PATH_WIDTH_CM)
    doors = [thing for thing in world.things if thing.name.startswith("door")]
    assert len(doors) >= 3
    assert all(isinstance(door, Board) for door in doors)
    assert len(world.things) > len(doors)
    gap = world.distance_cm(np.array([(0.0, 0.0), world.goal_cm]))
    assert gap.min() > 25  # start and goal have room for the robot


@pytest.mark.parametrize("seed", SEEDS)
def test_things_in_clutter_do_not_overlap_and_leave_start_and_goal_free(seed):
    world = clutter(seed)
    for n, thing in enumerate(world.things):
        earlier = replace(world, things=world.things[:n])
        assert earlier.distance_cm(np.array([(thing.x_cm, thing.z_cm)]))[0] > thing.reach_cm
    assert world.distance_cm(np.array([(0.0, 0.0), world.goal_cm])).min() > 25


def test_clutter_is_dense_and_mostly_leaves_a_way():
    worlds = [clutter(seed) for seed in SEEDS]
    assert np.median([len(world.things) for world in worlds]) >= 12
    assert np.mean([world.has_path(PATH_WIDTH_CM) for world in worlds]) > 0.8


def test_a_rough_world_is_the_same_world_behind_a_worse_camera():
    plain, rough = (world_from_uri(f"sim:corridor?seed=4&rough={n}") for n in (0, 1))
    assert rough.things == plain.things and rough.room == plain.room
    assert any(rough.lens.distortion) and not any(plain.lens.distortion)
    assert webcam_from_uri("sim:corridor?seed=4") == WebcamModel()
    worse = webcam_from_uri("sim:corridor?seed=4&rough=1")
    assert worse.readout_s > 0 and worse.latency_s > 0 and worse.jitter_s > 0 and worse.stamp_late_s > 0
    assert worse.full_well < WebcamModel().full_well
