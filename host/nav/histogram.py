"""Median and percentiles of any number of times in a fixed amount of memory."""

from __future__ import annotations

import math

import numpy as np

LEAST_MS, MOST_MS = 1e-3, 1e6
STEP = 1.01  # from one bin to the next: percentiles are within half a percent
STEP_LOG = math.log(STEP)


class Histogram:
    """Times in ms, counted in bins that are each one percent wide."""

    def __init__(self) -> None:
        self._bins = [0] * (math.ceil(math.log(MOST_MS / LEAST_MS, STEP)) + 1)
        self.count = 0

    def add(self, ms: float) -> None:
        """Count one."""
        at = math.log(max(ms, LEAST_MS) / LEAST_MS) / STEP_LOG
        self._bins[min(round(at), len(self._bins) - 1)] += 1
        self.count += 1

    def percentile(self, percent: float) -> float | None:
        """The least time that so many percent do not exceed; None where none was counted."""
        if self.count == 0:
            return None
        rank = max(1, math.ceil(percent / 100 * self.count))
        found = int(np.searchsorted(np.cumsum(self._bins), rank))
        return LEAST_MS * STEP**found

    def summary(self) -> dict[str, float | None]:
        """{median, p95} as result.json has them."""
        found = {"median": self.percentile(50), "p95": self.percentile(95)}
        return {name: None if ms is None else float(f"{ms:.3g}") for name, ms in found.items()}
