"""Ways through scenes, what odometry says of them, and how the estimator is judged on them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from board_scene import LENS
from solid_scene import PIECE, Ball, Block, Eye, Post, Sheet, Thing, board, room

from host.depth.config import DepthConfig
from host.depth.estimator import Estimator
from host.depth.report import DepthReport, RegionDepth
from host.pose import Pose
from host.rbdn.snapshot import Snapshot

WALL = 1  # region id of the wall behind everything in `boards_before_a_wall`
FIRST = 10  # and of the first thing before it
TICK_CM = 0.5  # of the wheel encoder
TICK_SIGMA_CM = TICK_CM / np.sqrt(12)


def wall(depth_cm: float = 260.0) -> Sheet:
    """A frontal wall that fills the picture."""
    return board(WALL, (0.0, 0.0, depth_cm), (8 * depth_cm, 8 * depth_cm))


def boards_before_a_wall(seed: int, columns: int = 3, rows: int = 2) -> list[Thing]:
    """Frontal boards of random size and depth (55 to 150 cm), none before another, and a wall."""
    rng = np.random.default_rng(1000 + seed)
    things: list[Thing] = []
    for row in range(rows):
        for column in range(columns):
            z = float(np.exp(rng.uniform(np.log(55), np.log(150))))
            cell = np.array([LENS.width / columns, LENS.height / rows]) / LENS.fx * z * 0.8
            size = cell * rng.uniform(0.5, 0.8, 2)
            middle = (np.array([column, row]) + 0.5) / (columns, rows) - 0.5
            centre = middle * (LENS.width, LENS.height) / LENS.fx * z * 0.8
            centre = centre + rng.uniform(-0.5, 0.5, 2) * (cell - size)
            things.append(board(FIRST + len(things), (*centre, z), (size[0], size[1])))
    return [wall(), *things]


def table_top(seed: int) -> list[Thing]:
    """A room with five to seven boxes, balls, posts and boards on its floor, some before others."""
    rng = np.random.default_rng(2000 + seed)
    floor_cm = float(rng.uniform(10, 15))
    things: list[Thing] = list(room(1, float(rng.uniform(200, 280)), floor_cm))
    stands: list[tuple[float, float, float]] = []
    while len(stands) < 5 + seed % 3:
        z = float(np.exp(rng.uniform(np.log(55), np.log(140))))
        x = float(rng.uniform(-0.38, 0.38) * z)
        size, kind, name = (
            float(rng.uniform(9, 20)),
            rng.choice(4, p=[0.45, 0.2, 0.2, 0.15]),
            FIRST + len(stands),
        )
        if any(np.hypot(x - x2, z - z2) < 0.7 * (size + size2) for x2, z2, size2 in stands):
            continue  # they would stand in each other
        stands.append((x, z, size))
        if kind == 0:
            height, deep = float(rng.uniform(0.6, 1.3) * size), float(rng.uniform(0.4, 0.9) * size)
            turned = 0.0 if rng.random() < 0.3 else float(rng.uniform(-0.7, 0.7))
            things.append(Block(name, np.array([x, floor_cm - height / 2, z]), (size, height, deep), turned))
        elif kind == 1:
            things.append(Ball(name, np.array([x, floor_cm - size / 2.6, z]), size / 2.6))
        elif kind == 2:
            height = float(rng.uniform(1.2, 2.0) * size)
            things.append(Post(name, np.array([x, floor_cm - height / 2, z]), size / 3, height))
        else:
            things.append(board(name, (x, floor_cm - size / 2, z), (size, size), float(rng.uniform(-1, 1))))
    return things


def ahead(frames: int, length_cm: float, direction: tuple[float, float, float] = (0, 0, 1)) -> list[Pose]:
    """A straight way of a length, 30 frames a second."""
    d = np.array(direction, float)
    d /= np.linalg.norm(d)
    return [Pose(np.eye(3), d * length_cm * k / (frames - 1), k / 30) for k in range(frames)]


def tilted(pose: Pose, pitch_rad: float, yaw_rad: float, roll_rad: float = 0.0) -> Pose:
    """The same place with the camera turned about its own axes."""
    (cp, sp), (cy, sy), (cr, sr) = ((np.cos(a), np.sin(a)) for a in (pitch_rad, yaw_rad, roll_rad))
    pitch = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
    yaw = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    roll = np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]])
    return replace(pose, rotation=pose.rotation @ yaw @ pitch @ roll)


def shaken(path: Sequence[Pose], degrees: float, seed: int) -> list[Pose]:
    """The way with pitch and yaw of every frame off by up to so much."""
    rng = np.random.default_rng(seed)
    off = np.radians(rng.uniform(-degrees, degrees, (len(path), 2)))
    return [tilted(p, *o) for p, o in zip(path, off, strict=True)]


def ticked(path: Sequence[Pose], seed: int, told: bool = False) -> list[Pose]:
    """What an encoder of 0.5 cm says of a straight way, its ticks anywhere on it."""
    phase = np.random.default_rng(seed).uniform(0, TICK_CM)
    out = []
    for pose in path:
        length = float(np.linalg.norm(pose.position_cm))
        counted = TICK_CM * np.floor((length + phase) / TICK_CM)
        where = pose.position_cm / length * counted if length > 0 else np.zeros(3)
        out.append(replace(pose, position_cm=where, sigma_z_cm=TICK_SIGMA_CM if told else 0.0))
    return out


@dataclass(frozen=True)
class Run:
    """What was seen, where, and what the estimator said."""

    eye: Eye
    poses: list[Pose]  # true
    snapshots: list[Snapshot]
    reports: list[DepthReport]

    @property
    def last(self) -> DepthReport:
        return self.reports[-1]

    def region(self, name: int, frame: int = -1) -> RegionDepth:
        return self.reports[frame].regions[name]

    def errors(self, frame: int = -1) -> dict[int, float]:
        """Relative error of the depth of every region that has one; not of things seen in several pieces."""
        truth, found = self.eye.truth(self.poses[frame]), self.reports[frame].regions
        return {
            name: depth / z - 1
            for name, z in truth.items()
            if name in found and name + PIECE not in found and (depth := found[name].depth_cm) is not None
        }


def drive(
    eye: Eye,
    path: Sequence[Pose],
    said: Sequence[Pose] | None = None,
    change: Callable[[int, Eye, Pose], Snapshot] | None = None,
    config: DepthConfig | None = None,
) -> Run:
    """Look from every place of a way and let the estimator judge.

    Parameters
    ----------
    said : what odometry says of the way; the truth if not given
    change : makes the snapshot of a frame from its number, the eye and the true pose; `eye.look` if not given
    """
    estimator = Estimator(eye.lens, config or DepthConfig())
    snapshots, reports = [], []
    for k, (pose, given) in enumerate(zip(path, said or path, strict=True)):
        snapshots.append(change(k, eye, pose) if change else eye.look(pose))
        reports.append(estimator.update(snapshots[-1], given))
    return Run(eye, list(path), snapshots, reports)


def before_the_wall(run: Run, frame: int = -1) -> np.ndarray:
    """Relative depth errors of all things before the wall, nan where there is no depth."""
    errors = run.errors(frame)
    return np.array([errors.get(t.id, np.nan) for t in run.eye.things if t.id >= FIRST])


@cache
def table_drives() -> tuple[Run, ...]:
    """Thirty drives before as many tables, of other lengths and noise; made once for all tests."""
    out = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        noise_px = float(rng.uniform(0.08, 0.2))
        path = ahead(int(rng.integers(6, 11)), float(rng.uniform(6, 10)))
        eye = Eye(table_top(seed), noise_px=noise_px, vertex_noise_px=noise_px, seed=seed)
        out.append(drive(eye, path))
    return tuple(out)
