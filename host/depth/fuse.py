"""One depth from several methods, and from the frames before.

Methods look at the same outline, so their errors are correlated: the combined sigma is computed with
that correlation and never pretends to independent evidence. Over time a region's last answer, moved
along with the camera, is averaged with the new one as if both shared all their errors: weights by
sigma, sigma the weighted mean. Every method already uses all frames of the run, so nothing is lost,
and no number of frames taken at rest can sharpen an answer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from host.depth.config import DepthConfig
from host.depth.motion import Station, travel_sigma_cm
from host.depth.outline import OutlineDepth
from host.depth.report import Estimate, RegionDepth

METHOD_CORRELATION = 0.5
DISAGREEMENT_SIGMAS = 3.0
FORGET_FRAMES = 30  # a region not seen for so long is new when it comes back


@dataclass(frozen=True)
class Combined:
    """The outcome of `combine`."""

    estimate: Estimate
    method: str  # with the greatest weight
    note: str | None


def combine(estimates: dict[str, Estimate]) -> Combined | None:
    """Weighted mean of the methods' answers; one that contradicts the outline is left out and named.

    The outline forgives what the others do not see: an edge that vanished, a corner that slid, an area
    that took in a shadow. Without it the surest of the others is the measure.
    """
    if not estimates:
        return None
    surest = min(estimates, key=lambda m: estimates[m].sigma_cm)
    best = estimates.get("outline", estimates[surest])
    agreeing, odd = [], []
    for name, e in estimates.items():
        gate = DISAGREEMENT_SIGMAS * np.hypot(e.sigma_cm, best.sigma_cm)
        (agreeing if abs(e.depth_cm - best.depth_cm) <= gate else odd).append(name)
    z = np.array([estimates[m].depth_cm for m in agreeing])
    sigma = np.array([estimates[m].sigma_cm for m in agreeing])
    weight = sigma**-2 / (sigma**-2).sum()
    covariance = METHOD_CORRELATION * np.outer(sigma, sigma)
    np.fill_diagonal(covariance, sigma**2)
    note = f"contradicted by {', '.join(odd)}" if odd else None
    fused = Estimate(float(weight @ z), float(np.sqrt(weight @ covariance @ weight)))
    return Combined(fused, agreeing[int(np.argmax(weight))], note)


@dataclass(frozen=True)
class _Remembered:
    estimate: Estimate
    method: str
    ray: np.ndarray  # (3,) towards the region's middle, third component 1
    station: Station
    seq: int


class Memory:
    """The last answer of every region, carried along with the camera."""

    def __init__(self, config: DepthConfig) -> None:
        self._config = config
        self._last: dict[int, _Remembered] = {}

    def forget(self, region_id: int) -> None:
        """The region is no longer what it was."""
        self._last.pop(region_id, None)

    def forget_unseen(self, seq: int) -> None:
        """Drop regions that were not seen for long."""
        for old in [k for k, m in self._last.items() if seq - m.seq > FORGET_FRAMES]:
            del self._last[old]

    def predict(self, region_id: int, station: Station) -> Estimate | None:
        """What the last answer is worth from here; None where there is none."""
        last = self._last.get(region_id)
        if last is None:
            return None
        r, t = last.station.pose.relative_to(station.pose)
        depth = float((r @ (last.ray * last.estimate.depth_cm) + t)[2])
        if depth <= 0:
            return None
        moved = float(np.linalg.norm(t))
        drift = self._config.memory_share_per_cm * moved * depth
        odometry = travel_sigma_cm(station, last.station) if moved > 0 else 0.0
        sigma = np.sqrt(last.estimate.sigma_cm**2 + drift**2 + odometry**2)
        return Estimate(depth, float(sigma))

    def update(
        self,
        region_id: int,
        measured: Combined | None,
        ray: np.ndarray,
        station: Station,
    ) -> tuple[Estimate, str, str | None] | None:
        """Average the new answer with the remembered one.

        Parameters
        ----------
        region_id : the region
        measured : what the methods say now; None to carry the last answer on
        ray : (3,) towards the region's middle, third component 1
        station : the present place

        Returns
        -------
        tuple or None
            estimate, method, and a note where there is something to say.
        """
        before = self.predict(region_id, station)
        last = self._last.get(region_id)
        note = measured.note if measured else None
        if measured is None:
            if before is None or last is None:
                return None
            if before.sigma_cm > self._config.max_relative_sigma * before.depth_cm:
                self.forget(region_id)
                return None
            # the ray and the sigma stay those of the last measurement, so that carrying adds nothing twice
            return before, last.method, "carried on from an earlier frame"
        now = measured.estimate
        if before is not None and last is not None:
            if (
                np.linalg.norm(station.pose.position_cm - last.station.pose.position_cm)
                < self._config.min_step_cm
            ):
                # at rest nothing new is learnt
                return before, last.method, note
            gate = DISAGREEMENT_SIGMAS * np.hypot(before.sigma_cm, now.sigma_cm)
            if abs(before.depth_cm - now.depth_cm) > gate:
                note = "differs from its last depth; begun anew"
            else:
                w = now.sigma_cm**-2 / (now.sigma_cm**-2 + before.sigma_cm**-2)
                now = Estimate(
                    w * now.depth_cm + (1 - w) * before.depth_cm, w * now.sigma_cm + (1 - w) * before.sigma_cm
                )
        self._last[region_id] = _Remembered(now, measured.method, ray, station, station.seq)
        return now, measured.method, note


def as_region_depth(
    answer: tuple[Estimate, str, str | None] | None,
    estimates: dict[str, Estimate],
    declined: dict[str, str],
    outline: OutlineDepth | None,
) -> RegionDepth:
    """The report's line on one region."""
    silhouette = outline.silhouette_cm if outline else None
    slope = outline.slope if outline else None
    if answer is None:
        reasons = "; ".join(f"{m}: {why}" for m, why in declined.items())
        return RegionDepth(None, None, None, reasons, estimates, declined)
    estimate, method, note = answer
    return RegionDepth(
        estimate.depth_cm, estimate.sigma_cm, method, note, estimates, declined, silhouette, slope
    )
