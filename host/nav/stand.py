"""Where a region stands: by its depth measured from motion, by its foot on the floor, or by both.

In each image column the lowest point of what is not floor is its foot: the floor is there at
height / ray_y. Both are compared and averaged as slopes of the ray to the foot, height / depth, in which the
foot's error is the same at every distance.

Something wide is a wall and stands where its feet are, column by column, for its mean depth says little of
its ends. Something narrow is filled from its
nearest point on. A ball's nearest point lies far before its foot: what hangs over at the sides is taken to
bulge as much towards the robot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from host.camera.lens import Lens
from host.depth.report import DepthReport
from host.nav.floor import FARTHEST_CM, NO_REGION, SIGMA_RAY, STEP_PX, Rays
from host.nav.odometry import heading_of
from host.pose import Pose
from host.rbdn.snapshot import Region

USABLE = 0.25  # a depth with a larger relative sigma places nothing
STRAIGHT = 0.006  # rms of a straight wall's feet about their line, as a slope: 2 px at 280 px focal length
WALL_CM = 70.0  # what is wider than this has a front as its feet have it, what is narrower a flat one
TOUCHING = 1.05  # columns whose foot is nearer than this times the nearest foot touch the floor
HANGING = 0.6  # a thing whose outer feet are flatter than this part of its nearest one hangs over there
MEAN_TO_FRONT = 0.15  # a thing's nearest point before its mean depth, in its widths
FARTHEST_DEPTH_CM = 450.0
LEAST_COLUMNS = 3
CUT_PART = 0.25  # with a larger part of its feet below the image, the others are a thing's sides or slivers
AT_BORDER = "at the lower border"  # it is there or nearer, and nothing says how much nearer
SURE, FAIR, FAINT = 1.0, 0.5, 0.25  # log-odds a frame is worth: depth and foot agree; one alone; they do not


@dataclass(frozen=True)
class Standing:
    """One region's front across the image, in the frame that showed it."""

    region: int
    columns: np.ndarray  # (K,) columns of the label image it covers
    depth_cm: np.ndarray  # (K,) of its nearest point in each, along the optical axis
    mean_cm: float  # the region's depth
    sigma_cm: float  # of the mean
    how: str  # the depth's method, "foot", or AT_BORDER
    weight: float  # log-odds

    def by_column(self, width: int) -> np.ndarray:
        """(width,) depth in each column, nan where it is not."""
        out = np.full(width, np.nan)
        out[self.columns] = self.depth_cm
        return out

    def where(self, mask: np.ndarray) -> Standing | None:
        """Only its columns in a mask (width,); None where those are too few to be anything."""
        kept = mask[self.columns]
        if int(kept.sum()) < LEAST_COLUMNS:
            return None
        return replace(self, columns=self.columns[kept], depth_cm=self.depth_cm[kept])

    def width_cm(self, lens: Lens) -> float:
        """How wide it looks at its distance."""
        return self.mean_cm * len(self.columns) * STEP_PX / lens.fx


class Feet:
    """Per column of the label image the first thing above the floor.

    Attributes
    ----------
    region : (W / 2,) its id, NO_REGION where only floor is seen
    depth_cm, sigma_cm : (W / 2,) of its foot
    free_cm : (W / 2,) depth up to which floor is seen
    cut : (W / 2,) bool, no floor is seen at all: the foot is at or below the image's lower border
    nearest_cm : where the view of the floor begins
    """

    def __init__(
        self, labels: np.ndarray, floor: np.ndarray, unsure: np.ndarray, rays: Rays, height_cm: float
    ) -> None:
        rows, cols = labels.shape
        column = np.arange(cols)
        self._across, self.height_cm = rays.across, height_cm
        passable = floor | unsure | (labels == NO_REGION)
        row, open_ended, self.cut = _first_other(passable)
        self.region = np.where(open_ended, NO_REGION, labels[row, column])
        # the foot's ray passes between the foot's pixel and the floor's pixel below it
        below = np.minimum(row + 1, rows - 1)
        slope = 0.5 * (rays.down[row, column] + rays.down[below, column])
        self.depth_cm = np.minimum(height_cm / np.maximum(slope, 1e-6), FARTHEST_CM)
        self.sigma_cm = self.depth_cm**2 / height_cm * SIGMA_RAY
        row, _, _ = _first_other(floor | (labels == NO_REGION))
        slope = np.maximum(rays.down[np.minimum(row + 1, rows - 1), column], 1e-6)
        self.free_cm = np.minimum(height_cm / slope, FARTHEST_CM)
        self.free_cm -= 2 * self.free_cm**2 / height_cm * SIGMA_RAY
        self.nearest_cm = float(height_cm / rays.down[-1].max())

    def width_cm(self, columns: np.ndarray, depth_cm: float) -> float:
        """Width of what spans these columns at a depth."""
        return float(self._across[columns[-1]] - self._across[columns[0]]) * depth_cm

    def point(self, pose: Pose, column: int, depth_cm: float) -> tuple[float, float]:
        """(x, z) in the odometry frame of a depth in a column."""
        heading = heading_of(pose)
        side = self._across[column] * depth_cm
        x = pose.position_cm[0] + depth_cm * math.sin(heading) + side * math.cos(heading)
        z = pose.position_cm[2] + depth_cm * math.cos(heading) - side * math.sin(heading)
        return float(x), float(z)


def _first_other(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Upwards in each column: row of the first pixel not in the mask, is there none, is it the lowest."""
    up = np.argmax(~mask[::-1], axis=0)
    none = np.asarray(mask.all(axis=0))
    return np.where(none, 0, len(mask) - 1 - up), none, (up == 0) & ~none


def stand_of(
    region: Region, report: DepthReport, feet: Feet, labels: np.ndarray, front_cm: float | None = None
) -> Standing | None:
    """Where a region that is not floor stands; None while nothing is known of it.

    With a foot, the shape across the columns is the foot's and the mean is that of foot and depth, weighted;
    where they contradict each other the nearer one is taken, and not trusted much. Without one its front lies
    `front_cm` before its mean depth, as it did when its foot was last seen. Where much of the foot is below
    the image it is nearer than the border: what little of a foot is left to see then says nothing.
    """
    measured = usable_depth(report, region.id)
    covered = np.nonzero((labels == region.id).any(axis=0))[0]
    columns = np.nonzero((feet.region == region.id) & ~feet.cut)[0]
    cut = np.nonzero((feet.region == region.id) & feet.cut)[0]
    mostly_cut = len(cut) >= LEAST_COLUMNS and len(cut) > CUT_PART * (len(columns) + len(cut))
    if len(columns) >= LEAST_COLUMNS and (not mostly_cut or _is_straight_wall(feet, columns, covered)):
        return _on_its_feet(region.id, measured, feet, columns, covered)
    if measured is not None:
        if len(covered) == 0:
            return None
        z, sigma, how = measured
        front = z - (MEAN_TO_FRONT * feet.width_cm(covered, z) if front_cm is None else front_cm)
        if not mostly_cut or front <= float(feet.depth_cm[cut].mean()):
            return Standing(region.id, covered, np.full(len(covered), front), z, sigma, how, FAIR)
    if len(cut) < LEAST_COLUMNS:
        return None
    depth = feet.depth_cm[cut]
    mean = float(depth.mean())
    return Standing(region.id, cut, depth, mean, 0.25 * mean, AT_BORDER, FAINT)


def _is_straight_wall(feet: Feet, columns: np.ndarray, covered: np.ndarray) -> bool:
    """Whether the feet in these columns lie on one line that goes on below the image."""
    slopes = feet.height_cm / feet.depth_cm[columns]
    nearest = float(np.percentile(slopes, 90))
    if feet.width_cm(covered, feet.height_cm / nearest) <= WALL_CM:
        return False
    return _straight_line(columns, slopes) is not None


def _straight_line(columns: np.ndarray, slopes: np.ndarray) -> np.polynomial.Polynomial | None:
    """The line through slopes over columns; None where they do not lie on one."""
    line = np.polynomial.Polynomial.fit(columns, slopes, 1)
    off = float(np.sqrt(np.mean((slopes - line(columns)) ** 2)))
    return line if off < STRAIGHT else None


def _on_its_feet(
    region: int,
    measured: tuple[float, float, str] | None,
    feet: Feet,
    columns: np.ndarray,
    covered: np.ndarray,
) -> Standing | None:
    slopes = feet.height_cm / feet.depth_cm[columns]
    nearest = float(np.percentile(slopes, 90))
    wall = feet.width_cm(covered, feet.height_cm / nearest) > WALL_CM
    foot_slope = float(np.mean(slopes)) if wall else nearest
    slope, sigma, how, weight = _agreed(foot_slope, measured, feet.height_cm)
    z = feet.height_cm / slope
    sigma_cm = sigma * z**2 / feet.height_cm
    if how == "foot" and sigma_cm > 0.3 * z:
        return None
    if wall:
        line = _straight_line(columns, slopes)
        if line is not None:
            columns = np.nonzero(feet.region == region)[0]  # also where its feet are below the image
            slopes = line(columns)
        depth = feet.height_cm / np.maximum(slopes, feet.height_cm / FARTHEST_CM)
        return Standing(region, columns, depth, z, sigma_cm, how, weight)
    bulge = 0.0
    if float(np.percentile(slopes, 10)) < HANGING * nearest:
        touching = float((slopes > nearest / TOUCHING).sum()) / len(covered)
        bulge = 0.5 * (1 - touching) * feet.width_cm(covered, z)
    return Standing(region, covered, np.full(len(covered), z - bulge), z, sigma_cm, how, weight)


def _agreed(
    slope: float, measured: tuple[float, float, str] | None, height_cm: float
) -> tuple[float, float, str, float]:
    """(slope, sigma, how, weight) of a foot's slope and a measured depth together."""
    sigma = SIGMA_RAY
    if measured is None:
        return slope, sigma, "foot", FAIR
    z, s, method = measured
    other, sigma_other = height_cm / z, height_cm * s / z**2
    if abs(other - slope) < 3 * math.hypot(sigma, sigma_other):
        share = sigma**2 / (sigma**2 + sigma_other**2)
        both = sigma * sigma_other / math.hypot(sigma, sigma_other)
        return share * other + (1 - share) * slope, both, method, SURE
    if other > slope:
        return other, sigma_other, method, FAINT
    return slope, sigma, "foot", FAINT


def usable_depth(report: DepthReport, region_id: int) -> tuple[float, float, str] | None:
    """(depth in cm, sigma in cm, method) of a region, or None where it says too little."""
    found = report.regions.get(region_id)
    if found is None or found.depth_cm is None or found.sigma_cm is None:
        return None
    if found.sigma_cm > USABLE * found.depth_cm or found.depth_cm > FARTHEST_DEPTH_CM:
        return None
    return found.depth_cm, found.sigma_cm, found.method or "depth"
