"""Rooms with things in them, to drive through."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np

from host.camera.lens import Lens
from host.sim.things import Ball, Board, Box, Cylinder, Material, Rgb, Thing, pieces_of


@dataclass(frozen=True)
class Room:
    """Four walls, floor and ceiling round everything."""

    left_cm: float  # x of the left wall
    right_cm: float
    back_cm: float  # z of the wall behind the start
    front_cm: float
    height_cm: float
    floor: Material
    left_wall: Material
    right_wall: Material
    back_wall: Material
    front_wall: Material
    ceiling: Material
    lamp_cm: tuple[float, float, float]  # x, height above the floor, z


@dataclass(frozen=True)
class World:
    """A room with things in it, and a robot's task in it."""

    name: str
    room: Room
    things: tuple[Thing, ...]
    camera_height_cm: float
    lens: Lens
    goal_cm: tuple[float, float]  # x, z
    seed: int

    @cached_property
    def _circles(self) -> np.ndarray:
        rows = [
            (piece.x_cm, piece.z_cm, piece.reach_cm)
            for thing in self.things
            for piece in pieces_of(thing)
            if not isinstance(piece, Box | Board)
        ]
        return np.array(rows).reshape(-1, 3)

    @cached_property
    def _rectangles(self) -> np.ndarray:
        rows = []
        for piece in (piece for thing in self.things for piece in pieces_of(thing)):
            if not isinstance(piece, Box | Board):
                continue
            c, s = math.cos(piece.yaw_rad), math.sin(piece.yaw_rad)
            x, z = piece.x_cm, piece.z_cm
            if isinstance(piece, Box):
                half = piece.depth_cm / 2
            else:  # leaning away from its lower edge
                half = piece.height_cm * math.sin(piece.lean_rad) / 2
                x, z = x + half * s, z + half * c
            rows.append((x, z, piece.width_cm / 2, abs(half), c, s))
        return np.array(rows).reshape(-1, 6)

    def distance_cm(self, points_cm: np.ndarray) -> np.ndarray:
        """Distance (N,) from places (N, 2) = (x, z) to the nearest wall or thing; negative inside one.

        Things count by what lies below them, however high they hang; ellipsoids by their longest half axis.
        """
        p = np.asarray(points_cm, float).reshape(-1, 2)
        x, z = p[:, 0], p[:, 1]
        room = self.room
        nearest = np.minimum(
            np.minimum(x - room.left_cm, room.right_cm - x), np.minimum(z - room.back_cm, room.front_cm - z)
        )
        if len(self._circles):
            c = self._circles
            away = np.hypot(x[:, None] - c[:, 0], z[:, None] - c[:, 1]) - c[:, 2]
            nearest = np.minimum(nearest, away.min(1))
        if len(self._rectangles):
            r = self._rectangles
            dx, dz = x[:, None] - r[:, 0], z[:, None] - r[:, 1]
            a = np.abs(r[:, 4] * dx - r[:, 5] * dz) - r[:, 2]
            b = np.abs(r[:, 5] * dx + r[:, 4] * dz) - r[:, 3]
            outside = np.hypot(np.maximum(a, 0), np.maximum(b, 0))
            nearest = np.minimum(nearest, (outside + np.minimum(np.maximum(a, b), 0)).min(1))
        return nearest

    def has_path(self, width_cm: float) -> bool:
        """Can a disc of this diameter surely get from the start (0, 0) to the goal?

        A way that is up to 6 cm wider than the disc may be missed.
        """
        cell = 4.0
        room = self.room
        x = np.arange(room.left_cm, room.right_cm, cell)
        z = np.arange(room.back_cm, room.front_cm, cell)
        grid = np.stack(np.meshgrid(x, z), axis=-1).reshape(-1, 2)
        # between neighbouring cells distance falls by at most half a diagonal
        free = self.distance_cm(grid) >= width_cm / 2 + cell * math.sqrt(0.5)
        _, label = cv2.connectedComponents(free.reshape(len(z), len(x)).astype(np.uint8), connectivity=8)
        ends = [
            label[round((pz - room.back_cm) / cell), round((px - room.left_cm) / cell)]
            for px, pz in ((0.0, 0.0), self.goal_cm)
        ]
        return ends[0] == ends[1] != 0


# --- Scenes ----------------------------------------------------------------------------------------

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
    """A furnished room of about 3 by 5 m, with one thing near the straight way to the goal."""
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
        ceiling=Material((236, 236, 232), contrast=0.0),
        lamp_cm=lamp,
    )  # fmt: skip
    goal = _goal(rng, shell)
    world = World("room", shell, (), 15.0, Lens(320, 240, 280.0, 280.0, 159.5, 119.5), goal, seed)
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
            if _fits(world, thing):
                more = replace(world, things=(*world.things, thing))
                if more.has_path(PATH_WIDTH_CM):
                    world = more
                    break
    return world


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


def _fits(world: World, thing: Thing) -> bool:
    """Does it stand clear of everything, of the start and of the goal?"""
    x, z, reach = thing.x_cm, thing.z_cm, thing.reach_cm
    start = math.hypot(x, z) - reach
    goal = math.hypot(x - world.goal_cm[0], z - world.goal_cm[1]) - reach
    return start > 50 and goal > 35 and float(world.distance_cm(np.array([x, z]))[0]) > reach + 3
