"""The face of the room: one call per frame from the net's snapshot and the pose to depths."""

from __future__ import annotations

import numpy as np

from host.camera.lens import Lens
from host.depth.area import AreaMethod
from host.depth.config import DepthConfig
from host.depth.fuse import Memory, as_region_depth, combine
from host.depth.motion import Station, first_station, next_station
from host.depth.outline import OutlineDepth, OutlineMethod
from host.depth.report import Declined, DepthReport, Estimate
from host.depth.vertex import VertexMethod
from host.pose import Pose
from host.rbdn.snapshot import Region, Snapshot


class Estimator:
    """Depth of every region and vertex, from all frames of the run so far.

    Parameters
    ----------
    lens : intrinsics of the camera the snapshots come from
    config : settings
    """

    def __init__(self, lens: Lens, config: DepthConfig | None = None) -> None:
        self._lens = lens
        self._config = config or DepthConfig()
        self._area = AreaMethod(lens, self._config)
        self._vertex = VertexMethod(lens, self._config)
        self._outline = OutlineMethod(lens, self._config)
        self._memory = Memory(self._config)
        self._station: Station | None = None

    def update(self, snapshot: Snapshot, pose: Pose) -> DepthReport:
        """Take in one frame.

        Parameters
        ----------
        snapshot : the net after the frame
        pose : where the camera was when the frame was taken
        """
        station = (
            first_station(snapshot.seq, pose, self._config)
            if self._station is None
            else next_station(self._station, snapshot.seq, pose, self._config)
        )
        self._station = station
        for event in snapshot.events:
            for changed in (event.id, event.parent):
                if changed is not None:
                    self._memory.forget(changed)
        self._memory.forget_unseen(snapshot.seq)
        outlines = self._outline.update(snapshot, station)
        own = outlines.own_share
        areas = self._area.update(snapshot, station, own)
        vertices = self._vertex.update(snapshot, station)
        regions = {}
        for region in snapshot.regions:
            outline = outlines.depths[region.id]
            found = outline if isinstance(outline, OutlineDepth) else None
            answers: dict[str, Estimate | Declined] = {
                "area": areas[region.id],
                "vertex": self._vertex.region(region, snapshot, vertices, own.get(region.id, 1.0)),
                "outline": outline if isinstance(outline, Declined) else outline.surface,
            }
            estimates = {m: a for m, a in answers.items() if isinstance(a, Estimate)}
            declined = {m: a.reason for m, a in answers.items() if isinstance(a, Declined)}
            fused = self._memory.update(region.id, combine(estimates), self._middle(region), station)
            regions[region.id] = as_region_depth(fused, estimates, declined, found)
        return DepthReport(regions, vertices)

    def _middle(self, region: Region) -> np.ndarray:
        """Ray (3,) towards the middle of the region's outline."""
        loop = region.loops[0]
        ray = self._lens.to_rays(0.5 * (loop.min(axis=0) + loop.max(axis=0))[None])[0]
        return np.array([ray[0], ray[1], 1.0])
