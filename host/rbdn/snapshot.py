"""What the net says of one frame: regions, vertices and sub-pixel contour, as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

OUTSIDE = -1  # region id of what lies beyond the image border


@dataclass(frozen=True)
class Region:
    """One region of the image. Coordinates in pixels, integer = pixel centre, x right, y down."""

    id: int  # kept from frame to frame
    parent: int | None  # the region it came out of when it was new, if any
    born_seq: int  # frame in which the id first appeared, or came back
    area_px: float  # soft area, sub-pixel
    sigma_area_px: float  # its standard error
    touches_border: bool
    mean_rgb: tuple[float, float, float]  # 0..255
    loops: tuple[np.ndarray, ...]  # each (N, 2) float64; outer loop first, then holes
    loop_vertices: tuple[np.ndarray, ...]  # each (N,) int64: id of the net's vertex at each loop point
    loop_neighbours: tuple[np.ndarray, ...]  # each (N,) int64: region beyond the edge from point k to k+1


@dataclass(frozen=True)
class Vertices:
    """The net's vertices, one row each."""

    ids: np.ndarray  # (N,) int64, kept from frame to frame
    xy_px: np.ndarray  # (N, 2) float64, refined
    sigma_px: np.ndarray  # (N,) float64, nan where the corner is not well defined


@dataclass(frozen=True)
class Contour:
    """Sub-pixel samples of every edge between two regions, about one a pixel."""

    xy_px: np.ndarray  # (M, 2) float64
    normal: np.ndarray  # (M, 2) float64, unit, pointing from the left region into the right one
    left: np.ndarray  # (M,) int64 region id
    right: np.ndarray  # (M,) int64 region id
    length_px: np.ndarray  # (M,) float64, stretch of outline the sample stands for
    sigma_px: np.ndarray  # (M,) float64, standard error along the normal


@dataclass(frozen=True)
class Event:
    """A change in the set of regions after the first frame.

    ``birth``: something new in the picture; `parent` is the region in which it appeared, None where a turn of
    the camera brought it in. ``split``: a part of `parent` that fell off, or was told apart from it only now.
    ``merge``: its pixels became part of `parent`. ``end``: it left the image, was hidden, or shrank to less
    than is worth following; `parent` is None. ``return``: one that ended or merged a while ago is seen again,
    known by its colour and place; `parent` is the region in which it appeared.
    """

    kind: str  # "birth", "split", "merge", "end" or "return"
    id: int
    parent: int | None


@dataclass(frozen=True)
class Snapshot:
    """The net after one frame. Nothing in it changes when the net moves on."""

    seq: int
    regions: tuple[Region, ...]
    vertices: Vertices
    contour: Contour
    events: tuple[Event, ...]
    cycles: int  # deformation cycles this frame took
    net_ms: float
    refine_ms: float
    limits: tuple[str, ...] = ()  # budgets of the configuration that acted in this frame, in words
