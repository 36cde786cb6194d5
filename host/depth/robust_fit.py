"""Robust least squares of 1/Z of all regions at once.

Residuals are linear in the inverse depth of their sample, r = r0 + g (rho - rho0). What a sample's own
position along its normal contributes to all its residuals alike is an unknown of its own, with the
present frame's measurement as one more observation, and eliminated: per sample the weighted mean over
its frames and itself is taken off residuals and gains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from host.depth.comparison import Look
from host.depth.samples import Samples

TUKEY = 4.7  # residuals so many times their scale have no weight
PASSES = 2  # of robust weighting on one look
COST_SCALES = 3.0  # residuals so many times the usual scale all cost the same
RHO_LIMITS = (1e-6, 1.0)  # 1/cm


@dataclass(frozen=True)
class Fit:
    """Inverse depths of all regions, 1/Z = rho + slope . (x - middle)."""

    rho: np.ndarray  # (R,) 1/cm at the region's middle
    slope: np.ndarray  # (2, R) per px
    covariance: np.ndarray  # (R, 3, 3) of rho and slope, for independent residuals of one px
    scale_px: np.ndarray  # (R,) of the residuals
    weight: np.ndarray  # (K, N) robust weights
    gain: np.ndarray  # (K, N) px per unit of rho
    cost: np.ndarray  # (N,) mean truncated cost, 0..1


@dataclass(frozen=True)
class Model:
    """What is fitted, and how far to trust it beforehand."""

    noise_px: float  # an outline is never taken to be better than this
    gate_px: float  # residuals beyond are not used
    tilt: np.ndarray | None = None  # (R,) standard error of a slope before looking; None for no slope


def fit(
    samples: Samples, look: Look, own: np.ndarray, rho: np.ndarray, slope: np.ndarray, model: Model
) -> Fit:
    """Fit from one look.

    Parameters
    ----------
    own : (N,) 0..1, how much a row counts
    rho, slope : (R,), (2, R) where the look was taken
    """
    region, n, gain, gate = samples.region, len(rho), look.gain, model.gate_px
    valid = (look.good & (np.abs(look.residual) < gate)).astype(np.float32)
    residual, weight = look.residual, valid
    scale = np.ones(n)
    covariance = np.zeros((n, 3, 3))
    total = 1 + valid.sum(0)
    common = _dot(weight, residual) / total
    for _ in range(PASSES):
        reach = np.minimum(gate, TUKEY * scale)[region].astype(np.float32)
        weight = valid * np.square(np.maximum(1 - np.square((residual - common) / reach), 0))
        total = 1 + weight.sum(0)
        weighted = weight * gain
        mean_gain, common = weighted.sum(0) / total, _dot(weight, residual) / total
        # a sample that is off in all frames alike is not on the outline it was taken for
        trust = own * np.maximum(1 - np.square(common / gate), 0)
        information = trust * (_dot(weighted, gain) - total * mean_gain**2)
        gradient = trust * (_dot(weighted, residual) - total * mean_gain * common)
        spread = trust * _dot(weight, np.square(residual - common))
        freedom = np.bincount(region, trust * (total - 1) * (1 - 1 / total), n)
        # Tukey's weights hide part of the spread
        scale = 1.25 * np.sqrt(np.bincount(region, spread, n) / np.maximum(freedom, 1e-9))
        scale = np.where(freedom > 0, np.maximum(model.noise_px, scale), 1.0)
        prior = None if model.tilt is None else (scale / model.tilt) ** 2
        step, covariance = _step(region, information, gradient, samples.offset, slope, prior, n)
        rho = np.clip(rho + np.clip(step[0], -0.3 * rho, 0.5 * rho), *RHO_LIMITS)
        slope = slope + step[1:]
        moved = rho[region] - look.rho
        if model.tilt is not None:
            moved = moved + (slope[:, region] * samples.offset).sum(0)
        residual = look.residual + gain * moved.astype(np.float32)
    known = np.bincount(region, minlength=n) > 0
    truncate = float(np.clip(COST_SCALES * np.median(scale[known]), model.noise_px, gate))
    cost = np.where(look.good, np.minimum(np.square((residual - common) / truncate), 1), 1).mean(axis=0)
    return Fit(rho, slope, covariance, scale, weight * trust.astype(np.float32), gain, cost)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("kn,kn->n", a, b)


def _step(
    region: np.ndarray,
    information: np.ndarray,
    gradient: np.ndarray,
    offset: np.ndarray,
    slope: np.ndarray,
    prior: np.ndarray | None,
    n: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Newton step (3, R) of rho and slope, and the covariance (R, 3, 3) for residuals of one px."""
    h00 = np.bincount(region, information, n)
    g0 = np.bincount(region, gradient, n)
    covariance = np.zeros((n, 3, 3))
    if prior is None:
        covariance[:, 0, 0] = 1 / np.maximum(h00, 1e-12)
        return np.stack([-g0 * covariance[:, 0, 0], np.zeros(n), np.zeros(n)]), covariance
    u, v = offset
    h = np.empty((n, 3, 3))
    h[:, 0, 0] = h00
    h[:, 0, 1] = h[:, 1, 0] = np.bincount(region, information * u, n)
    h[:, 0, 2] = h[:, 2, 0] = np.bincount(region, information * v, n)
    h[:, 1, 2] = h[:, 2, 1] = np.bincount(region, information * u * v, n)
    h[:, 1, 1] = np.bincount(region, information * u * u, n) + prior
    h[:, 2, 2] = np.bincount(region, information * v * v, n) + prior
    g = np.stack([g0, np.bincount(region, gradient * u, n), np.bincount(region, gradient * v, n)], axis=1)
    g[:, 1:] += prior[:, None] * slope.T
    size = np.sqrt(np.maximum(h[:, [0, 1, 2], [0, 1, 2]], 1e-12))
    scaled = h / (size[:, :, None] * size[:, None, :]) + 1e-9 * np.eye(3)
    covariance = np.linalg.inv(scaled) / (size[:, :, None] * size[:, None, :])
    return -np.einsum("rij,rj->ir", covariance, g), covariance
