"""The paper's experiments, rendered, run its way and ours, and written up as docs/experiments.md.

    python -m host.experiments [--seeds 30] [--jobs 2] [--out docs] [--json FILE]

The page, its pictures and the file appear only when all runs are done.
"""

from __future__ import annotations

from host.errors import UsageError, begin_command, run_command

if __name__ == "__main__":
    begin_command()

import json
import time
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from host.config import Config, read_command_line

if TYPE_CHECKING:  # so that --help need not wait for OpenCV
    from host.experiments.page import Outcome

MOST_SEEDS, MOST_JOBS = 1000, 64


@dataclass(frozen=True)
class ExperimentOptions:
    """Run the paper's three experiments, its way and ours, and write a page with tables and plots."""

    seeds: int = 30  # runs of each experiment
    jobs: int = 2  # processes that share the work
    out: Path = Path("docs")  # folder for experiments.md and pictures/
    json: Path | None = None  # write every depth with its truth to this file

    def __post_init__(self) -> None:
        for name, most in (("seeds", MOST_SEEDS), ("jobs", MOST_JOBS)):
            value = getattr(self, name)
            if not 1 <= value <= most:
                raise UsageError(f"--{name} must be from 1 to {most}, not {value}")


def run(options: ExperimentOptions, config: Config) -> None:
    """Do all of it; the places for the results are looked at first."""
    if find_spec("matplotlib") is None:
        raise UsageError("matplotlib not found, which draws the plots: .venv/bin/pip install -e '.[plots]'")
    from host.experiments.catalogue import tasks
    from host.experiments.overlays import overlay
    from host.experiments.page import PICTURES, PLOT, outcome_of, page
    from host.experiments.plots import errors_plot
    from host.experiments.pool import run_all
    from host.record.atomic import check_writable, write_whole

    check_writable(options.out, folder=True)
    check_writable(options.out / "pictures", folder=True)
    if options.json is not None:
        check_writable(options.json, folder=False)
    start = time.monotonic()
    work = tasks(options.seeds, config.net, config.depth)
    results = run_all(work, options.jobs)
    outcome = outcome_of(results, options.seeds)
    for task, result in zip(work, results, strict=True):
        if task.course.name in PICTURES and task.seed == 0:
            write_whole(options.out / "pictures" / PICTURES[task.course.name], overlay(_ends(result.stills)))
    write_whole(options.out / "pictures" / PLOT, errors_plot(outcome.findings))
    write_whole(options.out / "experiments.md", page(outcome).encode())
    if options.json is not None:
        write_whole(options.json, json.dumps(_figures(outcome)).encode() + b"\n")
    _print(outcome, options, time.monotonic() - start)


def _ends(stills: list[Any]) -> list[Any]:
    """First and last frame, and what lies half-way where that is far."""
    return [still for still in stills if still.travel_cm in (0.0, stills[-1].travel_cm, 100.0)]


def _figures(outcome: Outcome) -> dict[str, Any]:
    return {
        "seeds": outcome.seeds,
        "targets": [
            {
                "what": t.what,
                "wanted": t.wanted,
                "found": t.found if t.known else None,
                "unit": t.unit,
                "reached": t.reached,
            }
            for t in outcome.targets
        ],
        "findings": [asdict(row) for row in outcome.findings.rows],
        "pulls": [asdict(row) for row in outcome.pulls],
        "turns": [asdict(row) for row in outcome.turns],
        "times": [asdict(row) for row in outcome.times],
    }


def _print(outcome: Outcome, options: ExperimentOptions, seconds: float) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    if not console.is_terminal:
        console.width = 120
    table = Table(title=f"runs of each experiment: {options.seeds}", title_justify="left")
    table.add_column("figure", overflow="fold")
    for name in ("wanted", "found", "answers"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("reached")
    for target in outcome.targets:
        table.add_row(
            target.what, target.wanted, target.found_text, target.answers, "yes" if target.reached else "no",
            style=None if target.reached else "bold",
        )  # fmt: skip
    console.print(table)
    reached = sum(target.reached for target in outcome.targets)
    console.print(f"{reached} of {len(outcome.targets)} figures reached, {seconds:.0f} s", highlight=False)
    console.print(f"page: {options.out / 'experiments.md'}", highlight=False, soft_wrap=True, markup=False)


def main() -> None:
    """The command."""
    options, config = read_command_line(ExperimentOptions)
    run(options, config)


if __name__ == "__main__":
    run_command(main)
