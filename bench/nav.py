"""The main job in many worlds, judged by the truth: safety, depth, landmarks, time, in one table.

    python -m bench.nav [--rooms N] [--jobs N] [--first-seed S] [--only PART] [--plain] [--json FILE]

Every drive is ``host/nav_loop.py`` in a process of its own, with all models on unless ``--plain`` is said:
a poor webcam (rows read in turn, late, uneven, noisy, a distorting lens) on a body drawn at random (motors,
lag, dead zone, battery, wheels, encoder edges, slip). Worlds without a way of 40 cm to the goal count for
collisions only. Frame times are taken at the end, one drive at a time. Nothing passes or fails here.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from bench import approach, movers
from bench.drives import Drive, run_all
from bench.figures_file import check_json, write_json
from bench.figures_table import percent, print_figures
from bench.options import at_least
from host.config import read_options
from host.errors import run_command
from host.nav.map import RANGE_CM
from host.nav.stand import FARTHEST_DEPTH_CM, USABLE
from host.sim.drive_scenes import PATH_WIDTH_CM, free_loop
from host.sim.scenes import world_from_uri

KINDS = ("room", "corridor", "clutter")
THERE_CM = 15.0  # who says it is at the goal, farther off than this by its own pose, is not
LOOP_CM = 2000.0
LOOP_PLANNED_CM = 2600.0  # goals count as reached 10 cm before them: about so much is driven of it
LOOP_WHEELS = 3  # percent by which the left wheel is larger, which nobody has told the robot
Part = Literal["worlds", "approach", "movers", "loops", "time"]
PARTS: tuple[Part, ...] = ("worlds", "approach", "movers", "loops", "time")


@dataclass(frozen=True)
class Options:
    """Drive through many worlds and print a table."""

    rooms: int = 200
    """Worlds in all: rooms, corridors and clutter in turn; a quarter as many drives for each other part."""
    jobs: int = os.cpu_count() or 1
    """Drives at a time."""
    first_seed: int = 1000
    """Seed of the first world of each kind."""
    only: Part | None = None
    """Measure this part alone."""
    plain: bool = False
    """An ordinary webcam on an ordinary body."""
    max_time: float = 120.0
    """Simulated seconds after which a drive ends."""
    json: Path | None = None
    """Also write the figures, and every drive's own, to this file."""


def drives_of(part: Part, options: Options) -> list[Drive]:
    """What is driven for one part of the table."""

    rough = "" if options.plain else "&rough=1"

    def drive(kind: str, seed: int) -> Drive:
        return Drive(f"sim:{kind}?seed={seed}{rough}", f"sim:?seed={seed}{rough}", (), options.max_time)

    fewer = max(1, options.rooms // 4)
    if part == "approach":
        asked = approach.Options(runs=fewer, first_seed=options.first_seed, rough=not options.plain)
        return [one for one, _ in approach.drives_of(asked)]
    if part == "movers":
        return movers.drives_of(
            movers.Options(runs=fewer, first_seed=options.first_seed, rough=not options.plain)
        )
    if part == "worlds":
        numbers = range(options.rooms)
        return [drive(KINDS[n % len(KINDS)], options.first_seed + n // len(KINDS)) for n in numbers]
    if part == "loops":
        loops: list[Drive] = []
        for seed in itertools.count(options.first_seed):
            if len(loops) == max(1, options.rooms // 20):
                break
            try:
                loop = free_loop(world_from_uri(f"sim:room?seed={seed}"), LOOP_PLANNED_CM)
            except ValueError:
                continue  # there is no round way in every room
            task = ("--goal", *(f"{x:.0f},{z:.0f}" for x, z in loop))
            robot = f"sim:?seed={seed}{rough}&wheels={LOOP_WHEELS}"
            loops.append(Drive(f"sim:room?seed={seed}{rough}", robot, task, 5 * options.max_time))
        return loops
    return [drive(kind, options.first_seed) for kind in KINDS]


# --- Figures ------------------------------------------------------------------------------------------


def figures_of_worlds(drives: list[dict[str, Any]]) -> dict[str, Any]:
    """Safety and success of drives to a goal."""
    open_ways = [one for one in drives if one["has_path"]]
    metres = sum(one["true_distance_cm"] for one in drives) / 100
    false = sum(stop["false"] for one in drives for stop in one["stops"])
    return {
        "drives": len(drives),
        "metres": metres,
        "collisions": sum(one["collisions"] for one in drives),
        "closest_cm": min((one["min_clearance_cm"] for one in drives), default=None),
        "with_a_way": len(open_ways),
        "reached_percent": percent(_is_there(one) for one in open_ways),
        "elsewhere": sum(one["outcome"] == "goal" and not _is_there(one) for one in open_ways),
        "seconds_median": _median(one["duration_s"] for one in open_ways if one["outcome"] == "goal"),
        "false_stops_per_50_m": 50 * false / metres if metres else None,
        "refused_frames": sum(one["refused_frames"] for one in drives),
        **figures_of_depths(drives),
        "pose_error_cm_median": _median(e["position_cm"] for e in _present(drives, "final_pose_error")),
    }


def figures_of_depths(drives: list[dict[str, Any]]) -> dict[str, Any]:
    """Errors of the depths that the map takes, by which it is driven, and how honest their sigma is.

    A thing's front and a wall's come from the motion, from their foot on the floor, or from both. What the
    motion alone says of things is given as well.
    """

    def rows(key: str, background: bool, farthest_cm: float) -> list[dict[str, Any]]:
        return [
            one
            for drive in drives
            for one in drive[key] or []
            if one["background"] == background and one["depth_cm"] <= farthest_cm
            if one["sigma_cm"] and one["sigma_cm"] <= USABLE * one["depth_cm"]
        ]

    return {
        **_errors("depth", rows("fronts", False, RANGE_CM)),
        **_errors("wall", rows("fronts", True, RANGE_CM)),
        **_errors("motion", rows("depths", False, FARTHEST_DEPTH_CM)),
    }


def _errors(name: str, depths: list[dict[str, Any]]) -> dict[str, Any]:
    error = np.array([abs(d["error_percent"]) for d in depths])
    pull = np.array([abs(d["depth_cm"] - d["true_cm"]) / d["sigma_cm"] for d in depths])
    return {
        f"{name}s": len(depths),
        f"{name}_median_percent": _median(error),
        f"{name}_within_8_percent": percent(error <= 8.0),
        f"{name}_within_1_sigma_percent": percent(pull <= 1),
        f"{name}_within_2_sigma_percent": percent(pull <= 2),
    }


def figures_of_approaches(drives: list[dict[str, Any]]) -> dict[str, Any]:
    """How far from the distance asked for the robot stands at the end."""
    runs = [approach.outcome_of(one, _asked_cm(one)) for one in drives]
    return {f"approach_{key}": value for key, value in approach.summary(runs).items()}


def figures_of_movers(drives: list[dict[str, Any]]) -> dict[str, Any]:
    """Something crosses the way."""
    runs = [movers.outcome_of(one) for one in drives]
    return {f"mover_{key}": value for key, value in movers.summary(runs).items()}


def figures_of_loops(drives: list[dict[str, Any]]) -> dict[str, Any]:
    """Where the robot thinks it is after a long way that ends where it began."""
    ends = [(one["final_pose_error"], one["dead_reckoning_error"]) for one in drives]
    ratios = [dead["position_cm"] / max(pose["position_cm"], 1e-3) for pose, dead in ends if pose and dead]
    return {
        "loops": len(drives),
        "loops_done_percent": percent(one["outcome"] == "goal" for one in drives),
        "loop_metres": _median(one["true_distance_cm"] / 100 for one in drives),
        "loop_off_cm": _median(pose["position_cm"] for pose, _ in ends if pose),
        "loop_dead_reckoning_off_cm": _median(dead["position_cm"] for _, dead in ends if dead),
        "loop_times_nearer": _median(ratios),
        "loop_times_nearer_least": min(ratios, default=None),
    }


def figures_of_time(drives: list[dict[str, Any]]) -> dict[str, Any]:
    """Of one frame, capture to command."""
    return {
        "frame_ms_median": _median(one["frame_time_ms"]["median"] for one in drives),
        "frame_ms_p95": _median(one["frame_time_ms"]["p95"] for one in drives),
    }


FIGURES = {
    "worlds": figures_of_worlds,
    "approach": figures_of_approaches,
    "movers": figures_of_movers,
    "loops": figures_of_loops,
    "time": figures_of_time,
}


def _is_there(one: dict[str, Any]) -> bool:
    """At the goal, and not by the robot's own word alone."""
    error = one["final_pose_error"]
    return one["outcome"] == "goal" and error is not None and error["position_cm"] <= THERE_CM


def _asked_cm(one: dict[str, Any]) -> float:
    return float(one["task"].removeprefix("approaching up to ").removesuffix(" cm"))


def _present(drives: list[dict[str, Any]], key: str) -> list[Any]:
    return [one[key] for one in drives if one[key] is not None]


def _median(values: Iterable[float]) -> float | None:
    listed = list(values)
    return float(np.median(listed)) if listed else None


# --- Table --------------------------------------------------------------------------------------------

ROWS = {
    "drives": "drives",
    "metres": "driven, m",
    "collisions": "collisions",
    "closest_cm": "closest to anything, cm",
    "with_a_way": f"with a way of {PATH_WIDTH_CM:.0f} cm",
    "reached_percent": "of these, goal reached, %",
    "elsewhere": f"said to be there, over {THERE_CM:.0f} cm off",
    "seconds_median": "time to the goal, median, s",
    "false_stops_per_50_m": "stops for nothing, in 50 m",
    "refused_frames": "pictures not driven on",
    **{
        f"{name}{key}": said.format(what)
        for name, what in (
            ("depth", f"fronts of things on the map, up to {RANGE_CM / 100:g} m"),
            ("wall", "fronts of walls on the map"),
            ("motion", "depths of things by the motion alone"),
        )
        for key, said in (
            ("s", "{}"),
            ("_median_percent", "their error, median, %"),
            ("_within_8_percent", "within 8 %, %"),
            ("_within_1_sigma_percent", "within 1 sigma, %"),
            ("_within_2_sigma_percent", "within 2 sigma, %"),
        )
    },
    "pose_error_cm_median": "pose at the end off by, median, cm",
    **{f"approach_{key}": name for key, name in approach.ROWS.items()},
    **{f"mover_{key}": name for key, name in movers.ROWS.items()},
    "loops": f"loops of {LOOP_CM / 100:.0f} m, wheels {LOOP_WHEELS} % apart",
    "loops_done_percent": "came to their end, %",
    "loop_metres": "driven, median, m",
    "loop_off_cm": "pose at the end off by, median, cm",
    "loop_dead_reckoning_off_cm": "dead reckoning off by, median, cm",
    "loop_times_nearer": "times nearer, median",
    "loop_times_nearer_least": "times nearer, least",
    "frame_ms_median": "frame, capture to command, median, ms",
    "frame_ms_p95": "p95, ms",
}
HEADS = {
    "approach_runs": approach.TITLE,
    "mover_runs": movers.TITLE,
    "loops": "Long loops",
    "frame_ms_median": "Time",
}


def main() -> None:
    """The command."""
    options = read_options(Options)
    at_least("rooms", options.rooms, 1)
    at_least("jobs", options.jobs, 1)
    at_least("max-time", options.max_time, 1)
    check_json(options.json)
    parts = PARTS if options.only is None else (options.only,)
    columns = (*KINDS, "all")
    figures: dict[str, dict[str, Any]] = {column: {} for column in columns}
    all_drives: dict[str, list[dict[str, Any]]] = {}
    for part in parts:
        results = run_all(drives_of(part, options), 1 if part == "time" else options.jobs, part)
        for one in results:
            one["has_path"] = bool(world_from_uri(one["camera"]).has_path(PATH_WIDTH_CM))
        all_drives[part] = results
        ran = [one for one in results if "failed" not in one]
        for column in columns:
            mine = [one for one in ran if column == "all" or f":{column}?" in one["camera"]]
            figures[column] |= FIGURES[part](mine)
        _print_odd_ones(results)
    title = f"The main job in many worlds, {'plain' if options.plain else 'all models on'}"
    print_figures(title, ROWS, figures, HEADS)
    write_json(options.json, {"figures": figures, "drives": all_drives})


def _print_odd_ones(results: list[dict[str, Any]]) -> None:
    """A line for each drive that somebody should look at."""
    for one in results:
        named = f"--camera '{one['camera']}' --robot '{one['robot']}'"
        if "failed" in one:
            print(f"{named}: {one['failed']}")
        elif one["collisions"] or one["run_into"] or one["outcome"] in ("stopped", "timeout", "blocked"):
            touched = f"{one['collisions']} collisions, run into {one['run_into']} times"
            print(f"{named}: {one['outcome']}, {touched}: {one['reason']}")


if __name__ == "__main__":
    run_command(main)
