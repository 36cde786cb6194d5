"""The net's time and accuracy beside those of its rivals.

    python -m bench.net [--json FILE] [--scenes N] [--rounds N]

Everything runs interleaved in one process on one core; times are thread CPU time, and the minimum is the
figure to trust where other work shares the machine. Nothing passes or fails here.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

import cv2
import numpy as np
import tyro
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bench.flat_scenes import FlatScene, recall
from bench.memory import peak_mb_of_tracking
from host.errors import InputError, run_command
from host.rbdn import Net, Snapshot

SIZES = ((320, 240), (640, 480), (1280, 720))
MOTION_PX = 2.5  # a frame
FRAMES = 5
FIRST, TRACKED, REFINED = "net, first frame", "net, tracked frame", "net, refinement"
WHOLE = "net, all of it, tracked"
OURS = (FIRST, TRACKED, REFINED, WHOLE)
FLOW = "DIS flow, ultrafast"
NOT_INSTALLED = "not installed"
REMEDY = "what is not installed comes with: .venv/bin/pip install -e '.[bench]'"


@dataclass(frozen=True)
class Options:
    """Time the net beside its rivals and print one table."""

    json: Path | None = None
    """Also write the figures to this file."""
    scenes: int = 24
    """Random scenes at 320x240; fewer at larger sizes, for the same number of pixels."""
    rounds: int = 3
    """How often the net and the flow go through each scene."""


@dataclass
class Row:
    """What one method did at one size."""

    times_ms: list[float] = field(default_factory=list)
    found: int = 0
    true: int = 0
    note: str = ""

    def figures(self) -> dict[str, float | str | None]:
        """The row for JSON; None where nothing was measured."""
        return {
            "min_ms": min(self.times_ms) if self.times_ms else None,
            "median_ms": median(self.times_ms) if self.times_ms else None,
            "recall_iou_0.9": self.found / self.true if self.true else None,
            "note": self.note,
        }


Segmenter = Callable[[np.ndarray], np.ndarray]


def segmenters() -> dict[str, Segmenter | None]:
    """Rivals that make regions of one image, None where their package is missing."""
    try:
        from skimage.segmentation import felzenszwalb, slic  # pyright: ignore[reportMissingImports]
    except ImportError:
        return {"felzenszwalb": None, "SLIC": None}
    return {
        "felzenszwalb": lambda image: felzenszwalb(image, scale=300, sigma=0.8, min_size=200),
        "SLIC": lambda image: slic(image, n_segments=200, compactness=10, start_label=0),
    }


class TimedCore:
    """Stands before the net's engine and takes the time of its two calls apart."""

    def __init__(self, core) -> None:
        self._core = core
        self.track_ms = self.refine_ms = 0.0

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
            _follow(rows, frames, flow, judge=turn == 0)
        image, truth = frames[0]
        rgb = np.ascontiguousarray(image[:, :, ::-1])
        for name, rival in rivals.items():
            if rival is not None:
                _judge(rows[name], truth, _timed(rows[name], lambda run=rival, rgb=rgb: run(rgb)))
    return rows


def _follow(rows: dict[str, Row], frames: list[tuple[np.ndarray, np.ndarray]], flow, judge: bool) -> None:
    """One new net through the frames, the flow of the same frames in between."""
    net = Net()
    core = TimedCore(net._core)
    net._core = core  # pyright: ignore[reportAttributeAccessIssue]
    before = None
    for k, (image, truth) in enumerate(frames):
        begin = time.thread_time()
        snapshot = net.track(image)
        if k > 0:
            rows[WHOLE].times_ms.append(1e3 * (time.thread_time() - begin))
        row = rows[TRACKED if k > 0 else FIRST]
        row.times_ms.append(core.track_ms)
        rows[REFINED].times_ms.append(core.refine_ms)
        if judge:
            _judge(row, truth, _labels_of(snapshot, *truth.shape))
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        if before is not None:
            _timed(rows[FLOW], lambda a=before, b=grey: flow.calc(a, b, None))  # pyright: ignore
        before = grey


def _timed(row: Row, run: Callable[[], np.ndarray]) -> np.ndarray:
    begin = time.thread_time()
    out = run()
    row.times_ms.append(1e3 * (time.thread_time() - begin))
    return out


def _judge(row: Row, truth: np.ndarray, labels: np.ndarray) -> None:
    found, true = recall(truth, labels)
    row.found += found
    row.true += true


def _labels_of(snapshot: Snapshot, height: int, width: int) -> np.ndarray:
    """Region of every pixel, painted from the snapshot's outlines."""
    labels = np.zeros((height, width), np.int32)
    # Largest first, so that what lies in a hole is painted over it.
    for index, region in sorted(enumerate(snapshot.regions), key=lambda item: -item[1].area_px):
        outline = np.round(16 * region.loops[0]).astype(np.int32)
        cv2.fillPoly(labels, [outline], (index + 1,), shift=4)
    return labels


def table_of(results: dict[str, dict[str, Row]], memory_mb: float) -> Table:
    """The figures as a person wants them: one row a method and size."""
    table = Table(title=f"Flat scenes, noise 4, motion {MOTION_PX} px a frame; thread CPU time on one core")
    for heading in ("image", "method"):
        table.add_column(heading)
    for heading in ("min ms", "median ms", "x flow", "recall at IoU .9"):
        table.add_column(heading, justify="right")
    for size, rows in results.items():
        one_flow = min(rows[FLOW].times_ms)
        for name, row in rows.items():
            if not row.times_ms:
                table.add_row(size, name, row.note)
                continue
            fastest = min(row.times_ms)
            share = f"{100 * row.found / row.true:.1f} %" if row.true else ""
            times = (fastest, median(row.times_ms), fastest / one_flow)
            table.add_row(size, name, *(f"{t:.2f}" for t in times), share)
        table.add_section()
    table.caption = f"Peak memory of a process tracking 1280x720: {memory_mb:.0f} MB above its imports"
    if any(row.note for rows in results.values() for row in rows.values()):
        table.caption += escape(f"\n{REMEDY}")
    return table


def main() -> None:
    """Measure, print the table, and write it as JSON if asked to."""
    options = tyro.cli(Options)
    cv2.setNumThreads(1)
    results = {f"{width}x{height}": measure_size(width, height, options) for width, height in SIZES}
    memory_mb = peak_mb_of_tracking(1280, 720)
    Console().print(table_of(results, memory_mb))
    if options.json is not None:
        document = {
            "sizes": {size: {k: row.figures() for k, row in rows.items()} for size, rows in results.items()},
            "peak_memory_mb_1280x720": memory_mb,
        }
        try:
            options.json.write_text(json.dumps(document, indent=2) + "\n")
        except OSError as error:
            raise InputError(f"{options.json}: {error.strerror}; give a file that can be written") from error


if __name__ == "__main__":
    run_command(main)
