"""Parts of the depth engine by themselves: polygons, reliefs, the area and the vertex method."""

from __future__ import annotations

import ctypes
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from compile_cpp import compile_cpp

from host.camera.lens import Lens
from host.pose import Pose
from host.rbdn.snapshot import Snapshot

HERE = Path(__file__).resolve().parent
CORE = HERE.parents[1] / "host" / "depth" / "core"
PARTS = ("polygon", "relief", "path", "area", "vertex")
FLAGS = ["-Wall", "-Wextra", "-Wshadow", f"-I{CORE}"]


def compile_parts(main: Path, target: Path, flags: Sequence[str]) -> Path:
    """Compile the parts with another file."""
    sources = [CORE / f"{part}.cpp" for part in PARTS]
    return compile_cpp([*sources, main], target, [*FLAGS, *flags])


@cache
def library() -> ctypes.CDLL:
    """The parts behind the functions of parts_probe.cpp."""
    with tempfile.TemporaryDirectory() as folder:
        file = compile_parts(HERE / "parts_probe.cpp", Path(folder) / "parts.so", ["-O2", "-fPIC", "-shared"])
        loaded = ctypes.CDLL(str(file))
    for name in ("probe_area", "probe_length", "probe_mean_of_inverse"):
        getattr(loaded, name).restype = ctypes.c_double
    loaded.run_new.restype = ctypes.c_void_p
    return loaded


def _doubles(values: object) -> ctypes.Array[ctypes.c_double]:
    flat = np.ascontiguousarray(values, float).ravel()
    return (ctypes.c_double * max(1, len(flat)))(*flat)


def _longs(values: object) -> ctypes.Array[ctypes.c_int64]:
    flat = np.ascontiguousarray(values, np.int64).ravel()
    return (ctypes.c_int64 * max(1, len(flat)))(*flat.tolist())


def _loops(loops: Sequence[np.ndarray]) -> tuple[object, object, int]:
    xy = np.concatenate([np.asarray(loop, float).reshape(-1, 2) for loop in loops])
    sizes = (ctypes.c_int * len(loops))(*[len(loop) for loop in loops])
    return _doubles(xy), sizes, len(loops)


# --- Polygons --------------------------------------------------------------------------------------


def polygon_area(loops: Sequence[np.ndarray]) -> float:
    return library().probe_area(*_loops(loops))


def outline_length(loops: Sequence[np.ndarray]) -> float:
    return library().probe_length(*_loops(loops))


def polygon_moments(loops: Sequence[np.ndarray]) -> tuple[float, np.ndarray, np.ndarray]:
    """Area, centroid (2,), central second moments over the area (3,) = xx, yy, xy."""
    out = (ctypes.c_double * 6)()
    library().probe_moments(*_loops(loops), out)
    return out[0], np.array(out[1:3]), np.array(out[3:])


def mean_of_inverse(loops: Sequence[np.ndarray], a: float, b: float, c: float) -> float:
    return library().probe_mean_of_inverse(*_loops(loops), *(ctypes.c_double(v) for v in (a, b, c)))


def _points_of(name: str, points: np.ndarray, *more: object) -> np.ndarray:
    out = (ctypes.c_double * (2 * len(points) + 2))()
    count = getattr(library(), name)(_doubles(points), len(points), *more, out)
    return np.array(out[: 2 * count]).reshape(-1, 2)


def convex_hull(points: np.ndarray) -> np.ndarray:
    return _points_of("probe_hull", points)


def simplified(loop: np.ndarray, tolerance: float) -> np.ndarray:
    return _points_of("probe_simplified", loop, ctypes.c_double(tolerance))


def smallest_rectangle(points: np.ndarray) -> tuple[float, float]:
    out = (ctypes.c_double * 2)()
    library().probe_rectangle(_doubles(points), len(points), out)
    return out[0], out[1]


def is_convex(loop: np.ndarray) -> bool:
    return bool(library().probe_is_convex(_doubles(loop), len(loop)))


def may_be_one_face(loop: np.ndarray) -> bool:
    return bool(library().probe_may_be_one_face(_doubles(loop), len(loop)))


def relief_of(loop: np.ndarray, cut: bool = False) -> tuple[float, float]:
    """k and its sigma."""
    out = (ctypes.c_double * 2)()
    library().probe_relief(_doubles(loop), len(loop), int(cut), out)
    return out[0], out[1]


# --- Methods ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Said:
    """An answer of a method."""

    depth_cm: float
    sigma_cm: float
    sensitivity: float
    declined: str  # why there is no depth; empty where there is one

    @property
    def known(self) -> bool:
        return not self.declined


@dataclass(frozen=True)
class Noise:
    """How far odometry is to be trusted."""

    travel_cm: float = 0.02
    turn_rad: float = 1e-4
    turn_share: float = 0.01
    timing_s: float = 0.004


EXACT = Noise(0.0, 0.0, 0.0, 0.0)


class Run:
    """Both methods on one run of frames.

    Parameters
    ----------
    exact_outlines : whether outlines are known not to lie too far in or out
    """

    def __init__(self, lens: Lens, noise: Noise | None = None, exact_outlines: bool = False) -> None:
        noise = noise or Noise()
        camera = [lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy]
        trust = [noise.travel_cm, noise.turn_rad, noise.turn_share, noise.timing_s]
        self._at = ctypes.c_void_p(library().run_new(_doubles(camera), _doubles(trust), int(exact_outlines)))

    def __del__(self) -> None:
        library().run_delete(self._at)

    def see(self, snapshot: Snapshot, pose: Pose) -> np.ndarray:
        """Take in a frame of a lens without distortion; returns (N, 5) = x, y, z, sigma, sensitivity."""
        lib = library()
        sigmas = [pose.t_s, pose.sigma_z_cm, pose.sigma_rot_rad]
        lib.run_pose(
            self._at, snapshot.seq, _doubles(pose.rotation), _doubles(pose.position_cm), _doubles(sigmas)
        )
        for r in snapshot.regions:
            areas = _doubles([r.area_px, r.sigma_area_px, polygon_area(r.loops)])
            lib.run_add_region(
                self._at, ctypes.c_int64(r.id), areas, int(r.touches_border), *_loops(r.loops),
                _longs(r.loop_vertices[0]),
            )  # fmt: skip
        for event in snapshot.events:
            for changed in (event.id, event.parent):
                if changed is not None:
                    lib.run_add_changed(self._at, ctypes.c_int64(changed))
        v = snapshot.vertices
        out = (ctypes.c_double * (5 * len(v.ids) + 1))()
        lib.run_vertices(self._at, len(v.ids), _longs(v.ids), _doubles(v.xy_px), _doubles(v.sigma_px), out)
        return np.array(out[: 5 * len(v.ids)]).reshape(-1, 5)

    def area(self, row: int = 0, own_share: float = 1.0) -> Said:
        """What the area method says of a region of the frame just seen."""
        return self._ask("run_area", row, own_share)

    def region(self, row: int = 0, own_share: float = 1.0) -> Said:
        """What the vertex method says of a region of the frame just seen."""
        return self._ask("run_region", row, own_share)

    def frames(self) -> list[int]:
        """Frames that both still need; the path forgets all others."""
        out = (ctypes.c_int * 256)()
        count = library().run_frames(self._at, out)
        return list(out[:count])

    def _ask(self, name: str, row: int, own_share: float) -> Said:
        three, why = (ctypes.c_double * 3)(), ctypes.create_string_buffer(128)
        getattr(library(), name)(self._at, row, ctypes.c_double(own_share), three, why)
        return Said(three[0], three[1], three[2], why.value.decode())
