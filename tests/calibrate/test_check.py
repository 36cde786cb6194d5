"""A lens that holds is said to hold; one that was turned, refocused or is another's is found out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import pytest
from held_boards import LENS, pictures

from host.calibrate import mount
from host.calibrate.__main__ import main
from host.calibrate.flow import Mount
from host.camera.lens import Lens
from host.camera.lens_file import write_lens
from host.errors import InputError, UsageError

SIGMAS = (0.3, 0.003, 0.004, 0.003)


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A few pictures of the board."""
    folder = tmp_path_factory.mktemp("views")
    for k, image in enumerate(pictures(21)[:5]):
        cv2.imwrite(str(folder / f"{k}.png"), image)
    return folder


def checked(views: Path, lens: Lens, tmp_path: Path, **about: object) -> int | None:
    file = tmp_path / "camera.json"
    write_lens(file, lens, {"rms_px": 0.05, **about})
    return main(["check", "--camera", str(views), "--lens", str(file)])


def test_the_true_lens_holds(views: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert checked(views, LENS, tmp_path) == 0
    told = capsys.readouterr().out
    assert "The calibration holds." in told and "OFF" not in told and "px from where the lens puts" in told


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        (
            replace(LENS, fx=1.02 * LENS.fx, fy=1.02 * LENS.fy),
            "OFF    focal length across: these views want -",
        ),
        (replace(LENS, cx=LENS.cx + 9), "OFF    centre across: these views want -"),
        (replace(LENS, distortion=(LENS.distortion[0] + 0.1, *LENS.distortion[1:])), "OFF    corners lie"),
    ],
)
def test_a_lens_that_holds_no_more_ends_in_another_exit_code(
    views: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], wrong: Lens, complaint: str
) -> None:
    assert checked(views, wrong, tmp_path) == 3
    told = capsys.readouterr().out
    assert complaint in told
    assert "The calibration holds no more; calibrate anew: python -m host.calibrate camera" in told


def test_a_lens_for_another_size_is_refused(views: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"is for pictures of 320x240 px, camera .* gives 640x480; cal"):
        checked(views, replace(LENS, width=320, height=240), tmp_path)


def test_a_lens_of_another_camera_is_refused(
    views: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("host.camera.source.camera_name", lambda uri: "this one")
    with pytest.raises(InputError, match="lens of another camera, 'that one', and this one is 'this one'"):
        checked(views, LENS, tmp_path, camera_name="that one")


def test_two_views_are_too_few(views: Path, tmp_path: Path) -> None:
    few = tmp_path / "few"
    few.mkdir()
    for name in ("0.png", "1.png"):
        (few / name).write_bytes((views / name).read_bytes())
    with pytest.raises(InputError, match="too few views: 2, and at least 3 are needed"):
        checked(few, LENS, tmp_path)


def test_without_a_lens_file_it_is_said_what_to_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=r"camera\.json: no such file"):
        main(["check", "--camera", "0"])


@pytest.mark.parametrize(
    ("found", "code", "complaint"),
    [
        (Mount(15.2, 0.004, 0.0, -0.003, SIGMAS, 0.9), 0, "The calibration holds."),
        (
            Mount(17.0, 0.0, 0.0, 0.0, SIGMAS, 0.9),
            3,
            "OFF    the floor flows as of 17.0 cm",
        ),
        (
            Mount(15.0, 0.04, 0.0, 0.0, SIGMAS, 0.9),
            3,
            "OFF    the picture opens 2.3 degrees",
        ),
        (
            Mount(15.0, 0.0, 0.0, 0.05, SIGMAS, 0.9),
            3,
            "2.9 degrees aside of where it should",
        ),
    ],
)
def test_a_drive_tells_whether_the_camera_still_sits_as_it_is_set(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    found: Mount,
    code: int,
    complaint: str,
) -> None:
    monkeypatch.setattr(mount, "measure", lambda options, config: found)
    assert main(["check", "--robot", "sim:", "--camera", "sim:room?seed=1"]) == code
    assert complaint in capsys.readouterr().out


def test_a_wrong_command_line_gets_one_line() -> None:
    with pytest.raises(UsageError, match="--views must be from 3 to 50, not 2"):
        main(["check", "--views", "2"])
