"""The scenes of the paper's section 5, with its distances; a seed varies what the paper leaves open.

Seed 0 varies nothing. The others vary sizes by up to 4 %, places to the side, colours, light and texture.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from host.camera.lens import Lens
from host.pose import Pose
from host.sim.render import Renderer
from host.sim.things import Ball, Board, Box, Cone, Cylinder, Ellipsoid, Group, Material, Rgb, Thing, moved
from host.sim.world import Room, World

LENS = Lens(320, 240, 371.0, 371.0, 159.5, 119.5)  # the paper's camera: f follows from its Table 1
CAMERA_HEIGHT_CM = 8.7  # so that boxes with Table 1's lower corners stand on the floor
START = Pose.planar(0.0, 0.0, 0.0)


def experiment_1(seed: int = 0) -> World:
    """A red and a green box, front faces at 85 cm; seed 0 has the corners of the paper's Table 1.

    Sideways the boxes move by up to 1.5 cm. The paper's frames are 10 cm apart.
    """
    vary = _Variation(0xE1, seed)
    things = []
    for name, x, width, depth, height, rgb in (
        ("red_box", -15.75, 20.5, 12.0, 24.95, (196, 38, 36)),
        ("green_box", 16.0, 15.0, 11.0, 23.9, (40, 146, 62)),
    ):
        x += vary.aside(1.5)
        width, depth, height = vary.size(width), vary.size(depth), vary.size(height)
        box = Box(name, x, 85.0 + depth / 2, width, depth, height, 0.0, vary.paint(rgb))
        things.append(box)
    room = _room(vary, half_width_cm=150.0, front_cm=200.0, height_cm=178.7)
    return World("experiment_1", room, tuple(things), CAMERA_HEIGHT_CM, LENS, (0.0, 30.0), seed)


def experiment_2(seed: int = 0) -> World:
    """A turned box, a tomato and a pepper, at the average visible depths of the paper's Table 2.

    Those are 92.33, 47 and 68.5 cm. Sideways things move by up to 1 cm; the box is turned by 17 to 33
    degrees to either side. The paper's frames are 5 cm apart.
    """
    vary = _Variation(0xE2, seed)
    yaw = math.radians(25.0 + vary.aside(8.0)) * vary.sign()
    box = Box(
        "box", vary.aside(1.0), 92.0, vary.size(21.0), vary.size(7.5), vary.size(24.0), yaw,
        vary.paint((58, 96, 170)),
    )  # fmt: skip
    wide = vary.size(3.65)
    tomato = Ellipsoid(
        "tomato", -12.0 + vary.aside(1.0), 47.0, (wide, 0.84 * wide, wide), 0.0,
        vary.paint((190, 30, 24), gloss=0.12),
    )  # fmt: skip
    pepper = _pepper(vary, 16.5 + vary.aside(1.0), 68.5)
    room = _room(vary, half_width_cm=150.0, front_cm=120.0, height_cm=178.7)
    world = World("experiment_2", room, (box, tomato, pepper), CAMERA_HEIGHT_CM, LENS, (0.0, 20.0), seed)
    return _at_depths(world, {"box": 92.33, "tomato": 47.0, "pepper": 68.5})


def experiment_3(seed: int = 0) -> World:
    """A pot and a leafy tree at 712.5 and 725 cm, the average visible depths of the paper's Table 3.

    Two boards and a window, flat and facing the camera, stand and hang beside and behind them. Sideways
    things move by up to 8 cm. The paper's frames are 100 and 200 cm from the first.
    """
    vary = _Variation(0xE3, seed)
    pot = Cone(
        "pot", -62.0 + vary.aside(8.0), 712.5, vary.size(22.0), vary.size(33.0), vary.size(56.0),
        vary.paint((168, 82, 52), scale_cm=6.0),
    )  # fmt: skip
    things = (
        pot,
        _tree(vary, 38.0 + vary.aside(8.0), 725.0),
        Board(
            "blue_board", -142.0 + vary.aside(8.0), 690.0, vary.size(52.0), vary.size(74.0), 0.0,
            vary.paint((42, 84, 156), scale_cm=10.0),
        ),
        Board(
            "yellow_board", 142.0 + vary.aside(8.0), 760.0, vary.size(56.0), vary.size(62.0), 0.0,
            vary.paint((222, 178, 40), scale_cm=10.0),
        ),
        Board(
            "window", -80.0 + vary.aside(8.0), 898.0, vary.size(90.0), vary.size(60.0), 0.0,
            vary.paint((70, 84, 98), contrast=0.01, scale_cm=20.0), base_cm=90.0,
        ),
    )  # fmt: skip
    room = _room(vary, half_width_cm=320.0, front_cm=900.0, height_cm=320.0)
    world = World("experiment_3", room, things, CAMERA_HEIGHT_CM, LENS, (0.0, 250.0), seed)
    return _at_depths(world, {"pot": 712.5, "tree": 725.0})


def slants(seed: int = 0, angle_deg: float = 30.0) -> World:
    """Boards turned to the left, to the right and leaning back by one angle, 0 to 60 degrees.

    A mat on the floor and a poster on either side wall show the planes of floor and walls. Half of the
    boards bear a texture.
    """
    vary = _Variation(0x51A, seed)
    angle = math.radians(angle_deg)
    colours: list[Rgb] = [(190, 44, 40), (44, 92, 170), (40, 140, 66), (214, 168, 36), (120, 60, 140)]
    colours = [colours[k] for k in vary.rng.permutation(len(colours))]

    def paint(rgb: Rgb) -> Material:
        pattern, contrast = vary.rng.choice(["plain", "wood", "tiles"]), vary.rng.choice([0.02, 0.12])
        return vary.paint(rgb, str(pattern), contrast, 4.0)

    half_width, front = vary.size(66.0), vary.size(210.0)
    things = (
        Board(
            "turned_left", -20.0 + vary.aside(2.0), 84.0 + vary.aside(6.0), vary.size(18.0), vary.size(17.0),
            -angle, paint(colours[0]),
        ),
        Board(
            "turned_right", 22.0 + vary.aside(2.0), 92.0 + vary.aside(6.0), vary.size(19.0), vary.size(20.0),
            angle, paint(colours[1]),
        ),
        Board(
            "leaning", 1.0 + vary.aside(1.5), 100.0 + vary.aside(6.0), vary.size(17.0), vary.size(20.0),
            0.0, paint(colours[2]), lean_rad=angle,
        ),
        Board(
            "mat", vary.aside(3.0), 60.0 + vary.aside(2.0), vary.size(20.0), vary.size(20.0),
            0.0, vary.paint(colours[3]), base_cm=0.02, lean_rad=math.pi / 2,
        ),
        Board(
            "poster_left", 0.05 - half_width, 185.0, vary.size(28.0), vary.size(22.0),
            -math.pi / 2, vary.paint(colours[4]), base_cm=26.0,
        ),
        Board(
            "poster_right", half_width - 0.05, 188.0, vary.size(26.0), vary.size(24.0),
            math.pi / 2, vary.paint(colours[0]), base_cm=28.0,
        ),
    )  # fmt: skip
    room = _room(vary, half_width, front, height_cm=178.7)
    side = vary.paint((190, 206, 220), contrast=0.03, scale_cm=6.0)
    room = replace(room, left_wall=side, right_wall=side)
    return World("slants", room, things, 14.0, LENS, (0.0, 30.0), seed)


# --- Things ----------------------------------------------------------------------------------------


def _pepper(vary: _Variation, x_cm: float, z_cm: float) -> Group:
    """A bell pepper lying on its side: four lobes and a stalk."""
    skin = vary.paint((52, 128, 40), gloss=0.1)
    heading = math.radians(10.0 + vary.aside(8.0)) * vary.sign()
    long, thick = vary.size(4.6), vary.size(2.2)
    c, s = math.cos(heading), math.sin(heading)
    pieces = []
    for aside, up, part in ((0.0, 0.0, 1.0), (1.1, 0.6, 0.94), (-1.1, 0.4, 0.9), (0.0, 1.4, 0.92)):
        radii = (long * part, thick * part, thick * part)
        place = (x_cm - s * aside, z_cm + c * aside)
        pieces.append(Ellipsoid("skin", *place, radii, -heading, skin, up, math.radians(4.0)))
    end = long * 0.95
    stalk = vary.paint((84, 132, 52))
    pieces.append(
        Ellipsoid("stalk", x_cm + c * end, z_cm + s * end, (1.5, 0.5, 0.5), -heading, stalk, 2.7, 0.5)
    )
    return Group("pepper", tuple(pieces))


def _tree(vary: _Variation, x_cm: float, z_cm: float) -> Group:
    """A small tree: a trunk, and leaves in clusters, so that the outline is ragged and the depth uneven."""
    trunk = Cylinder("trunk", x_cm, z_cm, vary.size(5.5), 62.0, vary.paint((96, 70, 48), scale_cm=5.0))
    across, height = vary.size(42.0), vary.size(44.0)
    rng = vary.rng
    clusters = []
    for _ in range(110):
        direction = rng.standard_normal(3)
        direction *= rng.uniform(0.35, 1.0) ** (1 / 3) / np.linalg.norm(direction)
        radius = rng.uniform(5.0, 13.0)
        x, up, z = direction * (across, height, across)
        green = (62 + rng.uniform(-14, 14), 118 + rng.uniform(-18, 18), 44 + rng.uniform(-10, 10))
        leaves = Material(green, contrast=0.3, scale_cm=5.0, seed=int(rng.integers(1 << 31)))
        clusters.append(Ball("leaves", x_cm + x, z_cm + z, radius, leaves, 98.0 + up - radius))
    return Group("tree", (trunk, *clusters))


def _at_depths(world: World, mean_cm: dict[str, float]) -> World:
    """Things shifted ahead or back until their average visible depths from the start are these."""
    for _ in range(4):
        renderer = Renderer(world)
        seen = renderer.truth(START)
        depth = {name: seen.object_mean_z_cm[k] for k, name in renderer.object_names.items()}
        things: list[Thing] = []
        for thing in world.things:
            off = mean_cm[thing.name] - depth[thing.name] if thing.name in mean_cm else 0.0
            things.append(moved(thing, 0.0, off))
        world = replace(world, things=tuple(things))
    return world


# --- What the paper leaves open --------------------------------------------------------------------


class _Variation:
    """Draws what a seed varies."""

    def __init__(self, scene: int, seed: int) -> None:
        self.rng = np.random.default_rng((scene, seed))
        self._by = 0.0 if seed == 0 else 1.0

    def aside(self, most: float) -> float:
        """An offset within `most`."""
        return self._by * self.rng.uniform(-most, most)

    def size(self, cm: float) -> float:
        """A length within 4 % of this one."""
        return cm * (1.0 + self.aside(0.04))

    def sign(self) -> float:
        """1 or -1."""
        return 1.0 if self.aside(1.0) >= 0.0 else -1.0

    def paint(
        self,
        rgb: Rgb,
        pattern: str = "plain",
        contrast: float = 0.02,
        scale_cm: float = 3.0,
        gloss: float = 0.0,
    ) -> Material:
        """About this colour and grain."""
        r, g, b = (float(np.clip(c + self.aside(8.0), 0, 255)) for c in rgb)
        contrast, scale_cm = contrast * (1.0 + self.aside(0.4)), scale_cm * (1.0 + self.aside(0.2))
        seed = int(self.rng.integers(1 << 31))
        return Material((r, g, b), pattern, contrast, scale_cm, seed, gloss * (1.0 + self.aside(0.3)))


def _room(vary: _Variation, half_width_cm: float, front_cm: float, height_cm: float) -> Room:
    wall = vary.paint((232, 226, 210), contrast=0.03, scale_cm=6.0)
    return Room(
        -half_width_cm, half_width_cm, -120.0, front_cm, height_cm,
        floor=vary.paint((210, 176, 134), "wood", contrast=0.12, scale_cm=14.0),
        left_wall=wall, right_wall=wall, back_wall=wall, front_wall=wall,
        ceiling=Material((236, 236, 232), contrast=0.0),
        lamp_cm=(60.0 + vary.aside(40.0), 0.9 * height_cm, 0.2 * front_cm - 80.0 + vary.aside(30.0)),
    )  # fmt: skip
