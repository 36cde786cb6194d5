"""Height and tilt come out of how the floor flows; settings go into robot.toml without harm to the rest."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from host.calibrate import flow, mount
from host.calibrate.__main__ import main
from host.calibrate.flow import Mount, Shots, shots, solve
from host.calibrate.keep import keep, toml_lines
from host.calibrate.mount import sentences
from host.calibrate.paths import Path as Way
from host.calibrate.ride import Picture, Ride
from host.camera.lens import Lens
from host.config import Config, read_config
from host.errors import InputError, UsageError
from host.nav.config import BodyConfig

LENS = Lens(320, 240, 280.0, 280.0, 159.5, 119.5, (-0.08, 0.02, 0.0, 0.0, 0.0))


def driven(height_cm: float, pitch: float, roll: float, yaw: float, seed: int = 1) -> Shots:
    """Pictures of a floor with a pattern, from a camera that sits like this; ideal but for noise."""
    rng = np.random.default_rng(seed)
    floor = cv2.GaussianBlur(rng.uniform(0, 255, (900, 700)).astype(np.float32), (0, 0), 3.0) * 6 - 630
    x, y = np.meshgrid(np.arange(320.0), np.arange(240.0))
    rays = np.column_stack([LENS.to_rays(np.column_stack([x.ravel(), y.ravel()])), np.ones(x.size)])
    level = rays @ flow._turned(pitch, roll, yaw).T
    far = height_cm / np.maximum(level[:, 1], 1e-3)
    grays, places = [], []
    for ahead in np.arange(2.0, 36.0, 1.2):
        turn = 0.01 * math.sin(ahead / 7)
        right = far * (math.cos(turn) * level[:, 0] + math.sin(turn) * level[:, 2])
        on = ahead + far * (math.cos(turn) * level[:, 2] - math.sin(turn) * level[:, 0])
        u, v = (4 * right + 350).astype(np.float32), (4 * on).astype(np.float32)
        light = cv2.remap(floor, u.reshape(x.shape), v.reshape(x.shape), cv2.INTER_LINEAR, borderValue=128)
        light = cv2.GaussianBlur(light, (0, 0), 0.6) + rng.normal(0, 2, x.shape)
        grays.append(np.clip(light, 0, 255).astype(np.uint8))
        places.append((0.0, ahead, turn))
    return Shots(LENS, grays, np.array(places))


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer pairs and samples than a person would wait for."""
    monkeypatch.setattr(flow, "MOST_PAIRS", 6)
    monkeypatch.setattr(flow, "CM_PER_PX", 0.8)


def test_height_and_tilt_of_a_patterned_floor_are_found(quick: None) -> None:
    truth = (16.4, math.radians(2.3), math.radians(-1.2), math.radians(0.8))
    found = solve(driven(*truth), 15.0)
    assert found.height_cm == pytest.approx(truth[0], rel=0.01)
    for value, true in zip((found.pitch, found.roll, found.yaw), truth[1:], strict=True):
        assert value == pytest.approx(true, abs=math.radians(0.25))
    assert abs(found.height_cm - truth[0]) < 3 * found.sigmas[0] < 0.1 * truth[0]
    assert not found.level


def test_pictures_of_no_one_floor_are_refused(quick: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flow, "LAST_STEP_RAD", 0.01)
    rng = np.random.default_rng(5)
    seen = driven(15.0, 0.0, 0.0, 0.0)
    noise = [rng.integers(0, 255, gray.shape).astype(np.uint8) for gray in seen.grays]
    with pytest.raises(InputError, match=r"the floor is not the same from picture to picture \(correlation"):
        solve(Shots(LENS, noise, seen.places), 15.0)


def test_a_robot_that_does_not_get_on_is_told() -> None:
    t_s = np.linspace(0, 3, 50)
    stuck = Way(t_s, np.minimum(t_s, 1) * 4, np.minimum(t_s, 1) * 4)
    pictures = [Picture(float(t), np.zeros((240, 320), np.uint8), 1) for t in t_s]
    with pytest.raises(InputError, match=r"the robot came 2 cm ahead only: do its wheels turn"):
        shots(Ride(LENS, pictures, stuck), BodyConfig())


def test_pictures_are_taken_a_little_apart_and_not_at_the_ends() -> None:
    t_s = np.linspace(0, 5, 120)
    way = Way(t_s, 20 * t_s, 20 * t_s)
    seen = shots(
        Ride(LENS, [Picture(float(t), np.zeros((2, 2), np.uint8), 1) for t in t_s], way), BodyConfig()
    )
    ahead = seen.places[:, 1]
    assert np.diff(ahead).min() >= flow.STEP_CM and ahead[0] > flow.END_CM and ahead[-1] < 50 - flow.END_CM


def test_what_was_found_is_told_in_plain_words() -> None:
    tilted = Mount(16.0, 0.05, -0.02, 0.01, (0.2, 0.003, 0.004, 0.003), 0.9)
    told = "\n".join(sentences(tilted, Config()))
    assert "16.00 ± 0.20 cm above the floor (set now: 15)" in told
    assert "2.86 degrees down" in told and "0.57 degrees right of" in told and "1.15 degrees left" in told
    assert "takes the camera to be level" in told
    level = Mount(15.0, 0.001, 0.0, 0.0, (0.2, 0.003, 0.004, 0.003), 0.9)
    assert "takes the camera to be level" not in "\n".join(sentences(level, Config()))


@pytest.mark.parametrize(("roll", "sigma", "told"), [(0.0128, 0.0072, False), (0.0128, 0.004, True)])
def test_nobody_is_told_to_turn_a_camera_by_less_than_is_known(roll: float, sigma: float, told: bool) -> None:
    found = Mount(15.0, 0.001, roll, 0.0, (0.2, 0.003, sigma, 0.003), 0.9)
    assert ("turn it by these angles" in "\n".join(sentences(found, Config()))) == told


@pytest.mark.parametrize("command", ["mount", "delay"])
def test_what_cannot_be_kept_is_told_before_the_robot_drives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.toml").mkdir()
    monkeypatch.setattr("host.nav.rig.open_rig", lambda *_, **__: pytest.fail("it was driven"))
    with pytest.raises(UsageError, match=r"robot\.toml: is a folder"):
        main([command, "--save"])


@pytest.mark.parametrize(
    ("found", "complaint"),
    [
        (
            Mount(20.4, -0.05, 0.0, 0.0, (0.5, 0.004, 0.004, 0.003), 0.9),
            "20.4 cm is far from the 15 that are set",
        ),
        (
            Mount(15.5, 0.0, 0.0, 0.0, (0.9, 0.004, 0.004, 0.003), 0.9),
            "that is too little to go by: drive further",
        ),
    ],
)
def test_what_is_not_likely_or_not_sure_is_not_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, found: Mount, complaint: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(mount, "measure", lambda options, config: found)
    with pytest.raises(InputError, match=complaint):
        main(["mount", "--save"])
    assert not (tmp_path / "robot.toml").exists()


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--way-cm", "5"], "--way-cm must be from 20 to 300, not 5"),
        (["--robot", "sim:?nodd=1"], "no option 'nodd'; known are"),
        (["--lens", "camera.json"], "a simulated camera brings its own lens"),
    ],
)
def test_a_wrong_command_line_gets_one_line(arguments: list[str], complaint: str) -> None:
    with pytest.raises(UsageError) as told:
        main(["mount", *arguments])
    assert complaint in str(told.value) and "\n" not in str(told.value)


@pytest.mark.parametrize("command", ["mount", "delay"])
def test_nothing_is_kept_in_another_file_than_the_settings_came_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text("[body]\ntrack_cm = 16.0\n")
    monkeypatch.setattr("host.nav.rig.open_rig", lambda *_, **__: pytest.fail("it was driven"))
    with pytest.raises(UsageError, match=r"--save writes into robot\.toml, not into the file of --config"):
        main([command, "--save", "--config", "mine.toml"])
    assert not (tmp_path / "robot.toml").exists()


# --- robot.toml ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("", "[body]\ncamera_height_cm = 16.4\n"),
        ("[nav]\n", "[nav]\n\n[body]\ncamera_height_cm = 16.4\n"),
        (
            "[body]  # mine\ncamera_height_cm = 15  # lens\n[nav]\n",
            "[body]  # mine\ncamera_height_cm = 16.4  # lens\n[nav]\n",
        ),
        ("[body]\ntrack_cm = 16.0\n", "[body]\ncamera_height_cm = 16.4\ntrack_cm = 16.0\n"),
    ],
)
def test_one_setting_is_changed_and_all_else_stays(tmp_path: Path, before: str, after: str) -> None:
    file = tmp_path / "robot.toml"
    if before:
        file.write_text(before)
    keep({"body": {"camera_height_cm": 16.4}}, file)
    assert file.read_text() == after
    assert read_config(file).body.camera_height_cm == 16.4


def test_the_file_keeps_the_ends_of_its_lines_and_who_may_read_it(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_bytes(b"[body]\r\ncamera_height_cm = 15  # lens\r\n")
    file.chmod(0o640)
    keep({"body": {"camera_height_cm": 16.4}}, file)
    assert file.read_bytes() == b"[body]\r\ncamera_height_cm = 16.4  # lens\r\n"
    assert file.stat().st_mode & 0o777 == 0o640


def test_a_file_that_cannot_be_changed_line_by_line_is_left_alone(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text("body = {camera_height_cm = 15.0}\n")
    with pytest.raises(UsageError, match=r"robot\.toml"):
        keep({"body": {"camera_height_cm": 16.4}}, file)
    assert file.read_text() == "body = {camera_height_cm = 15.0}\n"


def test_settings_are_told_as_lines_of_toml() -> None:
    assert toml_lines({"webcam": {"late_s": 0.01}}) == ["[webcam]", "late_s = 0.01"]
