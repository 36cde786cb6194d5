"""What of the depth estimators may be set, with the values that worked."""

from __future__ import annotations

from dataclasses import dataclass

from host.ranges import check_ranges

FRAMES = (3, 1000)  # the first, the last, and one that may go
SHARE = (0.0, 1.0)
PX = (0.0, 50.0)
RANGES = {
    "travel_sigma_cm": (0.0, 10.0),
    "rotation_sigma_rad": (0.0, 1.0),
    "rotation_sigma_share": SHARE,
    "timing_sigma_s": (0.0, 1.0),
    "tracked_sigma_cm": (0.0, 100.0),
    "min_step_cm": (0.001, 100.0),
    "min_change": (0.0, 10.0),
    "max_relative_sigma": (0.0, 10.0),
    "area_history": FRAMES,
    "area_shape_change": (0.0, 10.0),
    "area_outline_px": PX,
    "area_drift_px": PX,
    "area_own_share": SHARE,
    "vertex_history": FRAMES,
    "vertex_noise_px": PX,
    "vertex_default_sigma_px": PX,
    "vertex_model_share": SHARE,
    "keyframes": FRAMES,
    "outline_spacing_px": (0.5, 100.0),
    "outline_border_px": PX,
    "outline_noise_px": PX,
    "outline_correlation_px": (0.0, 1000.0),
    "outline_model_share": SHARE,
    "nearest_cm": (0.1, 10000.0),
    "farthest_cm": (1.0, 100000.0),
    "memory_share_per_cm": SHARE,
}


@dataclass(frozen=True)
class DepthConfig:
    """Settings of the depth estimators. Shares are fractions of the depth unless said otherwise."""

    # how far the poses are to be trusted where they do not say so themselves
    travel_sigma_cm: float = 0.02  # of one reading of the travelled distance
    rotation_sigma_rad: float = 0.0001  # of the rotation from one frame to the next
    rotation_sigma_share: float = 0.01  # of a rotation itself: calibration of lens and odometry
    timing_sigma_s: float = 0.004  # between a frame and its pose; a rolling shutter counts
    tracked_sigma_cm: float = 1.0  # of a place where the camera is carried, rolling or rising, not on wheels
    min_step_cm: float = 0.3  # a frame nearer than this to the last one kept adds nothing and is not kept

    # when to answer at all
    min_change: float = 0.015  # relative change of size or bearing that a baseline must cause
    max_relative_sigma: float = 0.3  # a depth worse than this is declined

    # area
    area_history: int = 32  # frames kept for each region
    area_shape_change: float = 0.35  # change of shape over change of size beyond which area declines
    area_outline_px: float = 0.15  # by which all of an outline lies too far in or out, always alike
    area_drift_px: float = 0.05  # by which that changes along the way
    area_own_share: float = 0.97  # of its outline that must be the region's own

    # vertices
    vertex_history: int = 12  # frames kept
    vertex_noise_px: float = 0.1  # a vertex is never taken to be better than this
    vertex_default_sigma_px: float = 0.5  # of a vertex that does not know its own
    vertex_model_share: float = 0.01  # model error of a region's mean even on a flat face

    # outline
    keyframes: int = 6  # earlier frames the present outline is compared with
    outline_spacing_px: float = 3.5  # between samples of the present outline; at least 5 in a drive
    outline_border_px: float = 3.0  # samples nearer to the image border are not used
    outline_noise_px: float = 0.12  # an outline is never taken to be better than this
    outline_correlation_px: float = 8.0  # outlines err alike over such a length
    outline_model_share: float = 0.003  # model error even on a flat frontal thing
    nearest_cm: float = 12.0  # depths looked for, from
    farthest_cm: float = 2500.0  # and to

    # how quickly old answers are forgotten, per cm driven
    memory_share_per_cm: float = 0.002

    def __post_init__(self) -> None:
        check_ranges(self, RANGES)
        if not self.nearest_cm < self.farthest_cm:
            raise ValueError(f"nearest_cm = {self.nearest_cm} must be below farthest_cm = {self.farthest_cm}")
