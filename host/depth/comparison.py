"""The present outline, moved to a trial depth, against the outlines of earlier frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from host.camera.lens import Lens
from host.depth.keyframes import Faces, Keyframes
from host.depth.samples import Samples

LIKE_NORMAL = 0.8  # cosine between a sample's normal and its match's
LIKE_RGB = 40.0  # distance of mean colours below which two regions may be the same
ALONG_PX = 3.0  # a match may lie so far along the outline
NEAREST_SHARE = 0.05  # of its depth, nearer than which a sample would be behind the earlier camera


@dataclass(frozen=True)
class Look:
    """Residuals of every sample in every earlier frame, at one depth of each sample."""

    rho: np.ndarray  # (N,) inverse depths it was taken at, 1/cm
    residual: np.ndarray  # (..., K, N) px along the normal
    gain: np.ndarray  # (..., K, N) px per unit of rho
    good: np.ndarray  # (..., K, N) bool, whether there is a match


class Comparison:
    """One present frame against the kept ones.

    Parameters
    ----------
    keyframes : the earlier outlines
    shifts_cm : (K, 3) the present camera's position in the axes of the earlier ones
    faces : the present regions
    """

    def __init__(self, keyframes: Keyframes, shifts_cm: np.ndarray, faces: Faces, lens: Lens) -> None:
        self._keyframes = keyframes
        self._shifts = shifts_cm.astype(np.float32)
        self._focal = float(lens.fx), float(lens.fy)
        self._centre = float(lens.cx), float(lens.cy)
        # (K, R, M) whether a present region may be what an earlier one was: by its id or its colour
        kept = keyframes.faces
        self._alike = np.zeros((len(kept), len(faces.ids), max(len(k.ids) for k in kept)), bool)
        for k, then in enumerate(kept):
            apart = np.linalg.norm(faces.rgb[:, None] - then.rgb[None], axis=2)
            self._alike[k, :, : len(then.ids)] = (faces.ids[:, None] == then.ids) | (apart < LIKE_RGB)

    def look(self, samples: Samples, rho: np.ndarray, rows: np.ndarray | slice = slice(None)) -> Look:
        """Residuals at inverse depths `rho`: (N,), or (T, 1, N) for T trials at once, of some rows."""
        base, normal = samples.base[:, :, rows], samples.normal[:, :, rows]
        region, side = samples.region[rows], samples.side[rows]
        rho32 = rho.astype(np.float32)
        which = np.arange(len(self._shifts))[:, None]
        tx, ty, tz = self._shifts.T[:, :, None]
        depth = base[2] + rho32 * tz
        before = depth > NEAREST_SHARE
        inverse = 1 / np.where(before, depth, np.float32(1))
        x, y = (base[0] + rho32 * tx) * inverse, (base[1] + rho32 * ty) * inverse
        fx, fy = self._focal
        qx, qy = x * fx + self._centre[0], y * fy + self._centre[1]
        match = self._keyframes.match(which, qx, qy, samples.direction[:, rows])
        cosine = match.normal_x * normal[0] + match.normal_y * normal[1]
        opposite = cosine < 0
        sense = np.where(opposite, np.float32(-1), np.float32(1))
        cosine = np.abs(cosine)
        # between two points of an arc the mean normal is across their chord
        length = 1 / np.sqrt(2 + 2 * cosine)
        nx, ny = (match.normal_x * sense + normal[0]) * length, (match.normal_y * sense + normal[1]) * length
        dx, dy = qx - match.x_px, qy - match.y_px
        residual = dx * nx + dy * ny
        good = before & match.found & (cosine > LIKE_NORMAL) & (np.abs(dx * ny - dy * nx) < ALONG_PX)
        # the region itself must lie on the same side of the edge; what lies beyond may have changed
        inner = np.where((side == 0) != opposite, match.left, match.right)
        _, present, widest = self._alike.shape
        good &= self._alike.take((which * present + region) * widest + inner, mode="clip") & (inner >= 0)
        gain = ((tx - x * tz) * (fx * nx) + (ty - y * tz) * (fy * ny)) * inverse
        return Look(rho, residual, gain, good)
