"""Lens files, parameters and settings that do not belong together; a computer that is too slow."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from host.camera.lens import Lens
from host.camera.lens_file import write_lens
from host.doctor import calibration as checks
from host.doctor import timing
from host.doctor.finding import Outcome
from host.link.parameters import PARAMETERS, Param
from host.nav.config import BodyConfig

LENS = Lens(640, 480, 620.0, 618.0, 322.0, 236.0, (-0.28, 0.08, 0.0, 0.0, 0.0))
FLASHED = {param: known.default for param, known in PARAMETERS.items()}


def test_a_lens_for_these_pictures_is_well(tmp_path: Path):
    write_lens(tmp_path / "camera.json", LENS)
    found, lens = checks.check_lens_file(tmp_path / "camera.json", (640, 480))
    assert found.outcome == Outcome.OK and lens == LENS
    assert "59 degrees" in found.told


def test_a_missing_or_damaged_lens_file_is_told(tmp_path: Path):
    found, lens = checks.check_lens_file(tmp_path / "camera.json", (640, 480))
    assert found.outcome == Outcome.FAIL and lens is None and "no such file" in found.told
    (tmp_path / "camera.json").write_text("{")
    found, _ = checks.check_lens_file(tmp_path / "camera.json", (640, 480))
    assert "not valid JSON" in found.told and found.fix


def test_the_lens_of_another_camera_is_told(tmp_path: Path):
    write_lens(tmp_path / "camera.json", LENS)
    values = json.loads((tmp_path / "camera.json").read_text())
    (tmp_path / "camera.json").write_text(json.dumps(values | {"camera_name": "Webcam C270"}))
    assert checks.check_lens_file(tmp_path / "camera.json", None, "Webcam C270")[0].outcome == Outcome.OK
    found, _ = checks.check_lens_file(tmp_path / "camera.json", None, "Other")
    assert found.outcome == Outcome.FAIL
    assert "another camera, 'Webcam C270'" in found.told and "host.calibrate camera" in found.fix


@pytest.mark.parametrize(
    ("change", "size", "told"),
    [
        ({}, (320, 240), "for 640x480 px, the camera delivers 320x240"),
        ({"fx": 60.0, "fy": 60.0}, (640, 480), "degrees wide is no webcam's"),
        ({"fx": 3000.0, "fy": 3000.0}, (640, 480), "degrees wide is no webcam's"),
        ({"fy": 500.0}, (640, 480), "pixels are square"),
        ({"cx": 100.0}, (640, 480), "far from the picture's"),
        ({"distortion": (-1.5, 0.0, 0.0, 0.0, 0.0)}, (640, 480), "folds"),
        ({"distortion": (0.0, -8.0, 0.0, 0.0, 0.0)}, (640, 480), "folds"),
    ],
)
def test_a_lens_that_cannot_be_or_is_anothers_is_told(change, size, told):
    found = checks.check_lens(replace(LENS, **change), "camera.json", size)
    assert found.outcome == Outcome.FAIL
    assert told in found.told and "host.calibrate camera" in found.fix


def test_wheels_that_nobody_measured_are_told():
    found = checks.check_parameters(FLASHED)
    assert found.outcome == Outcome.WARN
    assert "never measured" in found.told and "host.calibrate wheels" in found.fix
    assert checks.check_parameters(FLASHED | {Param.TRACK_UM: 151_200}).outcome == Outcome.OK


@pytest.mark.parametrize(
    ("values", "told", "fix"),
    [
        (
            {Param.UM_PER_COUNT_LEFT: 5400, Param.UM_PER_COUNT_RIGHT: 5420},
            "cm_per_count = 0.5",
            "cm_per_count = 0.5410",
        ),
        (
            {Param.UM_PER_COUNT_LEFT: 5075, Param.UM_PER_COUNT_RIGHT: 4925},
            "wheel_ratio = 1, the robot has 1.0305",
            "[body]: wheel_ratio = 1.0305",
        ),
        ({Param.TRACK_UM: 162_000}, "track_cm = 15, the robot has 16.20", "[body]: track_cm = 16.20"),
    ],
)
def test_a_robot_toml_that_says_otherwise_than_the_robot_is_told_with_what_to_write(values, told, fix):
    found = checks.check_body(FLASHED | values, BodyConfig())
    assert found.outcome == Outcome.FAIL
    assert told in found.told and fix in found.fix
    assert checks.check_body(FLASHED, BodyConfig()).outcome == Outcome.OK


@pytest.mark.parametrize(
    ("took_ms", "outcome"), [([10.0] * 20, "ok"), ([10.0] * 18 + [64.0] * 2, "warn"), ([80.0] * 20, "FAIL")]
)
def test_a_computer_too_slow_for_its_camera_is_told(took_ms, outcome):
    found = timing.check_frame_time(took_ms, 15.0)
    assert found.outcome == outcome and "a picture every 67 ms" in found.told
    assert outcome == "ok" or "--net.max-ms 40" in found.fix


@pytest.mark.parametrize(("worst_s", "outcome"), [(0.001, "ok"), (0.05, "warn"), (0.3, "FAIL")])
def test_a_computer_that_pauses_is_told(worst_s, outcome):
    now_s, naps = [0.0], []

    def nap(seconds: float) -> None:
        naps.append(seconds)
        now_s[0] += seconds + (worst_s if len(naps) == 70 else 0.0)

    found = timing.check_pauses(timing.measure_pauses(nap, lambda: now_s[0]))
    assert found.outcome == outcome and (outcome == "ok" or "close other programs" in found.fix)


@pytest.mark.parametrize(("spread_ms", "outcome"), [(0.5, "ok"), (8.0, "warn"), (40.0, "FAIL")])
def test_clocks_that_do_not_go_together_are_told(spread_ms, outcome):
    echoes = [(0.1 * k, 0.1 * k + 0.002, 100_000 * k) for k in range(20)]

    def host_time_s(mcu_us: int) -> float:
        return 1e-6 * mcu_us + 0.001 + 0.001 * spread_ms * (1 if mcu_us % 200_000 else -1)

    found = timing.check_clocks(echoes, host_time_s)
    assert found.outcome == outcome and (outcome == "ok" or found.fix)


def test_a_line_that_answers_no_ping_is_told():
    assert timing.check_round_trip([]).outcome == Outcome.FAIL
    assert timing.check_clocks([], lambda _: 0.0).outcome == Outcome.UNTRIED
