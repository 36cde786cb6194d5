"""A second opinion on the net: areas, means and force counts, from the method's description, in plain NumPy.

Everything works on a net's arrays, in coordinates in which the image is [0, W] x [0, H] and pixel k covers
[k, k + 1). Nothing here knows of crossing lists, prefix sums or the order of the engine's arithmetic; where a
comparison hangs on rounding, the answer is a range.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

OUTSIDE = -1
ROUNDING_PX = 1e-6  # coordinates nearer than this may fall either way
ROUNDING_COLOUR = 1e-3  # the same for colours; the engine holds them as 32-bit floats
QUARTERS = 4  # of a CIELAB unit; colours are whole numbers of them
DEEPEST_RUN_PX = 24  # along a line, whatever the reach


def areas_of_faces(xy: np.ndarray, edges: np.ndarray, faces: int) -> np.ndarray:
    """Area of each face: what its edges sweep from the left border of the image. (F,) px."""
    p, q = xy[edges[:, 0]], xy[edges[:, 1]]
    swept = 0.5 * (p[:, 0] + q[:, 0]) * (q[:, 1] - p[:, 1])
    area = np.zeros(faces + 1)  # the last entry collects the outside
    np.add.at(area, edges[:, 2], -swept)
    np.add.at(area, edges[:, 3], swept)
    return area[:-1]


def owners_of_pixels(
    xy: np.ndarray, edges: np.ndarray, height: int, width: int
) -> tuple[np.ndarray, np.ndarray]:
    """The face that each pixel's centre lies in, by counting for every face the edges to the left of it.

    Returns
    -------
    owners
        (H, W) face, -1 where there is none or more than one.
    doubtful
        (H, W) centres that lie on an edge but for rounding.
    """
    faces = edges[:, 2:].max() + 1
    crossings = np.zeros((faces, height, width), np.uint8)
    doubtful = np.zeros((height, width), bool)
    centres_x, centres_y = np.arange(width) + 0.5, np.arange(height) + 0.5
    for a, b, left, right in edges.tolist():
        (ax, ay), (bx, by) = xy[a], xy[b]
        rows = np.flatnonzero((ay > centres_y) != (by > centres_y))
        at = ax + (centres_y[rows] - ay) * (bx - ax) / (by - ay) if len(rows) else np.zeros(0)
        beyond = at[:, None] <= centres_x
        doubtful[rows] |= np.abs(at[:, None] - centres_x) < ROUNDING_PX
        for face in (left, right):
            if face != OUTSIDE:
                crossings[face, rows] += beyond
    inside = crossings % 2 == 1
    return np.where(inside.sum(0) == 1, inside.argmax(0), OUTSIDE), doubtful


def means_of_faces(owners: np.ndarray, colours: np.ndarray, faces: int) -> np.ndarray:
    """Mean colour of each face's pixels. (F, 3), nan for a face without pixels."""
    sums = np.zeros((faces, 3))
    np.add.at(sums, owners.ravel(), colours.reshape(-1, 3))
    with np.errstate(invalid="ignore"):
        return sums / np.bincount(owners.ravel(), minlength=faces)[:, None]


@dataclass(frozen=True)
class Counts:
    """Pixels claimed across each edge, (E, 2, 2): on its left and right, in the halves of ends a and b."""

    least: np.ndarray
    most: np.ndarray

    def allow(self, counted: np.ndarray) -> np.ndarray:
        """Which edges (E,) were counted within the range."""
        return ((self.least <= counted) & (counted <= self.most)).all((1, 2))


def paper_counts(
    xy: np.ndarray, edges: np.ndarray, colours: np.ndarray, means: np.ndarray, eta: float, reach_px: float
) -> Counts:
    """The three conditions of section 2.2 for every pixel in an edge's four rectangles (Fig. 3)."""
    height, width = colours.shape[:2]
    owners, doubtful = owners_of_pixels(xy, edges, height, width)
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    least, most = np.zeros((len(edges), 2, 2)), np.zeros((len(edges), 2, 2))
    for k, (a, b, left, right) in enumerate(edges.tolist()):
        if OUTSIDE in (left, right):
            continue
        (ax, ay), (bx, by) = xy[a], xy[b]
        size = np.hypot(bx - ax, by - ay)
        along = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / size
        # Walking from a to b with y downwards, the left hand points to (dy, -dx).
        above = ((x - ax) * (by - ay) - (y - ay) * (bx - ax)) / size
        for side, (own, other, height_over) in enumerate(((left, right, above), (right, left, -above))):
            far_from_own = np.linalg.norm(colours - means[own], axis=2) - eta
            far_from_other = np.linalg.norm(colours - means[other], axis=2) - eta
            for half, along_half in enumerate((along, size - along)):
                # How deep a pixel lies inside the rectangle; negative is outside.
                depth = np.minimum.reduce(
                    [height_over, reach_px - height_over, along_half, size / 2 - along_half]
                )
                owned = np.where(doubtful, 0.0, np.where(owners == own, np.inf, -np.inf))
                place = np.minimum(depth, owned)
                colour = np.minimum(far_from_own, -far_from_other)
                least[k, side, half] = ((place > ROUNDING_PX) & (colour > ROUNDING_COLOUR)).sum()
                most[k, side, half] = ((place >= -ROUNDING_PX) & (colour >= -ROUNDING_COLOUR)).sum()
    return Counts(least, most)


def our_counts(
    xy: np.ndarray, edges: np.ndarray, colours: np.ndarray, means: np.ndarray, eta: float, reach_px: float
) -> Counts:
    """The unbroken run of pixels from an edge that are nearer to the other face's mean.

    A steep edge is looked at row by row, a flat one column by column: one pixel of the line it crosses is one
    pixel of its sensitivity region. A run ends at the reach, at the next edge along the line, and at the
    first pixel not claimed. A pixel is claimed by the face of the nearer mean, unless it is too far from that
    for eta and for the distance of the two means: then it is of a third colour. Means are taken to the
    quarter of a CIELAB unit in which pixels are counted, so that no comparison hangs on rounding.
    """
    means = np.floor(QUARTERS * means + 0.5) / QUARTERS
    least, most = np.zeros((len(edges), 2, 2)), np.zeros((len(edges), 2, 2))
    for by_rows in (True, False):
        # Columns are rows of the image with x and y exchanged, which makes a left hand of every right one.
        points = xy if by_rows else xy[:, ::-1]
        lines = colours if by_rows else colours.transpose(1, 0, 2)
        for line, pixels in enumerate(lines):
            level = line + 0.5
            met, at = _crossings_of_line(points, edges, level)
            for place in range(1, len(met) - 1):
                k = met[place]
                left, right = edges[k, 2:]
                a, b = points[edges[k, :2]]
                span, rise = b - a
                steep = abs(rise) >= abs(span) if by_rows else abs(rise) > abs(span)
                if not steep or OUTSIDE in (left, right):
                    continue
                depth = min(DEEPEST_RUN_PX, int(np.ceil(reach_px * np.hypot(span, rise) / abs(rise))))
                before, start, after = (int(np.ceil(x - 0.5)) for x in at[place - 1 : place + 2])
                backwards = pixels[max(before, start - depth) : start][::-1]
                forwards = pixels[start : min(after, start + depth)]
                # With y downwards, the left face of an edge comes first along a row where the edge runs up.
                left_first = (rise < 0) == by_rows
                on_left, on_right = (backwards, forwards) if left_first else (forwards, backwards)
                runs = (
                    _run_length(on_left, means[left], means[right], eta),
                    _run_length(on_right, means[right], means[left], eta),
                )
                # A pixel's centre on one of the three edges, or the line on the middle of this one.
                offsets = at[place - 1 : place + 2] - 0.5
                slack = 1 if np.abs(offsets - np.rint(offsets)).min() < ROUNDING_PX else 0
                from_middle = (level - (a[1] + b[1]) / 2) * np.sign(rise)
                for half, inside in enumerate((-from_middle, from_middle)):
                    for side, run in enumerate(runs):
                        least[k, side, half] += max(0, run - slack) if inside > ROUNDING_PX else 0
                        most[k, side, half] += run + slack if inside >= -ROUNDING_PX else 0
    return Counts(least, most)


def _crossings_of_line(points: np.ndarray, edges: np.ndarray, level: float) -> tuple[np.ndarray, np.ndarray]:
    """Edges that cross the line at this height, and where, in order."""
    p, q = points[edges[:, 0]], points[edges[:, 1]]
    met = np.flatnonzero((p[:, 1] > level) != (q[:, 1] > level))
    at = p[met, 0] + (level - p[met, 1]) * (q[met, 0] - p[met, 0]) / (q[met, 1] - p[met, 1])
    order = np.argsort(at, kind="stable")
    return met[order], at[order]


def _run_length(pixels: np.ndarray, own: np.ndarray, other: np.ndarray, eta: float) -> int:
    """Pixels from the first on that belong to the other mean."""
    to_own = ((pixels - own) ** 2).sum(1)
    to_other = ((pixels - other) ** 2).sum(1)
    too_far = max(eta**2, 0.3 * ((own - other) ** 2).sum())
    claimed = (to_other < to_own) & (to_other <= too_far)
    return len(claimed) if claimed.all() else int(np.argmin(claimed))
