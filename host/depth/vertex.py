"""Depth of the net's vertices by triangulation (Eq. 7-13), x and y jointly, over all frames of a run.

Eq. 7-9 are Y/Z = y/f in two frames with Z_j = Z_i - dZ. Here the camera may move and turn in any way:
with a vertex at (x, y) and inverse depth rho in the present frame, an earlier frame k sees it at

    (x_k, y_k) = first two of (R_k (x, y, 1) + rho t_k), divided by the third

which for pure forward motion is Eq. 10 in both coordinates. (x, y, rho) are fitted to all frames
together, so the sensitivity of Eq. 13, the vertex's distance from the focus of expansion over Z, enters
with both coordinates, and vertices near the focus get the large sigma they deserve.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from host.camera.lens import Lens
from host.depth.config import DepthConfig
from host.depth.keyframes import rows_of
from host.depth.motion import Station, most_redundant, rotation_sigma_rad, travel_sigma_cm, with_ones
from host.depth.report import Declined, Estimate, VertexDepths
from host.rbdn.snapshot import Region, Snapshot

ITERATIONS = 4
MIN_OWN_SHARE = 0.5  # below, most corners are not the region's
MIN_BEND_RAD = 0.75  # a polygon on a round outline bends by less
ARM_PX = 5.0
MIN_CORNERS = 3  # a region's depth from fewer vertices is chance


@dataclass(frozen=True)
class _Sight:
    station: Station
    ids: np.ndarray  # (N,) ascending
    rays: np.ndarray  # (N, 2)
    sigma_px: np.ndarray  # (N,)


class VertexMethod:
    """Follows the vertices of the net and answers with their positions and with depths of regions."""

    def __init__(self, lens: Lens, config: DepthConfig) -> None:
        self._lens = lens
        self._config = config
        self._kept: list[_Sight] = []

    def update(self, snapshot: Snapshot, station: Station) -> VertexDepths:
        """Positions of the vertices of `snapshot`, seen from `station`."""
        v = snapshot.vertices
        order = np.argsort(v.ids, kind="stable")
        c = self._config
        sharp = np.isfinite(v.sigma_px)
        sigma = np.where(sharp, np.maximum(v.sigma_px, c.vertex_noise_px), c.vertex_default_sigma_px)
        rays = self._lens.to_rays(v.xy_px)
        now = _Sight(station, v.ids[order], rays[order], sigma[order])
        rho, sigma_rho = self._triangulate(rays, sigma, v.ids, now)
        if not self._kept or (
            np.linalg.norm(station.pose.position_cm - self._kept[-1].station.pose.position_cm)
            >= self._config.min_step_cm
        ):
            self._kept.append(now)
            if len(self._kept) > self._config.vertex_history:
                positions = np.array([s.station.pose.position_cm for s in self._kept])
                del self._kept[most_redundant(positions, station.pose.position_cm)]
        good = (rho > 0) & (sigma_rho < self._config.max_relative_sigma * rho)
        depth = np.where(good, 1 / np.where(good, rho, 1.0), np.nan)
        return VertexDepths(v.ids, with_ones(rays) * depth[:, None], sigma_rho * depth**2)

    def _triangulate(
        self, rays: np.ndarray, sigma_px: np.ndarray, ids: np.ndarray, now: _Sight
    ) -> tuple[np.ndarray, np.ndarray]:
        """Inverse depths (N,) in 1/cm and their standard errors; (0, inf) where nothing is known."""
        n, kept = len(ids), self._kept
        if not kept or n == 0:
            return np.zeros(n), np.full(n, np.inf)
        focal = np.array([self._lens.fx, self._lens.fy])
        seen, weight, turn, shift = [], [], [], []
        odometry, rotation = [], []
        for then in kept:
            row = np.minimum(np.searchsorted(then.ids, ids), max(len(then.ids) - 1, 0))
            found = then.ids[row] == ids if len(then.ids) else np.zeros(n, bool)
            seen.append(then.rays[row] if len(then.ids) else np.zeros((n, 2)))
            weight.append(found / (then.sigma_px[row] ** 2 if len(then.ids) else 1.0))
            r, t = now.station.pose.relative_to(then.station.pose)
            turn.append(r)
            shift.append(t)
            odometry.append((travel_sigma_cm(now.station, then.station) / (np.linalg.norm(t) + 1e-9)) ** 2)
            rotation.append(rotation_sigma_rad(now.station, then.station, self._config) ** 2)
        q, w = np.stack(seen, 1), np.stack(weight, 1)  # (N, K, 2), (N, K)
        turns, shifts = np.array(turn), np.array(shift)
        rho = _linear_start(rays, q, w, turns, shifts)
        state = np.column_stack([rays, rho])
        information = np.zeros((n, 3, 3))
        chi2 = np.ones(n)
        gradient = np.zeros((n, w.shape[1]))
        for _ in range(ITERATIONS):
            p = with_ones(state[:, :2]) @ turns.transpose(0, 2, 1)  # (K, N, 3)
            a = p.transpose(1, 0, 2) + state[:, 2, None, None] * shifts  # (N, K, 3)
            depth = np.where(np.abs(a[..., 2:]) < 1e-6, 1e-6, a[..., 2:])
            off = (q - a[..., :2] / depth) * focal  # px
            columns = np.empty((n, len(kept), 3, 3))  # d a / d (x, y, rho)
            columns[..., :2] = turns[:, :, :2]
            columns[..., 2] = shifts
            j = columns[..., :2, :] - (a[..., :2] / depth)[..., None] * columns[..., 2:, :]
            j = j / depth[..., None]
            j = j * focal[:, None]
            # the present frame is a measurement like the others
            here = (rays - state[:, :2]) * focal
            w_here = sigma_px**-2
            chi2 = ((off**2).sum(2) * w).sum(1) + (here**2).sum(1) * w_here
            freedom = 2 * (w > 0).sum(1) + 2 - 3
            chi2 = np.maximum(1.0, chi2 / np.maximum(freedom, 1))
            information = np.einsum("nkij,nkil,nk->njl", j, j, w)
            information[:, 0, 0] += w_here * focal[0] ** 2
            information[:, 1, 1] += w_here * focal[1] ** 2
            information[:, 2, 2] += 1e-9
            right = np.einsum("nkij,nki,nk->nj", j, off, w)
            right[:, :2] += here * focal * w_here[:, None]
            state = state + np.linalg.solve(information, right[..., None])[..., 0]
            gradient = w * (j[..., 2] ** 2).sum(2)
        covariance = np.linalg.inv(information)
        share = gradient / np.maximum(gradient.sum(1, keepdims=True), 1e-300)
        variance = covariance[:, 2, 2] * chi2 + state[:, 2] ** 2 * (share @ np.array(odometry))
        # a rotation error shifts the whole frame: against the vertex's own travel over the image
        px_per_rho = np.sqrt(gradient / np.maximum(w, 1e-300)) + 1e-9
        shift_px = focal.mean() * np.sqrt(np.array(rotation))
        variance += (share * (shift_px / px_per_rho) ** 2).sum(1)
        usable = (w > 0).any(1) & (gradient.sum(1) > 0)
        return np.where(usable, state[:, 2], 0.0), np.where(usable, np.sqrt(variance), np.inf)

    def region(
        self, region: Region, snapshot: Snapshot, found: VertexDepths, own_share: float
    ) -> Estimate | Declined:
        """Depth of a region from its own corners.

        Parameters
        ----------
        region : one of `snapshot`
        found : what `update` said of the snapshot's vertices
        own_share : share of its outline that is not the outline of something nearer
        """
        if own_share < MIN_OWN_SHARE:
            return Declined("its corners belong to nearer regions")
        if region.touches_border:
            return Declined("cut by the image border")
        corners = region.loop_vertices[0][_bends(region.loops[0])]
        rows = rows_of(corners, found.ids)
        at = np.unique(rows[rows >= 0])
        z, sigma = found.xyz_cm[at, 2], found.sigma_cm[at]
        good = np.isfinite(z) & np.isfinite(snapshot.vertices.sigma_px[at])
        if good.sum() < MIN_CORNERS:
            return Declined("fewer than three corners with a depth")
        rho, sigma_rho = 1 / z[good], sigma[good] / z[good] ** 2
        centre = float(np.median(rho))
        for _ in range(3):
            scale = 1.4826 * float(np.median(np.abs(rho - centre)))
            gate = 4.7 * np.sqrt(sigma_rho**2 + scale**2) + 1e-12
            w = np.clip(1 - ((rho - centre) / gate) ** 2, 0, 1) ** 2 / (sigma_rho**2 + scale**2 / 4)
            if w.sum() <= 0:
                return Declined("its corners disagree")
            centre = float(w @ rho / w.sum())
        spread = float(w @ (rho - centre) ** 2 / w.sum())
        variance = 1 / w.sum() + spread / len(rho)
        relative = float(np.sqrt(variance / centre**2 + self._config.vertex_model_share**2))
        if relative > self._config.max_relative_sigma:
            return Declined(f"too uncertain ({100 * relative:.0f} %)")
        return Estimate(1 / centre, relative / centre)


def _bends(loop_px: np.ndarray) -> np.ndarray:
    """(N,) bool, where an outline has a corner rather than a place on a line or an arc."""
    spacing = float(np.hypot(*np.diff(loop_px, axis=0, append=loop_px[:1]).T).mean())
    # points closer than an arm tell the direction of the outline only together
    arm = max(1, round(ARM_PX / max(spacing, 1e-9)))
    before = loop_px - np.roll(loop_px, arm, axis=0)
    after = np.roll(loop_px, -arm, axis=0) - loop_px
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.abs(np.arctan2(cross, (before * after).sum(axis=1))) > MIN_BEND_RAD


def _linear_start(
    rays: np.ndarray, q: np.ndarray, w: np.ndarray, turns: np.ndarray, shifts: np.ndarray
) -> np.ndarray:
    """Inverse depths (N,) by linear least squares with the present rays taken as exact."""
    p = (with_ones(rays) @ turns.transpose(0, 2, 1)).transpose(1, 0, 2)  # (N, K, 3)
    constant = p[..., :2] - q * p[..., 2:]
    slope = q * shifts[:, 2:] - shifts[:, :2]
    above = (w * (constant * slope).sum(2)).sum(1)
    below = (w * (slope**2).sum(2)).sum(1)
    return np.where(below > 0, above / np.where(below > 0, below, 1.0), 0.0)
