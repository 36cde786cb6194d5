"""May this picture be driven on? Stale, dark, blank, blurred, torn, frozen and repeated ones say why not."""

from __future__ import annotations

import cv2
import numpy as np

from host.camera.frame import Frame
from host.nav import _nav
from host.nav.config import NavConfig
from host.nav.focus import FocusWatch

EVERY_PX = 4  # pixels looked at
DARK_LEVEL = 6.0  # mean grey level of a covered lens
FLAT_LEVELS = 2.0  # standard deviation below which there is nothing to see
FROZEN_CM = 1.5  # an unchanged picture after this much travel comes from a camera that hangs
REMEMBERED = 32  # pictures among which a repeated one is found
TORN_CM = 0.3  # after this much travel no row with something in it stays the same to the last bit
TORN_ROWS = 0.1  # of all that are looked at
ROW_LEVELS = 20  # from the darkest to the brightest of a row with something in it
EMPTY_LEVELS = 1  # and of one that was not delivered


class FrameWatch:
    """Looks at every frame before anything is made of it."""

    def __init__(self, config: NavConfig):
        self._config = config
        self._last: np.ndarray | None = None
        self._last_cm = 0.0
        self._focus = FocusWatch()
        self._seen_cm: dict[int, float] = {}  # travel at which a picture was first seen, in this order

    def objection(self, frame: Frame, now_s: float, travelled_cm: float) -> str | None:
        """Why the frame must not be driven on, in one line; None when it may.

        Parameters
        ----------
        frame : the newest picture.
        now_s : present time on the clock of ``frame.t_s``.
        travelled_cm : path of a wheel so far, turns on the spot included.
        """
        sample = _nav.thinned(np.ascontiguousarray(frame.image), EVERY_PX)
        repeated = self._repeated(sample, travelled_cm)
        torn = self._torn(sample, travelled_cm)
        self._last, self._last_cm = sample, travelled_cm
        age = now_s - frame.t_s
        if age > self._config.frame_stale_s:
            return f"picture is {1000 * age:.0f} ms old, {1000 * self._config.frame_stale_s:.0f} are allowed"
        means, deviations = cv2.meanStdDev(sample.reshape(-1, 1))
        if float(means[0, 0]) < DARK_LEVEL:
            return "picture is black: lens covered, or no light"
        if float(deviations[0, 0]) < FLAT_LEVELS:
            return "picture shows nothing: one even colour"
        if repeated or torn:
            return repeated or torn
        if self._focus.blurred(frame.image, frame.t_s, travelled_cm):
            return "picture is blurred: its edges went at once; out of focus, or the lens is dirty"
        return None

    @property
    def caution(self) -> str | None:
        """Why to go no faster than creeping, though the picture may be driven on; None where it is good."""
        return "picture stays soft, seeing less" if self._focus.soft else None

    def _repeated(self, sample: np.ndarray, travelled_cm: float) -> str | None:
        key = hash(sample.tobytes())
        since_cm = travelled_cm - self._seen_cm.setdefault(key, travelled_cm)
        if len(self._seen_cm) > REMEMBERED:
            del self._seen_cm[next(iter(self._seen_cm))]
        if since_cm <= FROZEN_CM:
            return None
        if self._last is not None and np.array_equal(sample, self._last):
            return f"picture has not changed over {since_cm:.1f} cm of travel: camera hangs"
        return f"picture was seen before, {since_cm:.1f} cm of travel ago: camera repeats itself"

    def _torn(self, sample: np.ndarray, travelled_cm: float) -> str | None:
        before = self._last
        spread, alike = _nav.compare_rows(sample, sample if before is None else before)
        rows = len(spread)
        empty = rows - 1 - int(np.argmax(spread[::-1] > EMPTY_LEVELS))
        if rows - 1 - empty > TORN_ROWS * rows:
            return f"picture is torn: nothing below row {EVERY_PX * (empty + 1)}"
        if before is None or travelled_cm - self._last_cm < TORN_CM:
            return None
        share = int((alike & (spread > ROW_LEVELS)).sum()) / rows
        if share >= TORN_ROWS and not alike.all():
            return f"picture is torn: {100 * share:.0f} % of its rows are those of the last one"
        return None
