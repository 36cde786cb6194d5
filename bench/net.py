"""The net's time and accuracy beside those of its rivals.

    python -m bench.net [--json FILE] [--scenes N] [--rounds N] [--judged-scenes N]

Everything runs interleaved in one process on one core. Times are thread CPU time, each image's quietest of
several rounds, since other work may share the machine. Nothing passes or fails here.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

import cv2
import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bench.figures_file import check_json, write_json
from bench.flat_scenes import DISTURBANCES, FlatScene, Score, labels_of, score
from bench.memory import peak_mb_of_tracking
from bench.options import at_least
from host.config import read_options
from host.errors import run_command
from host.rbdn import Net, NetConfig

SIZES = ((320, 240), (640, 480), (1280, 720))
MOTION_PX = 2.5  # a frame
FRAMES = 5
FIRST, TRACKED, REFINED = "net, first frame", "net, tracked frame", "net, refinement"
WHOLE = "net, all of it, tracked"
PAPER_FIRST, PAPER_TRACKED = "paper's rules, first frame", "paper's rules, tracked frame"
OURS = (FIRST, TRACKED, REFINED, WHOLE, PAPER_FIRST, PAPER_TRACKED)
PAPER = NetConfig(mode="paper")
FLOW = "DIS flow, ultrafast"
NOT_INSTALLED = "not installed"
REMEDY = (
    "felzenszwalb and SLIC come with: .venv/bin/pip install -e '.[bench]'\n"
    "SEEDS with opencv-contrib-python-headless in place of opencv-python-headless"
)


@dataclass(frozen=True)
class Options:
    """Time the net beside its rivals and print one table."""

    json: Path | None = None
    """Also write the figures to this file."""
    scenes: int = 24
    """Random scenes at 320x240; fewer at larger sizes, for the same number of pixels."""
    rounds: int = 3
    """How often the net and the flow go through each scene."""
    judged_scenes: int = 30
    """Random scenes at 320x240, spoiled in each way, for the quality of the first frame; 0 for none."""


@dataclass
class Row:
    """What one method did at one size."""

    quietest_ms: dict[tuple[int, int], float] = field(default_factory=dict)  # by scene and frame
    score: Score = field(default_factory=Score)
    images: int = 0  # that were scored
    note: str = ""

    def clock(self, image: tuple[int, int], ms: float) -> None:
        """Takes the time of one more run on an image."""
        self.quietest_ms[image] = min(ms, self.quietest_ms.get(image, ms))

    @property
    def median_ms(self) -> float:
        """Of the images."""
        return median(self.quietest_ms.values())

    def judge(self, truth: np.ndarray, labels: np.ndarray) -> None:
        """Adds what was found in one more image."""
        self.score += score(truth, labels)
        self.images += 1

    def figures(self) -> dict[str, float | str | None]:
        """The row for JSON; None where nothing was measured."""
        return {
            "min_ms": min(self.quietest_ms.values()) if self.quietest_ms else None,
            "median_ms": self.median_ms if self.quietest_ms else None,
            "recall_iou_0.9": self.score.found / self.score.true if self.score.true else None,
            "excess_regions_per_image": self.score.excess / self.images if self.images else None,
            "note": self.note,
        }


Segmenter = Callable[[np.ndarray], np.ndarray]


def segmenters() -> dict[str, Segmenter | None]:
    """Rivals that make regions of one image, None where their package is missing."""
    out: dict[str, Segmenter | None] = {"felzenszwalb": None, "SLIC": None, "SEEDS": None}
    try:
        from skimage.segmentation import felzenszwalb, slic  # pyright: ignore[reportMissingImports]

        out["felzenszwalb"] = lambda image: felzenszwalb(_rgb(image), scale=300, sigma=0.8, min_size=200)
        out["SLIC"] = lambda image: slic(_rgb(image), n_segments=200, compactness=10, start_label=0)
    except ImportError:
        pass
    if hasattr(cv2, "ximgproc"):
        out["SEEDS"] = _seeds
    return out


def _rgb(image: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(image[:, :, ::-1])


def _seeds(image: np.ndarray) -> np.ndarray:
    height, width = image.shape[:2]
    run = cv2.ximgproc.createSuperpixelSEEDS(width, height, 3, 200, 4)  # pyright: ignore
    run.iterate(cv2.cvtColor(image, cv2.COLOR_BGR2LAB), 5)
    return run.getLabels()


class TimedCore:
    """Stands before the net's engine and takes the time of its two calls apart."""

    def __init__(self, core) -> None:
        self._core = core
        self.track_ms = self.refine_ms = 0.0

    @classmethod
    def of(cls, net: Net) -> TimedCore:
        """Puts itself into a net, which calls it from then on."""
        core = cls(net._core)
        net._core = core  # pyright: ignore[reportAttributeAccessIssue]
        return core

    def track(self, bgr: np.ndarray, source: np.ndarray) -> None:
        begin = time.thread_time()
        self._core.track(bgr, source)
        self.track_ms = 1e3 * (time.thread_time() - begin)

    def refine(self, bgr: np.ndarray) -> dict[str, np.ndarray]:
        begin = time.thread_time()
        out = self._core.refine(bgr)
        self.refine_ms = 1e3 * (time.thread_time() - begin)
        return out

    def __getattr__(self, name: str):
        return getattr(self._core, name)


def measure_size(width: int, height: int, options: Options) -> dict[str, Row]:
    """All methods at one image size, taking turns on the same frames."""
    rows = {name: Row() for name in OURS}
    rows[FLOW] = Row()
    rivals = segmenters()
    for name, rival in rivals.items():
        rows[name] = Row(note="" if rival else NOT_INSTALLED)
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
    for seed in range(max(2, round(options.scenes * 320 * 240 / (width * height)))):
        frames = [FlatScene(seed).draw(width, height, MOTION_PX * k) for k in range(FRAMES)]
        for turn in range(options.rounds):
            _follow(rows, seed, frames, flow, judge=turn == 0)
        image, truth = frames[0]
        for name, rival in rivals.items():
            if rival is not None:
                rows[name].judge(
                    truth, _timed(rows[name], (seed, 0), lambda run=rival, image=image: run(image))
                )
    return rows


def judge_first_frames(scenes: int) -> dict[str, dict[str, Row]]:
    """What is found in single images, by disturbance and method."""
    rivals = segmenters()
    results: dict[str, dict[str, Row]] = {}
    for disturbance, how in DISTURBANCES.items():
        rows = results[disturbance] = {FIRST: Row(), PAPER_FIRST: Row()}
        rows |= {name: Row(note="" if rival else NOT_INSTALLED) for name, rival in rivals.items()}
        for seed in range(scenes):
            image, truth = FlatScene(seed).draw(320, 240, disturbance=how)
            for name, config in ((FIRST, NetConfig()), (PAPER_FIRST, PAPER)):
                core = TimedCore.of(net := Net(config))
                rows[name].judge(truth, labels_of(net.track(image), 320, 240))
                rows[name].clock((seed, 0), core.track_ms)
            for name, rival in rivals.items():
                if rival is not None:
                    rows[name].judge(
                        truth, _timed(rows[name], (seed, 0), lambda run=rival, image=image: run(image))
                    )
    return results


def _follow(
    rows: dict[str, Row], seed: int, frames: list[tuple[np.ndarray, np.ndarray]], flow, judge: bool
) -> None:
    """A new net of each mode through the frames, the flow of the same frames in between."""
    core = TimedCore.of(net := Net())
    literal_core = TimedCore.of(literal_net := Net(PAPER))
    before = None
    for k, (image, truth) in enumerate(frames):
        begin = time.thread_time()
        snapshot = net.track(image)
        if k > 0:
            rows[WHOLE].clock((seed, k), 1e3 * (time.thread_time() - begin))
        row = rows[TRACKED if k > 0 else FIRST]
        row.clock((seed, k), core.track_ms)
        rows[REFINED].clock((seed, k), core.refine_ms)
        if judge:
            row.judge(truth, labels_of(snapshot, truth.shape[1], truth.shape[0]))
        snapshot = literal_net.track(image)
        row = rows[PAPER_TRACKED if k > 0 else PAPER_FIRST]
        row.clock((seed, k), literal_core.track_ms)
        if judge:
            row.judge(truth, labels_of(snapshot, truth.shape[1], truth.shape[0]))
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        if before is not None:
            _timed(rows[FLOW], (seed, k), lambda a=before, b=grey: flow.calc(a, b, None))  # pyright: ignore
        before = grey


def _timed(row: Row, image: tuple[int, int], run: Callable[[], np.ndarray]) -> np.ndarray:
    begin = time.thread_time()
    out = run()
    row.clock(image, 1e3 * (time.thread_time() - begin))
    return out


def table_of(results: dict[str, dict[str, Row]], memory_mb: float) -> Table:
    """The figures as a person wants them: one row a method and size."""
    table = Table(title=f"Flat scenes, noise 4, motion {MOTION_PX} px a frame; thread CPU time on one core")
    for heading in ("image", "method"):
        table.add_column(heading)
    for heading in ("min ms", "median ms", "x flow", "found at IoU .9", "excess"):
        table.add_column(heading, justify="right")
    for size, rows in results.items():
        for name, row in rows.items():
            if not row.quietest_ms:
                table.add_row(size, name, row.note)
                continue
            times = (min(row.quietest_ms.values()), row.median_ms, row.median_ms / rows[FLOW].median_ms)
            table.add_row(size, name, *(f"{t:.2f}" for t in times), *_quality(row))
        table.add_section()
    small, *_, large = results
    growth = results[large][TRACKED].median_ms / results[small][TRACKED].median_ms
    table.caption = (
        f"Tracking {large} costs {growth:.1f} times what {small} does; "
        f"peak memory of a process tracking it: {memory_mb:.0f} MB above its imports"
    )
    if any(row.note for rows in results.values() for row in rows.values()):
        table.caption += escape(f"\n{REMEDY}")
    return table


def quality_table_of(results: dict[str, dict[str, Row]]) -> Table:
    """What is found in first frames, spoiled in several ways."""
    scenes = max(row.images for rows in results.values() for row in rows.values())
    table = Table(title=f"First frames of {scenes} flat scenes, 320x240, 2 to 6 overlapping shapes")
    for heading in ("spoiled by", "method"):
        table.add_column(heading)
    for heading in ("median ms", "found at IoU .9", "excess"):
        table.add_column(heading, justify="right")
    for disturbance, rows in results.items():
        for name, row in rows.items():
            time_ms = f"{row.median_ms:.2f}" if row.quietest_ms else row.note
            table.add_row(disturbance, name, time_ms, *_quality(row))
        table.add_section()
    return table


def _quality(row: Row) -> tuple[str, str]:
    if not row.images:
        return "", ""
    return f"{100 * row.score.found / row.score.true:.1f} %", f"{row.score.excess / row.images:.2f}"


def main() -> None:
    """Measure, print the table, and write it as JSON if asked to."""
    options = read_options(Options)
    check_json(options.json)
    at_least("scenes", options.scenes, 1)
    at_least("rounds", options.rounds, 1)
    at_least("judged-scenes", options.judged_scenes, 0)
    cv2.setNumThreads(1)
    results = {f"{width}x{height}": measure_size(width, height, options) for width, height in SIZES}
    memory_mb = peak_mb_of_tracking(1280, 720)
    Console(width=110).print(table_of(results, memory_mb))
    quality = judge_first_frames(options.judged_scenes) if options.judged_scenes > 0 else {}
    if quality:
        Console(width=110).print(quality_table_of(quality))
    document = {
        "sizes": {size: {k: row.figures() for k, row in rows.items()} for size, rows in results.items()},
        "first_frames": {how: {k: row.figures() for k, row in rows.items()} for how, rows in quality.items()},
        "peak_memory_mb_1280x720": memory_mb,
    }
    write_json(options.json, document)


if __name__ == "__main__":
    run_command(main)
