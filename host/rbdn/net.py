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
from host.rbdn.snapshot import Contour, Event, Region, Snapshot, Vertices
from host.rbdn.turn import TurnedView

SMALLEST_IMAGE_PX = 32
NO_ROTATION = 1e-3  # error of a rotation's matrix that is more than rounding
NO_TURN = np.zeros(0, np.int32)


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
        self._view = None if lens is None else TurnedView(lens)
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
        turn = self._check_rotation(rotation, image)
        begin = time.perf_counter()
        image = np.ascontiguousarray(image)
        self._displace(displacement)
        source = None if turn is None or self._view is None or self._seq == 0 else self._view.source(turn)
        self._core.track(image, NO_TURN if source is None else source)
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

    def _check_rotation(self, rotation: np.ndarray | None, image: np.ndarray) -> np.ndarray | None:
        if rotation is None:
            return None
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
        matrix = matrix.astype(float)
        if not _is_rotation(*matrix.tolist()):
            raise InputError(f"{matrix.tolist()} is no rotation: give unit rows at right angles")
        return matrix

    def _displace(self, displacement: Mapping[int, tuple[float, float]] | None) -> None:
        if not displacement:
            return
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

    def _snapshot(self, fine: dict[str, np.ndarray], net_ms: float, begin: float) -> Snapshot:
        events = self._events(fine)
        return Snapshot(
            seq=self._seq,
            regions=self._regions(fine),
            vertices=Vertices(fine["vertex_ids"], fine["vertices_px"], fine["vertex_sigma_px"]),
            contour=Contour(
                xy_px=fine["outline_px"],
                normal=fine["outline_normal"],
                left=fine["outline_left"],
                right=fine["outline_right"],
                length_px=fine["outline_length_px"],
                sigma_px=fine["outline_sigma_px"],
            ),
            events=events,
            cycles=self._core.cycles,
            net_ms=net_ms,
            refine_ms=1e3 * (time.perf_counter() - begin),
            limits=self._limits(net_ms),
        )

    def _regions(self, fine: dict[str, np.ndarray]) -> tuple[Region, ...]:
        xy, vertices, neighbours = fine["loop_px"], fine["loop_vertices"], fine["loop_neighbours"]
        ends = fine["loop_ends"].tolist()
        loops = [slice(begin, end) for begin, end in zip([0, *ends], ends, strict=False)]
        regions, first = [], 0
        names = ("region_ids", "area_px", "sigma_area_px", "touches_border", "mean_rgb", "loop_counts")
        for region, area, sigma, at_border, rgb, count in zip(
            *(fine[name].tolist() for name in names), strict=True
        ):
            born_seq, parent = self._origins[region]
            mine = loops[first : first + count]
            first += count
            regions.append(
                Region(
                    id=region,
                    parent=parent,
                    born_seq=born_seq,
                    area_px=area,
                    sigma_area_px=sigma,
                    touches_border=bool(at_border),
                    mean_rgb=tuple(rgb),
                    loops=tuple(xy[loop] for loop in mine),
                    loop_vertices=tuple(vertices[loop] for loop in mine),
                    loop_neighbours=tuple(neighbours[loop] for loop in mine),
                )
            )
        return tuple(regions)

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
        names = ("region_ids", "region_parents", "region_is_news", "region_is_back")
        for region, parent, is_news, is_back in zip(*(fine[name].tolist() for name in names), strict=True):
            if region in self._origins:
                continue
            parent = _known(parent)
            self._origins[region] = self._seq, parent
            if self._seq > 0:
                kind = "return" if is_back else "birth" if is_news or parent is None else "split"
                events.append(Event(kind, region, parent))
        for region, became in zip(fine["gone_ids"].tolist(), fine["gone_became"].tolist(), strict=True):
            became = _known(became)
            del self._origins[region]
            events.append(Event("end" if became is None else "merge", region, became))
        return tuple(events)


def _core_config(config: NetConfig) -> _core.Config:
    out = _core.Config()
    for name, value in asdict(config).items():
        setattr(out, name, _core.Mode[value] if name == "mode" else value)
    return out


def _known(region: int) -> int | None:
    return region if region >= 0 else None


def _is_rotation(x: list[float], y: list[float], z: list[float]) -> bool:
    """Are these rows of unit length, at right angles, and in the right order? Near enough."""
    products = ((x, x, 1.0), (y, y, 1.0), (z, z, 1.0), (x, y, 0.0), (y, z, 0.0), (z, x, 0.0))
    if not all(abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] - want) < NO_ROTATION for a, b, want in products):
        return False
    cross = (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])
    return cross[0] * z[0] + cross[1] * z[1] + cross[2] * z[2] > 0
