"""Depth from the motion of whole outlines: the main method.

The present outline is carried into earlier frames by the known motion and a trial inverse depth rho,

    q_k = first two of (R_k p + rho t_k), divided by the third

and compared with the outline found there, along the normal only. Vertices (Eq. 7-13) are its case of
single points, area (Eq. 14-18) its case of uniform growth. One rho is fitted for each region to all kept
frames together, robustly; where the outline supports it, rho = a + b x + c y over the image, which is
exact for slanted planes.

The position of each present sample along its normal is itself a measurement with an error common to
all comparisons: it is an unknown that is eliminated sample by sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from host.camera.lens import Lens
from host.depth.config import DepthConfig
from host.depth.keyframes import Keyframes, Outline, direction_of, faces_of, rows_of, usable_outline
from host.depth.motion import Station, rotation_sigma_rad, travel_sigma_cm
from host.depth.ownership import edge_owners
from host.depth.polygon import polygon_moments
from host.depth.report import Declined, Estimate
from host.depth.surface import FLAT, may_be_one_face, relief_of
from host.rbdn.snapshot import Region, Snapshot

TRIALS = 40  # inverse depths looked at, log-spaced
TRIAL_POINTS = 12  # samples of each region looked at
TRIAL_GATE_PX = 2.5
GATES_PX = (5.0, 3.5, 2.5)  # residuals beyond are not used; shrinks as the fit settles
REFITS = 3  # passes of robust weighting between two looks at the earlier outlines
TUKEY = 4.7
LIKE_NORMAL = 0.8  # cosine between a sample's normal and its match's
LIKE_RGB = 40.0  # distance of mean colours below which two regions may be the same
ALONG_PX = 3.0  # a match may lie so far along the outline
MIN_OWN_PX = 20.0  # of outline that is the region's own
MIN_OWN_SHARE = 0.25  # of its outline within the image
MIN_FOUND = 0.2  # of its own outline over all kept frames
MIN_CONTRAST = 0.15  # of a wrong depth's cost above the best
MIN_RIVAL = 0.05  # of another dip's cost above the best
RIVAL_RISE = 0.05  # by which the cost must rise between two dips
MIN_SHIFT_PX = 0.3  # by which the outline must have moved over the image
WHOLE_SHARE = 0.9  # of its outline that must be its own for the shape to say something
PLANE_CHI2 = 12.0  # a slope is believed when so far from zero in units of its variance
PLANE_TILT = 0.9  # prior: relative change of depth over half a width, in widths over depth


@dataclass(frozen=True)
class OutlineDepth:
    """What the outline says of a region."""

    surface: Estimate  # mean over the visible surface
    silhouette_cm: float  # where the outline itself is
    slope: tuple[float, float] | None  # d(1/Z)/dx, dy per px, where the outline shows a slant


@dataclass(frozen=True)
class _Sides:
    """One row for each side of each used sample: the sample as seen by one of its two regions."""

    region: np.ndarray  # (N,) index of the region
    pair: np.ndarray  # (N,) index of the boundary
    side: np.ndarray  # (N,) 0 left, 1 right
    length_px: np.ndarray  # (N,) outline the row stands for
    offset: np.ndarray  # (N, 2) px from the region's middle
    base: np.ndarray  # (3, K, N) components of R_k p
    normal: np.ndarray  # (2, K, N) the normal, turned with the camera
    direction: np.ndarray  # (K, N) as the keyframes file it


@dataclass(frozen=True)
class _Scan:
    """The best of many trial depths of every region, and how clearly it is the best."""

    rho: np.ndarray  # (R,) 1/cm
    contrast: np.ndarray  # (R,) cost of a wrong depth above that of the best, 0..1
    rival: np.ndarray  # (R,) cost of the next best that is apart from it, above the best; inf without one


@dataclass(frozen=True)
class _Look:
    """The present outline against the earlier ones, at one depth of every row."""

    rho: np.ndarray  # (N,) where it was taken
    residual: np.ndarray  # (K, N) px along the normal
    gain: np.ndarray  # (K, N) px per unit of rho
    good: np.ndarray  # (K, N) whether there is a match


@dataclass(frozen=True)
class _Fit:
    rho: np.ndarray  # (R,) 1/cm at the region's middle
    slope: np.ndarray  # (R, 2) per px
    covariance: np.ndarray  # (R, 3, 3) of rho and slope, for independent residuals of one px
    scale_px: np.ndarray  # (R,) residual
    weight: np.ndarray  # (K, N) robust weights
    gain: np.ndarray  # (K, N) px per unit of rho
    cost: np.ndarray  # (N,) mean truncated cost, 0..1


class OutlineMethod:
    """Keeps earlier outlines and answers with depths of regions."""

    def __init__(self, lens: Lens, config: DepthConfig) -> None:
        self._lens = lens
        self._config = config
        self._focal = np.array([lens.fx, lens.fy])
        self._centre = np.array([lens.cx, lens.cy])
        self._keyframes = Keyframes(lens, config)
        self.own_share: dict[int, float] = {}  # by region, of the outline not owned by something nearer

    def update(self, snapshot: Snapshot, station: Station) -> dict[int, OutlineDepth | Declined]:
        """Depths of the regions of `snapshot`, seen from `station`, by region id."""
        outline = usable_outline(snapshot.contour, self._lens, self._config.outline_border_px)
        answers = self._answers(snapshot.regions, outline, station)
        kept = self._keyframes.stations
        if not kept or (
            np.linalg.norm(station.pose.position_cm - kept[-1].pose.position_cm) >= self._config.min_step_cm
        ):
            self._keyframes.add(outline, faces_of(snapshot.regions), station)
        return answers

    def _answers(
        self, regions: tuple[Region, ...], outline: Outline, station: Station
    ) -> dict[int, OutlineDepth | Declined]:
        self.own_share = {}
        motions = [station.pose.relative_to(s.pose) for s in self._keyframes.stations]
        self._shift = np.array([t for _, t in motions]).reshape(-1, 3)
        if not (np.linalg.norm(self._shift, axis=1) >= self._config.min_step_cm).any():
            return {r.id: Declined("no motion yet") for r in regions}
        self._alike = self._alike_regions(regions)
        middle = np.array([polygon_moments(r.loops)[1] for r in regions]).reshape(-1, 2)
        sides, pairs = self._sides(regions, outline, middle, [r for r, _ in motions])
        if len(sides.region) == 0:
            return {r.id: Declined("no outline to measure") for r in regions}
        n = len(regions)
        scan = self._scan(sides, n)
        rho = scan.rho
        flat = np.zeros((n, 2))
        everyone = np.ones(len(sides.region))
        for gate in GATES_PX:
            fit = self._fit(sides, self._look(sides, rho, flat), everyone, rho, flat, gate)
            rho = fit.rho
        own = everyone
        outline_px = np.array([_outline_length(r) for r in regions])
        border = np.array([r.touches_border for r in regions])
        left = sides.side == 0
        boundary_px = np.bincount(sides.pair[left], sides.length_px[left], len(pairs))
        for _ in range(2):
            cost = np.column_stack([_mean(sides.pair[s], fit.cost[s], len(pairs)) for s in (left, ~left)])
            own = edge_owners(pairs, cost, rho, boundary_px, outline_px, border)[sides.pair, sides.side]
            own = own.astype(float)
            fit = self._fit(sides, self._look(sides, rho, flat), own, rho, flat, GATES_PX[-1])
            rho = fit.rho
        width_px = np.sqrt(np.array([max(r.area_px, 1.0) for r in regions]))
        tilt = PLANE_TILT * 2 / self._focal.mean() * rho  # per px: the width cancels
        tilted = self._fit(sides, self._look(sides, rho, flat), own, rho, flat, GATES_PX[-1], tilt)
        tilted = self._fit(
            sides,
            self._look(sides, tilted.rho, tilted.slope),
            own,
            tilted.rho,
            tilted.slope,
            GATES_PX[-1],
            tilt,
        )
        length = np.bincount(sides.region, sides.length_px, n)
        shares = np.bincount(sides.region, own * sides.length_px, n) / np.maximum(length, 1e-9)
        self.own_share = {
            r.id: float(s) for r, s, known in zip(regions, shares, length > 0, strict=True) if known
        }
        return {
            region.id: self._answer(i, region, float(width_px[i]), station, sides, own, scan, fit, tilted)
            for i, region in enumerate(regions)
        }

    def _alike_regions(self, regions: tuple[Region, ...]) -> np.ndarray:
        """(K, R, M) whether a present region may be what a region of a keyframe was: its id or its colour."""
        now, kept = faces_of(regions), self._keyframes.faces
        widest = max(len(k.ids) for k in kept)
        alike = np.zeros((len(kept), len(regions), widest), bool)
        for k, then in enumerate(kept):
            apart = np.linalg.norm(now.rgb[:, None] - then.rgb[None], axis=2)
            alike[k, :, : len(then.ids)] = (now.ids[:, None] == then.ids) | (apart < LIKE_RGB)
        return alike

    def _sides(
        self, regions: tuple[Region, ...], outline: Outline, middle: np.ndarray, turns: list[np.ndarray]
    ) -> tuple[_Sides, np.ndarray]:
        ids = np.array([r.id for r in regions], np.int64)
        left, right = rows_of(outline.left, ids), rows_of(outline.right, ids)
        known = np.nonzero((left >= 0) & (right >= 0))[0]
        keys, pair = np.unique(left[known] * len(ids) + right[known], return_inverse=True)
        pairs = np.column_stack([keys // len(ids), keys % len(ids)])
        # every stride-th sample of each boundary, in the order of the contour
        count = np.bincount(pair, minlength=len(keys))
        stride = np.maximum(-(-count // self._config.outline_points), 1)
        chosen = _rank_within(pair, count) % stride[pair] == 0
        point, pair = known[chosen], pair[chosen]
        length = outline.length_px[point] * stride[pair]
        xy, normal = outline.xy_px[point], outline.normal[point]
        rays = np.column_stack([(xy - self._centre) / self._focal, np.ones(len(xy))])
        along = np.column_stack([-normal[:, 1], normal[:, 0]]) / self._focal
        turn = np.array(turns)
        base = np.einsum("kij,nj->ikn", turn, rays)
        swing = np.einsum("kij,nj->ikn", turn[:, :, :2], along)
        tangent = (swing[:2] - base[:2] / base[2] * swing[2]) * self._focal[:, None, None]
        tangent /= np.maximum(np.hypot(tangent[0], tangent[1]), 1e-12)
        turned = np.stack([tangent[1], -tangent[0]])
        both = np.tile(np.arange(len(point)), 2)
        region = np.concatenate([pairs[pair, 0], pairs[pair, 1]])
        sides = _Sides(
            region,
            pair[both],
            np.repeat([0, 1], len(point)),
            length[both],
            xy[both] - middle[region],
            np.tile(base, 2),
            np.tile(turned, 2),
            np.tile(direction_of(turned[0], turned[1]), 2),
        )
        return sides, pairs

    def _project(
        self,
        base: np.ndarray,
        normal: np.ndarray,
        direction: np.ndarray,
        which: np.ndarray,
        rho: np.ndarray,
        region: np.ndarray,
        side: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residual along the normal (px), its derivative by rho, and whether there is a match."""
        tx, ty, tz = self._shift[which].transpose(2, 0, 1)
        depth = base[2] + rho * tz
        before = depth > 0.05
        inverse = 1 / np.where(before, depth, 1.0)
        x, y = (base[0] + rho * tx) * inverse, (base[1] + rho * ty) * inverse
        fx, fy = self._focal
        qx, qy = x * fx + self._centre[0], y * fy + self._centre[1]
        match = self._keyframes.match(which, qx, qy, direction)
        cosine = match.normal_x * normal[0] + match.normal_y * normal[1]
        # between two points of an arc the mean normal is across their chord
        sense = np.where(cosine < 0, -1.0, 1.0)
        nx, ny = match.normal_x * sense + normal[0], match.normal_y * sense + normal[1]
        cosine = np.abs(cosine)
        length = 1 / np.sqrt(np.maximum(2 + 2 * cosine, 1e-6))
        nx, ny = nx * length, ny * length
        dx, dy = qx - match.x_px, qy - match.y_px
        residual = dx * nx + dy * ny
        along = dx * ny - dy * nx
        good = before & match.found & (cosine > LIKE_NORMAL) & (np.abs(along) < ALONG_PX)
        # the region itself must lie on the same side of the edge; what lies beyond may have changed
        inner = np.where((side == 0) == (sense > 0), match.left, match.right)
        _, present, widest = self._alike.shape
        good &= self._alike.take((which * present + region) * widest + inner, mode="clip") & (inner >= 0)
        gain = ((tx - x * tz) * (fx * nx) + (ty - y * tz) * (fy * ny)) * inverse
        return residual, gain, good

    def _scan(self, sides: _Sides, n: int) -> _Scan:
        """Try log-spaced inverse depths on a few samples of each region."""
        c = self._config
        trials = 1 / np.geomspace(c.nearest_cm, c.farthest_cm, TRIALS)
        count = np.bincount(sides.region, minlength=n)
        stride = np.maximum(count // TRIAL_POINTS, 1)
        pick = np.nonzero(_rank_within(sides.region, count) % stride[sides.region] == 0)[0]
        frames = np.arange(len(self._shift))[:, None]
        residual, _, good = self._project(
            sides.base[:, None, :, pick],
            sides.normal[:, None, :, pick],
            sides.direction[:, pick],
            frames,
            trials[:, None, None],
            sides.region[pick],
            sides.side[pick],
        )
        cost = np.where(good, np.minimum((residual / TRIAL_GATE_PX) ** 2, 1.0), 1.0).sum(axis=1)
        table = np.stack([np.bincount(sides.region[pick], row, n) for row in cost])
        cost = table / np.maximum(np.bincount(sides.region[pick], minlength=n) * len(self._shift), 1)
        best = np.argmin(cost, axis=0)
        lowest = cost.min(axis=0)
        # a rival is a dip beyond a rise of the cost, seen from the best trial
        nearer = np.arange(TRIALS)[:, None] <= best
        rise = np.where(
            nearer,
            np.maximum.accumulate(np.where(nearer, cost, 0.0)[::-1], axis=0)[::-1],
            np.maximum.accumulate(np.where(nearer, 0.0, cost), axis=0),
        )
        rival = np.where(rise - cost > RIVAL_RISE, cost, np.inf).min(axis=0)
        return _Scan(trials[best], np.quantile(cost, 0.9, axis=0) - lowest, rival - lowest)

    def _look(self, sides: _Sides, rho: np.ndarray, slope: np.ndarray) -> _Look:
        local = rho[sides.region] + slope[sides.region, 0] * sides.offset[:, 0]
        local += slope[sides.region, 1] * sides.offset[:, 1]
        which = np.arange(len(sides.direction))[:, None]
        look = self._project(
            sides.base, sides.normal, sides.direction, which, local, sides.region, sides.side
        )
        return _Look(local, *look)

    def _fit(
        self,
        sides: _Sides,
        look: _Look,
        own: np.ndarray,
        rho: np.ndarray,
        slope: np.ndarray,
        gate: float,
        tilt: np.ndarray | None = None,
    ) -> _Fit:
        """Robust least squares of 1/Z of all regions at once, on residuals linear in rho.

        Parameters
        ----------
        own : (N,) 0..1, how much a row counts
        rho, slope : (R,), (R, 2) where `look` was taken
        gate : residuals beyond so many px are not used
        tilt : (R,) standard error of a slope before looking, per px; None for depths without slope
        """
        region, n, gain = sides.region, len(rho), look.gain
        offset_x, offset_y = sides.offset.T
        valid = (look.good & (np.abs(look.residual) < gate)).astype(float)
        scale = np.full(n, 1.0)
        residual, weight = look.residual, valid
        covariance = np.zeros((n, 3, 3))
        for _ in range(REFITS):
            total = 1 + weight.sum(0)
            common = (weight * residual).sum(0) / total
            reach = np.minimum(gate, TUKEY * scale)[region]
            weight = valid * np.square(np.maximum(1 - ((residual - common) / reach) ** 2, 0))
            total = 1 + weight.sum(0)
            weighted = weight * gain
            mean_gain, common = weighted.sum(0) / total, (weight * residual).sum(0) / total
            trust = own * np.maximum(1 - (common / gate) ** 2, 0)
            information = trust * ((weighted * gain).sum(0) - total * mean_gain**2)
            gradient = trust * ((weighted * residual).sum(0) - total * mean_gain * common)
            spread = (weight * (residual - common) ** 2).sum(0)
            freedom = np.bincount(region, trust * (total - 1) * (1 - 1 / total), n)
            # Tukey's weights hide part of the spread
            scale = 1.25 * np.sqrt(np.bincount(region, trust * spread, n) / np.maximum(freedom, 1e-9))
            scale = np.where(freedom > 0, np.maximum(self._config.outline_noise_px, scale), 1.0)
            step, covariance = _step(region, information, gradient, sides.offset, slope, scale, tilt, n)
            step[:, 0] = np.clip(step[:, 0], -0.3 * rho, 0.5 * rho)
            rho, slope = np.clip(rho + step[:, 0], 1e-6, 1.0), slope + step[:, 1:]
            moved = rho[region] + slope[region, 0] * offset_x + slope[region, 1] * offset_y - look.rho
            residual = look.residual + gain * moved
        final = np.minimum(((residual - common) / gate) ** 2, 1.0)
        cost = np.where(look.good, final, 1.0).mean(axis=0)
        return _Fit(rho, slope, covariance, scale, weight * trust, gain, cost)

    def _answer(
        self,
        i: int,
        region: Region,
        width_px: float,
        station: Station,
        sides: _Sides,
        own: np.ndarray,
        scan: _Scan,
        fit: _Fit,
        tilted: _Fit,
    ) -> OutlineDepth | Declined:
        c = self._config
        rows = np.nonzero(sides.region == i)[0]
        if len(rows) == 0:
            return Declined("no outline to measure")
        mine, length = own[rows], sides.length_px[rows]
        if not mine.any():
            return Declined("its outline belongs to nearer regions")
        found_px = float((mine * length * (fit.weight[:, rows].max(axis=0) > 0.1)).sum())
        found = float(fit.weight[:, rows].sum() / (mine.sum() * len(fit.weight)))
        if found_px < max(MIN_OWN_PX, MIN_OWN_SHARE * length.sum()) or found < MIN_FOUND:
            return Declined("too little of its outline was found again")
        if scan.contrast[i] < MIN_CONTRAST:
            return Declined("many depths fit its outline alike")
        if scan.rival[i] < MIN_RIVAL:
            return Declined("two depths fit its outline")
        # the common unknown of each sample is part of what one px of residual is worth
        used = fit
        slope = tilted.slope[i]
        spacing = max(1.0, float(np.average(length, weights=np.maximum(mine, 1e-9))))
        correlation = max(1.0, c.outline_correlation / spacing)
        slope_variance = tilted.covariance[i, 1:, 1:] * tilted.scale_px[i] ** 2 * correlation
        cut = region.touches_border or float(np.average(mine, weights=length)) < WHOLE_SHARE
        slanted = slope.any() and bool(slope @ np.linalg.solve(slope_variance, slope) > PLANE_CHI2)
        slanted = slanted and (cut or may_be_one_face(region.loops[0]))
        if slanted:
            used = tilted
        rho, weight, gain = float(used.rho[i]), used.weight[:, rows], used.gain[:, rows]
        shift_px = rho * float(np.sqrt((weight * gain**2).sum() / max(weight.sum(), 1e-9)))
        if shift_px < MIN_SHIFT_PX:
            return Declined("too little motion for its distance")
        noise = used.scale_px[i] ** 2 * correlation * used.covariance[i, 0, 0] / rho**2
        width = width_px / float(self._focal.mean())  # w / Z
        relief = FLAT if slanted else relief_of(region.loops[0], cut)
        bow = 0.0
        if slanted:
            extent = region.loops[0].max(axis=0) - region.loops[0].min(axis=0)
            bow = float(((slope * extent / rho) ** 2).sum()) / 12  # mean of 1/rho over 1/mean of rho
        silhouette = (1 + bow) / rho
        surface = silhouette * (1 - relief.k * width)
        variance = noise + (relief.sigma_k * width) ** 2 + c.outline_model_share**2
        variance += self._odometry(station, weight, gain, rho, sides.normal[:, :, rows])
        relative = float(np.sqrt(variance))
        if relative > c.max_relative_sigma:
            return Declined(f"too uncertain ({100 * relative:.0f} %)")
        estimate = Estimate(surface, relative * surface)
        return OutlineDepth(estimate, silhouette, (float(slope[0]), float(slope[1])) if slanted else None)

    def _odometry(
        self, station: Station, weight: np.ndarray, gain: np.ndarray, rho: float, normal: np.ndarray
    ) -> float:
        """Relative variance of the depth from errors of travel and rotation."""
        stations = self._keyframes.stations
        evidence = (weight * gain**2).sum(axis=1)
        if evidence.sum() <= 0:
            return 0.0
        share = evidence / evidence.sum()
        travel = np.array([travel_sigma_cm(station, s) for s in stations])
        reach = np.maximum(np.linalg.norm(self._shift, axis=1), 1e-9)
        # a turn shifts the whole frame; an outline all round a thing feels little of it
        turn_px = (
            np.array([rotation_sigma_rad(station, s, self._config) for s in stations]) * self._focal.mean()
        )
        pull = np.hypot(*(weight * gain * normal).sum(axis=2)) / np.maximum(evidence, 1e-12) / rho
        return float((share * ((travel / reach) ** 2 + (pull * turn_px) ** 2)).sum())


def _outline_length(region: Region) -> float:
    """Length of all loops in px, the image border included."""
    return float(sum(np.hypot(*np.diff(np.vstack([p, p[:1]]), axis=0).T).sum() for p in region.loops))


def _mean(index: np.ndarray, values: np.ndarray, n: int) -> np.ndarray:
    return np.bincount(index, values, n) / np.maximum(np.bincount(index, minlength=n), 1)


def _rank_within(group: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Position of each element among those of its group, in order of appearance."""
    order = np.argsort(group, kind="stable")
    rank = np.empty(len(group), np.int64)
    rank[order] = np.arange(len(group)) - np.repeat(np.cumsum(count) - count, count)
    return rank


def _step(
    region: np.ndarray,
    information: np.ndarray,
    gradient: np.ndarray,
    offset: np.ndarray,
    slope: np.ndarray,
    scale_px: np.ndarray,
    tilt: np.ndarray | None,
    n: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Newton step (R, 3) of rho and slope, and the covariance (R, 3, 3) for residuals of one px."""
    h00 = np.bincount(region, information, n)
    g0 = np.bincount(region, gradient, n)
    covariance = np.zeros((n, 3, 3))
    if tilt is None:
        covariance[:, 0, 0] = 1 / np.maximum(h00, 1e-12)
        return np.column_stack([-g0 * covariance[:, 0, 0], np.zeros((n, 2))]), covariance
    u, v = offset.T
    h = np.empty((n, 3, 3))
    h[:, 0, 0] = h00
    h[:, 0, 1] = h[:, 1, 0] = np.bincount(region, information * u, n)
    h[:, 0, 2] = h[:, 2, 0] = np.bincount(region, information * v, n)
    h[:, 1, 2] = h[:, 2, 1] = np.bincount(region, information * u * v, n)
    h[:, 1, 1] = np.bincount(region, information * u * u, n)
    h[:, 2, 2] = np.bincount(region, information * v * v, n)
    g = np.column_stack([g0, np.bincount(region, gradient * u, n), np.bincount(region, gradient * v, n)])
    prior = (scale_px / tilt) ** 2
    h[:, 1, 1] += prior
    h[:, 2, 2] += prior
    g[:, 1:] += prior[:, None] * slope
    size = np.sqrt(np.maximum(h[:, [0, 1, 2], [0, 1, 2]], 1e-12))
    inverse = np.linalg.inv(h / (size[:, :, None] * size[:, None, :]) + 1e-9 * np.eye(3))
    covariance = inverse / (size[:, :, None] * size[:, None, :])
    return -(covariance @ g[..., None])[..., 0], covariance
