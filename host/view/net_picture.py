"""A camera frame with the net over it and depths written into the regions."""

from __future__ import annotations

import cv2
import numpy as np

from host.depth.report import DepthReport, RegionDepth
from host.rbdn.snapshot import Region, Snapshot
from host.view.palette import (
    FAINT,
    PANEL,
    PANEL_TEXT,
    depth_text,
    region_colour,
    shade,
    text_size,
    write,
)

WIDTH_PX = 960  # small frames are enlarged to about this, so that letters stay readable
TINT = 0.15
SUBPIXEL_BITS = 4
LABEL_SCALE = 0.55
CAPTION_SCALE = 0.55
MARGIN_PX = 6
NAMED_AREA_SHARE = 0.004  # regions without depth are named only where they are larger

Box = tuple[int, int, int, int]  # x0, y0, x1, y1


def draw_net(image: np.ndarray, snapshot: Snapshot, depths: DepthReport, caption: str = "") -> np.ndarray:
    """Draw one frame.

    Parameters
    ----------
    image
        (H, W, 3) uint8, BGR; left as it is.
    snapshot, depths
        What the net and the depth estimators said of it.
    caption
        Written below the picture.

    Returns
    -------
    (H', W', 3) uint8, BGR, about 960 px wide.
    """
    scale = max(1, round(WIDTH_PX / image.shape[1]))
    canvas = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    _tint(canvas, snapshot, depths, scale)
    for region in snapshot.regions:
        for loop in region.loops:
            _line(canvas, loop, scale, PANEL, 4)
    # Of two regions that share an edge the smaller gives it its colour: things stand out from what is behind.
    for region in sorted(snapshot.regions, key=lambda r: -r.area_px):
        for loop in region.loops:
            _line(canvas, loop, scale, region_colour(region.id), 2)
    for region in snapshot.regions:
        for loop in region.loops:
            for vertex in loop:
                _dot(canvas, vertex, scale)
    _labels(canvas, snapshot, depths, scale)
    return np.vstack([canvas, _caption(canvas.shape[1], caption, snapshot, depths)])


def _points(loop: np.ndarray, scale: int) -> np.ndarray:
    """Image coordinates to those of the enlarged picture, in OpenCV's fixed point."""
    return np.round(((loop + 0.5) * scale - 0.5) * (1 << SUBPIXEL_BITS)).astype(np.int32).reshape(-1, 1, 2)


def _tint(canvas: np.ndarray, snapshot: Snapshot, depths: DepthReport, scale: int) -> None:
    """Regions with a depth are coloured in, so that they stand out from the others."""
    layer, known = canvas.copy(), np.zeros(canvas.shape[:2], np.uint8)
    for region in snapshot.regions:
        if _depth_of(region, depths).depth_cm is None:
            continue
        loops = [_points(loop, scale) for loop in region.loops]
        cv2.fillPoly(layer, loops, region_colour(region.id), cv2.LINE_8, SUBPIXEL_BITS)
        cv2.fillPoly(known, loops, 1, cv2.LINE_8, SUBPIXEL_BITS)
    blended = cv2.addWeighted(canvas, 1 - TINT, layer, TINT, 0)
    np.copyto(canvas, blended, where=known[..., None].astype(bool))


def _line(canvas: np.ndarray, loop: np.ndarray, scale: int, colour: tuple[int, int, int], width: int) -> None:
    cv2.polylines(canvas, [_points(loop, scale)], True, colour, width, cv2.LINE_AA, SUBPIXEL_BITS)


def _dot(canvas: np.ndarray, vertex: np.ndarray, scale: int) -> None:
    x, y = (int(v) for v in _points(vertex[None], scale).ravel())
    cv2.circle(canvas, (x, y), int(2.2 * (1 << SUBPIXEL_BITS)), PANEL, -1, cv2.LINE_AA, SUBPIXEL_BITS)
    cv2.circle(canvas, (x, y), int(1.4 * (1 << SUBPIXEL_BITS)), PANEL_TEXT, -1, cv2.LINE_AA, SUBPIXEL_BITS)


def _depth_of(region: Region, depths: DepthReport) -> RegionDepth:
    return depths.regions.get(region.id, RegionDepth(None, None, None, None))


def _labels(canvas: np.ndarray, snapshot: Snapshot, depths: DepthReport, scale: int) -> None:
    """Depths first, from the largest region down; a label that would cover another is moved or left out."""
    taken: list[Box] = []
    order = sorted(snapshot.regions, key=lambda r: (_depth_of(r, depths).depth_cm is None, -r.area_px))
    smallest = NAMED_AREA_SHARE * canvas.shape[0] * canvas.shape[1] / scale**2
    for region in order:
        depth = _depth_of(region, depths)
        if depth.depth_cm is None:
            if region.area_px < smallest:
                continue
            text, colour, letters = f"{region.id}", FAINT, 0.85 * LABEL_SCALE
        else:
            text = f"{region.id}: {depth_text(depth.depth_cm, depth.sigma_cm)}"
            colour, letters = PANEL_TEXT, LABEL_SCALE
        box = _place(canvas, _middle(region, scale), text_size(text, letters), taken)
        if box is None:
            continue
        taken.append(box)
        shade(canvas, box, PANEL, 0.78)
        x0, y0, _, y1 = box
        cv2.rectangle(canvas, (x0, y0), (x0 + 3, y1 - 1), region_colour(region.id), -1)
        write(canvas, text, (x0 + 4 + MARGIN_PX, y1 - MARGIN_PX), letters, colour)


def _middle(region: Region, scale: int) -> tuple[int, int]:
    """The place in the region farthest from its outline, in the enlarged picture."""
    outer = region.loops[0]
    low = np.floor(outer.min(axis=0)).astype(int) - 1
    width, height = np.ceil(outer.max(axis=0)).astype(int) - low + 2
    mask = np.zeros((height, width), np.uint8)
    loops = [np.round(loop - low).astype(np.int32).reshape(-1, 1, 2) for loop in region.loops]
    cv2.fillPoly(mask, loops, 1)
    _, _, _, (x, y) = cv2.minMaxLoc(cv2.distanceTransform(mask, cv2.DIST_L2, 3))
    return round((x + low[0] + 0.5) * scale), round((y + low[1] + 0.5) * scale)


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


def _caption(width: int, caption: str, snapshot: Snapshot, depths: DepthReport) -> np.ndarray:
    bar = np.full((36, width, 3), PANEL, np.uint8)
    known = sum(_depth_of(region, depths).depth_cm is not None for region in snapshot.regions)
    summary = f"{len(snapshot.regions)} regions, {known} with depth"
    write(bar, caption, (12, 24), CAPTION_SCALE, PANEL_TEXT)
    write(bar, summary, (width - 12 - text_size(summary, CAPTION_SCALE)[0], 24), CAPTION_SCALE, FAINT)
    return bar
