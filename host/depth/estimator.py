"""The face of the room: one call per frame from the net's snapshot and the pose to depths.

The engine is C++ (`core/estimator.cpp`); here arrays go in and reports come out.
"""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np

from host.camera.lens import Lens
from host.depth import _depth
from host.depth.config import DepthConfig
from host.depth.report import Correction, DepthReport, Estimate, RegionDepth, SolvedMotion, VertexDepths
from host.pose import Pose
from host.rbdn.snapshot import Snapshot

METHODS = ("area", "vertex", "outline")  # in the engine's order


class Estimator:
    """Depth of every region and vertex, from all frames of the run so far.

    Parameters
    ----------
    lens : intrinsics of the camera the snapshots come from
    config : settings
    """

    def __init__(self, lens: Lens, config: DepthConfig | None = None) -> None:
        self._core = _depth.Estimator(
            lens.width,
            lens.height,
            lens.fx,
            lens.fy,
            lens.cx,
            lens.cy,
            tuple(lens.distortion),
            asdict(config or DepthConfig()),
        )

    def update(self, snapshot: Snapshot, pose: Pose) -> DepthReport:
        """Take in one frame.

        Parameters
        ----------
        snapshot : the net after the frame
        pose : where odometry says the camera was when the frame was taken
        """
        regions, vertices = snapshot.regions, snapshot.vertices
        loops = [loop for r in regions for loop in r.loops]
        points = np.concatenate([*loops, np.zeros((0, 2))])
        contour = snapshot.contour
        found = self._core.update(
            np.array([r.id for r in regions], np.int64),
            np.array([r.area_px for r in regions], float),
            np.array([r.sigma_area_px for r in regions], float),
            np.array([r.touches_border for r in regions], bool),
            np.array([r.mean_rgb for r in regions], float).reshape(-1, 3),
            points,
            np.concatenate([*(ids for r in regions for ids in r.loop_vertices), np.zeros(0, np.int64)]),
            np.array([len(loop) for loop in loops], np.int64),
            np.array([row for row, r in enumerate(regions) for _ in r.loops], np.int64),
            np.ascontiguousarray(vertices.ids),
            np.ascontiguousarray(vertices.xy_px, float),
            np.ascontiguousarray(vertices.sigma_px, float),
            np.ascontiguousarray(contour.xy_px, float).reshape(-1, 2),
            np.ascontiguousarray(contour.normal, float).reshape(-1, 2),
            np.ascontiguousarray(contour.left),
            np.ascontiguousarray(contour.right),
            np.ascontiguousarray(contour.length_px, float),
            np.array([i for e in snapshot.events for i in (e.id, e.parent) if i is not None], np.int64),
            np.ascontiguousarray(pose.rotation, float),
            np.array([*pose.position_cm, pose.t_s, pose.sigma_z_cm, pose.sigma_rot_rad], float),
        )
        rotation, position = found["rotation"], found["position_cm"]
        motion = SolvedMotion(
            replace(pose, rotation=rotation, position_cm=position),
            *found["motion"],
            since=tuple(Correction(*row) for row in found["since"].tolist()),
        )
        depths = VertexDepths(
            vertices.ids, found["xyz_cm"], found["vertex_sigma_cm"], found["vertex_sensitivity"]
        )
        return DepthReport(self._regions(snapshot, found), depths, motion)

    @staticmethod
    def _regions(snapshot: Snapshot, found: dict) -> dict[int, RegionDepth]:
        out = {}
        rows = zip(
            snapshot.regions,
            found["estimates"].tolist(),
            found["declined"],
            found["fused"].tolist(),
            found["methods"],
            found["notes"],
            found["silhouette_cm"].tolist(),
            found["slope"].tolist(),
            found["slanted"],
            found["moving"],
            strict=True,
        )
        for region, answers, reasons, fused, method, note, silhouette, slope, slanted, moving in rows:
            named = list(zip(METHODS, answers, reasons, strict=True))
            estimates = {m: Estimate(*answer) for m, answer, why in named if not why}
            declined = {m: why for m, _, why in named if why}
            if method < 0:
                why = "; ".join(f"{m}: {reason}" for m, reason in declined.items())
                out[region.id] = RegionDepth(None, None, None, why, estimates, declined, moving=moving)
                continue
            out[region.id] = RegionDepth(
                fused[0],
                fused[1],
                METHODS[method],
                note or None,
                estimates,
                declined,
                silhouette if "outline" in estimates else None,
                (slope[0], slope[1]) if slanted else None,
                moving,
            )
        return out
