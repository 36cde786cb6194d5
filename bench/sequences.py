"""Sequences to track for long: a camera swaying before a table, a robot in a room, and folders with truth."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from host.camera.lens import Lens
from host.errors import InputError
from host.pose import Pose
from host.record.sequence import read_sequence
from host.sim.drive_scenes import OBJECT_COLOURS, room
from host.sim.render import Renderer, Webcam, WebcamModel
from host.sim.things import Ball, Box, Cylinder, Material, Rgb, Thing
from host.sim.world import Room, World

FRAME_S = 0.1


@dataclass(frozen=True)
class Truth:
    """What one picture shows, for scoring alone."""

    object_id: np.ndarray  # (H, W)
    part_id: np.ndarray  # (H, W)
    foreground: dict[int, tuple[int, ...]]  # parts of every object that is no part of the room


@dataclass(frozen=True)
class Shot:
    """One picture, whence it was taken, and what is true of it."""

    image: np.ndarray  # (H, W, 3) uint8, BGR
    pose: Pose
    truth: Truth | None = None
    depth_cm: np.ndarray | None = None  # (H, W) measured along the axis, 0 where it was not


@dataclass(frozen=True)
class LongRun:
    """Pictures from a simulated world along a way."""

    name: str
    world: World
    poses: tuple[Pose, ...]

    def shots(self, truth_from: int = 0, truth_every: int = 1) -> Iterator[Shot]:
        """All pictures; the truth only of those that will be scored, since it takes a while."""
        renderer = Renderer(self.world)
        webcam = Webcam(WebcamModel(), self.world.lens, self.world.seed)
        foreground = {
            k: tuple(part.id for part in renderer.parts if part.object_id == k)
            for k in renderer.object_names
            if k not in renderer.background_ids
        }
        for seq, pose in enumerate(self.poses):
            image = webcam.take(renderer.light(pose, webcam.model.psf_px), pose.t_s, seq)
            truth = None
            if seq >= truth_from and seq % truth_every == 0:
                true = renderer.truth(pose)
                truth = Truth(true.object_id.astype(int), true.part_id.astype(int), foreground)
            yield Shot(image, pose, truth)


def table_top(seed: int, frames: int) -> LongRun:
    """Five things before a wall; the camera sways a hand's breadth to and fro and sideways."""
    rng = np.random.default_rng((0x7AB1E, seed))
    wall = Material(_pale(rng), contrast=0.03, scale_cm=6.0, seed=1)
    table = Material(_pale(rng), "wood", 0.08, 12.0, seed=2)
    shell = Room(
        -150.0, 150.0, -120.0, rng.uniform(150, 190), 180.0,
        floor=table, left_wall=wall, right_wall=wall, back_wall=wall, front_wall=wall, ceiling=wall,
        lamp_cm=(rng.uniform(-60, 60), 160.0, -40.0),
    )  # fmt: skip
    lens = Lens(320, 240, 371.0, 371.0, 159.5, 119.5)
    world = World("table", shell, (), rng.uniform(13, 18), lens, (0.0, 20.0), seed)
    for colour in rng.permutation(len(OBJECT_COLOURS))[:5]:
        for _ in range(100):
            thing = _small_thing(rng, int(colour))
            if world.distance_cm(np.array([thing.x_cm, thing.z_cm]))[0] > thing.reach_cm + 2:
                world = replace(world, things=(*world.things, thing))
                break
    poses = []
    for k in range(frames):
        beat = 2 * math.pi * k / 75
        x, z, heading = 5 * math.sin(beat), 5 * (1 - math.cos(beat / 2)), 0.04 * math.sin(1.3 * beat)
        poses.append(Pose.planar(x, z, heading, t_s=k * FRAME_S))
    return LongRun(f"table-top {seed}", world, tuple(poses))


def _pale(rng: np.random.Generator) -> Rgb:
    red, green, blue = rng.uniform(130, 235, 3)
    return float(red), float(green), float(blue)


def _small_thing(rng: np.random.Generator, colour: int) -> Thing:
    z = rng.uniform(65, 120)
    x = z * rng.uniform(-0.36, 0.36)
    material = Material(OBJECT_COLOURS[colour], contrast=0.04, scale_cm=2.0, seed=colour)
    kind = rng.integers(3)
    if kind == 0:
        width, depth, height = rng.uniform(7, 18, 3)
        return Box("box", x, z, width, depth, height, rng.uniform(-0.6, 0.6), material)
    if kind == 1:
        return Cylinder("cylinder", x, z, rng.uniform(3, 6), rng.uniform(8, 18), material)
    return Ball("ball", x, z, rng.uniform(4, 7), material)


def corridor(seed: int, frames: int) -> LongRun:
    """Up and down a furnished room with a wobbling heading, as far as there is room ahead."""
    world = room(seed)
    bearing = math.atan2(*world.goal_cm)
    ahead = np.arange(0.0, math.hypot(*world.goal_cm), 2.0)
    places = ahead[:, None] * np.array([math.sin(bearing), math.cos(bearing)])
    blocked = np.flatnonzero(world.distance_cm(places) < 20.0)
    length = float(ahead[blocked[0] - 1]) if len(blocked) else float(ahead[-1])
    poses = []
    for k in range(frames):
        along = length * 0.5 * (1 - math.cos(1.5 * k / max(length, 30.0)))  # at most 0.75 cm a frame
        x, z = along * math.sin(bearing), along * math.cos(bearing)
        heading = bearing + 0.06 * math.sin(2 * math.pi * k / 40)
        poses.append(Pose.planar(x, z, heading, t_s=k * FRAME_S))
    return LongRun(f"corridor {seed}", world, tuple(poses))


def recorded(folder: Path) -> tuple[list[Shot], Lens]:
    """The pictures of a sequence folder, with true ids or measured depths where it has them.

    Raises
    ------
    InputError
        naming what is wrong with the folder.
    """
    sequence = read_sequence(folder)
    count = len(sequence.frames)
    truths, depths = _recorded_truths(folder, count), _recorded_depths(folder, count)
    shots = [
        Shot(sequence.image(k), frame.pose, truths[k], depths[k]) for k, frame in enumerate(sequence.frames)
    ]
    return shots, sequence.lens


def _recorded_truths(folder: Path, count: int) -> Sequence[Truth | None]:
    described, ids = folder / "truth" / "truth.json", folder / "truth" / "ids.npz"
    if not (described.is_file() and ids.is_file()):
        return [None] * count
    objects = json.loads(described.read_text())["objects"]
    foreground = {o["id"]: tuple(o["parts"]) for o in objects if not o["background"]}
    with np.load(ids) as maps:
        _check_count(ids, len(maps["object_id"]), count)
        return [
            Truth(whole.astype(int), part.astype(int), foreground)
            for whole, part in zip(maps["object_id"], maps["part_id"], strict=True)
        ]


def _recorded_depths(folder: Path, count: int) -> Sequence[np.ndarray | None]:
    described, files = folder / "truth" / "depth.json", sorted((folder / "truth" / "depth").glob("*.png"))
    if not (described.is_file() and files):
        return [None] * count
    _check_count(files[0].parent, len(files), count)
    unit_cm = 100 * json.loads(described.read_text())["depth_unit_m"]
    return [unit_cm * _depth_image(file) for file in files]


def _depth_image(file: Path) -> np.ndarray:
    depth = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    if depth is None:
        raise InputError(f"{file}: is no image that can be read; copy the sequence anew")
    return depth.astype(np.float32)


def _check_count(path: Path, found: int, count: int) -> None:
    if found != count:
        raise InputError(f"{path}: tells of {found} frames, but there are {count} pictures; make them equal")
