"""Worlds to drive through, each made from a seed: furnished rooms, corridors with doors, clutter."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from host.camera.lens import Lens
from host.sim.things import Ball, Board, Box, Cylinder, Group, Material, Mover, Rgb, Thing
from host.sim.world import Room, World

PATH_WIDTH_CM = 40.0  # every room has a way this wide to its goal
OBJECT_COLOURS: tuple[Rgb, ...] = (
    (196, 40, 38), (38, 140, 62), (30, 84, 160), (222, 130, 24), (226, 190, 40), (120, 62, 140),
    (24, 140, 150), (150, 84, 48), (60, 60, 66), (208, 96, 130), (110, 160, 60), (70, 50, 120),
)  # fmt: skip
WALL_COLOURS: tuple[Rgb, ...] = (
    (222, 214, 196), (206, 216, 222), (224, 206, 200), (204, 216, 200), (228, 226, 220), (214, 204, 222),
)  # fmt: skip
FLOORS = (
    ("wood", (196, 160, 118), 0.16, 12.0),
    ("wood", (150, 110, 78), 0.18, 9.0),
    ("tiles", (176, 186, 190), 0.05, 30.0),
    ("tiles", (190, 178, 160), 0.05, 40.0),
)
DOOR_COLOURS: tuple[Rgb, ...] = (
    (150, 96, 58), (238, 234, 226), (96, 110, 128), (178, 138, 92), (120, 140, 118),
)  # fmt: skip
LENS = Lens(320, 240, 280.0, 280.0, 159.5, 119.5)
CAMERA_HEIGHT_CM = 15.0
CEILING = Material((236, 236, 232), contrast=0.0)


def boxes(seed: int = 0) -> World:
    """The paper's first experiment: a red and a green box, front faces at 85 cm, corners of its Table 1."""
    wall = Material((232, 226, 210), contrast=0.03, scale_cm=6.0, seed=1)
    room = Room(
        -150.0, 150.0, -120.0, 200.0, 178.7,
        floor=Material((210, 176, 134), "wood", 0.12, 14.0, seed=2),
        left_wall=wall, right_wall=wall, back_wall=wall, front_wall=wall,
        ceiling=Material((236, 236, 232), contrast=0.0),
        lamp_cm=(60.0, 160.0, -40.0),
    )  # fmt: skip
    things = (
        Box("red_box", -15.75, 91.0, 20.5, 12.0, 24.95, 0.0, Material((196, 38, 36), contrast=0.02, seed=3)),
        Box("green_box", 16.0, 90.5, 15.0, 11.0, 23.9, 0.0, Material((40, 146, 62), contrast=0.02, seed=4)),
    )
    lens = Lens(320, 240, 371.0, 371.0, 159.5, 119.5)
    return World("boxes", room, things, 8.7, lens, (0.0, 30.0), seed)


def room(seed: int = 0, objects: int = 8) -> World:
    """A furnished room of about 3 by 5 m with a door or two, and one thing near the straight way to the goal.

    In every other room one thing looks nearly as the front wall does. No objects: no doors either.
    """
    rng = np.random.default_rng((0x600D, seed))
    width, length = rng.uniform(270, 340), rng.uniform(440, 560)
    left = -width * rng.uniform(0.38, 0.62)
    back = -rng.uniform(60, 90)
    pattern, rgb, contrast, scale = FLOORS[rng.integers(len(FLOORS))]
    left_wall, right_wall, back_wall, front_wall = (
        Material(WALL_COLOURS[k], contrast=0.03, scale_cm=7.0, seed=int(rng.integers(1 << 31)))
        for k in rng.permutation(len(WALL_COLOURS))[:4]
    )
    lamp = (left + width * rng.uniform(0.3, 0.7), 230.0, back + length * rng.uniform(0.25, 0.6))
    shell = Room(
        left, left + width, back, back + length, 250.0,
        floor=Material(rgb, pattern, contrast, scale, int(rng.integers(1 << 31))),
        left_wall=left_wall, right_wall=right_wall, back_wall=back_wall, front_wall=front_wall,
        ceiling=CEILING,
        lamp_cm=lamp,
    )  # fmt: skip
    goal = _goal(rng, shell)
    world = World("room", shell, (), CAMERA_HEIGHT_CM, LENS, goal, seed)
    colours = [OBJECT_COLOURS[k] for k in rng.permutation(len(OBJECT_COLOURS))]
    for n in range(objects):
        colour = colours[n % len(colours)]
        for _ in range(200):
            if n == 0:  # near the straight way
                part, aside = rng.uniform(0.4, 0.7), rng.uniform(-20, 20)
                x, z = part * goal[0] + aside, part * goal[1]
            else:
                x = rng.uniform(shell.left_cm + 8, shell.right_cm - 8)
                z = rng.uniform(50, shell.front_cm - 8)
            thing = _thing(rng, f"{n}", x, z, colour)
            if _stands_clear(world, thing):
                more = replace(world, things=(*world.things, thing))
                if more.has_path(PATH_WIDTH_CM):
                    world = more
                    break
    return _lived_in(world) if objects else world


def _lived_in(world: World) -> World:
    """With doors in the walls, and perhaps one thing of low contrast."""
    rng = np.random.default_rng((0xD004, world.seed))
    room, things = world.room, list(world.things)
    if len(things) > 1 and rng.random() < 0.5:
        n = int(rng.integers(1, len(things)))
        things[n] = _painted(things[n], _like(rng, room.front_wall.rgb))
    paint = DOOR_COLOURS[rng.integers(len(DOOR_COLOURS))]
    ahead = rng.uniform(120, room.front_cm - 60, 2)
    across = rng.uniform(room.left_cm + 60, room.right_cm - 60)
    places = {
        "left": (room.left_cm + 1, ahead[0], -math.pi / 2),
        "right": (room.right_cm - 1, ahead[1], math.pi / 2),
        "front": (across, room.front_cm - 1, 0.0),
    }
    for wall in rng.permutation(list(places))[: int(rng.integers(1, 3))]:
        look = Material(paint, contrast=0.03, scale_cm=9.0, seed=int(rng.integers(1 << 31)))
        x, z, yaw = places[str(wall)]
        things.append(Board(f"door_{wall}", float(x), float(z), 84.0, 200.0, yaw, look))
    return replace(world, things=tuple(things))


def _painted(thing: Thing, rgb: Rgb) -> Thing:
    assert not isinstance(thing, Group)
    return replace(thing, material=replace(thing.material, rgb=rgb))


def corridor(seed: int = 0) -> World:
    """A corridor 1.1 to 1.7 m wide with doors and things along its walls; the goal lies further down."""
    rng = np.random.default_rng((0xC0441D, seed))
    width, length = rng.uniform(110, 170), rng.uniform(500, 720)
    left, back = -width * rng.uniform(0.4, 0.6), -rng.uniform(50, 80)
    side, end = (_wall(rng, colour) for colour in rng.permutation(len(WALL_COLOURS))[:2])
    shell = Room(
        left, left + width, back, back + length, 240.0,
        floor=_floor(rng), left_wall=side, right_wall=side, back_wall=end, front_wall=end, ceiling=CEILING,
        lamp_cm=(left + width / 2, 225.0, back + length * rng.uniform(0.3, 0.6)),
    )  # fmt: skip
    aside = width / 2 - 30
    goal = (left + width / 2 + rng.uniform(-aside, aside), rng.uniform(230, min(330, shell.front_cm - 50)))
    doors = _doors(rng, shell)
    world = World("corridor", shell, doors, CAMERA_HEIGHT_CM, LENS, goal, seed)
    colours = rng.permutation(len(OBJECT_COLOURS))
    for n in range(int(rng.integers(3, 7))):
        rgb = OBJECT_COLOURS[colours[n]]
        for _ in range(100):
            thing = _thing(rng, f"{n}", 0.0, rng.uniform(45, shell.front_cm - 40), rgb)
            at_left = bool(rng.integers(2))
            gap = thing.reach_cm + rng.uniform(1, 8)
            thing = replace(thing, x_cm=shell.left_cm + gap if at_left else shell.right_cm - gap)
            more = replace(world, things=(*world.things, thing))
            if _stands_clear(world, thing) and more.has_path(PATH_WIDTH_CM):
                world = more
                break
    return world


def clutter(seed: int = 0) -> World:
    """Many things on 3 by 4 m, some hiding others, some looking nearly as their surroundings do.

    A way of 40 cm to the goal is likely and not certain: ``World.has_path`` tells.
    """
    rng = np.random.default_rng((0xC1077E4, seed))
    width, length = rng.uniform(280, 360), rng.uniform(380, 470)
    left, back = -width * rng.uniform(0.4, 0.6), -rng.uniform(50, 80)
    left_wall, right_wall, back_wall, front_wall = (
        _wall(rng, colour) for colour in rng.permutation(len(WALL_COLOURS))[:4]
    )
    shell = Room(
        left, left + width, back, back + length, 250.0,
        floor=_floor(rng), left_wall=left_wall, right_wall=right_wall, back_wall=back_wall,
        front_wall=front_wall, ceiling=CEILING,
        lamp_cm=(left + width * rng.uniform(0.3, 0.7), 230.0, back + length * rng.uniform(0.25, 0.6)),
    )  # fmt: skip
    world = World("clutter", shell, (), CAMERA_HEIGHT_CM, LENS, _goal(rng, shell), seed)
    groups = int(rng.integers(6, 10))
    for group in range(groups):
        x, z = rng.uniform(shell.left_cm + 20, shell.right_cm - 20), rng.uniform(50, shell.front_cm - 20)
        for member in range(int(rng.integers(1, 4))):
            rgb = _like(rng, front_wall.rgb) if rng.random() < 0.15 else _any_colour(rng)
            for _ in range(20):
                near = rng.normal(0.0, 22.0, 2) if member else (0.0, 0.0)
                thing = _thing(rng, f"{group}_{member}", x + near[0], z + near[1], rgb)
                if _stands_clear(world, thing):
                    world = replace(world, things=(*world.things, thing))
                    break
    return world


MOVER_REACH_CM = 60.0  # to either side of the straight way, so that it is back before long
MOVER_ASIDE_CM = 22.0  # least of it: beyond this it leaves the way to a robot of 12 cm
MOVER_MET_CM = 40.0  # before the robot it first crosses
MOVER_MET_CM_S = 14.0  # if that comes on its straight way as fast as robots do that look where they go
MOVER_TRIES = 400


def with_mover(world: World) -> World:
    """The same world with something that crosses the straight way to the goal, to and fro.

    It crosses between a third and three quarters of the way, at right angles, clear of all that stands; what
    leaves no room for that anywhere is taken away. When it first does, a robot that goes straight to the
    goal at an ordinary pace is 40 cm before it; later crossings follow every 12 s or sooner.
    """
    rng = np.random.default_rng((0x307E4, world.seed))
    goal = np.array(world.goal_cm)
    aside = np.array([goal[1], -goal[0]]) / np.hypot(*goal)
    rgb = OBJECT_COLOURS[rng.integers(len(OBJECT_COLOURS))]
    look = Material(rgb, contrast=0.05, scale_cm=4.0, seed=int(rng.integers(1 << 31)))
    for attempt in range(MOVER_TRIES):
        radius, part = rng.uniform(6, 11), rng.uniform(0.35, 0.72)
        middle = part * goal
        if attempt == MOVER_TRIES // 2:
            world = _without_things_beside(world, middle, aside, radius)
        reaches = [_room_cm(world, middle, way * aside, radius) for way in (-1, 1)]
        if min(reaches) < MOVER_ASIDE_CM:
            continue
        near, far = (0, 1) if rng.integers(2) else (1, 0)
        ends = middle - reaches[0] * aside, middle + reaches[1] * aside
        speed = rng.uniform(10, 20)
        thing = Cylinder("mover", ends[near][0], ends[near][1], radius, rng.uniform(20, 45), look)
        met_s = max(float(np.hypot(*middle)) - MOVER_MET_CM, 0.0) / MOVER_MET_CM_S
        period_s = 2 * sum(reaches) / speed
        ahead_s = (reaches[near] / speed - met_s) % period_s
        other_end = (float(ends[far][0]), float(ends[far][1]))
        return replace(world, movers=(Mover(thing, other_end, speed, ahead_s),))
    raise AssertionError(f"{world.name} {world.seed} is too narrow for a mover")


LOOP_CLEAR_CM = 26.0  # from the middle of a robot of 12 cm to anything
LOOP_STEP_CM = 30.0  # least distance between two goals
LOOP_REACH_CM = 350.0  # a goal lies no further to a side or ahead: the robot's map ends at 400


def free_loop(world: World, length_cm: float) -> list[tuple[float, float]]:
    """Goals (x, z), in truth, of a way of at least this length that returns to the start; for benchmarks.

    It goes round through places from which the next can be seen: straight from goal to goal there is room for
    a robot, with 14 cm to spare on both sides. A round is repeated until the way is long enough.

    Raises
    ------
    ValueError
        There is no such round in this world.
    """
    rng = np.random.default_rng((0x10097, world.seed))
    room, start = world.room, (0.0, 0.0)
    low = np.maximum(np.array([room.left_cm, room.back_cm]) + LOOP_CLEAR_CM, -LOOP_REACH_CM)
    high = np.minimum(np.array([room.right_cm, room.front_cm]) - LOOP_CLEAR_CM, LOOP_REACH_CM)
    places = rng.uniform(low, high, (400, 2))
    places = places[world.distance_cm(places) > LOOP_CLEAR_CM]
    best: list[tuple[float, float]] = []
    best_cm = 0.0
    for _ in range(300):
        middle = places[rng.integers(len(places))] if len(places) else np.zeros(2)
        chosen = places[rng.permutation(len(places))[: int(rng.integers(3, 8))]]
        order = np.argsort(np.arctan2(*(chosen - middle).T))
        goals = [(float(x), float(z)) for x, z in chosen[order]] + [start]
        legs = list(pairwise([start, *goals]))
        if min(math.dist(a, b) for a, b in legs) < LOOP_STEP_CM or not all(
            _is_free(world, a, b) for a, b in legs
        ):
            continue
        round_cm = sum(math.dist(a, b) for a, b in legs)
        if round_cm > best_cm:
            best, best_cm = goals, round_cm
    if not best:
        raise ValueError(f"no round way is free in {world.name} {world.seed}")
    return best * math.ceil(length_cm / best_cm)


def _is_free(world: World, a: tuple[float, float], b: tuple[float, float]) -> bool:
    parts = np.linspace(0.0, 1.0, max(2, math.ceil(math.dist(a, b) / 2.0)))[:, None]
    return bool(world.distance_cm(np.array(a) + parts * (np.array(b) - a)).min() > LOOP_CLEAR_CM)


def _room_cm(world: World, begin: np.ndarray, way: np.ndarray, radius: float) -> float:
    """How far a disc can go from a place, staying clear of everything."""
    steps = np.arange(0.0, MOVER_REACH_CM + 1.0, 2.0)
    blocked = world.distance_cm(begin + steps[:, None] * way) < radius + 3
    return max(float(steps[int(np.argmax(blocked))]) - 2.0, 0.0) if blocked.any() else MOVER_REACH_CM


def _without_things_beside(world: World, middle: np.ndarray, aside: np.ndarray, radius: float) -> World:
    """Without what would hinder a mover to cross here far enough to either side."""
    places = middle + np.arange(-30.0, 31.0, 2.0)[:, None] * aside
    empty = replace(world, things=())
    clear = tuple(
        thing
        for thing in world.things
        if replace(empty, things=(thing,)).distance_cm(places).min() > radius + 3
    )
    return replace(world, things=clear)


def _wall(rng: np.random.Generator, colour: int) -> Material:
    return Material(WALL_COLOURS[colour], contrast=0.03, scale_cm=7.0, seed=int(rng.integers(1 << 31)))


def _floor(rng: np.random.Generator) -> Material:
    pattern, rgb, contrast, scale = FLOORS[rng.integers(len(FLOORS))]
    return Material(rgb, pattern, contrast, scale, int(rng.integers(1 << 31)))


def _doors(rng: np.random.Generator, shell: Room) -> tuple[Thing, ...]:
    """Two to four doors a side wall, 1 cm before it."""
    doors: list[Thing] = []
    paint = DOOR_COLOURS[rng.integers(len(DOOR_COLOURS))]
    for name, x, way in (("left", shell.left_cm + 1, -1), ("right", shell.right_cm - 1, 1)):
        z = shell.back_cm + rng.uniform(60, 160)
        while z < shell.front_cm - 60:
            look = Material(paint, contrast=0.03, scale_cm=9.0, seed=int(rng.integers(1 << 31)))
            doors.append(Board(f"door_{name}_{len(doors)}", x, z, 84.0, 200.0, way * math.pi / 2, look))
            z += rng.uniform(130, 260)
    return tuple(doors)


def _any_colour(rng: np.random.Generator) -> Rgb:
    r, g, b = np.array(OBJECT_COLOURS[rng.integers(len(OBJECT_COLOURS))]) * rng.uniform(0.8, 1.15)
    return min(r, 250.0), min(g, 250.0), min(b, 250.0)


def _like(rng: np.random.Generator, rgb: Rgb) -> Rgb:
    """A colour of low contrast to another: a little darker, a little off."""
    r, g, b = np.array(rgb) * rng.uniform(0.72, 0.86) + rng.uniform(-8, 8, 3)
    return r, g, b


def _goal(rng: np.random.Generator, shell: Room) -> tuple[float, float]:
    z = rng.uniform(200, 290)
    x = z * math.tan(rng.uniform(-0.26, 0.26))
    return float(np.clip(x, shell.left_cm + 50, shell.right_cm - 50)), float(z)


def _thing(rng: np.random.Generator, number: str, x: float, z: float, rgb: Rgb) -> Thing:
    material = Material(rgb, contrast=0.05, scale_cm=4.0, seed=int(rng.integers(1 << 31)))
    kind = rng.choice(["box", "box", "cylinder", "ball"])
    if kind == "box":
        w, d, h = rng.uniform(10, 36), rng.uniform(10, 30), rng.uniform(12, 55)
        return Box(f"box_{number}", x, z, w, d, h, rng.uniform(-math.pi / 4, math.pi / 4), material)
    if kind == "cylinder":
        return Cylinder(f"cylinder_{number}", x, z, rng.uniform(5, 14), rng.uniform(15, 50), material)
    return Ball(f"ball_{number}", x, z, rng.uniform(7, 15), material)


def _stands_clear(world: World, thing: Thing) -> bool:
    """Does it stand clear of everything, of the start and of the goal?"""
    x, z, reach = thing.x_cm, thing.z_cm, thing.reach_cm
    start = math.hypot(x, z) - reach
    goal = math.hypot(x - world.goal_cm[0], z - world.goal_cm[1]) - reach
    return start > 50 and goal > 35 and float(world.distance_cm(np.array([x, z]))[0]) > reach + 3
