"""An hour of driving in one process: does it stay in memory, and does nothing go wrong?

    python -m bench.endurance [--minutes M] [--camera URI] [--json FILE]

The robot explores a simulated room and then drives to and fro between the far ends of what it has seen, until
the simulated time is over. Every simulated minute a line tells the memory of the process, the time taken and
what went wrong so far, so that a run that is cut short still tells something. Nothing passes or fails here.
Ten pictures a second, so that an hour takes well less than one.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.table import Table

from bench.figures_file import check_json, write_json
from bench.options import at_least
from host.config import Config, read_options
from host.errors import run_command

if TYPE_CHECKING:  # so that --help need not wait for all of it
    from host.nav.pilot import View
    from host.nav.result import DriveLog
    from host.nav.task import Task

EVERY_S = 60.0
INSIDE_CM = 40.0  # goals lie so far within the edge of the map, for the robot to stand on it


@dataclass(frozen=True)
class Options:
    """Drive for long and print how memory and faults grow."""

    minutes: float = 60.0  # simulated
    camera: str = "sim:room?seed=1&rough=1&fps=10"  # the world
    json: Path | None = None
    """Also write the figures to this file."""


@dataclass(frozen=True)
class Sample:
    """How things stand after some simulated minutes."""

    minutes: float
    rss_mb: float
    wall_s: float
    drives: int
    metres: float
    collisions: int
    stops: int
    refused: int
    forgotten: int
    faults: int


def rss_mb() -> float:
    """Memory of this process now, as the system counts it."""
    status = Path("/proc/self/status").read_text()
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS")) / 1024


class Endurance:
    """One simulation, one robot, drive after drive."""

    def __init__(self, uri: str, minutes: float):
        from host.sim.session import Simulation

        self.config = Config()
        self.simulation = Simulation(uri)
        self.until_s = 60 * minutes
        self.samples: list[Sample] = []
        self.ends: dict[str, int] = {}
        self.bad_ends: list[str] = []
        self._logs = {"stops": 0, "refused": 0, "forgotten": 0, "faults": 0}
        self._drives = 0
        self._next_s = EVERY_S
        self._began_s = time.monotonic()

    def run(self, console: Console) -> None:
        """Until the time is over."""
        from host.link.robot import Robot
        from host.nav.drive import drive
        from host.nav.pilot import Pilot
        from host.nav.task import Explore, Route
        from host.sim.board import Line

        simulation, clock = self.simulation, self.simulation.clock
        self._sample(console)
        with Robot(simulation.transport, clock, lambda: Line(simulation.board)) as robot:
            robot.connect()
            goals: list[tuple[float, float]] = []
            while clock.now_s() < self.until_s:
                first = self._drives == 0
                task: Task = Route(goals, set_down=first) if goals else Explore(set_down=first)
                config = self.config
                lens = simulation.world.lens
                pilot = Pilot(
                    lens, task, net=config.net, depth=config.depth, body=config.body, nav=config.nav
                )
                left_s = self.until_s - clock.now_s()
                longest_s = left_s if goals else left_s / 4
                log, code = drive(
                    simulation.camera, robot, clock, pilot, config.nav, longest_s, 1e9,
                    lambda view, log: self._look(view, log, console),
                )  # fmt: skip
                self._count(log, code)
                # At the end of a route, or where it is blocked, look around anew from here.
                goals = [] if goals or log.last_pose is None else to_and_fro(log, config.nav.map_half_cm)
            self._sample(console)

    def _look(self, view: View, log: DriveLog, console: Console) -> None:
        if self.simulation.clock.now_s() >= self._next_s:
            self._next_s += EVERY_S
            self._sample(console, log)

    def _count(self, log: DriveLog, code: int) -> None:
        self._drives += 1
        self.ends[log.outcome] = self.ends.get(log.outcome, 0) + 1
        if code != 0:
            self.bad_ends.append(f"{self.simulation.clock.now_s() / 60:.1f} min: {log.reason}")
        for name, number in counts_of(log).items():
            self._logs[name] += number

    def _sample(self, console: Console, log: DriveLog | None = None) -> None:
        now = counts_of(log) if log else dict.fromkeys(self._logs, 0)
        body = self.simulation.body
        sample = Sample(
            round(self.simulation.clock.now_s() / 60, 2), round(rss_mb(), 1),
            round(time.monotonic() - self._began_s, 1), self._drives + (log is not None),
            round(body.distance_cm / 100, 1), body.collisions,
            **{name: self._logs[name] + now[name] for name in self._logs},
        )  # fmt: skip
        self.samples.append(sample)
        console.print(
            f"{sample.minutes:5.1f} min  {sample.rss_mb:6.1f} MB  {sample.metres:6.1f} m  "
            f"{sample.collisions} collisions  {sample.faults} faults  {sample.stops} stops  "
            f"{sample.refused} refused  {sample.forgotten} forgotten  {sample.wall_s:.0f} s"
        )


def counts_of(log: DriveLog) -> dict[str, int]:
    """What may go wrong in a drive and is counted."""
    return {
        "stops": log.times_stopped,
        "refused": log.refused_frames,
        "forgotten": log.times_forgotten,
        "faults": log.faults_cleared + len(log.reconnections),
    }


def to_and_fro(log: DriveLog, map_half_cm: float) -> list[tuple[float, float]]:
    """Ten times to the place of the path that is farthest from here, and back.

    They are told as the next drive's pilot sees them, for whom the camera is at the origin now, and the map
    reaches as far from there as it did before from elsewhere.
    """
    here = log.last_pose
    assert here is not None
    path = np.array([pose.position_cm for pose in log.path])
    local = (path - here.position_cm) @ here.rotation
    on_map = np.abs(local[:, [0, 2]]).max(axis=1) < map_half_cm - INSIDE_CM
    away = np.where(on_map, np.hypot(local[:, 0], local[:, 2]), 0.0)
    end = local[int(np.argmax(away))]
    far = (float(end[0]), float(end[2]))
    return [far, (0.0, 0.0)] * 10


def figures_of(endurance: Endurance) -> dict[str, Any]:
    """What --json gets."""
    first, last = endurance.samples[min(1, len(endurance.samples) - 1)], endurance.samples[-1]
    hours = (last.minutes - first.minutes) / 60
    return {
        "samples": [asdict(sample) for sample in endurance.samples],
        "ends": endurance.ends,
        "bad_ends": endurance.bad_ends,
        "growth_mb_per_hour": (last.rss_mb - first.rss_mb) / hours if hours > 0 else None,
    }


def main() -> None:
    """The command."""
    options = read_options(Options)
    at_least("minutes", options.minutes, 1)
    check_json(options.json)
    endurance = Endurance(options.camera, options.minutes)
    endurance.run(Console())
    figures = figures_of(endurance)
    table = Table(title="Driving for long", title_justify="left", show_header=False)
    growth = figures["growth_mb_per_hour"]
    table.add_row("memory grew, MB an hour", "-" if growth is None else f"{growth:.1f}")
    table.add_row("ends of drives", ", ".join(f"{n} {end}" for end, n in endurance.ends.items()))
    table.add_row("of these, bad ones", "; ".join(endurance.bad_ends) or "none")
    Console().print(table)
    write_json(options.json, figures)


if __name__ == "__main__":
    run_command(main)
