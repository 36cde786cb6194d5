"""Whose outline is it? An edge between two regions shows the depth of the nearer one only."""

from __future__ import annotations

import numpy as np

CLEARLY_BETTER = 0.12  # difference of mean truncated cost (0..1) that decides who explains something
SAME_DEPTH = 0.03  # relative; nearer than this two regions tie
SURROUND_RATIO = 3.5  # of whose outline the edge is so much more, that one is surrounded
MIN_REST_PX = 15.0  # of outline elsewhere, to judge a region by it


def edge_owners(
    pair: np.ndarray,
    cost: np.ndarray,
    rho: np.ndarray,
    length_px: np.ndarray,
    outline_px: np.ndarray,
    touches_border: np.ndarray,
) -> np.ndarray:
    """Which side may use each boundary between two regions.

    The side whose depth explains the boundary's motion owns it. Where both do, one of them may have its
    depth from this very boundary: the one whose depth does not fit the rest of its outline. Where that
    does not tell either, the nearer one owns the boundary, unless it surrounds the other, for what
    surrounds is behind. Where depths agree too, a region that surrounds the other (or is cut by the
    image border, when the other is not) may not use it; otherwise, as between two faces of a box, both may.

    Parameters
    ----------
    pair : (P, 2) indices of the regions on both sides
    cost : (P, 2) mean truncated cost of the boundary under the depth of either side, 0..1
    rho : (R,) inverse depths, 0 where unknown
    length_px : (P,) length of each boundary
    outline_px : (R,) length of each region's whole outline
    touches_border : (R,) bool

    Returns
    -------
    (P, 2) bool, may this side use the boundary
    """
    n = len(rho)
    mine = np.ones(pair.shape, bool)
    known = rho[pair] > 0
    sunk, length = np.zeros(n), np.zeros(n)
    for side in (0, 1):
        sunk += np.bincount(pair[:, side], length_px * cost[:, side], n)
        length += np.bincount(pair[:, side], length_px, n)
    rest_px = length[pair] - length_px[:, None]
    rest = (sunk[pair] - length_px[:, None] * cost) / np.maximum(rest_px, 1e-9)
    judged = (rest_px > MIN_REST_PX).all(axis=1)
    share = length_px[:, None] / np.maximum(outline_px[pair], 1.0)
    border = touches_border[pair]
    for side, other in ((0, 1), (1, 0)):
        worse = cost[:, side] - cost[:, other]
        undecided = np.abs(worse) <= CLEARLY_BETTER
        misfit = np.where(judged, rest[:, side] - rest[:, other], 0.0)
        relative = rho[pair[:, side]] / np.maximum(rho[pair[:, other]], 1e-12)
        farther, tie = relative < 1 - SAME_DEPTH, np.abs(relative - 1) <= SAME_DEPTH
        around = share[:, other] > SURROUND_RATIO * share[:, side]
        inside = share[:, side] > SURROUND_RATIO * share[:, other]
        behind = around | (border[:, side] & ~border[:, other])
        by_place = (farther & ~inside) | (tie & behind)
        by_fit = misfit > CLEARLY_BETTER
        lost = (worse > CLEARLY_BETTER) | (undecided & (by_fit | (by_place & (misfit >= -CLEARLY_BETTER))))
        mine[:, side] = ~(lost & known[:, other])
    return mine
