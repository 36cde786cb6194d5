"""Whose outline is it? An edge between two regions shows the depth of the nearer one only."""

from __future__ import annotations

import numpy as np

CLEARLY_BETTER = 0.12  # difference of mean truncated cost (0..1) that decides who explains an edge
SAME_DEPTH = 0.03  # relative; nearer than this two regions tie
SURROUND_RATIO = 2.5  # in a tie, the one of whose outline the edge is so much more owns it


def edge_owners(
    pair: np.ndarray,
    cost: np.ndarray,
    rho: np.ndarray,
    length_px: np.ndarray,
    outline_px: np.ndarray,
    touches_border: np.ndarray,
) -> np.ndarray:
    """Which side may use each boundary between two regions.

    The side whose depth explains the boundary's motion owns it. Where both explain it and their depths
    differ, the nearer one does. Where the depths agree too, a region that surrounds the other (or is cut
    by the image border, when the other is not) got its depth from the other's outline and may not use it;
    otherwise, as between two faces of a box, both may.

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
    mine = np.ones(pair.shape, bool)
    known = rho[pair] > 0
    better = cost[:, 0] - cost[:, 1]  # positive: the second side explains it better
    ratio = np.where(known.all(axis=1), rho[pair[:, 0]] / np.maximum(rho[pair[:, 1]], 1e-12), 1.0)
    share = length_px[:, None] / np.maximum(outline_px[pair], 1.0)
    border = touches_border[pair]
    for side in (0, 1):
        other = 1 - side
        sign = 1.0 if side == 0 else -1.0
        explained_by_other = sign * better > CLEARLY_BETTER
        undecided = np.abs(better) <= CLEARLY_BETTER
        relative = ratio if side == 0 else 1 / np.maximum(ratio, 1e-12)
        farther = relative < 1 - SAME_DEPTH
        tie = np.abs(relative - 1) <= SAME_DEPTH
        around = share[:, other] > SURROUND_RATIO * share[:, side]
        inside = share[:, side] > SURROUND_RATIO * share[:, other]
        behind = around | (border[:, side] & ~border[:, other])
        lost = explained_by_other | (undecided & ((farther & ~inside) | (tie & behind)))
        mine[:, side] = ~(lost & known[:, other])
    return mine
