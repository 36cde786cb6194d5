"""A whole drive of --approach by the real command, with everything simulated that a robot has."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def test_the_robot_stops_the_asked_distance_before_what_is_ahead(tmp_path: Path):
    out = tmp_path / "result.json"
    command = [sys.executable, str(ROOT / "host" / "nav_loop.py"), "--no-view", "--json", str(out)]
    more = ["--camera", "sim:room?seed=1", "--approach", "10", "--max-time", "240"]
    run = subprocess.run(command + more, cwd=tmp_path, capture_output=True, text=True, timeout=280)
    assert run.returncode == 0, run.stderr
    result = json.loads(out.read_text())
    assert result["outcome"] == "approached", result["reason"]
    assert result["collisions"] == 0
    assert result["room_ahead_cm"] == pytest.approx(10.0, abs=3.0)
