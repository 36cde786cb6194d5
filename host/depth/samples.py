"""The present outline as the earlier frames would see it, were it infinitely far away.

Every sample lies between two regions and may show the depth of either, so it is listed twice, once for
each side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from host.camera.lens import Lens
from host.depth.keyframes import Outline, direction_of, rows_of


@dataclass(frozen=True)
class Samples:
    """One row for each side of each used sample. K earlier frames."""

    region: np.ndarray  # (N,) row of the region it is seen for
    pair: np.ndarray  # (N,) boundary it belongs to
    side: np.ndarray  # (N,) 0 when that region is on the left, 1 on the right
    length_px: np.ndarray  # (N,) outline the row stands for
    offset: np.ndarray  # (2, N) px from the region's middle
    base: np.ndarray  # (3, K, N) float32, R_k p: its ray in the axes of the earlier frames
    normal: np.ndarray  # (2, K, N) float32, its normal, turned with the camera
    direction: np.ndarray  # (K, N) of that normal, as the keyframes file it
    pairs: np.ndarray  # (P, 2) rows of the regions left and right of every boundary


def samples_of(
    outline: Outline, ids: np.ndarray, middle: np.ndarray, turns: np.ndarray, lens: Lens, limit: int
) -> Samples:
    """Pick samples from the outline, at most `limit` of each boundary, and turn them.

    Parameters
    ----------
    ids : (R,) of the present regions
    middle : (R, 2) their middles, px
    turns : (K, 3, 3) rotations from the present camera to the earlier ones
    """
    focal, centre = np.array([lens.fx, lens.fy]), np.array([lens.cx, lens.cy])
    left, right = rows_of(outline.left, ids), rows_of(outline.right, ids)
    known = np.nonzero((left >= 0) & (right >= 0))[0]
    keys, pair = np.unique(left[known] * len(ids) + right[known], return_inverse=True)
    pairs = np.column_stack([keys // len(ids), keys % len(ids)])
    # every stride-th sample of each boundary, in the order of the contour
    count = np.bincount(pair, minlength=len(keys))
    stride = np.maximum(-(-count // limit), 1)
    chosen = rank_within(pair, count) % stride[pair] == 0
    point, pair = known[chosen], pair[chosen]
    xy, normal = outline.xy_px[point], outline.normal[point]
    rays = np.column_stack([(xy - centre) / focal, np.ones(len(xy))])
    along = np.column_stack([-normal[:, 1], normal[:, 0]]) / focal
    base = np.einsum("kij,nj->ikn", turns, rays)
    swing = np.einsum("kij,nj->ikn", turns[:, :, :2], along)
    tangent = (swing[:2] - base[:2] / base[2] * swing[2]) * focal[:, None, None]
    tangent /= np.maximum(np.hypot(tangent[0], tangent[1]), 1e-12)
    turned = np.stack([tangent[1], -tangent[0]])
    region = np.concatenate([pairs[pair, 0], pairs[pair, 1]])
    return Samples(
        region,
        np.tile(pair, 2),
        np.repeat([0, 1], len(point)),
        np.tile(outline.length_px[point] * stride[pair], 2),
        np.tile(xy.T, 2) - middle[region].T,
        np.tile(base.astype(np.float32), 2),
        np.tile(turned.astype(np.float32), 2),
        np.tile(direction_of(turned[0], turned[1]), 2),
        pairs,
    )


def rank_within(group: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Position of each element among those of its group, in order of appearance."""
    order = np.argsort(group, kind="stable")
    rank = np.empty(len(group), np.int64)
    rank[order] = np.arange(len(group)) - np.repeat(np.cumsum(count) - count, count)
    return rank
