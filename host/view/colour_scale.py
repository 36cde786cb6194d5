"""Colours that stand for numbers, and the bar that tells which."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from host.view.palette import INK, PAPER, text_size, write

STEPS = 256
LEGEND_PX = 52
BAR_PX = 12
MARGIN_PX = 14
LETTERS = 0.42
ROUND_NUMBERS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)  # and their tenfolds: the ticks of depth
SMALLEST_RATIO = 2.0  # of the farthest to the nearest colour: less would show noise as if it were depth
ERROR_KNEE = 0.02  # below it colours change evenly with the error, above with its logarithm
OUTLIERS_PERCENT = 3  # of the depths at either end may get the last colour


def _ramp(*anchors: tuple[int, int, int]) -> np.ndarray:
    """Evenly spaced BGR anchors filled up to a table (STEPS, 3)."""
    at = np.linspace(0, 1, len(anchors))
    fine = np.linspace(0, 1, STEPS)
    return np.column_stack([np.interp(fine, at, channel) for channel in np.array(anchors, float).T])


def _map(kind: int) -> np.ndarray:
    return cv2.applyColorMap(np.arange(STEPS, dtype=np.uint8)[:, None], kind)[:, 0].astype(float)


NEAR_TO_FAR = _map(cv2.COLORMAP_TURBO)[::-1][16:-24]  # red is near; its ends are too dark to tell apart
SURE_TO_UNSURE = _ramp((110, 70, 20), (150, 140, 40), (120, 200, 130), (110, 225, 240), (60, 130, 245))
NEARER_TO_FARTHER = _ramp(
    (110, 30, 0), (200, 110, 30), (235, 190, 140), (240, 240, 240),
    (130, 170, 240), (50, 70, 205), (30, 0, 95),
)  # fmt: skip


@dataclass(frozen=True)
class ColourScale:
    """A colour for every number from the first tick to the last; beyond them, the last colour."""

    ticks: tuple[float, ...]  # ascending
    table: np.ndarray  # (N, 3) BGR
    warp: Callable[[np.ndarray], np.ndarray]  # ascending: numbers to what goes evenly with the colours
    label: Callable[[float], str]  # a tick in words

    def colours(self, values: np.ndarray) -> np.ndarray:
        """(..., 3) uint8 BGR of finite numbers (...)."""
        steps = np.round(self._position(values) * (len(self.table) - 1)).astype(int)
        return np.round(self.table[steps]).astype(np.uint8)

    def legend(self, width_px: int, title: str) -> np.ndarray:
        """A strip (LEGEND_PX, width_px, 3) with title, colours and ticks."""
        strip = np.full((LEGEND_PX, width_px, 3), PAPER, np.uint8)
        room = text_size(title, LETTERS)[0] + 2 * MARGIN_PX
        length = width_px - room - 2 * MARGIN_PX
        write(strip, title, (MARGIN_PX, MARGIN_PX + BAR_PX - 1), LETTERS, INK)
        steps = np.round(np.linspace(0, len(self.table) - 1, length)).astype(int)
        strip[MARGIN_PX : MARGIN_PX + BAR_PX, room : room + length] = self.table[steps]
        free_from = 0
        for tick in self.ticks:
            x = room + round(float(self._position(np.array(tick))) * (length - 1))
            text = self.label(tick)
            text_px = text_size(text, LETTERS)[0]
            left = min(x - text_px // 2, width_px - text_px - 2)
            strip[MARGIN_PX + BAR_PX : MARGIN_PX + BAR_PX + 4, x] = INK
            if left >= free_from:
                write(strip, text, (left, LEGEND_PX - 8), LETTERS, INK)
                free_from = left + text_px + 6
        return strip

    def _position(self, values: np.ndarray) -> np.ndarray:
        low, high = self.warp(np.array(self.ticks[0])), self.warp(np.array(self.ticks[-1]))
        inside = np.clip(values, self.ticks[0], self.ticks[-1])
        return (self.warp(inside) - low) / (high - low)


def depth_scale(depths_cm: np.ndarray) -> ColourScale:
    """A logarithmic scale in cm over nearly all of some depths (N,), between round numbers."""
    low, high = 50.0, 300.0  # what a room may hold
    if len(depths_cm):
        low = float(np.percentile(depths_cm, OUTLIERS_PERCENT, method="lower"))
        high = float(np.percentile(depths_cm, 100 - OUTLIERS_PERCENT, method="higher"))
    decades = range(-1, 6)
    numbers = np.array([n * 10.0**d for d in decades for n in ROUND_NUMBERS])
    first = max(int(np.searchsorted(numbers, low * (1 + 1e-9))) - 1, 0)
    last = min(int(np.searchsorted(numbers, max(high, low * SMALLEST_RATIO))), len(numbers) - 1)
    return ColourScale(tuple(numbers[first : last + 1].tolist()), NEAR_TO_FAR, np.log, lambda v: f"{v:g}")


RELATIVE_SIGMA = ColourScale(
    (0.003, 0.01, 0.03, 0.1, 0.3), SURE_TO_UNSURE, np.log, lambda v: f"{100 * v:g} %"
)
RELATIVE_ERROR = ColourScale(
    (-0.3, -0.1, -0.05, -0.02, 0.0, 0.02, 0.05, 0.1, 0.3),
    NEARER_TO_FARTHER,
    lambda v: np.arcsinh(v / ERROR_KNEE),
    lambda v: f"{100 * v:+g} %" if v else "0",
)
