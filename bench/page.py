"""How quick the live page is, and how quick its STOP, in a Chromium on the same machine.

python -m bench.page [--seconds 10] [--presses 4] [--json out.json]
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.figures_file import check_json, write_json
from bench.figures_table import print_figures
from bench.options import at_least
from host.config import read_options
from host.errors import DeviceError, UsageError, run_command
from host.nav.config import BodyConfig, NavConfig

if TYPE_CHECKING:  # so that --help need not wait for all of it
    from bench.browser import Browser, Tab
    from host.link.protocol import Telemetry
    from host.nav.pilot import Pilot
    from host.sim.session import Simulation

ROOT = Path(__file__).resolve().parents[1]
CAMERA = "sim:room?seed=1"
STILL_CM_S = 1.0  # slower is standing: two counts a second
QUICK_CM_S = 15.0  # from which a drive is stopped
BUSY_S = 0.3  # for which the program hears nothing after STOP
STANDS_WITHIN_S = 60.0  # on a busy machine
WAYS = ("button", "key")
NOTE_TIMES = """
    window.times = []; const told = hear; hear = (n) => { if (n.kind === 'drawn') times.push(n.ms); told(n) }
"""
ROWS = {
    "url_s": "from start to the printed address, s",
    "first_picture_s": "from start to the first picture drawn, s",
    "pictures_per_s": "pictures drawn a second",
    "drawn_median_ms": "exposure to drawn: median, ms",
    "drawn_p95_ms": "95 % below, ms",
    "show_median_ms": "handing a picture over: median, ms",
    "show_p95_ms": "95 % below, ms",
    "frame_alone_ms": "frame time without a page: median, ms",
    "frame_watched_ms": "with a page that is looked at, ms",
    "off_ms": "STOP to motors without power: worst, ms",
    "still_ms": "to slower than 1 cm/s: worst, ms",
    "stands_ms": "to exactly zero: worst, ms",
    "busy_off_ms": "STOP while the loop is busy to motors without power: worst, ms",
}
HEADS = {
    "url_s": "A drive of nav_loop --view",
    "show_median_ms": "What the loop pays",
    "off_ms": "STOP, times of the robot",
}


@dataclass(frozen=True)
class PageOptions:
    """Measure the live page."""

    seconds: float = 10.0  # of a drive that is looked at
    presses: int = 4  # of STOP, by button and key in turn, in each case
    json: Path | None = None  # write the figures here as well


def main() -> None:
    """The command."""
    options = read_options(PageOptions)
    at_least("seconds", options.seconds, 3)
    at_least("presses", options.presses, 1)
    check_json(options.json)
    from bench.browser import chromium, program

    if program() is None:
        raise UsageError("chromium is not installed: apt-get install chromium")
    with chromium() as browser:
        figures = {
            **look_on(browser, options.seconds),
            **pay(browser, options.seconds),
            **stop_free(browser, options.presses),
            **stop_busy(browser, options.presses),
        }
    load = os.getloadavg()[0]
    print_figures(
        f"Live page; {load:.1f} processes want to run on {os.cpu_count()} cores", ROWS, {"": figures}, HEADS
    )
    write_json(options.json, figures)


def look_on(browser: Browser, seconds: float) -> dict[str, float]:
    """A drive as a person starts it, looked at."""
    with tempfile.TemporaryDirectory() as folder:
        began_s = time.monotonic()
        process = _nav_loop(folder, seconds + 5, "--view", "--view-port", "0")
        try:
            assert process.stderr is not None
            url = process.stderr.readline().split()[-1]
            url_s = time.monotonic() - began_s
            tab = browser.open(url)
            tab.wait_for("window.live?.shots > 0")
            first_s = time.monotonic() - began_s
            tab.ask(NOTE_TIMES)
            before, start_s = tab.ask("live.shots"), time.monotonic()
            time.sleep(seconds)
            rate = (tab.ask("live.shots") - before) / (time.monotonic() - start_s)
            times = tab.ask("times")
            tab.press_key("Space")
            process.communicate(timeout=60)
        finally:
            process.kill()
    return {
        "url_s": url_s,
        "first_picture_s": first_s,
        "pictures_per_s": rate,
        "drawn_median_ms": float(np.median(times)),
        "drawn_p95_ms": float(np.percentile(times, 95)),
    }


def _nav_loop(folder: str, seconds: float, *more: str) -> subprocess.Popen[str]:
    command = [
        sys.executable,
        str(ROOT / "host/nav_loop.py"),
        "--camera",
        CAMERA,
        "--max-time",
        f"{seconds:g}",
    ]
    return subprocess.Popen(
        [*command, "--json", "out.json", *more], cwd=folder, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def pay(browser: Browser, seconds: float) -> dict[str, float]:
    """What a picture costs the loop's thread; and its frame time without a page and with one."""
    from host.link.robot import Robot
    from host.nav.drive import drive
    from host.sim.session import Simulation
    from host.view.page.server import LivePage

    medians = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, more in (("alone", ()), ("watched", ("--view", "--view-port", "0"))):
            process = _nav_loop(folder, seconds, *more)
            try:
                assert process.stderr is not None
                if more:
                    browser.open(process.stderr.readline().split()[-1])
                process.communicate(timeout=20 * seconds)
            finally:
                process.kill()
            result = json.loads((Path(folder) / "out.json").read_text())
            medians[f"frame_{name}_ms"] = result["frame_time_ms"]["median"]
    simulation = Simulation(CAMERA)
    robot = Robot(simulation.transport, simulation.clock)
    robot.connect()
    views: list[Any] = []
    pilot = _pilot(simulation)
    drive(
        simulation.camera, robot, simulation.clock, pilot, NavConfig(), 1.0, 600.0,
        lambda view, log: views.append((view, log)),
    )  # fmt: skip
    times = []
    with LivePage(port=0) as page:
        page.begin("a drive", [], BodyConfig(), robot, lambda t_s: t_s)
        tab = browser.open(page.url)
        tab.wait_for("window.live && socket.readyState === 1")
        for _ in range(100):
            began_s = time.perf_counter()
            page.show(views[-1][0].frame, views[-1][0], pilot.map, views[-1][1])
            times.append(1e3 * (time.perf_counter() - began_s))
            time.sleep(0.02)
    return {
        **medians,
        "show_median_ms": float(np.median(times)),
        "show_p95_ms": float(np.percentile(times, 95)),
    }


def _pilot(simulation: Simulation, *, drives: bool = False) -> Pilot:
    from host.depth.config import DepthConfig
    from host.nav.pilot import Pilot
    from host.nav.task import MeasureOnly, Route
    from host.rbdn import NetConfig

    task = Route([simulation.world.goal_cm]) if drives else MeasureOnly()
    return Pilot(
        simulation.world.lens, task, net=NetConfig(), depth=DepthConfig(), body=BodyConfig(), nav=NavConfig()
    )


def stop_free(browser: Browser, presses: int) -> dict[str, float]:
    """A drive in real time, stopped at speed; times are the simulation's."""
    worst: dict[str, float] = {"off_ms": 0.0, "still_ms": 0.0, "stands_ms": 0.0}
    for k in range(presses):
        for name, ms in _stopped_drive(browser, WAYS[k % 2]).items():
            worst[name] = max(worst[name], ms)
    return worst


def _stopped_drive(browser: Browser, way: str) -> dict[str, float]:
    from host.link.robot import Robot
    from host.nav.drive import drive
    from host.sim.board import Side
    from host.sim.session import Simulation
    from host.view.page.server import LivePage

    simulation = Simulation(CAMERA, real_time=True)
    robot = Robot(simulation.transport, simulation.clock)
    robot.connect()
    pilot = _pilot(simulation, drives=True)
    body, board = simulation.body, simulation.board
    samples: list[tuple[int, float, float]] = []  # time, speed, power

    def note() -> None:
        power = max(abs(board.duty(side)) for side in Side)
        samples.append((board.time_us, abs(body.speed_cm_s), power))

    with LivePage(port=0) as page:
        page.begin("a drive", [], BodyConfig(), robot, lambda t_s: t_s)
        tab = browser.open(page.url)
        tab.wait_for("window.live && socket.readyState === 1")

        def run() -> None:
            drive(
                simulation.camera, robot, simulation.clock, pilot, NavConfig(), 60.0, 600.0,
                lambda view, log: page.show(view.frame, view, pilot.map, log),
            )  # fmt: skip
            for _ in range(500):
                simulation.clock.sleep_s(0.001)
                note()

        thread = threading.Thread(target=run)
        simulation.board.step, step = (lambda us: (step(us), note())), simulation.board.step  # type: ignore[method-assign]
        thread.start()
        while not samples or samples[-1][1] < QUICK_CM_S:
            time.sleep(0.01)
        pressed_us = board.time_us
        _press(tab, way)
        thread.join()
    after = [(1e-3 * (us - pressed_us), speed, power) for us, speed, power in samples if us >= pressed_us]
    return {
        "off_ms": _since_when(after, lambda speed, power: power == 0.0),
        "still_ms": _since_when(after, lambda speed, power: speed < STILL_CM_S),
        "stands_ms": _since_when(after, lambda speed, power: speed == 0.0),
    }


def _since_when(samples: list[tuple[float, float, float]], holds: Any) -> float:
    """The time from which on something holds to the end."""
    last = max((ms for ms, speed, power in samples if not holds(speed, power)), default=0.0)
    return min((ms for ms, _, _ in samples if ms > last), default=float("inf"))


def _press(tab: Tab, way: str) -> None:
    if way == "key":
        tab.press_key("Space")
    else:
        tab.press(*tab.ask("(b => [b.x + 20, b.y + 20])($('stop').getBoundingClientRect())"))


def stop_busy(browser: Browser, presses: int) -> dict[str, float]:
    """A robot in a process of its own, at speed, whose program computes and hears nothing."""
    command = [sys.executable, "-m", "host.sim.serve", "sim:", "--world", CAMERA]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    worst = 0.0
    try:
        assert process.stdout is not None
        port = process.stdout.readline().strip()
        for k in range(presses):
            told = stop_while_busy(browser, port, WAYS[k % 2])
            samples = [(1e3 * t_s, 0.0, float(abs(r.duty_left_permille))) for t_s, r in told if t_s > 0]
            worst = max(worst, _since_when(samples, lambda speed, power: power == 0.0))
    finally:
        process.kill()
        process.wait()
    return {"busy_off_ms": worst}


def stop_while_busy(browser: Browser, port: str, way: str) -> list[tuple[float, Telemetry]]:
    """Drive, and press STOP while the program computes and hears nothing.

    Returns
    -------
    told
        What the robot told all the while, and how long after STOP, s; it stands again.
    """
    from host.link.clock import SystemClock
    from host.link.robot import Robot
    from host.link.serial_port import SerialPort
    from host.view.page.server import LivePage

    over = threading.Event()

    def be_busy() -> None:
        while not over.is_set():
            sum(range(1000))

    with LivePage(port=0) as page, Robot(SerialPort(port), SystemClock()) as robot:
        robot.connect()
        robot.clear()  # the STOP before
        page.begin("a drive", [], BodyConfig(), robot, lambda t_s: t_s)
        tab = browser.open(page.url)
        tab.wait_for("window.live?.phase() === 'wait' && socket.readyState === 1")
        while robot.latest is None or robot.latest.speed_left_mm_s < 10 * QUICK_CM_S:
            robot.drive(200, 0)
            time.sleep(0.02)
            robot.poll()
        busy = threading.Thread(target=be_busy)
        busy.start()
        try:
            robot.drive(200, 0)
            pressed_s = time.monotonic()
            _press(tab, way)
            time.sleep(BUSY_S)
        finally:
            over.set()
            busy.join()
        told = [(robot.host_time_s(report.mcu_time_us) - pressed_s, report) for report in robot.poll()]
        give_up_s = time.monotonic() + STANDS_WITHIN_S
        while robot.latest.speed_left_mm_s or robot.latest.speed_right_mm_s:
            if time.monotonic() > give_up_s:
                raise DeviceError(f"{port}: the robot goes on {STANDS_WITHIN_S:.0f} s after STOP")
            time.sleep(0.05)
            robot.poll()
        return told


if __name__ == "__main__":
    run_command(main)
