"""The paper's first experiment, driven by the robot itself: 10 cm straight on, then the depth of both boxes.

    python -m bench.driven_experiment [--seeds N] [--first-seed S] [--scene boxes] [--rough] [--json FILE]

Camera, firmware, wheels and loop are those of ``host/nav_loop.py``; encoders count half centimetres, and
where in its count each wheel begins is different in every run. The robot stands, drives the baseline, stands
again; then the fused depth of either box is compared with the truth. Three estimators see the same pictures:
with the robot's odometry, with raw counts as its place, and with the true places, which shows what sight
alone leaves. Nothing passes or fails here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from rich.console import Console
from rich.progress import track as progress
from rich.table import Table

from bench.figures_file import check_json, write_json
from bench.options import at_least
from host.config import Config, read_options
from host.errors import run_command
from host.nav.config import BodyConfig
from host.pose import Pose, wrap

if TYPE_CHECKING:  # so that --help need not wait for all of it
    from host.depth.report import DepthReport
    from host.nav.command import Command
    from host.nav.map import ObstacleMap
    from host.nav.odometry import WheelReading
    from host.nav.pilot import View
    from host.nav.result import DriveLog
    from host.sim.session import Simulation

REST_S = 0.4  # stands this long before and after
HOLD_GAIN = 2.0  # turn rate per heading error, 1/s
LEAST_SHARE = 0.5  # of a box's pixels that must have a depth
LONGEST_S = 30.0
ESTIMATORS = ("odometry", "raw counts", "true places")


@dataclass(frozen=True)
class Options:
    """Drive the paper's first experiment many times and print a table."""

    seeds: int = 20
    """Runs."""
    first_seed: int = 1
    """Seed of the first run."""
    scene: Literal["boxes", "experiment_1"] = "boxes"
    """boxes: the paper's two boxes; experiment_1: a seed also varies their sizes, places and colours."""
    baseline: float = 10.0
    """Way from standstill to standstill, cm."""
    speed: float = 10.0
    """On the way, cm/s."""
    fps: float = 15.0
    """Pictures a second."""
    rough: bool = False
    """A poor webcam: rows read in turn, late, stamped late and unevenly, more noise."""
    json: Path | None = None
    """Also write the figures, and those of every run, to this file."""


class Straight:
    """Stands, drives straight on over the baseline, stands, and is done."""

    def __init__(self, baseline_cm: float, speed_cm_s: float, brake_cm_s2: float) -> None:
        self._baseline_cm, self._speed_cm_s, self._brake_cm_s2 = baseline_cm, speed_cm_s, brake_cm_s2
        self._start: tuple[float, float, float, float] | None = None  # time, x, z, heading
        self._arrived_s: float | None = None

    def decide(self, obstacle_map: ObstacleMap, camera: Pose) -> Command:
        from host.nav.command import Command
        from host.nav.odometry import body_of

        x, z, heading = body_of(camera, obstacle_map.body.camera_ahead_cm)
        if self._start is None:
            self._start = (camera.t_s, x, z, heading)
        begin_s, x0, z0, aim = self._start
        if camera.t_s - begin_s < REST_S:
            return Command(0.0, 0.0, "stand: before the baseline")
        left_cm = self._baseline_cm - math.hypot(x - x0, z - z0)
        rolls_out_cm = self._speed_cm_s**2 / (2 * self._brake_cm_s2)
        if self._arrived_s is None and left_cm <= rolls_out_cm:
            self._arrived_s = camera.t_s
        if self._arrived_s is None:
            return Command(10 * self._speed_cm_s, HOLD_GAIN * wrap(aim - heading), "drive the baseline")
        if camera.t_s - self._arrived_s < 2 * REST_S:
            return Command(0.0, 0.0, "stand: after the baseline")
        return Command(0.0, 0.0, "the baseline is driven", "measured")


class Beside:
    """Estimators that see what the robot's own sees, with other places; and the truth, for the score."""

    def __init__(self, simulation: Simulation, stamp_late_s: float, config: Config) -> None:
        from host.depth.estimator import Estimator

        self._simulation, self._stamp_late_s = simulation, stamp_late_s
        self._cell_cm = config.body.cm_per_count
        lens = simulation.world.lens
        self._raw, self._exact = Estimator(lens, config.depth), Estimator(lens, config.depth)
        self._counts: list[tuple[float, float]] = []  # time, mean of both
        self._raw_start: float | None = None
        self.last: dict[str, DepthReport] = {}
        self.view: View | None = None
        self.travel_errors_cm: list[float] = []

    def hear(self, reading: WheelReading) -> None:
        self._counts.append((reading.t_s, (reading.count_left + reading.count_right) / 2))

    def watch(self, view: View) -> None:
        """One frame."""
        t_s = view.frame.t_s
        counted = [n for at_s, n in self._counts if at_s <= t_s] or [self._counts[0][1]]
        self._raw_start = counted[-1] if self._raw_start is None else self._raw_start
        way_cm = (counted[-1] - self._raw_start) * self._cell_cm
        raw = Pose.planar(0.0, way_cm, 0.0, t_s=t_s, sigma_z_cm=self._cell_cm / math.sqrt(24))
        true = self._simulation.true_pose(t_s - self._stamp_late_s)
        self.last = {
            "odometry": view.depths,
            "raw counts": self._raw.update(view.snapshot, raw),
            "true places": self._exact.update(view.snapshot, replace(true, t_s=t_s)),
        }
        self.view = view
        self.travel_errors_cm.append(float(view.pose.position_cm[2] - true.position_cm[2]))

    def scores(self) -> list[dict[str, Any]]:
        """Error of every box by every estimator, on the last frame."""
        from host.experiments.truth import FrameTruth, by_object

        assert self.view is not None
        t_s = self.view.frame.t_s - self._stamp_late_s
        truth = FrameTruth(self._simulation.renderer_at(t_s), self._simulation.true_pose(t_s))
        regions = by_object(truth.shown(self.view.snapshot))
        out = []
        for thing_id, thing in truth.things.items():
            for name, report in self.last.items():
                known = [
                    (shown.pixels, found.depth_cm, found.sigma_cm)
                    for shown in regions.get(thing_id, [])
                    if (found := report.regions[shown.region.id]).depth_cm is not None
                ]
                pixels = sum(n for n, *_ in known)
                depth = sigma = None
                if pixels >= LEAST_SHARE * thing.area_px:
                    depth = sum(n * d for n, d, _ in known) / pixels
                    sigma = sum(n * (s or 0.0) for n, _, s in known) / pixels
                out.append({
                    "thing": thing.name, "estimator": name, "depth_cm": depth, "sigma_cm": sigma,
                    "true_cm": thing.mean_cm,
                    "error_percent": None if depth is None else 100 * (depth / thing.mean_cm - 1),
                })  # fmt: skip
        return out


def run(options: Options, seed: int, config: Config) -> dict[str, Any]:
    """One drive."""
    from host.link.robot import Robot
    from host.nav.drive import drive
    from host.nav.pilot import Pilot
    from host.sim.body import BodyModel
    from host.sim.render import WebcamModel
    from host.sim.scenes import ROUGH
    from host.sim.session import Simulation

    webcam = ROUGH if options.rough else WebcamModel()
    simulation = Simulation(
        f"sim:{options.scene}?seed={seed}", body=BodyModel(), webcam=webcam, fps=options.fps
    )
    world = simulation.world
    body: BodyConfig = replace(config.body, camera_height_cm=world.camera_height_cm)
    task = Straight(options.baseline, options.speed, config.nav.brake_cm_s2)
    pilot = Pilot(world.lens, task, net=config.net, depth=config.depth, body=body, nav=config.nav)
    beside = Beside(simulation, webcam.stamp_late_s, config)
    heard = pilot.odometry.add

    def add(reading: WheelReading) -> None:
        heard(reading)
        beside.hear(reading)

    pilot.odometry.add = add  # type: ignore[method-assign]

    def on_view(view: View, log: DriveLog) -> None:
        beside.watch(view)

    with Robot(simulation.transport, simulation.clock) as robot:
        robot.connect()
        log, _ = drive(
            simulation.camera, robot, simulation.clock, pilot, config.nav, LONGEST_S, 20 * LONGEST_S, on_view
        )
    return {
        "seed": seed, "outcome": log.outcome, "reason": log.reason, "frames": log.frames,
        "travelled_cm": simulation.body.distance_cm, "travel_error_cm": beside.travel_errors_cm[-1],
        "boxes": beside.scores(),
    }  # fmt: skip


def summary(runs: list[dict[str, Any]], estimator: str) -> dict[str, Any]:
    """Errors of both boxes over all runs with one estimator, in percent."""
    rows = [box for one in runs for box in one["boxes"] if box["estimator"] == estimator]
    errors = np.array([row["error_percent"] for row in rows if row["error_percent"] is not None])
    pulls = np.array([
        abs(row["depth_cm"] - row["true_cm"]) / row["sigma_cm"] for row in rows if row["sigma_cm"]
    ])  # fmt: skip
    if len(errors) == 0:
        return {"asked": len(rows), "answers": 0}
    return {
        "asked": len(rows),
        "answers": len(errors),
        "median_percent": float(np.median(np.abs(errors))),
        "rms_percent": float(np.sqrt(np.mean(errors**2))),
        "p90_percent": float(np.percentile(np.abs(errors), 90)),
        "mean_percent": float(np.mean(errors)),
        "within_sigmas_percent": {n: 100 * float(np.mean(pulls <= n)) for n in (1, 2)},
    }


ROWS = {
    "median_percent": "median error, %",
    "rms_percent": "rms, %",
    "p90_percent": "90 % below, %",
    "mean_percent": "mean with its sign, %",
}


def print_table(figures: dict[str, dict[str, Any]], options: Options) -> None:
    """A column for each estimator."""
    webcam = "poor webcam" if options.rough else "webcam"
    title = (
        f"sim:{options.scene}, {options.baseline:g} cm driven by the robot, {options.seeds} runs, {webcam}"
    )
    table = Table(title=title, title_justify="left")
    table.add_column("depth of both boxes")
    for name in figures:
        table.add_column(name, justify="right")
    table.add_row("answers", *(f"{one['answers']} of {one['asked']}" for one in figures.values()))
    for key, name in ROWS.items():
        table.add_row(name, *(f"{one[key]:.2f}" if key in one else "-" for one in figures.values()))
    for n in (1, 2):
        shares = (one.get("within_sigmas_percent", {}).get(n) for one in figures.values())
        table.add_row(f"within {n} sigma, %", *("-" if s is None else f"{s:.0f}" for s in shares))
    Console().print(table)


def main() -> None:
    """The command."""
    options = read_options(Options)
    at_least("seeds", options.seeds, 1)
    at_least("baseline", options.baseline, 2)
    at_least("speed", options.speed, 2)
    check_json(options.json)
    config = Config()
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    console = Console(stderr=True)
    runs = [run(options, s, config) for s in progress(seeds, "driving", console=console, transient=True)]
    figures = {name: summary(runs, name) for name in ESTIMATORS}
    print_table(figures, options)
    for one in runs:
        if one["outcome"] != "measured":
            print(f"seed {one['seed']}: {one['outcome']}: {one['reason']}")
    write_json(options.json, {"figures": figures, "runs": runs})


if __name__ == "__main__":
    run_command(main)
