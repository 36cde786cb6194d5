"""The main job through its real command line: what it leaves, what it refuses, how Ctrl-C ends it."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import cv2
import pytest

from host.nav.result import without_times

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = [sys.executable, str(ROOT / "host" / "nav_loop.py")]
MODULE = [sys.executable, "-m", "host.nav_loop"]


PATIENCE_S = 600  # a busy machine decides no test
PATIENT = ("--max-wall", str(PATIENCE_S), "--no-view", "--json", "out.json")


def run(
    folder: Path, *arguments: str, command: list[str] = SCRIPT, hash_seed: int = 1
) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    return subprocess.run(
        [*command, *arguments], cwd=folder, capture_output=True, text=True, timeout=PATIENCE_S, check=False,
        env={**os.environ, "PYTHONPATH": path, "PYTHONHASHSEED": str(hash_seed)},
    )  # fmt: skip


@pytest.fixture(scope="module")
def drive(tmp_path_factory) -> tuple[Path, dict]:
    """A short drive in a room: its folder and result."""
    folder = tmp_path_factory.mktemp("drive")
    done = run(folder, "--camera", "sim:room?seed=3", "--max-time", "5", *PATIENT)
    assert done.returncode == 0, done.stderr
    assert "closest approach" in done.stdout
    return folder, json.loads((folder / "out.json").read_text())


def test_the_result_holds_everything_it_promises(drive):
    _, result = drive
    assert result["outcome"] in ("goal", "blocked", "timeout", "stopped")
    assert result["outcome"] == "timeout"  # nobody drives three metres in five seconds
    assert result["duration_s"] == pytest.approx(5.0, abs=0.2)
    assert 5 < result["distance_cm"] < 100
    assert result["collisions"] == result["run_into"] == 0
    assert result["min_clearance_cm"] > 0
    assert set(result["final_pose"]) == {"x_cm", "z_cm", "heading_deg"}
    assert result["final_pose_error"]["position_cm"] < 3
    assert result["frames"] == pytest.approx(75, abs=3)
    assert result["dropped_frames"] == 0
    assert 0 < result["frame_time_ms"]["median"] <= result["frame_time_ms"]["p95"]
    assert result["link"]["host"]["frames"] > 400
    assert result["link"]["host"]["crc"] == 0
    assert result["depth_errors"]["count"] == len(result["depths"]) > 0
    assert all(math.isfinite(d["error_percent"]) for d in result["depths"])
    assert sum(d["pictures"] for d in result["decisions"]) >= result["frames"]
    assert set(result["stage_ms"]) == {"wheels", "watch", "net", "depth", "localise", "map", "steer"}
    assert all(0 < ms["median"] <= ms["p95"] for ms in result["stage_ms"].values())
    assert result["latency_ms"]["median"] < 1.0  # this camera is quick, and thinking takes no simulated time
    assert set(result["dead_reckoning"]) == set(result["final_pose"])
    assert all(d["reason"] and "\n" not in d["reason"] for d in result["decisions"])


def test_the_run_folder_holds_the_same_result_and_pictures_that_open(drive):
    folder, result = drive
    latest = folder / "runs" / "latest"
    assert latest.is_symlink()
    assert json.loads((latest / "result.json").read_text()) == result
    frames = sorted(latest.glob("frame_*.png"))
    assert len(frames) >= 3
    assert cv2.imread(str(frames[-1])).shape[1] == 960
    assert min(cv2.imread(str(latest / "path.png")).shape[:2]) > 300


def test_the_run_folder_holds_a_report_that_stands_alone_with_every_picture(drive):
    folder, result = drive
    latest = folder / "runs" / "latest"
    text = (latest / "report.html").read_text()
    assert len(text) < 2_000_000 and result["reason"] in text and "truth of the simulator" in text
    assert text.count("data:image/jpeg;base64,") == len(result["pictures"]) >= 3
    assert all((latest / picture["file"]).is_file() for picture in result["pictures"])
    assert len(result["true_path"]) >= 8 and result["floor"]["png"] and result["settings"] == {}
    assert result["trace"]["t_s"][-1] == pytest.approx(result["duration_s"], abs=0.3)


def test_the_same_seed_gives_the_same_result_apart_from_times_also_as_a_module(drive, tmp_path):
    _, result = drive
    arguments = ["--camera", "sim:room?seed=3", "--max-time", "5", *PATIENT]
    done = run(tmp_path, *arguments, command=MODULE, hash_seed=2)
    assert done.returncode == 0, done.stderr
    again = json.loads((tmp_path / "out.json").read_text())
    assert without_times(again) == without_times(result)


def test_the_same_seed_gives_the_same_bytes_with_all_models_on(tmp_path):
    arguments = ["--camera", "sim:clutter?seed=5&rough=1", "--robot", "sim:?seed=5&rough=1"]
    texts = []
    for hash_seed in (1, 2):
        done = run(tmp_path, *arguments, "--max-time", "4", *PATIENT, hash_seed=hash_seed)
        assert done.returncode == 0, done.stderr
        texts.append(json.dumps(without_times(json.loads((tmp_path / "out.json").read_text()))))
    assert texts[0] == texts[1]


def test_a_goal_with_a_minus_is_a_goal_and_no_option(tmp_path):
    done = run(tmp_path, "--goal", "-30,150", "--max-time", "0.2", "--json", "out.json", "--no-view")
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "out.json").read_text())["goal_cm"] == [-30, 150]


@pytest.mark.parametrize(
    ("arguments", "task", "goal"),
    [
        (["--goal", "-30,150", "-10.5,200"], "driving to -30,150 cm then -10,200 cm", [-10.5, 200]),
        (["--goal", "3e1,150", "-1e1,2E+2"], "driving to 30,150 cm then -10,200 cm", [-10, 200]),
        (["--goal", "-30,150", "--goal=-10,200"], "driving to -30,150 cm then -10,200 cm", [-10, 200]),
        (["--explore"], "exploring", None),
        (["--approach", "25"], "approaching up to 25 cm", None),
        (["--measure-only"], "measuring only", None),
    ],
)
def test_what_a_drive_is_for_is_chosen_and_told(arguments, task, goal, tmp_path):
    done = run(tmp_path, *arguments, "--max-time", "0.2", "--json", "out.json", "--no-view")
    assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / "out.json").read_text())
    assert (result["task"], result["goal_cm"]) == (task, goal)
    bound_for = not {"--explore", "--measure-only"} & set(arguments)
    assert result["reason"] == ("not there after 0.2 s" if bound_for else "ended after 0.2 s")
    assert (tmp_path / "runs" / "latest" / "path.png").exists()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--goal", "abc"], "abc"),
        (["--goal", "1"], "--goal 1"),
        (["--goal", "1,2,3"], "--goal 1,2,3"),
        (["--goal", "nan,100"], "nan"),
        (["--goal", "0,9999"], "off the map"),
        (["--goal", "0,100 5,x"], "5,x"),
        (["--goal"], "--goal"),
        (["--goal", "0,100", "--explore"], "exclude each other"),
        (["--approach", "20", "--measure-only"], "exclude each other"),
        (["--approach", "-1"], "--approach -1"),
        (["--max-time", "-1"], "--max-time"),
        (["--max-time", "nan"], "--max-time"),
        (["--max-time", "soon"], "soon"),
        (["--max-wall", "0"], "--max-wall"),
        (["--view", "--view-port", "99999"], "--view-port 99999"),
        (["--view", "--view-host", "nowhere.invalid"], "--view-host nowhere.invalid"),
        (["--view-port", "8090"], "add --view"),
        (["--view-host", "0.0.0.0", "--no-view"], "add --view"),
        (["--camera", "sim:nowhere"], "sim:nowhere"),
        (["--camera", "sim:room?seed=x"], "seed"),
        (["--camera", "sim:room", "--robot", "/dev/ttyACM0"], "do not go together"),
        (["--robot", "sim:room"], "write sim: or avr:"),
        (["--json", "."], "is a folder"),
        (["--nav.speed-cm-s", "0"], "speed"),
        (["--sped", "3"], "--sped"),
        (["--config", "missing.toml"], "missing.toml"),
    ],
)
def test_bad_arguments_get_one_line_and_exit_code_2_and_leave_nothing(arguments, named, tmp_path):
    done = run(tmp_path, *arguments)
    assert done.returncode == 2
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith("error: ")
    assert named in lines[0]
    assert not list(tmp_path.iterdir())


def test_a_missing_webcam_gets_one_line_and_exit_code_4(tmp_path):
    done = run(tmp_path, "--camera", "/dev/video99", "--robot", "/dev/ttyNONE", "--goal", "0,100")
    assert done.returncode == 4
    assert len(done.stderr.strip().splitlines()) == 1
    assert "/dev/video99" in done.stderr


@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_ctrl_c_still_writes_the_result_and_exits_130(kind, tmp_path):
    process = subprocess.Popen(
        [*SCRIPT, "--camera", "sim:room?seed=3", "--json", "out.json"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=partial(signal.signal, kind, signal.SIG_DFL),  # nohup around the tests ignores SIGHUP
    )  # fmt: skip
    try:
        assert process.stderr is not None
        assert "driving to" in process.stderr.readline()
        time.sleep(2.0)
        process.send_signal(kind)
        _, said = process.communicate(timeout=PATIENCE_S)
    finally:
        process.kill()
    assert process.returncode == 130, said
    assert "Traceback" not in said
    result = json.loads((tmp_path / "out.json").read_text())
    assert (result["outcome"], result["reason"]) == ("stopped", "interrupted")
    assert (tmp_path / "runs" / "latest" / "path.png").exists()
