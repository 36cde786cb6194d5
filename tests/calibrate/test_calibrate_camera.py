"""A rendered board gives the lens back that it was seen through; what cannot be a lens is told in a line."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from held_boards import LENS, SMALL, camera, pictures, sightings

from host.calibrate import watch as watching
from host.calibrate.__main__ import main
from host.calibrate.board import Board, Sighting
from host.calibrate.intrinsics import Corners, Solution, solve
from host.calibrate.verdict import LensCalibration, faults
from host.calibrate.views import Coverage
from host.calibrate.watch import Watched, watch
from host.camera.frame import Frame
from host.camera.lens_file import check_camera, read_about, read_lens, write_lens
from host.errors import InputError, UsageError
from host.nav.rig import open_rig
from host.sim.board_views import HeldBoard, good_views, held_at

VIEWS = 21


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pictures as a person would have photographed them."""
    return photographs(tmp_path_factory.mktemp("photographs"), pictures(VIEWS))


def photographs(folder: Path, images: Iterable[np.ndarray]) -> Path:
    folder.mkdir(exist_ok=True)
    for k, image in enumerate(images):
        cv2.imwrite(str(folder / f"{k:02d}.png"), image)
    return folder


@pytest.fixture(scope="module")
def calibrated(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command, run once."""
    out = tmp_path_factory.mktemp("out") / "camera.json"
    assert main(["camera", "--camera", str(folder), "--out", str(out)]) == 0
    return out


def test_focal_lengths_come_to_a_thousandth_and_the_centre_to_half_a_pixel(calibrated: Path) -> None:
    found = read_lens(calibrated)
    assert found.fx == pytest.approx(LENS.fx, rel=1e-3) and found.fy == pytest.approx(LENS.fy, rel=1e-3)
    assert (found.cx, found.cy) == pytest.approx((LENS.cx, LENS.cy), abs=0.5)


def test_the_lens_is_right_where_it_bends_most(calibrated: Path) -> None:
    found = read_lens(calibrated)
    rim = np.array([[20.0, 20.0], [620.0, 30.0], [30.0, 450.0], [600.0, 460.0]])
    off = found.to_pixels(LENS.to_rays(rim)) - rim
    assert np.hypot(*off.T).max() < 0.6


def test_the_errors_are_no_larger_than_the_spread_that_is_told(calibrated: Path) -> None:
    found, told = read_lens(calibrated), read_about(calibrated)["sigma"]
    for name in ("fx", "fy", "cx", "cy"):
        assert abs(getattr(found, name) - getattr(LENS, name)) < 4 * told[name]
    assert 0.02 < told["fx"] < 0.5 and 0.02 < told["cx"] < 0.5


def test_the_file_tells_whose_lens_it_is_and_how_good(calibrated: Path) -> None:
    told = read_about(calibrated)
    assert told["board"]["columns"] == 8 and told["views"] >= 18
    assert 0.02 < told["rms_px"] < 0.1 and told["held_out_px"] < 1.3 * told["rms_px"]
    assert told["calibrated"][:2] == "20" and told["camera_name"] is None
    picture = cv2.imread(str(calibrated.with_suffix(".png")))
    assert picture.shape == (764, 960, 3)


def test_a_bent_board_does_not_pass_and_nothing_is_written(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    straight = list(sightings(VIEWS))

    def bent(board: Board, image: np.ndarray) -> Sighting:
        seen = straight.pop(0)
        x, y = board.corners_mm[seen.ids, :2].T / board.size_mm[0]
        swing = 3.0 * np.sin(9 * x + 5 * y)  # px
        return replace(seen, points=seen.points + np.column_stack([swing, -swing]))

    monkeypatch.setattr(Board, "find", bent)
    out = tmp_path / "camera.json"
    assert main(["camera", "--camera", str(folder), "--out", str(out)]) == 3
    told = capsys.readouterr().out
    assert "Not good enough, nothing written: corners lie" in told and "is the board flat" in told
    assert not out.exists()


# --- Taking views -------------------------------------------------------------------------------


def test_of_a_moving_hand_only_what_is_held_still_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    hand = HeldBoard(SMALL, Board(), [view for view in good_views(8, 7) if view[1] > 0.6][:3])
    monkeypatch.setattr(watching, "open_for_board", lambda *_: hand)
    found = watch("sim:target", Board(), None, lambda cover: cover.done)
    assert len(found.coverage.views) == 3
    assert found.coverage.seen["moving"] >= 10  # all ways between, and the first picture of each stop
    assert found.coverage.seen["same"] >= 3


class _Source:
    """Frames of the same times apart as a camera's."""

    def __init__(self, images: Iterable[np.ndarray]) -> None:
        self.lens = None
        self._frames = [Frame(image, k / 15, k) for k, image in enumerate(images)]

    def read(self, timeout_s: float) -> Frame | None:
        return self._frames.pop(0) if self._frames else None

    def close(self) -> None:
        self._frames = []


def watched(monkeypatch: pytest.MonkeyPatch, images: Iterable[np.ndarray], uri: str = "0") -> Watched:
    monkeypatch.setattr(watching, "open_for_board", lambda *_: _Source(images))
    monkeypatch.setattr(watching, "is_live", lambda uri: False)
    return watch(uri, Board(), None, lambda cover: cover.done)


def test_a_board_that_never_rests_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"in 5 pictures, always moving too fast: hold board and camera"):
        watched(monkeypatch, pictures(VIEWS)[:5])


def test_a_camera_out_of_focus_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    dim = cv2.GaussianBlur(pictures(VIEWS)[0], (0, 0), 3.5)
    with pytest.raises(InputError, match=r"always too blurred: edges are \d\.\d px wide at best and may"):
        watched(monkeypatch, [dim] * 4)


def test_a_board_far_away_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    small = Sighting(np.arange(35), 10 * Board().corners_mm[:, :2] / 30 + 200, 10.0, 1.0)
    monkeypatch.setattr(Board, "find", lambda *_: small)
    with pytest.raises(InputError, match="always too far away: its squares must be at least 12 px wide"):
        watched(monkeypatch, [np.zeros((480, 640, 3), np.uint8)] * 3)


def test_pictures_without_a_board_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    grey = np.full((120, 160, 3), 128, np.uint8)
    with pytest.raises(InputError, match=r"no board seen in 3 pictures; expected 8 x 6 squares of 30 mm"):
        watched(monkeypatch, [grey] * 3)


@pytest.mark.parametrize(
    ("other", "complaint"),
    [
        (Board(dictionary="DICT_5X5_100"), "another board, with markers of DICT_5X5"),
        (Board(columns=9, rows=7, dictionary="DICT_4X4_100"), "another board: marker 30 is there"),
    ],
)
def test_another_board_is_told(monkeypatch: pytest.MonkeyPatch, other: Board, complaint: str) -> None:
    image = np.full((480, 640), 255, np.uint8)
    for x, y, w, h in other.black_mm:
        left, top, right, bottom = (round(2.2 * v) + 10 for v in (x, y, x + w, y + h))
        image[top:bottom, left:right] = 0
    with pytest.raises(InputError) as told:
        watched(monkeypatch, [cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)] * 2)
    assert f"wrong board ({complaint}" in str(told.value) and "see --board" in str(told.value)


def test_pictures_that_change_their_size_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = [np.zeros((120, 160, 3), np.uint8), np.zeros((240, 320, 3), np.uint8)]
    with pytest.raises(InputError, match="pictures of 320x240 px after some of 160x120; keep to one size"):
        watched(monkeypatch, sizes)


def test_a_camera_without_pictures_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="camera 0: no pictures"):
        watched(monkeypatch, [])


def test_too_few_views_are_told_with_what_is_missing(tmp_path: Path) -> None:
    few = photographs(tmp_path / "few", pictures(VIEWS)[:3])
    with pytest.raises(InputError, match=r"too few views: 3, and at least 8 are needed; tilt the board's"):
        main(["camera", "--camera", str(few), "--out", str(tmp_path / "camera.json")])
    assert (tmp_path / "camera.png").exists()  # shows what was covered


def test_views_that_are_all_alike_are_told(tmp_path: Path) -> None:
    alike = photographs(tmp_path / "alike", [pictures(VIEWS)[1]] * 6)
    with pytest.raises(InputError, match=r"all views alike: 5 of 6 pictures show the board as 1 others do"):
        main(["camera", "--camera", str(alike), "--out", str(tmp_path / "camera.json")])


def test_views_without_any_tilt_determine_no_lens() -> None:
    mm = Board().corners_mm
    views = [Corners(mm, 1.5 * mm[:, :2] + (10.0 * k, 5.0 * k)) for k in range(9)]
    with pytest.raises(InputError, match="too alike; tilt the board towards each side in turn"):
        solve(views, 640, 480)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--out", "/proc/no/camera.json"], "/proc/no/camera.json: "),
        (["--camera", "sim:room"], "camera sim:room: nobody holds a board there"),
        (["--camera", "sim:target?sed=1"], "no parameter 'sed'; known are seed, views"),
        (["--camera", "sim:target?seed=x"], "seed must be a whole number"),
    ],
)
def test_a_wrong_command_line_gets_one_line(
    arguments: list[str], complaint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError) as told:
        main(["camera", *arguments])
    assert complaint in str(told.value) and "\n" not in str(told.value)


# --- The verdict --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"rms_px": 0.7}, "corners lie 0.70 px from where the lens puts them, 0.50 are allowed"),
        ({"held_out_px": 0.2}, "views left out of the reckoning lie 0.20 px off, the others 0.05"),
        ({"sigmas": np.array([3.0, 3.0, 0.1, 0.1, 0, 0, 0, 0, 0])}, "focal length is known to 0.5"),
        ({"sigmas": np.array([0.1, 0.1, 2.0, 0.1, 0, 0, 0, 0, 0])}, "centre is known to 2.0 px only, 1.0"),
    ],
)
def test_every_reason_not_to_pass_is_told_in_words(changes: dict, complaint: str) -> None:
    coverage = Coverage(Board(), 640, 480, False)
    for sighting in sightings(VIEWS):
        coverage.add(sighting, 0.0)
    good = Solution(LENS, np.full(9, 0.1), 0.05, 0.05, (), (), ())
    assert faults(coverage, good) == []
    assert complaint in " ".join(faults(coverage, replace(good, **changes)))


def test_a_corner_of_the_picture_that_was_not_covered_is_told() -> None:
    coverage = Coverage(Board(), 640, 480, False)
    for k in range(2):
        coverage.add(
            Board().find(camera().take(*held_at(LENS, Board(), (0.3, 0.3), 0.4, (0.1, k / 2, 0)), k)), 0
        )
    told = faults(coverage, Solution(LENS, np.full(9, 0.1), 0.05, 0.05, (), (), ()))
    assert any("the board was tilted in 0 of 4 ways only: tilt the board's" in line for line in told)
    assert any("65 are needed, fewest at: upper right" in line for line in told), told
    assert isinstance(LensCalibration(Watched(coverage, None), None, told).coverage, Coverage)  # type: ignore[arg-type]


# --- The file -----------------------------------------------------------------------------------


def test_a_lens_of_another_camera_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "camera.json"
    write_lens(file, LENS, {"camera_name": "HD Webcam C270"})
    assert read_lens(file) == LENS
    check_camera(file, "HD Webcam C270")
    check_camera(file, None)
    with pytest.raises(
        InputError, match=r"is the lens of another camera, 'HD Webcam C270', and this one is 'X'"
    ):
        check_camera(file, "X")
    monkeypatch.setattr("host.nav.rig.camera_name", lambda uri: "X")
    with pytest.raises(InputError, match="lens of another camera"), open_rig("0", "auto", file):
        pass
    file.write_text(json.dumps({"width": 3}))
    check_camera(file, "X")  # it does not tell
