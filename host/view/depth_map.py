"""A depth for every pixel: that of its region, along the region's slant where it has one."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from host.depth.report import DepthReport, RegionDepth
from host.rbdn.snapshot import Region, Snapshot
from host.view.canvas import SUBPIXEL_BITS, fixed_points

NEWTON_STEPS = 8
FLATTEST_SHARE = 0.2  # a slanted plane ends where its 1/Z has fallen to this share of its mean


@dataclass(frozen=True)
class DepthMap:
    """What regions and their depths say of every pixel of a frame, perhaps enlarged."""

    region: np.ndarray  # (H, W) index into the snapshot's regions, -1 for none
    depth_cm: np.ndarray  # (H, W), nan where the region has none
    relative_sigma: np.ndarray  # (H, W), likewise


def depth_map(snapshot: Snapshot, depths: DepthReport, shape: tuple[int, int], scale: int = 1) -> DepthMap:
    """Spread the regions' depths over their pixels.

    Parameters
    ----------
    snapshot, depths
        Of one frame.
    shape
        (height, width) of the frame.
    scale
        How many times larger the map is to be.
    """
    height, width = shape[0] * scale, shape[1] * scale
    owner = np.full((height, width), -1, np.int32)
    # Outlines are drawn with their pixels; of two that share one the smaller region keeps it.
    order = sorted(range(len(snapshot.regions)), key=lambda k: -snapshot.regions[k].area_px)
    for k in order:
        loops = [fixed_points(loop, scale) for loop in snapshot.regions[k].loops]
        cv2.fillPoly(owner, loops, k, cv2.LINE_8, SUBPIXEL_BITS)
    depth = np.full((height, width), np.nan)
    sigma = np.full((height, width), np.nan)
    for k, region in enumerate(snapshot.regions):
        found = depths.regions.get(region.id)
        if found is None or found.depth_cm is None:
            continue
        own = owner == k
        rows, columns = np.nonzero(own)
        places_px = (np.column_stack([columns, rows]) + 0.5) / scale - 0.5
        depth[own] = depths_at(found, places_px)
        if found.sigma_cm is not None:
            sigma[own] = found.sigma_cm / found.depth_cm
    return DepthMap(owner, depth, sigma)


def depths_at(found: RegionDepth, places_px: np.ndarray) -> np.ndarray:
    """Depths (N,) of a region with a depth at all places (N, 2) that it covers.

    On a slanted region they lie on the plane 1/Z = a + b x + c y whose slope is the region's and whose mean
    depth over the places is the region's depth; elsewhere all are equal.
    """
    assert found.depth_cm is not None
    if found.slope is None or len(places_px) == 0:
        return np.full(len(places_px), found.depth_cm)
    fall = (places_px - places_px.mean(axis=0)) @ np.array(found.slope)
    inverse = 1 / found.depth_cm
    for _ in range(NEWTON_STEPS):
        plane = np.maximum(inverse + fall, FLATTEST_SHARE * inverse)
        excess = (1 / plane).mean() - found.depth_cm
        inverse += excess / (1 / plane**2).mean()
    return 1 / np.maximum(inverse + fall, FLATTEST_SHARE * inverse)


def depth_of(region: Region, depths: DepthReport) -> RegionDepth:
    """What is known of a region; nothing where the report leaves it out."""
    return depths.regions.get(region.id, RegionDepth(None, None, None, "not estimated in this frame"))
