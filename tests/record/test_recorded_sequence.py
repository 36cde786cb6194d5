"""Recordings measured and exported as sequences, with the poses of their wheels."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from host.config import Config
from host.errors import UsageError
from host.measure import MeasureOptions, run_sequence
from host.nav.odometry import heading_of
from host.nav.task import Explore
from host.record import export
from host.record.mcap_reader import Recording
from host.record.recorded_sequence import read_recorded_sequence
from host.record.recorder import Recorder
from host.record.sequence import read_sequence
from tests.record.test_recording import LENS, StillClock, jpeg_frame, noise


def test_poses_are_those_of_the_drive_a_little_better_known(recorded_drive):
    sequence = read_recorded_sequence(recorded_drive)
    live = {e["frame"]: e["odometry"] for e in Recording(recorded_drive).journal() if e["do"] == "drove"}
    assert sequence.notes == ()
    assert [frame.number for frame in sequence.frames] == list(range(len(sequence.frames)))
    for frame in sequence.frames:
        x, z, heading = live.get(frame.number, (math.nan,) * 3)
        if not math.isnan(x):
            assert math.dist((x, z), frame.pose.position_cm[[0, 2]]) < 1.5
            assert heading == pytest.approx(heading_of(frame.pose), abs=0.05)
    assert sequence.frames[-1].pose.position_cm[2] > 5
    assert all(frame.pose.sigma_z_cm > 0 and frame.pose.sigma_rot_rad > 0 for frame in sequence.frames[20:])


def test_measuring_a_recording_and_its_export_give_the_same_depths(recorded_drive, tmp_path, monkeypatch):
    monkeypatch.setattr("sys.argv", ["export", str(recorded_drive), str(tmp_path / "folder")])
    export.main()
    results = []
    for source in (recorded_drive, tmp_path / "folder"):
        options = MeasureOptions(json=tmp_path / "out.json")
        run_sequence(Path(source), options, Config())
        results.append(json.loads((tmp_path / "out.json").read_text()))
    ours, exported = results
    assert ours["camera"] == exported["camera"] and len(ours["frames"]) == len(exported["frames"]) > 25
    known = 0
    for a, b in zip(ours["frames"], exported["frames"], strict=True):
        for r, s in zip(a["regions"], b["regions"], strict=True):
            # poses.csv holds quaternions, whose last bit is not the matrix's
            assert (r["id"], r["area_px"]) == (s["id"], pytest.approx(s["area_px"], rel=1e-6))
            assert (r["depth_cm"] is None) == (s["depth_cm"] is None)
            if r["depth_cm"] is not None:
                assert r["depth_cm"] == pytest.approx(s["depth_cm"], rel=1e-6)
                known += 1
    assert known > 20


def test_pictures_are_exported_as_they_were_recorded(tmp_path):
    path = tmp_path / "run.mcap"
    with Recorder(path) as recorder:
        recorder.pilot(StillClock(), LENS, Explore(), Config(), {})
        frames = [jpeg_frame(1, 0.1), jpeg_frame(2, 0.2), jpeg_frame(3, 0.2), jpeg_frame(4, 0.3)]
        for frame in frames:
            recorder.frame_number(frame)
    sequence = read_recorded_sequence(path)
    assert [frame.number for frame in sequence.frames] == [0, 1, 3]  # the third is no later than the second
    assert [sequence.file(k) for k in range(3)] == [frames[k].encoded for k in (0, 1, 3)]
    assert np.array_equal(sequence.image(2), frames[3].image)
    assert noise(1).shape == sequence.image(0).shape


def test_an_exported_folder_keeps_jpeg_files(tmp_path, monkeypatch):
    path = tmp_path / "run.mcap"
    frames = [jpeg_frame(k, 0.1 * k) for k in range(3)]
    with Recorder(path) as recorder:
        recorder.pilot(StillClock(), LENS, Explore(), Config(), {})
        for frame in frames:
            recorder.frame_number(frame)
    monkeypatch.setattr("sys.argv", ["export", str(path), str(tmp_path / "folder")])
    export.main()
    sequence = read_sequence(tmp_path / "folder")
    assert [f.path.read_bytes() for f in sequence.frames] == [frame.encoded for frame in frames]
    with pytest.raises(UsageError, match="exists already"):
        export.main()


def test_a_robot_that_was_carried_is_told_of(tmp_path):
    path = tmp_path / "run.mcap"
    with Recorder(path) as recorder:
        pilot = recorder.pilot(StillClock(), LENS, Explore(), Config(), {})
        recorder.frame_number(jpeg_frame(1, 7.0))
        recorder.frame_number(jpeg_frame(2, 9.5))
        pilot.forget()
    (note,) = read_recorded_sequence(path).notes
    assert "at 2.5 s the robot slipped or was carried" in note


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (lambda path: MeasureOptions(poses=path), "--poses .*: a recording brings its wheels' poses"),
        (lambda path: MeasureOptions(json=path), "belongs to the sequence and would be overwritten"),
    ],
)
def test_what_would_harm_or_contradict_the_recording_is_refused(recorded_drive, options, says):
    before = recorded_drive.read_bytes()
    with pytest.raises(UsageError, match=says):
        run_sequence(recorded_drive, options(recorded_drive), Config())
    assert recorded_drive.read_bytes() == before
