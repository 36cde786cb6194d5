"""Where the camera was when a frame was taken."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

AngleT = TypeVar("AngleT", float, np.ndarray)


@dataclass(frozen=True)
class Pose:
    """Camera-to-world pose: ``X_world = rotation @ X_camera + position_cm``.

    World axes are those of the camera at the start: x right, y down, z forward.
    """

    rotation: np.ndarray  # (3, 3)
    position_cm: np.ndarray  # (3,)
    t_s: float = 0.0
    sigma_z_cm: float = 0.0  # of the travelled distance since the run began, along the path
    sigma_rot_rad: float = 0.0  # of the rotation between neighbouring frames

    @staticmethod
    def planar(x_cm: float, z_cm: float, heading_rad: float, **more: float) -> Pose:
        """A robot on a floor; heading grows to the right (from z towards x)."""
        c, s = math.cos(heading_rad), math.sin(heading_rad)
        rotation = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        return Pose(rotation, np.array([x_cm, 0.0, z_cm]), **more)

    def relative_to(self, reference: Pose) -> tuple[np.ndarray, np.ndarray]:
        """``(R, t)`` with ``X_reference = R @ X_self + t``; t in cm."""
        back = reference.rotation.T
        return back @ self.rotation, back @ (self.position_cm - reference.position_cm)


def wrap(angle: AngleT) -> AngleT:
    """The same angle, or angles, within half a turn either way of 0."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def bearing(start: tuple[float, float], end: tuple[float, float]) -> float:
    """Heading from one place (x, z) to another, rad."""
    return math.atan2(end[0] - start[0], end[1] - start[1])
