"""Colours and lettering that all pictures share."""

from __future__ import annotations

import colorsys

import cv2
import numpy as np

Colour = tuple[int, int, int]  # BGR

INK: Colour = (60, 52, 46)
MUTED: Colour = (150, 142, 134)
PAPER: Colour = (250, 249, 247)
FAINT: Colour = (200, 195, 190)
PANEL: Colour = (44, 38, 34)
PANEL_TEXT: Colour = (240, 238, 235)
FONT = cv2.FONT_HERSHEY_SIMPLEX
GOLDEN_RATIO = 0.618033988749895
# OpenCV's letters know no more than ASCII before version 5.
PLUS_MINUS = "±" if int(cv2.__version__.split(".")[0]) >= 5 else "+-"


def region_colour(region_id: int) -> Colour:
    """A colour that stays with the id and is far from those of neighbouring ids."""
    hue = (0.55 + region_id * GOLDEN_RATIO) % 1.0
    red, green, blue = colorsys.hsv_to_rgb(hue, 0.55 if region_id % 2 else 0.72, 0.95)
    return round(255 * blue), round(255 * green), round(255 * red)


def depth_text(depth_cm: float, sigma_cm: float | None) -> str:
    """``85.2 ± 0.6 cm``, with as many digits as the sigma supports."""
    if sigma_cm is None:
        return f"{depth_cm:.0f} cm"
    digits = 1 if sigma_cm < 2.0 else 0
    return f"{depth_cm:.{digits}f} {PLUS_MINUS} {sigma_cm:.{digits}f} cm"


def text_size(text: str, scale: float) -> tuple[int, int]:
    """Width and height of a line of text, px."""
    (width, height), _ = cv2.getTextSize(text, FONT, scale, 1)
    return width, height


def write(canvas: np.ndarray, text: str, at: tuple[int, int], scale: float, colour: Colour) -> None:
    """Write one line on `canvas` (H, W, 3) with its lower left corner at `at` (x, y)."""
    printable = text.encode("utf-8", "replace").decode()  # a file's name may be no UTF-8
    cv2.putText(canvas, printable, at, FONT, scale, colour, 1, cv2.LINE_AA)


def shade(canvas: np.ndarray, box: tuple[int, int, int, int], colour: Colour, alpha: float) -> None:
    """Lay a translucent rectangle (x0, y0, x1, y1) over `canvas`, cut at its edges."""
    x0, y0, x1, y1 = box
    part = canvas[max(y0, 0) : max(y1, 0), max(x0, 0) : max(x1, 0)]
    part[:] = np.round(part * (1 - alpha) + np.array(colour) * alpha).astype(np.uint8)
