"""What a worker process is given, and what all scoring of one run has in common."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from host.depth.config import DepthConfig
from host.experiments.course import Course, Drive
from host.experiments.truth import FrameTruth
from host.rbdn import NetConfig
from host.sim.render import WebcamModel
from host.sim.world import World


@dataclass(frozen=True)
class Task:
    """One run, as a worker process gets it."""

    course: Course
    scene: Callable[[], World]
    seed: int
    model: WebcamModel
    net: NetConfig
    depth: DepthConfig
    setting: float | None = None  # what a sweep varies
    keep_stills: bool = False


@dataclass(frozen=True)
class Scored:
    """What the findings of one task have in common."""

    task: Task
    drive: Drive
    first: FrameTruth

    def travel_cm(self, k: int, odometry: str = "exact") -> float:
        """From the first frame to frame `k`; exact odometry tells the true one."""
        poses = self.drive.odometry[odometry]
        return float(poses[k].position_cm[2] - poses[0].position_cm[2])


def as_printed(xyz_cm: np.ndarray) -> tuple[float, float, float]:
    """As the paper's tables have places: Y up."""
    x, y, z = xyz_cm
    return float(x), -float(y), float(z)
