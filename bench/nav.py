"""The main job in many worlds: rooms, corridors and clutter, each from its own seed.

    python -m bench.nav [--worlds N] [--jobs N] [--first-seed S] [--rough] [--json FILE]

Every world is driven by ``host/nav_loop.py`` in a process of its own. Worlds without a way of 40 cm to the
goal count for collisions only. Frame times are of processes that share the machine with each other. Nothing
passes or fails here.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track as progress
from rich.table import Table

from bench.figures_file import check_json, write_json
from bench.options import at_least
from host.errors import run_command
from host.sim.drive_scenes import PATH_WIDTH_CM
from host.sim.scenes import world_from_uri

KINDS = ("room", "corridor", "clutter")
NAV_LOOP = Path(__file__).resolve().parents[1] / "host" / "nav_loop.py"
SIGMAS = (1, 2)


@dataclass(frozen=True)
class Options:
    """Drive through many worlds and print a table."""

    worlds: int = 200
    """Worlds in all: rooms, corridors and clutter in turn."""
    jobs: int = os.cpu_count() or 1
    """Drives at a time."""
    first_seed: int = 1000
    """Seed of the first world of each kind."""
    rough: bool = False
    """With a poor webcam: rows read in turn, late and unevenly, a distorting lens, more noise."""
    max_time: float = 120.0
    """Simulated seconds after which a drive ends."""
    json: Path | None = None
    """Also write the figures, and every drive's own, to this file."""


def drive(uri: str, max_time_s: float) -> dict[str, Any]:
    """result.json of one drive, or what went wrong."""
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "result.json"
        command = [
            sys.executable, str(NAV_LOOP), "--no-view", "--camera", uri, "--max-time", str(max_time_s),
            "--json", str(result),
        ]  # fmt: skip
        # One thread each, so that as many drives as cores do not fight for them.
        alone = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run(command, capture_output=True, text=True, cwd=folder, env=alone)
        if not result.exists():
            return {"camera": uri, "failed": done.stderr.strip().splitlines()[-1:] or ["no result"]}
        return json.loads(result.read_text())


def summary(drives: list[dict[str, Any]]) -> dict[str, Any]:
    """The figures of some drives together."""
    ran = [one for one in drives if "failed" not in one]
    open_ways = [one for one in ran if one["has_path"]]
    depths = [d for one in ran for d in one["depths"] or [] if not d["background"]]
    error = np.array([d["error_percent"] for d in depths])
    known = [d for d in depths if d["sigma_cm"]]
    pull = np.array([abs(d["depth_cm"] - d["true_cm"]) / d["sigma_cm"] for d in known])
    metres = sum(one["true_distance_cm"] for one in ran) / 100
    return {
        "drives": len(drives),
        "failed": len(drives) - len(ran),
        "with_a_way": len(open_ways),
        "reached_percent": _percent(one["outcome"] == "goal" for one in open_ways),
        "collisions": sum(one["collisions"] for one in ran),
        "closest_cm": min((one["min_clearance_cm"] for one in ran), default=None),
        "metres": metres,
        "seconds_median": _median(one["duration_s"] for one in open_ways if one["outcome"] == "goal"),
        "depth_median_percent": _median(np.abs(error)),
        "depth_p90_percent": float(np.percentile(np.abs(error), 90)) if len(error) else None,
        "within_sigmas_percent": {n: _percent(pull <= n) for n in SIGMAS},
        "pose_error_cm_median": _median(
            one["final_pose_error"]["position_cm"] for one in ran if one["final_pose_error"]
        ),
        "frame_ms_median": _median(one["frame_time_ms"]["median"] for one in ran),
        "frame_ms_p95": _median(one["frame_time_ms"]["p95"] for one in ran),
    }


def _median(values: Any) -> float | None:
    listed = list(values)
    return float(np.median(listed)) if listed else None


def _percent(hits: Any) -> float | None:
    listed = list(hits)
    return 100 * float(np.mean(listed)) if listed else None


ROWS = {
    "drives": "drives",
    "failed": "ended without a result",
    "with_a_way": f"with a way of {PATH_WIDTH_CM:.0f} cm",
    "reached_percent": "of these, goal reached, %",
    "collisions": "collisions",
    "closest_cm": "closest to anything, cm",
    "metres": "driven, m",
    "seconds_median": "time to the goal, median, s",
    "depth_median_percent": "depth of things, median error, %",
    "depth_p90_percent": "90 % below, %",
    "pose_error_cm_median": "pose at the end off by, median, cm",
    "frame_ms_median": "frame, capture to command, median, ms",
    "frame_ms_p95": "p95, ms",
}


def print_table(figures: dict[str, dict[str, Any]]) -> None:
    """One column for each kind of world, and one for all."""
    table = Table(title="The main job in many worlds", title_justify="left")
    table.add_column("")
    for kind in figures:
        table.add_column(kind, justify="right")
    for key, name in ROWS.items():
        table.add_row(name, *(_number(one[key]) for one in figures.values()))
    for n in SIGMAS:
        shares = [one["within_sigmas_percent"][n] for one in figures.values()]
        table.add_row(f"depth within {n} sigma, %", *map(_number, shares))
    Console().print(table)


def _number(value: float | None) -> str:
    if value is None:
        return "-"
    return str(value) if isinstance(value, int) else f"{value:.1f}"


def main() -> None:
    """The command."""
    import tyro

    options = tyro.cli(Options, description=__doc__)
    at_least("worlds", options.worlds, 1)
    at_least("jobs", options.jobs, 1)
    at_least("max-time", options.max_time, 1)
    check_json(options.json)
    rough = "&rough=1" if options.rough else ""
    uris = []
    for n in range(options.worlds):
        kind, seed = KINDS[n % len(KINDS)], options.first_seed + n // len(KINDS)
        uris.append(f"sim:{kind}?seed={seed}{rough}")
    drives: list[dict[str, Any]] = []
    with ThreadPoolExecutor(options.jobs) as pool:
        running = [pool.submit(drive, uri, options.max_time) for uri in uris]
        console = Console(stderr=True)
        for done in progress(as_completed(running), "driving", len(uris), console=console, transient=True):
            one = done.result()
            one["has_path"] = world_from_uri(one["camera"]).has_path(PATH_WIDTH_CM)
            drives.append(one)
    drives.sort(key=lambda one: uris.index(one["camera"]))
    figures = {kind: summary([one for one in drives if f":{kind}?" in one["camera"]]) for kind in KINDS}
    figures["all"] = summary(drives)
    print_table(figures)
    for one in drives:
        if "failed" in one:
            print(f"{one['camera']}: {one['failed'][0]}")
        elif one["collisions"] or (one["has_path"] and one["outcome"] != "goal"):
            print(f"{one['camera']}: {one['outcome']}, {one['collisions']} collisions: {one['reason']}")
    write_json(options.json, {"figures": figures, "drives": drives})


if __name__ == "__main__":
    run_command(main)
