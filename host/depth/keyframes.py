"""The outlines of earlier frames, kept so that the nearest outline to any image point is one look-up away."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from host.camera.lens import Lens
from host.depth.config import DepthConfig
from host.depth.motion import Station, most_redundant
from host.rbdn.snapshot import OUTSIDE, Contour, Region

DIRECTIONS = 4  # outlines are filed by direction, every 45 degrees
CELL_PX = 2  # side of a cell of the look-up map
SAMPLES = 16384  # of outline kept of each frame at most
REACH_CELLS = 4  # how far from an outline the map still points to it


@dataclass(frozen=True)
class Outline:
    """Contour samples without the lens's distortion: pixels of an ideal camera of the same f and centre."""

    xy_px: np.ndarray  # (N, 2)
    normal: np.ndarray  # (N, 2), from left to right region
    left: np.ndarray  # (N,) region id
    right: np.ndarray  # (N,)
    length_px: np.ndarray  # (N,)


def usable_outline(contour: Contour, lens: Lens, border_px: float) -> Outline:
    """The samples between two regions and away from the image border, undistorted."""
    x, y = contour.xy_px[:, 0], contour.xy_px[:, 1]
    keep = (contour.left != OUTSIDE) & (contour.right != OUTSIDE) & (contour.left != contour.right)
    keep &= (x > border_px) & (x < lens.width - 1 - border_px)
    keep &= (y > border_px) & (y < lens.height - 1 - border_px)
    xy, normal = contour.xy_px[keep], contour.normal[keep]
    if any(lens.distortion):
        focal, centre = np.array([lens.fx, lens.fy]), np.array([lens.cx, lens.cy])
        along = np.column_stack([-normal[:, 1], normal[:, 0]])
        ends = [lens.to_rays(xy + s * along) * focal + centre for s in (-0.5, 0.0, 0.5)]
        along = ends[2] - ends[0]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        xy, normal = ends[1], np.column_stack([along[:, 1], -along[:, 0]])
    return Outline(xy, normal, contour.left[keep], contour.right[keep], contour.length_px[keep])


@dataclass(frozen=True)
class Faces:
    """Who the regions of a frame are and what they look like."""

    ids: np.ndarray  # (R,)
    rgb: np.ndarray  # (R, 3) 0..255


def faces_of(regions: tuple[Region, ...]) -> Faces:
    """Ids and colours of the regions, row by row."""
    return Faces(
        np.array([r.id for r in regions], np.int64), np.array([r.mean_rgb for r in regions]).reshape(-1, 3)
    )


def rows_of(wanted: np.ndarray, ids: np.ndarray) -> np.ndarray:
    """Row of each wanted id in `ids`, -1 where it is not there."""
    if len(ids) == 0:
        return np.full(len(wanted), -1)
    order = np.argsort(ids)
    at = order[np.minimum(np.searchsorted(ids[order], wanted), len(ids) - 1)]
    return np.where(ids[at] == wanted, at, -1)


@dataclass(frozen=True)
class Match:
    """Contour samples of earlier frames nearest to asked points; every array of the question's shape."""

    x_px: np.ndarray
    y_px: np.ndarray
    normal_x: np.ndarray
    normal_y: np.ndarray
    left: np.ndarray  # row of the region on either side among those of its keyframe
    right: np.ndarray
    found: np.ndarray  # bool


def direction_of(normal_x: np.ndarray, normal_y: np.ndarray) -> np.ndarray:
    """Which of the filed directions is nearest to each normal; its sense does not matter."""
    angle = np.arctan2(normal_y, normal_x)
    return np.rint(angle * (DIRECTIONS / np.pi)).astype(np.int64) % DIRECTIONS


class Keyframes:
    """A few earlier frames, spread over the path."""

    def __init__(self, lens: Lens, config: DepthConfig) -> None:
        self._limit = config.keyframes
        self._width, self._height = lens.width, lens.height
        self._rows = lens.height // CELL_PX + 1 + 2 * REACH_CELLS
        self._columns = lens.width // CELL_PX + 1 + 2 * REACH_CELLS
        self.stations: list[Station] = []  # oldest first
        self._slots: list[int] = []  # where each is filed
        # row of the sample nearest to each cell, for each slot and direction; -1 where there is none
        self._index = np.full(self._limit * DIRECTIONS * self._rows * self._columns, -1, np.int32)
        self._table = np.zeros(
            (4, self._limit * SAMPLES), np.float32
        )  # x, y, normal x, normal y; SAMPLES rows a slot
        self._sides = np.zeros((2, self._limit * SAMPLES), np.int32)  # rows of left and right region
        self._faces = [Faces(np.zeros(0, np.int64), np.zeros((0, 3)))] * self._limit
        self._offsets = self._nearest_last()

    def _nearest_last(self) -> list[int]:
        """Steps within the map, far ones first, so that painting in this order leaves the nearest on top."""
        span = range(-REACH_CELLS, REACH_CELLS + 1)
        steps = [(dx * dx + dy * dy, dy * self._columns + dx) for dy in span for dx in span]
        return [at for d2, at in sorted(steps, reverse=True) if d2 <= REACH_CELLS**2]

    @property
    def faces(self) -> list[Faces]:
        """Regions of the kept frames, in the order of `stations`."""
        return [self._faces[slot] for slot in self._slots]

    def add(self, outline: Outline, faces: Faces, station: Station) -> None:
        """Keep a frame; when there are too many, the one missed least goes."""
        if len(self.stations) == self._limit:
            positions = np.array([s.pose.position_cm for s in self.stations])
            gone = most_redundant(positions, station.pose.position_cm)
            del self.stations[gone]
            slot = self._slots.pop(gone)
        else:
            slot = len(self.stations)
        self.stations.append(station)
        self._slots.append(slot)
        self._faces[slot] = faces
        self._paint(slot, outline, faces.ids)

    def _paint(self, slot: int, outline: Outline, ids: np.ndarray) -> None:
        cells = self._rows * self._columns
        layers = self._index[slot * DIRECTIONS * cells : (slot + 1) * DIRECTIONS * cells]
        layers[:] = -1
        # an outline too long for its slot is thinned evenly
        thin = slice(None, None, 1 + len(outline.xy_px) // SAMPLES)
        xy, normal = outline.xy_px[thin], outline.normal[thin]
        first = slot * SAMPLES
        self._table[:2, first : first + len(xy)] = xy.T
        self._table[2:, first : first + len(xy)] = normal.T
        self._sides[0, first : first + len(xy)] = rows_of(outline.left[thin], ids)
        self._sides[1, first : first + len(xy)] = rows_of(outline.right[thin], ids)
        cell = np.rint(xy / CELL_PX).astype(np.int64) + REACH_CELLS
        low, high = REACH_CELLS, np.array([self._columns, self._rows]) - 1 - REACH_CELLS
        inside = ((cell >= low) & (cell <= high)).all(axis=1)
        at = (cell[:, 1] * self._columns + cell[:, 0])[inside]
        index = (first + np.nonzero(inside)[0]).astype(np.int32)
        angle = np.floor(np.arctan2(normal[inside, 1], normal[inside, 0]) * (DIRECTIONS / np.pi))
        # every sample is filed under the two directions it lies between
        base = np.concatenate([((angle + d).astype(np.int64) % DIRECTIONS) * cells + at for d in (0, 1)])
        index = np.concatenate([index, index])
        for offset in self._offsets:
            layers[base + offset] = index

    def match(self, which: np.ndarray, x_px: np.ndarray, y_px: np.ndarray, direction: np.ndarray) -> Match:
        """Nearest samples of like direction.

        Parameters
        ----------
        which : (...,) index into `stations`
        x_px, y_px : (...,) where to look, ideal pixels
        direction : (...,) as `direction_of` has it
        """
        inside = (x_px > -0.5) & (x_px < self._width - 0.5) & (y_px > -0.5) & (y_px < self._height - 0.5)
        column = (np.where(inside, x_px, 0) * (1 / CELL_PX) + (REACH_CELLS + 0.5)).astype(np.int32)
        row = (np.where(inside, y_px, 0) * (1 / CELL_PX) + (REACH_CELLS + 0.5)).astype(np.int32)
        layer = np.asarray(self._slots)[which] * DIRECTIONS + direction
        at = self._index.take((layer * self._rows + row) * self._columns + column)
        found = inside & (at >= 0)
        x, y, nx, ny = (table.take(at, mode="clip") for table in self._table)
        left, right = (table.take(at, mode="clip") for table in self._sides)
        return Match(x, y, nx, ny, left, right, found)
