"""How long one picture takes, from having it to its command, stage by stage, beside public methods.

    python -m bench.frame_time [--seconds S] [--repeats N] [--json FILE]

Every drive is simulated once and taped; then the loop is played on the tape several times, in one thread,
and nothing is rendered. A picture's time is the processor's, the least over the repeats: what it takes where
the machine does nothing else. The public methods get the same pictures.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in the drive

import pickle
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from rich.console import Console
from rich.table import Table

from bench.figures_file import check_json, write_json
from bench.options import at_least
from host.camera.frame import Frame
from host.config import read_options
from host.errors import run_command

if TYPE_CHECKING:  # so that --help need not wait for the simulator
    from bench.tape import Tape

DRIVES = {
    "room": ("sim:room?seed=1", "sim:"),
    "corridor": ("sim:corridor?seed=12", "sim:"),
    "clutter": ("sim:clutter?seed=11", "sim:"),
    "rough room": ("sim:room?seed=7&rough=1", "sim:?rough=1&seed=7"),
}
ROWS = ("wheels", "watch", "localise", "net", "depth", "map", "steer", "command", "all")
CORNERS = 200
DIS, KLT = "DIS flow, medium", "200 corners and KLT"


@dataclass(frozen=True)
class Options:
    """Tape simulated drives, play them to the loop, and print what each stage takes."""

    seconds: float = 15.0  # of each drive
    repeats: int = 5
    json: Path | None = None
    """Also write the figures to this file."""


def dis_flow() -> Callable[[np.ndarray, np.ndarray], None]:
    """Dense flow between two grey pictures."""
    dis = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)

    def flow(before: np.ndarray, now: np.ndarray) -> None:
        dis.calc(before, now, np.zeros((*now.shape, 2), np.float32))

    return flow


def corners_klt(before: np.ndarray, now: np.ndarray) -> None:
    """Corners of a grey picture found anew and followed into the next."""
    corners = cv2.goodFeaturesToTrack(before, CORNERS, 0.01, 5)
    if corners is not None:
        cv2.calcOpticalFlowPyrLK(before, now, corners, np.empty_like(corners))


def peer_ms(
    frames: list[Frame], method: Callable[[np.ndarray, np.ndarray], None], repeats: int
) -> np.ndarray:
    """Least ms of a method for every picture after the first, making it grey included."""
    runs = []
    for _ in range(repeats):
        times, before = [], cv2.cvtColor(frames[0].image, cv2.COLOR_BGR2GRAY)
        for frame in frames[1:]:
            began_s = time.thread_time()
            now = cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY)
            method(before, now)
            times.append(1e3 * (time.thread_time() - began_s))
            before = now
        runs.append(times)
    return np.min(runs, axis=0)


def peak_mb(tape: Tape, seconds: float) -> float:
    """Memory that one play takes beyond the tape, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tape"
        path.write_bytes(pickle.dumps(tape))
        child = [sys.executable, "-m", "bench.tape", str(path), str(seconds)]
        return float(subprocess.run(child, check=True, capture_output=True, text=True).stdout)


def figures_of(tape: Tape, options: Options) -> dict[str, Any]:
    """Median and p95 of every stage and of the peers, ms; memory, MB."""
    from bench.tape import play

    runs = [play(tape, options.seconds)[0] for _ in range(options.repeats)]
    ms = {row: np.min([[one.get(row, 0.0) for one in run] for run in runs], axis=0) for row in ROWS}
    frames = [picture for picture, _ in tape.pictures if isinstance(picture, Frame)]
    ms[DIS] = peer_ms(frames, dis_flow(), options.repeats)
    ms[KLT] = peer_ms(frames, corners_klt, options.repeats)
    median, p95 = ({name: float(np.percentile(v, q)) for name, v in ms.items()} for q in (50, 95))
    return {
        "pictures": len(runs[0]),
        "median_ms": median,
        "p95_ms": p95,
        "over_dis": median["command"] / median[DIS],
        "over_klt": median["command"] / median[KLT],
        "peak_mb": peak_mb(tape, options.seconds),
    }


def print_figures(figures: dict[str, dict[str, Any]]) -> None:
    """One table: stages down, drives across, median and p95."""
    table = Table(title="One picture: median / p95, ms", title_justify="left")
    table.add_column("")
    for name in figures:
        table.add_column(name, justify="right")
    every = figures.values()
    for row in next(iter(every))["median_ms"]:
        if row in ("command", DIS):
            table.add_section()
        words = {"command": "picture to command", "all": "until all is noted"}.get(row, row)
        table.add_row(words, *(f"{one['median_ms'][row]:.2f} / {one['p95_ms'][row]:.2f}" for one in every))
    table.add_section()
    table.add_row("over DIS, over KLT", *(f"{f['over_dis']:.2f}, {f['over_klt']:.2f}" for f in every))
    table.add_row("pictures", *(str(one["pictures"]) for one in every))
    table.add_row("peak memory, MB", *(f"{one['peak_mb']:.0f}" for one in every))
    Console().print(table)


def main() -> None:
    """The command."""
    options = read_options(Options)
    from bench.tape import record

    at_least("seconds", options.seconds, 2)
    at_least("repeats", options.repeats, 1)
    check_json(options.json)
    cv2.setNumThreads(1)
    figures: dict[str, dict[str, Any]] = {}
    console = Console(stderr=True)
    for name, (camera, robot) in DRIVES.items():
        with console.status(f"{name}: driving"):
            tape, _ = record(camera, robot, options.seconds)
        with console.status(f"{name}: playing"):
            figures[name] = figures_of(tape, options)
    print_figures(figures)
    write_json(options.json, figures)


if __name__ == "__main__":
    run_command(main)
