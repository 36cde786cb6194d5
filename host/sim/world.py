"""A simulated world: a room with things in it, and what a disc that drives through it may touch."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np

from host.camera.lens import Lens
from host.sim.things import Board, Box, Material, Mover, Thing, pieces_of


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
    """A room with things in it, and a robot's task in it. Only ``at`` knows of its movers."""

    name: str
    room: Room
    things: tuple[Thing, ...]
    camera_height_cm: float
    lens: Lens
    goal_cm: tuple[float, float]  # x, z
    seed: int
    movers: tuple[Mover, ...] = ()

    def at(self, t_s: float) -> World:
        """The world as it stands at a time, its movers among its things."""
        if not self.movers:
            return self
        return replace(self, things=(*self.things, *(mover.at(t_s) for mover in self.movers)), movers=())

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
