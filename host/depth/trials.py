"""Log-spaced trial depths of every region: where to start, and how clear the answer is.

A depth from before is never the only start: a wrong one would keep itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from host.depth.comparison import Comparison
from host.depth.config import DepthConfig
from host.depth.samples import Samples, rank_within

TRIALS = 40
POINTS = 12  # samples of each region looked at
GATE_PX = 2.5  # residuals beyond all cost the same
RIVAL_RISE = 0.05  # by which the cost must rise between two dips


@dataclass(frozen=True)
class Start:
    """The best of many trial depths of every region, and how clearly it is the best."""

    rho: np.ndarray  # (R,) 1/cm
    contrast: np.ndarray  # (R,) cost of a wrong depth above that of the best, 0..1
    rival: np.ndarray  # (R,) cost of the next best that is apart from it, above the best; inf without one


def best_trials(comparison: Comparison, samples: Samples, n: int, config: DepthConfig) -> Start:
    """Try depths on a few samples of each of `n` regions in all earlier frames."""
    trials = 1 / np.geomspace(config.nearest_cm, config.farthest_cm, TRIALS)
    count = np.bincount(samples.region, minlength=n)
    stride = np.maximum(count // POINTS, 1)
    rows = np.nonzero(rank_within(samples.region, count) % stride[samples.region] == 0)[0]
    look = comparison.look(samples, trials[:, None, None], rows)
    each = np.where(look.good, np.minimum((look.residual / GATE_PX) ** 2, 1), 1).mean(axis=1)  # (T, N)
    region = samples.region[rows]
    cost = np.stack([np.bincount(region, row, n) for row in each])
    cost /= np.maximum(np.bincount(region, minlength=n), 1)
    best, lowest = np.argmin(cost, axis=0), cost.min(axis=0)
    # a rival is a dip beyond a rise of the cost, seen from the best trial
    before = np.arange(TRIALS)[:, None] <= best
    rise = np.where(
        before,
        np.maximum.accumulate(np.where(before, cost, 0.0)[::-1], axis=0)[::-1],
        np.maximum.accumulate(np.where(before, 0.0, cost), axis=0),
    )
    rival = np.where(rise - cost > RIVAL_RISE, cost, np.inf).min(axis=0)
    return Start(trials[best], np.quantile(cost, 0.9, axis=0) - lowest, rival - lowest)
