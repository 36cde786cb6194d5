"""Which views of the board are taken by themselves, what they cover of picture, tilts and distances, and what
is missing."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field

import cv2
import numpy as np

from host.calibrate.board import Board, Sighting
from host.calibrate.intrinsics import Corners

COLUMNS, ROWS = 8, 6  # of the picture's cells
LEAST_VIEWS = 8  # to reckon with
ENOUGH_VIEWS, MOST_VIEWS = 20, 60
CELLS_WANTED, CELLS_NEEDED = 0.85, 0.65  # share of the picture with corners in it: to stop, to pass
TILTED_RAD = 0.28  # 16 degrees
FACING_RAD = 0.15
EACH_TILT, EACH_DISTANCE = 2, 2  # views
NEAR, FAR = 0.7, 0.55  # of the picture's width that the whole board takes, or would
STEADY_PX, STEADY_WIDTH = 0.7, 640  # movement from one picture to the next, at that width
SOON_S = 0.25  # pictures further apart tell nothing of steadiness
BLURRED_PX = 2.5  # of an edge, at that width
LEAST_SQUARE_PX = 12.0
NEW = 0.18  # sum of differences in place, size and tilt that makes another view
SHADES = " ░▒▓█"
TILTS = ("left away", "right away", "top away", "bottom away")
PARTS = (
    ("upper left", "top", "upper right"),
    ("left", "middle", "right"),
    ("lower left", "bottom", "lower right"),
)


@dataclass(frozen=True)
class View:
    """A board that was held still and sharp."""

    corners: Corners
    looks: np.ndarray  # (5,) middle across and down, width over the picture's, tilts over 60 degrees
    tilt: tuple[float, float]  # rad: right side away, top away
    width: float  # of the whole board over the picture's


@dataclass
class Coverage:
    """Takes pictures' sightings one by one and keeps those that add something."""

    board: Board
    width: int
    height: int
    steady_wanted: bool  # not of photographs, between which anything may happen
    views: list[View] = field(default_factory=list)
    cells: np.ndarray = field(default_factory=lambda: np.zeros((ROWS, COLUMNS), int))
    seen: Counter[str] = field(default_factory=Counter)  # pictures by what became of them
    blur_px: float = math.inf  # the least so far
    _last: tuple[float, Sighting] | None = None

    def add(self, sighting: Sighting | None, t_s: float) -> str:
        """What became of a picture: taken, none, blurred, moving, far or same."""
        last, self._last = self._last, None if sighting is None else (t_s, sighting)
        verdict = "none" if sighting is None else self._verdict(sighting, t_s, last)
        self.seen[verdict] += 1
        return verdict

    def _verdict(self, sighting: Sighting, t_s: float, last: tuple[float, Sighting] | None) -> str:
        self.blur_px = min(self.blur_px, sighting.blur_px)
        if sighting.spacing_px < LEAST_SQUARE_PX:
            return "far"
        if self.steady_wanted and not self._steady(sighting, t_s, last):
            return "moving"
        if sighting.blur_px > self.most_blur_px:
            return "blurred"
        view = self._view(sighting)
        if view is None:
            return "none"
        if any(np.abs(view.looks - one.looks).sum() < NEW for one in self.views):
            return "same"
        self.views.append(view)
        cell = self._cells_of(view.corners.points)
        np.add.at(self.cells, (cell[:, 1], cell[:, 0]), 1)
        return "taken"

    @property
    def most_blur_px(self) -> float:
        """Of an edge that is sharp enough."""
        return BLURRED_PX * max(1.0, self.width / STEADY_WIDTH)

    def _steady(self, sighting: Sighting, t_s: float, last: tuple[float, Sighting] | None) -> bool:
        if last is None or not 0 < t_s - last[0] < SOON_S:
            return False
        _, mine, theirs = np.intersect1d(sighting.ids, last[1].ids, return_indices=True)
        if len(mine) < 4:
            return False
        moved = float(np.median(np.hypot(*(sighting.points[mine] - last[1].points[theirs]).T)))
        return moved < STEADY_PX * max(1.0, self.width / STEADY_WIDTH)

    def _view(self, sighting: Sighting) -> View | None:
        mm = self.board.corners_mm[sighting.ids]
        guess = np.array([
            [self.width, 0, (self.width - 1) / 2], [0, self.width, (self.height - 1) / 2], [0, 0, 1.0]
        ])  # fmt: skip
        ok, turn, place = cv2.solvePnP(
            mm.reshape(-1, 1, 3), sighting.points.reshape(-1, 1, 2), guess, np.zeros(5),
            flags=cv2.SOLVEPNP_IPPE,
        )  # fmt: skip
        if not ok:
            return None
        rotation = np.asarray(cv2.Rodrigues(np.asarray(turn, float))[0])
        middle = rotation @ (*(np.array(self.board.size_mm) / 2), 0.0) + np.asarray(place, float).ravel()
        away = rotation[:, 2]
        tilt = (-math.atan2(away[0], away[2]), math.atan2(away[1], away[2]))
        wide = self.board.size_mm[0] / max(float(middle[2]), 1e-6)
        x, y = sighting.points.mean(0) / (self.width, self.height)
        looks = np.array([x, y, wide, tilt[0] / (math.pi / 3), tilt[1] / (math.pi / 3)])
        return View(Corners(mm, sighting.points), looks, tilt, wide)

    def _cells_of(self, points: np.ndarray) -> np.ndarray:
        at = np.floor(points / (self.width, self.height) * (COLUMNS, ROWS)).astype(int)
        return np.clip(at, 0, (COLUMNS - 1, ROWS - 1))

    # --- What is covered ---------------------------------------------------------------------------

    @property
    def covered(self) -> float:
        """Share of the picture's cells with corners in them."""
        return float((self.cells > 0).mean())

    @property
    def tilts(self) -> dict[str, int]:
        """Views tilted each way."""
        across, up = (np.array([view.tilt[k] for view in self.views]) for k in range(2))
        counts = [(across < -TILTED_RAD).sum(), (across > TILTED_RAD).sum(), (up > TILTED_RAD).sum()]
        return dict(zip(TILTS, [*map(int, counts), int((up < -TILTED_RAD).sum())], strict=True))

    @property
    def distances(self) -> dict[str, int]:
        """Views from near by and from afar."""
        widths = np.array([view.width for view in self.views])
        return {"near": int((widths > NEAR).sum()), "far": int((widths < FAR).sum())}

    def bare_part(self) -> str:
        """Which ninth of the picture has fewest of its cells covered."""
        bare = np.array([
            [float((part > 0).mean()) for part in np.array_split(rows, 3, axis=1)]
            for rows in np.array_split(self.cells, 3, axis=0)
        ])  # fmt: skip
        row, column = np.unravel_index(int(bare.argmin()), bare.shape)
        return PARTS[row][column]

    def missing(self, cells: float = CELLS_WANTED) -> list[str]:
        """What would make the calibration surer, the most important first; nothing when it is enough."""
        out = []
        for way, count in self.tilts.items():
            if count < EACH_TILT:
                side, _, _ = way.partition(" ")
                out.append(f"tilt the board's {side} {'edge' if side in ('top', 'bottom') else 'side'} away")
        distances = self.distances
        if distances["near"] < EACH_DISTANCE:
            out.append("come nearer, until the board nearly fills the picture")
        if distances["far"] < EACH_DISTANCE:
            out.append("go further away, until the board takes half of the picture's width")
        if self.covered < cells:
            part = self.bare_part()
            at = "in the middle" if part == "middle" else f"at the {part}"
            out.append(f"bring the board's corners {at} of the picture, partly outside if need be")
        return out

    @property
    def done(self) -> bool:
        """No more views are wanted."""
        return len(self.views) >= MOST_VIEWS or (len(self.views) >= ENOUGH_VIEWS and not self.missing())

    def lines(self, advice: bool = True) -> list[str]:
        """Coverage for a terminal: the picture's cells, and beside them the rest."""
        shade = [
            "".join(2 * SHADES[min(len(SHADES) - 1, math.ceil(count / 4))] for count in row)
            for row in self.cells.tolist()
        ]
        ticks = {**self.tilts, **self.distances}
        beside = [
            f"views {len(self.views)} of {ENOUGH_VIEWS} or more, {100 * self.covered:.0f} % of the picture",
            "tilts    " + ", ".join(f"{name} {ticks[name]}" for name in TILTS),
            f"distance near {ticks['near']}, far {ticks['far']}",
        ]
        if advice:
            beside += ["", "next: " + (self.missing() or ["other views of the same kinds"])[0]]
        beside += [""] * (ROWS - len(beside))
        return [f"|{row}|  {text}".rstrip() for row, text in zip(shade, beside, strict=True)]


def draw(coverage: Coverage, residuals: tuple[np.ndarray, ...] = (), enlarged: float = 100.0) -> np.ndarray:
    """(H, W, 3) BGR: all corners that were seen, cells without any in red, residuals as strokes, enlarged."""
    scale = 960 / coverage.width
    size = (round(coverage.height * scale), 960)
    image = np.full((*size, 3), 255, np.uint8)
    for row in range(ROWS):
        for column in range(COLUMNS):
            x0, x1 = (round(size[1] * c / COLUMNS) for c in (column, column + 1))
            y0, y1 = (round(size[0] * r / ROWS) for r in (row, row + 1))
            colour = (232, 245, 232) if coverage.cells[row, column] else (205, 205, 250)
            cv2.rectangle(image, (x0, y0), (x1, y1), colour, -1)
            cv2.rectangle(image, (x0, y0), (x1, y1), (200, 200, 200), 1)
    for k, view in enumerate(coverage.views):
        hue = np.array([[[37 * k % 180, 190, 150]]], np.uint8)
        colour = tuple(int(c) for c in cv2.cvtColor(hue, cv2.COLOR_HSV2BGR)[0, 0])
        points = scale * (view.corners.points + 0.5)
        ends = points + scale * enlarged * residuals[k] if k < len(residuals) else points
        for (x, y), (to_x, to_y) in zip(points, ends, strict=True):
            at = (round(x), round(y))
            cv2.line(image, at, (round(to_x), round(to_y)), (60, 60, 60), 1, cv2.LINE_AA)
            cv2.circle(image, at, 3, colour, -1, cv2.LINE_AA)
    foot = np.full((44, 960, 3), 255, np.uint8)
    text = f"{len(coverage.views)} views, corners in {100 * coverage.covered:.0f} % of the cells (red: none)"
    if residuals:
        text += f"; strokes: {enlarged:g} times what the lens leaves"
    cv2.putText(foot, text, (12, 29), cv2.FONT_HERSHEY_SIMPLEX, 0.55, (40, 40, 40), 1, cv2.LINE_AA)
    return np.concatenate([image, foot])
