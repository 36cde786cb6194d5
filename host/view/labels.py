"""Labels written into the regions they speak of, none over another."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from host.rbdn.snapshot import Region
from host.view.palette import PANEL, Colour, region_colour, shade, text_size, write

MARGIN_PX = 6
NAMED_AREA_SHARE = 0.004  # of the picture: only larger regions get a label that is not written always

Box = tuple[int, int, int, int]  # x0, y0, x1, y1


@dataclass(frozen=True)
class Label:
    """A line of text that belongs to a region."""

    region: Region
    text: str
    colour: Colour
    letters: float  # scale of the lettering
    always: bool = False  # also in a region too small to be named


def write_labels(canvas: np.ndarray, labels: Iterable[Label], scale: int) -> None:
    """From the largest region down; a label that would cover another is moved or left out."""
    taken: list[Box] = []
    smallest = NAMED_AREA_SHARE * canvas.shape[0] * canvas.shape[1] / scale**2
    for label in sorted(labels, key=lambda found: (not found.always, -found.region.area_px)):
        if label.region.area_px < smallest and not label.always:
            continue
        x, y = np.round((middle_of(label.region) + 0.5) * scale).astype(int)
        box = _place(canvas, (int(x), int(y)), text_size(label.text, label.letters), taken)
        if box is None:
            continue
        taken.append(box)
        shade(canvas, box, PANEL, 0.78)
        x0, y0, _, y1 = box
        cv2.rectangle(canvas, (x0, y0), (x0 + 3, y1 - 1), region_colour(label.region.id), -1)
        write(canvas, label.text, (x0 + 4 + MARGIN_PX, y1 - MARGIN_PX), label.letters, label.colour)


def middle_of(region: Region) -> np.ndarray:
    """The place (2,) in a region farthest from its outline, px."""
    outer = region.loops[0]
    low = np.floor(outer.min(axis=0)).astype(int) - 1
    width, height = np.ceil(outer.max(axis=0)).astype(int) - low + 2
    mask = np.zeros((height, width), np.uint8)
    loops = [np.round(loop - low).astype(np.int32).reshape(-1, 1, 2) for loop in region.loops]
    cv2.fillPoly(mask, loops, 1)
    _, _, _, farthest = cv2.minMaxLoc(cv2.distanceTransform(mask, cv2.DIST_L2, 3))
    return np.array(farthest, float) + low


def _place(
    canvas: np.ndarray, middle: tuple[int, int], size: tuple[int, int], taken: list[Box]
) -> Box | None:
    """A free box for a label near `middle`, within the picture; None where all is taken."""
    width, height = size[0] + 4 + 2 * MARGIN_PX, size[1] + 2 * MARGIN_PX
    for step in (0, -1, 1, -2, 2):
        x0 = min(max(middle[0] - width // 2, 0), canvas.shape[1] - width)
        y0 = min(max(middle[1] - height // 2 + step * (height + 2), 0), canvas.shape[0] - height)
        box = (x0, y0, x0 + width, y0 + height)
        if not any(box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3] for b in taken):
            return box
    return None
