"""Whole drives by the real command: it gets there, and it touches nothing."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("seed", [1, 3])
def test_the_robot_reaches_the_goal_of_a_room_and_touches_nothing(seed: int, tmp_path: Path):
    out = tmp_path / "result.json"
    command = [sys.executable, str(ROOT / "host" / "nav_loop.py"), "--no-view", "--json", str(out)]
    more = ["--camera", f"sim:room?seed={seed}", "--max-time", "120", "--max-wall", "1000"]
    run = subprocess.run(command + more, cwd=tmp_path, capture_output=True, text=True, timeout=1100)
    assert run.returncode == 0, run.stderr
    result = json.loads(out.read_text())
    assert result["outcome"] == "goal", result["reason"]
    assert result["collisions"] == 0
    assert result["min_clearance_cm"] > 0
    assert result["final_pose_error"]["position_cm"] < 5.0


def test_what_goes_by_right_before_the_camera_does_not_turn_the_robots_map(tmp_path: Path):
    out = tmp_path / "result.json"
    command = [sys.executable, str(ROOT / "host" / "nav_loop.py"), "--no-view", "--json", str(out)]
    world = ["--camera", "sim:clutter?seed=32&movers=1&rough=1", "--robot", "sim:?seed=38&rough=1"]
    limits = ["--max-time", "17", "--max-wall", "500"]  # it goes by after 15 s, and fills half of the picture
    run = subprocess.run([*command, *world, *limits], cwd=tmp_path, capture_output=True, timeout=600)
    assert run.returncode == 0, run.stderr
    result = json.loads(out.read_text())
    assert abs(result["final_pose_error"]["heading_deg"]) < 5.0
