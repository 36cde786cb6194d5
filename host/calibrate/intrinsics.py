"""A lens from views of a flat board: least squares over lens and places at once, with what stays uncertain.

OpenCV gives the start. The rest is done here: single bad corners are weighed down, the covariance is that of
the solution, and both are the same with every version of OpenCV.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from host.camera.lens import Lens
from host.errors import InputError

NAMES = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
ALL = np.ones(len(NAMES), bool)
WITHOUT_K3 = ALL & (np.arange(len(NAMES)) != 8)
PLACING = np.arange(len(NAMES)) < 4  # focal lengths and centre alone
ROUNDS = 30
HEAVY = 6.0  # degrees of freedom of the corners' errors
FOLDS = 4  # each left out in turn, to see how well the rest foretells it
K3_GAIN = (
    12.0  # by which the errors' squares, over their variance, must fall for a sixth power to be believed
)


@dataclass(frozen=True)
class Corners:
    """One view: where which points of the board are."""

    board_mm: np.ndarray  # (N, 3)
    points: np.ndarray  # (N, 2) px


@dataclass(frozen=True)
class Solution:
    """The lens that fits best, and how well it is known."""

    lens: Lens
    sigmas: np.ndarray  # (9,) standard errors of fx, fy, cx, cy, k1, k2, p1, p2, k3
    rms_px: float  # of the corners' distances
    held_out_px: float  # the same of views that the lens was found without; nan where not asked for
    view_rms_px: tuple[float, ...]
    places: tuple[np.ndarray, ...]  # (6,) each: rotation vector and place in mm
    residuals: tuple[np.ndarray, ...]  # (N, 2) each: seen less foretold


def solve(views: Sequence[Corners], width: int, height: int) -> Solution:
    """Lens and all places, from nothing.

    Raises
    ------
    InputError
        The views do not determine a lens.
    """
    boards = [v.board_mm.astype(np.float32).reshape(-1, 1, 3) for v in views]
    points = [v.points.astype(np.float32).reshape(-1, 1, 2) for v in views]
    try:
        _, matrix, bends, turns, places = cv2.calibrateCamera(
            boards, points, (width, height), np.eye(3), np.zeros(5), flags=cv2.CALIB_FIX_K3
        )
    except cv2.error:
        raise _alike() from None
    matrix, bends = np.asarray(matrix), np.asarray(bends, float).ravel()
    values = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *bends[:4], 0.0])
    starts = [
        np.r_[np.asarray(r, float).ravel(), np.asarray(t, float).ravel()]
        for r, t in zip(turns, places, strict=True)
    ]
    simple = _refine(views, values, starts, WITHOUT_K3, width, height)
    full = _refine(views, _values(simple.lens), list(simple.places), ALL, width, height)
    noise = simple.rms_px**2 / 2
    gain = sum(
        float((a**2).sum() - (b**2).sum()) for a, b in zip(simple.residuals, full.residuals, strict=True)
    )
    free, best = (ALL, full) if gain / noise > K3_GAIN else (WITHOUT_K3, simple)
    return replace(best, held_out_px=_held_out(views, best, free, width, height))


def _held_out(views: Sequence[Corners], best: Solution, free: np.ndarray, width: int, height: int) -> float:
    """How far corners of views lie from where a lens found without them puts these."""
    if len(views) < 2 * FOLDS:
        return math.nan
    squares, count = 0.0, 0
    for fold in range(FOLDS):
        kept = [k for k in range(len(views)) if k % FOLDS != fold]
        one = _refine(
            [views[k] for k in kept],
            _values(best.lens), [best.places[k] for k in kept], free, width, height, rounds=6,
        )  # fmt: skip
        for k in range(fold, len(views), FOLDS):
            left = place_of(views[k], one.lens, best.places[k]).residuals[0]
            squares, count = squares + float((left**2).sum()), count + len(left)
    return math.sqrt(squares / count)


def place_of(view: Corners, lens: Lens, start: np.ndarray | None = None) -> Solution:
    """Where the board is, by a lens that is known."""
    if start is None:
        start = _first_place(view, lens)
    return _refine([view], _values(lens), [start], np.zeros(len(NAMES), bool), lens.width, lens.height)


def _first_place(view: Corners, lens: Lens) -> np.ndarray:
    rays = lens.to_rays(view.points)
    ok, turn, place = cv2.solvePnP(
        view.board_mm.reshape(-1, 1, 3), rays.reshape(-1, 1, 2), np.eye(3), np.zeros(5),
        flags=cv2.SOLVEPNP_IPPE,
    )  # fmt: skip
    if not ok:
        raise _alike()
    return np.r_[np.asarray(turn, float).ravel(), np.asarray(place, float).ravel()]


def adjust(views: Sequence[Corners], lens: Lens) -> Solution:
    """The lens with the focal lengths and the centre that fit these views best; its bending is kept."""
    starts = [_first_place(view, lens) for view in views]
    return _refine(views, _values(lens), starts, PLACING, lens.width, lens.height)


def _values(lens: Lens) -> np.ndarray:
    return np.array([lens.fx, lens.fy, lens.cx, lens.cy, *lens.distortion])


def _lens(values: np.ndarray, width: int, height: int) -> Lens:
    fx, fy, cx, cy, *bends = values.tolist()
    return Lens(width, height, fx, fy, cx, cy, tuple(bends))


def _refine(
    views: Sequence[Corners],
    values: np.ndarray,
    places: list[np.ndarray],
    free: np.ndarray,
    width: int,
    height: int,
    rounds: int = ROUNDS,
) -> Solution:
    """Gauss and Newton's way downhill; each view's place is eliminated by itself."""
    values, places = values.copy(), [p.copy() for p in places]
    count = int(free.sum())
    noise = None
    covariance = np.zeros((count, count))
    for _ in range(rounds):
        parts = [_errors(view, values, place) for view, place in zip(views, places, strict=True)]
        sizes = np.concatenate([np.abs(off).ravel() for off, _, _ in parts])
        noise = max(1.4826 * float(np.median(sizes)), 1e-4)
        square, right = np.zeros((count, count)), np.zeros(count)
        eliminated = []
        for off, by_place, by_lens in parts:
            weight = ((HEAVY + 1) / (HEAVY + (off / noise) ** 2).ravel())[:, None]
            a, b, r = by_lens[:, free], by_place, off.ravel()
            bb, ba = b.T @ (weight * b), b.T @ (weight * a)
            br = b.T @ (weight[:, 0] * r)
            back = np.linalg.solve(bb + 1e-12 * np.trace(bb) * np.eye(6), np.column_stack([ba, br]))
            square += a.T @ (weight * a) - ba.T @ back[:, :-1]
            right += a.T @ (weight[:, 0] * r) - ba.T @ back[:, -1]
            eliminated.append(back)
        try:
            scale = np.sqrt(np.maximum(np.diag(square), 1e-30))
            if count and np.linalg.cond(square / np.outer(scale, scale)) > 1e10:
                raise np.linalg.LinAlgError
            covariance = np.linalg.inv(square) * noise**2 if count else covariance
            step = np.linalg.solve(square, right) if count else right
        except np.linalg.LinAlgError:
            raise _alike() from None
        values[free] += step
        for place, back in zip(places, eliminated, strict=True):
            place += back[:, -1] - back[:, :-1] @ step
        if not np.isfinite(values).all() or values[:2].min() < width / 50:
            raise _alike()
        if not count or np.abs(step / np.maximum(np.sqrt(np.diag(covariance)), 1e-12)).max() < 1e-3:
            moved = max(float(np.abs(back[:, -1]).max()) for back in eliminated)
            if count or moved < 1e-7:
                break
    residuals = tuple(_errors(view, values, place)[0] for view, place in zip(views, places, strict=True))
    squares = [float((off**2).sum()) for off in residuals]
    corners = [len(off) for off in residuals]
    sigmas = np.zeros(len(NAMES))
    sigmas[free] = np.sqrt(np.diag(covariance))
    return Solution(
        _lens(values, width, height), sigmas, math.sqrt(sum(squares) / sum(corners)), math.nan,
        tuple(math.sqrt(s / n) for s, n in zip(squares, corners, strict=True)), tuple(places), residuals,
    )  # fmt: skip


def _errors(
    view: Corners, values: np.ndarray, place: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(seen less foretold (N, 2), its slopes by the place (2 N, 6) and by the lens (2 N, 9))."""
    matrix = np.array([[values[0], 0, values[2]], [0, values[1], values[3]], [0, 0, 1.0]])
    told, slopes = cv2.projectPoints(
        view.board_mm.reshape(-1, 1, 3), place[:3].copy(), place[3:].copy(), matrix, values[4:].copy()
    )
    slopes = np.asarray(slopes)
    return view.points - np.asarray(told).reshape(-1, 2), slopes[:, :6], slopes[:, 6:15]


def _alike() -> InputError:
    return InputError(
        "these views do not determine a lens: they are too alike; tilt the board towards each side in turn"
    )
