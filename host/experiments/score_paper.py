"""Depths by the paper's formulas, on its own polygons and on the areas that are truly visible."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from host.camera.lens import Lens
from host.depth.two_frames import area_depth_cm, place_cm, vertex_depth_cm
from host.experiments.findings import At, Finding
from host.experiments.paper_mode import PolygonNet
from host.experiments.task import Scored, as_printed
from host.experiments.truth import FrameTruth, by_object, pixel_of

NEAR_PX = 8.0  # a vertex so far from a corner is not that corner: these polygons are rough


def score_paper(
    scored: Scored, start: PolygonNet, now: PolygonNet, odometry: str, k: int, lens: Lens
) -> Iterator[Finding]:
    """Eq. 16 on the polygon that showed most of each object, Eq. 10 on its vertices nearest the corners."""
    task, first = scored.task, scored.first
    travel, about = scored.travel_cm(k, odometry), task.course.looks[k]
    common = (task.course.name, task.seed, odometry)
    for thing_id, regions in by_object(first.shown(start.snapshot)).items():
        if thing_id not in first.things:
            continue
        thing = first.things[thing_id]
        polygon = max(regions, key=lambda shown: shown.pixels).region.id
        found = growth = None
        if polygon in now.areas_px2 and travel > 0:
            before, after = start.areas_px2[polygon], now.areas_px2[polygon]
            found = _number(area_depth_cm(before, after, travel))
            growth = after - before
        for at, true, carried in _both_ends(thing.mean_cm, scored.travel_cm(k), travel):
            depth = None if found is None else found + carried
            yield Finding(
                *common, "paper area", thing.name, about, at, true, depth,
                growth=growth, setting=task.setting,
            )  # fmt: skip
    middle = np.array([lens.cx, lens.cy])
    for name, corner in first.corners_cm().items():
        seen = pixel_of(corner, lens)
        nearest = min(start.vertices_px, key=lambda v: float(np.hypot(*(start.vertices_px[v] - seen))))
        found = place = growth = None
        if (
            nearest in now.vertices_px
            and travel > 0
            and np.hypot(*(start.vertices_px[nearest] - seen)) < NEAR_PX
        ):
            before, after = (net.vertices_px[nearest] - middle for net in (start, now))
            found = _number(vertex_depth_cm(before[1], after[1], travel))
            growth = abs(float(after[1] - before[1]))
            if found is not None:
                place = as_printed(place_cm(before[None], [found], lens.fx)[0])
        yield Finding(
            *common, "paper vertex", name, about, "first", float(corner[2]), found,
            true_place_cm=as_printed(corner), place_cm=place, growth=growth, setting=task.setting,
        )  # fmt: skip


def score_exact_areas(scored: Scored, truth: FrameTruth, k: int) -> Iterator[Finding]:
    """Eq. 16 on the areas truly visible from a camera that does not shake: the limit of the formula."""
    task, travel, about = scored.task, scored.travel_cm(k), scored.task.course.looks[k]
    for thing_id, thing in scored.first.things.items():
        if thing_id not in truth.things or not (thing.whole and truth.things[thing_id].whole):
            continue
        found = _number(area_depth_cm(thing.area_px, truth.things[thing_id].area_px, travel))
        for at, true, carried in _both_ends(thing.mean_cm, travel, travel):
            true = truth.things[thing_id].mean_cm if at == "last" else true
            depth = None if found is None else found + carried
            yield Finding(
                task.course.name, task.seed, "exact", "exact areas", thing.name, about, at, true, depth,
                setting=task.setting,
            )  # fmt: skip


def _both_ends(mean_cm: float, true_travel: float, travel: float) -> Iterator[tuple[At, float, float]]:
    """At which camera, the truth there, and what to add to a depth found for the first one."""
    yield "first", mean_cm, 0.0
    yield "last", mean_cm - true_travel, -travel


def _number(value: np.ndarray) -> float | None:
    return float(value) if np.isfinite(value) else None
