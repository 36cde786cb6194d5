"""Checks of the benchmarks' options, before any work is done."""

from __future__ import annotations

from pathlib import Path

from host.errors import UsageError
from host.record.atomic import check_writable


def at_least(name: str, value: float, least: float) -> None:
    """Raise UsageError where an option is too small to measure anything."""
    if not value >= least:
        raise UsageError(f"--{name} {value:g}: give at least {least:g}")


def check_json(path: Path | None) -> None:
    """Raise UsageError where the figures could not be written later."""
    if path is not None:
        check_writable(path, folder=False)
