"""The paper's net as it is, without any refinement: its polygons' areas and its vertices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from host.rbdn import Net, NetConfig, Snapshot


@dataclass(frozen=True)
class PolygonNet:
    """The net after one frame."""

    snapshot: Snapshot  # refined; tells which polygon shows what
    vertices_px: dict[int, np.ndarray]  # (2,) by vertex id
    areas_px2: dict[int, float]  # by region id: in the paper every polygon is a region


class PaperPipeline:
    """Follows the images by the paper's rules."""

    def __init__(self) -> None:
        self._net = Net(NetConfig(mode="paper"))

    def track(self, image: np.ndarray) -> Snapshot:
        """Fit the net to the next image."""
        return self._net.track(image)

    def polygons(self, snapshot: Snapshot) -> PolygonNet:
        """The polygons of `snapshot`, which must be of the last image tracked."""
        faces = self._net.faces()
        return PolygonNet(
            snapshot,
            dict(zip(faces["vertex_ids"].tolist(), faces["vertices_px"], strict=True)),
            dict(zip(faces["region_ids"].tolist(), faces["areas_px"].tolist(), strict=True)),
        )
