"""OpenCV's own V4L2 code and ours against a camera that answers as the kernel would."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import uuid
from itertools import pairwise
from pathlib import Path

import cv2
import pytest
from pictures import image

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).parent
HEADER = Path("/usr/include/linux/videodev2.h")
pytestmark = pytest.mark.skipif(
    not (HEADER.exists() and shutil.which("cc")), reason="needs cc and the kernel's headers"
)


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict:
    """What a program saw that knows nothing of the fake."""
    folder = tmp_path_factory.mktemp("camera")
    library = folder / "fake_v4l2.so"
    compiler = ["cc", "-shared", "-fPIC", "-Wall", "-Werror"]
    subprocess.run([*compiler, "-o", library, HERE / "fake_v4l2.c", "-ldl"], check=True)
    scene = image(1, 640, 480)
    for number in range(40):
        cv2.imwrite(str(folder / f"{number}.jpg"), scene)
        scene[number, number] = 0  # no two are the same
    device = Path(f"/dev/shm/camera-{uuid.uuid4().hex}")
    device.touch()
    try:
        done = subprocess.run(
            [sys.executable, HERE / "drive_fake_v4l2.py", device, folder],
            capture_output=True, text=True, timeout=120, check=False,
            env={
                **os.environ, "PYTHONPATH": str(ROOT), "LD_PRELOAD": str(library),
                "FAKE_CAMERA": str(device), "FAKE_PICTURES": str(folder),
            },
        )  # fmt: skip
    finally:
        device.unlink()
    assert done.returncode == 0, done.stderr
    return {"device": str(device)} | json.loads(done.stdout)


def test_the_jpegs_come_byte_for_byte_as_the_camera_made_them(seen):
    assert None not in seen["numbers"]
    assert all(0 < (b - a) % 40 < 20 for a, b in pairwise(seen["numbers"]))
    assert seen["shapes"] == [[480, 640, 3]]
    assert seen["damaged"] == 0


def test_the_times_are_the_drivers(seen):
    """It stamps 40 ms before it hands over; a picture is read at once, but for a busy machine."""
    assert 0.04 <= min(seen["ages_s"]) < 0.075


def test_what_is_automatic_is_off(seen):
    controls = seen["controls"]
    assert controls.pop("exposure_time_absolute") == 157
    assert controls == {
        "auto_exposure": 1, "exposure_dynamic_framerate": 0, "white_balance_automatic": 0,
        "white_balance_temperature": 4600, "focus_automatic_continuous": 0, "focus_absolute": 0,
    }  # fmt: skip


def test_its_name_and_what_it_offers_are_known(seen):
    assert seen["name"] == "Fake Camera"
    assert seen["modes"] == [
        f"{code} {size} at 30" for code in ("YUYV", "MJPG") for size in ("640x480", "320x240")
    ]


def test_one_that_hangs_is_let_go_of_after_a_second_and_one_that_is_unplugged_sought(seen):
    assert seen["silent_s"] < 0.5
    assert 0.5 < seen["hung_s"] < 3.0
    assert seen["told"].count(f"camera {seen['device']}: delivers again") == 1


def test_another_size_and_rate_than_asked_for_are_told(seen):
    first, *others = [text for text in seen["told"] if "delivers again" not in text]
    assert "gives 640x480 px, not 800x600 and 30 pictures a second, not 60; it offers MJPG" in first
    assert others == [first]  # when it was opened again
