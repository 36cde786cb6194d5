"""Writes what a camera sees on a way through a simulated world as a sequence folder with its truth.

python -m host.sim.export FOLDER [--camera URI] [--frames N] [--step CM] [--turn DEGREES] [--shake DEGREES]
                                 [--encoder CM] [--move THING=CM] [--ideal]
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from host.errors import UsageError, run_command
from host.pose import Pose
from host.record.sequence import write_sequence
from host.sim.render import IDEAL, Renderer, TrueFrame, Webcam, WebcamModel
from host.sim.scenes import world_from_uri
from host.sim.things import moved
from host.sim.world import World

MOST_FRAMES = 1_000_000
PERIOD_S = 0.1  # between frames


@dataclass(frozen=True)
class Way:
    """Poses at equal steps, turning evenly; the first is the world's origin."""

    frames: int = 11
    step_cm: float = 1.0  # along the heading
    turn_rad: float = 0.0  # between frames, to the right
    shake_rad: float = 0.0  # greatest pitch and yaw of the camera; the first frame is taken at rest
    encoder_cm: float = 0.0  # travel between two counts of the wheels; 0 for an odometer without steps

    def poses(self, seed: int = 0) -> Iterator[Pose]:
        """Where the camera truly is, one pose a frame."""
        rng = np.random.default_rng((0x5A4E, seed))
        for k, pose in enumerate(self._planar([self.step_cm] * self.frames)):
            pitch, yaw = rng.uniform(-self.shake_rad, self.shake_rad, 2) * (k > 0)
            yield replace(pose, rotation=pose.rotation @ _turned(pitch, yaw)) if self.shake_rad else pose

    def odometry(self, seed: int = 0) -> Iterator[Pose]:
        """What the robot makes of it: it knows nothing of shaking, and of travel what the wheels count.

        The first count comes anywhere within the first `encoder_cm`. Sigmas state how far to trust it.
        """
        counted = np.arange(self.frames + 1) * self.step_cm
        if self.encoder_cm:
            phase = np.random.default_rng((0xE2C0, seed)).random()
            counted = self.encoder_cm * np.floor(counted / self.encoder_cm + phase)
        doubts = {
            "sigma_z_cm": self.encoder_cm / math.sqrt(12.0),
            "sigma_rot_rad": self.shake_rad / math.sqrt(3.0),
        }
        for pose in self._planar(np.diff(counted)):
            yield replace(pose, **doubts)

    def _planar(self, steps_cm: Iterable[float]) -> Iterator[Pose]:
        x = z = heading = 0.0
        for k, step_cm in enumerate(steps_cm):
            yield Pose.planar(x, z, heading, t_s=k * PERIOD_S)
            middle = heading + self.turn_rad / 2
            x, z = x + step_cm * math.sin(middle), z + step_cm * math.cos(middle)
            heading += self.turn_rad


@dataclass(frozen=True)
class Mover:
    """A thing that does not stand still."""

    name: str
    right_cm: float  # between frames, along the world's x

    def world_at(self, world: World, frame: int) -> World:
        """The world when the frame is taken."""
        things = tuple(
            moved(thing, frame * self.right_cm, 0.0) if thing.name == self.name else thing
            for thing in world.things
        )
        return replace(world, things=things)


def export(folder: Path, world: World, way: Way, model: WebcamModel, mover: Mover | None = None) -> None:
    """Write frames, odometry, lens and ``truth/`` (truth.json, ids.npz, depth.npz).

    Raises
    ------
    UsageError
        where the folder has something in it already or cannot be written, or the world has no such mover.
    """
    if mover and mover.name not in {thing.name for thing in world.things}:
        known = ", ".join(thing.name for thing in world.things)
        raise UsageError(f"nothing called {mover.name!r} to move in {world.name}; there are {known}")
    webcam = Webcam(model, world.lens, world.seed)
    poses = list(way.poses(world.seed))
    worlds = [mover.world_at(world, k) if mover else world for k in range(way.frames)]
    renderers = [Renderer(each) for each in worlds]

    def pictures() -> Iterator[tuple[np.ndarray, Pose]]:
        for seq, said in enumerate(way.odometry(world.seed)):
            light = renderers[seq].light(poses[seq], model.psf_px)
            yield webcam.take(light, said.t_s, seq), said

    write_sequence(folder, world.lens, pictures())
    truths = [renderer.truth(pose) for renderer, pose in zip(renderers, poses, strict=True)]
    frames = [
        _frame_truth(k, renderers[k], truths[k], poses[k], _full_areas(worlds[k], renderers[k], poses[k]))
        for k in range(way.frames)
    ]
    scene = _scene_truth(renderers[0], mover.name if mover else None)
    (folder / "truth").mkdir()
    (folder / "truth" / "truth.json").write_text(json.dumps({**scene, "frames": frames}))
    np.savez_compressed(folder / "truth" / "depth.npz", depth=np.stack([t.depth_cm for t in truths]))
    np.savez_compressed(
        folder / "truth" / "ids.npz",
        part_id=np.stack([t.part_id for t in truths]),
        object_id=np.stack([t.object_id for t in truths]),
    )


def _turned(pitch_rad: float, yaw_rad: float) -> np.ndarray:
    """(3, 3) of a camera that looks up by a pitch, then to the right by a yaw."""
    c, s = math.cos(pitch_rad), math.sin(pitch_rad)
    up = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    return Pose.planar(0.0, 0.0, yaw_rad).rotation @ up


def _scene_truth(renderer: Renderer, mover: str | None) -> dict[str, Any]:
    objects = [
        {
            "id": object_id,
            "name": name,
            "background": object_id in renderer.background_ids,
            "moving": name == mover,
            "parts": [part.id for part in renderer.parts if part.object_id == object_id],
        }
        for object_id, name in renderer.object_names.items()
    ]
    parts = [
        {"id": part.id, "object": part.object_id, "name": part.name, "planar": part.planar}
        for part in renderer.parts
    ]
    return {"objects": objects, "parts": parts}


def _full_areas(world: World, renderer: Renderer, pose: Pose) -> np.ndarray:
    """Area of every part as if its object stood alone in the room, by part id."""
    alone = [Renderer(replace(world, things=(thing,))) for thing in world.things]
    room_parts = sum(part.object_id in renderer.background_ids for part in renderer.parts)
    areas = [single.truth(pose).part_area_px[room_parts + 1 :] for single in alone]
    return np.concatenate([np.full(room_parts + 1, np.nan), *areas])


def _frame_truth(
    number: int, renderer: Renderer, truth: TrueFrame, pose: Pose, full_area: np.ndarray
) -> dict[str, Any]:
    objects: dict[str, Any] = {}
    parts: dict[str, Any] = {}
    for object_id in renderer.object_names:
        own = [part for part in renderer.parts if part.object_id == object_id]
        area = float(truth.object_area_px[object_id])
        if area == 0.0:
            continue
        objects[str(object_id)] = _surface_truth(
            area,
            float(truth.object_mean_z_cm[object_id]),
            float(full_area[[part.id for part in own]].sum()),
            truth.object_id == object_id,
        )
        for part in own:
            if truth.part_area_px[part.id] > 0.0:
                parts[str(part.id)] = _surface_truth(
                    float(truth.part_area_px[part.id]),
                    float(truth.part_mean_z_cm[part.id]),
                    float(full_area[part.id]),
                    truth.part_id == part.id,
                ) | _corners(renderer, part.corners_cm, pose)
    camera = {"position_cm": pose.position_cm.tolist(), "rotation": pose.rotation.tolist()}
    return {"i": number, "camera": camera, "objects": objects, "parts": parts}


def _surface_truth(area: float, z_mean: float, full_area: float, mask: np.ndarray) -> dict[str, Any]:
    touches = bool(mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any())
    known = {"area_px": area, "z_mean": z_mean, "touches_border": touches}
    if math.isnan(full_area):  # the room itself
        return known
    return known | {"full_area": full_area, "visible_fraction": area / full_area}


def _corners(renderer: Renderer, corners_cm: np.ndarray, pose: Pose) -> dict[str, Any]:
    camera = (corners_cm - pose.position_cm) @ pose.rotation
    if not len(camera) or camera[:, 2].min() < 1.0:
        return {}
    pixels = renderer.lens.to_pixels(camera[:, :2] / camera[:, 2:])
    return {"corners_px": pixels.tolist(), "corners_cam": camera.tolist()}


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message}; see --help")


def _mover(text: str) -> Mover:
    name, _, step = text.partition("=")
    try:
        if not math.isfinite(step_cm := float(step)):
            raise ValueError
        return Mover(name, step_cm)
    except ValueError:
        raise UsageError(f"--move {text!r}: give a thing and its step in cm, like ball_1=0.5") from None


def main() -> None:
    """The command."""
    parser = _Parser(
        prog="python -m host.sim.export", description="Export a simulated sequence with its truth."
    )
    parser.add_argument("folder", type=Path, help="new or empty folder")
    parser.add_argument("--camera", default="sim:boxes", help="simulated world (default: %(default)s)")
    parser.add_argument("--frames", type=int, default=11, help="how many (default: %(default)s)")
    parser.add_argument("--step", type=float, default=1.0, help="cm between frames (default: %(default)s)")
    parser.add_argument("--turn", type=float, default=0.0, help="degrees between frames, to the right")
    parser.add_argument(
        "--shake", type=float, default=0.0, metavar="DEGREES", help="pitch and yaw of the camera, at most"
    )
    parser.add_argument(
        "--encoder", type=float, default=0.0, metavar="CM", help="odometry in whole counts of this travel"
    )
    parser.add_argument(
        "--move", type=_mover, metavar="THING=CM", help="a thing that moves to the right between frames"
    )
    parser.add_argument("--ideal", action="store_true", help="no blur, noise or JPEG")
    options = parser.parse_args()
    if not 1 <= options.frames <= MOST_FRAMES:
        raise UsageError(f"--frames must be from 1 to {MOST_FRAMES}, not {options.frames}")
    for name in ("shake", "encoder"):
        if not 0.0 <= getattr(options, name) < math.inf:
            raise UsageError(f"--{name} must be 0 or more, not {getattr(options, name)}")
    for name in ("step", "turn"):
        if not math.isfinite(getattr(options, name)):
            raise UsageError(f"--{name} must be a finite number, not {getattr(options, name)}")
    way = Way(
        options.frames,
        options.step,
        math.radians(options.turn),
        shake_rad=math.radians(options.shake),
        encoder_cm=options.encoder,
    )
    model = IDEAL if options.ideal else WebcamModel()
    export(options.folder, world_from_uri(options.camera), way, model, options.move)


if __name__ == "__main__":
    run_command(main)
