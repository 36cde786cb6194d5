"""Whole drives to a goal with something crossing ahead: does the robot give way?

    python -m bench.movers [--runs N] [--jobs N] [--first-seed S] [--rough] [--json FILE]

Rooms, corridors and clutter in turn, in each one thing that goes to and fro across the straight way to the
goal and gives way to nobody. A collision is a touch while the robot drives; a touch while it stands or turns
is told apart, for there the other one drove into it. Nothing passes or fails here.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.drives import Drive, run_all
from bench.figures_file import check_json, write_json
from bench.figures_table import percent, print_figures
from bench.options import at_least
from host.config import read_options
from host.errors import run_command

TITLE = "Something crosses ahead"
KINDS = ("room", "corridor", "clutter")
YIELDS = ("giving way", "comes this way", "moving)")  # in a reason: the robot knows that something moves


@dataclass(frozen=True)
class Options:
    """Drive past moving things in many worlds and print a table."""

    runs: int = 50
    """Drives in all."""
    jobs: int = os.cpu_count() or 1
    """Drives at a time."""
    first_seed: int = 1
    """Seed of the first world of each kind, and of the first robot."""
    rough: bool = False
    """With a poor webcam, and with robots that are not as they are believed to be."""
    max_time: float = 120.0
    """Simulated seconds after which a drive ends."""
    json: Path | None = None
    """Also write the figures, and every run's own, to this file."""


def drives_of(options: Options) -> list[Drive]:
    """Every drive: its world, its robot."""
    drives = []
    for n in range(options.runs):
        kind, seed = KINDS[n % len(KINDS)], options.first_seed + n // len(KINDS)
        more, robot = ("&rough=1", "sim:?rough=1&seed=") if options.rough else ("", "sim:?seed=")
        camera = f"sim:{kind}?seed={seed}&movers=1{more}"
        drives.append(Drive(camera, f"{robot}{options.first_seed + n}", (), options.max_time))
    return drives


def outcome_of(result: dict[str, Any]) -> dict[str, Any]:
    """What the table needs of one result."""
    if "failed" in result:
        return {"camera": result["camera"], "outcome": "failed", "reason": result["failed"]}
    reasons = [one["reason"] for one in result["decisions"]]
    return {
        **{key: result[key] for key in ("camera", "robot", "outcome", "reason", "collisions", "run_into")},
        "min_clearance_cm": result["min_clearance_cm"],
        "duration_s": result["duration_s"],
        "gave_way": any(word in reason for reason in reasons for word in YIELDS),
    }


def summary(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """The figures of some runs together."""
    ran = [one for one in runs if one["outcome"] != "failed"]
    return {
        "runs": len(runs),
        "failed": len(runs) - len(ran),
        "untouched_percent": percent([one["collisions"] == 0 for one in ran]),
        "not_run_into_percent": percent([one["run_into"] == 0 for one in ran]),
        "reached_percent": percent([one["outcome"] == "goal" for one in ran]),
        "gave_way_percent": percent([one["gave_way"] for one in ran]),
    }


ROWS = {
    "runs": "runs",
    "failed": "ended without a result",
    "untouched_percent": "drove into nothing, %",
    "not_run_into_percent": "nothing ran into it, %",
    "reached_percent": "goal reached, %",
    "gave_way_percent": "saw something move and said so, %",
}


def main() -> None:
    """The command."""
    options = read_options(Options)
    at_least("runs", options.runs, 1)
    at_least("jobs", options.jobs, 1)
    at_least("max-time", options.max_time, 1)
    check_json(options.json)
    runs = [outcome_of(one) for one in run_all(drives_of(options), options.jobs, "crossing")]
    figures = {kind: summary([one for one in runs if f":{kind}?" in one["camera"]]) for kind in KINDS}
    figures["all"] = summary(runs)
    print_figures(TITLE, ROWS, figures)
    for one in runs:
        if one["outcome"] != "goal" or one["collisions"] or one["run_into"]:
            touches = f"{one.get('collisions')} collisions, run into {one.get('run_into')} times"
            print(f"{one['camera']}: {one['outcome']}, {touches}: {one['reason']}")
    write_json(options.json, {"figures": figures, "runs": runs})


if __name__ == "__main__":
    run_command(main)
