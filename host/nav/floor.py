"""Which regions are floor: told by their depths against the floor's plane, by place and by colour.

The camera's height is known, so the floor's depth along every ray below the horizon is too. A region lies
on that plane or stands on it. Where a weak edge has made one region of floor and wall, only its near part
counts as floor, and only weakly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from host.camera.lens import Lens
from host.depth.report import DepthReport
from host.nav.odometry import heading_of
from host.pose import Pose
from host.rbdn.snapshot import Region, Snapshot

STEP_PX = 2  # the regions are looked at on every second pixel
NO_REGION = -1
FARTHEST_CM = 500.0  # above the row where the floor is this far away nothing counts as floor
MIXED_CM = 90.0  # of a region that is floor and wall in one, floor is what would be nearer than this
CROSSING = 0.02  # a region with more than this share above that row is not floor alone
LIKE_FLOOR = 20.0  # mean colours nearer than this to a proven floor's are floor too
LIKE_MIXED = 35.0  # and what is floor and wall in one is still nearer than this
MOST_OF_BORDER = 0.6  # while no floor is known, what covers this share of the lower border is floor at least
PART_OF_BORDER = 0.3  # and what covers this and is nothing else is floor alone
SIGMA_RAY = 0.01  # of the tilt of the floor's plane against the camera, rad
VOTE = 0.2  # what one frame's depths count; a new region begins at 1 or -0.1 by its looks
CERTAIN = 3.0  # votes are kept within this


@dataclass(frozen=True)
class Rays:
    """Directions of the label image's pixels with pitch and roll taken out, heading left in."""

    across: np.ndarray  # (W / 2,) X/Z of the column
    down: np.ndarray  # (H / 2, W / 2) Y/Z


def label_image(snapshot: Snapshot, lens: Lens) -> np.ndarray:
    """Region id of every second pixel, (H / 2, W / 2) int32; NO_REGION where none is."""
    labels = np.full((lens.height // STEP_PX, lens.width // STEP_PX), NO_REGION, np.int32)
    for region in snapshot.regions:
        loops = [np.round((loop - 0.5) / STEP_PX * 16).astype(np.int32) for loop in region.loops]
        cv2.fillPoly(labels, loops, region.id, shift=4)
    return labels


@lru_cache(maxsize=2)
def _camera_rays(shape: tuple[int, int], lens: Lens) -> np.ndarray:
    """Directions (3, H / 2 * W / 2) of a label image's pixels in the camera's frame, Z = 1."""
    rows, cols = shape
    xs = np.arange(cols) * STEP_PX + 0.5 * (STEP_PX - 1)
    ys = np.arange(rows) * STEP_PX + 0.5 * (STEP_PX - 1)
    grid = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    return np.vstack([lens.to_rays(grid).T, np.ones(len(grid))])


def rays_of(shape: tuple[int, int], lens: Lens, pose: Pose) -> Rays:
    """Rays of a label image's pixels, seen from a pose."""
    rows, cols = shape
    level = Pose.planar(0.0, 0.0, heading_of(pose)).rotation.T @ pose.rotation
    rays = level @ _camera_rays(shape, lens)
    middle = slice(rows // 2 * cols, (rows // 2 + 1) * cols)
    return Rays(rays[0, middle] / rays[2, middle], (rays[1] / rays[2]).reshape(shape))


class FloorFinder:
    """Votes of all frames on every region; one bad frame changes nothing."""

    def __init__(self, height_cm: float) -> None:
        self._height_cm = height_cm
        self._votes: dict[int, float] = {}
        self._mixed: set[int] = set()
        self._floor_rgb: np.ndarray | None = None

    def is_floor(self, region_id: int) -> bool:
        """Floor and nothing else."""
        return self._votes.get(region_id, 0.0) > 0.0 and region_id not in self._mixed

    def is_mixed(self, region_id: int) -> bool:
        """Floor and something else in one region."""
        return region_id in self._mixed

    def update(self, snapshot: Snapshot, report: DepthReport, pose: Pose, labels: np.ndarray, rays: Rays):
        """Take in one frame.

        Returns
        -------
        floor : (H / 2, W / 2) bool, what is taken for floor
        unsure : the same, where a mixed region may be floor, far or near
        """
        self._mixed.clear()
        for region in snapshot.regions:
            mine = labels == region.id
            if mine.any():
                self._vote(region, mine, report, pose, rays)
        known = {region.id for region in snapshot.regions}
        self._votes = {k: v for k, v in self._votes.items() if k in known}
        self._learn_colour(snapshot)
        mixed = np.asarray(np.isin(labels, list(self._mixed)))
        floor = np.asarray(np.isin(labels, [i for i in known if self.is_floor(i)]))
        near = mixed & (rays.down > self._height_cm / MIXED_CM)
        return floor | near, mixed & (rays.down > self._height_cm / FARTHEST_CM)

    def _vote(self, region: Region, mine: np.ndarray, report: DepthReport, pose: Pose, rays: Rays) -> None:
        before = self._votes.get(region.id)
        ray_y = rays.down[mine]
        if float((ray_y < self._height_cm / FARTHEST_CM).mean()) > CROSSING:
            mixed = self._looks_mixed(region, mine) or ((before or 0.0) > 0 and bool(mine[-1].any()))
            if mixed:
                self._mixed.add(region.id)
            if before is None:
                self._votes[region.id] = 1.0 if mixed else -CERTAIN
            return
        vote = self._vote_of_depth(region, mine, report, rays)
        on, above = self._corners(region, report, pose)
        if on + above >= 3:
            vote += VOTE * (on - 2 * above) / (on + above)
        like = self._looks_like_floor(region, mine)
        if before is None:
            vote += 1.0 if like else -0.1
        elif like and mine[-1].any():
            vote += VOTE / 2
        self._votes[region.id] = float(np.clip((before or 0.0) + vote, -CERTAIN, CERTAIN))

    def _looks_like_floor(self, region: Region, mine: np.ndarray) -> bool:
        """By colour, and before a floor's colour is known by lying in front of the robot."""
        if self._floor_rgb is None:
            return float(mine[-1].mean()) > PART_OF_BORDER
        return self._off_floor_colour(region) < LIKE_FLOOR

    def _looks_mixed(self, region: Region, mine: np.ndarray) -> bool:
        """Does a region that reaches up to the walls hold the floor before the robot as well?"""
        share = float(mine[-1].mean())
        if self._floor_rgb is None:
            return share > MOST_OF_BORDER
        return share > PART_OF_BORDER and self._off_floor_colour(region) < LIKE_MIXED

    def _off_floor_colour(self, region: Region) -> float:
        return float(np.linalg.norm(np.array(region.mean_rgb) - self._floor_rgb))

    def _vote_of_depth(self, region: Region, mine: np.ndarray, report: DepthReport, rays: Rays) -> float:
        """Does the region's depth fit a thing lying on the floor, or one standing on its lowest row?"""
        found = report.regions.get(region.id)
        if found is None or found.depth_cm is None or found.sigma_cm is None:
            return 0.0
        lying = float(np.mean(self._height_cm / rays.down[mine]))
        columns = np.nonzero(mine.any(axis=0))[0]
        lowest = len(mine) - 1 - np.argmax(mine[::-1, columns], axis=0)
        standing = float(np.mean(self._height_cm / rays.down[lowest, columns]))
        if lying - standing < 2 * found.sigma_cm:
            return 0.0
        return VOTE if found.depth_cm**2 > lying * standing else -VOTE

    def _corners(self, region: Region, report: DepthReport, pose: Pose) -> tuple[int, int]:
        """How many of a region's vertices lie on the floor, and how many surely above it."""
        ids = np.concatenate(region.loop_vertices) if region.loop_vertices else np.empty(0, np.int64)
        pick = np.isin(report.vertices.ids, ids) & np.isfinite(report.vertices.sigma_cm)
        if not pick.any():
            return 0, 0
        xyz = report.vertices.xyz_cm[pick]
        down = np.einsum("j,nj->n", pose.rotation[1], xyz)
        slope = np.abs(down) / np.maximum(xyz[:, 2], 1.0)
        sigma = np.hypot(report.vertices.sigma_cm[pick] * slope, xyz[:, 2] * SIGMA_RAY)
        over = self._height_cm - down
        sure = sigma < 2.0
        on, above = np.abs(over) < 2 * sigma + 1.0, over > 2 * sigma + 2.0
        return int((sure & on).sum()), int((sure & above).sum())

    def _learn_colour(self, snapshot: Snapshot) -> None:
        proven = [r for r in snapshot.regions if self.is_floor(r.id) and self._votes[r.id] > 0.4]
        if not proven:
            return
        rgb = np.array(max(proven, key=lambda r: r.area_px).mean_rgb)
        self._floor_rgb = rgb if self._floor_rgb is None else 0.9 * self._floor_rgb + 0.1 * rgb
