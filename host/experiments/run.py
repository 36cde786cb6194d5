"""One drive through one scene: pictures to the paper's pipeline and to ours, then depths beside the truth."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from host.depth.estimator import Estimator
from host.depth.report import DepthReport
from host.experiments.course import Course, Drive, drive
from host.experiments.findings import RunResult, Still, Times, Turn
from host.experiments.paper_mode import PaperPipeline, PolygonNet
from host.experiments.score_ours import camera_of, corner_pulls, region_pulls, score_ours
from host.experiments.score_paper import score_exact_areas, score_paper
from host.experiments.task import Scored, Task
from host.experiments.truth import FrameTruth
from host.rbdn import Net
from host.sim.render import Renderer, Webcam


def run_task(task: Task) -> RunResult:
    """Render, track, estimate and score; neither pipeline is ever told any truth."""
    course, world = task.course, task.scene()
    lens = world.lens
    renderer, webcam = Renderer(world), Webcam(task.model, lens, task.seed)
    driven = drive(course, task.seed)
    scored = Scored(task, driven, FrameTruth(renderer, driven.true[0]))
    result = RunResult()
    paper, net = PaperPipeline(), Net(task.net, lens)
    estimators = {odometry: Estimator(lens, task.depth) for odometry in driven.odometry}
    clock = _Clock()
    start: PolygonNet | None = None
    before: DepthReport | None = None
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
        elif k in course.looks and start is not None and before is not None:
            truth = FrameTruth(renderer, true_pose)
            straight = FrameTruth(renderer, driven.odometry["exact"][k])
            result.findings.extend(score_exact_areas(scored, straight, k))
            now = paper.polygons(paper_snapshot)
            for odometry, report in reports.items():
                result.findings.extend(score_paper(scored, start, now, odometry, k, lens))
                result.findings.extend(score_ours(scored, truth, snapshot, report, odometry, k, lens))
            result.turns.append(_turn(task, before, reports["exact"], driven, k))
            if k == course.frames - 1:
                result.pulls.extend(region_pulls(task.course.name, truth, snapshot, reports["exact"]))
                result.pulls.extend(corner_pulls(result.findings, course))
        before = reports["exact"]
        if task.keep_stills and (k == 0 or k in course.looks):
            travel = course.looks.get(k, 0.0)
            result.stills.append(Still(travel, image, snapshot, reports["exact"]))
    result.times.extend(clock.times(course))
    return result


def _turn(task: Task, before: DepthReport, report: DepthReport, driven: Drive, k: int) -> Turn:
    """Angle between the true camera and odometry's, and between it and the solved one."""
    true, odometry = driven.true[k], driven.odometry["exact"][k]
    solved, solved_before = (
        camera_of(r, driven.odometry["exact"][j]) for r, j in ((report, k), (before, k - 1))
    )
    step, solved_step = (
        true.rotation.T @ driven.true[k - 1].rotation,
        solved.rotation.T @ solved_before.rotation,
    )
    return Turn(
        task.course.name,
        task.seed,
        _angle_rad(true.rotation, odometry.rotation),
        _angle_rad(true.rotation, solved.rotation),
        _angle_rad(step, solved_step),
    )


def _angle_rad(a: np.ndarray, b: np.ndarray) -> float:
    turned = a.T @ b
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
