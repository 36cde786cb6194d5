"""How long one update of all depths takes where there is much to do: some 40 regions and 200 vertices."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from host.camera.lens import Lens
from host.depth.estimator import Estimator
from host.pose import Pose
from host.rbdn import Net, Snapshot
from host.sim.drive_scenes import OBJECT_COLOURS
from host.sim.render import Renderer, Webcam, WebcamModel
from host.sim.things import Board, Material
from host.sim.world import Room, World

LENS = Lens(320, 240, 371.0, 371.0, 159.5, 119.5)
COLUMNS, ROWS = 8, 5
NEAREST_CM, FARTHEST_CM = 120.0, 240.0
FRAMES = 24
STEP_CM = 0.5
SETTLED = 8  # frames after which as many earlier ones are kept as ever


@dataclass(frozen=True)
class UpdateTimes:
    """Thread CPU times of the updates, and how much there was to do in them on average."""

    regions: float
    vertices: float
    median_ms: float
    p90_ms: float
    slowest_ms: float

    def figures(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def update_times(rounds: int = 3) -> UpdateTimes:
    """Time the updates of a drive towards boards that hang in rows; of each frame the quietest round."""
    poses = [Pose.planar(0.0, STEP_CM * k, 0.0, t_s=k / 30) for k in range(FRAMES)]
    snapshots = _snapshots(poses)
    ms = np.full((rounds, FRAMES), np.inf)
    for turn in range(rounds):
        estimator = Estimator(LENS)
        for k, (snapshot, pose) in enumerate(zip(snapshots, poses, strict=True)):
            begin = time.thread_time()
            estimator.update(snapshot, pose)
            ms[turn, k] = 1e3 * (time.thread_time() - begin)
    quietest = ms.min(axis=0)[SETTLED:]
    return UpdateTimes(
        float(np.mean([len(s.regions) for s in snapshots[SETTLED:]])),
        float(np.mean([len(s.vertices.ids) for s in snapshots[SETTLED:]])),
        float(np.median(quietest)),
        float(np.percentile(quietest, 90)),
        float(quietest.max()),
    )


def _snapshots(poses: list[Pose]) -> list[Snapshot]:
    world = _gallery()
    renderer, model = Renderer(world), WebcamModel()
    webcam, net = Webcam(model, LENS, world.seed), Net(lens=LENS)
    return [
        net.track(webcam.take(renderer.light(pose, model.psf_px), pose.t_s, seq))
        for seq, pose in enumerate(poses)
    ]


def _gallery() -> World:
    """Boards of many colours, each in its own field of the picture at its own depth."""
    rng = np.random.default_rng(1)
    height_cm = 120.0  # of the camera
    wall = Material((224, 222, 214), contrast=0.02, scale_cm=6.0, seed=1)
    room = Room(
        -400.0, 400.0, -150.0, 420.0, 320.0,
        floor=Material((170, 150, 120), contrast=0.02, scale_cm=6.0, seed=2),
        left_wall=wall, right_wall=wall, back_wall=wall, front_wall=wall, ceiling=wall,
        lamp_cm=(0.0, 300.0, -60.0),
    )  # fmt: skip
    boards = []
    side_px = min(LENS.width / COLUMNS, LENS.height / ROWS)
    for row in range(ROWS):
        for column in range(COLUMNS):
            z = rng.uniform(NEAREST_CM, FARTHEST_CM)
            width, height = rng.uniform(0.45, 0.65, 2) * side_px * z / LENS.fx
            x = ((column + 0.5) * LENS.width / COLUMNS - LENS.cx) * z / LENS.fx
            middle = height_cm - ((row + 0.5) * LENS.height / ROWS - LENS.cy) * z / LENS.fy
            colour = OBJECT_COLOURS[int(rng.integers(len(OBJECT_COLOURS)))]
            paint = Material(colour, contrast=0.02, seed=len(boards))
            name = f"board_{row}_{column}"
            boards.append(
                Board(name, x, z, width, height, rng.uniform(-0.4, 0.4), paint, middle - height / 2)
            )
    return World("gallery", room, tuple(boards), height_cm, LENS, (0.0, 60.0), 1)
