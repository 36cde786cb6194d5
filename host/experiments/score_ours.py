"""Depths by our estimator, carried to the camera they are asked for, and how honest their sigmas are."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from host.camera.lens import Lens
from host.depth.report import DepthReport, RegionDepth
from host.depth.two_frames import area_sensitivity
from host.experiments.course import Course
from host.experiments.findings import At, Finding, Pull
from host.experiments.task import Scored, as_printed
from host.experiments.truth import FrameTruth, Shown, by_object, pixel_of
from host.pose import Pose
from host.rbdn import Snapshot

METHODS = ("area", "outline", "vertex", "fused")
NEAR_PX = 3.0  # a vertex so far from a corner is not that corner
MOST_SHARE = 0.5  # of an object's pixels that must lie in regions with a depth


def score_ours(
    scored: Scored,
    truth: FrameTruth,
    snapshot: Snapshot,
    report: DepthReport,
    odometry: str,
    k: int,
    lens: Lens,
) -> Iterator[Finding]:
    """Every object by every method, and the corners; carried to the first camera by the solved motion."""
    task, first = scored.task, scored.first
    poses = scored.drive.odometry[odometry]
    turn, shift = camera_of(report, poses[k]).relative_to(poses[0])
    travel = task.course.looks[k]
    common = (task.course.name, task.seed, odometry)
    regions = by_object(truth.shown(snapshot))
    for thing_id, thing in first.things.items():
        if thing_id not in truth.things:
            continue
        for method in METHODS:
            known = [
                (shown, *answer)
                for shown in regions.get(thing_id, [])
                if (answer := _answer(report.regions[shown.region.id], method)) is not None
            ]
            pixels = np.array([shown.pixels for shown, *_ in known])
            enough = pixels.sum() >= MOST_SHARE * truth.things[thing_id].area_px
            ends: tuple[tuple[At, float], ...] = (
                ("first", thing.mean_cm),
                ("last", truth.things[thing_id].mean_cm),
            )
            for at, true in ends:
                found = sigma = growth = None
                if enough:
                    depths = [_carried(shown, depth, lens, at, turn, shift) for shown, depth, _ in known]
                    found = float(pixels @ depths / pixels.sum())
                    sigma = float(pixels @ [s for *_, s in known] / pixels.sum())
                    if method == "area":
                        area = sum(shown.region.area_px for shown, *_ in known)
                        growth = float(area_sensitivity(area, found)) * travel
                yield Finding(
                    *common, method, thing.name, travel, at, true, found, sigma,
                    growth=growth, setting=task.setting,
                )  # fmt: skip
    yield from _our_corners(scored, truth, snapshot, report, common, k, (turn, shift), lens)


def _our_corners(
    scored: Scored,
    truth: FrameTruth,
    snapshot: Snapshot,
    report: DepthReport,
    common: tuple[str, int, str],
    k: int,
    back: tuple[np.ndarray, np.ndarray],
    lens: Lens,
) -> Iterator[Finding]:
    """The vertex with a depth that is nearest to each corner."""
    task, travel = scored.task, scored.task.course.looks[k]
    xy = {int(v): p for v, p in zip(snapshot.vertices.ids, snapshot.vertices.xy_px, strict=True)}
    depths = report.vertices
    known = np.isfinite(depths.xyz_cm[:, 2])
    seen_at = np.array([xy[int(v)] for v in depths.ids[known]]).reshape(-1, 2)
    now = truth.corners_cm()
    for name, corner in scored.first.corners_cm().items():
        away = np.hypot(*(seen_at - pixel_of(now[name], lens)).T)
        found = sigma = place = growth = None
        if len(away) and away.min() < NEAR_PX:
            row = int(np.flatnonzero(known)[away.argmin()])
            xyz = back[0] @ depths.xyz_cm[row] + back[1]
            found, sigma, place = float(xyz[2]), float(depths.sigma_cm[row]), as_printed(xyz)
            offset = seen_at[away.argmin()] - (lens.cx, lens.cy)
            growth = float(np.hypot(*offset)) / found * travel  # Eq. 13 in both coordinates
        yield Finding(
            *common, "vertex", name, travel, "first", float(corner[2]), found, sigma,
            true_place_cm=as_printed(corner), place_cm=place, growth=growth, setting=task.setting,
        )  # fmt: skip


def camera_of(report: DepthReport, odometry: Pose) -> Pose:
    """Where the estimator thinks the camera was: odometry's pose, corrected where it solved for that."""
    return odometry if report.motion is None else report.motion.camera


def _answer(depth: RegionDepth, method: str) -> tuple[float, float] | None:
    if method == "fused":
        return None if depth.depth_cm is None or depth.sigma_cm is None else (depth.depth_cm, depth.sigma_cm)
    found = depth.estimates.get(method)
    return None if found is None else (found.depth_cm, found.sigma_cm)


def _carried(shown: Shown, depth_cm: float, lens: Lens, at: At, turn: np.ndarray, shift: np.ndarray) -> float:
    """A region's depth at the camera asked for, by the ray through the middle of its pixels."""
    if at == "last":
        return depth_cm
    ray = np.append(lens.to_rays(shown.middle_px[None])[0], 1.0)
    return float((turn @ (depth_cm * ray) + shift)[2])


def region_pulls(course: str, truth: FrameTruth, snapshot: Snapshot, report: DepthReport) -> Iterator[Pull]:
    """Every region's depth by every method against the mean depth of its own pixels."""
    for shown in truth.shown(snapshot):
        for method in METHODS:
            answer = _answer(report.regions[shown.region.id], method)
            if answer is not None:
                yield Pull(course, method, (answer[0] - shown.depth_cm) / answer[1])


def corner_pulls(findings: list[Finding], course: Course) -> Iterator[Pull]:
    for f in findings:
        if f.place_cm and f.sigma_cm and f.odometry == "exact" and f.travel_cm == course.travel_cm:
            yield Pull(course.name, "corner", ((f.found_cm or np.nan) - f.true_cm) / f.sigma_cm)
