"""A frame enlarged for drawing, and the bar of text that goes below a picture."""

from __future__ import annotations

import cv2
import numpy as np

from host.view.palette import FAINT, PANEL, PANEL_TEXT, text_size, write

SUBPIXEL_BITS = 4
LETTERS = 0.55
BAR_PX = 36


def enlarged(image: np.ndarray, width_px: int) -> tuple[np.ndarray, int]:
    """An image (H, W, 3) a whole number of times larger, to about a width, and that number."""
    scale = max(1, round(width_px / image.shape[1]))
    return cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC), scale


def fixed_points(points_px: np.ndarray, scale: int) -> np.ndarray:
    """Image coordinates (N, 2), integer = pixel centre, in OpenCV's fixed point of the enlarged picture."""
    moved = (points_px + 0.5) * scale - 0.5
    return np.round(moved * (1 << SUBPIXEL_BITS)).astype(np.int32).reshape(-1, 1, 2)


def caption_bar(width_px: int, caption: str, summary: str) -> np.ndarray:
    """A dark bar with one text at its left and one at its right end."""
    bar = np.full((BAR_PX, width_px, 3), PANEL, np.uint8)
    write(bar, caption, (12, 24), LETTERS, PANEL_TEXT)
    write(bar, summary, (width_px - 12 - text_size(summary, LETTERS)[0], 24), LETTERS, FAINT)
    return bar
