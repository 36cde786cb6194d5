"""What recording costs: time in the loop's own thread for every picture, and the frame time beside it.

    python -m bench.recording [--seconds S] [--camera URI] [--json FILE]

A drive is simulated and recorded once. Then its calls are made again in real time, on a fresh pilot, three
times: not recorded; recorded with the pictures' own JPEG; with PNG, made in the recorder's thread. On a
machine that is busy with other things only the thread's own time (CPU) says something.
"""

from __future__ import annotations

import tempfile
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from rich.console import Console
from rich.table import Table

from bench.figures_file import check_json, write_json
from bench.options import at_least
from host.camera.frame import Frame
from host.config import Config, read_options
from host.errors import run_command
from host.link.protocol import Decoder, Telemetry

if TYPE_CHECKING:  # so that --help need not wait for all of it
    from host.nav.pilot import View
    from host.record.mcap_reader import Recording

IN_THE_LOOP = ("frame_number", "entry", "hear", "made", "decided", "drove", "event", "put_bytes")
SETTLED = 5  # pictures at the start that are not counted


@dataclass(frozen=True)
class Options:
    """Measure what recording costs the loop."""

    seconds: float = 15.0  # of the drive; three times as long are measured
    camera: str = "sim:room?seed=1&rough=1"
    json: Path | None = None
    """Also write the figures to this file."""


class Timed:
    """Adds up the time spent in some methods of an object, those called by each other counted once."""

    def __init__(self, target: object, names: tuple[str, ...]) -> None:
        self.spent_s = self.cpu_s = 0.0
        self._inside = False
        for name in names:
            setattr(target, name, self._timed(getattr(target, name)))

    def _timed(self, method: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            if self._inside:
                return method(*arguments)
            self._inside, began_s, began_cpu_s = True, time.perf_counter(), time.thread_time()
            try:
                return method(*arguments)
            finally:
                self.spent_s += time.perf_counter() - began_s
                self.cpu_s += time.thread_time() - began_cpu_s
                self._inside = False

        return call


def simulate(options: Options, path: Path) -> Recording:
    """The drive that is done again."""
    from host.link.robot import Robot
    from host.nav.drive import drive
    from host.nav.task import Route
    from host.record.mcap_reader import Recording
    from host.record.recorder import Recorder
    from host.sim.session import Simulation

    simulation, config = Simulation(options.camera), Config()
    clock, lens, task = simulation.clock, simulation.world.lens, Route([simulation.world.goal_cm])
    with (
        Recorder(path) as recorder,
        Robot(recorder.line(simulation.transport, clock), clock) as robot,
    ):
        robot.connect()
        pilot = recorder.pilot(clock, lens, task, config, {})
        drive(
            simulation.camera, robot, clock, pilot, config.nav, options.seconds, 1e9,
            lambda view, log: recorder.drove(view, log, robot),
        )  # fmt: skip
    return Recording(path)


def as_jpeg(frame: Frame) -> Frame:
    data = cv2.imencode(".jpg", frame.image)[1].tobytes()
    return replace(frame, image=cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), encoded=data)


def drive_again(recording: Recording, jpeg: bool, path: Path | None) -> dict[str, Any]:
    """The recorded calls at the times at which they were made; ms a picture."""
    pictures = [recorded.frame() for recorded in recording.frames()]
    pictures = [as_jpeg(frame) if jpeg else replace(frame, encoded=None) for frame in pictures]
    entries = {said.t_ns: [] for said in recording.messages("/journal", "/serial/rx", "/serial/tx")}
    journal, serial = recording.journal(), recording.serial()
    for said in recording.messages("/journal", "/serial/rx", "/serial/tx"):
        what = next(journal) if said.topic == "/journal" else next(serial)
        entries[said.t_ns].append(what)
    from host.link.clock import SystemClock
    from host.nav.pilot import Pilot
    from host.nav.result import DriveLog
    from host.record.journal import reading_of, task_of
    from host.record.recorder import Recorder

    task, config = task_of(recording.begin["task"]), recording.config
    recorder = None if path is None else Recorder(path)
    if recorder is None:
        pilot = Pilot(
            recording.lens, task, net=config.net, depth=config.depth, body=config.body, nav=config.nav
        )
    else:
        pilot = recorder.pilot(SystemClock(), recording.lens, task, config, {})
    timed = None if recorder is None else Timed(recorder, IN_THE_LOOP)
    log, robot = DriveLog(), SimpleNamespace(events=deque(), latest=None)
    decoder = Decoder(to_host=True)
    frame_ms: list[float] = []
    spent_ms: list[float] = []
    cpu_ms: list[float] = []
    spent_s = cpu_s = 0.0
    view: View | None = None
    first_ns, began_s = next(iter(entries)), time.perf_counter()
    for t_ns, whats in entries.items():
        wait_s = 1e-9 * (t_ns - first_ns) - (time.perf_counter() - began_s)
        if wait_s > 0:
            time.sleep(wait_s)
        for what in whats:
            if not isinstance(what, dict):
                if not what.sent:
                    heard = [m for _, m in decoder.feed(what.data) if isinstance(m, Telemetry)]
                    robot.latest = heard[-1] if heard else robot.latest
                if recorder is not None:
                    recorder.put_bytes("tx" if what.sent else "rx", what.data)
                continue
            match what["do"]:
                case "hear":
                    pilot.hear(reading_of(what))
                case "react":
                    pilot.react_within(what["reaction_s"])
                case "forget":
                    pilot.forget()
                case "decide":
                    pilot.decide(what["now_s"])
                case "take":
                    now_s = time.perf_counter()
                    view = pilot.take(pictures[what["frame"]], what["now_s"])
                    log.decide(what["now_s"], view.command.v_mm_s, 0.0, view.command.reason)
                    frame_ms.append(1e3 * (time.perf_counter() - now_s))
                case "drove" if recorder is not None and timed is not None and view is not None:
                    recorder.drove(view, log, robot)  # type: ignore[arg-type]
                    spent_ms.append(1e3 * (timed.spent_s - spent_s))
                    cpu_ms.append(1e3 * (timed.cpu_s - cpu_s))
                    spent_s, cpu_s = timed.spent_s, timed.cpu_s
    out: dict[str, Any] = {"frame_time_ms": spread(frame_ms[SETTLED:])}
    if recorder is not None:
        recorder.close()
        told = recorder.summary()
        out["in_the_loop_ms"] = spread(spent_ms[SETTLED:])
        out["in_the_loop_cpu_ms"] = spread(cpu_ms[SETTLED:])
        out["mb_a_minute"] = 60e-6 * told["bytes"] / recording.duration_s
        out["lost"] = told["lost_frames"] + told["lost_entries"]
    return out


def spread(times_ms: list[float]) -> dict[str, float]:
    return {
        "median": float(np.median(times_ms)),
        "p95": float(np.percentile(times_ms, 95)),
        "most": float(np.max(times_ms)),
    }


def main() -> None:
    """The command."""
    options = read_options(Options)
    at_least("seconds", options.seconds, 2)
    check_json(options.json)
    figures = {}
    with tempfile.TemporaryDirectory() as folder:
        recording = simulate(options, Path(folder) / "drive.mcap")
        for name, jpeg in (("not recorded", True), ("recorded, JPEG", True), ("recorded, PNG", False)):
            path = None if name == "not recorded" else Path(folder) / f"{name}.mcap"
            figures[name] = drive_again(recording, jpeg, path)
    command = f"python -m bench.recording --seconds {options.seconds:g} --camera '{options.camera}'"
    table = Table(title=command)
    names = ("", "in the loop, ms a picture", "of it CPU", "most CPU", "understanding it, ms", "MB a minute")
    for column in (*names, "left out"):
        table.add_column(column, justify="right" if column else "left")
    for name, one in figures.items():
        wall, cpu, frame = one.get("in_the_loop_ms"), one.get("in_the_loop_cpu_ms"), one["frame_time_ms"]
        costs = ["-"] * 3
        if wall is not None and cpu is not None:
            costs = [f"{part['median']:.3f} (p95 {part['p95']:.3f})" for part in (wall, cpu)]
            costs.append(f"{cpu['most']:.3f}")
        size = f"{one['mb_a_minute']:.0f}" if "mb_a_minute" in one else "-"
        understood = f"{frame['median']:.1f} (p95 {frame['p95']:.1f})"
        table.add_row(name, *costs, understood, size, str(one.get("lost", "-")))
    Console(width=130).print(table)
    write_json(options.json, figures)


if __name__ == "__main__":
    run_command(main)
