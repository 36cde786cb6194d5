"""Strokes that every picture shares: a muted palette, lines, and text in readable boxes."""

from __future__ import annotations

import colorsys

import cv2
import numpy as np

Colour = tuple[int, int, int]  # blue, green, red, as OpenCV has it

DARK: Colour = (38, 34, 30)
LIGHT: Colour = (244, 244, 242)
GREY: Colour = (150, 148, 144)
FONT = cv2.FONT_HERSHEY_SIMPLEX
SUBPIXEL_BITS = 4
PADDING_PX = 5


def colour_of(number: int) -> Colour:
    """A muted colour, the same whenever the number is, and unlike those of its neighbours."""
    hue = number * 0.618034 % 1.0  # golden section: neighbouring numbers get far hues
    red, green, blue = colorsys.hls_to_rgb(hue, 0.62, 0.5)
    return round(255 * blue), round(255 * green), round(255 * red)


def polyline(
    picture: np.ndarray, points: np.ndarray, colour: Colour, width: int, closed: bool = False
) -> None:
    """Anti-aliased line through points (N, 2) in pixels of the picture, integer = pixel centre."""
    if len(points) > 1:
        cv2.polylines(picture, [_fixed(points)], closed, colour, width, cv2.LINE_AA, SUBPIXEL_BITS)


def fill(picture: np.ndarray, loops: list[np.ndarray], colour: Colour) -> None:
    """Fill the inside of loops (each (N, 2) px), holes left out."""
    cv2.fillPoly(picture, [_fixed(loop) for loop in loops], colour, cv2.LINE_AA, SUBPIXEL_BITS)


def dot(picture: np.ndarray, point: np.ndarray, radius_px: float, colour: Colour, width: int = -1) -> None:
    """Anti-aliased disc, or with a width a ring."""
    x, y = _fixed(np.asarray(point, float))
    radius = round(radius_px * (1 << SUBPIXEL_BITS))
    cv2.circle(picture, (int(x), int(y)), radius, colour, width, cv2.LINE_AA, SUBPIXEL_BITS)


def text_size(text: str, scale: float = 0.5) -> tuple[int, int]:
    """Width and height in pixels of one line of text."""
    (width, height), _ = cv2.getTextSize(text.replace("±", "+"), FONT, scale, 1)
    return width, height


def write(picture: np.ndarray, text: str, left: int, base: int, colour: Colour, scale: float = 0.5) -> None:
    """One line of ASCII text, its base line at `base`; ± is also understood, which the font lacks."""
    parts = text.split("±")
    for k, part in enumerate(parts):
        cv2.putText(picture, part, (left, base), FONT, scale, colour, 1, cv2.LINE_AA)
        left += text_size(part, scale)[0] if part else 0
        if k + 1 < len(parts):
            width, _ = text_size("+", scale)
            cv2.putText(picture, "+", (left, base - 2), FONT, scale, colour, 1, cv2.LINE_AA)
            cv2.line(picture, (left + 2, base + 1), (left + width - 3, base + 1), colour, 1)
            left += width


def box_size(lines: list[str], scale: float = 0.5) -> tuple[int, int]:
    """Width and height in pixels of a box around lines of text."""
    sizes = [text_size(line, scale) for line in lines]
    height = max(h for _, h in sizes)
    return max(w for w, _ in sizes) + 2 * PADDING_PX, len(lines) * (height + 5) - 5 + 2 * PADDING_PX


def box(
    picture: np.ndarray, lines: list[str], left: int, top: int, rim: Colour | None = None, scale: float = 0.5
) -> None:
    """Lines of text on a dark, slightly transparent ground, with a coloured bar on the left if asked for."""
    width, height = box_size(lines, scale)
    part = picture[max(top, 0) : top + height, max(left, 0) : left + width]
    part[:] = (0.2 * part + 0.8 * np.array(DARK)).astype(np.uint8)
    if rim is not None:
        cv2.rectangle(picture, (left, top), (left + 2, top + height - 1), rim, -1)
    step = max(text_size(line, scale)[1] for line in lines) + 5
    for k, line in enumerate(lines):
        write(picture, line, left + PADDING_PX + 1, top + PADDING_PX + k * step + step - 5, LIGHT, scale)


def _fixed(points: np.ndarray) -> np.ndarray:
    return np.round(np.asarray(points, float) * (1 << SUBPIXEL_BITS)).astype(np.int32)
