"""The paper's own formulas (Eq. 7-18), and two frames solved together with the camera's unknown turn.

Everything here takes image points in pixels from the principal point, x right and y down, and gives depths
along the optical axis of the *first* of the two frames; the camera moves `travel_cm` along it between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

ITERATIONS = 4  # the weights of areas and relief depend a little on the depths


# --- As published ----------------------------------------------------------------------------------


def vertex_depth_cm(y_first_px: ArrayLike, y_last_px: ArrayLike, travel_cm: float) -> np.ndarray:
    """Depth of vertices by Eq. 10, from y alone; nan where y does not move away from the axis."""
    y_first, y_last = np.asarray(y_first_px, float), np.asarray(y_last_px, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = travel_cm * y_last / (y_last - y_first)
    return np.where(np.isfinite(depth) & (depth > 0), depth, np.nan)


def place_cm(xy_px: ArrayLike, depth_cm: ArrayLike, focal_px: float) -> np.ndarray:
    """(N, 3) X, Y, Z in cm of points (N, 2) at depths (N,) of the same frame (Eq. 7, 8, 11, 12)."""
    depth = np.asarray(depth_cm, float)
    return np.column_stack([np.asarray(xy_px, float) * (depth / focal_px)[:, None], depth])


def vertex_sensitivity(y_last_px: ArrayLike, depth_cm: ArrayLike) -> np.ndarray:
    """Change of y with travel by Eq. 13, px/cm."""
    return np.abs(np.asarray(y_last_px, float)) / np.asarray(depth_cm, float)


def area_depth_cm(area_first_px2: ArrayLike, area_last_px2: ArrayLike, travel_cm: float) -> np.ndarray:
    """Mean depth of regions by Eq. 16; nan where the area does not grow."""
    with np.errstate(divide="ignore", invalid="ignore"):
        shrink = np.sqrt(np.asarray(area_first_px2, float) / np.asarray(area_last_px2, float))
        return np.where(shrink < 1, travel_cm / (1 - shrink), np.nan)


def area_growth_px2(area_last_px2: ArrayLike, depth_cm: ArrayLike, travel_cm: float) -> np.ndarray:
    """By how much an area grows over the travel (Eq. 17), px^2."""
    step = travel_cm / np.asarray(depth_cm, float)
    return np.asarray(area_last_px2, float) * (2 * step - step**2)


def area_sensitivity(area_last_px2: ArrayLike, depth_cm: ArrayLike) -> np.ndarray:
    """Change of the area with travel by Eq. 18, px^2/cm."""
    return 2 * np.asarray(area_last_px2, float) / np.asarray(depth_cm, float)


# --- With the camera's turn unknown ----------------------------------------------------------------


@dataclass(frozen=True)
class TwoViews:
    """What two frames show of some faces and their corners; nan where a number is not known."""

    first_px: np.ndarray  # (N, 2) corners in the first frame
    last_px: np.ndarray  # (N, 2) the same corners in the last one
    face: np.ndarray  # (N,) int, 0 to M - 1: the face each corner belongs to
    area_first_px2: np.ndarray  # (M,)
    area_last_px2: np.ndarray  # (M,)


@dataclass(frozen=True)
class TwoViewSolution:
    """Depths at the first frame, and how the camera turned between the two."""

    shift_px: np.ndarray  # (2,) by which the turn alone moved the middle of the image: right, down
    shift_sigma_px: np.ndarray  # (2,)
    face_depth_cm: np.ndarray  # (M,)
    face_sigma_cm: np.ndarray  # (M,)
    corner_depth_cm: np.ndarray  # (N,)
    corner_sigma_cm: np.ndarray  # (N,)


def solve_two_views(
    views: TwoViews,
    focal_px: float,
    travel_cm: float,
    corner_sigma_px: float = 0.5,
    turn_sigma_rad: float = 0.02,
    relief_share: float = 0.15,
) -> TwoViewSolution:
    """Depths of faces and corners, and the common shift of the image, by one least-squares fit.

    With the growth g = Z / (Z - travel) Eq. 10 reads ``last = g * first``, and Eq. 16
    ``sqrt(A_last / A_first) = g``. A small turn of the camera adds, at (x, y) of the last frame,
    ``(f + x^2/f, x y/f)`` times its yaw and ``(x y/f, f + y^2/f)`` times its pitch, and scales areas by three
    times the turn's part along (x, y). All of this is linear in the unknowns: two angles, one growth a face,
    and one more a corner, by which the corner lies before or behind its face.

    Parameters
    ----------
    views
        At least one corner or area a face. Areas count as measured independently of the corners; where they
        are those of the polygons through them, the sigmas are too small by about a fifth.
    focal_px
        Focal length.
    travel_cm
        Between the frames, along the axis.
    corner_sigma_px
        Standard error of a corner in either coordinate of either frame; that of the areas follows from it.
        Half a pixel is what a polygon has that was not refined.
    turn_sigma_rad
        How far the camera may have turned by either angle, as a standard deviation.
    relief_share
        How far corners lie before or behind their face, as a standard deviation relative to its size: the
        default fits things whose corners lie anywhere within a quarter of their size.

    Raises
    ------
    ValueError
        where a face has neither a corner with a known coordinate nor an area.
    """
    corners, faces = len(views.face), len(views.area_first_px2)
    unknowns = 2 + faces + corners
    known = np.isfinite(views.first_px) & np.isfinite(views.last_px)
    has_area = np.isfinite(views.area_first_px2) & np.isfinite(views.area_last_px2)
    bare = ~has_area & (np.bincount(views.face[known.any(1)], minlength=faces) == 0)
    if bare.any():
        raise ValueError(f"faces {np.flatnonzero(bare).tolist()} have neither a corner nor an area")
    size_px = _sizes_px(views)
    centre = np.array([_middle(views.last_px[views.face == m]) for m in range(faces)]).reshape(-1, 2)
    turn = _turn_columns(views.last_px, focal_px)
    growth = _first_growth(views, known, has_area)
    state, covariance = np.zeros(unknowns), np.zeros((unknowns, unknowns))
    for _ in range(ITERATIONS):
        rows, right, sigma = [], [], []
        for n, axis in zip(*np.nonzero(known), strict=True):
            row = np.zeros(unknowns)
            row[:2] = turn[n, axis]
            row[[2 + views.face[n], 2 + faces + n]] = views.first_px[n, axis]
            rows.append(row)
            right.append(views.last_px[n, axis])
            sigma.append(corner_sigma_px * np.hypot(1, growth[views.face[n]]))
        for m in np.flatnonzero(has_area):
            row = np.zeros(unknowns)
            row[:2] = 1.5 * growth[m] * centre[m] / focal_px
            row[2 + m] = 1.0
            rows.append(row)
            right.append(np.sqrt(views.area_last_px2[m] / views.area_first_px2[m]))
            # the four sides of a square of uncertain corners, in both frames
            sigma.append(growth[m] * corner_sigma_px / np.sqrt(views.area_first_px2[m]))
        for k in range(2):
            rows.append(np.eye(unknowns)[k])
            right.append(0.0)
            sigma.append(turn_sigma_rad)
        for n in range(corners):
            g = growth[views.face[n]]
            rows.append(np.eye(unknowns)[2 + faces + n])
            right.append(0.0)
            # d g / d Z = -g (g - 1) / Z, and the face's size is size_px * Z / f
            sigma.append(relief_share * size_px[views.face[n]] / focal_px * g * (g - 1))
        weight = 1 / np.array(sigma)
        matrix, vector = np.array(rows) * weight[:, None], np.array(right) * weight
        covariance = np.linalg.inv(matrix.T @ matrix)
        state = covariance @ (matrix.T @ vector)
        off = vector - matrix @ state
        covariance *= max(1.0, float(off @ off) / max(1, len(vector) - unknowns))
        growth = np.maximum(state[2 : 2 + faces], 1 + 1e-6)
    of_corner = np.zeros((corners, unknowns))
    of_corner[np.arange(corners), 2 + views.face] = 1.0
    of_corner[np.arange(corners), 2 + faces + np.arange(corners)] = 1.0
    face_variance = np.diag(covariance)[2 : 2 + faces]
    corner_variance = np.einsum("nu,uv,nv->n", of_corner, covariance, of_corner)
    face_depth, face_sigma = _depth_of_growth(state[2 : 2 + faces], face_variance, travel_cm)
    corner_depth, corner_sigma = _depth_of_growth(of_corner @ state, corner_variance, travel_cm)
    return TwoViewSolution(
        focal_px * state[:2],
        focal_px * np.sqrt(np.diag(covariance)[:2]),
        face_depth,
        face_sigma,
        corner_depth,
        corner_sigma,
    )


def _turn_columns(xy_px: np.ndarray, focal_px: float) -> np.ndarray:
    """(N, 2, 2): d(coordinate)/d(angle); a coordinate that is not known moves nothing."""
    x, y = np.nan_to_num(xy_px).T
    both = x * y / focal_px
    return np.stack(
        [np.stack([focal_px + x**2 / focal_px, both], 1), np.stack([both, focal_px + y**2 / focal_px], 1)], 1
    )


def _sizes_px(views: TwoViews) -> np.ndarray:
    """(M,) size of every face in the first frame."""
    sizes = np.sqrt(views.area_first_px2)
    for m in np.flatnonzero(~np.isfinite(sizes)):
        of_face = np.nan_to_num(views.first_px[views.face == m])
        sizes[m] = max(1.0, float(np.ptp(of_face, axis=0).max()))
    return sizes


def _middle(xy_px: np.ndarray) -> np.ndarray:
    """Mean (2,) of the coordinates that are known, zero where none is."""
    known = np.isfinite(xy_px)
    return np.where(known, xy_px, 0.0).sum(0) / np.maximum(known.sum(0), 1)


def _first_growth(views: TwoViews, known: np.ndarray, has_area: np.ndarray) -> np.ndarray:
    """(M,) growth of every face by its area, or else by the spread of its corners."""
    growth = np.full(len(has_area), 1.1)
    growth[has_area] = np.sqrt(views.area_last_px2[has_area] / views.area_first_px2[has_area])
    for m in np.flatnonzero(~has_area):
        own = known & (views.face == m)[:, None]
        spread = [
            (np.ptp(views.first_px[own[:, axis], axis]), np.ptp(views.last_px[own[:, axis], axis]))
            for axis in (0, 1)
            if own[:, axis].sum() > 1
        ]
        before, after = np.sum(spread, axis=0) if spread else (0.0, 0.0)
        if before > 0:
            growth[m] = after / before
    return np.maximum(growth, 1 + 1e-3)


def _depth_of_growth(
    growth: np.ndarray, variance: np.ndarray, travel_cm: float
) -> tuple[np.ndarray, np.ndarray]:
    """Depths and their standard errors; nan where nothing grows."""
    excess = np.where(growth > 1, growth - 1, np.nan)
    return travel_cm * growth / excess, travel_cm * np.sqrt(variance) / excess**2
