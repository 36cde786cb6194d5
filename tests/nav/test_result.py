"""What a drive leaves: a log that becomes JSON, and folders that never take each other's place."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from host.errors import UsageError
from host.nav.config import BodyConfig, NavConfig
from host.nav.histogram import Histogram
from host.nav.result import (
    MOST_DECISIONS,
    MOST_PLACES,
    DriveLog,
    new_run_folder,
    without_times,
    write_json,
)
from host.pose import Pose


def test_a_log_without_a_single_frame_is_still_json():
    found = json.loads(json.dumps(DriveLog().as_dict(), allow_nan=False))
    assert found["outcome"] == "stopped"
    assert found["final_pose"] is None
    assert found["frame_time_ms"] == {"median": None, "p95": None}


def test_frame_times_and_pose_are_summed_up():
    log = DriveLog()
    for ms in range(1, 101):
        log.frame_ms.add(ms)
        log.spent({"net": ms / 10, "map": 0.0})
    log.be_at(Pose.planar(3.0, 4.0, 0.1), Pose.planar(5.0, 4.0, 0.0))
    found = log.as_dict()
    assert found["frame_time_ms"]["median"] == pytest.approx(50, rel=0.01)
    assert found["frame_time_ms"]["p95"] == pytest.approx(95, rel=0.01)
    assert found["stage_ms"]["net"]["median"] == pytest.approx(5, rel=0.01)
    assert found["final_pose"] == {"x_cm": 3.0, "z_cm": 4.0, "heading_deg": 5.73}
    assert found["dead_reckoning"] == {"x_cm": 5.0, "z_cm": 4.0, "heading_deg": 0.0}


def test_percentiles_of_many_times_need_little_memory_and_are_within_half_a_percent():
    times = np.random.default_rng(3).lognormal(1.0, 1.0, 20_000)
    found = Histogram()
    for ms in times:
        found.add(float(ms))
    for percent in (1, 50, 95, 99.9):
        assert found.percentile(percent) == pytest.approx(np.percentile(times, percent), rel=0.007)


def test_a_decision_that_differs_in_numbers_only_is_the_same_one():
    log = DriveLog()
    for k in range(5):
        log.decide(
            k, 200 - k, 0.0, f"slow: region 7 at {50 - k} ±1.{k} cm (outline), {30 - k} cm from the rim"
        )
    log.decide(5, 100.0, 0.0, "slow: region 8 at 45 ±1.4 cm (outline), 25 cm from the rim")
    log.decide(6, 0.0, 0.0, "stop: region 8 at 45 ±1.4 cm (outline), 4 cm from the rim")
    assert [(d.t_s, d.pictures) for d in log.decisions] == [(0, 5), (5, 1), (6, 1)]
    assert log.times_stopped == 1


def test_a_log_of_ten_hours_is_no_larger_than_one_of_one():
    log = DriveLog()
    for k in range(100_000):
        pose = Pose.planar(2.0 * k, 0.0, 0.5 * k)
        log.be_at(pose, pose)
        log.decide(k, 10.0, 0.0, f"reason {'ab'[k % 2]}")
    assert len(log.path) <= MOST_PLACES and len(log.decisions) <= MOST_DECISIONS
    assert log.path[0].position_cm[0] == 0.0
    assert log.path[-1].position_cm[0] > 1.9 * 100_000  # thinned evenly, not cut off
    assert (log.decisions[0].t_s, log.decisions[-1].t_s) == (0, 99_999)
    assert log.decisions_left_out + len(log.decisions) == 100_000


def test_without_its_times_a_result_is_what_the_seed_makes_it():
    log, later = DriveLog(), DriveLog()
    for one, ms in ((log, 3.0), (later, 4.0)):
        one.frame_ms.add(ms)
        one.spent({"net": ms})
    assert log.as_dict() != later.as_dict()
    assert without_times(log.as_dict()) == without_times(later.as_dict())
    assert without_times({"a": [{"stage_ms": 1, "b": 2}]}) == {"a": [{"b": 2}]}


def test_two_runs_of_one_second_get_two_folders_and_latest_is_the_second(tmp_path):
    first, second = (new_run_folder(tmp_path / "runs", "20260101-120000") for _ in range(2))
    assert first != second
    assert (tmp_path / "runs" / "latest").resolve() == second.resolve()


def test_drives_that_end_at_the_same_moment_each_get_a_folder(tmp_path):
    with ThreadPoolExecutor(8) as pool:
        folders = set(pool.map(lambda _: new_run_folder(tmp_path / "runs", "20260101-120000"), range(64)))
    assert len(folders) == 64 and (tmp_path / "runs" / "latest").resolve() in folders
    assert len(list((tmp_path / "runs").iterdir())) == 65


def test_a_latest_that_is_no_link_is_left_alone_and_named(tmp_path):
    (tmp_path / "runs" / "latest").mkdir(parents=True)
    (tmp_path / "runs" / "latest" / "mine").write_text("x")
    with pytest.raises(UsageError, match="runs"):
        new_run_folder(tmp_path / "runs", "20260101-120000")
    assert (tmp_path / "runs" / "latest" / "mine").read_text() == "x"
    assert sorted(p.name for p in (tmp_path / "runs").iterdir()) == ["20260101-120000", "latest"]


def test_a_result_that_is_not_finite_is_never_written(tmp_path):
    path = tmp_path / "out.json"
    path.write_text("before")
    with pytest.raises(ValueError, match="JSON"):
        write_json({"x": float("nan")}, path)
    assert path.read_text() == "before"


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        (BodyConfig, {"track_cm": 0.0}),
        (BodyConfig, {"cm_per_count": -0.5}),
        (NavConfig, {"frame_stale_s": 0.5}),
        (NavConfig, {"creep_cm_s": 30.0}),
        (NavConfig, {"cell_cm": 0.5}),
        (NavConfig, {"speed_cm_s": float("nan")}),
    ],
)
def test_settings_that_make_no_sense_are_refused(kind, values):
    with pytest.raises(ValueError, match=next(iter(values))):
        kind(**values)
