"""What can stand, lie or hang in a simulated world.

World axes are the camera's at the start: x right, y down, z forward, in cm. Places are (x, z) on the floor,
heights are above it, and a heading or yaw turns from z towards x.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

Rgb = tuple[float, float, float]  # 0..255, as on a screen


@dataclass(frozen=True)
class Material:
    """How a surface looks."""

    rgb: Rgb
    pattern: str = "plain"  # "plain", "wood" or "tiles"
    contrast: float = 0.04  # of the texture, relative to the colour
    scale_cm: float = 3.0  # grain of plain, width of a plank, side of a tile
    seed: int = 0
    gloss: float = 0.0  # brightness of the lamp's reflection, relative to white paper


@dataclass(frozen=True)
class Box:
    """An upright box; x, z is the middle of its base."""

    name: str
    x_cm: float
    z_cm: float
    width_cm: float  # along x at yaw 0
    depth_cm: float  # along z at yaw 0
    height_cm: float
    yaw_rad: float
    material: Material
    base_cm: float = 0.0  # height of its underside

    @property
    def reach_cm(self) -> float:
        """Radius of the circle round the base."""
        return math.hypot(self.width_cm, self.depth_cm) / 2


@dataclass(frozen=True)
class Cylinder:
    """An upright cylinder; x, z is the middle of its base."""

    name: str
    x_cm: float
    z_cm: float
    radius_cm: float
    height_cm: float
    material: Material
    base_cm: float = 0.0  # height of its underside

    @property
    def reach_cm(self) -> float:
        """Radius of the base."""
        return self.radius_cm


@dataclass(frozen=True)
class Cone:
    """An upright truncated cone, such as a flower pot; x, z is the middle of its base."""

    name: str
    x_cm: float
    z_cm: float
    radius_cm: float  # of its underside
    top_radius_cm: float  # 0 for a tip
    height_cm: float
    material: Material
    base_cm: float = 0.0  # height of its underside

    @property
    def reach_cm(self) -> float:
        """Radius where it is widest."""
        return max(self.radius_cm, self.top_radius_cm)


@dataclass(frozen=True)
class Ball:
    """A ball; x, z is below its middle."""

    name: str
    x_cm: float
    z_cm: float
    radius_cm: float
    material: Material
    base_cm: float = 0.0  # height of its lowest point

    @property
    def reach_cm(self) -> float:
        """How far it reaches sideways."""
        return self.radius_cm


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid; x, z is below its middle."""

    name: str
    x_cm: float
    z_cm: float
    radii_cm: tuple[float, float, float]  # to the right, up and ahead when neither turned nor rolled
    yaw_rad: float
    material: Material
    base_cm: float = 0.0  # height of its lowest point
    roll_rad: float = 0.0  # about its axis ahead; lifts its right side

    @property
    def half_axes_cm(self) -> np.ndarray:
        """(3, 3): one half axis a row, in world axes."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        right, ahead, up = np.array([c, 0, -s]), np.array([s, 0, c]), np.array([0, -1.0, 0])
        c, s = math.cos(self.roll_rad), math.sin(self.roll_rad)
        return np.array(self.radii_cm)[:, None] * np.array([c * right + s * up, c * up - s * right, ahead])

    @property
    def reach_cm(self) -> float:
        """Its longest half axis."""
        return max(self.radii_cm)


@dataclass(frozen=True)
class Board:
    """A rectangle without thickness, seen from both sides; x, z is the middle of its lower edge."""

    name: str
    x_cm: float
    z_cm: float
    width_cm: float
    height_cm: float  # along the board
    yaw_rad: float
    material: Material
    base_cm: float = 0.0  # height of its lower edge
    lean_rad: float = 0.0  # of its upper edge away from the viewer; a quarter turn lays it flat

    @property
    def reach_cm(self) -> float:
        """Radius of the circle round its lower edge that holds all of it."""
        return math.hypot(self.width_cm / 2, self.height_cm * math.sin(self.lean_rad))


Shape = Box | Cylinder | Cone | Ball | Ellipsoid | Board


@dataclass(frozen=True)
class Group:
    """Several shapes that are one thing, such as a bottle; shapes of one name are one part of it."""

    name: str
    pieces: tuple[Shape, ...]

    @property
    def x_cm(self) -> float:
        """Place of the first piece."""
        return self.pieces[0].x_cm

    @property
    def z_cm(self) -> float:
        """Place of the first piece."""
        return self.pieces[0].z_cm

    @property
    def reach_cm(self) -> float:
        """Radius of the circle round the place that holds all pieces."""
        return max(math.hypot(p.x_cm - self.x_cm, p.z_cm - self.z_cm) + p.reach_cm for p in self.pieces)


Thing = Shape | Group


@dataclass(frozen=True)
class Mover:
    """A thing that goes to and fro between its place and another one, at one speed."""

    thing: Thing
    other_end_cm: tuple[float, float]  # x, z
    speed_cm_s: float
    ahead_s: float = 0.0  # since when it has been under way at time 0

    def at(self, t_s: float) -> Thing:
        """The thing where it is at a time; `ahead_s` before 0 it set out from its own place."""
        way = (self.other_end_cm[0] - self.thing.x_cm, self.other_end_cm[1] - self.thing.z_cm)
        length = math.hypot(*way)
        gone = self.speed_cm_s * (t_s + self.ahead_s) % (2 * length)
        part = min(gone, 2 * length - gone) / length
        return moved(self.thing, part * way[0], part * way[1])


def moved(thing: Thing, right_cm: float, ahead_cm: float) -> Thing:
    """The same thing elsewhere."""
    if isinstance(thing, Group):
        pieces = tuple(_moved(piece, right_cm, ahead_cm) for piece in thing.pieces)
        return replace(thing, pieces=pieces)
    return _moved(thing, right_cm, ahead_cm)


def _moved(shape: Shape, right_cm: float, ahead_cm: float) -> Shape:
    return replace(shape, x_cm=shape.x_cm + right_cm, z_cm=shape.z_cm + ahead_cm)


def pieces_of(thing: Thing) -> tuple[Shape, ...]:
    """The shapes that make it up."""
    return thing.pieces if isinstance(thing, Group) else (thing,)
