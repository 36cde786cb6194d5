"""The main job with parts that run by themselves: a network camera and a robot on a port, in real time."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from host.camera.lens_file import write_lens
from host.sim.session import Simulation

ROOT = Path(__file__).resolve().parents[2]
sys.path += [str(ROOT / "tests/camera"), str(ROOT / "tests/link")]
from mjpeg_server import MjpegServer, serving  # noqa: E402
from plugged_robot import Plug, plugged_in  # noqa: E402

SECONDS = 3.6


@pytest.fixture
def plug(tmp_path: Path):
    with plugged_in(tmp_path / "ttyACM0") as plug:
        yield plug


def nav_loop(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "host.nav_loop", *arguments],
        cwd=folder, capture_output=True, text=True, timeout=120, check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip


def fail(server: MjpegServer, plug: Plug) -> None:
    """A second into the drive the camera is away for a while, then the robot."""
    while server.callers == 0:
        time.sleep(0.01)
    time.sleep(1.5)
    server.fault = "stalls"
    time.sleep(0.6)
    server.fault = None
    time.sleep(0.4)
    plug.put_in(False)
    time.sleep(0.3)
    plug.put_in(True)


def test_camera_and_robot_may_both_be_away_for_a_while(tmp_path: Path, plug: Plug):
    simulation = Simulation("sim:room?seed=3")
    lens, seen = tmp_path / "camera.json", simulation.camera.read(1.0)
    write_lens(lens, simulation.world.lens)
    assert seen is not None

    def picture(number: int) -> bytes:
        noise = np.random.default_rng(number).integers(0, 3, seen.image.shape, np.uint8)
        return cv2.imencode(".jpg", cv2.add(seen.image, noise))[1].tobytes()

    with serving(picture=picture) as server:
        trouble = threading.Thread(target=fail, args=(server, plug))
        trouble.start()
        done = nav_loop(
            tmp_path, "--camera", server.url, "--robot", str(plug.path), "--lens", str(lens),
            "--measure-only", "--max-time", str(SECONDS), "--json", "out.json",
        )  # fmt: skip
        trouble.join()
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads((tmp_path / "out.json").read_text())
    assert result["outcome"] == "timeout", result["reason"]
    reasons = [decision["reason"] for decision in result["decisions"]]
    assert any("no picture for 0.3 s" in reason for reason in reasons), reasons
    assert len(result["reconnections"]) == 1
    assert not result["reconnections"][0]["restarted"]
    assert result["frames"] > 20
    assert "measuring" in reasons[-2], reasons  # it went on
