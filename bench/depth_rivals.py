"""What else gives an object's depth while the camera drives ahead: four rivals, each favoured with the truth.

All get the object's true mask in the first frame, the true travel, and every frame of the drive. A scale s
between the first frame and a later one, d cm ahead, belongs to 1/s = 1 - d/Z, so that all frames together
give Z by least squares; those who follow single points triangulate them with the true poses instead.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from host.camera.lens import Lens
from host.pose import Pose

ECC_MARGIN_PX = 4  # round the object, of the patch that is aligned
ECC_STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 60, 1e-5)
ECC_BLUR_PX = 3
CORNERS = {"maxCorners": 80, "qualityLevel": 0.01, "minDistance": 4}
CORNER_RIM_PX = 1  # by which the mask grows for corners, which sit on outlines
LK = {"winSize": (15, 15), "maxLevel": 3}
LK_BACK_PX = 0.3  # a corner followed to and fro must come back so near
FLOW_RIM_PX = 3  # by which the mask grows for the flow, for which an outline is the steepest place
LEAST_SLOPE = 1e-3  # weight of the flow where the picture has no slope at all


@dataclass(frozen=True)
class Frames:
    """A drive as the rivals get it."""

    grey: Sequence[np.ndarray]  # (H, W) uint8 each
    poses: Sequence[Pose]  # true
    lens: Lens

    @property
    def travel_cm(self) -> np.ndarray:
        """(F,) along the first frame's axis."""
        return np.array([pose.relative_to(self.poses[0])[1][2] for pose in self.poses])


Rival = Callable[
    [Frames, np.ndarray], float | None
]  # frames and first mask to the depth at the last frame, cm


def ecc(frames: Frames, mask: np.ndarray) -> float | None:
    """The object's patch of the first frame, aligned with every other one by correlation."""
    (top, bottom), (left, right) = (_span(np.flatnonzero(mask.any(axis=a))) for a in (1, 0))
    patch = np.ascontiguousarray(frames.grey[0][top:bottom, left:right])
    warp = np.array([[1, 0, left], [0, 1, top]], np.float32)
    everywhere = np.ones_like(frames.grey[0])
    shrinks = [1.0]
    for grey in frames.grey[1:]:
        try:
            _, warp = cv2.findTransformECC(
                patch, grey, warp, cv2.MOTION_AFFINE, ECC_STOP, everywhere, ECC_BLUR_PX
            )
        except cv2.error:
            return None  # its way to say that it did not converge
        growth = float(np.linalg.det(warp[:, :2].astype(float)))
        if growth <= 0:
            return None
        shrinks.append(growth**-0.5)
    return _depth_of_shrinks(frames.travel_cm, np.array(shrinks))


def klt(frames: Frames, mask: np.ndarray) -> float | None:
    """Corners in the object, followed from frame to frame and triangulated; the median of their depths."""
    corners = cv2.goodFeaturesToTrack(frames.grey[0], mask=_grown(mask, CORNER_RIM_PX), **CORNERS)
    if corners is None:
        return None
    tracks = [corners.reshape(-1, 2)]
    good = np.ones(len(corners), bool)
    for before, after in zip(frames.grey, frames.grey[1:], strict=False):
        start = tracks[-1].reshape(-1, 1, 2)
        end, found, _ = cv2.calcOpticalFlowPyrLK(before, after, start, None, **LK)  # pyright: ignore
        back, returned, _ = cv2.calcOpticalFlowPyrLK(after, before, end, None, **LK)  # pyright: ignore
        good &= (found.ravel() == 1) & (returned.ravel() == 1)
        good &= np.hypot(*(back - start).reshape(-1, 2).T) < LK_BACK_PX
        tracks.append(end.reshape(-1, 2))
    if not good.any():
        return None
    depths = _triangulated(frames, np.array(tracks)[:, good].astype(float))
    depths = depths[np.isfinite(depths) & (depths > 0)]
    return float(np.median(depths)) if len(depths) else None


def dis_divergence(frames: Frames, mask: np.ndarray) -> float | None:
    """Dense flow from the first frame to every other, and an affine motion fitted to it over the object.

    It counts by how steep the picture is, since flow is guessed where that is even.
    """
    y, x = np.nonzero(_grown(mask, FLOW_RIM_PX))
    soft = cv2.GaussianBlur(frames.grey[0].astype(np.float32), (0, 0), 1.0)
    slope = np.hypot(cv2.Sobel(soft, -1, 1, 0), cv2.Sobel(soft, -1, 0, 1))
    trust = (slope[y, x] + LEAST_SLOPE)[:, None].astype(float)
    places = trust * np.column_stack([x, y, np.ones(len(x))])
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    shrinks = [1.0]
    for grey in frames.grey[1:]:
        moved = flow.calc(frames.grey[0], grey, None)[y, x].astype(float)  # pyright: ignore
        affine = np.linalg.lstsq(places, trust * moved, rcond=None)[0]
        growth = float(np.linalg.det(np.eye(2) + affine[:2]))
        if growth <= 0:
            return None
        shrinks.append(growth**-0.5)
    return _depth_of_shrinks(frames.travel_cm, np.array(shrinks))


RIVALS: dict[str, Rival] = {
    "ECC, affine": ecc,
    "KLT, triangulated": klt,
    "DIS, divergence": dis_divergence,
}


def pixel_count(travel_cm: np.ndarray, pixels: np.ndarray) -> float | None:
    """Eq. 16 on the pixels (F,) of an object's true mask in every frame."""
    return _depth_of_shrinks(travel_cm, np.sqrt(pixels[0] / pixels))


def _grown(mask: np.ndarray, rim_px: int) -> np.ndarray:
    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * rim_px + 1,) * 2, np.uint8))


def _span(where: np.ndarray) -> tuple[int, int]:
    """First row or column of the patch, and the one after the last; an image may end before."""
    return max(int(where[0]) - ECC_MARGIN_PX, 0), int(where[-1]) + 1 + ECC_MARGIN_PX


def _depth_of_shrinks(travel_cm: np.ndarray, shrinks: np.ndarray) -> float | None:
    """Depth at the last frame from 1/s of every frame against the first; None where nothing grew."""
    growth = float(travel_cm @ (1 - shrinks))
    if growth <= 0:
        return None
    return float(travel_cm @ travel_cm) / growth - float(travel_cm[-1])


def _triangulated(frames: Frames, tracks_px: np.ndarray) -> np.ndarray:
    """Depths (N,) at the last frame of points followed through all frames, (F, N, 2)."""
    rays = [np.column_stack([frames.lens.to_rays(points), np.ones(len(points))]) for points in tracks_px]
    above, below = np.zeros(len(rays[0])), np.zeros(len(rays[0]))
    turn, shift = np.eye(3), np.zeros(3)
    for ray, pose in zip(rays, frames.poses, strict=True):
        turn, shift = frames.poses[0].relative_to(pose)
        turned = rays[0] @ turn.T
        for axis in (0, 1):  # seen * (turned_z + rho shift_z) = turned + rho shift
            constant = ray[:, axis] * turned[:, 2] - turned[:, axis]
            slope = ray[:, axis] * shift[2] - shift[axis]
            above -= constant * slope
            below += slope * slope
    with np.errstate(divide="ignore", invalid="ignore"):
        return (rays[0] @ turn.T)[:, 2] * (below / above) + shift[2]
