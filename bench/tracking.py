"""Does tracking decay? Long runs, passes, every third frame, to and fro, and ids on recordings.

    python -m bench.tracking [SEQUENCE...] [--json FILE] [--scenes N] [--frames N]

Sequence folders given are played to and fro; where they have measured depth, it tells which pixels must keep
their region's id. Times are thread CPU time of the net alone. Nothing passes or fails here.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Annotated, Any

import cv2
import numpy as np
from rich.console import Console
from rich.progress import track as progress
from rich.table import Table
from tyro.conf import Positional

from bench.figures_file import check_json, write_json
from bench.label_map import iou_table, label_map, overlaps
from bench.options import at_least
from bench.passes import KINDS, LOOKS, STILL_FRAMES, PassScene
from bench.sequences import LongRun, Shot, Truth, corridor, recorded, table_top
from host.camera.lens import Lens
from host.config import read_options
from host.errors import run_command
from host.rbdn import Net

PASSES = 9  # of a sequence played to and fro
SMALLEST_PX = 200  # visible pixels below which an object need not be found
NEWS_PX = 300  # visible pixels from which an object that enters must be found
FOUND_FRAMES = 2
FOUND_IOU = 0.5
GOOD_IOU = 0.75
THIRD = 3  # "every third frame"
SCORED_EVERY = 10  # frames of a long run
SAME_DEPTH = 0.1  # relative; what differs more is another surface


@dataclass(frozen=True)
class Options:
    """Measure whether tracking decays and print one table."""

    sequences: Annotated[tuple[Path, ...], Positional] = ()
    """Sequence folders, played to and fro."""
    json: Path | None = None
    """Also write the figures to this file."""
    scenes: int = 4
    """Generated passes of each kind and look."""
    frames: int = 300
    """Length of the long runs."""


@dataclass(frozen=True)
class View:
    """What the net made of one frame."""

    ids: tuple[int, ...]  # of the regions
    index: np.ndarray  # (H, W): which of them holds each pixel
    faces: int
    vertices: int
    edges: int
    ms: float
    sound: bool

    def shared_with(self, truth: np.ndarray, count: int) -> np.ndarray:
        """Pixels that true label t and region r share, (count, regions)."""
        return overlaps(truth, self.index, count, len(self.ids))


class Follower:
    """A net whose every frame is timed and checked."""

    def __init__(self, lens: Lens | None = None) -> None:
        self._net = Net(lens=lens)
        self._core = _TimedCore(self._net._core)
        self._net._core = self._core  # pyright: ignore[reportAttributeAccessIssue]

    def see(self, image: np.ndarray, rotation: np.ndarray | None = None) -> View:
        """Track one frame."""
        snapshot = self._net.track(image, rotation)
        faces = self._net.faces()
        return View(
            ids=tuple(r.id for r in snapshot.regions),
            index=label_map(snapshot.regions, image.shape[:2]),
            faces=len(faces["means"]),
            vertices=len(faces["vertices_px"]),
            edges=len(faces["edges"]),
            ms=self._core.ms,
            sound=not self._net.faults(),
        )


class _TimedCore:
    """Stands before the net's engine and takes its time."""

    def __init__(self, core) -> None:
        self._core = core
        self.ms = 0.0

    def track(self, *arguments: np.ndarray) -> None:
        begin = time.thread_time()
        self._core.track(*arguments)
        self.ms = 1e3 * (time.thread_time() - begin)

    def __getattr__(self, name: str):
        return getattr(self._core, name)


# --- Scores ----------------------------------------------------------------------------------------


def object_ious(view: View, truth: Truth) -> dict[int, float]:
    """For every object that is large enough the best overlap of a region with it or its largest part."""
    count = int(max(truth.object_id.max(), truth.part_id.max(), *truth.foreground)) + 1
    wholes, parts = view.shared_with(truth.object_id, count), view.shared_with(truth.part_id, count)
    whole_iou, part_iou = iou_table(wholes), iou_table(parts)
    out = {}
    for thing, own in truth.foreground.items():
        if wholes[thing].sum() < SMALLEST_PX:
            continue
        largest = max(own, key=lambda p: parts[p].sum() if p < count else 0)
        out[thing] = float(max(whole_iou[thing].max(), part_iou[largest].max()))
    return out


def share(hits: Iterable[bool]) -> float | None:
    """In percent; None of nothing."""
    hits = list(hits)
    return 100 * sum(hits) / len(hits) if hits else None


def kept_ids(before: View, now: View, shots: tuple[Shot, Shot], lens: Lens) -> np.ndarray:
    """Which pixels kept their region's id: of those outside the largest region, seen again at the next frame.

    Their measured depth tells where they must be then, and whether they are still to be seen there.
    """
    first, second = shots
    assert first.depth_cm is not None and second.depth_cm is not None
    largest = np.bincount(before.index.ravel()).argmax()
    y, x = np.nonzero((first.depth_cm > 0) & (before.index != largest))
    z = first.depth_cm[y, x]
    rays = lens.to_rays(np.column_stack([x, y]).astype(float))
    rotation, shift = first.pose.relative_to(second.pose)
    places = np.column_stack([rays, np.ones(len(rays))]) * z[:, None] @ rotation.T + shift
    ahead = places[:, 2] > 1.0
    x, y, places = x[ahead], y[ahead], places[ahead]
    to = np.rint(lens.to_pixels(places[:, :2] / places[:, 2:])).astype(int)
    height, width = second.depth_cm.shape
    inside = (to >= 0).all(1) & (to[:, 0] < width) & (to[:, 1] < height)
    x, y, places, to = x[inside], y[inside], places[inside], to[inside]
    seen = second.depth_cm[to[:, 1], to[:, 0]]
    same = (seen > 0) & (np.abs(seen / places[:, 2] - 1) < SAME_DEPTH)
    ids_before, ids_now = np.array(before.ids), np.array(now.ids)
    return (ids_before[before.index[y, x]] == ids_now[now.index[to[:, 1], to[:, 0]]])[same]


# --- Long runs -------------------------------------------------------------------------------------


def measure_long_run(run: LongRun) -> dict[str, Any]:
    """The last third of a long run beside nets made afresh from the same frames."""
    follower = Follower()
    tracked: list[View] = []
    pairs: list[tuple[View, View, Truth]] = []
    last = None
    for k, shot in enumerate(run.shots(2 * len(run.poses) // 3, SCORED_EVERY)):
        tracked.append(follower.see(shot.image))
        if shot.truth is not None and last is not None:
            # Made from the frame before, so that its second frame's time can be compared.
            fresh = Follower()
            fresh.see(last)
            pairs.append((tracked[k], fresh.see(shot.image), shot.truth))
        last = shot.image

    def recall(views: Iterable[tuple[View, Truth]]) -> float | None:
        return share(iou >= GOOD_IOU for view, true in views for iou in object_ious(view, true).values())

    def ratio(figure: str) -> float:
        return median(getattr(a, figure) / getattr(b, figure) for a, b, _ in pairs)

    return {
        "recall": recall((view, true) for view, _, true in pairs),
        "recall_fresh": recall((fresh, true) for _, fresh, true in pairs),
        "faces_ratio": ratio("faces"),
        "vertices_ratio": ratio("vertices"),
        "time_ratio": ratio("ms"),
        **_times(tracked[1:]),
    }


def measure_to_and_fro(shots: Sequence[Shot], lens: Lens) -> dict[str, Any]:
    """Nine passes over a sequence; the last beside the first."""
    follower = Follower(lens)
    order = list(range(len(shots)))
    passes: list[list[View]] = []
    last: Shot | None = None
    for turn in range(PASSES):
        views = []
        for k in order if turn == 0 else order[1:]:
            rotation = None if last is None else shots[k].pose.relative_to(last.pose)[0]
            views.append(follower.see(shots[k].image, rotation))
            last = shots[k]
        passes.append(views if turn == 0 else [passes[-1][-1], *views])
        order.reverse()

    def recall(views: list[View]) -> float | None:
        truths = [s.truth for s in shots]  # the last pass runs forward like the first
        pairs = [(v, t) for v, t in zip(views[1:], truths[1:], strict=True) if t is not None]
        return share(iou >= GOOD_IOU for v, t in pairs for iou in object_ious(v, t).values())

    def kept(views: list[View]) -> float | None:
        hits = [
            kept_ids(a, b, (shots[k], shots[k + 1]), lens)
            for k, (a, b) in enumerate(pairwise(views))
            if shots[k].depth_cm is not None
        ]
        return 100 * float(np.concatenate(hits).mean()) if hits else None

    def ratio(figure: str) -> float:
        first, final = (median(getattr(v, figure) for v in views[1:]) for views in (passes[0], passes[-1]))
        return final / first

    return {
        "recall": recall(passes[-1]),
        "recall_first_pass": recall(passes[0]),
        "ids_kept": kept(passes[-1]),
        "ids_kept_first_pass": kept(passes[0]),
        "faces_ratio": ratio("faces"),
        "edges_ratio": ratio("edges"),
        "time_ratio": ratio("ms"),
        **_times([view for views in passes for view in views[1:]]),
    }


def _times(views: list[View]) -> dict[str, Any]:
    typical = median(v.ms for v in views)
    return {
        "median_ms": typical,
        "worst_over_median": max(v.ms for v in views) / typical,
        "unsound_frames": sum(not v.sound for v in views),
    }


# --- Passes ----------------------------------------------------------------------------------------


@dataclass
class PassScore:
    """What was seen of some passes."""

    found_after: list[int] = field(default_factory=list)  # frames of NEWS_PX, for each that entered
    kept: list[bool] = field(default_factory=list)  # each object in each frame of a pass: its id from before?
    recovered: list[bool] = field(default_factory=list)  # each object of a pass: is it whole in the end?
    same_id: list[bool] = field(default_factory=list)  # and with its id from before?
    debris: list[int] = field(default_factory=list)  # regions too many in the end
    good: list[bool] = field(default_factory=list)  # each object in each third frame

    def add(self, other: PassScore) -> None:
        """Take in what was seen of more passes."""
        for name in vars(self):
            getattr(self, name).extend(getattr(other, name))


def judge_pass(scene: PassScene, views: Sequence[View], labels: Sequence[np.ndarray], step: int) -> PassScore:
    """One scene of which every `step`-th frame was tracked; `labels` are those frames' true ones."""
    score = PassScore()
    pair = () if scene.partner is None else (scene.mover, scene.partner)
    tables = [view.shared_with(true, scene.labels) for view, true in zip(views, labels, strict=True)]
    rested = STILL_FRAMES // step
    before = {t: views[rested].ids[iou_table(tables[rested])[t].argmax()] for t in pair}
    for k, (view, shared) in enumerate(zip(views, tables, strict=True)):
        visible, iou = shared.sum(1), iou_table(shared).max(1)
        if k * step % THIRD == 0:
            score.good += [bool(iou[t] >= GOOD_IOU) for t in range(1, len(iou)) if visible[t] >= SMALLEST_PX]
        for t in pair:
            if k > rested and visible[t] >= NEWS_PX:
                most = shared[t].argmax()
                score.kept.append(view.ids[most] == before[t] and 2 * shared[t, most] > shared[:, most].sum())
    if scene.enters:
        sizes = np.array([shared[scene.mover].sum() for shared in tables])
        ious = np.array([iou_table(shared)[scene.mover].max() for shared in tables])
        since = int((sizes >= NEWS_PX).argmax())
        found = np.flatnonzero(ious[since:] >= FOUND_IOU)
        score.found_after.append(int(found[0]) if len(found) else len(views))
    last = iou_table(tables[-1])
    for t in pair:
        score.recovered.append(bool(last[t].max() >= GOOD_IOU))
        score.same_id.append(score.recovered[-1] and views[-1].ids[last[t].argmax()] == before[t])
    score.debris.append(max(0, len(views[-1].ids) - int((tables[-1].sum(1) > 0).sum())))
    return score


def measure_passes(count: int, looks: Sequence[str] = LOOKS) -> dict[str, Any]:
    """Generated passes, tracked at every frame and at every third."""
    scores = {(kind, step): PassScore() for kind in KINDS for step in (1, THIRD)}
    views: list[View] = []
    scenes = [(kind, look, seed) for kind in KINDS for look in looks for seed in range(count)]
    for kind, look, seed in progress(scenes, "passes", transient=True):
        scene = PassScene(kind, look, seed)
        frames = [scene.draw(k) for k in range(scene.frames)]
        for step in (1, THIRD):
            follower = Follower()
            seen = [follower.see(image) for image, _ in frames[::step]]
            scores[kind, step].add(judge_pass(scene, seen, [true for _, true in frames[::step]], step))
            views += seen[1:]

    def over(kinds: Iterable[str], figure: str, step: int = 1) -> list[Any]:
        return [hit for kind in kinds for hit in getattr(scores[kind, step], figure)]

    partial = ("part", "across")
    return {
        "found_within_2_frames": share(n <= FOUND_FRAMES for n in over(["enter"], "found_after")),
        "ids_kept_while_partly_covered": share(over(partial, "kept")),
        "recovered_after_partial_pass": share(over(partial, "recovered")),
        "recovered_after_full_pass": share(over(["cover"], "recovered")),
        "same_id_after_full_pass": share(over(["cover"], "same_id")),
        "debris_per_scene": float(np.mean(over(KINDS, "debris"))),
        "recall": share(over(KINDS, "good")),
        "recall_every_third_frame": share(over(KINDS, "good", THIRD)),
        **_times(views),
    }


# --- The table -------------------------------------------------------------------------------------


def table_of(figures: dict[str, dict[str, Any]]) -> Table:
    """All figures, a section for each sequence; those a section lacks are left out."""
    table = Table(title="Tracking over time; recall at IoU 0.75, in percent")
    for heading, side in (("sequence", "left"), ("figure", "left"), ("value", "right")):
        table.add_column(heading, justify=side)  # pyright: ignore[reportArgumentType]
    for name, section in figures.items():
        for figure, value in section.items():
            if value is not None:
                text = str(value) if isinstance(value, int) else f"{value:.2f}"
                table.add_row(name, figure.replace("_", " "), text)
                name = ""
        table.add_section()
    return table


def main() -> None:
    """Measure, print the table, and write it as JSON if asked to."""
    options = read_options(Options)
    check_json(options.json)
    at_least("scenes", options.scenes, 1)
    at_least("frames", options.frames, 2)
    cv2.setNumThreads(1)
    folders = {folder.name: recorded(folder) for folder in options.sequences}
    figures: dict[str, dict[str, Any]] = {"generated passes": measure_passes(options.scenes)}
    runs = [make(seed, options.frames) for make in (table_top, corridor) for seed in (1, 2)]
    for run in progress(runs, "long runs", transient=True):
        figures[run.name] = measure_long_run(run)
    for name, (shots, lens) in progress(folders.items(), "to and fro", transient=True):
        figures[name] = measure_to_and_fro(shots, lens)
    Console(width=110).print(table_of(figures))
    write_json(options.json, figures)


if __name__ == "__main__":
    run_command(main)
