"""Depth of objects beside that of its rivals, on the same frames of rendered drives.

    python -m bench.depth [--seeds N] [--shake-deg DEGREES] [--json FILE]

Ours gets the frames and the odometry, which is exact in travel and knows nothing of the shaking. The rivals
are favoured: every one is given the true mask of the first frame (the pixel count that of every frame) and
the true poses. Errors are relative to the average visible depth at the last frame, of objects that meet
neither the border nor each other. Times are thread CPU time on one core. Nothing passes or fails here.
"""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from rich.table import Table

from bench.depth_rivals import RIVALS, Frames, pixel_count
from bench.figures_file import check_json, write_json
from bench.label_map import label_map
from bench.memory import peak_kb
from bench.options import at_least
from host.config import read_options
from host.depth.estimator import Estimator
from host.depth.report import DepthReport
from host.errors import run_command
from host.rbdn import Net, Snapshot

if TYPE_CHECKING:  # so that --help need not wait for the renderer
    from bench.depth_drives import Take

OURS = "net and depth"
PIXELS = "pixels, Eq. 16"
METHODS = (OURS, *RIVALS, PIXELS)
CLOSE = 0.02
MOST_SHARE = 0.5  # of an object's pixels that must lie in regions with a depth
GOAL = 2.0  # times more accurate than the best rival


@dataclass(frozen=True)
class Options:
    """Compare depths with those of rivals and print two tables."""

    seeds: int = 8
    """Drives through each kind of scene."""
    shake_deg: float = 0.5
    """Pitch and yaw of each frame against the first: anything up to this."""
    json: Path | None = None
    """Also write the figures to this file."""


@dataclass
class Row:
    """What one method did on one kind of scene."""

    errors: list[float] = field(default_factory=list)  # relative
    missing: int = 0  # objects without an answer
    ms: list[float] = field(default_factory=list)  # per frame, one for each drive

    def judge(self, found_cm: Sequence[float | None], true_cm: Sequence[float]) -> None:
        """Takes the depths of some more objects."""
        for found, true in zip(found_cm, true_cm, strict=True):
            if found is None or not np.isfinite(found):
                self.missing += 1
            else:
                self.errors.append(found / true - 1)

    @contextmanager
    def clocked(self, frames: int) -> Iterator[None]:
        """Takes the time of one more drive."""
        begin = time.thread_time()
        yield
        self.ms.append(1e3 * (time.thread_time() - begin) / frames)

    def figures(self) -> dict[str, Any]:
        """The row as JSON has it; None where nothing was found."""
        size = np.abs(self.errors)
        found = len(size) > 0
        return {
            "objects": len(size) + self.missing,
            "without_depth": self.missing,
            "median_percent": 100 * float(np.median(size)) if found else None,
            "p90_percent": 100 * float(np.percentile(size, 90)) if found else None,
            "rms_percent": 100 * float(np.sqrt(np.mean(size**2))) if found else None,
            "within_2_percent": 100 * float((size <= CLOSE).sum()) / max(len(size) + self.missing, 1),
            "ms_per_frame": median(self.ms) if self.ms else None,
        }


def ours(drive: Take) -> tuple[Snapshot, DepthReport]:
    """The whole pipeline over a drive; what it says of the last frame."""
    net, estimator = Net(lens=drive.lens), Estimator(drive.lens)
    answers = [
        (snapshot := net.track(image), estimator.update(snapshot, pose))
        for image, pose in zip(drive.images, drive.odometry, strict=True)
    ]
    return answers[-1]


def depth_over(
    mask: np.ndarray, regions: np.ndarray, snapshot: Snapshot, report: DepthReport
) -> float | None:
    """Mean depth of the regions that mostly show an object, by its pixels; None where they are too few.

    Parameters
    ----------
    mask
        (H, W) bool, the object's pixels.
    regions
        (H, W) index of the region that holds each pixel.
    """
    count = len(snapshot.regions)
    shared = np.bincount(regions[mask], minlength=count)
    whole = np.bincount(regions.ravel(), minlength=count)
    depths = [report.regions[region.id].depth_cm for region in snapshot.regions]
    used = [k for k in range(count) if depths[k] is not None and 2 * shared[k] > whole[k]]
    pixels = shared[used]
    if pixels.sum() < MOST_SHARE * mask.sum():
        return None
    return float(pixels @ np.array([depths[k] for k in used], float) / pixels.sum())


def measure(drive: Take, rows: dict[str, Row]) -> None:
    """Let all methods see one drive, and judge them."""
    truths = [target.true_cm for target in drive.targets]
    count = len(drive.images)
    with rows[OURS].clocked(count):
        snapshot, report = ours(drive)
    regions = label_map(snapshot.regions, drive.images[0].shape[:2])
    found = [depth_over(target.last_mask, regions, snapshot, report) for target in drive.targets]
    rows[OURS].judge(found, truths)
    for name, rival in RIVALS.items():
        with rows[name].clocked(count):
            frames = _frames(drive)
            found = [rival(frames, target.first_mask) for target in drive.targets]
        rows[name].judge(found, truths)
    travel = _frames(drive).travel_cm
    rows[PIXELS].judge([pixel_count(travel, target.pixels) for target in drive.targets], truths)


def _frames(drive: Take) -> Frames:
    grey = [cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) for image in drive.images]
    return Frames(grey, drive.true_poses, drive.lens)


# --- Memory ----------------------------------------------------------------------------------------


def peak_mb(method: str, drive: Take) -> float:
    """Peak memory of a fresh process that runs one method over a drive, above what it had before."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(_peak_mb_here, method, drive).result()


def _peak_mb_here(method: str, drive: Take) -> float:
    cv2.setNumThreads(1)
    Path("/proc/self/clear_refs").write_text("5")  # sets the peak back: receiving the drive took more
    before = peak_kb()
    if method == OURS:
        ours(drive)
    else:
        frames = _frames(drive)
        for target in drive.targets:
            RIVALS[method](frames, target.first_mask)
    return (peak_kb() - before) / 1024


# --- The tables ------------------------------------------------------------------------------------


def advantage(rows: dict[str, Row]) -> dict[str, float | None]:
    """How many times smaller our error is than the best rival's, by median and by rms."""
    out: dict[str, float | None] = {}
    for figure in ("median_percent", "rms_percent"):
        mine = rows[OURS].figures()[figure]
        others = [rows[name].figures()[figure] for name in METHODS if name != OURS]
        known = [other for other in others if other is not None]
        out[figure.removesuffix("_percent")] = min(known) / mine if mine and known else None
    return out


def table_of(results: dict[str, dict[str, Row]], memory_mb: dict[str, float], shake_deg: float) -> Table:
    """One row a method and scene."""
    table = Table(
        title=f"Depth of whole objects at the last frame; frames shaken by up to {shake_deg:g} degrees"
    )
    for heading in ("scene", "method"):
        table.add_column(heading, no_wrap=True)
    for heading in ("none", "median %", "p90 %", "rms %", "<= 2 %", "x ours", "ms", "MB"):
        table.add_column(heading, justify="right", no_wrap=True)
    for scene, rows in results.items():
        mine = rows[OURS].figures()["median_percent"]
        for name, row in rows.items():
            found = row.figures()
            theirs = found["median_percent"]
            table.add_row(
                scene,
                name,
                f"{found['without_depth']}/{found['objects']}",
                *(_cell(found[f"{key}_percent"]) for key in ("median", "p90", "rms")),
                f"{found['within_2_percent']:.0f}",
                _cell(theirs / mine if mine and theirs is not None else None),
                _cell(found["ms_per_frame"], 1),
                _cell(memory_mb.get(name), 1),
            )
            scene = ""
        table.add_section()
    table.caption = (
        "x ours: the median error beside ours; ms: of a frame, all objects; MB: peak of a process of its own"
    )
    return table


def advantages_of(results: dict[str, dict[str, Row]]) -> Iterator[str]:
    """One line a scene: how much more accurate than the best rival."""
    for scene, rows in results.items():
        better = advantage(rows)
        yield (
            f"{scene}: {_cell(better['median'])} (median) and {_cell(better['rms'])} (rms) times "
            f"more accurate than the best rival; the aim is {GOAL:g}"
        )


def _cell(value: float | None, digits: int = 2) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def main() -> None:
    """Measure, print the tables, and write them as JSON if asked to."""
    options = read_options(Options)
    check_json(options.json)
    at_least("seeds", options.seeds, 1)
    at_least("shake-deg", options.shake_deg, 0)
    from rich.console import Console
    from rich.progress import track as progress

    from bench.depth_drives import SCENES, take
    from bench.depth_update import update_times

    cv2.setNumThreads(1)
    results = {scene.name: {name: Row() for name in METHODS} for scene in SCENES}
    drives = [(scene, seed) for scene in SCENES for seed in range(options.seeds)]
    for scene, seed in progress(drives, "driving", transient=True):
        measure(take(scene, seed, options.shake_deg), results[scene.name])
    first = take(SCENES[0], 0, options.shake_deg)
    memory_mb = {name: peak_mb(name, first) for name in (OURS, *RIVALS)}
    update = update_times()
    console = Console(width=110)
    console.print(table_of(results, memory_mb, options.shake_deg))
    for line in advantages_of(results):
        console.print(line, highlight=False)
    console.print(
        f"one depth update with {update.regions:.0f} regions and {update.vertices:.0f} vertices: "
        f"{update.median_ms:.2f} ms (median), {update.p90_ms:.2f} ms (p90); the aim is 1 ms",
        highlight=False,
    )
    document = {
        "scenes": {
            scene: {
                "methods": {name: row.figures() for name, row in rows.items()},
                "advantage": advantage(rows),
            }
            for scene, rows in results.items()
        },
        "peak_memory_mb": memory_mb,
        "depth_update": update.figures(),
    }
    write_json(options.json, document)


if __name__ == "__main__":
    run_command(main)
