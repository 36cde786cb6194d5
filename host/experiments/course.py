"""How the robot drives in an experiment: where its camera truly is, and what odometry says of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from host.pose import Pose

COUNT_CM = 0.5  # the paper's encoder
SPEED_CM_S = 10.0


@dataclass(frozen=True)
class Course:
    """A straight drive along the optical axis."""

    name: str
    travel_cm: float  # about: each drive is up to a quarter of a centimetre longer or shorter
    frames: int  # at equal steps
    shake_rad: float  # pitch and yaw of each frame against the first: anything up to this, evenly
    look_cm: tuple[float, ...]  # travels, about, after which depths are compared with the truth

    @property
    def looks(self) -> dict[int, float]:
        """Travel by frame, of the frames that are looked at."""
        step = self.travel_cm / (self.frames - 1)
        return {round(travel / step): travel for travel in self.look_cm}


@dataclass(frozen=True)
class Drive:
    """One pose a frame each."""

    true: list[Pose]
    odometry: dict[str, list[Pose]]  # "exact" and "encoder" distances; neither knows of the shaking


def drive(course: Course, seed: int) -> Drive:
    """The same drive for the same seed.

    The encoder counts whole half centimetres, beginning anywhere within one. Odometry states its own doubts:
    the standard deviation of a count's rounding, and that of the shaking.
    """
    rng = np.random.default_rng((0xD21E, seed))
    # A way of whole counts would hide the encoder's error: it would be the same at both ends.
    way_cm = course.travel_cm + rng.uniform(-COUNT_CM / 2, COUNT_CM / 2)
    travel = np.linspace(0.0, way_cm, course.frames)
    pitch, yaw = rng.uniform(-course.shake_rad, course.shake_rad, (2, course.frames))
    pitch[0] = yaw[0] = 0.0
    phase = rng.uniform(0.0, COUNT_CM)
    counted = COUNT_CM * np.floor((travel + phase) / COUNT_CM)
    true = [
        Pose(_rotation(p, y), np.array([0.0, 0.0, z]), z / SPEED_CM_S)
        for p, y, z in zip(pitch, yaw, travel, strict=True)
    ]
    doubt = course.shake_rad / math.sqrt(3)
    exact = [Pose.planar(0.0, z, 0.0, t_s=z / SPEED_CM_S, sigma_rot_rad=doubt) for z in travel]
    encoder = [
        replace(pose, position_cm=np.array([0.0, 0.0, z]), sigma_z_cm=COUNT_CM / math.sqrt(12))
        for pose, z in zip(exact, counted, strict=True)
    ]
    return Drive(true, {"exact": exact, "encoder": encoder})


def _rotation(pitch_rad: float, yaw_rad: float) -> np.ndarray:
    c, s = math.cos(pitch_rad), math.sin(pitch_rad)
    up = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    return Pose.planar(0.0, 0.0, yaw_rad).rotation @ up
