"""Drives before rendered scenes, for comparing ways to depth: pictures, poses, and the truth for scoring."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from host.camera.lens import Lens
from host.pose import Pose
from host.sim.experiment_scenes import experiment_1, experiment_2, experiment_3
from host.sim.export import Way
from host.sim.render import Renderer, TrueFrame, Webcam, WebcamModel
from host.sim.tabletop_scenes import tabletop
from host.sim.world import World

WHOLE_SHARE = 0.993  # of an object's own picture that must be visible
SMALLEST_PX = 200  # objects with fewer pixels in the first frame are left out


@dataclass(frozen=True)
class Scene:
    """A kind of scene, and how it is driven through."""

    name: str
    make: Callable[[int], World]
    travel_cm: float
    frames: int


SCENES = (
    Scene("experiment 1, 10 cm", experiment_1, 10.0, 16),
    Scene("experiment 2, 5 cm", experiment_2, 5.0, 11),
    Scene("experiment 3, 100 cm", experiment_3, 100.0, 21),
    Scene("experiment 3, 200 cm", experiment_3, 200.0, 41),
    Scene("table-tops, 8 cm", tabletop, 8.0, 11),
)


@dataclass(frozen=True)
class Target:
    """An object that is whole, neither hidden nor cut by the border, in the first and in the last frame."""

    name: str
    first_mask: np.ndarray  # (H, W) bool
    last_mask: np.ndarray  # (H, W) bool
    pixels: np.ndarray  # (F,) of its mask in every frame
    true_cm: float  # mean depth of its visible surface at the last frame


@dataclass(frozen=True)
class Take:
    """One drive: what a robot gets, and what is true of it."""

    images: tuple[np.ndarray, ...]  # (H, W, 3) uint8, BGR
    odometry: tuple[Pose, ...]  # exact in travel; knows nothing of the shaking
    lens: Lens
    true_poses: tuple[Pose, ...]
    targets: tuple[Target, ...]


def take(scene: Scene, seed: int, shake_deg: float) -> Take:
    """Drive and render one scene."""
    world = scene.make(seed)
    renderer, model = Renderer(world), WebcamModel()
    webcam = Webcam(model, world.lens, seed)
    way = Way(scene.frames, scene.travel_cm / (scene.frames - 1), shake_rad=math.radians(shake_deg))
    poses = tuple(way.poses(seed))
    images = tuple(
        webcam.take(renderer.light(pose, model.psf_px), pose.t_s, seq) for seq, pose in enumerate(poses)
    )
    targets = _targets(world, renderer, poses)
    return Take(images, tuple(way.odometry(seed)), world.lens, poses, targets)


def _targets(world: World, renderer: Renderer, poses: Sequence[Pose]) -> tuple[Target, ...]:
    truths = [renderer.truth(pose) for pose in poses]
    last = truths[-1]
    things = [thing for thing in renderer.object_names if thing not in renderer.background_ids]
    out = []
    for thing, shape in zip(things, world.things, strict=True):
        masks = [truth.object_id == thing for truth in truths]
        alone = Renderer(replace(world, things=(shape,)))
        if masks[0].sum() < SMALLEST_PX or not all(
            _is_whole(masks[k], alone.truth(poses[k]), alone.background_ids) for k in (0, -1)
        ):
            continue
        parts = [part.id for part in renderer.parts if part.object_id == thing]
        area = last.part_area_px[parts]
        mean = float(area @ last.part_mean_z_cm[parts] / area.sum())
        pixels = np.array([mask.sum() for mask in masks])
        out.append(Target(renderer.object_names[thing], masks[0], masks[-1], pixels, mean))
    return tuple(out)


def _is_whole(mask: np.ndarray, alone: TrueFrame, background: frozenset[int]) -> bool:
    """Whether an object touches no border and shows all that it would if it stood there alone."""
    if mask[[0, -1]].any() or mask[:, [0, -1]].any():
        return False
    full = ~np.isin(alone.object_id, list(background))
    return bool(mask.sum() >= WHOLE_SHARE * full.sum())
