"""The net's vertices in space, in cm, with the camera and its path: aslant from behind and from above."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from host.depth.report import DepthReport
from host.pose import Pose
from host.rbdn.snapshot import Region, Snapshot
from host.view.canvas import SUBPIXEL_BITS, caption_bar
from host.view.palette import INK, MUTED, PAPER, Colour, region_colour, text_size, write

SIZE_PX = (900, 640)  # width, height of the slanting view; the other is as high
ABOVE_WIDTH_PX = 560
MARGIN_PX = 46
LETTERS = 0.45
TURN_RAD = math.radians(28)  # the viewer stands so far to the right of straight behind
TILT_RAD = math.radians(24)  # and looks down by so much
SURE_SHARE = 0.15  # vertices less sure than this, sigma over depth, are left out
OUTLIERS_PERCENT = 2  # of the vertices at either end may lie outside the picture
GRID_LINES = 9  # about, along the longer side
FRUSTUM_SHARE = 0.1  # its length, of the longer side of the grid
GRID: Colour = (222, 216, 208)
STALK: Colour = (205, 200, 194)
PATH: Colour = (176, 108, 40)
FILL = 0.3


@dataclass(frozen=True)
class Space:
    """What is drawn, in the world's axes: x right, y down, z forward, cm."""

    path_cm: np.ndarray  # (F, 3) camera positions
    camera: Pose  # the last of them
    points_cm: np.ndarray  # (N, 3) vertices
    sigma_cm: np.ndarray  # (N,) along the camera's ray
    edges: dict[tuple[int, int], int]  # pairs of points, and the smaller of the regions they lie between
    faces: tuple[
        tuple[Region, tuple[int, ...]], ...
    ]  # regions whose every vertex is known, and which they are
    left_out: int  # vertices without a depth, or with too unsure a one


def space_of(snapshot: Snapshot, depths: DepthReport, poses: Sequence[Pose]) -> Space:
    """Where the vertices of the last frame are, and where the camera was in all frames.

    Parameters
    ----------
    snapshot, depths
        Of the last frame.
    poses
        Of all frames up to it.
    """
    camera, found = poses[-1], depths.vertices
    depth = found.xyz_cm[:, 2]
    with np.errstate(invalid="ignore"):
        sure = np.isfinite(depth) & (depth > 0) & (found.sigma_cm < SURE_SHARE * depth)
    points = found.xyz_cm[sure] @ camera.rotation.T + camera.position_cm
    row = {int(vertex): k for k, vertex in enumerate(found.ids[sure])}
    edges: dict[tuple[int, int], int] = {}
    faces = []
    for region in sorted(snapshot.regions, key=lambda r: -r.area_px):
        for loop in region.loop_vertices:
            ends = [row.get(int(vertex)) for vertex in loop]
            for a, b in zip(ends, ends[1:] + ends[:1], strict=True):
                if a is not None and b is not None:
                    edges[min(a, b), max(a, b)] = region.id
        outer = [row.get(int(vertex)) for vertex in region.loop_vertices[0]]
        known = tuple(k for k in outer if k is not None)
        if len(known) == len(outer):
            faces.append((region, known))
    sigma = found.sigma_cm[sure] / depth[sure] * np.linalg.norm(found.xyz_cm[sure], axis=1)
    path = np.array([pose.position_cm for pose in poses])
    left_out = len(snapshot.vertices.ids) - len(points)
    return Space(path, camera, points, sigma, edges, tuple(faces), left_out)


def draw_space(space: Space, caption: str = "") -> np.ndarray:
    """Draw both views side by side, (H, W, 3) uint8, BGR.

    The net's edges have the colours that their regions have in the other pictures.
    """
    slanting = _View(space, SIZE_PX, TURN_RAD, TILT_RAD)
    above = _View(space, (ABOVE_WIDTH_PX, SIZE_PX[1]), 0.0, math.pi / 2)
    row = np.hstack(
        [
            slanting.drawn("aslant from behind; sticks along the rays are one sigma either way"),
            above.drawn("from above"),
        ]
    )
    shown = f"{len(space.points_cm)} vertices"
    if space.left_out:
        shown += f"; {space.left_out} without a depth good to {100 * SURE_SHARE:g} %"
    return np.vstack([row, caption_bar(row.shape[1], caption, shown)])


class _View:
    """A parallel projection of the scene onto a canvas."""

    def __init__(self, space: Space, size_px: tuple[int, int], turn_rad: float, tilt_rad: float) -> None:
        self._space = space
        ct, st, cd, sd = math.cos(turn_rad), math.sin(turn_rad), math.cos(tilt_rad), math.sin(tilt_rad)
        self._right = np.array([ct, 0.0, st])
        self._down = np.array([st * sd, cd, -ct * sd])
        self._ahead = np.array([-st * cd, sd, ct * cd])
        low, high = _bounds(space)
        self._floor_y = high[1]
        self._step = _round_step(float(max(high[0] - low[0], high[2] - low[2])))
        self._x = _grid_from_to(low[0], high[0], self._step)
        self._z = _grid_from_to(low[2], high[2], self._step)
        corners = np.array(
            [(x, y, z) for x in self._x[[0, -1]] for y in (low[1], high[1]) for z in self._z[[0, -1]]]
        )
        flat = np.column_stack([corners @ self._right, corners @ self._down])
        room = np.array(size_px) - 2 * MARGIN_PX
        self._scale = float((room / np.ptp(flat, axis=0)).min())
        middle = (flat.min(axis=0) + flat.max(axis=0)) / 2
        self._origin = np.array(size_px) / 2 - self._scale * middle
        self._canvas = np.full((size_px[1], size_px[0], 3), PAPER, np.uint8)

    def drawn(self, title: str) -> np.ndarray:
        """The finished canvas."""
        write(self._canvas, title, (14, 24), LETTERS, INK)
        self._grid()
        self._stalks()
        self._faces()
        self._edges()
        self._vertices()
        self._camera()
        return self._canvas

    def _at(self, points_cm: np.ndarray) -> np.ndarray:
        """Places (N, 2) int32 in OpenCV's fixed point."""
        points = np.atleast_2d(points_cm)
        flat = np.column_stack([points @ self._right, points @ self._down])
        return np.round((self._origin + self._scale * flat) * (1 << SUBPIXEL_BITS)).astype(np.int32)

    def _line(self, points_cm: np.ndarray, colour: Colour, width: int = 1, closed: bool = False) -> None:
        places = self._at(points_cm).reshape(-1, 1, 2)
        cv2.polylines(self._canvas, [places], closed, colour, width, cv2.LINE_AA, SUBPIXEL_BITS)

    def _dot(self, point_cm: np.ndarray, radius_px: float, colour: Colour) -> None:
        x, y = (int(v) for v in self._at(point_cm)[0])
        fixed = round(radius_px * (1 << SUBPIXEL_BITS))
        cv2.circle(self._canvas, (x, y), fixed, colour, -1, cv2.LINE_AA, SUBPIXEL_BITS)

    def _grid(self) -> None:
        y = self._floor_y
        for x in self._x:
            self._line(np.array([(x, y, self._z[0]), (x, y, self._z[-1])]), GRID)
        for z in self._z:
            self._line(np.array([(self._x[0], y, z), (self._x[-1], y, z)]), GRID)
        for x in self._x:
            self._number(x, (x, y, self._z[0]), (0, 18))
        for z in self._z[1:]:
            self._number(z, (self._x[-1], y, z), (24, 5))
        self._word("x, cm", ((self._x[0] + self._x[-1]) / 2, y, self._z[0]), (0, 36))
        self._word("z, cm", (self._x[-1], y, (self._z[0] + self._z[-1]) / 2), (64, 5))

    def _number(self, value: float, at_cm: tuple[float, float, float], shift_px: tuple[int, int]) -> None:
        self._word(f"{value:g}", at_cm, shift_px)

    def _word(self, text: str, at_cm: tuple[float, float, float], shift_px: tuple[int, int]) -> None:
        x, y = self._at(np.array(at_cm))[0] / (1 << SUBPIXEL_BITS)
        left = round(x) + shift_px[0] - text_size(text, LETTERS)[0] // 2
        write(self._canvas, text, (left, round(y) + shift_px[1]), LETTERS, MUTED)

    def _stalks(self) -> None:
        for point in self._space.points_cm:
            foot = np.array([point[0], self._floor_y, point[2]])
            self._line(np.array([point, foot]), STALK)
            self._dot(foot, 1.5, STALK)

    def _faces(self) -> None:
        """Each in its own colour, the farthest first."""
        faces = [(region, self._space.points_cm[list(rows)]) for region, rows in self._space.faces]
        for region, points in sorted(faces, key=lambda pair: -float((pair[1] @ self._ahead).mean())):
            red, green, blue = region.mean_rgb
            places = [self._at(points).reshape(-1, 1, 2)]
            layer = self._canvas.copy()
            cv2.fillPoly(layer, places, (blue, green, red), cv2.LINE_AA, SUBPIXEL_BITS)
            cv2.addWeighted(layer, FILL, self._canvas, 1 - FILL, 0, dst=self._canvas)

    def _edges(self) -> None:
        for ends, region in self._space.edges.items():
            self._line(self._space.points_cm[list(ends)], region_colour(region), 2)

    def _vertices(self) -> None:
        """Each with its sigma either way along the ray it was seen on."""
        camera = self._space.camera.position_cm
        for point, sigma in zip(self._space.points_cm, self._space.sigma_cm, strict=True):
            ray = (point - camera) / np.linalg.norm(point - camera)
            self._line(np.array([point - sigma * ray, point + sigma * ray]), MUTED)
            self._dot(point, 3.0, INK)

    def _camera(self) -> None:
        self._line(self._space.path_cm, PATH, 2)
        for place in self._space.path_cm:
            self._dot(place, 2.0, PATH)
        pose = self._space.camera
        length = FRUSTUM_SHARE * max(np.ptp(self._x), np.ptp(self._z))
        corners = length * np.array([(-0.43, -0.32, 1), (0.43, -0.32, 1), (0.43, 0.32, 1), (-0.43, 0.32, 1)])
        rim = corners @ pose.rotation.T + pose.position_cm
        self._line(rim, PATH, 1, closed=True)
        for corner in rim:
            self._line(np.array([pose.position_cm, corner]), PATH)


def _bounds(space: Space) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest x, y, z (3,) of path and nearly all points."""
    low, high = space.path_cm.min(axis=0), space.path_cm.max(axis=0)
    if len(space.points_cm):
        least = np.percentile(space.points_cm, OUTLIERS_PERCENT, axis=0, method="lower")
        greatest = np.percentile(space.points_cm, 100 - OUTLIERS_PERCENT, axis=0, method="higher")
        low, high = np.minimum(low, least), np.maximum(high, greatest)
    return low, high


def _round_step(length_cm: float) -> float:
    """Distance between grid lines: 1, 2 or 5 times a power of ten."""
    wanted = max(length_cm, 1.0) / GRID_LINES
    power = 10.0 ** math.floor(math.log10(wanted))
    return next(n * power for n in (1.0, 2.0, 5.0, 10.0) if n * power >= wanted)


def _grid_from_to(low: float, high: float, step: float) -> np.ndarray:
    first, last = math.floor(low / step), math.ceil(high / step)
    return step * np.arange(first, max(last, first + 1) + 1)
