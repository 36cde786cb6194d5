"""`python -m host.measure`: the results file as agreed, and one line for whatever is wrong."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent / "record"))
from broken_sequences import FAULTS

from host import measure
from host.depth.report import DepthReport, Estimate, RegionDepth, VertexDepths
from host.errors import InputError, run_command
from host.measure import measure_sequence, result_dict
from host.pose import Pose
from host.rbdn.snapshot import Contour, Region, Snapshot, Vertices
from host.record.sequence import read_sequence

ROOT = Path(__file__).parent.parent


class FakeNet:
    """One region over the middle; remembers what it was told."""

    def __init__(self) -> None:
        self.rotations: list[np.ndarray | None] = []

    def track(self, image: np.ndarray, rotation: np.ndarray | None = None) -> Snapshot:
        self.rotations.append(rotation)
        square = np.array([[10.0, 10], [30, 10], [30, 30], [10, 30]])
        ids = np.arange(4)
        region = Region(
            7, None, 0, 400.0, 1.0, False, (1.0, 2.0, 3.0), (square,), (ids,), (np.zeros(4, np.int64),)
        )
        empty = np.zeros(0)
        return Snapshot(
            seq=len(self.rotations) - 1,
            regions=(region, replace(region, id=8, parent=7)),
            vertices=Vertices(ids, square, np.full(4, 0.1)),
            contour=Contour(np.zeros((0, 2)), np.zeros((0, 2)), empty, empty, empty, empty),
            events=(),
            cycles=3,
            net_ms=1.5,
            refine_ms=0.5,
            limits=("polygons merged further, to keep to 3",),
        )


class FakeEstimator:
    """Region 7 has a depth, region 8 a reason; vertices are told in another order and one has no depth."""

    def __init__(self) -> None:
        self.poses: list[Pose] = []

    def update(self, snapshot: Snapshot, pose: Pose) -> DepthReport:
        self.poses.append(pose)
        xyz = np.array([[3.0, 30, 300], [np.nan] * 3, [1, 10, 100], [0, 0, 50]])
        return DepthReport(
            regions={
                7: RegionDepth(80.0, 0.5, "area", None, {"area": Estimate(80.0, 0.5)}),
                8: RegionDepth(None, None, None, "too little motion"),
            },
            vertices=VertexDepths(np.array([3, 2, 1, 0]), xyz, np.array([3.0, np.nan, 1.0, 0.5])),
        )


def command(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """Run the command in this process as the shell would; its exit code."""
    monkeypatch.setattr(sys, "argv", ["measure", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        run_command(measure.main)
    return int(stop.value.code or 0)


def test_each_frame_is_told_the_rotation_since_the_one_before(sequence_folder: Path):
    text = (sequence_folder / "poses.csv").read_text()
    c, s = np.cos(0.05), np.sin(0.05)  # half of a turn by 0.1 rad
    (sequence_folder / "poses.csv").write_text(text.replace("4.0,1,0,0,0", f"4.0,{c},0,{s},0"))
    sequence, net, estimator = read_sequence(sequence_folder), FakeNet(), FakeEstimator()
    list(measure_sequence(sequence, net, estimator))
    first, second, third, fourth = net.rotations
    assert first is None
    assert second == pytest.approx(np.eye(3))
    assert third == pytest.approx(Pose.planar(0, 0, 0.1).rotation)
    assert fourth == pytest.approx(Pose.planar(0, 0, -0.1).rotation)
    assert estimator.poses == [frame.pose for frame in sequence.frames]


def test_the_results_have_every_key_of_the_contract_and_null_where_nothing_is_known(sequence_folder: Path):
    sequence = read_sequence(sequence_folder)
    frames = [frame.as_dict() for frame in measure_sequence(sequence, FakeNet(), FakeEstimator())]
    result = json.loads(json.dumps(result_dict(sequence, frames), allow_nan=False))
    assert result["sequence"] == "run"
    assert result["camera"] == json.loads((sequence_folder / "camera.json").read_text())
    frame = result["frames"][3]
    assert (frame["frame"], frame["t_s"]) == (3, 0.3)
    times = frame["time_ms"]
    assert (times["net"], times["refine"]) == (1.5, 0.5)
    assert 0 <= times["depth"] <= times["total"]
    assert frame["limits"] == ["polygons merged further, to keep to 3"]
    known, unknown = frame["regions"]
    assert known == {
        "id": 7,
        "parent": None,
        "area_px": 400.0,
        "touches_border": False,
        "mean_rgb": [1.0, 2.0, 3.0],
        "loops": [[[10, 10], [30, 10], [30, 30], [10, 30]]],
        "depth_cm": 80.0,
        "sigma_cm": 0.5,
        "method": "area",
        "estimates": {"area": {"depth_cm": 80.0, "sigma_cm": 0.5}},
    }
    assert unknown["parent"] == 7
    assert [unknown[key] for key in ("depth_cm", "sigma_cm", "method")] == [None, None, None]
    assert unknown["method_note"] == "too little motion"
    assert frame["vertices"][1] == {
        "id": 1, "x_px": 30, "y_px": 10, "X_cm": 1, "Y_cm": 10, "Z_cm": 100, "sigma_cm": 1
    }  # fmt: skip
    assert [frame["vertices"][2][key] for key in ("X_cm", "Y_cm", "Z_cm", "sigma_cm")] == [None] * 4


def test_what_only_some_regions_have_is_told_of_those_alone():
    region = FakeNet().track(np.zeros((1, 1, 3), np.uint8)).regions[0]
    nothing = VertexDepths(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0))

    def told(depth: RegionDepth) -> dict:
        return measure._region_dict(region, DepthReport({region.id: depth}, nothing))

    plain = RegionDepth(80.0, 0.5, "area", None, {"area": Estimate(80.0, 0.5)})
    more = replace(
        plain,
        estimates={"area": Estimate(80.0, 0.5, sensitivity=42.0)},
        silhouette_cm=81.5,
        slope=(1e-5, -2e-5),
        moving=True,
    )
    assert told(more) == told(plain) | {
        "estimates": {"area": {"depth_cm": 80.0, "sigma_cm": 0.5, "sensitivity": 42.0}},
        "silhouette_cm": 81.5,
        "slope": [1e-5, -2e-5],
        "moving": True,
    }


def test_a_vertex_tells_its_sensitivity_where_it_has_one():
    snapshot = FakeNet().track(np.zeros((1, 1, 3), np.uint8))
    depths = FakeEstimator().update(snapshot, Pose.planar(0, 0, 0))
    moves = np.array([0.3, np.nan, 0.1, 0.0])
    with_moves = replace(depths, vertices=replace(depths.vertices, sensitivity=moves))
    told = [vertex.get("sensitivity") for vertex in measure._vertex_dicts(snapshot, with_moves)]
    assert told == [0.0, 0.1, None, 0.3]
    assert not any("sensitivity" in vertex for vertex in measure._vertex_dicts(snapshot, depths))


def test_a_single_frame_is_too_few(sequence_folder: Path):
    sequence = read_sequence(sequence_folder)
    with pytest.raises(InputError, match="only 1 frame"):
        next(measure_sequence(replace(sequence, frames=sequence.frames[:1]), FakeNet(), FakeEstimator()))


def test_the_command_measures_a_growing_square(sequence_folder: Path, tmp_path: Path):
    out, pictures = tmp_path / "new" / "out.json", tmp_path / "pictures"
    done = subprocess.run(
        [sys.executable, "-m", "host.measure", sequence_folder, "--json", out, "--pictures", pictures],
        cwd=ROOT, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    result = json.loads(out.read_text())
    regions = result["frames"][3]["regions"]
    square = min(regions, key=lambda region: region["area_px"])
    assert square["mean_rgb"] == pytest.approx([200, 50, 50], abs=8)
    assert square["depth_cm"] == pytest.approx(54, rel=0.1)  # in cm, not metres; how well is for the scorers
    assert f"{square['depth_cm']:.1f}" in done.stdout
    names = {f"{k:06d}{kind}.png" for k in range(4) for kind in ("", "_depth")} | {"vertices.png"}
    assert {p.name for p in pictures.iterdir()} == names
    assert cv2.imread(str(pictures / "000003.png")).shape[1] == 960


def test_the_error_is_drawn_only_where_the_sequence_brings_its_truth(
    sequence_folder: Path, tmp_path, monkeypatch
):
    def width() -> int:
        assert command(monkeypatch, sequence_folder, "--pictures", tmp_path / "pictures") == 0
        return cv2.imread(str(tmp_path / "pictures" / "000003_depth.png")).shape[1]

    without = width()
    (sequence_folder / "truth").mkdir()
    np.savez(sequence_folder / "truth" / "depth.npz", depth=np.full((4, 72, 96), 60.0))
    assert width() == pytest.approx(1.5 * without, rel=0.02)


@pytest.mark.parametrize(
    "depth", [np.full((4, 72, 90), 60.0), np.full((3, 72, 96), 60.0), np.full(4, 60.0), None]
)
def test_a_truth_that_does_not_fit_is_named_before_anything_is_written(
    depth, sequence_folder: Path, tmp_path: Path, monkeypatch, capfd
):
    path = sequence_folder / "truth" / "depth.npz"
    path.parent.mkdir()
    if depth is None:
        path.write_bytes(b"no archive")
    else:
        np.savez(path, depth=depth)
    assert command(monkeypatch, sequence_folder, "--pictures", tmp_path / "pictures") == 3
    said = capfd.readouterr()
    assert said.err.startswith(f"error: {path}: ") and said.err.count("\n") == 1
    assert not (tmp_path / "pictures").exists()
    assert command(monkeypatch, sequence_folder, "--json", tmp_path / "out.json") == 0, (
        "only pictures read it"
    )


def test_running_twice_gives_the_same_answers(sequence_folder: Path, tmp_path: Path, monkeypatch):
    results = []
    for name in ("a.json", "b.json"):
        assert command(monkeypatch, sequence_folder, "--json", tmp_path / name) == 0
        frames = json.loads((tmp_path / name).read_text())["frames"]
        results.append([{key: f[key] for key in ("frame", "regions", "vertices")} for f in frames])
    assert results[0] == results[1]


@pytest.mark.parametrize("name", FAULTS)
def test_a_broken_sequence_gets_one_line_and_leaves_earlier_results(
    name: str, sequence_folder: Path, tmp_path: Path, monkeypatch, capfd
):
    out, pictures = tmp_path / "out.json", tmp_path / "pictures"
    out.write_text("earlier result")
    pictures.mkdir()
    (pictures / "000000.png").write_text("earlier picture")
    FAULTS[name].apply(sequence_folder)
    capfd.readouterr()
    code = command(monkeypatch, sequence_folder, "--json", out, "--pictures", pictures)
    said = capfd.readouterr()
    assert code == 3
    assert said.out == ""
    assert said.err.startswith("error: ")
    assert said.err.count("\n") == 1
    for word in FAULTS[name].words:
        assert word in said.err
    assert out.read_text() == "earlier result"
    assert [(p.name, p.read_text()) for p in pictures.iterdir()] == [("000000.png", "earlier picture")]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out.json", "pictures", "run"]


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ([], 2, ["nothing to measure", "--still"]),
        (["nowhere"], 3, ["nowhere", "no such folder"]),
        (["run/camera.json"], 3, ["camera.json", "not a sequence folder"]),
        (["run", "--poses", "other.csv"], 3, ["other.csv", "no such file"]),
        (["run", "--poses", "poses.csv"], 3, ["did you mean run/poses.csv"]),
        (["run", "--poses"], 2, ["--poses"]),
        (["run", "--jsn", "x"], 2, ["--jsn", "did you mean --json"]),
        (["run", "more"], 2, ["more"]),
        (["run", "--json", "run"], 2, ["run", "is a folder"]),
        (["run", "--json", "run/poses.csv/x"], 2, ["run/poses.csv", "is a file"]),
        (["run", "--json", "run/camera.json"], 2, ["run/camera.json", "belongs to the sequence"]),
        (["run", "--json", "run/frames/../poses.csv"], 2, ["poses.csv", "belongs to the sequence"]),
        (["run", "--json", "x" * 300], 2, ["x" * 300, "too long"]),
        (["x" * 300], 3, ["x" * 300, "no such folder"]),
        (["run", "--poses", "x" * 300], 3, ["x" * 300, "too long"]),
        (["run", "--config", "x" * 300], 2, ["x" * 300, "too long"]),
        (["run", "--pictures", "run/poses.csv"], 2, ["run/poses.csv", "is a file"]),
        (["run", "--net.merge-distance", "much"], 2, ["--net.merge-distance", "much"]),
        (["run", "--net.merge-distance", "-5"], 2, ["merge_distance", "-5"]),
        (["run", "--net.merge-distence", "5"], 2, ["did you mean --net.merge-distance"]),
        (["run", "--config", "no.toml"], 2, ["no.toml", "no such"]),
    ],
)
def test_a_command_line_that_cannot_be_followed_gets_one_line(
    arguments, code, words, sequence_folder: Path, monkeypatch, capfd
):
    monkeypatch.chdir(sequence_folder.parent)
    before = {p: p.stat().st_mtime_ns for p in sequence_folder.parent.rglob("*")}
    assert command(monkeypatch, *arguments) == code
    said = capfd.readouterr()
    assert said.out == ""
    assert said.err.startswith("error: ")
    assert said.err.count("\n") == 1
    for word in words:
        assert word in said.err
    assert {p: p.stat().st_mtime_ns for p in sequence_folder.parent.rglob("*")} == before


def test_pictures_never_replace_the_images_they_show(sequence_folder: Path, monkeypatch, capfd):
    images = sequence_folder / "frames"
    poses = sequence_folder / "poses.csv"
    for k, suffix in enumerate(("png", "png", "jpg", "jpg")):
        (images / f"{k:03d}.{suffix}").rename(images / f"{k:06d}.{suffix}")
    poses.write_text(poses.read_text().replace("frames/", "frames/000"))
    before = {p.name: p.read_bytes() for p in images.iterdir()}
    assert command(monkeypatch, sequence_folder, "--pictures", images) == 2
    assert f"{images}: holds the sequence's own images" in capfd.readouterr().err
    assert {p.name: p.read_bytes() for p in images.iterdir()} == before


def test_an_image_too_small_for_the_net_is_named(sequence_folder: Path, monkeypatch, capfd):
    for file in (sequence_folder / "frames").iterdir():
        assert cv2.imwrite(str(file), np.full((20, 24, 3), 128, np.uint8))
    camera = json.loads((sequence_folder / "camera.json").read_text())
    (sequence_folder / "camera.json").write_text(json.dumps(camera | {"width": 24, "height": 20}))
    assert command(monkeypatch, sequence_folder) == 3
    said = capfd.readouterr().err
    assert said.count("\n") == 1
    assert "frames/000.png: image of 24x20 px is too small" in said


def test_ctrl_c_ends_with_130_and_leaves_earlier_results(sequence_folder: Path, tmp_path: Path):
    long_run = ["frame,file,t_s,x_cm,y_cm,z_cm,qw,qx,qy,qz"]
    long_run += [f"{k},frames/{k % 2:03d}.png,{k},0,0,{k % 2},1,0,0,0" for k in range(20000)]
    (sequence_folder / "poses.csv").write_text("\n".join(long_run))
    out = tmp_path / "out.json"
    out.write_text("earlier result")
    process = subprocess.Popen(
        [sys.executable, "-m", "host.measure", sequence_folder, "--json", out],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    time.sleep(3.0)
    assert process.poll() is None
    process.send_signal(signal.SIGINT)
    printed, said = process.communicate(timeout=20)
    assert (process.returncode, said, printed) == (130, "interrupted\n", "")
    assert out.read_text() == "earlier result"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out.json", "run"]


def test_help_explains_each_option_and_setting():
    done = subprocess.run(
        [sys.executable, "-m", "host.measure", "--help"], cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0
    for part in (
        "the sequence folder",
        "--poses PATH",
        "--json PATH",
        "--config PATH",
        "--net.merge-distance",
    ):
        assert part in done.stdout


def test_budgets_that_acted_are_told_below_the_table(sequence_folder: Path, monkeypatch, capfd):
    assert command(monkeypatch, sequence_folder, "--net.max-polygons", 1) == 0
    assert re.search("in [1-4] of 4 frames: polygons merged further, to keep to 1", capfd.readouterr().out)
