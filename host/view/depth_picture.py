"""Depth, its sigma and, where the truth is known, its error: panels over the paled frame.

A region without depth is hatched, and its reason is told below the panels; a moving one is hatched both ways.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from host.depth.report import DepthReport, RegionDepth
from host.rbdn.snapshot import Region, Snapshot
from host.view.canvas import SUBPIXEL_BITS, caption_bar, enlarged, fixed_points
from host.view.colour_scale import RELATIVE_ERROR, RELATIVE_SIGMA, ColourScale
from host.view.depth_map import depth_map, depth_of
from host.view.labels import Label, write_labels
from host.view.palette import FAINT, INK, PANEL, PANEL_TEXT, PAPER, Colour, text_size, write

WIDTH_PX = 640  # of a panel, about
GAP_PX = 10
LETTERS = 0.45
LINE_PX = 20
REASON_LINES = 3  # kept free in every picture, so that all of a sequence are of one size
PALE = 0.7  # share of white over the frame where nothing is known
DETAIL = 0.5  # of the frame's texture that shines through the colours
DETAIL_PX = 3.0  # coarser than this is left to the colours, which would else not be the legend's
HATCH_PX = 14
HATCH: Colour = (168, 160, 152)
MOVING: Colour = (190, 40, 190)


def draw_depth(
    image: np.ndarray,
    snapshot: Snapshot,
    depths: DepthReport,
    scale: ColourScale,
    true_depth_cm: np.ndarray | None = None,
    caption: str = "",
) -> np.ndarray:
    """Draw one frame's depths.

    Parameters
    ----------
    image
        (H, W, 3) uint8, BGR; left as it is.
    snapshot, depths
        What the net and the depth estimators said of it.
    scale
        Colours of the depths, cm.
    true_depth_cm
        (H, W), 0 where nothing is; with it there is a third panel, the error of every pixel and each
        region's median.
    caption
        Written below the picture.

    Returns
    -------
    (H', W', 3) uint8, BGR, two or three panels of about 640 px side by side.
    """
    large, factor = enlarged(image, WIDTH_PX)
    found = depth_map(snapshot, depths, (image.shape[0], image.shape[1]), factor)

    def panel(values: np.ndarray, colours: ColourScale, title: str, text: Callable[[Region], str | None]):
        canvas = _coloured(large, values, colours)
        for k, region in enumerate(snapshot.regions):
            own = found.region == k
            if depth_of(region, depths).moving:
                _hatch(canvas, own, MOVING, both_ways=True)
            elif depth_of(region, depths).depth_cm is None:
                _hatch(canvas, own, HATCH)
        _outlines(canvas, snapshot, factor)
        write_labels(canvas, _labels(snapshot, depths, text), factor)
        return np.vstack([canvas, colours.legend(canvas.shape[1], title)])

    def depth_text(region: Region) -> str | None:
        depth = depth_of(region, depths).depth_cm
        return None if depth is None else f"{depth:.1f}" if depth < 99.95 else f"{depth:.0f}"

    def sigma_text(region: Region) -> str | None:
        depth = depth_of(region, depths)
        if depth.depth_cm is None or depth.sigma_cm is None:
            return None
        return f"{100 * depth.sigma_cm / depth.depth_cm:.1f} %"

    panels = [
        panel(found.depth_cm, scale, "depth, cm", depth_text),
        panel(found.relative_sigma, RELATIVE_SIGMA, "sigma / depth", sigma_text),
    ]
    if true_depth_cm is not None:
        truth = cv2.resize(true_depth_cm.astype(float), large.shape[1::-1], interpolation=cv2.INTER_NEAREST)
        truth[truth <= 0] = np.nan

        error = found.depth_cm / truth - 1

        errors = {region.id: error[found.region == k] for k, region in enumerate(snapshot.regions)}

        def error_text(region: Region) -> str | None:
            own = errors[region.id]
            return None if np.isnan(own).all() else f"{100 * np.nanmedian(own):+.1f} %"

        panels.append(panel(error, RELATIVE_ERROR, "error, far is red", error_text))
    gap = np.full((panels[0].shape[0], GAP_PX, 3), PAPER, np.uint8)
    row = np.hstack([part for one in panels for part in (gap, one)][1:])
    known = sum(depth_of(region, depths).depth_cm is not None for region in snapshot.regions)
    bar = caption_bar(row.shape[1], caption, f"{len(snapshot.regions)} regions, {known} with depth")
    return np.vstack([row, _reasons(row.shape[1], snapshot, depths), bar])


def _coloured(large: np.ndarray, values: np.ndarray, colours: ColourScale) -> np.ndarray:
    grey = cv2.cvtColor(large, cv2.COLOR_BGR2GRAY).astype(np.float32)
    detail = DETAIL * (grey - cv2.GaussianBlur(grey, (0, 0), DETAIL_PX))[..., None]
    pale = np.repeat((PALE * 255 + (1 - PALE) * grey)[..., None], 3, axis=2)
    known = np.isfinite(values)
    pale[known] = colours.colours(values[known])
    return np.clip(pale + np.where(known[..., None], detail, 0), 0, 255).astype(np.uint8)


def _hatch(canvas: np.ndarray, mask: np.ndarray, colour: Colour, both_ways: bool = False) -> None:
    rows, columns = np.nonzero(mask)
    line = (rows + columns) % HATCH_PX < 2
    if both_ways:
        line |= (rows - columns) % HATCH_PX < 2
    canvas[rows[line], columns[line]] = colour


def _outlines(canvas: np.ndarray, snapshot: Snapshot, factor: int) -> None:
    loops = [fixed_points(loop, factor) for region in snapshot.regions for loop in region.loops]
    cv2.polylines(canvas, loops, True, PANEL, 1, cv2.LINE_AA, SUBPIXEL_BITS)


def _labels(snapshot: Snapshot, depths: DepthReport, text: Callable[[Region], str | None]) -> list[Label]:
    out = []
    for region in snapshot.regions:
        words, moving = text(region), depth_of(region, depths).moving
        if moving:
            words = "moving" if words is None else f"{words} moving"
        known = words is not None
        out.append(
            Label(
                region,
                f"{region.id}: {words}" if known else f"{region.id}",
                PANEL_TEXT if known else FAINT,
                LETTERS if known else 0.85 * LETTERS,
            )
        )
    return out


def _reasons(width_px: int, snapshot: Snapshot, depths: DepthReport) -> np.ndarray:
    """The regions without depth, those of like reason together, in a strip that is always as high."""
    groups: dict[str, list[str]] = {}
    for region in sorted(snapshot.regions, key=lambda r: -r.area_px):
        depth = depth_of(region, depths)
        if depth.depth_cm is None:
            groups.setdefault(_reason(depth), []).append(str(region.id))
    strip = np.full((REASON_LINES * LINE_PX + 10, width_px, 3), PAPER, np.uint8)
    texts = [f"{', '.join(ids)}: {reason}" for reason, ids in groups.items()]
    lines, left_out = _in_lines("no depth   ", texts, width_px - 24)
    if left_out:
        lines[-1] += f"   and {left_out} more reasons"
    for k, line in enumerate(lines):
        write(strip, line, (12, 19 + k * LINE_PX), LETTERS, INK)
    return strip


def _reason(depth: RegionDepth) -> str:
    return depth.declined.get("outline") or depth.method_note or "the motion supports none yet"


def _in_lines(start: str, texts: list[str], width_px: int) -> tuple[list[str], int]:
    """Texts in at most REASON_LINES lines, and how many had no room."""
    if not texts:
        return [], 0
    more_px = text_size("   and 99 more reasons", LETTERS)[0]
    lines, empty = [start], True
    for k, text in enumerate(texts):
        last = len(lines) == REASON_LINES
        room_px = width_px - (more_px if last else 0)
        candidate = lines[-1] + ("" if empty else ";   ") + text
        if empty or text_size(candidate, LETTERS)[0] <= room_px:
            lines[-1], empty = candidate, False
        elif not last:
            lines.append(text)
        else:
            return lines, len(texts) - k
    return lines, 0
