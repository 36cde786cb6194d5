"""What the depth estimators say of one frame."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from host.pose import Pose


@dataclass(frozen=True)
class Estimate:
    """A depth along the optical axis of the present frame, with its standard error."""

    depth_cm: float
    sigma_cm: float
    # what the measured quantity changes by for one cm of travel: px of a vertex (Eq. 13), px^2 of an area
    # (Eq. 18), px of an outline
    sensitivity: float | None = None


@dataclass(frozen=True)
class RegionDepth:
    """Depth of a region: the mean over its visible surface in the present frame."""

    depth_cm: float | None
    sigma_cm: float | None
    method: str | None  # the method that weighs most: "area", "vertex" or "outline"
    method_note: str | None  # why there is no depth, or what speaks against the one there is
    estimates: dict[str, Estimate] = field(default_factory=dict)  # by method
    declined: dict[str, str] = field(default_factory=dict)  # reason by method
    silhouette_cm: float | None = None  # where the outline is: behind the surface on round things
    slope: tuple[float, float] | None = None  # d(1/Z)/dx, dy in 1/(cm px), where the outline shows a slant
    moving: bool = False  # its outline moves as nothing that stands still could


@dataclass(frozen=True)
class VertexDepths:
    """Positions of the net's vertices in the camera frame of the present image, one row each."""

    ids: np.ndarray  # (N,) int64
    xyz_cm: np.ndarray  # (N, 3) float64, nan where the motion supports none
    sigma_cm: np.ndarray  # (N,) float64, of z, nan likewise
    sensitivity: np.ndarray | None = None  # (N,) float64, px of image motion for one cm of travel (Eq. 13)


@dataclass(frozen=True)
class Correction:
    """By how much odometry was wrong between an earlier frame and the present one."""

    since_s: float  # time of the earlier frame's pose
    yaw_rad: float  # the camera turned so much further to the right than odometry says
    sigma_yaw_rad: float
    travel_cm: float  # and came so much further along the way; the scale of all travel shows in no picture
    sigma_travel_cm: float


@dataclass(frozen=True)
class SolvedMotion:
    """Where the camera really was, solved from the images on top of odometry.

    The corrections are those since the oldest frame that this one was compared with, ``since[0]``, and so
    are their standard errors; where nothing could be compared they are what odometry is worth.
    """

    camera: Pose  # the present pose, corrected
    pitch_rad: float  # the correction: about the camera's x axis
    yaw_rad: float  # about its y axis
    travel_cm: float  # along the way
    since: tuple[Correction, ...] = ()  # against each of the kept frames, oldest first

    @property
    def sigma_yaw_rad(self) -> float | None:
        """Standard error of ``yaw_rad``; None while there is no earlier frame."""
        return self.since[0].sigma_yaw_rad if self.since else None

    @property
    def sigma_travel_cm(self) -> float | None:
        """Standard error of ``travel_cm``, likewise."""
        return self.since[0].sigma_travel_cm if self.since else None


@dataclass(frozen=True)
class DepthReport:
    """Everything known of depth after one frame."""

    regions: dict[int, RegionDepth]
    vertices: VertexDepths
    motion: SolvedMotion | None = None
