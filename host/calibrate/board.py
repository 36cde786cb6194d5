"""The printed board: chess squares with numbered markers (ChArUco), where its corners are, and finding them.

OpenCV 4 puts these corners half a pixel too far right and down, OpenCV 5 does not, and both return arrays of
other shapes. So every corner found is searched for again here, in the picture itself, from near by.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np

from host.errors import InputError

DICTIONARIES = tuple(f"DICT_{bits}X{bits}_{count}" for bits in (4, 5, 6, 7) for count in (50, 100, 250, 1000))
LEAST_CORNERS = 6  # of a view that is any use
MISFIT = 0.15  # of a square's width: corners that lie worse than this on one plane are of another board
MOVED = 0.12  # of a square's width that a corner may lie from where OpenCV has it
EDGE_LONG = 0.35  # of a square's edge that is looked at, from its corner
EDGE_WIDE = 0.04  # standard deviation of what is looked at beside it, of the same
EDGE_WIDE_PX = 1.2  # and no less than this
MOST_WINDOW_PX = 20.0
EDGE_ROUNDS = 3
EDGE_CROSSING = 0.02  # of the two edges' slopes: less, and only one edge was there
Rectangle = tuple[float, float, float, float]  # x, y, width, height


@dataclass(frozen=True)
class Board:
    """Squares across and down, in mm. The corner at the top left has black below it and to the left above."""

    columns: int = 8
    rows: int = 6
    square_mm: float = 30.0
    marker_mm: float = 22.5
    dictionary: str = "DICT_4X4_50"

    def __post_init__(self) -> None:
        markers = self.columns * self.rows // 2
        if not (3 <= self.columns <= 40 and 3 <= self.rows <= 40):
            raise ValueError(f"{self.columns} by {self.rows} squares: give 3 to 40 each way")
        if self.dictionary not in DICTIONARIES:
            raise ValueError(f"dictionary {self.dictionary!r}: give one of {', '.join(DICTIONARIES)}")
        if not (1.0 <= self.square_mm <= 1000.0 and 0.3 <= self.marker_mm / self.square_mm <= 0.95):
            raise ValueError(
                f"squares of {self.square_mm:g} mm with markers of {self.marker_mm:g}: a marker takes 0.3 to "
                "0.95 of its square"
            )
        if markers > int(self.dictionary.rpartition("_")[2]):
            raise ValueError(f"{markers} markers are more than {self.dictionary} has")

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height."""
        return self.columns * self.square_mm, self.rows * self.square_mm

    @property
    def words(self) -> str:
        """What it is, for a person."""
        return (
            f"{self.columns} x {self.rows} squares of {self.square_mm:g} mm, markers of "
            f"{self.marker_mm:g} mm ({self.dictionary})"
        )

    @cached_property
    def corners_mm(self) -> np.ndarray:
        """(N, 3) inner corners by number, from the board's upper left; z is 0."""
        points = np.asarray(self._board.getChessboardCorners(), float).reshape(-1, 3)
        return points

    @cached_property
    def _marks(self) -> cv2.aruco.Dictionary:
        return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, self.dictionary))

    @cached_property
    def _board(self) -> cv2.aruco.CharucoBoard:
        return cv2.aruco.CharucoBoard((self.columns, self.rows), self.square_mm, self.marker_mm, self._marks)

    @cached_property
    def _detector(self) -> cv2.aruco.CharucoDetector:
        corners = cv2.aruco.CharucoParameters()
        corners.minMarkers = 1  # beside a corner, where OpenCV asks for both
        corners.tryRefineMarkers = True  # from those that were found to those that were nearly
        return cv2.aruco.CharucoDetector(self._board, corners)

    @cached_property
    def black_mm(self) -> list[Rectangle]:
        """Everything black, as rectangles that do not overlap, from the board's upper left corner."""
        s = self.square_mm
        out = [
            (column * s, row * s, s, s)
            for row in range(self.rows)
            for column in range(self.columns)
            if (row + column) % 2 == 0
        ]
        cells = self._marks.markerSize + 2
        cell = self.marker_mm / cells
        ids = np.asarray(self._board.getIds()).ravel()
        for number, corners in zip(ids, self._board.getObjPoints(), strict=True):
            x0, y0 = np.asarray(corners, float).reshape(-1, 3)[0, :2]
            bits = cv2.aruco.generateImageMarker(self._marks, int(number), cells) == 0
            for row in range(cells):
                ends = np.flatnonzero(np.diff(np.r_[False, bits[row], False]))
                out += [
                    (x0 + a * cell, y0 + row * cell, (b - a) * cell, cell)
                    for a, b in zip(ends[::2].tolist(), ends[1::2].tolist(), strict=True)
                ]
        return out

    def find(self, image: np.ndarray) -> Sighting | None:
        """Its corners in a picture, gray or BGR; None where too few or another board's are there."""
        gray = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        found, ids, _, _ = self._detector.detectBoard(gray)
        if found is None or ids is None or len(found) < LEAST_CORNERS:
            return None
        ids = np.asarray(ids, int).reshape(-1)
        rough = np.asarray(found, np.float32).reshape(-1, 2)
        near_px = self._spacing_px(ids, rough)
        if near_px is None:
            return None
        view, _ = cv2.findHomography(self.corners_mm[ids, :2], rough, 0)
        if view is None:
            return None
        points = self._along_edges(gray, ids, rough, view)
        height, width = gray.shape
        kept = np.hypot(*(points - rough).T) < max(MOVED * near_px, 1.5)
        kept &= (points > 2).all(1) & (points < (width - 3, height - 3)).all(1)
        if kept.sum() < LEAST_CORNERS or not self._is_flat(ids[kept], points[kept], near_px):
            return None
        return Sighting(ids[kept], points[kept], near_px, _blur_px(gray, points[kept], near_px))

    def _along_edges(
        self, gray: np.ndarray, ids: np.ndarray, rough: np.ndarray, view: np.ndarray
    ) -> np.ndarray:
        """(N, 2) corners as the points where the edges that meet in them cross.

        Only what is near these edges counts, so that the markers in the squares do not.
        """
        slopes = np.stack([cv2.Sobel(gray, cv2.CV_32F, 1, 0), cv2.Sobel(gray, cv2.CV_32F, 0, 1)], axis=-1)
        out = np.full(rough.shape, np.nan)
        for k, (mm, start) in enumerate(zip(self.corners_mm[ids, :2], rough.astype(float), strict=True)):
            to_px = _slope_of(view, mm) * self.square_mm  # px by squares
            if abs(np.linalg.det(to_px)) < 4.0:
                continue
            to_squares = np.linalg.inv(to_px)
            reach = min(EDGE_LONG * float(np.abs(to_px).sum(1).max()), MOST_WINDOW_PX)
            x0, y0 = np.maximum(np.floor(start - reach).astype(int), 0)
            x1, y1 = np.ceil(start + reach).astype(int) + 1
            near = slopes[y0:y1, x0:x1]
            if min(near.shape[:2]) < 3:
                continue
            x, y = np.meshgrid(np.arange(x0, x0 + near.shape[1]), np.arange(y0, y0 + near.shape[0]))
            at, slope = np.stack([x, y], axis=-1).reshape(-1, 2), near.reshape(-1, 2).astype(float)
            wide = max(EDGE_WIDE, EDGE_WIDE_PX / math.sqrt(abs(np.linalg.det(to_px))))
            along = (slope * at).sum(1)
            point = start
            for _ in range(EDGE_ROUNDS):
                across = np.abs((at - point) @ to_squares.T)
                weight = np.exp(-0.5 * (across.min(1) / wide) ** 2) * (across.max(1) < EDGE_LONG)
                weighed = slope * weight[:, None]
                (a, b), (_, c) = (weighed.T @ slope).tolist()
                size = a * c - b * b
                if not size > EDGE_CROSSING * (a + c) ** 2:
                    break
                p, q = (along @ weighed).tolist()
                point = np.array([c * p - b * q, a * q - b * p]) / size
            else:
                out[k] = point
        return np.where(np.isnan(out), np.inf, out)

    def _spacing_px(self, ids: np.ndarray, points: np.ndarray) -> float | None:
        """The least distance between neighbouring corners."""
        place = {int(number): point for number, point in zip(ids, points, strict=True)}
        across = self.columns - 1
        gaps = [
            math.dist(point, place[other])
            for number, point in place.items()
            for other in (number + 1, number + across)
            if other in place and (other != number + 1 or other % across)
        ]
        return min(gaps) if gaps else None

    def _is_flat(self, ids: np.ndarray, points: np.ndarray, near_px: float) -> bool:
        """Do the corners lie as on this board's plane, but for what a lens bends?"""
        flat = self.corners_mm[ids, :2]
        if np.linalg.matrix_rank(flat - flat.mean(0), tol=0.1 * self.square_mm) < 2:
            return False
        view, _ = cv2.findHomography(flat, points, 0)
        if view is None:
            return False
        on = np.column_stack([flat, np.ones(len(flat))]) @ view.T
        off = np.hypot(*(on[:, :2] / on[:, 2:] - points).T)
        return bool(np.median(off) < MISFIT * near_px)

    def why_not(self, image: np.ndarray) -> str | None:
        """What else there is in a picture in which it is not found; None where there is nothing."""
        gray = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        best, most = self.dictionary, _markers(gray, self._marks)
        for name in DICTIONARIES[1::4]:
            if name.split("_")[1] == self.dictionary.split("_")[1]:
                continue
            ids = _markers(gray, cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name)))
            if len(ids) > len(most):
                best, most = name, ids
        if len(most) < 4:
            return None
        if best != self.dictionary:
            return f"another board, with markers of {best.rpartition('_')[0]}"
        beyond = self.columns * self.rows // 2
        if max(most) >= beyond:
            return f"another board: marker {max(most)} is there, and this one ends at {beyond - 1}"
        return "its markers, but not in their places, or too few of its corners"


def _markers(gray: np.ndarray, marks: cv2.aruco.Dictionary) -> list[int]:
    _, ids, _ = cv2.aruco.ArucoDetector(marks).detectMarkers(gray)
    return [] if ids is None else [int(number) for number in np.asarray(ids).ravel()]


def _slope_of(view: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(2, 2) slopes of a homography at a point."""
    x, y, w = view @ (at[0], at[1], 1.0)
    return (view[:2, :2] - np.outer((x / w, y / w), view[2, :2])) / w


@dataclass(frozen=True)
class Sighting:
    """A board's corners in one picture."""

    ids: np.ndarray  # (N,) numbers of the corners
    points: np.ndarray  # (N, 2) px
    spacing_px: float  # least distance between neighbours
    blur_px: float  # standard deviation of the edges' blur


def _blur_px(gray: np.ndarray, points: np.ndarray, near_px: float) -> float:
    """How wide the edges are at the corners: contrast over steepest slope, as of a blurred step."""
    half = int(np.clip(0.3 * near_px, 3, 12))
    widths = []
    for x, y in np.round(points).astype(int):
        patch = gray[max(y - half, 0) : y + half + 1, max(x - half, 0) : x + half + 1].astype(np.float32)
        if min(patch.shape) < 5:
            continue
        smooth = cv2.GaussianBlur(patch, (0, 0), 0.6)
        slope_y, slope_x = np.gradient(smooth)
        steepest = float(np.percentile(np.hypot(slope_x, slope_y), 97))
        dark, bright = np.percentile(smooth, (5, 95))
        if steepest > 0:
            widths.append((bright - dark) / (steepest * math.sqrt(2 * math.pi)))
    return float(np.median(widths)) if widths else math.inf


def write_board(board: Board, path: Path) -> None:
    """Write what `read_board` reads."""
    from host.record.atomic import write_whole

    write_whole(path, (json.dumps(asdict(board), indent=1) + "\n").encode())


def read_board(path: Path) -> Board:
    """The board that a target.json tells of.

    Raises
    ------
    InputError
        It cannot be read, or tells of no board.
    """
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(values, dict):
            raise ValueError("it must be one JSON object")
        known = {name: type(value) for name, value in asdict(Board()).items()}
        for name, value in values.items():
            if name not in known:
                raise ValueError(f"unknown key {name!r}; the keys are {', '.join(known)}")
            wanted = (int, float) if known[name] is float else known[name]
            if isinstance(value, bool) or not isinstance(value, wanted):
                raise ValueError(f"{name} = {json.dumps(value)[:40]} is not of the right kind")
        return Board(**values)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); 'python -m host.calibrate target' writes one"
        ) from error
    except (ValueError, RecursionError) as error:  # of JSON and of UTF-8 too
        raise InputError(
            f"{path}: tells of no board: {error}; write it with host.calibrate target"
        ) from error
