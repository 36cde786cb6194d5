"""The report of a drive: what it tells, that it stands alone, and what is left out where it is not known."""

from __future__ import annotations

import re
import time
from typing import Any

import cv2
import numpy as np
import pytest

from host.config import Config
from host.nav.config import NavConfig
from host.view.report import changed_settings, report

TIMES = {"median": 5.0, "p95": 9.0}


def a_result() -> dict[str, Any]:
    """As a short simulated drive leaves it."""
    return {
        "camera": "sim:room?seed=1", "robot": "sim:", "task": "driving to 0,100 cm", "goal_cm": [0.0, 100.0],
        "outcome": "goal", "reason": "goal reached <really>", "duration_s": 2.0, "distance_cm": 98.0,
        "frames": 30, "dropped_frames": 0, "refused_frames": 1, "times_stopped": 1, "times_forgotten": 0,
        "faults_cleared": 0,
        "reconnections": [{"t_s": 1.0, "away_s": 0.5, "restarted": True, "why": "unplugged"}],
        "frame_time_ms": TIMES, "latency_ms": TIMES, "stage_ms": {"net": TIMES}, "began_s": 0.5,
        "trace": {
            "t_s": [0.0, 1.0, 2.0], "x_cm": [None, 1.0, 2.0], "z_cm": [None, 50.0, 98.0],
            "heading_deg": [None, 0.0, 1.0], "v_mm_s": [0.0, 200.0, 0.0], "omega_rad_s": [0.0, 0.1, 0.0],
            "left_mm_s": [0, 190, 0], "right_mm_s": [0, 210, 0], "battery_mv": [7400, 7350, None],
            "damaged": [0, 0, 2], "frame_time_ms": [None, 5.0, 6.0], "latency_ms": [None, 40.0, 41.0],
            "stage_ms": {"net": [None, 2.0, 2.0]},
        },
        "depths_over_time": {"7": {"t_s": [0.5, 1.0], "depth_cm": [90.0, 60.0], "sigma_cm": [2.0, None]}},
        "decisions": [
            {"t_s": 0.0, "v_mm_s": 200.0, "omega_rad_s": 0.0, "reason": "go", "pictures": 9},
            {"t_s": 1.0, "v_mm_s": 0.0, "omega_rad_s": 0.0, "reason": "stop: region 7 <near>", "pictures": 9},
            {"t_s": 1.5, "v_mm_s": 99.0, "omega_rad_s": 0.0, "reason": "go", "pictures": 9},
            {"t_s": 2.0, "v_mm_s": 0.0, "omega_rad_s": 0.0, "reason": "goal: reached", "pictures": 1},
        ],
        "decisions_left_out": 3, "collisions": 0, "run_into": 0, "min_clearance_cm": 12.3,
        "final_pose_error": {"position_cm": 1.5, "heading_deg": 0.2},
        "depth_errors": {"count": 1, "median_percent": 5.0, "p90_percent": 5.0, "things": {}},
        "depths": [{"t_s": 1.5, "region": 7, "background": False, "depth_cm": 63.0, "sigma_cm": 2.0,
                    "true_cm": 60.0, "error_percent": 5.0}],
        "stops": [{"t_s": 1.5, "reason": "stop: region 7 <near>", "true_room_cm": 9.0, "false": False}],
        "true_path": [[0.5, 0.0, 0.0], [1.5, 1.1, 50.0]],
        "link": {"host": {"frames": 100, "crc": 2}, "robot": {"frames": 50, "crc": 0}, "refused_by_robot": 0},
        "floor": {"png": "AA==", "left_cm": -10.0, "near_cm": -10.0, "width_cm": 50.0, "height_cm": 120.0,
                  "things": [{"region": 7, "ends_cm": [[-5.0, 110.0], [5.0, 110.0]], "told": "region 7"}],
                  "robot": {"x_cm": 2.0, "z_cm": 86.0, "heading_deg": 1.0, "radius_cm": 12.0}},
        "pictures": [{"file": "stop_00015.png", "t_s": 1.0, "told": "stop: region 7 <near>"},
                     {"file": "frame_00000.png", "t_s": -0.01, "told": "go"},
                     {"file": "frame_00099.png", "t_s": 9.0, "told": "never written"}],
        "settings": {"nav.speed_cm_s": {"value": 15.0, "default": 20.0}},
        "versions": {"program": "0.1.0", "python": "3.11"},
    }  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    for name in ("stop_00015.png", "frame_00000.png"):
        noise = np.random.default_rng(1).integers(0, 255, (720, 960, 3), np.uint8)
        cv2.imwrite(str(tmp_path / name), cv2.GaussianBlur(noise, None, 3))
    return tmp_path


def test_it_tells_outcome_stops_settings_and_versions_and_escapes_them(folder):
    text = report(a_result(), folder).decode()
    for told in (
        "goal reached &lt;really&gt;", "stop: region 7 &lt;near&gt;", "truly free ahead", "9 cm",
        "nav.speed_cm_s", "unplugged", "and 3 more", "0.1.0", "closest approach *", "12.3 cm",
    ):  # fmt: skip
        assert told in text, told
    assert "<near>" not in text and "<really>" not in text
    titles = re.findall(r'class="title"[^>]*>([^<]*)<', text)
    assert titles == [
        "The way, from above", "Depth", "Error of depth (truth of the simulator)", "Speed", "Latency",
        "Of it, stage by stage", "Battery", "Frames damaged or lost so far, both ways",
    ]  # fmt: skip


def test_it_stands_alone_is_small_and_quickly_made(folder):
    began_s = time.process_time()
    page = report(a_result(), folder)
    assert time.process_time() - began_s < 1.0
    assert len(page) < 500_000
    text = page.decode()
    assert text.count("data:image/jpeg;base64,") == 2  # the third picture was never written
    fetched = re.findall(r'(?:src|href)="(?!data:)[^"]*"|url\(|<link|<script|@import', text)
    assert not fetched, fetched


def test_stops_for_the_same_reason_have_each_its_own_truth(folder):
    result, why = a_result(), "stop: looking again before going on"
    result["decisions"] = [
        {"t_s": t_s, "v_mm_s": v, "omega_rad_s": 0.0, "reason": reason, "pictures": 1}
        for t_s, v, reason in (
            (0.0, 99.0, "go"), (1.0, 0.0, why), (1.2, 99.0, "go"), (3.0, 0.0, why), (3.2, 99.0, "go"),
            (5.0, 0.0, why), (5.5, 99.0, "go"), (6.0, 0.0, "goal: reached"),
        )
    ]  # fmt: skip
    result["stops"] = [
        {"t_s": result["began_s"] + t_s, "reason": why, "true_room_cm": room, "false": False}
        for t_s, room in ((1.0, 21.0), (3.01, 43.0))
    ]
    rows = re.findall(
        r"<tr><td>(\d\.0 s)</td><td>stop: [^<]*</td><td>([^<]*)</td>", report(result, folder).decode()
    )
    assert rows == [("1.0 s", "21 cm"), ("3.0 s", "43 cm"), ("5.0 s", "")]


def test_without_the_simulator_no_truth_is_told(folder):
    result = a_result()
    truths = ("collisions", "run_into", "min_clearance_cm", "final_pose_error", "depth_errors", "depths",
              "stops", "true_path")  # fmt: skip
    text = report(result | dict.fromkeys(truths), folder).decode()
    assert "truth of the simulator" not in text and "*" not in text.split("</style>")[1].split("<h2>")[0]


def test_a_drive_that_saw_nothing_has_a_report_too(tmp_path):
    result = {
        k: v for k, v in a_result().items() if k not in ("trace", "depths", "floor", "pictures", "true_path")
    }
    empty = result | {"decisions": [], "depths_over_time": {}, "outcome": "stopped"}
    text = report(empty, tmp_path).decode()
    assert 'class="verdict faulty"' in text and "None on the way." in text


def test_only_settings_that_were_changed_are_told():
    assert changed_settings(Config()) == {}
    changed = changed_settings(Config(nav=NavConfig(speed_cm_s=15.0)))
    assert changed == {"nav.speed_cm_s": {"value": 15.0, "default": NavConfig().speed_cm_s}}
