"""Findings in few numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from host.experiments.findings import Finding


@dataclass(frozen=True)
class Summary:
    """Absolute errors in percent; nan where nothing was found."""

    asked: int
    found: int
    rms: float
    median: float
    p95: float
    largest: float


def summary_of(errors: Iterable[float]) -> Summary:
    """Of errors in percent, nan for those without an answer."""
    given = np.abs(np.array(list(errors), float))
    known = given[np.isfinite(given)]
    if len(known) == 0:
        return Summary(len(given), 0, np.nan, np.nan, np.nan, np.nan)
    return Summary(
        len(given),
        len(known),
        float(np.sqrt(np.mean(known**2))),
        float(np.median(known)),
        float(np.percentile(known, 95)),
        float(known.max()),
    )


@dataclass(frozen=True)
class Findings:
    """All findings, to choose from."""

    rows: tuple[Finding, ...]

    def where(self, test: Callable[[Finding], bool] = lambda _: True, /, **wanted: object) -> Findings:
        """Those whose fields have these values (or one of these, for a tuple) and that pass a test."""
        rows = self.rows
        for name, value in wanted.items():
            allowed = value if isinstance(value, tuple) else (value,)
            rows = tuple(row for row in rows if getattr(row, name) in allowed)
        return Findings(tuple(row for row in rows if test(row)))

    def values(self, name: str) -> list[object]:
        """The different values of a field, in the order of their appearance."""
        return list(dict.fromkeys(getattr(row, name) for row in self.rows))

    @property
    def summary(self) -> Summary:
        """Of all errors here."""
        return summary_of(row.error for row in self.rows)
