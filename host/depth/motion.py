"""Where frames were taken, how well that is known, and which earlier ones are worth keeping."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from host.depth.config import DepthConfig
from host.pose import Pose


@dataclass(frozen=True)
class Station:
    """The place of one frame on the path."""

    seq: int
    pose: Pose
    path_cm: float  # length of the path up to here
    travel_variance_cm2: float  # of the distance driven so far, grows along the path
    reading_variance_cm2: float  # of this one reading, independent of the others
    rotation_variance_rad2: float  # accumulated from frame to frame
    timing_variance_rad2: float  # of this rotation, because the frame's time is not exactly the pose's


def first_station(seq: int, pose: Pose, config: DepthConfig) -> Station:
    """Where the run begins. The first pose's sigma is what a single reading is worth."""
    reading = max(config.travel_sigma_cm, pose.sigma_z_cm) ** 2
    return Station(seq, pose, 0.0, pose.sigma_z_cm**2, reading, 0.0, 0.0)


def next_station(last: Station, seq: int, pose: Pose, config: DepthConfig) -> Station:
    """The station after `last`."""
    step_cm = float(np.linalg.norm(pose.position_cm - last.pose.position_cm))
    dt_s = pose.t_s - last.pose.t_s
    rate = turn_rad(last.pose, pose) / dt_s if dt_s > 0 else 0.0
    step_rotation = max(config.rotation_sigma_rad, pose.sigma_rot_rad) ** 2
    return Station(
        seq,
        pose,
        last.path_cm + step_cm,
        max(last.travel_variance_cm2, pose.sigma_z_cm**2),
        last.reading_variance_cm2,
        last.rotation_variance_rad2 + step_rotation,
        (rate * config.timing_sigma_s) ** 2,
    )


def travel_sigma_cm(a: Station, b: Station) -> float:
    """Standard error of the distance between two stations."""
    grown = abs(a.travel_variance_cm2 - b.travel_variance_cm2)
    return float(np.sqrt(grown + a.reading_variance_cm2 + b.reading_variance_cm2))


def turn_rad(a: Pose, b: Pose) -> float:
    """Angle between the orientations of two poses."""
    return float(np.arccos(np.clip((np.trace(a.rotation.T @ b.rotation) - 1) / 2, -1, 1)))


def rotation_sigma_rad(a: Station, b: Station, config: DepthConfig) -> float:
    """Standard error of the rotation between two stations."""
    grown = abs(a.rotation_variance_rad2 - b.rotation_variance_rad2)
    scaled = (config.rotation_sigma_share * turn_rad(a.pose, b.pose)) ** 2
    return float(np.sqrt(grown + scaled + a.timing_variance_rad2 + b.timing_variance_rad2))


def most_redundant(positions_cm: np.ndarray, present_cm: np.ndarray) -> int:
    """Index of the kept frame that is missed least.

    Gaps are judged against their distance from the present, so what remains is spread evenly in the
    logarithm of the baseline: near frames for near things, far frames for far ones.

    Parameters
    ----------
    positions_cm : (N, 3) positions of the kept frames, oldest first, N >= 3
    present_cm : (3,) the present position
    """
    gap = np.linalg.norm(positions_cm[2:] - positions_cm[:-2], axis=1)
    away = np.linalg.norm(positions_cm[1:-1] - present_cm, axis=1)
    return 1 + int(np.argmin(gap / (away + 1.0)))


def with_ones(rays: np.ndarray) -> np.ndarray:
    """(N, 2) = (X/Z, Y/Z) to (N, 3) = (X/Z, Y/Z, 1)."""
    return np.column_stack([rays, np.ones(len(rays))])
