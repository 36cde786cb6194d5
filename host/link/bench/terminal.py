"""What a person at a terminal sees of a run: a bar while it lasts, then one table and the verdict."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator

from host.link.bench.result import Cell, Result
from host.link.bench.verdict import Grade

COLOURS = {Grade.HEALTHY: "green", Grade.NOTE: "cyan", Grade.FAULTY: "yellow", Grade.UNSAFE: "bold red"}
Advance = Callable[[float], None]  # by how much of the total


def cell_text(cell: Cell) -> str:
    """A number to three or four digits, a text as it is, nothing for None."""
    if cell is None:
        return "–"
    if isinstance(cell, str):
        return cell
    if isinstance(cell, int):
        return f"{cell:,}"
    if not math.isfinite(cell):
        return "–"
    size = abs(cell)
    if size < 1e-9:
        return "0.00"
    if size < 0.01:
        return f"{cell:.1e}"
    return f"{cell:,.0f}" if size >= 1000 else f"{cell:.1f}" if size >= 10 else f"{cell:.2f}"


@contextlib.contextmanager
def progress(what: str, total: float) -> Iterator[Advance]:
    """A bar on stderr where that is a terminal; nothing elsewhere."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = ("{task.description}", BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda amount: bar.advance(task, amount)


def show(result: Result) -> None:
    """Table and verdict on stdout."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console()
    if not console.is_terminal:
        console.width = 120
    table = Table(title=f"{result.command}, {result.robot}", title_justify="left")
    for k, name in enumerate(result.columns):
        table.add_column(name, justify="left" if k == 0 else "right", overflow="fold")
    for row in result.rows:
        table.add_row(*(Text(cell_text(cell)) for cell in row))
    console.print(table)
    console.print(Text(result.verdict.text, style=COLOURS[result.verdict.grade]), soft_wrap=True)
