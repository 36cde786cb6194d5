"""A picture with the net over it: a camera frame with depths in its regions, or a still with its regions."""

from __future__ import annotations

import cv2
import numpy as np

from host.depth.report import DepthReport, RegionDepth
from host.rbdn.snapshot import Region, Snapshot
from host.view.canvas import SUBPIXEL_BITS, caption_bar, enlarged, fixed_points
from host.view.labels import Label, write_labels
from host.view.palette import FAINT, PANEL, PANEL_TEXT, depth_text, region_colour

WIDTH_PX = 960  # small frames are enlarged to about this, so that letters stay readable
TINT = 0.15
STILL_TINT = 0.3
LABEL_SCALE = 0.55


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
    canvas, scale = enlarged(image, WIDTH_PX)
    known = [region for region in snapshot.regions if _depth_of(region, depths).depth_cm is not None]
    _tint(canvas, known, TINT, scale)  # so that they stand out from the others
    _outlines(canvas, snapshot, scale)
    write_labels(canvas, _depth_labels(snapshot, depths), scale)
    summary = f"{len(snapshot.regions)} regions, {len(known)} with depth"
    return np.vstack([canvas, caption_bar(canvas.shape[1], caption, summary)])


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
    canvas, scale = enlarged(image, WIDTH_PX)
    _tint(canvas, list(snapshot.regions), STILL_TINT, scale)
    _outlines(canvas, snapshot, scale)
    labels = [Label(region, str(region.id), PANEL_TEXT, 0.85 * LABEL_SCALE) for region in snapshot.regions]
    write_labels(canvas, labels, scale)
    return np.vstack([canvas, caption_bar(canvas.shape[1], caption, f"{len(snapshot.regions)} regions")])


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


def _tint(canvas: np.ndarray, regions: list[Region], share: float, scale: int) -> None:
    layer, tinted = canvas.copy(), np.zeros(canvas.shape[:2], np.uint8)
    for region in sorted(regions, key=lambda r: -r.area_px):
        loops = [fixed_points(loop, scale) for loop in region.loops]
        cv2.fillPoly(layer, loops, region_colour(region.id), cv2.LINE_8, SUBPIXEL_BITS)
        cv2.fillPoly(tinted, loops, 1, cv2.LINE_8, SUBPIXEL_BITS)
    blended = cv2.addWeighted(canvas, 1 - share, layer, share, 0)
    np.copyto(canvas, blended, where=tinted[..., None].astype(bool))


def _line(canvas: np.ndarray, loop: np.ndarray, scale: int, colour: tuple[int, int, int], width: int) -> None:
    cv2.polylines(canvas, [fixed_points(loop, scale)], True, colour, width, cv2.LINE_AA, SUBPIXEL_BITS)


def _dot(canvas: np.ndarray, vertex: np.ndarray, scale: int) -> None:
    x, y = (int(v) for v in fixed_points(vertex[None], scale).ravel())
    cv2.circle(canvas, (x, y), int(2.2 * (1 << SUBPIXEL_BITS)), PANEL, -1, cv2.LINE_AA, SUBPIXEL_BITS)
    cv2.circle(canvas, (x, y), int(1.4 * (1 << SUBPIXEL_BITS)), PANEL_TEXT, -1, cv2.LINE_AA, SUBPIXEL_BITS)


def _depth_of(region: Region, depths: DepthReport) -> RegionDepth:
    return depths.regions.get(region.id, RegionDepth(None, None, None, None))


def _depth_labels(snapshot: Snapshot, depths: DepthReport) -> list[Label]:
    known, unknown = [], []
    for region in snapshot.regions:
        depth = _depth_of(region, depths)
        if depth.depth_cm is None:
            unknown.append(Label(region, f"{region.id}", FAINT, 0.85 * LABEL_SCALE))
        else:
            text = f"{region.id}: {depth_text(depth.depth_cm, depth.sigma_cm)}"
            known.append(Label(region, text, PANEL_TEXT, LABEL_SCALE, always=True))
    return known + unknown
