"""The truth of a frame, and which regions show which object. Used after the estimators have spoken."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from host.camera.lens import Lens
from host.pose import Pose
from host.rbdn.snapshot import Region, Snapshot
from host.sim.render import Renderer
from host.sim.scoring import region_mask

SMALLEST_PX = 20  # regions with fewer pixels of an object do not show it
CORNER_NAMES = "DCBA"  # of the quadrilateral that the renderer starts at the lower left


@dataclass(frozen=True)
class Shown:
    """A region and the object that most of its pixels show."""

    region: Region
    object_id: int
    pixels: int  # of that object
    depth_cm: float  # mean over them
    middle_px: np.ndarray  # (2,) of them


@dataclass(frozen=True)
class ObjectTruth:
    """What is to be seen of one object."""

    name: str
    area_px: float
    mean_cm: float  # average depth of what is visible
    whole: bool  # not cut by the image border


class FrameTruth:
    """What is true of one frame.

    Attributes
    ----------
    things : dict[int, ObjectTruth]
        By object id; without the room's own surfaces.
    """

    def __init__(self, renderer: Renderer, pose: Pose) -> None:
        self._renderer, self._pose = renderer, pose
        self._frame = renderer.truth(pose)
        self.things: dict[int, ObjectTruth] = {}
        for object_id, name in renderer.object_names.items():
            if object_id in renderer.background_ids:
                continue
            ids = [part.id for part in renderer.parts if part.object_id == object_id]
            area = self._frame.part_area_px[ids]
            if area.sum() > 0:
                mean = float(area @ self._frame.part_mean_z_cm[ids] / area.sum())
                mask = self._frame.object_id == object_id
                cut = mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any()
                self.things[object_id] = ObjectTruth(name, float(area.sum()), mean, not cut)

    def shown(self, snapshot: Snapshot) -> list[Shown]:
        """Every region with the object it shows."""
        out = []
        for region in snapshot.regions:
            mask = region_mask(region.loops, self._frame.object_id.shape)
            ids = self._frame.object_id[mask]
            if len(ids) == 0:
                continue
            owner = int(np.bincount(ids).argmax())
            mask &= self._frame.object_id == owner
            y, x = np.nonzero(mask)
            if owner == 0 or len(x) < max(SMALLEST_PX, len(ids) // 2):
                continue
            depth = float(self._frame.depth_cm[mask].mean(dtype=float))
            out.append(Shown(region, owner, len(x), depth, np.array([x.mean(), y.mean()])))
        return out

    def corners_cm(self) -> dict[str, np.ndarray]:
        """(3,) in the camera's frame for the corners of every front face, as "red_box A"."""
        out = {}
        for part in self._renderer.parts:
            thing, _, face = part.name.partition("/")
            if face == "front" and part.object_id not in self._renderer.background_ids:
                camera = (part.corners_cm - self._pose.position_cm) @ self._pose.rotation
                out |= {f"{thing} {name}": xyz for name, xyz in zip(CORNER_NAMES, camera, strict=True)}
        return out


def pixel_of(xyz_cm: np.ndarray, lens: Lens) -> np.ndarray:
    """(2,) where a point in the camera's frame is seen."""
    return lens.to_pixels((xyz_cm[:2] / xyz_cm[2])[None])[0]


def by_object(shown: list[Shown]) -> dict[int, list[Shown]]:
    """Regions by the id of the object they show."""
    out: dict[int, list[Shown]] = {}
    for one in shown:
        out.setdefault(one.object_id, []).append(one)
    return out
