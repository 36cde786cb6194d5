"""What a drive leaves: a log that becomes JSON, and folders that never take each other's place."""

from __future__ import annotations

import json

import pytest

from host.errors import UsageError
from host.nav.config import BodyConfig, NavConfig
from host.nav.result import DriveLog, new_run_folder, write_json
from host.pose import Pose


def test_a_log_without_a_single_frame_is_still_json():
    found = json.loads(json.dumps(DriveLog().as_dict(), allow_nan=False))
    assert found["outcome"] == "stopped"
    assert found["final_pose"] is None
    assert found["frame_time_ms"] == {"median": None, "p95": None}


def test_frame_times_and_pose_are_summed_up():
    log = DriveLog(frame_ms=[float(k) for k in range(1, 101)], path=[Pose.planar(3.0, 4.0, 0.1)])
    found = log.as_dict()
    assert found["frame_time_ms"]["median"] == pytest.approx(50.5)
    assert found["frame_time_ms"]["p95"] == pytest.approx(95.05)
    assert found["final_pose"] == {"x_cm": 3.0, "z_cm": 4.0, "heading_deg": 5.73}


def test_two_runs_of_one_second_get_two_folders_and_latest_is_the_second(tmp_path):
    first, second = (new_run_folder(tmp_path / "runs", "20260101-120000") for _ in range(2))
    assert first != second
    assert (tmp_path / "runs" / "latest").resolve() == second.resolve()


def test_a_latest_that_is_no_link_is_left_alone_and_named(tmp_path):
    (tmp_path / "runs" / "latest").mkdir(parents=True)
    (tmp_path / "runs" / "latest" / "mine").write_text("x")
    with pytest.raises(UsageError, match="runs"):
        new_run_folder(tmp_path / "runs", "20260101-120000")
    assert (tmp_path / "runs" / "latest" / "mine").read_text() == "x"


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
