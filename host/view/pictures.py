"""A camera frame with the net drawn over it and the depths written into the regions."""

from __future__ import annotations

import cv2
import numpy as np

from host.depth.report import DepthReport, RegionDepth
from host.rbdn.snapshot import Region, Snapshot
from host.view import ink

WIDTH_PX = 960  # small frames are enlarged by a whole factor to about this
SMALLEST_LABEL_SHARE = 0.001  # of the picture: regions smaller than this get no label
TINT = 0.16  # how much of a region's colour its pixels take on


def draw_frame(image: np.ndarray, snapshot: Snapshot, report: DepthReport | None, caption: str) -> np.ndarray:
    """The picture (kH, kW, 3) uint8 BGR of a frame (H, W, 3), enlarged by a whole factor k.

    Parameters
    ----------
    image
        (H, W, 3) uint8 BGR, the frame the snapshot was made of.
    report
        None where nothing is known of depth.
    caption
        One line of ASCII for the strip below the frame.
    """
    scale = max(1, round(WIDTH_PX / image.shape[1]))
    picture = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    tint = picture.copy()
    for region in snapshot.regions:
        ink.fill(tint, [_scaled(loop, scale) for loop in region.loops], ink.colour_of(region.id))
    picture = cv2.addWeighted(picture, 1 - TINT, tint, TINT, 0)
    for width, halo in ((4, True), (2, False)):
        for region in snapshot.regions:
            for loop in region.loops:
                colour = ink.DARK if halo else ink.colour_of(region.id)
                ink.polyline(picture, _scaled(loop, scale), colour, width, closed=True)
    for xy in _scaled(snapshot.vertices.xy_px, scale):
        ink.dot(picture, xy, 2.6, ink.DARK)
        ink.dot(picture, xy, 1.7, ink.LIGHT)
    _label_regions(picture, snapshot, report, scale)
    return np.vstack([picture, _strip(caption, picture.shape[1])])


def _scaled(points_px: np.ndarray, scale: int) -> np.ndarray:
    return (np.asarray(points_px, float) + 0.5) * scale - 0.5


def _label_regions(picture: np.ndarray, snapshot: Snapshot, report: DepthReport | None, scale: int) -> None:
    """Depths first and large regions first, each where there is most room in its region."""
    depths = {} if report is None else report.regions
    smallest = SMALLEST_LABEL_SHARE * picture.shape[0] * picture.shape[1] / scale**2
    wanted = [r for r in snapshot.regions if r.area_px >= smallest]
    wanted.sort(key=lambda r: (_depth_of(depths, r) is None, -r.area_px))
    taken = np.zeros(picture.shape[:2], bool)
    for region in wanted:
        depth = _depth_of(depths, region)
        if depth is None:
            lines, size = [f"#{region.id}"], 0.4
        else:
            lines, size = [f"{depth.depth_cm:.1f} ±{depth.sigma_cm:.1f} cm"], 0.5
        anchor = _roomiest_point(region, picture.shape[:2], scale)
        width, height = ink.box_size(lines, size)
        place = _free_place(taken, anchor, width, height, tries=0 if depth is None else 4)
        if place is None:
            continue
        left, top = place
        taken[max(top - 2, 0) : top + height + 2, max(left - 2, 0) : left + width + 2] = True
        if not (left <= anchor[0] < left + width and top <= anchor[1] < top + height):
            middle = np.array([left + width / 2, top + height / 2])
            ink.polyline(picture, np.array([anchor, middle]), ink.LIGHT, 1)
            ink.dot(picture, np.array(anchor), 3, ink.LIGHT)
        ink.box(picture, lines, left, top, ink.colour_of(region.id), size)


def _depth_of(depths: dict[int, RegionDepth], region: Region) -> RegionDepth | None:
    depth = depths.get(region.id)
    return None if depth is None or depth.depth_cm is None or depth.sigma_cm is None else depth


def _roomiest_point(region: Region, shape: tuple[int, int], scale: int) -> tuple[float, float]:
    """The point of the picture that lies farthest inside the region."""
    mask = np.zeros(
        (shape[0] // scale + 2, shape[1] // scale + 2), np.uint8
    )  # a rim, as beyond is not inside
    cv2.fillPoly(mask, [np.round(loop).astype(np.int32) + 1 for loop in region.loops], 1)
    mask[[0, -1]] = mask[:, [0, -1]] = 0
    y, x = np.unravel_index(int(cv2.distanceTransform(mask, cv2.DIST_L2, 3).argmax()), mask.shape)
    return (x - 0.5) * scale, (y - 0.5) * scale


def _free_place(
    taken: np.ndarray, anchor: tuple[float, float], width: int, height: int, tries: int
) -> tuple[int, int] | None:
    """Left and top of a box at or near the anchor that covers no other box; None where there is no room."""
    rows, columns = taken.shape
    steps = [(0, 0)]
    for far in range(1, tries + 1):
        steps += [
            (0, -far),
            (0, far),
            (-far, 0),
            (far, 0),
            (far, far),
            (-far, far),
            (far, -far),
            (-far, -far),
        ]
    for dx, dy in steps:
        left = round(anchor[0] - width / 2) + dx * (width // 2 + 6)
        top = round(anchor[1] - height / 2) + dy * (height + 6)
        left = min(max(left, 2), columns - width - 2)
        top = min(max(top, 2), rows - height - 2)
        if left >= 0 and top >= 0 and not taken[top : top + height, left : left + width].any():
            return left, top
    return None


def _strip(caption: str, width: int) -> np.ndarray:
    strip = np.full((26, width, 3), ink.DARK, np.uint8)
    ink.write(strip, caption, 10, 17, ink.LIGHT, 0.45)
    return strip
