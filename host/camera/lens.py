"""The pinhole camera with OpenCV's five distortion terms."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

MORE_STEPS = 20
CLOSE_PX = 1e-4


@dataclass(frozen=True)
class Lens:
    """Intrinsics in pixels; an integer coordinate is a pixel's centre."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)  # k1, k2, p1, p2, k3

    @property
    def matrix(self) -> np.ndarray:
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def to_rays(self, points_px: np.ndarray) -> np.ndarray:
        """Undistorted image points (N, 2) in pixels to (N, 2) = (X/Z, Y/Z)."""
        points = np.asarray(points_px, float).reshape(-1, 2)
        if any(self.distortion) and len(points):  # OpenCV gives None for no points
            flat = cv2.undistortPoints(points.reshape(-1, 1, 2), self.matrix, np.array(self.distortion))
            rays = flat.reshape(-1, 2)
            # OpenCV stops after five steps, which leaves up to 0.1 px in the corners of a wide lens
            for _ in range(MORE_STEPS):
                off_px = points - self.to_pixels(rays)
                if not np.abs(off_px).max() > CLOSE_PX:
                    break
                rays = rays + off_px / (self.fx, self.fy)
            return rays
        return (points - (self.cx, self.cy)) / (self.fx, self.fy)

    def to_pixels(self, rays: np.ndarray) -> np.ndarray:
        """The inverse of to_rays: (N, 2) = (X/Z, Y/Z) to pixels (N, 2)."""
        rays = np.asarray(rays, float).reshape(-1, 2)
        if any(self.distortion) and len(rays):
            space = np.column_stack([rays, np.ones(len(rays))])
            zero = np.zeros(3)
            out, _ = cv2.projectPoints(space, zero, zero, self.matrix, np.array(self.distortion))
            return out.reshape(-1, 2)
        return rays * (self.fx, self.fy) + (self.cx, self.cy)
