"""May this picture be driven on? Stale, dark, blank and frozen ones say why not."""

from __future__ import annotations

import numpy as np

from host.camera.frame import Frame
from host.nav.config import NavConfig

EVERY_PX = 4  # pixels looked at
DARK_LEVEL = 6.0  # mean grey level of a covered lens
FLAT_LEVELS = 2.0  # standard deviation below which there is nothing to see
FROZEN_CM = 1.5  # an unchanged picture after this much travel comes from a camera that hangs


class FrameWatch:
    """Looks at every frame before anything is made of it."""

    def __init__(self, config: NavConfig):
        self._config = config
        self._last: np.ndarray | None = None
        self._same_since_cm = 0.0

    def objection(self, frame: Frame, now_s: float, travelled_cm: float) -> str | None:
        """Why the frame must not be driven on, in one line; None when it may.

        Parameters
        ----------
        frame : the newest picture.
        now_s : present time on the clock of ``frame.t_s``.
        travelled_cm : path of a wheel so far, turns on the spot included.
        """
        sample = frame.image[::EVERY_PX, ::EVERY_PX]
        if self._last is None or not np.array_equal(sample, self._last):
            self._last, self._same_since_cm = sample.copy(), travelled_cm
        age = now_s - frame.t_s
        if age > self._config.frame_stale_s:
            return f"picture is {1000 * age:.0f} ms old, {1000 * self._config.frame_stale_s:.0f} are allowed"
        if float(sample.mean()) < DARK_LEVEL:
            return "picture is black: lens covered, or no light"
        if float(sample.std()) < FLAT_LEVELS:
            return "picture shows nothing: one even colour"
        unchanged = travelled_cm - self._same_since_cm
        if unchanged > FROZEN_CM:
            return f"picture has not changed over {unchanged:.1f} cm of travel: camera hangs"
        return None
