"""Whole drives of `--approach`: how far from the asked distance does the robot stop?

    python -m bench.approach [--runs N] [--jobs N] [--first-seed S] [--rough] [--json FILE]

Rooms, corridors and clutter in turn, a robot of its own in each, 10, 20 and 40 cm asked in turn. The truth is
the way that the robot could still go straight on when the drive is over. Where that way ends at something the
robot has never approached, as beyond the edge of the map, a run counts as not ended. Nothing passes or fails
here.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.drives import Drive, run_all
from bench.figures_file import check_json, write_json
from bench.figures_table import print_figures
from bench.options import at_least
from host.config import read_options
from host.errors import run_command

TITLE = "Stopping before what is ahead"
KINDS = ("room", "corridor", "clutter")
ASKED_CM = (10.0, 20.0, 40.0)
WITHIN_CM = 3.0


@dataclass(frozen=True)
class Options:
    """Approach what is ahead in many worlds and print a table."""

    runs: int = 40
    """Drives in all."""
    jobs: int = os.cpu_count() or 1
    """Drives at a time."""
    first_seed: int = 1
    """Seed of the first world of each kind, and of the first robot."""
    rough: bool = False
    """With a poor webcam, and with robots that are not as they are believed to be."""
    json: Path | None = None
    """Also write the figures, and every run's own, to this file."""


def drives_of(options: Options) -> list[tuple[Drive, float]]:
    """Every drive with the distance that is asked."""
    drives = []
    for n in range(options.runs):
        kind, seed = KINDS[n % len(KINDS)], options.first_seed + n // len(KINDS)
        asked = ASKED_CM[(n + n // len(KINDS)) % len(ASKED_CM)]
        more, robot = ("&rough=1", "sim:?rough=1&seed=") if options.rough else ("", "sim:?seed=")
        camera, robot = f"sim:{kind}?seed={seed}{more}", f"{robot}{options.first_seed + n}"
        drives.append((Drive(camera, robot, ("--approach", f"{asked:g}"), 240.0), asked))
    return drives


def outcome_of(result: dict[str, Any], asked_cm: float) -> dict[str, Any]:
    """What the table needs of one result."""
    if "failed" in result:
        return {"camera": result["camera"], "outcome": "failed", "reason": result["failed"], "off_cm": None}
    ended = result["outcome"] == "approached"
    return {
        "camera": result["camera"],
        "robot": result["robot"],
        "asked_cm": asked_cm,
        "outcome": result["outcome"],
        "reason": result["reason"],
        "off_cm": result["room_ahead_cm"] - asked_cm if ended else None,
        "collisions": result["collisions"],
        "duration_s": result["duration_s"],
    }


def summary(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """The figures of some runs together."""
    off = np.array([one["off_cm"] for one in runs if one["off_cm"] is not None])
    within = int((np.abs(off) <= WITHIN_CM).sum())
    return {
        "runs": len(runs),
        "approached": len(off),
        "within_percent": 100 * within / len(off) if len(off) else None,
        "within_of_all_percent": 100 * within / len(runs) if runs else None,
        "median_cm": float(np.median(off)) if len(off) else None,
        "median_abs_cm": float(np.median(np.abs(off))) if len(off) else None,
        "p95_abs_cm": float(np.percentile(np.abs(off), 95)) if len(off) else None,
        "collisions": sum(one.get("collisions") or 0 for one in runs),
    }


ROWS = {
    "runs": "runs",
    "approached": "ended before what is ahead",
    "within_percent": f"of these within {WITHIN_CM:g} cm, %",
    "within_of_all_percent": f"of all within {WITHIN_CM:g} cm, %",
    "median_cm": "stopped too far away by, median, cm",
    "median_abs_cm": "off either way, median, cm",
    "p95_abs_cm": "95 % below, cm",
    "collisions": "collisions",
}


def main() -> None:
    """The command."""
    options = read_options(Options)
    at_least("runs", options.runs, 1)
    at_least("jobs", options.jobs, 1)
    check_json(options.json)
    drives = drives_of(options)
    results = run_all([drive for drive, _ in drives], options.jobs, "approaching")
    runs = [outcome_of(result, asked) for result, (_, asked) in zip(results, drives, strict=True)]
    figures = {f"{cm:g} cm": summary([one for one in runs if one.get("asked_cm") == cm]) for cm in ASKED_CM}
    figures["all"] = summary(runs)
    print_figures(TITLE, ROWS, figures)
    for one in runs:
        if one["off_cm"] is None or abs(one["off_cm"]) > WITHIN_CM:
            off = "" if one["off_cm"] is None else f"{one['off_cm']:+.1f} cm: "
            print(f"{one['camera']} {one.get('robot', '')}: {one['outcome']}, {off}{one['reason']}")
    write_json(options.json, {"figures": figures, "runs": runs})


if __name__ == "__main__":
    run_command(main)
