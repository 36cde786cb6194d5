"""What the depth estimators say of one frame."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Estimate:
    """A depth along the optical axis of the present frame, with its standard error."""

    depth_cm: float
    sigma_cm: float
    sensitivity: float | None = None  # of what is measured, per cm driven: px (vertex, outline), px^2 (area)


@dataclass(frozen=True)
class Declined:
    """Why a method has no answer."""

    reason: str


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
    moving: bool = False  # its outline does not fit the robot's own motion


@dataclass(frozen=True)
class VertexDepths:
    """Positions of the net's vertices in the camera frame of the present image, one row each."""

    ids: np.ndarray  # (N,) int64
    xyz_cm: np.ndarray  # (N, 3) float64, nan where the motion supports none
    sigma_cm: np.ndarray  # (N,) float64, of z, nan likewise


@dataclass(frozen=True)
class DepthReport:
    """Everything known of depth after one frame."""

    regions: dict[int, RegionDepth]
    vertices: VertexDepths
