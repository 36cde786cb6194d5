"""The main job: look, measure, map, steer, drive, until the goal is reached or something ends the drive.

    python host/nav_loop.py --camera sim:room?seed=1 --robot sim: --goal -69,284 --max-time 45 --json out.json
    python host/nav_loop.py --explore | --approach 20 | --measure-only | --goal 60,120 -60,200
    python host/nav_loop.py --view     # and look on in a browser

Leaves runs/<time>/ (and runs/latest) with result.json and annotated pictures.
"""

from __future__ import annotations

import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: threads only wait

if __package__ in (None, ""):  # run as a script: the package lies one folder up
    sys.path[0] = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))

from host.errors import UsageError, begin_command, run_command

if __name__ == "__main__":
    begin_command()

import math
import re
import signal
import time
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from host.config import Config, read_command_line
from host.nav.config import MOST_CELLS, NavConfig
from host.progress import LiveText
from host.record.atomic import check_writable, write_whole

if TYPE_CHECKING:  # what takes long to load is loaded when the command line was read
    from host.camera.frame import Frame
    from host.nav.pilot import View
    from host.nav.result import DriveLog
    from host.nav.task import Task
    from host.record.recorder import Recorder
    from host.view.page.server import LivePage

RUNS = Path("runs")
APPROACH_HALF_CM = 1000.0  # an approach goes straight on; this far it finds its map
TICK_S = 0.1  # between two lines on the terminal
LONGEST_WALL_S = 52.0  # of a simulated drive that is not asked to last longer


@dataclass(frozen=True)
class Options:
    """Drive to a goal by what the camera sees, and leave a result in runs/latest."""

    camera: str = "sim:room?seed=1"  # sim:room?seed=N, a webcam's number or device, or http:// of a stream
    robot: str = "sim:"  # sim: with a simulated camera, else auto or a port such as /dev/ttyACM0
    goal: str | None = None
    """X,Z in cm from the camera at the start, right and ahead; several make a route; a room has its own"""
    explore: bool = False  # look at all floor that can be reached
    approach: float | None = None  # stop this many cm before what is ahead
    measure_only: bool = False  # drive nothing; somebody else moves the robot
    max_time: float = 45.0  # seconds after which the drive ends wherever it is
    max_wall: float | None = None
    """seconds of real time after which it ends as well; --max-time or 52, whichever is more"""
    json: Path | None = None  # write the result here as well
    lens: Path | None = None  # camera.json of a real camera
    record: Path | None = None
    """new MCAP file for pictures, the line's bytes and what was made of them; host.replay does it again"""
    view: bool = False  # a page to look on in a browser, with a STOP; a simulated drive then takes its time
    view_host: str = "127.0.0.1"
    """where that page is served; 0.0.0.0 lets other machines in who have the token in its address"""
    view_port: int | None = None  # 8080, or the next one that is free


def parse_goal(text: str, config: Config) -> tuple[float, float]:
    """``X,Z`` in cm; UsageError where it is no point on the map."""
    try:
        x, z = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"--goal {text}: not two numbers; write X,Z in cm, such as 0,200") from None
    limit = config.nav.map_half_cm
    if not (abs(x) < limit and abs(z) < limit):
        raise UsageError(
            f"--goal {text}: off the map; keep both within ±{limit:.0f} cm or set nav.map_half_cm"
        )
    return x, z


def parse_route(text: str, config: Config) -> list[tuple[float, float]]:
    """One goal or several with spaces between."""
    return [parse_goal(goal, config) for goal in text.split()] or [parse_goal(text, config)]


def choose_task(
    options: Options, route: list[tuple[float, float]], world_goal_cm: tuple[float, float] | None
) -> tuple[Task, str, tuple[float, float] | None]:
    """(the task, the task in words, the last goal); the world's own goal where nothing else is asked."""
    from host.nav.task import Approach, Explore, MeasureOnly, Route

    if options.explore:
        return Explore(), "exploring", None
    if options.approach is not None:
        return Approach(options.approach), f"approaching up to {options.approach:g} cm", None
    if options.measure_only:
        return MeasureOnly(), "measuring only", None
    if not route and world_goal_cm is not None:
        route = [world_goal_cm]
    if not route:
        raise UsageError("--goal is missing: write X,Z in cm, such as --goal 0,200 for two metres ahead")
    return Route(route), "driving to " + " then ".join(f"{x:.0f},{z:.0f} cm" for x, z in route), route[-1]


def with_long_map(nav: NavConfig) -> NavConfig:
    """With a map that an approach straight on does not soon come to the edge of."""
    half = min(max(nav.map_half_cm, APPROACH_HALF_CM), MOST_CELLS * nav.cell_cm)
    return replace(nav, map_half_cm=max(half, nav.map_half_cm))


def main() -> int:
    """The command: exit code 0 also for blocked and timeout, which are ends a drive may have."""
    options, config = read_command_line(Options, _joined_goals(sys.argv[1:]))
    route = [] if options.goal is None else parse_route(options.goal, config)
    asked = [route != [], options.explore, options.approach is not None, options.measure_only]
    if sum(asked) > 1:
        raise UsageError("--goal, --explore, --approach and --measure-only exclude each other: give one")
    if options.approach is not None and not 0 <= options.approach <= 100:
        raise UsageError(f"--approach {options.approach:g}: give 0 to 100 cm")
    if not 0 < options.max_time < math.inf:
        raise UsageError(f"--max-time {options.max_time:g}: give seconds above zero")
    if options.max_wall is not None and not 0 < options.max_wall < math.inf:
        raise UsageError(f"--max-wall {options.max_wall:g}: give seconds above zero")
    if not options.view and (options.view_port, options.view_host) != (None, Options.view_host):
        raise UsageError("--view-host and --view-port say where the live page is: add --view")
    if options.json is not None:
        check_writable(options.json, folder=False, beside=(options.record, options.lens))
    check_writable(RUNS, folder=True)

    with open_page(options) as page, open_recorder(options.record) as recorder:
        return _drive(options, config, route, page, recorder)


def _drive(
    options: Options,
    config: Config,
    route: list[tuple[float, float]],
    page: LivePage | None,
    recorder: Recorder | None,
) -> int:
    from host.nav.drive import drive
    from host.nav.gallery import Gallery
    from host.nav.pilot import Pilot
    from host.nav.result import new_run_folder, write_json
    from host.nav.rig import open_rig
    from host.record.versions import versions
    from host.view.floor_map import floor_of
    from host.view.report import changed_settings, report

    tap = None if recorder is None else recorder.line
    if page is not None:
        page.say(f"opening camera {options.camera} and robot {options.robot}")
    with open_rig(
        options.camera,
        options.robot,
        options.lens,
        tap=tap,
        real_time=page is not None,
        webcam=config.webcam,
    ) as rig:
        task, words, goal_cm = choose_task(options, route, rig.goal_cm)
        nav = config.nav if options.approach is None else with_long_map(config.nav)
        if recorder is None:
            pilot = Pilot(rig.lens, task, net=config.net, depth=config.depth, body=config.body, nav=nav)
        else:
            pilot = recorder.pilot(rig.clock, rig.lens, task, replace(config, nav=nav), asdict(options))
        gallery = Gallery()
        print(f"{words} for at most {options.max_time:g} s; Ctrl-C stops", file=sys.stderr)
        if page is not None:
            goals = route or ([] if goal_cm is None else [goal_cm])
            page.begin(words, goals, config.body, rig.robot, rig.monotonic_s)
        with LiveText(TICK_S, transient=True) as ticker:

            def on_view(view: View, log: DriveLog) -> None:
                if page is not None:
                    page.show(view.frame, view, pilot.map, log)
                gallery.add(view)
                rig.watch(view)
                ticker.show(lambda: moment(log), cut=True)
                if recorder is not None:
                    recorder.drove(view, log, rig.robot)

            def on_refusal(frame: Frame | None, why: str, log: DriveLog) -> None:
                if page is not None:
                    page.show(frame, None, pilot.map, log)
                rig.refuse(why)
                gallery.refuse(frame, why)
                ticker.show(lambda: moment(log), cut=True)
                if recorder is not None:
                    recorder.refused(frame, why, log, rig.robot)

            wall_s = options.max_wall or max(options.max_time, LONGEST_WALL_S)
            log, code = drive(
                rig.camera,
                rig.robot,
                rig.clock,
                pilot,
                config.nav,
                options.max_time,
                wall_s,
                on_view,
                bound_for=not (options.explore or options.measure_only),
                on_refusal=on_refusal,
            )
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the motors stand; what is left takes a second
        if page is not None:
            page.end(log.outcome, log.reason)
        if recorder is not None:
            recorder.ended(log, rig.robot)
        result = {
            "camera": options.camera,
            "robot": options.robot,
            "task": words,
            "goal_cm": None if goal_cm is None else [round(v, 3) for v in goal_cm],
            **log.as_dict(),
            **rig.truth(log),
            "link": rig.link_counters(),
            "floor": floor_of(pilot.map, config.body, log),
            "pictures": gallery.pictures(log.began_s),
            "settings": changed_settings(config),
            "versions": versions(),
        }
    if recorder is not None:
        recorder.close()
        result["recording"] = recorder.summary()
    folder = new_run_folder(RUNS, time.strftime("%Y%m%d-%H%M%S"))
    write_json(result, folder / "result.json")
    if options.json is not None:
        write_json(result, options.json)
    gallery.write(folder, pilot.map, config.body, goal_cm, log)
    write_whole(folder / "report.html", report(result, folder))
    print_summary(result, folder)
    return code


def open_page(options: Options) -> AbstractContextManager[LivePage | None]:
    """A live page where one is asked for, else None."""
    if not options.view:
        return nullcontext()
    from host.view.page.server import LivePage

    page = LivePage(options.view_host, options.view_port)
    print(f"live page: {page.url}", file=sys.stderr, flush=True)
    return page


def open_recorder(path: Path | None) -> AbstractContextManager[Recorder | None]:
    """A recorder where a recording is asked for, else None."""
    if path is None:
        return nullcontext()
    from host.record.recorder import Recorder

    return Recorder(path)


def _joined_goals(arguments: list[str]) -> list[str]:
    """``--goal -50,200 --goal 0,300`` as ``--goal=-50,200 0,300``, which cannot be mistaken for options."""
    out: list[str] = []
    goals: list[str] = []
    before = ""
    for argument in arguments:
        if before == "--goal":
            goals.append(argument)
        elif argument.startswith("--goal="):
            goals.append(argument.removeprefix("--goal="))
        elif before == "goals" and re.fullmatch(r"(?!--)[^,\s]+,[^,\s]+", argument):
            goals.append(argument)
        else:
            if argument != "--goal":
                out.append(argument)
            before = argument
            continue
        before = "goals"
    if before == "--goal":
        out.append("--goal")  # without a value, which is told
    return [*out, f"--goal={' '.join(goals)}"] if goals else out


def moment(log: DriveLog) -> str:
    """Time, distance, what the robot does and why, in a line."""
    last = log.decisions[-1]
    return f"{log.duration_s:5.1f} s  {log.distance_cm:5.0f} cm  {last.v_mm_s / 10:4.0f} cm/s  {last.reason}"


def print_summary(result: dict[str, Any], folder: Path) -> None:
    """The end of the drive as a table."""
    from rich.console import Console
    from rich.table import Table

    outcome, reason = result["outcome"], result["reason"]
    title = reason if reason.startswith(outcome) else f"{outcome}: {reason}"
    table = Table(show_header=False, title=title, title_justify="left")
    for name, value in _summary_rows(result):
        table.add_row(name, value)
    table.add_row("result", str(folder / "result.json"))
    table.add_row("report", str(folder / "report.html"))
    Console().print(table)


def _summary_rows(result: dict[str, Any]) -> list[tuple[str, str]]:
    def number(value: float | None, unit: str, digits: int = 1) -> str:
        return "not known" if value is None else f"{value:.{digits}f} {unit}"

    def spread(times: dict[str, float | None]) -> str:
        return f"median {number(times['median'], 'ms', 2)}, p95 {number(times['p95'], 'ms', 2)}"

    ms, depth, error = result["frame_time_ms"], result["depth_errors"], result["final_pose_error"]
    rows = [
        ("time", number(result["duration_s"], "s")),
        ("distance", number(result["distance_cm"], "cm", 0)),
        ("closest approach", number(result["min_clearance_cm"], "cm")),
        ("collisions", "not known" if result["collisions"] is None else str(result["collisions"])),
        *([("run into by others", str(result["run_into"]))] if result["run_into"] else []),
        ("final pose off by", "not known" if error is None else number(error["position_cm"], "cm")),
    ]
    for name, part in (("of things", depth and depth["things"]), ("with walls and floor", depth)):
        text = "not known"
        if part is not None and part["count"] > 0:
            median, most = part["median_percent"], part["p90_percent"]
            text = f"median {median:.1f} %, 90 % below {most:.1f} % ({part['count']})"
        rows.append((f"depth error {name}", text))
    frames = f"{result['frames']}, {result['dropped_frames']} dropped"
    if result["limited_frames"]:
        frames += f", a budget of the net acted in {result['limited_frames']}"
    if result["refused_frames"]:
        frames += f", {result['refused_frames']} not driven on"
    rows.append(("frames", frames))
    rows.append(("frame time", spread(ms)))
    rows += [(f"  of it {stage}", spread(times)) for stage, times in result["stage_ms"].items()]
    rows.append(("exposure to command", spread(result["latency_ms"])))
    late = result["pictures_late_ms"]
    if late is not None:
        rows.append(
            ("pictures late by", f"{late['best']:.0f} ± {late['sigma']:.0f} ms; {late['used']:.0f} ms used")
        )
    rows.append(("stops, with that at the end", str(result["times_stopped"])))
    if "recording" in result:
        made = result["recording"]
        early = "" if made["ended_early"] is None else f"; ended early: {made['ended_early']}"
        size = f"{made['frames']} pictures, {made['bytes'] / 1e6:.1f} MB"
        rows.append(("recording", f"{made['file']}, {size}{early}"))
    if result["times_forgotten"]:
        rows.append(("carried off or slipped", f"{result['times_forgotten']} times: map begun anew"))
    lost = len(result["reconnections"])
    if lost or result["faults_cleared"]:
        rows.append(("robot lost or at fault", f"{lost} and {result['faults_cleared']} times"))
    return rows


if __name__ == "__main__":
    run_command(main)
