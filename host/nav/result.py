"""What a drive leaves behind: the log while it runs, result.json when it is over."""

from __future__ import annotations

import json
import math
import os
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from host.errors import UsageError
from host.nav.odometry import heading_of
from host.pose import Pose
from host.record.atomic import write_whole


@dataclass(frozen=True)
class Decision:
    """One command and why, at a time since the start of the drive."""

    t_s: float
    v_mm_s: float
    omega_rad_s: float
    reason: str


@dataclass(frozen=True)
class LostAndFound:
    """The robot was lost on the way, and connected again."""

    t_s: float  # since the start of the drive, when it was back
    away_s: float
    restarted: bool  # and not only cut off
    why: str


@dataclass
class DriveLog:
    """Grows while the robot drives; holds nothing but what the robot itself can know."""

    outcome: str = "stopped"  # goal, explored, approached, blocked, timeout or stopped
    reason: str = "not begun"
    duration_s: float = 0.0
    distance_cm: float = 0.0
    frames: int = 0
    dropped_frames: int = 0
    refused_frames: int = 0  # stale, dark, blank or frozen ones
    limited_frames: int = 0  # in which a budget of the net acted
    faults_cleared: int = 0
    reconnections: list[LostAndFound] = field(default_factory=list)
    frame_ms: list[float] = field(default_factory=list)  # capture to command, camera and line not counted
    path: list[Pose] = field(default_factory=list)  # of the camera, at every frame driven on
    decisions: list[Decision] = field(default_factory=list)

    def decide(self, t_s: float, v_mm_s: float, omega_rad_s: float, reason: str) -> None:
        self.decisions.append(Decision(round(t_s, 4), round(v_mm_s, 1), round(omega_rad_s, 4), reason))

    def end(self, outcome: str, reason: str) -> None:
        self.outcome, self.reason = outcome, reason

    def as_dict(self) -> dict[str, Any]:
        """The part of result.json that needs no truth."""
        ms = np.array(self.frame_ms)
        last = self.path[-1] if self.path else None
        return {
            "outcome": self.outcome,
            "reason": self.reason,
            "duration_s": round(self.duration_s, 3),
            "distance_cm": round(self.distance_cm, 2),
            "final_pose": None if last is None else pose_as_dict(last),
            "frames": self.frames,
            "dropped_frames": self.dropped_frames,
            "refused_frames": self.refused_frames,
            "limited_frames": self.limited_frames,
            "faults_cleared": self.faults_cleared,
            "reconnections": [asdict(one) for one in self.reconnections],
            "frame_time_ms": {
                "median": round(float(np.median(ms)), 2) if len(ms) else None,
                "p95": round(float(np.percentile(ms, 95)), 2) if len(ms) else None,
            },
            "decisions": [asdict(d) for d in self.decisions],
        }


def pose_as_dict(pose: Pose) -> dict[str, float]:
    """Planar pose in cm and degrees, as result.json has it."""
    return {
        "x_cm": round(float(pose.position_cm[0]), 3),
        "z_cm": round(float(pose.position_cm[2]), 3),
        "heading_deg": round(math.degrees(heading_of(pose)), 3),
    }


def write_json(result: dict[str, Any], path: Path) -> None:
    """Write whole or not at all; UsageError where the place does not allow it."""
    write_whole(path, (json.dumps(result, indent=1, allow_nan=False) + "\n").encode())


def new_run_folder(runs: Path, name: str) -> Path:
    """Make ``runs/name``, or ``runs/name-2`` and so on where that exists, and point ``runs/latest`` to it."""
    try:
        runs.mkdir(parents=True, exist_ok=True)
        folder, k = runs / name, 2
        while folder.exists():
            folder, k = runs / f"{name}-{k}", k + 1
        folder.mkdir()
        link = runs / ".latest"
        link.unlink(missing_ok=True)
        link.symlink_to(folder.name, target_is_directory=True)
        os.replace(link, runs / "latest")
    except OSError as error:
        raise UsageError(f"{runs} cannot be written: {error.strerror}; run from another folder") from None
    return folder
