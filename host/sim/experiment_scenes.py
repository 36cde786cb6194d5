"""The scenes of the paper's section 5, with its distances; a seed varies what the paper leaves open."""

from __future__ import annotations

import numpy as np

from host.camera.lens import Lens
from host.sim.things import Box, Material, Rgb
from host.sim.world import Room, World

LENS = Lens(320, 240, 371.0, 371.0, 159.5, 119.5)  # the paper's camera: f follows from its Table 1
FRONT_CM = 85.0  # depth of both front faces in experiment 1


def experiment_1(seed: int = 0) -> World:
    """A red and a green box, front faces at 85 cm; Table 1 of the paper has their corners.

    Seed 0 is the paper's; others vary sizes by up to 4 %, places by up to 1.5 cm to the side, colours, light
    and texture.
    """
    rng = np.random.default_rng((0xE1, seed))
    room = _room(rng, height_cm=178.7, front_cm=200.0)
    vary = 0.0 if seed == 0 else 1.0
    things = []
    for name, x, width, depth, height, rgb in (
        ("red_box", -15.75, 20.5, 12.0, 24.95, (196, 38, 36)),
        ("green_box", 16.0, 15.0, 11.0, 23.9, (40, 146, 62)),
    ):
        x += vary * rng.uniform(-1.5, 1.5)
        width, depth, height = (s * (1.0 + vary * rng.uniform(-0.04, 0.04)) for s in (width, depth, height))
        z = FRONT_CM + depth / 2
        things.append(Box(name, x, z, width, depth, height, 0.0, _painted(rng, rgb)))
    return World("experiment_1", room, tuple(things), 8.7, LENS, (0.0, 30.0), seed)


# --- What the paper leaves open --------------------------------------------------------------------


def _room(rng: np.random.Generator, height_cm: float, front_cm: float) -> Room:
    wall = _painted(rng, (232, 226, 210), contrast=0.03, scale_cm=6.0)
    return Room(
        -150.0, 150.0, -120.0, front_cm, height_cm,
        floor=_painted(rng, (210, 176, 134), "wood", contrast=0.12, scale_cm=14.0),
        left_wall=wall, right_wall=wall, back_wall=wall, front_wall=wall,
        ceiling=Material((236, 236, 232), contrast=0.0),
        lamp_cm=(60.0 + rng.uniform(-40, 40), 0.9 * height_cm, -40.0 + rng.uniform(-30, 30)),
    )  # fmt: skip


def _painted(
    rng: np.random.Generator, rgb: Rgb, pattern: str = "plain", contrast: float = 0.02, scale_cm: float = 3.0
) -> Material:
    """About this colour and grain."""
    r, g, b = (float(np.clip(c + rng.uniform(-8, 8), 0, 255)) for c in rgb)
    contrast, scale_cm = contrast * rng.uniform(0.6, 1.6), scale_cm * rng.uniform(0.8, 1.25)
    return Material((r, g, b), pattern, contrast, scale_cm, int(rng.integers(1 << 31)))
