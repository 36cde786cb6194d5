"""What is worth knowing again: what a frame shows of it, and which of the things known it may be.

Two kinds. A thing that stands free on the floor looks the same from all sides as far as its middle goes: half
way between its left and right outline lies its axis, nearly, for boxes, cylinders and balls alike; its height
and its tint stay too. And upright edges, where what they bound is cut by the picture's border: corners of the
room, doors, things too near to be seen whole.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from host.camera.lens import Lens
from host.depth.report import DepthReport
from host.nav.stand import usable_depth
from host.rbdn.snapshot import OUTSIDE, Region, Snapshot

LEAST_PX = 60.0  # a smaller region has no colour and no outline to rely on
WIDEST_CM = 60.0  # what is wider is a wall or a part of the floor
EDGE_PX = 2.0  # to the image border
SIGMA_SLOPE = 0.01  # of a foot's ray against the floor: the camera's pitch, mostly
MIDDLE_WIDTHS = 0.45  # a thing's middle behind its foot, in its widths
FOOT_SIGMA_WIDTHS = 0.25  # and how far that may be off
OUTLINE_SIGMA_WIDTHS = 0.15  # likewise the middle against where the outline is
AGREES = 3.0  # standard errors between foot and measured depth
SIGMA_EDGE_PX = 1.5  # of one side of an outline: in each frame a half, but it stays off alike for long
SIGMA_LOOK = 0.1  # a box seen from near has its middle off by so much of its width over its distance, squared
LEAST_EDGE_PX = 25.0  # a shorter upright edge is none
UPRIGHT = 0.06  # across over down, of an upright edge
BELOW_PX, BELOW_STEEP = 5.0, 0.87  # an outline that goes on down for so much, by over 60 degrees
SIGMA_UPRIGHT_CM = 1.0  # by which an edge that is seen may not be the same line of the thing

# how alike the same thing looks when it is seen again
SIGMA_TINT = 0.025  # of the shares of red and green
SIGMA_LIGHT = 0.3  # relative brightness: other side, other light
SIGMA_HEIGHT = 0.12  # relative
SIGMA_WIDTH = 0.3  # relative
UNLIKE = 14.0  # a sum of squares, looks and place, in standard errors, beyond which it is another thing
CLEARLY = 8.0  # by so much the best must beat the second

Key = int | tuple[int, int]  # how the net names it while it follows it: a region, or two with an edge between


@dataclass(frozen=True)
class Look:
    """What stays of it when it is seen from elsewhere.

    ``colours`` : red, green, blue of the thing, or of what is left and what is right of the edge, 0..255
    """

    colours: tuple[tuple[float, ...], ...]
    size_cm: tuple[float, float] | None = None  # height and width of a thing

    def unlike(self, other: Look) -> float:
        """Sum of squares of what differs, in standard errors; inf between a thing and an edge."""
        if len(self.colours) != len(other.colours):
            return math.inf
        total = sum(_unlike_colours(a, b) for a, b in zip(self.colours, other.colours, strict=True))
        if self.size_cm and other.size_cm:
            height, width = (math.log(a / b) for a, b in zip(self.size_cm, other.size_cm, strict=True))
            total += (height / SIGMA_HEIGHT) ** 2 + (width / SIGMA_WIDTH) ** 2
        return total

    def with_more(self, other: Look, share: float) -> Look:
        """The mean of both, ``share`` of it the other's."""

        def mean(a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, ...]:
            return tuple((1 - share) * p + share * q for p, q in zip(a, b, strict=True))

        colours = tuple(mean(a, b) for a, b in zip(self.colours, other.colours, strict=True))
        if self.size_cm is None or other.size_cm is None:
            return Look(colours)
        height, width = mean(self.size_cm, other.size_cm)
        return Look(colours, (height, width))


def _unlike_colours(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    light_a, light_b = sum(a) + 3.0, sum(b) + 3.0
    red, green = a[0] / light_a - b[0] / light_b, a[1] / light_a - b[1] / light_b
    return (red * red + green * green) / SIGMA_TINT**2 + (math.log(light_a / light_b) / SIGMA_LIGHT) ** 2


@dataclass(frozen=True)
class Sighting:
    """One thing or edge in one frame."""

    key: Key
    across: float  # X/Z of its middle
    sigma_across: float
    near: float  # 1/Z of its middle, 1/cm
    sigma_near: float
    look: Look


def sightings_of(
    snapshot: Snapshot, report: DepthReport, lens: Lens, camera_height_cm: float
) -> list[Sighting]:
    """What in a frame may be a landmark: it stands on the floor, and nothing says that it moves."""
    still = {r.id for r in snapshot.regions if r.id in report.regions and not report.regions[r.id].moving}
    whole = [r for r in snapshot.regions if not r.touches_border and r.area_px >= LEAST_PX and r.id in still]
    things = _things(whole, report, lens, camera_height_cm)
    return things + _edges(snapshot.regions, still, lens, camera_height_cm)


def _things(whole: list[Region], report: DepthReport, lens: Lens, camera_height_cm: float) -> list[Sighting]:
    if not whole:
        return []
    ends = np.empty((len(whole), 4, 2))
    for row, region in enumerate(whole):
        outline = region.loops[0]
        (left, top), (right, low) = outline.argmin(axis=0), outline.argmax(axis=0)
        ends[row] = outline[[left, right, top, low]]
    rays = lens.to_rays(ends.reshape(-1, 2)).reshape(-1, 4, 2)
    out = []
    for region, px, ray in zip(whole, ends.tolist(), rays.tolist(), strict=True):
        if not (px[0][0] > EDGE_PX and px[1][0] < lens.width - 1 - EDGE_PX):
            continue
        slope = ray[3][1]
        if slope < 2 * SIGMA_SLOPE:
            continue  # it does not stand where the floor can be seen
        middle = math.tan(0.5 * (math.atan(ray[0][0]) + math.atan(ray[1][0])))
        span, rise = ray[1][0] - ray[0][0], slope - ray[2][1]
        foot_cm = camera_height_cm / slope
        near = 1 / (foot_cm * (1 + MIDDLE_WIDTHS * span))
        sigma = math.hypot(SIGMA_SLOPE / camera_height_cm, FOOT_SIGMA_WIDTHS * span * near)
        measured = usable_depth(report, region.id)
        if measured is not None:
            at = report.regions[region.id].silhouette_cm or measured[0]
            other, sigma_other = 1 / at, math.hypot(measured[1] / at**2, OUTLINE_SIGMA_WIDTHS * span / at)
            if abs(near - other) > AGREES * math.hypot(sigma, sigma_other):
                continue  # it does not stand on the floor there, or something hides its foot
            share = sigma**2 / (sigma**2 + sigma_other**2)
            near = share * other + (1 - share) * near
            sigma = sigma * sigma_other / math.hypot(sigma, sigma_other)
        height, width = rise / near, span / near
        if width > WIDEST_CM or height <= 0:
            continue
        sigma_across = math.hypot(SIGMA_EDGE_PX / math.sqrt(2) / lens.fx, SIGMA_LOOK * span**2)
        look = Look((region.mean_rgb,), (height, width))
        out.append(Sighting(region.id, middle, sigma_across, near, sigma, look))
    return out


def _edges(
    regions: tuple[Region, ...], still: set[int], lens: Lens, camera_height_cm: float
) -> list[Sighting]:
    """Upright edges between two regions that both go on beyond the picture."""
    cut = {r.id: r for r in regions if r.touches_border and r.id in still}
    if not cut:
        return []
    owners = [region for region in cut.values() for _ in region.loops]
    loops = [loop for region in cut.values() for loop in region.loops]
    ends = np.cumsum([len(loop) for loop in loops])  # where the next one begins
    points = np.concatenate(loops)
    beyond = np.concatenate([ids for region in cut.values() for ids in region.loop_neighbours])
    after = np.arange(1, len(points) + 1)
    after[ends - 1] = np.concatenate([[0], ends[:-1]])
    step = points[after] - points
    # a region lies on the left of its outline where that goes up
    up = (
        (step[:, 1] < -LEAST_EDGE_PX) & (np.abs(step[:, 0]) < -2 * UPRIGHT * step[:, 1]) & (beyond != OUTSIDE)
    )
    at = np.flatnonzero(up)
    of = np.searchsorted(ends, at, side="right").tolist()
    found = [
        (owners[loop], cut[other], k)
        for loop, other, k in zip(of, beyond[at].tolist(), at.tolist(), strict=True)
        if other in cut
    ]
    if not found:
        return []
    lowest = np.array([k for _, _, k in found])
    rays = lens.to_rays(np.stack([points[lowest], points[after[lowest]]], axis=1)).reshape(-1, 2, 2)
    keys = [(left.id, right.id) for left, right, _ in found]
    out = []
    for (left, right, k), key, (low, top) in zip(found, keys, rays.tolist(), strict=True):
        slope = low[1]
        if keys.count(key) > 1 or slope < 2 * SIGMA_SLOPE:
            continue
        if abs(low[0] - top[0]) > UPRIGHT * (slope - top[1]):
            continue
        if slope > (lens.height - 1 - lens.cy) / lens.fy - EDGE_PX / lens.fy:
            continue  # its foot is below the picture
        if _goes_on_below(left, points[k], -1) or _goes_on_below(right, points[k], 1):
            continue  # one stands before the other: what is seen there is the other's foot
        near = slope / camera_height_cm
        across = 0.5 * (low[0] + top[0])
        sigma_across = math.hypot(SIGMA_EDGE_PX / lens.fx, SIGMA_UPRIGHT_CM * near)
        look = Look((left.mean_rgb, right.mean_rgb))
        out.append(Sighting(key, across, sigma_across, near, SIGMA_SLOPE / camera_height_cm, look))
    return out


def _goes_on_below(region: Region, low: np.ndarray, step: int) -> bool:
    """Whether a region's outline goes on downwards from the lower end of an edge."""
    for loop in region.loops:
        for at in np.flatnonzero((loop == low).all(axis=1)).tolist():
            for n in range(1, min(4, len(loop))):
                x, y = (loop[(at + n * step) % len(loop)] - low).tolist()
                if math.hypot(x, y) >= BELOW_PX:
                    if y > BELOW_STEEP * math.hypot(x, y):
                        return True
                    break
    return False


def recognise(unlike: np.ndarray) -> dict[int, int]:
    """Which sighting is which known thing: ``{row: column}`` where that is clear both ways.

    Parameters
    ----------
    unlike : (S, L) sums of squares, looks and place together, inf where out of the question
    """
    out = {}
    if not unlike.shape[1]:
        return out
    for row, column in enumerate(unlike.argmin(axis=1).tolist()):
        least = unlike[row, column]
        if not least < UNLIKE:
            continue
        rivals = np.concatenate([np.delete(unlike[row], column), np.delete(unlike[:, column], row)])
        if len(rivals) == 0 or rivals.min() > least + CLEARLY:
            out[row] = column
    return out
