"""From the depth of a silhouette to the mean depth of the visible surface.

An outline that occludes lies behind the surface it bounds: on a sphere at the circle of tangency, on an
upright cylinder at its sides. With w = sqrt(A) Z / f, the region's width in cm,

    Z_surface = Z_outline - k * w

A sphere of radius r shows a disc of area pi r^2 whose mean depth is (2/3) r before its rim: k = 0.38. An
upright cylinder's mean is (pi/4) r before its sides: k = 0.35 at twice as high as wide, but its lower
rim, nearer than the sides, pulls the outline forward. A frontal plane has k = 0, a box seen over a
corner 0.15 to 0.3. The outline's shape tells a round thing from a rectangular one; what it cannot tell (a
frontal face from a cylinder) goes into sigma.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np


@dataclass(frozen=True)
class Relief:
    """How far the visible surface stands before its outline, in widths of the region."""

    k: float
    sigma_k: float


# area over smallest rectangle around it, and the relief that goes with it; pi/4 = 0.785 is an ellipse
SHAPES = (
    (0.80, Relief(0.30, 0.09)),
    (0.86, Relief(0.28, 0.11)),
    (0.93, Relief(0.12, 0.11)),
    (0.98, Relief(0.02, 0.07)),
)
HOLLOW = Relief(0.0, 0.2)
UNKNOWN = Relief(0.15, 0.25)
FLAT = Relief(0.0, 0.03)
MIN_SOLIDITY = 0.87
MIN_BEND_PX = 1.5  # a side may leave its chord by this
BEND_SHARE = 0.015  # or by so much of the outline's length
FACE_AREA_SHARE = 0.04  # by which the straight sides may miss the area


def may_be_one_face(loop_px: np.ndarray) -> bool:
    """Whether an outline has three or four straight sides, as the face of a box or a board has.

    Round things and boxes seen over a corner have outlines that slant too, but not as one plane.

    Parameters
    ----------
    loop_px : (N, 2) the outer loop
    """
    points = loop_px.astype(np.float32).reshape(-1, 1, 2)
    corners = cv2.approxPolyDP(points, max(MIN_BEND_PX, BEND_SHARE * cv2.arcLength(points, True)), True)
    if not 3 <= len(corners) <= 4 or not cv2.isContourConvex(corners):
        return False
    area = abs(float(cv2.contourArea(points)))
    return abs(abs(float(cv2.contourArea(corners))) - area) < FACE_AREA_SHARE * area


def relief_of(loop_px: np.ndarray, cut: bool) -> Relief:
    """Relief to be expected behind an outline.

    Parameters
    ----------
    loop_px : (N, 2) the outer loop
    cut : whether the image border or a nearer thing takes part of the outline, so that its shape says nothing
    """
    if cut:
        return UNKNOWN
    points = loop_px.astype(np.float32).reshape(-1, 1, 2)
    area = abs(float(cv2.contourArea(points)))
    (_, (width, height), _) = cv2.minAreaRect(points)
    hull = float(cv2.contourArea(cv2.convexHull(points)))
    if area <= 0 or width * height <= 0 or hull <= 0:
        return UNKNOWN
    if area / hull < MIN_SOLIDITY:
        return HOLLOW
    filled = [f for f, _ in SHAPES]
    k = np.interp(area / (width * height), filled, [r.k for _, r in SHAPES])
    sigma = np.interp(area / (width * height), filled, [r.sigma_k for _, r in SHAPES])
    return Relief(float(k), float(sigma))
