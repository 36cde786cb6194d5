"""Depth from the motion of whole outlines: the main method.

The present outline is carried into earlier frames by the known motion and a trial inverse depth rho,

    q_k = first two of (R_k p + rho t_k), divided by the third

and compared with the outline found there, along the normal only. Vertices (Eq. 7-13) are its case of
single points, area (Eq. 14-18) its case of uniform growth. One rho is fitted for each region to all kept
frames together, robustly; where the outline supports it, rho = a + b x + c y over the image, which is
exact for slanted planes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from host.camera.lens import Lens
from host.depth.comparison import Comparison
from host.depth.config import DepthConfig
from host.depth.keyframes import Keyframes, Outline, faces_of, usable_outline
from host.depth.motion import Station, rotation_sigma_rad, travel_sigma_cm
from host.depth.ownership import edge_owners
from host.depth.polygon import outline_length, polygon_moments
from host.depth.report import Declined, Estimate
from host.depth.robust_fit import Fit, Model, fit
from host.depth.samples import Samples, samples_of
from host.depth.surface import FLAT, may_be_one_face, relief_of
from host.depth.trials import Start, best_trials
from host.rbdn.snapshot import Region, Snapshot

GATES_PX = (5.0, 3.5, 2.5)  # residuals beyond are not used; shrinks as the fit settles
MIN_OWN_PX = 20.0  # of outline that is the region's own
MIN_OWN_SHARE = 0.25  # of its outline within the image
MIN_FOUND = 0.2  # of its own outline over all kept frames
MIN_CONTRAST = 0.15  # of a wrong depth's cost above the best
MIN_RIVAL = 0.05  # of another dip's cost above the best
MIN_SHIFT_PX = 0.3  # by which the outline must have moved over the image
WHOLE_SHARE = 0.9  # of its outline that must be its own for the shape to say something
CUT_CHI2 = 12.0  # a slope of a cut region is believed when so far from zero in units of its variance
FACE_CHI2 = 20.0  # and of a whole face, which a box with a side face may look like
FACE_SLANT = 0.45  # tangent of the slant from which a whole face is slanted
PLANE_TILT = 0.9  # prior: relative change of depth over half a width, in widths over depth


@dataclass(frozen=True)
class OutlineDepth:
    """What the outline says of a region."""

    surface: Estimate  # mean over the visible surface
    silhouette_cm: float  # where the outline itself is
    slope: tuple[float, float] | None  # d(1/Z)/dx, dy per px, where the outline shows a slant


@dataclass(frozen=True)
class OutlineAnswers:
    """What the outlines of one frame say, by region id."""

    depths: dict[int, OutlineDepth | Declined]
    own_share: dict[int, float]  # of its outline that is not the outline of something nearer


@dataclass(frozen=True)
class _Motion:
    """From the present frame to the kept ones."""

    turns: np.ndarray  # (K, 3, 3)
    shifts_cm: np.ndarray  # (K, 3)
    travel: np.ndarray  # (K,) relative variance of the length of the shift
    turn_px: np.ndarray  # (K,) shift of the image that the error of the rotation makes


@dataclass(frozen=True)
class _Support:
    """How much of its outline every region has found again, and what errors of the motion do to it."""

    length_px: np.ndarray  # (R,) outline between regions
    own: np.ndarray  # (R,) share of it that is the region's own
    found_px: np.ndarray  # (R,) own outline found in some frame
    found: np.ndarray  # (R,) share of the own outline found, over all frames
    spacing_px: np.ndarray  # (R,) outline for one used sample
    shift_px: np.ndarray  # (R,) typical motion over the image
    motion: np.ndarray  # (R,) relative variance of the depth from errors of travel and rotation


class OutlineMethod:
    """Keeps earlier outlines and answers with depths of regions."""

    def __init__(self, lens: Lens, config: DepthConfig) -> None:
        self._lens = lens
        self._config = config
        self._focal_px = 0.5 * (lens.fx + lens.fy)
        self._keyframes = Keyframes(lens, config)

    def update(self, snapshot: Snapshot, station: Station) -> OutlineAnswers:
        """Depths of the regions of `snapshot`, seen from `station`."""
        outline = usable_outline(snapshot.contour, self._lens, self._config.outline_border_px)
        answers = self._answers(snapshot.regions, outline, station)
        kept = self._keyframes.stations
        if not kept or (
            np.linalg.norm(station.pose.position_cm - kept[-1].pose.position_cm) >= self._config.min_step_cm
        ):
            self._keyframes.add(outline, faces_of(snapshot.regions), station)
        return answers

    def _answers(self, regions: tuple[Region, ...], outline: Outline, station: Station) -> OutlineAnswers:
        motion = self._motion(station)
        if not (np.linalg.norm(motion.shifts_cm, axis=1) >= self._config.min_step_cm).any():
            return OutlineAnswers({r.id: Declined("no motion yet") for r in regions}, {})
        faces = faces_of(regions)
        middle = np.array([polygon_moments(r.loops)[1] for r in regions]).reshape(-1, 2)
        limit = self._config.outline_points
        samples = samples_of(outline, faces.ids, middle, motion.turns, self._lens, limit)
        if len(samples.region) == 0:
            return OutlineAnswers({r.id: Declined("no outline to measure") for r in regions}, {})
        n = len(regions)
        comparison = Comparison(self._keyframes, motion.shifts_cm, faces, self._lens)
        start = best_trials(comparison, samples, n, self._config)
        flat = np.zeros((2, n))
        own = np.ones(len(samples.region))
        now = None
        rho = start.rho
        for gate in GATES_PX:
            look = comparison.look(samples, rho[samples.region])
            now = fit(samples, look, own, rho, flat, self._model(gate))
            rho = now.rho
        assert now is not None
        for _ in range(2):
            own = self._owners(samples, now, regions)
            look = comparison.look(samples, rho[samples.region])
            now = fit(samples, look, own, rho, flat, self._model(GATES_PX[-1]))
            rho = now.rho
        tilt = PLANE_TILT * 2 / self._focal_px * rho  # per px: the width cancels
        tilted = fit(samples, look, own, rho, flat, self._model(GATES_PX[-1], tilt))
        level = self._support(samples, own, now, motion)
        slanted = self._support(samples, own, tilted, motion)
        known = level.length_px > 0
        return OutlineAnswers(
            {r.id: self._answer(i, r, start, now, level, tilted, slanted) for i, r in enumerate(regions)},
            {r.id: float(s) for r, s, k in zip(regions, level.own, known, strict=True) if k},
        )

    def _model(self, gate_px: float, tilt: np.ndarray | None = None) -> Model:
        return Model(self._config.outline_noise_px, gate_px, tilt)

    def _motion(self, station: Station) -> _Motion:
        stations = self._keyframes.stations
        moves = [station.pose.relative_to(s.pose) for s in stations]
        shifts = np.array([t for _, t in moves]).reshape(-1, 3)
        reach = np.maximum(np.linalg.norm(shifts, axis=1), 1e-9)
        travel = np.array([travel_sigma_cm(station, s) for s in stations])
        turn = np.array([rotation_sigma_rad(station, s, self._config) for s in stations])
        turns = np.array([r for r, _ in moves]).reshape(-1, 3, 3)
        return _Motion(turns, shifts, (travel / reach) ** 2, turn * self._focal_px)

    def _owners(self, samples: Samples, now: Fit, regions: tuple[Region, ...]) -> np.ndarray:
        """(N,) 1 where a row's region may use the sample, else 0."""
        count = len(samples.pairs)
        sides = [samples.side == 0, samples.side == 1]
        rows = np.maximum(np.bincount(samples.pair[sides[0]], minlength=count), 1)
        cost = np.column_stack([np.bincount(samples.pair[s], now.cost[s], count) / rows for s in sides])
        mine = edge_owners(
            samples.pairs,
            cost,
            now.rho,
            np.bincount(samples.pair[sides[0]], samples.length_px[sides[0]], count),
            np.array([outline_length(r.loops) for r in regions]),
            np.array([r.touches_border for r in regions]),
        )
        return mine[samples.pair, samples.side].astype(float)

    def _support(self, samples: Samples, own: np.ndarray, now: Fit, motion: _Motion) -> _Support:
        n, region = len(now.rho), samples.region

        def total(values: np.ndarray) -> np.ndarray:
            return np.bincount(region, values, n)

        rows = np.maximum(total(own), 1e-9)
        length, weight = total(samples.length_px), now.weight
        mine = total(own * samples.length_px)
        pull = weight * now.gain
        evidence = pull * now.gain
        # a turn shifts the whole frame; an outline all round a thing feels little of it
        per_frame = np.stack([total(e) for e in evidence])  # (K, R)
        drag = np.stack([[total(g) for g in pull * axis] for axis in samples.normal])  # (2, K, R)
        lever = np.hypot(*drag) / np.maximum(per_frame, 1e-12) / now.rho * motion.turn_px[:, None]
        all_frames = np.maximum(per_frame.sum(axis=0), 1e-12)
        share = per_frame / all_frames
        return _Support(
            length,
            mine / np.maximum(length, 1e-9),
            total(own * samples.length_px * (weight.max(axis=0) > 0.1)),
            total(weight.mean(axis=0)) / rows,
            mine / rows,
            now.rho * np.sqrt(all_frames / np.maximum(total(weight.sum(axis=0)), 1e-9)),
            (share * (motion.travel[:, None] + lever**2)).sum(axis=0),
        )

    def _answer(
        self,
        i: int,
        region: Region,
        start: Start,
        level_fit: Fit,
        level: _Support,
        tilted_fit: Fit,
        tilted: _Support,
    ) -> OutlineDepth | Declined:
        c = self._config
        if level.length_px[i] == 0:
            return Declined("no outline to measure")
        if level.own[i] == 0:
            return Declined("its outline belongs to nearer regions")
        if (
            level.found_px[i] < max(MIN_OWN_PX, MIN_OWN_SHARE * level.length_px[i])
            or level.found[i] < MIN_FOUND
        ):
            return Declined("too little of its outline was found again")
        if start.contrast[i] < MIN_CONTRAST:
            return Declined("many depths fit its outline alike")
        if start.rival[i] < MIN_RIVAL:
            return Declined("two depths fit its outline")
        if level.shift_px[i] < MIN_SHIFT_PX:
            return Declined("too little motion for its distance")
        correlation = max(1.0, c.outline_correlation / max(1.0, float(level.spacing_px[i])))
        cut = region.touches_border or level.own[i] < WHOLE_SHARE
        slope = tilted_fit.slope[:, i]
        doubt = tilted_fit.covariance[i, 1:, 1:] * tilted_fit.scale_px[i] ** 2 * correlation
        chi2 = float(slope @ np.linalg.solve(doubt, slope))
        slant = float(np.hypot(*slope)) * self._focal_px / float(tilted_fit.rho[i])
        if cut:
            slanted = chi2 > CUT_CHI2
        else:
            slanted = chi2 > FACE_CHI2 and slant > FACE_SLANT and may_be_one_face(region.loops[0])
        now, support = (tilted_fit, tilted) if slanted else (level_fit, level)
        rho = float(now.rho[i])
        silhouette = 1 / rho
        if slanted:
            extent = np.ptp(region.loops[0], axis=0)
            silhouette *= 1 + float(((slope * extent / rho) ** 2).sum()) / 12  # mean of 1/rho over 1/mean
        width = float(np.sqrt(max(region.area_px, 1.0))) / self._focal_px  # w / Z
        relief = FLAT if slanted else relief_of(region.loops[0], cut)
        noise = now.scale_px[i] ** 2 * correlation * now.covariance[i, 0, 0] / rho**2
        model = (relief.sigma_k * width) ** 2 + c.outline_model_share**2
        if slanted:
            model += (0.5 * (1 - float(level_fit.rho[i]) / rho)) ** 2  # it might be no plane after all
        relative = float(np.sqrt(noise + model + support.motion[i]))
        if not relative < c.max_relative_sigma:
            return Declined(f"too uncertain ({100 * relative:.0f} %)")
        surface = silhouette * (1 - relief.k * width)
        tilt = (float(slope[0]), float(slope[1])) if slanted else None
        return OutlineDepth(Estimate(surface, relative * surface), silhouette, tilt)
