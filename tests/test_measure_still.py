"""`python -m host.measure --still`: a picture and JSON of one image, or one line for whatever is wrong."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from host import measure
from host.errors import run_command

ROOT = Path(__file__).parent.parent


@pytest.fixture
def still(tmp_path: Path) -> Path:
    """A red square of 60 px on grey."""
    image = np.full((120, 160, 3), (200, 195, 190), np.uint8)
    image[30:90, 50:110] = (40, 40, 190)
    path = tmp_path / "square.png"
    assert cv2.imwrite(str(path), image)
    return path


def command(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """Run the command in this process as the shell would; its exit code."""
    monkeypatch.setattr(sys, "argv", ["measure", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        run_command(measure.main)
    return int(stop.value.code or 0)


def test_one_line_makes_a_picture_and_json(still: Path, tmp_path: Path):
    out = tmp_path / "new" / "folder"
    done = subprocess.run(
        [sys.executable, "-m", "host.measure", "--still", still, "--out", out],
        cwd=ROOT, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("2 regions in ")
    assert sorted(p.name for p in out.iterdir()) == ["square_net.json", "square_net.png"]
    result = json.loads((out / "square_net.json").read_text())
    assert (result["image"], result["width"], result["height"], result["limits"]) == (
        "square.png",
        160,
        120,
        [],
    )
    square = min(result["regions"], key=lambda region: region["area_px"])
    wall = max(result["regions"], key=lambda region: region["area_px"])
    assert square["area_px"] == pytest.approx(3600, abs=0.125 * 240)  # no blur tells where an edge lies
    assert 0 < square["sigma_area_px"] < 10
    assert square["mean_rgb"] == pytest.approx([190, 40, 40], abs=3)
    assert (square["touches_border"], wall["touches_border"]) == (False, True)
    assert square["id"] != wall["id"]
    corners = np.array(square["loops"][0])
    assert [*corners.min(axis=0), *corners.max(axis=0)] == pytest.approx([49.5, 29.5, 109.5, 89.5], abs=0.3)
    assert len(wall["loops"]) == 2, "outer loop and the hole"


def test_the_picture_shows_the_regions_in_their_colours(still: Path, tmp_path: Path, monkeypatch):
    assert command(monkeypatch, "--still", still, "--out", tmp_path) == 0
    picture = cv2.imread(str(tmp_path / "square_net.png"))
    assert picture.shape[1] == 960
    image = cv2.resize(cv2.imread(str(still)), None, fx=6, fy=6)
    inside, wall = (slice(380, 520), slice(500, 640)), (slice(20, 120), slice(20, 200))
    tints = [(picture[part].astype(float) - image[part]).mean((0, 1)) for part in (inside, wall)]
    assert all(np.abs(tint).max() > 15 for tint in tints)
    assert np.abs(tints[0] - tints[1]).max() > 15


def test_a_large_photograph_is_shrunk_but_told_in_its_own_pixels(still: Path, tmp_path: Path, monkeypatch):
    large = cv2.resize(cv2.imread(str(still)), None, fx=20, fy=20, interpolation=cv2.INTER_NEAREST)
    assert cv2.imwrite(str(tmp_path / "large.png"), large)
    assert command(monkeypatch, "--still", tmp_path / "large.png", "--out", tmp_path) == 0
    assert cv2.imread(str(tmp_path / "large_net.png")).shape[1] == 1280
    result = json.loads((tmp_path / "large_net.json").read_text())
    assert (result["width"], result["height"], result["shrink"]) == (3200, 2400, 2.5)
    square = min(result["regions"], key=lambda region: region["area_px"])
    assert square["area_px"] == pytest.approx(1200 * 1200, rel=0.01)
    corners = np.array(square["loops"][0])
    assert [*corners.min(axis=0), *corners.max(axis=0)] == pytest.approx(
        [999.5, 599.5, 2199.5, 1799.5], abs=8
    )


def test_results_go_to_runs_unless_told_otherwise(still: Path, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert command(monkeypatch, "--still", still.name) == 0
    assert (tmp_path / "runs" / "square_net.json").is_file()


def test_settings_of_the_net_apply(still: Path, tmp_path: Path, monkeypatch, capfd):
    assert command(monkeypatch, "--still", still, "--out", tmp_path, "--net.max-polygons", 1) == 0
    said = capfd.readouterr().out
    assert said.startswith("1 regions")
    assert "polygons merged further, to keep to 1" in said


def _small(folder: Path) -> Path:
    path = folder / "small.png"
    assert cv2.imwrite(str(path), np.zeros((20, 24, 3), np.uint8))
    return path


def _text(folder: Path) -> Path:
    path = folder / "notes.txt"
    path.write_text("no picture")
    return path


def _cut(folder: Path) -> Path:
    path = folder / "cut.png"
    path.write_bytes((folder / "square.png").read_bytes()[:200])
    return path


FAULTS = {
    "missing": (lambda folder: folder / "gone.png", "gone.png: no such image"),
    "folder": (lambda folder: folder, "is a folder; give an image"),
    "no image": (_text, "notes.txt: neither PNG nor JPEG"),
    "cut short": (_cut, "cut.png: "),
    "too small": (_small, "small.png: image of 24x20 px is too small"),
    "long name": (lambda folder: folder / ("x" * 300), "no such image"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_image_is_named_in_one_line_and_nothing_is_written(fault, still, monkeypatch, capfd):
    make, word = FAULTS[fault]
    path, out = make(still.parent), still.parent / "out"
    assert command(monkeypatch, "--still", path, "--out", out) == 3
    said = capfd.readouterr()
    assert said.out == "" and said.err.startswith("error: ") and said.err.count("\n") == 1
    assert word in said.err
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((), "nothing to measure"),
        (("--still", "square.png", "sequence"), "leave out sequence"),
        (("--still", "square.png", "--json", "x.json"), "leave out x.json"),
        (("sequence", "--out", "x"), "--out is for --still"),
        (("--still", "square.png", "--out", "square.png"), "is a file"),
    ],
)
def test_contradictions_on_the_command_line_are_told_in_one_line(arguments, word, still, monkeypatch, capfd):
    monkeypatch.chdir(still.parent)
    assert command(monkeypatch, *arguments) == 2
    said = capfd.readouterr()
    assert said.out == "" and said.err.startswith("error: ") and said.err.count("\n") == 1
    assert word in said.err


def test_an_odd_name_and_an_odd_shape_get_a_picture_or_one_line(
    still: Path, tmp_path: Path, monkeypatch, capsys
):
    odd = os.fsencode(still.parent) + b"/sq\xffuare.png"
    os.rename(still, odd)
    assert command(monkeypatch, "--still", os.fsdecode(odd), "--out", tmp_path / "out") == 0
    long = tmp_path / "long.png"
    assert cv2.imwrite(str(long), np.zeros((1, 30000, 3), np.uint8))
    assert command(monkeypatch, "--still", long, "--out", tmp_path / "out") == 3
    assert "30000x1 px is too small" in capsys.readouterr().err
