"""Where the regions of one frame lie, column by column from the lower border up, and along which rays."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from host.camera.lens import Lens
from host.nav import _nav
from host.nav.odometry import heading_of
from host.pose import Pose
from host.rbdn.snapshot import Snapshot

STEP_PX = 2  # the regions are looked at on every second pixel
NO_REGION = -1
FAR = 50.0  # camera heights; where level rays meet the floor is of no interest
LEVEL = 1e-9  # a rotation's part that is no more than rounding


@dataclass(frozen=True, eq=False)
class Rays:
    """Directions of the looked-at pixels with pitch and roll taken out, heading left in."""

    across: np.ndarray  # (W / 2,) X/Z of the column
    down: np.ndarray  # (W / 2, H / 2) Y/Z, lowest pixel first
    _flatter: dict[float, np.ndarray] = field(default_factory=dict, repr=False)
    _steeper: dict[float, np.ndarray] = field(default_factory=dict, repr=False)

    @cached_property
    def reach(self) -> np.ndarray:
        """(W / 2 * H / 2 + 1,) running sum of Z/Y over all pixels, column after column; at most FAR each."""
        return np.concatenate([[0.0], np.cumsum(1.0 / np.maximum(self.down, 1.0 / FAR))])

    @cached_property
    def steepest(self) -> float:
        """Y/Z of the pixel that looks down most."""
        return float(self.down[:, 0].max())

    def flatter(self, slope: float) -> np.ndarray:
        """(W / 2 * H / 2 + 1,) running count of pixels that look down less than a slope."""
        if slope not in self._flatter:
            self._flatter[slope] = np.concatenate([[0.0], np.cumsum(self.down < slope)])
        return self._flatter[slope]

    def steeper(self, slope: float) -> np.ndarray:
        """(W / 2,) how many pixels of each column look down more than a slope."""
        if slope not in self._steeper:
            self._steeper[slope] = (self.down > slope).sum(axis=1)
        return self._steeper[slope]


@lru_cache(maxsize=2)
def _camera_rays(lens: Lens) -> np.ndarray:
    """Directions (3, W / 2 * H / 2) of the looked-at pixels in the camera's frame, Z = 1."""
    cols, rows = lens.width // STEP_PX, lens.height // STEP_PX
    xs = np.arange(cols) * STEP_PX + 0.5 * (STEP_PX - 1)
    ys = np.arange(rows)[::-1] * STEP_PX + 0.5 * (STEP_PX - 1)
    grid = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.vstack([lens.to_rays(grid).T, np.ones(len(grid))])


def _turned(lens: Lens, level: np.ndarray) -> Rays:
    cols, rows = lens.width // STEP_PX, lens.height // STEP_PX
    rays = level @ _camera_rays(lens)
    down = (rays[1] / rays[2]).reshape(cols, rows)
    across = (rays[0] / rays[2]).reshape(cols, rows)[:, rows - 1 - rows // 2]
    return Rays(across, down)


@lru_cache(maxsize=2)
def _level_rays(lens: Lens) -> Rays:
    return _turned(lens, np.eye(3))


def rays_of(lens: Lens, pose: Pose) -> Rays:
    """Rays of the looked-at pixels, seen from a pose."""
    if abs(pose.rotation[1, 1] - 1.0) < LEVEL:
        return _level_rays(lens)
    return _turned(lens, Pose.planar(0.0, 0.0, heading_of(pose)).rotation.T @ pose.rotation)


class Picture:
    """Regions by pixel.

    Attributes
    ----------
    ids : (K + 1,) region ids, NO_REGION last
    place : dict, index into ids by region id
    labels : (W / 2, H / 2) index into ids of every second pixel, lowest pixel first
    lowest : (K + 1, W / 2) how many pixels above the lower border each region begins; -1 where it is not
    pixels : (K + 1,) how many each region has
    at_border : (K + 1,) how many of them at the lower border
    """

    def __init__(self, snapshot: Snapshot, lens: Lens, rays: Rays) -> None:
        self.ids = np.array([*(region.id for region in snapshot.regions), NO_REGION], np.int64)
        self.place = {region.id: k for k, region in enumerate(snapshot.regions)}
        self.rays = rays
        self.labels, self._starts, self._ends, self._owner, self.lowest, self.pixels, self.at_border = (
            _nav.columns(label_image(snapshot, lens), len(self.ids))
        )

    @property
    def shape(self) -> tuple[int, int]:
        """(W / 2, H / 2)."""
        return self.labels.shape[0], self.labels.shape[1]

    def total(self, running: np.ndarray) -> np.ndarray:
        """(K + 1,) of what a running sum over all pixels says of each region's."""
        return _nav.totals(running, self._starts, self._ends, self._owner, len(self.ids))

    def columns_of(self, region: int) -> np.ndarray:
        """Columns in which a region is seen."""
        return (self.lowest[self.place[region]] >= 0).nonzero()[0]


def label_image(snapshot: Snapshot, lens: Lens) -> np.ndarray:
    """Which of the snapshot's regions every second pixel shows, (H / 2, W / 2); their number where none."""
    loops = [loop for region in snapshot.regions for loop in region.loops]
    return _nav.fill(
        np.concatenate([*loops, np.zeros((0, 2))]),
        np.array([len(loop) for loop in loops], np.int64),
        np.array([k for k, region in enumerate(snapshot.regions) for _ in region.loops], np.int64),
        lens.height // STEP_PX,
        lens.width // STEP_PX,
        STEP_PX,
        len(snapshot.regions),
    )
