"""Checks of the benchmarks' options, before any work is done."""

from __future__ import annotations

from host.errors import UsageError


def at_least(name: str, value: float, least: float) -> None:
    """Raise UsageError where an option is too small to measure anything."""
    if not value >= least:
        raise UsageError(f"--{name} {value:g}: give at least {least:g}")
