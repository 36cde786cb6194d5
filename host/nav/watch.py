"""May this picture be driven on? Stale, dark, blank, blurred, torn, frozen and repeated ones say why not."""

from __future__ import annotations

import math

import cv2
import numpy as np

from host.camera.frame import Frame
from host.nav.config import NavConfig

EVERY_PX = 4  # pixels looked at
DARK_LEVEL = 6.0  # mean grey level of a covered lens
FLAT_LEVELS = 2.0  # standard deviation below which there is nothing to see
FROZEN_CM = 1.5  # an unchanged picture after this much travel comes from a camera that hangs
REMEMBERED = 32  # pictures among which a repeated one is found
TORN_CM = 0.3  # after this much travel no row with something in it stays the same to the last bit
TORN_ROWS = 0.1  # of all that are looked at
ROW_LEVELS = 20  # from the darkest to the brightest of a row with something in it
EMPTY_LEVELS = 1  # and of one that was not delivered
EDGE_PX = 10  # an edge in focus is much narrower than this
NARROW_PX = 2  # and a good part of its step lies within this
BAND_ROWS = 4
EDGE_LEVELS = 32  # step in brightness across an edge
CLEAR_EDGES = 150  # pixels of edges in a picture that tells how sharp pictures are
LEAST_EDGES = 20
SHARPEST_PERCENT = 90  # one of the sharper edges speaks for the picture: many things are soft
SHARP_SHARE, SOFT_SHARE = 0.6, 0.36  # of the step within NARROW_PX; a ramp's is 0.2
SAME_VIEW_CM = 3.0  # after no more travel than this edges do not just leave the picture


class FrameWatch:
    """Looks at every frame before anything is made of it."""

    def __init__(self, config: NavConfig):
        self._config = config
        self._last: np.ndarray | None = None
        self._last_cm = 0.0
        self._sharp_cm = -math.inf  # travel at the last picture, if that was sharp
        self._seen_cm: dict[int, float] = {}  # travel at which a picture was first seen, in this order

    def objection(self, frame: Frame, now_s: float, travelled_cm: float) -> str | None:
        """Why the frame must not be driven on, in one line; None when it may.

        Parameters
        ----------
        frame : the newest picture.
        now_s : present time on the clock of ``frame.t_s``.
        travelled_cm : path of a wheel so far, turns on the spot included.
        """
        rows = frame.image[::EVERY_PX]
        sample = np.ascontiguousarray(rows[:, ::EVERY_PX])
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
        return repeated or torn or self._blurred(frame.image, travelled_cm)

    def _blurred(self, image: np.ndarray, travelled_cm: float) -> str | None:
        """Soft edges where sharp ones were a moment ago; things that are soft themselves are no blur."""
        edges, sharpness = sharpness_of(image)
        if sharpness >= SHARP_SHARE:
            self._sharp_cm = travelled_cm if edges >= CLEAR_EDGES else -math.inf
        elif sharpness < SOFT_SHARE and travelled_cm - self._sharp_cm < SAME_VIEW_CM:
            return "picture is blurred: its edges became wide at once; out of focus, or the lens is dirty"
        return None

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
        spread = (sample.max(axis=1) - sample.min(axis=1)).max(axis=1)  # along each row
        empty = len(spread) - 1 - int(np.argmax(spread[::-1] > EMPTY_LEVELS))
        if len(spread) - 1 - empty > TORN_ROWS * len(spread):
            return f"picture is torn: nothing below row {EVERY_PX * (empty + 1)}"
        if self._last is None or travelled_cm - self._last_cm < TORN_CM:
            return None
        same = (sample == self._last).all(axis=(1, 2)) & (spread > ROW_LEVELS)
        if same.mean() >= TORN_ROWS and not (sample == self._last).all():
            return f"picture is torn: {100 * same.mean():.0f} % of its rows are those of the last one"
        return None


def sharpness_of(image: np.ndarray) -> tuple[int, float]:
    """How much of an edge's step lies within two pixels, for the sharper edges of a picture.

    Parameters
    ----------
    image : (H, W, 3) uint8

    Returns
    -------
    (pixels of edges, the share: 0.2 for a ramp up to 1; 0 where there are too few edges)
    """
    # The mean of a few rows has less noise, which looks sharp.
    band = cv2.resize(image, (image.shape[1], image.shape[0] // BAND_ROWS), interpolation=cv2.INTER_AREA)
    levels = np.ascontiguousarray(band[::2, :, 1])
    step = cv2.absdiff(levels[:, EDGE_PX:], levels[:, :-EDGE_PX])
    row, col = np.nonzero(step >= EDGE_LEVELS)
    if len(row) < LEAST_EDGES:
        return len(row), 0.0
    narrow = cv2.absdiff(levels[:, NARROW_PX:], levels[:, :-NARROW_PX])
    steepest = cv2.dilate(narrow, np.ones((1, EDGE_PX - NARROW_PX + 1)), anchor=(0, 0))[row, col]
    return len(row), float(np.percentile(steepest / step[row, col], SHARPEST_PERCENT))
