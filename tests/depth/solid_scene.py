"""Solid things in space as an ideal net would see them: outlines, ownership and occlusion without any image.

Every thing is convex and a region of its own. The outline of each is found in closed form; which region
lies on either side of each of its points is asked of the rays just inside and outside. Outlines err with
noise that is correlated along them, as those measured on images do; vertices err each on their own.
Snapshots cost a few milliseconds, so that many runs can be judged together.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

import cv2
import numpy as np
from board_scene import LENS

from host.camera.lens import Lens
from host.pose import Pose
from host.rbdn.snapshot import OUTSIDE, Contour, Event, Region, Snapshot, Vertices

FAR = 0  # region id of where no thing is
PIECE = 1000  # the second piece that is seen of a thing has an id so much higher
NEAR_CM = 2.0  # nothing nearer than this to the camera's plane is seen
PROBE_PX = 0.4  # how far beside an outline its two regions are asked for
ALONG_PX = 2.0  # Gaussian by which noise is smoothed along the outline: it is correlated over 4 px
CORRELATION_PX = 2 * ALONG_PX * np.sqrt(np.pi)  # of outline that err as one
BORDER_PX = 3.0  # no samples of outline nearer to the image border
CELL_PX = 4.0  # vertices are looked up by cells
SMALLEST_PX = 40.0  # regions smaller than this are not seen
SMOOTH, CUT = -1, -2  # in place of a corner's number: on an arc, and at the edge of what is looked at
RIM_POINTS = 96  # of a circle


@dataclass(frozen=True)
class Rim:
    """The outline of a convex thing in the camera's frame."""

    rays: np.ndarray  # (N, 2) = (X/Z, Y/Z), a closed polygon
    corner: np.ndarray  # (N,) number of the thing's corner there, or SMOOTH or CUT
    depth_cm: np.ndarray  # (N,) of the points


class Thing(Protocol):
    """Anything that can be looked at."""

    @property
    def id(self) -> int: ...
    def rim(self, pose: Pose) -> Rim | None: ...
    def depth(self, origin_cm: np.ndarray, rays: np.ndarray) -> np.ndarray: ...
    def moved(self, by_cm: tuple[float, float, float]) -> Thing: ...


@dataclass(frozen=True)
class Sheet:
    """A flat convex thing: a board, the face of a box, a wall, a floor."""

    id: int
    corners_cm: np.ndarray  # (C, 3) in world axes, in order

    def rim(self, pose: Pose) -> Rim | None:
        points = (self.corners_cm - pose.position_cm) @ pose.rotation
        corner = np.arange(len(points))
        if points[:, 2].min() < NEAR_CM:
            points, corner = _cut(points, corner, points[:, 2] - NEAR_CM)
        return None if len(points) < 3 else Rim(points[:, :2] / points[:, 2:], corner, points[:, 2])

    def depth(self, origin_cm: np.ndarray, rays: np.ndarray) -> np.ndarray:
        c = self.corners_cm
        normal = np.cross(c[1] - c[0], c[2] - c[0])
        with np.errstate(divide="ignore", invalid="ignore"):
            z = (normal @ (c[0] - origin_cm)) / (rays @ normal)
        hit = z > 0
        # on the inner side of every edge; the ray passes it where the edge's plane through the origin says
        out = c - origin_cm
        sides = np.cross(out, np.roll(out, -1, axis=0))
        sides *= np.sign(sides @ out.mean(axis=0))[:, None]
        return np.where(hit & (rays @ sides.T >= 0).all(axis=1), z, np.inf)

    def moved(self, by_cm: tuple[float, float, float]) -> Sheet:
        return replace(self, corners_cm=self.corners_cm + by_cm)


@dataclass(frozen=True)
class Block:
    """A box that is one region."""

    id: int
    centre_cm: np.ndarray  # (3,)
    size_cm: tuple[float, float, float]  # width, height, length
    turned_rad: float = 0.0  # about the vertical

    @property
    def axes(self) -> np.ndarray:
        """(3, 3), its own axes as columns."""
        c, s = np.cos(self.turned_rad), np.sin(self.turned_rad)
        return np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])

    @property
    def corners_cm(self) -> np.ndarray:
        """(8, 3)"""
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        return self.centre_cm + (signs * np.array(self.size_cm) / 2) @ self.axes.T

    def faces(self, first_id: int) -> list[Sheet]:
        """Its six sides as things of their own."""
        c = self.corners_cm
        loops = ((0, 2, 6, 4), (1, 3, 7, 5), (0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6))
        return [Sheet(first_id + k, c[list(loop)]) for k, loop in enumerate(loops)]

    def rim(self, pose: Pose) -> Rim | None:
        points = (self.corners_cm - pose.position_cm) @ pose.rotation
        if points[:, 2].min() < NEAR_CM:
            return None
        rays = points[:, :2] / points[:, 2:]
        hull = _hull(rays)
        return Rim(rays[hull], hull, points[hull, 2])

    def depth(self, origin_cm: np.ndarray, rays: np.ndarray) -> np.ndarray:
        start = (origin_cm - self.centre_cm) @ self.axes
        way = rays @ self.axes
        way = np.where(np.abs(way) < 1e-12, 1e-12, way)
        half = np.array(self.size_cm) / 2
        one, two = (-half - start) / way, (half - start) / way
        enter, leave = np.minimum(one, two).max(axis=1), np.maximum(one, two).min(axis=1)
        return np.where((enter < leave) & (enter > 0), enter, np.inf)

    def moved(self, by_cm: tuple[float, float, float]) -> Block:
        return replace(self, centre_cm=self.centre_cm + np.array(by_cm))


@dataclass(frozen=True)
class Ball:
    """A sphere."""

    id: int
    centre_cm: np.ndarray  # (3,)
    radius_cm: float

    def rim(self, pose: Pose) -> Rim | None:
        c = (self.centre_cm - pose.position_cm) @ pose.rotation
        far = float(np.linalg.norm(c))
        share = (self.radius_cm / far) ** 2
        if c[2] < self.radius_cm + NEAR_CM:
            return None
        across = np.cross(c, (0.0, 1.0, 0.0)) / far
        across /= np.linalg.norm(across)
        up = np.cross(across, c / far)
        a = np.linspace(0, 2 * np.pi, RIM_POINTS, endpoint=False)[:, None]
        points = c * (1 - share) + self.radius_cm * np.sqrt(1 - share) * (np.cos(a) * across + np.sin(a) * up)
        return Rim(points[:, :2] / points[:, 2:], np.full(RIM_POINTS, SMOOTH), points[:, 2])

    def depth(self, origin_cm: np.ndarray, rays: np.ndarray) -> np.ndarray:
        away = origin_cm - self.centre_cm
        a, b, c = (rays**2).sum(axis=1), rays @ away, away @ away - self.radius_cm**2
        root = b * b - a * c
        z = (-b - np.sqrt(np.maximum(root, 0))) / a
        return np.where((root > 0) & (z > 0), z, np.inf)

    def moved(self, by_cm: tuple[float, float, float]) -> Ball:
        return replace(self, centre_cm=self.centre_cm + np.array(by_cm))


@dataclass(frozen=True)
class Post:
    """An upright cylinder."""

    id: int
    centre_cm: np.ndarray  # (3,)
    radius_cm: float
    height_cm: float

    def rim(self, pose: Pose) -> Rim | None:
        a = np.linspace(0, 2 * np.pi, RIM_POINTS, endpoint=False)
        ring = np.column_stack([np.cos(a), np.zeros_like(a), np.sin(a)]) * self.radius_cm
        up = np.array([0.0, self.height_cm / 2, 0.0])
        points = np.concatenate([ring - up, ring + up]) + self.centre_cm
        points = (points - pose.position_cm) @ pose.rotation
        if points[:, 2].min() < NEAR_CM:
            return None
        rays = points[:, :2] / points[:, 2:]
        hull = _hull(rays)
        return Rim(rays[hull], np.full(len(hull), SMOOTH), points[hull, 2])

    def depth(self, origin_cm: np.ndarray, rays: np.ndarray) -> np.ndarray:
        away, half = origin_cm - self.centre_cm, self.height_cm / 2
        flat = np.array([1.0, 0.0, 1.0])
        a, b = (rays**2) @ flat, rays @ (away * flat)
        c = (away**2) @ flat - self.radius_cm**2
        root = b * b - a * c
        side = (-b - np.sqrt(np.maximum(root, 0))) / np.maximum(a, 1e-12)
        good = (root > 0) & (side > 0) & (np.abs(away[1] + side * rays[:, 1]) <= half)
        z = np.where(good, side, np.inf)
        for end in (-half, half):
            with np.errstate(divide="ignore", invalid="ignore"):
                cap = (end - away[1]) / rays[:, 1]
                at = away + cap[:, None] * rays
                inside = (cap > 0) & ((at**2) @ flat <= self.radius_cm**2)
            z = np.minimum(z, np.where(inside, cap, np.inf))
        return z

    def moved(self, by_cm: tuple[float, float, float]) -> Post:
        return replace(self, centre_cm=self.centre_cm + np.array(by_cm))


def board(
    id: int, centre_cm: tuple[float, float, float], size_cm: tuple[float, float], turned_rad: float = 0.0
) -> Sheet:
    """An upright board turned about the vertical, its right side away from the camera."""
    across = np.array([np.cos(turned_rad), 0.0, np.sin(turned_rad)]) * size_cm[0] / 2
    down = np.array([0.0, size_cm[1] / 2, 0.0])
    c = np.array(centre_cm)
    return Sheet(id, np.array([c - across - down, c + across - down, c + across + down, c - across + down]))


def patch(id: int, corners_cm: list[tuple[float, float, float]]) -> Sheet:
    """A flat thing by its corners."""
    return Sheet(id, np.array(corners_cm, float))


def room(
    first_id: int, depth_cm: float = 250.0, floor_cm: float = 14.0, half_width_cm: float = 130.0
) -> list[Sheet]:
    """Floor, back wall and two side walls around the way ahead."""
    x, top, behind = half_width_cm, -200.0, -100.0
    return [
        patch(
            first_id,
            [
                (-x, floor_cm, behind),
                (x, floor_cm, behind),
                (x, floor_cm, depth_cm),
                (-x, floor_cm, depth_cm),
            ],
        ),
        patch(
            first_id + 1,
            [(-x, top, depth_cm), (x, top, depth_cm), (x, floor_cm, depth_cm), (-x, floor_cm, depth_cm)],
        ),
        patch(
            first_id + 2,
            [(-x, top, behind), (-x, top, depth_cm), (-x, floor_cm, depth_cm), (-x, floor_cm, behind)],
        ),
        patch(
            first_id + 3,
            [(x, top, behind), (x, top, depth_cm), (x, floor_cm, depth_cm), (x, floor_cm, behind)],
        ),
    ]


@dataclass
class Eye:
    """Looks at things and hands out snapshots, numbered from 0."""

    things: list[Thing]
    lens: Lens = LENS
    noise_px: float = 0.0  # of the outline, along its normal
    vertex_noise_px: float = 0.0
    seed: int = 0
    _views: dict[tuple, View] = field(default_factory=dict)  # what was looked at before, by pose and things
    _truths: dict[tuple, dict[int, float]] = field(default_factory=dict)
    _kept: list[Thing] = field(default_factory=list)
    _names: dict[tuple, int] = field(default_factory=dict)  # of vertices, kept from frame to frame

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng(self.seed)
        self._seq = 0

    def again(self, seed: int) -> Eye:
        """One that errs otherwise, and need not find again what this one has found."""
        return replace(self, seed=seed)

    def look(self, pose: Pose, events: tuple[Event, ...] = ()) -> Snapshot:
        """The snapshot an ideal net would make from here."""
        key = self._key(pose)
        if key not in self._views:
            self._views[key] = self._view(pose)
        self._seq += 1
        return self._views[key].snapshot(
            self._seq - 1, events, self.noise_px, self.vertex_noise_px, self._rng
        )

    def truth(self, pose: Pose) -> dict[int, float]:
        """Mean depth of the visible surface of every thing in view, by region id."""
        key = self._key(pose)
        if key not in self._truths:
            columns, rows = np.arange(0.0, self.lens.width, 2.0), np.arange(0.0, self.lens.height, 2.0)
            z = self._depths(pose, np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2))
            nearest = np.where(np.isfinite(z.min(axis=0)), z.argmin(axis=0), -1)
            seen = [k for k in range(len(self.things)) if (nearest == k).any()]
            self._truths[key] = {self.things[k].id: float(z[k][nearest == k].mean()) for k in seen}
        return self._truths[key]

    def _key(self, pose: Pose) -> tuple:
        self._kept.extend(self.things)  # no other thing may get the id of one of them
        return (pose.rotation.tobytes(), pose.position_cm.tobytes(), *(id(t) for t in self.things))

    def corner_truth(self, pose: Pose) -> dict[int, float]:
        """Depth of every corner of every thing's outline, hidden or not, by vertex id."""
        out = {}
        for thing in self.things:
            rim = thing.rim(pose)
            for c, z in zip(rim.corner, rim.depth_cm, strict=True) if rim else ():
                if c >= 0:
                    out[self._name(("corner", thing.id, int(c)))] = float(z)
        return out

    def _name(self, key: tuple) -> int:
        return self._names.setdefault(key, len(self._names))

    def _depths(self, pose: Pose, points_px: np.ndarray) -> np.ndarray:
        """(T, N) depth of every thing at image points (N, 2)."""
        rays = np.column_stack([self.lens.to_rays(points_px), np.ones(len(points_px))]) @ pose.rotation.T
        return np.stack([t.depth(pose.position_cm, rays) for t in self.things])

    def _labels(self, pose: Pose, points_px: np.ndarray) -> np.ndarray:
        """(N,) region id at image points."""
        z = self._depths(pose, points_px)
        ids = np.array([t.id for t in self.things])
        return np.where(np.isfinite(z.min(axis=0)), ids[z.argmin(axis=0)], FAR)

    def _view(self, pose: Pose) -> View:
        chains, samples = self._chains(pose)
        corners = _Corners(self._name)
        by_region: dict[int, list[tuple[int, int]]] = {}
        for k, chain in enumerate(chains):
            by_region.setdefault(chain.inside, []).append((k, 0))
            if chain.beyond != OUTSIDE:
                by_region.setdefault(chain.beyond, []).append((k, 1))
        drafts: list[_Draft] = []
        pieces: dict[tuple[int, int], int] = {}  # region on either side of every chain
        for region_id in sorted(by_region):
            loops = _linked(chains, by_region[region_id])
            size = [_shoelace(_outline(chains, loop)) for loop in loops]
            outer = sorted((s, i) for i, s in enumerate(size) if s < -SMALLEST_PX)
            holes = [j for j, s in enumerate(size) if s > 0]
            for rank, (_, i) in enumerate(outer):
                # what a nearer thing cuts in two is two regions
                mine = [i, *holes] if rank == 0 else [i]
                name = region_id + PIECE * rank
                pieces.update({part: name for j in mine for part in loops[j]})
                area = -sum(size[j] for j in mine)
                drafts.append(_draft(name, area, chains, [loops[j] for j in mine], corners))
        return View(
            tuple(drafts),
            np.array([*corners.xy], np.int64),
            np.array([*corners.xy.values()]).reshape(-1, 2),
            np.array([*corners.sharp.values()], bool),
            *self._samples(chains, pieces),
            samples,
        )

    def _samples(self, chains: list[_Chain], pieces: dict[tuple[int, int], int]) -> tuple[np.ndarray, ...]:
        limit = np.array([self.lens.width, self.lens.height]) - 1 - BORDER_PX
        parts = [
            (np.zeros((0, 2)), np.zeros((0, 2)), *(np.zeros(0, np.int64),) * 2, np.zeros(0), np.zeros(0, int))
        ]
        for k, chain in enumerate(chains):
            if chain.beyond == OUTSIDE or (k, 0) not in pieces or (k, 1) not in pieces:
                continue
            keep = chain.sample & ((chain.xy_px > BORDER_PX) & (chain.xy_px < limit)).all(axis=1)
            n = int(keep.sum())
            sides = np.full(n, pieces[k, 0]), np.full(n, pieces[k, 1])
            parts.append(
                (chain.xy_px[keep], chain.normal[keep], *sides, chain.length_px[keep], chain.slot[keep])
            )
        return tuple(np.concatenate(p) for p in zip(*parts, strict=True))

    def _chains(self, pose: Pose) -> tuple[list[_Chain], int]:
        """Every stretch of outline between two regions or along the border, and how many samples in all."""
        strips = [s for t in self.things if (s := self._strip(t, pose)) is not None] + [self._frame()]
        all_xy, all_normal = (np.concatenate([getattr(s, a) for s in strips]) for a in ("xy_px", "normal"))
        label = self._labels(
            pose, np.concatenate([all_xy - PROBE_PX * all_normal, all_xy + PROBE_PX * all_normal])
        )
        inner, outer = np.split(label, 2)
        w, h = self.lens.width, self.lens.height
        chains, first = [], 0
        taken: dict[tuple[int, int], list[np.ndarray]] = {}
        for strip in strips:
            here = np.arange(first, first + len(strip.xy_px))
            first += len(here)
            inside, beyond, x, y = inner[here], outer[here], strip.xy_px[:, 0], strip.xy_px[:, 1]
            if strip.thing is None:
                good, beyond = np.ones(len(x), bool), np.full(len(x), OUTSIDE)
            else:
                good = (inside == strip.thing) & (beyond != inside)
                good &= (x > -0.5) & (x < w - 0.5) & (y > -0.5) & (y < h - 0.5)
                # an edge that two faces share is listed once
                for other in np.unique(beyond[good]):
                    for points in taken.get((int(other), strip.thing), ()):
                        mine = np.nonzero(good & (beyond == other))[0]
                        gap = np.abs(strip.xy_px[mine, None] - points[None]).sum(axis=2).min(axis=1)
                        good[mine[gap < 1.2]] = False
            key = np.where(good, beyond, -9)
            runs = _runs(key) if strip.thing is not None else _runs(inside)
            for run in runs:
                if not good[run[0]] or (len(run) < 3 and strip.thing is not None):
                    continue
                a, b = int(inside[run[0]]), int(beyond[run[0]])
                chains.append(strip.part(run, here[run], a, b))
                if strip.thing is not None:
                    taken.setdefault((a, b), []).append(strip.xy_px[run])
        return chains, first

    def _frame(self) -> _Strip:
        """The image border, seen from within."""
        w, h = self.lens.width - 0.5, self.lens.height - 0.5
        return _strip(np.array([[w, -0.5], [-0.5, -0.5], [-0.5, h], [w, h]]), np.arange(4), None, 4.0, 0.0)

    def _strip(self, thing: Thing, pose: Pose) -> _Strip | None:
        """The outline of a thing in the image, a sample a pixel."""
        rim = thing.rim(pose)
        if rim is None:
            return None
        lens = self.lens
        edge = lens.to_rays(np.array([[-20.0, -20.0], [lens.width + 20.0, lens.height + 20.0]]))
        rays, corner = rim.rays, rim.corner
        for axis in (0, 1):
            for sign, limit in ((1, edge[0, axis]), (-1, -edge[1, axis])):
                if (sign * rays[:, axis] < limit).any():
                    rays, corner = _cut(rays, corner, sign * rays[:, axis] - limit)
                    if len(rays) < 3:
                        return None
        if any(lens.distortion):
            rays, corner = _subdivided(rays, corner, 6.0 / lens.fx)
        xy = lens.to_pixels(rays)
        if _shoelace(xy) > 0:
            xy, corner = xy[::-1], corner[::-1]
        if abs(_shoelace(xy)) < 4.0:
            return None
        # samples do not sit on the same places of the thing from frame to frame
        return _strip(xy, corner, thing.id, 1.0, 0.2 + 0.6 * ((0.618 * (len(self._views) + thing.id)) % 1))


@dataclass(frozen=True)
class _Draft:
    """A region without the errors of its measurement."""

    id: int
    area_px: float
    around_px: float
    touches_border: bool
    nodes: tuple[np.ndarray, ...]  # vertex ids of every loop
    rows: tuple[np.ndarray, ...]  # of those vertices
    beyond: tuple[np.ndarray, ...]


@dataclass(frozen=True)
class View:
    """What there is to see from a place, without errors."""

    drafts: tuple[_Draft, ...]
    vertex_ids: np.ndarray
    vertex_px: np.ndarray
    sharp: np.ndarray  # bool, whether the vertex is well defined
    xy_px: np.ndarray  # of the samples of the outline, as in Contour
    normal: np.ndarray
    left: np.ndarray
    right: np.ndarray
    length_px: np.ndarray
    slot: np.ndarray  # place of each sample among all those of all outlines
    slots: int

    def snapshot(
        self,
        seq: int,
        events: tuple[Event, ...],
        noise_px: float,
        vertex_noise_px: float,
        rng: np.random.Generator,
    ) -> Snapshot:
        """With errors."""
        error = noise_px * _smooth_noise(self.slots, rng)[self.slot]
        vertices = self.vertex_px + rng.normal(0, vertex_noise_px, self.vertex_px.shape)
        ids, index = np.unique(np.concatenate([self.left, self.right]), return_inverse=True)
        swell = error * self.length_px
        grown = np.bincount(index, np.concatenate([swell, -swell]), len(ids))
        more = dict(zip(ids.tolist(), grown.tolist(), strict=True))
        regions = tuple(
            Region(
                d.id,
                None,
                0,
                d.area_px + more.get(d.id, 0.0),
                float(noise_px * np.sqrt(CORRELATION_PX * d.around_px)) + 0.5,
                d.touches_border,
                ((37 * d.id) % 211 + 20.0, (83 * d.id) % 211 + 20.0, (149 * d.id) % 211 + 20.0),
                tuple(vertices[r] for r in d.rows),
                d.nodes,
                d.beyond,
            )
            for d in self.drafts
        )
        contour = Contour(
            self.xy_px + error[:, None] * self.normal,
            self.normal,
            self.left,
            self.right,
            self.length_px,
            np.full(len(self.left), max(noise_px, 0.02)),
        )
        sigma = np.where(self.sharp, max(vertex_noise_px, 0.02), np.nan)
        return Snapshot(
            seq, regions, Vertices(self.vertex_ids, vertices, sigma), contour, events, 0, 0.0, 0.0
        )


@dataclass(frozen=True)
class _Chain:
    """A stretch of outline with one region on each side."""

    xy_px: np.ndarray  # (N, 2) without errors
    normal: np.ndarray  # (N, 2) away from the inside
    length_px: np.ndarray  # (N,)
    sample: np.ndarray  # (N,) bool, else it is there for the outline's shape only
    corner: np.ndarray  # (N,) number of the thing's corner, or SMOOTH
    slot: np.ndarray  # (N,) place among the points of all outlines
    thing: int | None  # whose outline it is, None for the image border
    inside: int
    beyond: int


@dataclass(frozen=True)
class _Strip:
    """A whole outline."""

    xy_px: np.ndarray
    normal: np.ndarray
    length_px: np.ndarray
    sample: np.ndarray
    corner: np.ndarray
    thing: int | None

    def part(self, rows: np.ndarray, slot: np.ndarray, inside: int, beyond: int) -> _Chain:
        arrays = (self.xy_px, self.normal, self.length_px, self.sample, self.corner)
        return _Chain(*(a[rows] for a in arrays), slot, self.thing, inside, beyond)


class _Corners:
    """The net's vertices of one frame: corners, points on arcs, and where three regions meet."""

    def __init__(self, name: Callable[[tuple], int]) -> None:
        self._name = name
        self.xy: dict[int, np.ndarray] = {}
        self.sharp: dict[int, bool] = {}
        self._near: dict[tuple[int, int], list[tuple[int, float, float]]] = {}  # by cells of CELL_PX
        self._met: list[tuple] = []

    def along(self, chain: _Chain) -> list[int]:
        """Vertex ids from the chain's start to its end, both included."""
        marked = np.nonzero((chain.corner >= 0) & ~chain.sample)[0]
        arcs = np.nonzero((chain.corner == SMOOTH) & ~chain.sample)[0]
        inner = np.sort(np.concatenate([marked, arcs[:: max(1, len(arcs) // 10)]])).tolist()
        last = len(chain.xy_px) - 1
        out = []
        for at in [0, *[i for i in inner if 0 < i < last], last]:
            vertex = self._at(chain, at, at in (0, last))
            if not out or out[-1] != vertex:
                out.append(vertex)
        return out

    def _at(self, chain: _Chain, at: int, end: bool) -> int:
        x, y = chain.xy_px[at].tolist()
        reach = 2.0 if end else 0.7
        column, row = int(x // CELL_PX), int(y // CELL_PX)
        for cell in ((column + i, row + j) for i in (-1, 0, 1) for j in (-1, 0, 1)):
            for vertex, there_x, there_y in self._near.get(cell, ()):
                if abs(there_x - x) + abs(there_y - y) < reach:
                    return vertex
        number = int(chain.corner[at])
        if number >= 0 and not chain.sample[at]:
            key: tuple = ("corner", chain.thing, number)
        elif end:
            meeting = (min(chain.inside, chain.beyond), max(chain.inside, chain.beyond), chain.thing)
            key = ("meeting", meeting, sum(m == meeting for m in self._met))
            self._met.append(meeting)
        else:
            key = ("arc", chain.thing, round(float(np.arctan2(*chain.normal[at])) * 4))
        vertex = self._name(key)
        while vertex in self.xy:
            key = (*key, "more")
            vertex = self._name(key)
        self._near.setdefault((column, row), []).append((vertex, x, y))
        self.xy[vertex] = np.array([x, y])
        self.sharp[vertex] = key[0] != "arc" and chain.thing is not None
        return vertex


def _draft(
    name: int, area: float, chains: list[_Chain], loops: list[list[tuple[int, int]]], corners: _Corners
) -> _Draft:
    nodes, beyond = [], []
    for loop in loops:
        ids: list[int] = []
        others: list[int] = []
        for k, side in loop:
            other = chains[k].beyond if side == 0 else chains[k].inside
            for vertex in corners.along(chains[k])[:: 1 if side == 0 else -1]:
                if ids and ids[-1] == vertex:
                    others[-1] = other
                else:
                    ids.append(vertex)
                    others.append(other)
        if len(ids) > 1 and ids[0] == ids[-1]:
            ids, others = ids[:-1], others[:-1]
        nodes.append(np.array(ids, np.int64))
        beyond.append(np.array(others, np.int64))
    row = {vertex: k for k, vertex in enumerate(corners.xy)}
    used = [chains[k] for loop in loops for k, _ in loop]
    around = float(sum(c.length_px.sum() for c in used))
    touches = any(c.beyond == OUTSIDE for c in used)
    rows = tuple(np.array([row[int(v)] for v in n]) for n in nodes)
    return _Draft(name, area, around, touches, tuple(nodes), rows, tuple(beyond))


def _linked(chains: list[_Chain], parts: list[tuple[int, int]]) -> list[list[tuple[int, int]]]:
    """Chains in order around a region, loop by loop; a part is a chain and one of its sides."""
    start = np.array([chains[k].xy_px[0 if side == 0 else -1] for k, side in parts])
    end = np.array([chains[k].xy_px[-1 if side == 0 else 0] for k, side in parts])
    gap = np.abs(end[:, None] - start[None]).sum(axis=2)
    free, loops = set(range(len(parts))), []
    while free:
        first = here = min(free)
        loop = []
        while True:
            free.discard(here)
            loop.append(parts[here])
            here = min((*free, first), key=lambda j: (gap[here, j], j))
            if here == first:
                break
        loops.append(loop)
    return loops


def _outline(chains: list[_Chain], loop: list[tuple[int, int]]) -> np.ndarray:
    return np.concatenate([chains[k].xy_px[:: 1 if side == 0 else -1] for k, side in loop])


def _runs(key: np.ndarray) -> list[np.ndarray]:
    """Rows of every stretch of equal keys around a closed outline."""
    cuts = np.nonzero(key != np.roll(key, 1))[0]
    if len(cuts) == 0:
        return [np.r_[np.arange(len(key)), 0]]
    pairs = zip(cuts, np.roll(cuts, -1), strict=True)
    return [np.arange(a, b if b > a else b + len(key)) % len(key) for a, b in pairs]


def _strip(xy: np.ndarray, corner: np.ndarray, thing: int | None, step_px: float, phase: float) -> _Strip:
    """Samples at even steps along a closed polygon, its corners among them."""
    side = np.roll(xy, -1, axis=0) - xy
    length = np.hypot(side[:, 0], side[:, 1])
    reach = np.concatenate([[0.0], np.cumsum(length)])
    at = np.arange(phase * step_px, reach[-1], step_px)
    which = np.minimum(np.searchsorted(reach, at, side="right") - 1, len(xy) - 1)
    points = xy[which] + ((at - reach[which]) / np.maximum(length[which], 1e-9))[:, None] * side[which]
    outward = np.column_stack([-side[:, 1], side[:, 0]]) / np.maximum(length, 1e-9)[:, None]
    bisector = outward + np.roll(outward, 1, axis=0)
    bisector /= np.maximum(np.hypot(bisector[:, 0], bisector[:, 1]), 1e-9)[:, None]
    order = np.argsort(np.concatenate([at, reach[:-1]]), kind="stable")
    n, m = len(at), len(xy)

    def merged(of_samples: np.ndarray, of_corners: np.ndarray) -> np.ndarray:
        return np.concatenate([of_samples, of_corners])[order]

    return _Strip(
        merged(points, xy),
        merged(outward[which], bisector),
        merged(np.full(n, reach[-1] / max(n, 1)), np.zeros(m)),
        merged(np.ones(n, bool), np.zeros(m, bool)),
        merged(np.full(n, CUT), corner),
        thing,
    )


def _smooth_noise(n: int, rng: np.random.Generator) -> np.ndarray:
    """(n,) of variance 1, correlated over about 4 neighbours."""
    m = 1 << max(n - 1, 1).bit_length()
    low_pass = np.exp(-0.5 * (2 * np.pi * ALONG_PX * np.fft.rfftfreq(m)) ** 2)
    noise = np.fft.irfft(np.fft.rfft(rng.normal(size=m)) * low_pass, m)
    return noise[:n] * np.sqrt(CORRELATION_PX)


def _cut(points: np.ndarray, corner: np.ndarray, room: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What of a convex polygon is where `room` >= 0."""
    out, names = [], []
    for k in range(len(points)):
        a, b = points[k], points[(k + 1) % len(points)]
        ra, rb = room[k], room[(k + 1) % len(points)]
        if ra >= 0:
            out.append(a)
            names.append(corner[k])
        if (ra >= 0) != (rb >= 0):
            out.append(a + ra / (ra - rb) * (b - a))
            names.append(CUT)
    return np.array(out).reshape(-1, points.shape[1]), np.array(names, int)


def _subdivided(points: np.ndarray, corner: np.ndarray, longest: float) -> tuple[np.ndarray, np.ndarray]:
    out, names = [], []
    for k, a in enumerate(points):
        b = points[(k + 1) % len(points)]
        n = int(np.linalg.norm(b - a) / longest) + 1
        out.append(a + np.arange(n)[:, None] / n * (b - a))
        names.append(np.r_[corner[k], np.full(n - 1, CUT)])
    return np.concatenate(out), np.concatenate(names)


def _hull(points: np.ndarray) -> np.ndarray:
    """Rows of the convex hull, in order."""
    return cv2.convexHull(points.astype(np.float32), returnPoints=False)[:, 0]


def _shoelace(p: np.ndarray) -> float:
    x, y = p[:, 0], p[:, 1]
    return float(0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
