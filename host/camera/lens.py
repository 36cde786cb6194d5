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
        if any(self.distortion):
            # As cv2.projectPoints to the last bit, and several times as fast.
            k1, k2, p1, p2, k3 = self.distortion
            x, y = rays.T
            xx, yy, xy = x * x, y * y, 2 * x * y
            r2 = xx + yy
            stretch = 1 + k1 * r2 + k2 * (r2 * r2) + k3 * (r2 * r2 * r2)
            bent_x = x * stretch + p1 * xy + p2 * (r2 + 2 * xx)
            bent_y = y * stretch + p1 * (r2 + 2 * yy) + p2 * xy
            rays = np.column_stack([bent_x, bent_y])
        return rays * (self.fx, self.fy) + (self.cx, self.cy)
