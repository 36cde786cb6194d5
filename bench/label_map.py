"""A snapshot's regions as a label image, and how that overlaps with a true one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from host.rbdn import Region


def label_map(regions: Sequence[Region], shape: tuple[int, int]) -> np.ndarray:
    """Index into `regions` of the one that holds each pixel's centre, (H, W).

    Where refined outlines overlap or gape by a part of a pixel, it belongs to the smaller or the largest one.
    """
    height, width = shape
    order = sorted(range(len(regions)), key=lambda k: -regions[k].area_px)
    labels = np.full(shape, order[0])
    for index in order[1:]:
        flips = np.zeros(height * (width + 1), int)
        for loop in regions[index].loops:
            flips += _crossed_cells(loop, height, width)
        inside = np.cumsum(flips.reshape(height, width + 1), axis=1)[:, :width] & 1
        labels[inside == 1] = index
    return labels


def _crossed_cells(loop: np.ndarray, height: int, width: int) -> np.ndarray:
    """How often a closed outline crosses each row just before each pixel's centre, (H * (W + 1),)."""
    start, end = loop, np.roll(loop, -1, axis=0)
    up = (start[:, 1] > end[:, 1])[:, None]
    high, low = np.where(up, end, start), np.where(up, start, end)
    first, last = (np.clip(np.ceil(p[:, 1]), 0, height).astype(int) for p in (high, low))
    count = last - first
    edge = np.repeat(np.arange(len(loop)), count)
    row = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + first[edge]
    part = (row - high[edge, 1]) / (low[edge, 1] - high[edge, 1])
    across = high[edge, 0] + part * (low[edge, 0] - high[edge, 0])
    column = np.clip(np.ceil(across), 0, width).astype(int)
    return np.bincount(row * (width + 1) + column, minlength=height * (width + 1))


def overlaps(truth: np.ndarray, found: np.ndarray, true_count: int, found_count: int) -> np.ndarray:
    """Pixels that true label t and found label f share, (true_count, found_count)."""
    pairs = truth.ravel() * found_count + found.ravel()
    return np.bincount(pairs, minlength=true_count * found_count).reshape(true_count, found_count)


def iou_table(shared: np.ndarray) -> np.ndarray:
    """Intersection over union for a table of `overlaps`; 0 where both are empty."""
    union = shared.sum(1, keepdims=True) + shared.sum(0, keepdims=True) - shared
    return shared / np.maximum(union, 1)
