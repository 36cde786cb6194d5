"""Where a region stands: by its depth measured from motion, by its foot on the floor, or by both.

In each image column the lowest point of what is not floor is its foot: the floor is there at
height / ray_y. Both are compared and averaged as slopes of the ray to the foot, height / depth, in which the
foot's error is the same at every distance.

Something wide is a wall and stands where its feet are, column by column, for its mean depth says little of
its ends. So does what is narrow, if its feet make one straight edge or two and it is upright at their ends: a
box's sides seen at a slant, a piece of a wall. All else is filled from its nearest point on. A ball's nearest
point lies far before its foot: what hangs over at the sides, or ends in points there, is taken to bulge as
much towards the robot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from host.camera.lens import Lens
from host.depth.report import DepthReport
from host.nav import _nav
from host.nav.floor import FARTHEST_CM, SIGMA_RAY, FloorFinder
from host.nav.odometry import heading_of
from host.nav.picture import NO_REGION, STEP_PX, Picture
from host.pose import Pose

USABLE = 0.25  # a depth with a larger relative sigma places nothing
VAGUEST = 0.3  # a foot alone with a larger relative sigma is none
EDGE = 0.004  # rms of feet about a straight edge: rows of STEP_PX make 0.002
SEAM_EDGE = 0.012  # and of feet that the picture itself was asked for, in strips
SIGMA_EDGE = 0.004  # of the slope of a straight edge, tilt of the camera included; of many feet
SIGMA_SEAM = 0.02  # of a foot that only the picture shows: it finds the shade before a wall as well
SIGMA_FOOT = 0.004  # of the nearest of other feet
SIGMA_ROUND = 0.015  # of the foot of what hangs over: it is in its own shade
FOOT_PART = 0.03  # and of both these so much of the slope besides: fronts are seldom flat
BEHIND = 0.15  # and of what others hide up to all of it so much of the slope times the part that is hidden
MOTION = 1.4  # beside a foot a depth by motion counts with so many of its sigmas, for its tails are heavy
CONTRADICTED = 0.6  # of the difference between foot and depth that contradict each other is the sigma
TO_FRONT, SIGMA_TO_FRONT = 0.05, 0.1  # in widths: a flat front is so far before the thing's mean depth
IN_SIGHT = 0.2  # what shows its foot in a smaller part of its columns is behind others: where it stands can wait
UNTOLD = 0.05  # and while its relative sigma is larger it stands nowhere
FOOTLESS = 0.05  # relative error more of what shows no foot: what stands before it has a part of its outline
MEAN_TO_FRONT = 0.15  # a thing's nearest point before its mean depth, in its widths
FARTHEST_DEPTH_CM = 450.0
LEAST_COLUMNS = 3
MIXED = 2  # a region that is floor up to a foot, beside 1 for floor and 0 for all else
CUT_PART = 0.25  # with a larger part of its feet below the image, the others are a thing's sides or slivers
AT_BORDER = "at the lower border"  # it is there or nearer, and nothing says how much nearer
NO_COLUMNS = np.empty(0, np.int64)
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
    round_cm: float = 0.0  # radius of what is round and hangs over, such as a ball
    seam: bool = False  # only the picture shows its foot; a shade before another thing looks like that

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
    """Per column of the picture the first thing above the floor.

    Attributes
    ----------
    region : (W / 2,) its id, NO_REGION where only floor is seen
    slope, depth_cm : (W / 2,) Y/Z of its foot, and how far that is
    sure : (W / 2,) bool, all that lies before the foot is surely floor
    floor_cm, free_cm : (W / 2,) depth up to which floor is seen, and up to which at the least
    cut : (W / 2,) bool, no floor is seen at all: the foot is at or below the image's lower border
    unknown : (W / 2,) bool, not even at the lower border is floor told from a wall like it
    nearest_cm : where the view of the floor begins
    """

    def __init__(self, picture: Picture, floor: FloorFinder, pose: Pose, height_cm: float) -> None:
        rays = picture.rays
        self.across, self.height_cm = rays.across, height_cm
        ids = picture.ids.tolist()
        ground = np.array(
            [MIXED if floor.is_mixed(i) else i == NO_REGION or floor.is_floor(i) for i in ids], np.uint8
        )
        self.region, self.cut, self.slope, self.depth_cm, self.sure, self.floor_cm, self.free_cm = _nav.feet(
            picture.labels,
            rays.down,
            picture.ids,
            NO_REGION,
            ground,
            floor.foot,
            height_cm,
            FARTHEST_CM,
            SIGMA_RAY,
        )
        self.unknown = (ground[picture.labels[:, 0]] == MIXED) & (floor.foot < 0)
        self.nearest_cm = height_cm / rays.steepest
        heading = heading_of(pose)
        self._ahead = math.sin(heading), math.cos(heading)
        self._from = float(pose.position_cm[0]), float(pose.position_cm[2])
        self._columns = _by_key(2 * self.region + self.cut)

    def columns_of(self, region: int) -> tuple[np.ndarray, np.ndarray]:
        """Columns in which a region's foot is seen, and in which it is below the image."""
        return self._columns.get(2 * region, NO_COLUMNS), self._columns.get(2 * region + 1, NO_COLUMNS)

    def sight_of(self, region: int, t_s: float) -> _nav.FootSight | None:
        """Where a region's foot stands; None where that does not tell where it is."""
        feet = self.region, self.slope, self.depth_cm, self.cut, self.across, self.height_cm
        return _nav.sight_of(*feet, self._from, self._ahead, region, CUT_PART, SIGMA_RAY, t_s)

    def width_cm(self, columns: np.ndarray, depth_cm: float) -> float:
        """Width of what spans these columns at a depth."""
        return float(self.across[columns[-1]] - self.across[columns[0]]) * depth_cm

    def seen_free(self, places: np.ndarray, half_cm: float) -> np.ndarray:
        """(N,) bool, whether floor is seen at places (N, 2) = (x, z) and half so wide on both sides."""
        rel = places - self._from
        ahead = rel @ self._ahead
        aside = rel @ (self._ahead[1], -self._ahead[0])
        seen = ahead - half_cm > self.nearest_cm
        for k in np.flatnonzero(seen):
            edges = (aside[k] - half_cm) / ahead[k], (aside[k] + half_cm) / ahead[k]
            left, right = np.searchsorted(self.across, edges)
            inside = left > 0 and right < len(self.across)
            seen[k] = inside and bool((self.free_cm[left : right + 1] > ahead[k]).all())
        return seen

    def point(self, column: int, depth_cm: float) -> tuple[float, float]:
        """(x, z) in the odometry frame of a depth in a column."""
        side = float(self.across[column]) * depth_cm
        sine, cosine = self._ahead
        x, z = self._from
        return x + depth_cm * sine + side * cosine, z + depth_cm * cosine - side * sine


def _by_key(keys: np.ndarray) -> dict[int, np.ndarray]:
    """Where each key is, in order."""
    order = keys.argsort(kind="stable")
    ordered = keys[order]
    ends = [0, *((ordered[1:] != ordered[:-1]).nonzero()[0] + 1).tolist(), len(keys)]
    return {key: order[a:b] for key, (a, b) in zip(ordered[ends[:-1]].tolist(), pairwise(ends), strict=True)}


def stand_of(
    region_id: int,
    report: DepthReport,
    feet: Feet,
    picture: Picture,
    front_cm: float | None = None,
    mixed: bool = False,
    moving: bool = False,
) -> Standing | None:
    """Where a region that is not floor stands; None while nothing is known of it.

    With a foot, the shape across the columns is the foot's and the mean is that of foot and depth, weighted;
    where they contradict each other the nearer one is taken, and not trusted much. Without one its front lies
    `front_cm` before its mean depth, as it did when its foot was last seen. Where much of the foot is below
    the image it is nearer than the border: what little of a foot is left to see then says nothing.
    """
    measured = None if moving or mixed else usable_depth(report, region_id)  # true of things at rest
    covered = (feet.region == region_id).nonzero()[0] if mixed else picture.columns_of(region_id)
    columns, cut = feet.columns_of(region_id)
    mostly_cut = len(cut) >= LEAST_COLUMNS and len(cut) > CUT_PART * (len(columns) + len(cut))
    if len(columns) >= LEAST_COLUMNS and (
        not mostly_cut or _nav.is_straight_wall(*_shape(region_id, feet, columns, covered, picture))
    ):
        hidden = (len(covered) - len(columns) - len(cut)) / len(covered)  # by others
        found = _on_its_feet(region_id, measured, feet, columns, covered, hidden, picture, mixed)
        return replace(found, seam=True) if found is not None and mixed else found
    if measured is not None:
        z, sigma, how = measured
        hidden = len(cut) < LEAST_COLUMNS and len(columns) < IN_SIGHT * len(covered)
        if len(covered) == 0 or (hidden and sigma > UNTOLD * z):
            return None
        front = z - (MEAN_TO_FRONT * feet.width_cm(covered, z) if front_cm is None else front_cm)
        if not mostly_cut or front <= _mean(feet.depth_cm[cut]):
            sigma = math.hypot(sigma, FOOTLESS * z)
            return Standing(region_id, covered, np.full(len(covered), front), z, sigma, how, FAIR)
    if len(cut) < LEAST_COLUMNS:
        return None
    depth = feet.depth_cm[cut]
    mean = _mean(depth)
    return Standing(region_id, cut, depth, mean, 0.25 * mean, AT_BORDER, FAINT)


def _mean(values: np.ndarray) -> float:
    return float(values.sum()) / len(values)  # what np.mean does, in half the time


def _shape(
    region: int, feet: Feet, columns: np.ndarray, covered: np.ndarray, picture: Picture
) -> tuple[np.ndarray, int, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """A region's feet and outline, as `_nav` asks for them."""
    place = picture.place[region]
    return picture.labels, place, feet.slope, feet.cut, columns, covered, feet.across, feet.height_cm


def _on_its_feet(
    region: int,
    measured: tuple[float, float, str] | None,
    feet: Feet,
    columns: np.ndarray,
    covered: np.ndarray,
    hidden: float,
    picture: Picture,
    mixed: bool,
) -> Standing | None:
    height = feet.height_cm
    nearest, mean, is_wall, line, edges, hangs, touching = _nav.stance(
        *_shape(region, feet, columns, covered, picture), SEAM_EDGE if mixed else EDGE
    )
    if is_wall:
        sigma = SIGMA_SEAM if mixed else SIGMA_RAY if line is None else SIGMA_EDGE
        if (placed := _placed(mean, sigma, measured, height)) is None:
            return None
        if line is None:
            slopes = feet.slope[columns]
        else:
            columns = (feet.region == region).nonzero()[0]  # also where its feet are below the image
            slopes = line[0] + line[1] * columns
        return Standing(region, columns, height / np.maximum(slopes, height / FARTHEST_CM), *placed[1:])

    behind = BEHIND * hidden
    if edges is not None:
        sigma = math.hypot(SIGMA_SEAM if mixed else SIGMA_EDGE, behind * mean)
        placed = _placed(mean, sigma, measured, height)
        if placed is None:
            return None
        slopes = np.maximum(edges + (placed[0] - mean), height / FARTHEST_CM)
        return Standing(region, covered, height / slopes, *placed[1:])

    sigma = SIGMA_SEAM if mixed else SIGMA_ROUND if hangs else SIGMA_FOOT
    sigma = math.hypot(sigma, FOOT_PART * nearest, behind * nearest)
    if measured is not None:
        z, sigma_cm, how = measured
        width_cm = feet.width_cm(covered, z)
        measured = z - TO_FRONT * width_cm, math.hypot(sigma_cm, SIGMA_TO_FRONT * width_cm), how
    if (placed := _placed(nearest, sigma, measured, height)) is None:
        return None
    z = placed[1]
    bulge = round_cm = 0.0
    if hangs:
        round_cm = 0.5 * feet.width_cm(covered, z)
        bulge = (1 - touching) * round_cm
    return Standing(region, covered, np.full(len(covered), z - bulge), *placed[1:], round_cm)


def _placed(
    slope: float, sigma: float, measured: tuple[float, float, str] | None, height_cm: float
) -> tuple[float, float, float, str, float] | None:
    """(slope, depth, its sigma, how, weight) of foot and measured depth; None if that tells nothing."""
    slope, sigma, how, weight = _agreed(slope, sigma, measured, height_cm)
    z = height_cm / slope
    sigma_cm = sigma * z**2 / height_cm
    return None if how == "foot" and sigma_cm > VAGUEST * z else (slope, z, sigma_cm, how, weight)


def _agreed(
    slope: float, sigma: float, measured: tuple[float, float, str] | None, height_cm: float
) -> tuple[float, float, str, float]:
    """(slope, sigma, how, weight) of a foot's slope and a measured depth together."""
    if measured is None:
        return slope, sigma, "foot", FAIR
    z, s, method = measured
    other, sigma_other = height_cm / z, height_cm * s / z**2
    agree = abs(other - slope) < 3 * math.hypot(sigma, sigma_other)
    sigma_other *= MOTION
    if agree:
        share = sigma**2 / (sigma**2 + sigma_other**2)
        both = sigma * sigma_other / math.hypot(sigma, sigma_other)
        return share * other + (1 - share) * slope, both, method, SURE
    doubt = CONTRADICTED * abs(other - slope)  # the farther one may be right after all
    if other > slope:
        return other, max(sigma_other, doubt), method, FAINT
    return slope, max(sigma, doubt), "foot", FAINT


def usable_depth(report: DepthReport, region_id: int) -> tuple[float, float, str] | None:
    """(depth in cm, sigma in cm, method) of a region, or None where it says too little."""
    found = report.regions.get(region_id)
    if found is None or found.depth_cm is None or found.sigma_cm is None:
        return None
    if found.sigma_cm > USABLE * found.depth_cm or found.depth_cm > FARTHEST_DEPTH_CM:
        return None
    return found.depth_cm, found.sigma_cm, found.method or "depth"
