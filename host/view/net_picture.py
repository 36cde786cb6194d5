"""A picture with the net over it: a camera frame with depths in its regions, or a still with its regions."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from host.depth.report import DepthReport, RegionDepth
from host.rbdn.snapshot import Region, Snapshot
from host.view.palette import (
    FAINT,
    PANEL,
    PANEL_TEXT,
    Colour,
    depth_text,
    region_colour,
    shade,
    text_size,
    write,
)

WIDTH_PX = 960  # small frames are enlarged to about this, so that letters stay readable
TINT = 0.15
STILL_TINT = 0.3
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
    canvas, scale = _enlarged(image)
    known = [region for region in snapshot.regions if _depth_of(region, depths).depth_cm is not None]
    _tint(canvas, known, TINT, scale)  # so that they stand out from the others
    _outlines(canvas, snapshot, scale)
    _write_labels(canvas, _depth_labels(snapshot, depths), scale)
    summary = f"{len(snapshot.regions)} regions, {len(known)} with depth"
    return np.vstack([canvas, _caption_bar(canvas.shape[1], caption, summary)])


def draw_regions(image: np.ndarray, snapshot: Snapshot, caption: str = "") -> np.ndarray:
    """Draw a still with each region in its colour and the larger ones with their ids.

    Parameters
    ----------
    image
        (H, W, 3) uint8, BGR; left as it is.
    snapshot
        What the net made of it.
    caption
        Written below the picture.

    Returns
    -------
    (H', W', 3) uint8, BGR, small images enlarged to about 960 px.
    """
    canvas, scale = _enlarged(image)
    _tint(canvas, list(snapshot.regions), STILL_TINT, scale)
    _outlines(canvas, snapshot, scale)
    labels = [_Label(region, str(region.id), PANEL_TEXT, 0.85 * LABEL_SCALE) for region in snapshot.regions]
    _write_labels(canvas, labels, scale)
    return np.vstack([canvas, _caption_bar(canvas.shape[1], caption, f"{len(snapshot.regions)} regions")])


@dataclass(frozen=True)
class _Label:
    region: Region
    text: str
    colour: Colour
    letters: float  # scale of the lettering
    always: bool = False  # also in a region too small to be named


def _enlarged(image: np.ndarray) -> tuple[np.ndarray, int]:
    scale = max(1, round(WIDTH_PX / image.shape[1]))
    return cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC), scale


def _outlines(canvas: np.ndarray, snapshot: Snapshot, scale: int) -> None:
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


def _points(loop: np.ndarray, scale: int) -> np.ndarray:
    """Image coordinates to those of the enlarged picture, in OpenCV's fixed point."""
    return np.round(((loop + 0.5) * scale - 0.5) * (1 << SUBPIXEL_BITS)).astype(np.int32).reshape(-1, 1, 2)


def _tint(canvas: np.ndarray, regions: list[Region], share: float, scale: int) -> None:
    layer, tinted = canvas.copy(), np.zeros(canvas.shape[:2], np.uint8)
    for region in sorted(regions, key=lambda r: -r.area_px):
        loops = [_points(loop, scale) for loop in region.loops]
        cv2.fillPoly(layer, loops, region_colour(region.id), cv2.LINE_8, SUBPIXEL_BITS)
        cv2.fillPoly(tinted, loops, 1, cv2.LINE_8, SUBPIXEL_BITS)
    blended = cv2.addWeighted(canvas, 1 - share, layer, share, 0)
    np.copyto(canvas, blended, where=tinted[..., None].astype(bool))


def _line(canvas: np.ndarray, loop: np.ndarray, scale: int, colour: tuple[int, int, int], width: int) -> None:
    cv2.polylines(canvas, [_points(loop, scale)], True, colour, width, cv2.LINE_AA, SUBPIXEL_BITS)


def _dot(canvas: np.ndarray, vertex: np.ndarray, scale: int) -> None:
    x, y = (int(v) for v in _points(vertex[None], scale).ravel())
    cv2.circle(canvas, (x, y), int(2.2 * (1 << SUBPIXEL_BITS)), PANEL, -1, cv2.LINE_AA, SUBPIXEL_BITS)
    cv2.circle(canvas, (x, y), int(1.4 * (1 << SUBPIXEL_BITS)), PANEL_TEXT, -1, cv2.LINE_AA, SUBPIXEL_BITS)


def _depth_of(region: Region, depths: DepthReport) -> RegionDepth:
    return depths.regions.get(region.id, RegionDepth(None, None, None, None))


def _depth_labels(snapshot: Snapshot, depths: DepthReport) -> list[_Label]:
    known, unknown = [], []
    for region in snapshot.regions:
        depth = _depth_of(region, depths)
        if depth.depth_cm is None:
            unknown.append(_Label(region, f"{region.id}", FAINT, 0.85 * LABEL_SCALE))
        else:
            text = f"{region.id}: {depth_text(depth.depth_cm, depth.sigma_cm)}"
            known.append(_Label(region, text, PANEL_TEXT, LABEL_SCALE, always=True))
    return known + unknown


def _write_labels(canvas: np.ndarray, labels: list[_Label], scale: int) -> None:
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


def _caption_bar(width: int, caption: str, summary: str) -> np.ndarray:
    bar = np.full((36, width, 3), PANEL, np.uint8)
    write(bar, caption, (12, 24), CAPTION_SCALE, PANEL_TEXT)
    write(bar, summary, (width - 12 - text_size(summary, CAPTION_SCALE)[0], 24), CAPTION_SCALE, FAINT)
    return bar
