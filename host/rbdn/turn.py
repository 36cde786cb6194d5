"""Where a camera that turned saw before what each of its pixels shows now."""

from __future__ import annotations

import numpy as np

from host.camera.lens import Lens
from host.rbdn import _core

STEP_PX = 8  # between the pixels whose turn is worked out; it bends little, and lenses take their time
BEHIND = 1e-3  # along the optical axis, as rays have it
STEADY_PX = 3.0  # a turn that moves pixels less than this is left to the forces


class TurnedView:
    """Looks through one lens; what does not depend on the turn is worked out once."""

    def __init__(self, lens: Lens) -> None:
        self._lens = lens
        right, bottom = lens.width - 1, lens.height - 1
        self._corners = np.array([[0, 0], [right, 0], [0, bottom], [right, bottom]])
        x, y = (np.arange(-(-size // STEP_PX) + 1) * STEP_PX for size in (lens.width, lens.height))
        nodes = np.stack(np.meshgrid(x, y), axis=-1)
        self._nodes_shape = nodes.shape
        self._corner_rays: list[list[float]] = lens.to_rays(self._corners).tolist()
        self._node_rays = lens.to_rays(nodes.reshape(-1, 2))

    def source(self, rotation: np.ndarray) -> np.ndarray | None:
        """For every pixel the index of the pixel of the last image that the rotation brought there.

        Parameters
        ----------
        rotation
            (3, 3), how the camera turned since: ``X_last = rotation @ X_now``.

        Returns
        -------
        source
            (H * W,) int32, -1 for what was not seen; None where the turn moves pixels by no more than a few.
        """
        if not self._moves(rotation):
            return None
        nodes = self._turned(self._node_rays, rotation).reshape(self._nodes_shape).astype(np.float32)
        return _core.turned_pixels(nodes, STEP_PX, self._lens.width, self._lens.height)

    def _moves(self, rotation: np.ndarray) -> bool:
        """Whether some corner of the image was elsewhere before, by more than a little, or behind it."""
        (a, b, c), (d, e, f), (g, h, i) = rotation.tolist()
        rays = []
        for x, y in self._corner_rays:
            w = g * x + h * y + i
            if not w > BEHIND:
                return True
            rays.append(((a * x + b * y + c) / w, (d * x + e * y + f) / w))
        return bool(np.abs(self._lens.to_pixels(np.array(rays)) - self._corners).max() >= STEADY_PX)

    def _turned(self, rays: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """Where the last image showed what lies on `rays` (N, 2) of the turned camera; far things only."""
        x, y = rays.T
        # Written out, since a threaded matrix product would keep the robot's other cores spinning.
        u, v, w = (row[0] * x + row[1] * y + row[2] for row in rotation.tolist())
        in_front = w > BEHIND
        w = np.where(in_front, w, 1.0)
        far_away = 1e6
        rays = np.column_stack([np.where(in_front, u / w, far_away), np.where(in_front, v / w, far_away)])
        return self._lens.to_pixels(rays)
