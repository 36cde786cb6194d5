"""What of the net may be set, with the values that worked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from host.ranges import check_ranges

Mode = Literal["ours", "paper"]
RANGES = {
    "square_px": (4, 200),
    "merge_distance": (1, 200),
    "rgb_distance": (1, 450),
    "lightness_weight": (0, 1),
    "min_area_px": (1, 1e6),
    "min_width_px": (0, 100),
    "start_reach_px": (2, 20),
    "track_reach_px": (2, 20),
    "start_cycles": (1, 1000),
    "track_cycles": (1, 1000),
    "group_step": (0, 200),
    "keep_step": (0, 200),
    "refresh_frames": (0, 100000),
    "max_polygons": (0, 1000000),
    "max_ms": (0, 1e6),
}


@dataclass(frozen=True)
class NetConfig:
    """Settings of the deformable net. Lengths in pixels, colours in discounted CIELAB units."""

    mode: Mode = "ours"
    """Whose rules the net follows: ours, or those of the paper to the letter, to compare the two."""
    square_px: int = 16
    """Side of the initial squares (Fig. 2)."""
    merge_distance: float = 7.5
    """Colours nearer than this belong to one polygon (eta of the paper)."""
    rgb_distance: float = 30.0
    """The same in the paper's mode, which compares RGB levels of 0 to 255."""
    lightness_weight: float = 0.3
    """How much lightness counts beside hue; low, so that an object's own shading does not split it."""
    min_area_px: float = 200.0
    """Polygons smaller than this join a neighbour."""
    min_width_px: float = 2.5
    """Polygons thinner than this join a neighbour."""
    start_reach_px: int = 8
    """Depth of the sensitivity regions on the first frame (w of the paper)."""
    track_reach_px: int = 12
    """The same while tracking, where it bounds how far an edge may move between frames."""
    start_cycles: int = 60
    """Most deformation cycles on the first frame."""
    track_cycles: int = 16
    """Most deformation cycles on later frames."""
    group_step: float = 8.0
    """Neighbouring polygons are one region where the colour steps less than this across their common edge."""
    keep_step: float = 12.0
    """Polygons that are one region part only above this step."""
    refresh_frames: int = 5
    """Every so many frames the net is drawn anew from its own regions, for worn-off corners; 0: never."""
    max_polygons: int = 0
    """Most polygons; beyond, those nearest in colour are merged however far apart they are; 0: any number."""
    max_ms: float = 0.0
    """Most ms to fit a frame; the rest is left to the next. Where it acts, results vary; 0: any time."""

    def __post_init__(self) -> None:
        if self.mode not in get_args(Mode):
            raise ValueError(f"mode = {self.mode!r} is not one of {', '.join(map(repr, get_args(Mode)))}")
        check_ranges(self, RANGES)
