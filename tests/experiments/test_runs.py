"""What the runs do: driving, keeping the truth apart, matching, and answering the same for the same seed."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from host.depth.config import DepthConfig
from host.depth.estimator import Estimator
from host.depth.report import DepthReport
from host.experiments import run
from host.experiments.catalogue import EXPERIMENT_1, tasks
from host.experiments.course import COUNT_CM, Course, drive
from host.experiments.findings import RunResult
from host.experiments.run import run_task
from host.experiments.summary import Findings, summary_of
from host.experiments.task import Task
from host.pose import Pose
from host.rbdn import NetConfig, Snapshot
from host.sim.experiment_scenes import experiment_1
from host.sim.render import WebcamModel

SHORT = Course("short", 10.0, 6, 0.0, (10.0,))


def _task(course: Course = SHORT, seed: int = 0) -> Task:
    return Task(course, partial(experiment_1, seed), seed, WebcamModel(), NetConfig(), DepthConfig())


@pytest.fixture(scope="module")
def short_run() -> RunResult:
    return run_task(_task())


def test_the_camera_shakes_by_no_more_than_it_should_and_odometry_does_not_know() -> None:
    driven = drive(EXPERIMENT_1, 3)
    axes = np.array([pose.rotation[:, 2] for pose in driven.true])
    yaw, pitch = np.arctan2(axes[:, 0], axes[:, 2]), np.arcsin(axes[:, 1])
    assert driven.true[0].rotation == pytest.approx(np.eye(3))
    for angle in (yaw, pitch):
        assert 0.8 * EXPERIMENT_1.shake_rad < np.abs(angle).max() <= EXPERIMENT_1.shake_rad
    for poses in driven.odometry.values():
        assert all((pose.rotation == np.eye(3)).all() for pose in poses)
    exact = [pose.position_cm for pose in driven.odometry["exact"]]
    assert np.array(exact) == pytest.approx(np.array([pose.position_cm for pose in driven.true]))


def test_the_encoder_counts_from_a_random_phase_and_says_what_a_count_is_worth() -> None:
    off = []
    for seed in range(50):
        driven = drive(EXPERIMENT_1, seed)
        counted = np.array([pose.position_cm[2] for pose in driven.odometry["encoder"]])
        true = np.array([pose.position_cm[2] for pose in driven.true])
        assert np.all(counted / COUNT_CM % 1 == 0)
        assert counted[0] == 0
        off.append(counted - true)
        assert np.ptp(off[-1]) <= COUNT_CM
    assert np.abs(off).max() < COUNT_CM
    # the difference of two roundings, at the end of the way as well
    assert np.std(np.array(off)[:, -1]) == pytest.approx(COUNT_CM / math.sqrt(6), rel=0.2)
    assert driven.odometry["encoder"][0].sigma_z_cm == pytest.approx(COUNT_CM / math.sqrt(12))


def test_the_estimator_is_given_odometry_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[Pose] = []

    class Listening(Estimator):
        def update(self, snapshot: Snapshot, pose: Pose) -> DepthReport:
            given.append(pose)
            return super().update(snapshot, pose)

    monkeypatch.setattr(run, "Estimator", Listening)
    course = replace(SHORT, shake_rad=math.radians(1), frames=3)
    run_task(_task(course))
    expected = [poses[k] for k in range(3) for poses in drive(course, 0).odometry.values()]
    assert [p.position_cm.tolist() for p in given] == [p.position_cm.tolist() for p in expected]
    assert all((pose.rotation == np.eye(3)).all() for pose in given)


def test_both_ways_find_the_boxes_and_ours_is_nearer(short_run: RunResult) -> None:
    rows = Findings(tuple(short_run.findings)).where(
        odometry="exact", at="first", thing=("red_box", "green_box")
    )
    ours, paper = (rows.where(method=method).summary for method in ("fused", "paper area"))
    assert (ours.found, paper.found) == (2, 2)
    assert ours.largest < 3
    assert ours.largest < paper.largest


def test_true_areas_show_the_limit_of_the_formula(short_run: RunResult) -> None:
    rows = Findings(tuple(short_run.findings)).where(method="exact areas", at="first").rows
    boxes = {row.thing: row for row in rows if row.thing.endswith("box")}
    assert [row.true_cm for row in boxes.values()] == pytest.approx(
        [85.2, 85.3], abs=0.3
    )  # a little of a side
    assert all(abs(row.error) < 4 for row in boxes.values())


def test_corners_are_named_and_placed_as_in_the_papers_table(short_run: RunResult) -> None:
    rows = Findings(tuple(short_run.findings)).where(method="vertex", odometry="exact").rows
    places = {row.thing: row.true_place_cm for row in rows if row.true_place_cm}
    assert places["red_box A"] == pytest.approx((-26.0, 16.25, 85.0), abs=0.01)
    assert places["red_box C"] == pytest.approx((-5.5, -8.7, 85.0), abs=0.01)
    assert places["green_box B"] == pytest.approx((23.5, 15.2, 85.0), abs=0.01)
    found = next(row for row in rows if row.thing == "red_box A")
    assert found.place_cm == pytest.approx((-26.0, 16.25, 85.0), abs=1.5)


def test_depths_of_the_last_frame_are_those_of_the_first_less_the_way(short_run: RunResult) -> None:
    rows = Findings(tuple(short_run.findings)).where(method="fused", odometry="exact", thing="red_box")
    first, last = (rows.where(at=at).rows[0] for at in ("first", "last"))
    way_cm = drive(SHORT, 0).odometry["exact"][-1].position_cm[2]
    assert way_cm != 10.0
    assert first.found_cm == pytest.approx(last.found_cm + way_cm, abs=0.05)  # the solved turn shows


def test_a_run_is_the_same_every_time(short_run: RunResult) -> None:
    again = run_task(_task())
    assert again.findings == short_run.findings
    assert again.pulls == short_run.pulls
    assert run_task(_task(seed=1)).findings != short_run.findings


def test_there_are_as_many_runs_as_asked_for_and_sweeps_take_fewer() -> None:
    many, few = (tasks(seeds, NetConfig(), DepthConfig()) for seeds in (30, 2))
    assert sum(task.course is EXPERIMENT_1 for task in many) == 30
    assert len({task.seed for task in many if task.course.name == "slant"}) == 5
    assert len({task.seed for task in few if task.course.name == "slant"}) == 2


def test_what_was_not_found_counts_as_asked_and_spoils_no_error() -> None:
    s = summary_of([1.0, -3.0, math.nan])
    assert (s.asked, s.found, s.median, s.largest) == (3, 2, 2.0, 3.0)
    assert s.rms == pytest.approx(math.sqrt(5))
    assert math.isnan(summary_of([math.nan]).rms)
