"""What of the net may be set, with the values that worked."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NetConfig:
    """Settings of the deformable net. Lengths in pixels, colours in the net's colour units."""

    square_px: int = 16  # side of the initial squares
    merge_distance: float = 14.0  # eta of the paper: colours nearer than this are one region
    min_area_px: float = 200.0  # smaller polygons are merged into a neighbour
