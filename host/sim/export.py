"""Writes what a camera sees on a way through a simulated world as a sequence folder with its truth.

python -m host.sim.export FOLDER [--camera URI] [--frames N] [--step CM] [--turn DEGREES] [--ideal]
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from host.errors import UsageError, run_command
from host.pose import Pose
from host.record.sequence import write_sequence
from host.sim.render import IDEAL, Renderer, TrueFrame, Webcam, WebcamModel
from host.sim.scenes import world_from_uri
from host.sim.world import World

PERIOD_S = 0.1  # between frames


@dataclass(frozen=True)
class Way:
    """Poses at equal steps, turning evenly."""

    frames: int = 11
    step_cm: float = 1.0  # along the heading
    turn_rad: float = 0.0  # between frames, to the right

    def poses(self) -> Iterator[Pose]:
        """One a frame; the first is the world's origin."""
        x = z = heading = 0.0
        for k in range(self.frames):
            yield Pose.planar(x, z, heading, t_s=k * PERIOD_S)
            middle = heading + self.turn_rad / 2
            x, z = x + self.step_cm * math.sin(middle), z + self.step_cm * math.cos(middle)
            heading += self.turn_rad


def export(folder: Path, world: World, way: Way, model: WebcamModel) -> None:
    """Write frames, poses, lens and ``truth/`` (truth.json, ids.npz, depth.npz).

    Raises
    ------
    UsageError
        where the folder has something in it already or cannot be written.
    """
    renderer = Renderer(world)
    webcam = Webcam(model, world.lens, world.seed)
    poses = list(way.poses())

    def pictures() -> Iterator[tuple[np.ndarray, Pose]]:
        for seq, pose in enumerate(poses):
            yield webcam.take(renderer.light(pose, model.psf_px), pose.t_s, seq), pose

    write_sequence(folder, world.lens, pictures())
    truths = [renderer.truth(pose) for pose in poses]
    alone = [Renderer(replace(world, things=(thing,))) for thing in world.things]
    frames = [
        _frame_truth(k, renderer, truth, pose, _full_areas(renderer, alone, pose))
        for k, (pose, truth) in enumerate(zip(poses, truths, strict=True))
    ]
    (folder / "truth").mkdir()
    (folder / "truth" / "truth.json").write_text(json.dumps({**_scene_truth(renderer), "frames": frames}))
    np.savez_compressed(folder / "truth" / "depth.npz", depth=np.stack([t.depth_cm for t in truths]))
    np.savez_compressed(
        folder / "truth" / "ids.npz",
        part_id=np.stack([t.part_id for t in truths]),
        object_id=np.stack([t.object_id for t in truths]),
    )


def _scene_truth(renderer: Renderer) -> dict[str, Any]:
    objects = [
        {
            "id": object_id,
            "name": name,
            "background": object_id in renderer.background_ids,
            "moving": False,
            "parts": [part.id for part in renderer.parts if part.object_id == object_id],
        }
        for object_id, name in renderer.object_names.items()
    ]
    parts = [
        {"id": part.id, "object": part.object_id, "name": part.name, "planar": part.planar}
        for part in renderer.parts
    ]
    return {"objects": objects, "parts": parts}


def _full_areas(renderer: Renderer, alone: list[Renderer], pose: Pose) -> np.ndarray:
    """Area of every part as if its object stood alone in the room, by part id."""
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
        ids = [part.id for part in own]
        area = float(truth.part_area_px[ids].sum())
        if area == 0.0:
            continue
        objects[str(object_id)] = _surface_truth(
            area,
            float(truth.part_area_px[ids] @ truth.part_mean_z_cm[ids]) / area,
            float(full_area[ids].sum()),
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
    return {"i": number, "objects": objects, "parts": parts}


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
    parser.add_argument("--ideal", action="store_true", help="no blur, noise or JPEG")
    options = parser.parse_args()
    if options.frames < 1:
        raise UsageError(f"--frames must be at least 1, not {options.frames}")
    way = Way(options.frames, options.step, math.radians(options.turn))
    export(options.folder, world_from_uri(options.camera), way, IDEAL if options.ideal else WebcamModel())


if __name__ == "__main__":
    run_command(main)
