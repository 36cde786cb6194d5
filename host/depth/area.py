"""Depth from the growth of a region's area (Eq. 14-18), with rotation taken out, over all frames of a run.

Eq. 14 says that the area of a frontal surface goes with 1/Z^2, so 1/sqrt(A) is linear in Z, and with
Z = Z0 - d (Eq. 9) linear in the distance d driven towards it:

    1/sqrt(A_k) = s * (Z0 - d_k)

Two frames give Eq. 16; more are a regression whose intercept over slope is the depth. The sensitivity
of Eq. 18, dA/dZ = 2 A / Z, makes a relative area error e worth (Z / dZ) * e / sqrt(2) of the depth.

Areas are compared in one fixed orientation of the camera: that of the first frame of the region's
history. Turning the camera changes an area element by 1/(r3 . p)^3; the exact change is taken from the
region's own polygon.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from host.camera.lens import Lens
from host.depth.config import DepthConfig
from host.depth.motion import Station, most_redundant, rotation_sigma_rad, travel_sigma_cm
from host.depth.polygon import outline_length, polygon_area, polygon_moments
from host.depth.report import Declined, Estimate
from host.rbdn.snapshot import Region, Snapshot

MIN_FACING = 0.5  # cosine beyond which the common orientation no longer faces the region
BREAK_SIGMAS = 6.0  # a sight so far from the line of the others does not belong to it
BREAK_FRAMES = 2  # so many of them in a row begin a new history
TUKEY = 4.7  # residuals so many times their scale hardly count
FORGET_FRAMES = 30  # a region not seen for so long has no history


@dataclass(frozen=True)
class _Sight:
    """One measurement of a region, in the orientation common to its history."""

    station: Station
    inverse_size: float  # 1/sqrt(A), A in units of the plane Z = 1
    relative_sigma: float  # of inverse_size
    shape: np.ndarray  # (3,) second moments over area: xx, yy, xy; pure scaling leaves them alone


@dataclass
class _History:
    rotation: np.ndarray  # (3, 3) camera-to-world rotation all areas are compared in
    sights: list[_Sight] = field(default_factory=list)
    last_seq: int = 0
    off_line: list[_Sight] = field(default_factory=list)  # the last ones in a row that did not fit


class AreaMethod:
    """Follows the areas of all regions and answers with depths."""

    def __init__(self, lens: Lens, config: DepthConfig) -> None:
        self._lens = lens
        self._config = config
        self._histories: dict[int, _History] = {}

    def update(
        self, snapshot: Snapshot, station: Station, own_share: dict[int, float]
    ) -> dict[int, Estimate | Declined]:
        """Depths of the regions of `snapshot`, seen from `station`, by region id.

        Parameters
        ----------
        own_share : by region id, the share of its outline that is not the outline of something nearer
        """
        for event in snapshot.events:
            # what lost a part or swallowed another no longer shows what was followed
            for changed in (event.id, event.parent):
                if changed is not None:
                    self._histories.pop(changed, None)
        for old in [k for k, h in self._histories.items() if snapshot.seq - h.last_seq > FORGET_FRAMES]:
            del self._histories[old]
        return {r.id: self._region(r, station, own_share.get(r.id, 1.0)) for r in snapshot.regions}

    def _region(self, region: Region, station: Station, own_share: float) -> Estimate | Declined:
        if region.touches_border:
            self._histories.pop(region.id, None)
            return Declined("cut by the image border")
        if own_share < self._config.area_own_share:
            self._histories.pop(region.id, None)
            return Declined("partly hidden by a nearer region")
        rays = [self._lens.to_rays(loop) for loop in region.loops]
        history = self._histories.setdefault(region.id, _History(station.pose.rotation))
        history.last_seq = station.seq
        turned = self._turned(rays, history.rotation.T @ station.pose.rotation)
        if turned is None:
            self._histories[region.id] = history = _History(station.pose.rotation, last_seq=station.seq)
            turned = rays
        area, centre, spread = polygon_moments(turned)
        polygon_px = polygon_area(region.loops)
        if area <= 0 or polygon_px <= 0 or region.area_px <= 0:
            return Declined("no area")
        outline_px = outline_length(region.loops)
        sigma_px2 = np.hypot(region.sigma_area_px, outline_px * self._config.area_outline_px)
        # the polygon only says how the lens and the rotation scale the measured soft area
        area *= region.area_px / polygon_px
        # an unknown turn scales an area seen at x by 3 x (r3 . p depends on it in the third power)
        first = history.sights[0].station if history.sights else station
        turn = rotation_sigma_rad(station, first, self._config)
        sigma = np.hypot(0.5 * sigma_px2 / region.area_px, 1.5 * float(np.hypot(*centre)) * turn)
        sight = _Sight(station, area**-0.5, float(sigma), spread / area)
        return self._answer(history, sight, centre)

    @staticmethod
    def _turned(rays: list[np.ndarray], rotation: np.ndarray) -> list[np.ndarray] | None:
        out = []
        for loop in rays:
            p = loop @ rotation[:, :2].T + rotation[:, 2]
            if (p[:, 2] < MIN_FACING * np.linalg.norm(p, axis=1)).any():
                return None
            out.append(p[:, :2] / p[:, 2:])
        return out

    def _answer(self, history: _History, sight: _Sight, centre: np.ndarray) -> Estimate | Declined:
        sights = history.sights
        moved = not sights or _distance(sights[-1], sight) >= self._config.min_step_cm
        if moved and self._off_line(history, sight):
            history.off_line.append(sight)
            if len(history.off_line) < BREAK_FRAMES:
                return self._regress(history, sights, sight, centre)
            history.sights, history.off_line = history.off_line, []
            return Declined("its area jumped; a new baseline begins")
        answer = self._regress(history, [*sights, sight], sight, centre)
        if moved:
            history.off_line = []
            sights.append(sight)
            if len(sights) > self._config.area_history:
                positions = np.array([s.station.pose.position_cm for s in sights])
                del sights[most_redundant(positions, sight.station.pose.position_cm)]
        return answer

    def _off_line(self, history: _History, sight: _Sight) -> bool:
        """Whether a sight contradicts the line through the earlier ones."""
        if len(history.sights) < 3:
            return False
        line = _fit_line(_driven(history, history.sights, sight.station), history.sights)
        if line is None:
            return False
        expected = line.mean_y - line.slope * line.mean_d
        spread = expected * sight.relative_sigma * line.scale
        doubt = np.sqrt(spread**2 + line.scale**2 * (1 / line.weight + line.mean_d**2 / line.sdd))
        return bool(abs(sight.inverse_size - expected) > BREAK_SIGMAS * doubt)

    def _regress(
        self, history: _History, sights: list[_Sight], present: _Sight, centre: np.ndarray
    ) -> Estimate | Declined:
        """Depth at the present from a line through the sights."""
        c = self._config
        now = present.station
        y = np.array([s.inverse_size for s in sights])
        driven = _driven(history, sights, now)
        growth = float(y.max() / y.min() - 1)
        line = _fit_line(driven, sights)
        if line is None or growth < c.min_change or np.ptp(driven) < c.min_step_cm:
            return Declined("too little motion towards it")
        if line.slope >= 0:
            return Declined("its area does not grow with the motion")
        depth_then = -(line.mean_y - line.slope * line.mean_d) / line.slope
        # the line is uncertain in its height and, about its middle, in its slope
        lever = depth_then - line.mean_d
        variance = line.scale**2 / line.slope**2 * (1 / line.weight + lever**2 / line.sdd)
        farthest = sights[int(np.argmax(np.abs(driven)))]
        odometry = travel_sigma_cm(now, farthest.station) / max(abs(driven).max(), 1e-9)
        ray = np.array([*centre, 1.0])
        depth = depth_then * float((now.pose.rotation.T @ history.rotation @ ray)[2])
        relative = float(np.sqrt(variance / depth_then**2 + odometry**2 + c.area_model_share**2))
        change = self._shape_change(farthest, present)
        if change > c.area_shape_change * growth + 8 * present.relative_sigma:
            return Declined(f"its shape changed by {100 * change:.0f} %, not only its size")
        if depth <= 0 or not relative < c.max_relative_sigma:
            return Declined(f"too uncertain ({100 * relative:.0f} %)")
        return Estimate(depth, relative * depth)

    @staticmethod
    def _shape_change(a: _Sight, b: _Sight) -> float:
        """Half the relative change of the second moments over area; zero for pure scaling."""
        size = 0.5 * (a.shape[0] + a.shape[1])
        return float(0.5 * np.abs(b.shape - a.shape).max() / size)


@dataclass(frozen=True)
class _Line:
    """1/sqrt(A) = mean_y + slope * (d - mean_d)."""

    slope: float
    mean_d: float
    mean_y: float
    weight: float  # sum of the weights
    sdd: float  # weighted square deviations of d
    scale: float  # of the residuals, in their sigmas, at least 1


def _fit_line(driven: np.ndarray, sights: list[_Sight]) -> _Line | None:
    """Robust weighted line; None where all sights are from one place."""
    if len(sights) < 2 or np.ptp(driven) == 0:
        return None
    y = np.array([s.inverse_size for s in sights])
    sigma = y * np.array([max(s.relative_sigma, 1e-4) for s in sights])
    weight = sigma**-2
    w, scale = weight, 1.0
    for _ in range(5 if len(y) >= 4 else 1):
        mean_d, mean_y = float(w @ driven / w.sum()), float(w @ y / w.sum())
        along = driven - mean_d
        sdd = float(w @ along**2)
        slope = float((w * along) @ (y - mean_y) / sdd)
        off = (y - mean_y - slope * along) / sigma
        line = _Line(slope, mean_d, mean_y, float(w.sum()), sdd, scale)
        scale = max(1.0, 1.4826 * float(np.median(np.abs(off))))
        w = weight * np.clip(1 - (off / (TUKEY * scale)) ** 2, 0.02, 1) ** 2
    return line


def _driven(history: _History, sights: list[_Sight], now: Station) -> np.ndarray:
    """How far before the present each sight was taken, along the common optical axis, cm."""
    moved = np.array([s.station.pose.position_cm - now.pose.position_cm for s in sights])
    return moved.reshape(-1, 3) @ history.rotation[:, 2]


def _distance(a: _Sight, b: _Sight) -> float:
    return float(np.linalg.norm(b.station.pose.position_cm - a.station.pose.position_cm))
