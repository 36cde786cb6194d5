"""The polygon net over an enlarged part of an image: edges, vertices, moves and single pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from host.view.palette import INK, PAPER, Colour, text_size, write

EDGE: Colour = (70, 60, 52)
VERTEX: Colour = (255, 255, 255)
MOVE: Colour = (40, 40, 210)
SUBPIXEL_BITS = 4
PALE = 0.35  # share of white in the image behind the net, so that the net stands out
GAP_PX = 14
CAPTION_PX = 30
LETTERS = 0.5


@dataclass(frozen=True)
class Part:
    """A rectangle of an image, in whole pixels, and how many times it is enlarged."""

    left: int
    top: int
    width: int
    height: int
    scale: int

    def canvas(self, image: np.ndarray, pale: float = PALE) -> np.ndarray:
        """The part of `image` (H, W, 3), enlarged and paled."""
        part = image[self.top : self.top + self.height, self.left : self.left + self.width]
        how = cv2.INTER_NEAREST if self.scale > 4 else cv2.INTER_CUBIC
        large = cv2.resize(part, None, fx=self.scale, fy=self.scale, interpolation=how)
        return cv2.addWeighted(large, 1 - pale, np.full_like(large, 255), pale, 0)

    def at(self, points_px: np.ndarray) -> np.ndarray:
        """Image coordinates (N, 2), integer = pixel centre, in OpenCV's fixed point of the canvas."""
        moved = (np.atleast_2d(points_px) + 0.5 - (self.left, self.top)) * self.scale - 0.5
        return np.round(moved * (1 << SUBPIXEL_BITS)).astype(np.int32)


def draw_edges(
    canvas: np.ndarray, part: Part, faces: dict[str, np.ndarray], colour: Colour = EDGE, width: int = 2
) -> None:
    """Draw every edge of a net, as `host.rbdn.Net.faces` tells it."""
    ends = part.at(faces["vertices_px"])
    for a, b in faces["edges"][:, :2]:
        _line(canvas, ends[a], ends[b], colour, width)


def draw_vertices(canvas: np.ndarray, part: Part, vertices_px: np.ndarray, colour: Colour = VERTEX) -> None:
    """Draw vertices (N, 2) as dots with a dark rim."""
    for x, y in part.at(vertices_px):
        for radius, shade in ((4.0, EDGE), (2.8, colour)):
            centre = (int(x), int(y))
            fixed = round(radius * (1 << SUBPIXEL_BITS))
            cv2.circle(canvas, centre, fixed, shade, -1, cv2.LINE_AA, SUBPIXEL_BITS)


def draw_moves(canvas: np.ndarray, part: Part, before_px: np.ndarray, after_px: np.ndarray) -> None:
    """Draw an arrow from each place (N, 2) to where it goes; what hardly moves gets none."""
    for start, end in zip(part.at(before_px), part.at(after_px), strict=True):
        reach = float(np.hypot(*(end - start))) / (1 << SUBPIXEL_BITS)
        if reach < 4:
            continue
        _line(canvas, start, end, MOVE, 2)
        along = (end - start) / np.hypot(*(end - start))
        for turn in (2.6, -2.6):
            wing = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ along
            tip = end + np.round(wing * min(9.0, reach / 2) * (1 << SUBPIXEL_BITS)).astype(np.int32)
            _line(canvas, end, tip, MOVE, 2)


def fill_loops(
    canvas: np.ndarray, part: Part, loops_px: Sequence[np.ndarray], colour: Colour, share: float
) -> None:
    """Lay a translucent polygon over the canvas; loops (N, 2) inside another are holes."""
    layer = canvas.copy()
    loops = [part.at(loop).reshape(-1, 1, 2) for loop in loops_px]
    cv2.fillPoly(layer, loops, colour, cv2.LINE_AA, SUBPIXEL_BITS)
    cv2.addWeighted(layer, share, canvas, 1 - share, 0, dst=canvas)


def draw_loop(canvas: np.ndarray, part: Part, loop_px: np.ndarray, colour: Colour) -> None:
    """Draw a closed line through points (N, 2)."""
    points = [part.at(loop_px).reshape(-1, 1, 2)]
    cv2.polylines(canvas, points, True, colour, 2, cv2.LINE_AA, SUBPIXEL_BITS)


def mark_pixels(canvas: np.ndarray, part: Part, mask: np.ndarray, colour: Colour) -> None:
    """Mark the middle of each pixel of `mask`, (H, W) bool."""
    inside = mask[part.top : part.top + part.height, part.left : part.left + part.width]
    inset = max(1, part.scale // 4)
    for y, x in np.argwhere(inside) * part.scale:
        canvas[y + inset : y + part.scale - inset, x + inset : x + part.scale - inset] = colour


def in_a_row(panels: list[np.ndarray], captions: list[str]) -> np.ndarray:
    """Pictures of one height side by side, each with a line of text below it."""
    height = panels[0].shape[0]
    out: list[np.ndarray] = []
    for k, (panel, caption) in enumerate(zip(panels, captions, strict=True)):
        width = panel.shape[1]
        if text_size(caption, LETTERS)[0] > width:
            raise ValueError(f"caption is wider than its picture: {caption}")
        bar = np.full((CAPTION_PX, width, 3), PAPER, np.uint8)
        write(bar, caption, (1, 21), LETTERS, INK)
        if k > 0:
            out.append(np.full((height + CAPTION_PX, GAP_PX, 3), PAPER, np.uint8))
        out.append(np.vstack([panel, bar]))
    return np.hstack(out)


def above_each_other(rows: list[np.ndarray]) -> np.ndarray:
    """Rows of pictures in a column, filled up to the widest."""
    width = max(row.shape[1] for row in rows)
    return np.vstack(
        [
            cv2.copyMakeBorder(row, 0, 0, 0, width - row.shape[1], cv2.BORDER_CONSTANT, value=PAPER)
            for row in rows
        ]
    )


def _line(canvas: np.ndarray, a: np.ndarray, b: np.ndarray, colour: Colour, width: int) -> None:
    start, end = (int(a[0]), int(a[1])), (int(b[0]), int(b[1]))
    cv2.line(canvas, start, end, colour, width, cv2.LINE_AA, SUBPIXEL_BITS)
