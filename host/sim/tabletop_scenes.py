"""Table-tops: a few things of any shape standing about, some before others, some cut by the border."""

from __future__ import annotations

import colorsys
import math

import cv2
import numpy as np

from host.camera.lens import Lens
from host.sim.things import (
    Ball,
    Box,
    Cone,
    Cylinder,
    Ellipsoid,
    Group,
    Material,
    Rgb,
    Thing,
    moved,
)  # fmt: skip
from host.sim.world import Room, World

LENS = Lens(320, 240, 371.0, 371.0, 159.5, 119.5)
NEAREST_CM, FARTHEST_CM = 46.0, 132.0  # of a thing's middle
APART_CM = 1.5  # at least, between things
LEAST_CONTRAST = 28.0  # in CIELAB between a thing and what it stands before, so that it can be told from it


def tabletop(seed: int = 0) -> World:
    """Three to seven things on a table before a wall; the camera, a hand above it, looks straight ahead."""
    rng = np.random.default_rng((0x7AB1E, seed))
    wall, table = _wall_and_table(rng)
    front = rng.uniform(150.0, 230.0)
    room = Room(
        -260.0, 260.0, -120.0, front, 190.0,
        floor=table, left_wall=wall, right_wall=wall, back_wall=wall, front_wall=wall,
        ceiling=Material((236, 236, 232), contrast=0.0),
        lamp_cm=(rng.uniform(-110, 110), 170.0, rng.uniform(-70, 60)),
    )  # fmt: skip
    height = rng.uniform(7.0, 17.0)
    things: list[Thing] = []
    wanted = int(rng.integers(3, 8))
    for _ in range(400):
        if len(things) == wanted:
            break
        kind = MAKERS[rng.integers(len(MAKERS))]
        thing = kind(rng, f"{kind.__name__.strip('_')}_{len(things)}", _colour(rng, (wall.rgb, table.rgb)))
        z = rng.uniform(NEAREST_CM, FARTHEST_CM)
        reach_px = LENS.fx * thing.reach_cm / z
        cut = rng.random() < 0.12  # by the border, perhaps
        beyond = 0.5 * reach_px if cut else -1.3 * reach_px
        aside = LENS.width / 2 + beyond
        if aside <= 0.0:
            continue
        thing = moved(thing, rng.uniform(-aside, aside) * z / LENS.fx, z)
        if _has_room(thing, things) and not _hidden(thing, things):
            things.append(thing)
    return World("tabletop", room, tuple(things), height, LENS, (0.0, 15.0), seed)


# --- Things, at (0, 0) -----------------------------------------------------------------------------


def _box(rng: np.random.Generator, name: str, rgb: Rgb) -> Thing:
    w, d, h = rng.uniform(6, 19), rng.uniform(4, 15), rng.uniform(5, 22)
    return Box(name, 0.0, 0.0, w, d, h, rng.uniform(-math.pi / 4, math.pi / 4), _painted(rng, rgb))


def _ball(rng: np.random.Generator, name: str, rgb: Rgb) -> Thing:
    return Ball(name, 0.0, 0.0, rng.uniform(2.8, 6.5), _painted(rng, rgb, rng.uniform(0, 0.15)))


def _can(rng: np.random.Generator, name: str, rgb: Rgb) -> Thing:
    paint = _painted(rng, rgb, rng.uniform(0, 0.15))
    return Cylinder(name, 0.0, 0.0, rng.uniform(2.8, 5.5), rng.uniform(6, 15), paint)


def _cup(rng: np.random.Generator, name: str, rgb: Rgb) -> Thing:
    foot = rng.uniform(2.4, 4.0)
    rim, height = foot * rng.uniform(1.15, 1.5), rng.uniform(6, 12)
    return Cone(name, 0.0, 0.0, foot, rim, height, _painted(rng, rgb))


def _bottle(rng: np.random.Generator, name: str, rgb: Rgb) -> Thing:
    paint = _painted(rng, rgb, rng.uniform(0.05, 0.2))
    body, neck = rng.uniform(2.6, 4.2), rng.uniform(0.9, 1.4)
    heights = rng.uniform(8, 13), rng.uniform(2.5, 5), rng.uniform(3, 6)
    bases = 0.0, heights[0], heights[0] + heights[1]
    return Group(
        name,
        (
            Cylinder("body", 0.0, 0.0, body, heights[0], paint, bases[0]),
            Cone("body", 0.0, 0.0, body, neck, heights[1], paint, bases[1]),
            Cylinder("body", 0.0, 0.0, neck, heights[2], paint, bases[2]),
        ),
    )


def _fruit(rng: np.random.Generator, name: str, rgb: Rgb) -> Thing:
    across = rng.uniform(2.8, 5.0)
    radii = (across * rng.uniform(1.0, 1.6), across * rng.uniform(0.75, 1.0), across)
    paint = _painted(rng, rgb, rng.uniform(0.05, 0.2))
    return Ellipsoid(name, 0.0, 0.0, radii, rng.uniform(-1.2, 1.2), paint, roll_rad=rng.uniform(-0.2, 0.2))


MAKERS = (_box, _box, _box, _ball, _can, _cup, _bottle, _fruit)


# --- Places ----------------------------------------------------------------------------------------


def _has_room(thing: Thing, things: list[Thing]) -> bool:
    return all(
        math.hypot(thing.x_cm - other.x_cm, thing.z_cm - other.z_cm)
        > thing.reach_cm + other.reach_cm + APART_CM
        for other in things
    )


def _hidden(thing: Thing, things: list[Thing]) -> bool:
    """Would more than half of the width of it or of another be covered?"""
    spans = [(t.z_cm, t.x_cm / t.z_cm, t.reach_cm / t.z_cm) for t in (thing, *things)]
    for far, middle, half in spans:
        for near, other, wide in spans:
            covered = min(middle + half, other + wide) - max(middle - half, other - wide)
            if near < far and covered > half:
                return True
    return False


# --- Looks -----------------------------------------------------------------------------------------


def _wall_and_table(rng: np.random.Generator) -> tuple[Material, Material]:
    while True:
        wall = _hsv(rng.random(), rng.uniform(0.03, 0.25), rng.uniform(0.75, 0.95))
        table = _hsv(rng.random(), rng.uniform(0.1, 0.5), rng.uniform(0.45, 0.85))
        if _difference(wall, table) > LEAST_CONTRAST / 2:
            break
    pattern, contrast, scale = (
        ("plain", 0.06, 4.0), ("wood", 0.12, 10.0), ("wood", 0.15, 7.0), ("tiles", 0.05, 25.0),
    )[rng.integers(4)]  # fmt: skip
    seeds = rng.integers(1 << 31, size=2)
    return (
        Material(wall, contrast=rng.uniform(0.01, 0.04), scale_cm=6.0, seed=int(seeds[0])),
        Material(table, pattern, contrast * rng.uniform(0.5, 1.3), scale, seed=int(seeds[1])),
    )


def _colour(rng: np.random.Generator, behind: tuple[Rgb, ...]) -> Rgb:
    while True:
        rgb = _hsv(rng.random(), rng.uniform(0.45, 0.95), rng.uniform(0.3, 0.85))
        if all(_difference(rgb, other) > LEAST_CONTRAST for other in behind):
            return rgb


def _painted(rng: np.random.Generator, rgb: Rgb, gloss: float = 0.0) -> Material:
    seed = int(rng.integers(1 << 31))
    return Material(rgb, "plain", rng.uniform(0.01, 0.08), rng.uniform(1.5, 5.0), seed, gloss)


def _hsv(hue: float, saturation: float, value: float) -> Rgb:
    r, g, b = colorsys.hsv_to_rgb(hue, saturation, value)
    return 255 * r, 255 * g, 255 * b


def _difference(a: Rgb, b: Rgb) -> float:
    both = np.array([[a, b]], np.float32) / np.float32(255)
    lab = cv2.cvtColor(both, cv2.COLOR_RGB2LAB)[0]
    return float(np.linalg.norm(lab[0] - lab[1]))
