"""The net's face: images in, snapshots out."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict

import numpy as np

from host.camera.lens import Lens
from host.errors import InputError
from host.rbdn import _core
from host.rbdn.config import NetConfig
from host.rbdn.snapshot import OUTSIDE, Contour, Event, Region, Snapshot, Vertices

SMALLEST_IMAGE_PX = 32
TURN_STEP_PX = 8  # between the pixels whose turn is worked out
NO_ROTATION = 1e-3  # error of a rotation's matrix that is more than rounding
STEADY_PX = 3.0  # a turn that moves pixels less than this is left to the forces


class Net:
    """Segments the first image it is given and follows the regions through the next ones.

    Parameters
    ----------
    config
        Settings of the net.
    lens
        Needed only where `track` is told of the camera's rotation.
    """

    def __init__(self, config: NetConfig | None = None, lens: Lens | None = None) -> None:
        self._config = config or NetConfig()
        self._lens = lens
        self._core = _core.NetCore(_core_config(self._config))
        self._seq = 0
        self._shape: tuple[int, ...] | None = None
        self._origins: dict[int, tuple[int, int | None]] = {}  # of every region: seq of its birth, parent

    def track(
        self,
        image: np.ndarray,
        rotation: np.ndarray | None = None,
        displacement: Mapping[int, tuple[float, float]] | None = None,
    ) -> Snapshot:
        """Fit the net to the next image.

        Parameters
        ----------
        image
            (H, W, 3) uint8, BGR, of the same size at every call.
        rotation
            (3, 3), how the camera turned since the last image: ``X_last = rotation @ X_now``. Used before the
            first cycle where it moves pixels by more than a few.
        displacement
            By region id, how many pixels (right, down) it is expected to have moved since the last image, the
            rotation left out. Its outline is put there before the first cycle; an edge between two regions
            goes with the one that moves more. Without it, a thing that leaves its last place altogether from
            one image to the next is lost. Ids that are no more are passed over.

        Raises
        ------
        InputError
            for an image of another kind or size, a matrix that is no rotation, a rotation without a lens or
            with one of another size, or a displacement that is no pair of finite numbers.
        """
        self._check(image)
        self._check_rotation(rotation, image)
        begin = time.perf_counter()
        image = np.ascontiguousarray(image)
        self._displace(displacement or {})
        source = self._turned_from(rotation)
        self._core.track(image, source)
        net_ms = 1e3 * (time.perf_counter() - begin)
        begin = time.perf_counter()
        fine = self._core.refine(image)
        snapshot = self._snapshot(fine, net_ms, begin)
        self._seq += 1
        return snapshot

    def faults(self) -> list[int]:
        """Edges that break the net's planarity; empty unless there is a bug."""
        return self._core.faults()

    def faces(self) -> dict[str, np.ndarray]:
        """The polygons behind the regions, not refined.

        Vertices with their ids, edges (a, b, left, right), and of every polygon its mean, area and region id
        as of the last image; the label image.
        """
        return self._core.faces()

    def _check(self, image: np.ndarray) -> None:
        if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
            raise InputError(f"the net takes (H, W, 3) uint8 images, not {image.shape} {image.dtype}")
        if min(image.shape[:2]) < SMALLEST_IMAGE_PX:
            raise InputError(
                f"image of {image.shape[1]}x{image.shape[0]} px is too small for the net: "
                f"give at least {SMALLEST_IMAGE_PX} px a side"
            )
        if self._shape is not None and image.shape != self._shape:
            raise InputError(
                f"image of {image.shape[1]}x{image.shape[0]} px follows one of "
                f"{self._shape[1]}x{self._shape[0]}: a net keeps one size, start another net"
            )
        self._shape = image.shape

    def _check_rotation(self, rotation: np.ndarray | None, image: np.ndarray) -> None:
        if rotation is None:
            return
        lens = self._lens
        if lens is None:
            raise InputError("a rotation is of no use without a lens: give one to the net")
        if (lens.height, lens.width) != image.shape[:2]:
            raise InputError(
                f"the lens is for {lens.width}x{lens.height} px, the image has "
                f"{image.shape[1]}x{image.shape[0]}: give the lens of this camera"
            )
        matrix = np.asarray(rotation)
        if matrix.shape != (3, 3) or matrix.dtype.kind not in "fiu":
            raise InputError(f"a rotation is a matrix of (3, 3) numbers, not {matrix.shape} {matrix.dtype}")
        # The product is written out, since a threaded one would keep the robot's other cores spinning.
        product = (matrix[:, None, :] * matrix[None, :, :]).sum(2)
        if not (np.abs(product - np.eye(3)) < NO_ROTATION).all() or np.linalg.det(matrix) < 0:
            raise InputError(f"{matrix.tolist()} is no rotation: give unit rows at right angles")

    def _displace(self, displacement: Mapping[int, tuple[float, float]]) -> None:
        known = {region: by for region, by in displacement.items() if region in self._origins}
        for region, by in known.items():
            if np.shape(by) != (2,):
                raise InputError(f"displacement of region {region} is {by}: give (dx, dy) in pixels")
        by_px = np.array(list(known.values()), float).reshape(-1, 2)
        if not np.isfinite(by_px).all():
            region = list(known)[int(np.argmin(np.isfinite(by_px).all(1)))]
            raise InputError(f"displacement of region {region} is {known[region]}: give finite pixels")
        if len(known) > 0:
            self._core.displace(np.array(list(known), np.int64), by_px)

    def _turned_from(self, rotation: np.ndarray | None) -> np.ndarray:
        """For every pixel the pixel of the last image that the rotation brought there, -1 for none."""
        none = np.zeros(0, np.int32)
        if rotation is None or self._lens is None or self._seq == 0:
            return none
        lens = self._lens
        corners = np.array(
            [[0, 0], [lens.width - 1, 0], [0, lens.height - 1], [lens.width - 1, lens.height - 1]]
        )
        if np.abs(_turn(lens, corners, rotation) - corners).max() < STEADY_PX:
            return none
        turned = np.rint(_turned_image(lens, rotation))
        x, y = turned[..., 0], turned[..., 1]
        inside = (x >= 0) & (y >= 0) & (x < lens.width) & (y < lens.height)
        return np.where(inside, y * lens.width + x, -1).astype(np.int32).ravel()

    def _snapshot(self, fine: dict[str, np.ndarray], net_ms: float, begin: float) -> Snapshot:
        ids = fine["region_ids"]
        events = self._events(fine)
        loops = _loops_of_regions(fine, len(ids))
        regions = tuple(
            Region(
                id=int(ids[k]),
                parent=self._origins[int(ids[k])][1],
                born_seq=self._origins[int(ids[k])][0],
                area_px=float(fine["area_px"][k]),
                sigma_area_px=float(fine["sigma_area_px"][k]),
                touches_border=bool(fine["touches_border"][k]),
                mean_rgb=(red, green, blue),
                loops=tuple(fine["vertices_px"][v] for v, _ in loops[k]),
                loop_vertices=tuple(fine["vertex_ids"][v] for v, _ in loops[k]),
                loop_neighbours=tuple(np.where(n >= 0, ids[n], OUTSIDE) for _, n in loops[k]),
            )
            for k, (red, green, blue) in enumerate(fine["mean_rgb"].tolist())
        )
        return Snapshot(
            seq=self._seq,
            regions=regions,
            vertices=Vertices(fine["vertex_ids"], fine["vertices_px"], fine["vertex_sigma_px"]),
            contour=Contour(
                xy_px=fine["outline_px"],
                normal=fine["outline_normal"],
                left=ids[fine["outline_left"]],
                right=ids[fine["outline_right"]],
                length_px=fine["outline_length_px"],
                sigma_px=fine["outline_sigma_px"],
            ),
            events=events,
            cycles=self._core.cycles,
            net_ms=net_ms,
            refine_ms=1e3 * (time.perf_counter() - begin),
            limits=self._limits(net_ms),
        )

    def _limits(self, net_ms: float) -> tuple[str, ...]:
        limits = []
        if self._core.polygons_limited:
            limits.append(f"polygons merged further, to keep to {self._config.max_polygons}")
        if self._core.time_limited:
            limits.append(f"fitting stopped after {self._config.max_ms:g} ms")
        elif 0 < self._config.max_ms < net_ms:
            limits.append(f"fitting overran {self._config.max_ms:g} ms in a step that cannot be cut short")
        return tuple(limits)

    def _events(self, fine: dict[str, np.ndarray]) -> tuple[Event, ...]:
        """What changed in the set of regions; keeps track of where each came from."""
        events = []
        ids, parents = fine["region_ids"].tolist(), fine["region_parents"]
        kinds = np.where((fine["region_is_news"] > 0) | (parents < 0), "birth", "split")
        kinds = np.where(fine["region_is_back"] > 0, "return", kinds).tolist()
        for region, parent, kind in zip(ids, map(_known, parents), kinds, strict=True):
            if region in self._origins:
                continue
            self._origins[region] = self._seq, parent
            if self._seq > 0:
                events.append(Event(kind, region, parent))
        for region, became in zip(fine["gone_ids"].tolist(), map(_known, fine["gone_became"]), strict=True):
            del self._origins[region]
            events.append(Event("end" if became is None else "merge", region, became))
        return tuple(events)


def _core_config(config: NetConfig) -> _core.Config:
    out = _core.Config()
    for name, value in asdict(config).items():
        setattr(out, name, _core.Mode[value] if name == "mode" else value)
    return out


def _known(region: int) -> int | None:
    return int(region) if region >= 0 else None


def _turn(lens: Lens, pixels: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Where the last image showed what the turned camera sees at `pixels` (N, 2); far things only."""
    x, y = lens.to_rays(pixels).T
    # Written out, since a threaded matrix product would keep the robot's other cores spinning.
    u, v, w = (row[0] * x + row[1] * y + row[2] for row in np.asarray(rotation, float))
    in_front = w > 1e-3
    w = np.where(in_front, w, 1.0)
    far_away = 1e6
    rays = np.column_stack([np.where(in_front, u / w, far_away), np.where(in_front, v / w, far_away)])
    return lens.to_pixels(rays)


def _turned_image(lens: Lens, rotation: np.ndarray) -> np.ndarray:
    """The same for every pixel, (H, W, 2) float32.

    It is worked out for some and interpolated in between, since it bends little and lenses take their time.
    """
    x, y = (np.arange(-(-size // TURN_STEP_PX) + 1) * TURN_STEP_PX for size in (lens.width, lens.height))
    nodes = np.stack(np.meshgrid(x, y), axis=-1)
    turned = _turn(lens, nodes.reshape(-1, 2), rotation).reshape(nodes.shape).astype(np.float32)
    for axis in (0, 1):
        turned = _interpolated(turned, axis)
    return turned[: lens.height, : lens.width]


def _interpolated(nodes: np.ndarray, axis: int) -> np.ndarray:
    """TURN_STEP_PX values for each interval between neighbours along the axis, from its first end on."""
    nodes = np.moveaxis(nodes, axis, 0)
    part = (np.arange(TURN_STEP_PX, dtype=np.float32) / TURN_STEP_PX).reshape(-1, *(1,) * (nodes.ndim - 1))
    fine = nodes[:-1, None] + part * (nodes[1:] - nodes[:-1])[:, None]
    return np.moveaxis(fine.reshape(-1, *nodes.shape[1:]), 0, axis)


def _loops_of_regions(fine: dict[str, np.ndarray], count: int) -> list[list[tuple[np.ndarray, np.ndarray]]]:
    """For each region its loops as (vertex indices, neighbour indices), the largest outer loop first."""
    starts = fine["loop_starts"]
    out: list[list[tuple[np.ndarray, np.ndarray]]] = [[] for _ in range(count)]
    for k in np.argsort(-fine["loop_areas"], kind="stable"):
        part = slice(starts[k], starts[k + 1])
        out[fine["loop_regions"][k]].append((fine["loop_vertices"][part], fine["loop_neighbours"][part]))
    return out
