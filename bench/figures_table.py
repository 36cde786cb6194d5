"""The table that a benchmark's figures are printed in: a row for each figure, a column for each kind."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table


def print_figures(
    title: str,
    rows: Mapping[str, str],
    figures: Mapping[str, Mapping[str, Any]],
    heads: Mapping[str, str] | None = None,
) -> None:
    """Print what there is.

    Parameters
    ----------
    title
        Above the table.
    rows
        The words for every figure; one that the last column lacks is left out.
    figures
        By column.
    heads
        Words of a line of its own above some figures.
    """
    table = Table(title=title, title_justify="left")
    table.add_column("")
    for column in figures:
        table.add_column(column, justify="right")
    known = list(figures.values())[-1]
    for key, name in rows.items():
        if key not in known:
            continue
        if heads and key in heads and table.row_count:
            table.add_section()
            table.add_row(heads[key])
        table.add_row(name, *(_number(one.get(key)) for one in figures.values()))
    Console().print(table)


def percent(hits: Iterable[bool]) -> float | None:
    """How many of them are true; None of none."""
    listed = list(hits)
    return 100 * float(np.mean(listed)) if listed else None


def _number(value: float | None) -> str:
    if value is None:
        return "-"
    return str(value) if isinstance(value, int) else f"{value:.1f}"
