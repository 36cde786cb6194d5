"""One drive through one scene: pictures to the paper's pipeline and to ours, then depths beside the truth."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from host.camera.lens import Lens
from host.depth.config import DepthConfig
from host.depth.estimator import Estimator
from host.depth.report import DepthReport, RegionDepth
from host.depth.two_frames import area_depth_cm, area_sensitivity, place_cm, vertex_depth_cm
from host.experiments.course import Course, Drive, drive
from host.experiments.findings import At, Finding, Pull, RunResult, Still, Times, Turn
from host.experiments.paper_mode import PaperPipeline, PolygonNet
from host.experiments.truth import FrameTruth, Shown, pixel_of
from host.pose import Pose
from host.rbdn import Net, NetConfig, Snapshot
from host.sim.render import Renderer, Webcam, WebcamModel
from host.sim.world import World

METHODS = ("area", "outline", "vertex", "fused")
NEAR_PX = 3.0  # a vertex of ours so far from a corner is not that corner
PAPER_NEAR_PX = 8.0  # the paper's polygons are rougher
MOST_SHARE = 0.5  # of an object's pixels that must lie in regions with a depth


@dataclass(frozen=True)
class Task:
    """One run, as a worker process gets it."""

    course: Course
    scene: Callable[[], World]
    seed: int
    model: WebcamModel
    net: NetConfig
    depth: DepthConfig
    setting: float | None = None  # what a sweep varies
    keep_stills: bool = False


@dataclass(frozen=True)
class _Scored:
    """What the findings of one task have in common."""

    task: Task
    drive: Drive
    first: FrameTruth

    def travel_cm(self, k: int, odometry: str = "exact") -> float:
        """From the first frame to frame `k`; exact odometry tells the true one."""
        poses = self.drive.odometry[odometry]
        return float(poses[k].position_cm[2] - poses[0].position_cm[2])


def run_task(task: Task) -> RunResult:
    """Render, track, estimate and score; neither pipeline is ever told any truth."""
    course, world = task.course, task.scene()
    lens = world.lens
    renderer, webcam = Renderer(world), Webcam(task.model, lens, task.seed)
    driven = drive(course, task.seed)
    scored = _Scored(task, driven, FrameTruth(renderer, driven.true[0]))
    result = RunResult()
    paper, net = PaperPipeline(), Net(task.net, lens)
    estimators = {odometry: Estimator(lens, task.depth) for odometry in driven.odometry}
    clock = _Clock()
    start: PolygonNet | None = None
    for k, true_pose in enumerate(driven.true):
        image = webcam.take(renderer.light(true_pose, task.model.psf_px), true_pose.t_s, k)
        with clock("paper"):
            paper_snapshot = paper.track(image)
        with clock("ours"):
            snapshot = net.track(image)
        reports = {}
        for odometry, poses in driven.odometry.items():
            with clock(f"depth {odometry}"):
                reports[odometry] = estimators[odometry].update(snapshot, poses[k])
        if k == 0:
            start = paper.polygons(paper_snapshot)
        elif k in course.looks and start is not None:
            truth = FrameTruth(renderer, true_pose)
            straight = FrameTruth(renderer, driven.odometry["exact"][k])
            result.findings.extend(_exact_areas(scored, straight, k))
            now = paper.polygons(paper_snapshot)
            for odometry, report in reports.items():
                result.findings.extend(_paper(scored, start, now, odometry, k, lens))
                result.findings.extend(_ours(scored, truth, snapshot, report, odometry, k, lens))
            result.turns.append(_turn(task, reports["exact"], driven, k))
            if k == course.frames - 1:
                result.pulls.extend(_pulls(task.course.name, truth, snapshot, reports["exact"]))
                result.pulls.extend(_corner_pulls(result.findings, course))
        if task.keep_stills and (k == 0 or k in course.looks):
            travel = course.looks.get(k, 0.0)
            result.stills.append(Still(travel, image, snapshot, reports["exact"]))
    result.times.extend(clock.times(course))
    return result


# --- The paper's way -------------------------------------------------------------------------------


def _paper(
    scored: _Scored, start: PolygonNet, now: PolygonNet, odometry: str, k: int, lens: Lens
) -> Iterator[Finding]:
    """Eq. 16 on the polygon that showed most of each object, Eq. 10 on its vertices nearest the corners."""
    task, first = scored.task, scored.first
    travel, about = scored.travel_cm(k, odometry), task.course.looks[k]
    common = (task.course.name, task.seed, odometry)
    for thing_id, regions in _by_object(first.shown(start.snapshot)).items():
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
            and np.hypot(*(start.vertices_px[nearest] - seen)) < PAPER_NEAR_PX
        ):
            before, after = (net.vertices_px[nearest] - middle for net in (start, now))
            found = _number(vertex_depth_cm(before[1], after[1], travel))
            growth = abs(float(after[1] - before[1]))
            if found is not None:
                place = _as_printed(place_cm(before[None], [found], lens.fx)[0])
        yield Finding(
            *common, "paper vertex", name, about, "first", float(corner[2]), found,
            true_place_cm=_as_printed(corner), place_cm=place, growth=growth, setting=task.setting,
        )  # fmt: skip


def _exact_areas(scored: _Scored, truth: FrameTruth, k: int) -> Iterator[Finding]:
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


# --- Our way ---------------------------------------------------------------------------------------


def _ours(
    scored: _Scored,
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
    regions = _by_object(truth.shown(snapshot))
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
    scored: _Scored,
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
            found, sigma, place = float(xyz[2]), float(depths.sigma_cm[row]), _as_printed(xyz)
            offset = seen_at[away.argmin()] - (lens.cx, lens.cy)
            growth = float(np.hypot(*offset)) / found * travel  # Eq. 13 in both coordinates
        yield Finding(
            *common, "vertex", name, travel, "first", float(corner[2]), found, sigma,
            true_place_cm=_as_printed(corner), place_cm=place, growth=growth, setting=task.setting,
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


# --- Honesty, turns, times -------------------------------------------------------------------------


def _pulls(course: str, truth: FrameTruth, snapshot: Snapshot, report: DepthReport) -> Iterator[Pull]:
    """Every region's depth by every method against the mean depth of its own pixels."""
    for shown in truth.shown(snapshot):
        for method in METHODS:
            answer = _answer(report.regions[shown.region.id], method)
            if answer is not None:
                yield Pull(course, method, (answer[0] - shown.depth_cm) / answer[1])


def _corner_pulls(findings: list[Finding], course: Course) -> Iterator[Pull]:
    for f in findings:
        if f.place_cm and f.sigma_cm and f.odometry == "exact" and f.travel_cm == course.travel_cm:
            yield Pull(course.name, "corner", ((f.found_cm or np.nan) - f.true_cm) / f.sigma_cm)


def _turn(task: Task, report: DepthReport, driven: Drive, k: int) -> Turn:
    """Angle between the true camera and odometry's, and between it and the solved one."""
    true, odometry = driven.true[k], driven.odometry["exact"][k]
    left = _angle_rad(true, camera_of(report, odometry))
    return Turn(task.course.name, task.seed, _angle_rad(true, odometry), left)


def _angle_rad(a: Pose, b: Pose) -> float:
    turned = a.rotation.T @ b.rotation
    return float(max(abs(turned[0, 2] - turned[2, 0]), abs(turned[1, 2] - turned[2, 1])) / 2)


class _Clock:
    """CPU time of this thread by what it was spent on, a list with one entry a frame."""

    def __init__(self) -> None:
        self._ms: dict[str, list[float]] = {}

    def __call__(self, name: str) -> _Clock:
        self._name = name
        return self

    def __enter__(self) -> None:
        self._start = time.thread_time()

    def __exit__(self, *_: object) -> None:
        self._ms.setdefault(self._name, []).append(1e3 * (time.thread_time() - self._start))

    def times(self, course: Course) -> Iterator[Times]:
        """Of both pipelines."""
        depth = float(np.median(self._ms["depth exact"]))
        for method, depth_ms in (("paper", 0.0), ("ours", depth)):
            ms = self._ms[method]
            yield Times(course.name, method, ms[0], sum(ms[1:]), len(ms), depth_ms)


# --- Small change ----------------------------------------------------------------------------------


def _by_object(shown: list[Shown]) -> dict[int, list[Shown]]:
    out: dict[int, list[Shown]] = {}
    for one in shown:
        out.setdefault(one.object_id, []).append(one)
    return out


def _as_printed(xyz_cm: np.ndarray) -> tuple[float, float, float]:
    """As the paper's tables have places: Y up."""
    x, y, z = xyz_cm
    return float(x), -float(y), float(z)


def _number(value: np.ndarray) -> float | None:
    return float(value) if np.isfinite(value) else None
