"""Recorded drives done again: the same to the bit, and otherwise the place where they part."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter

from host.camera.frame import Frame
from host.camera.lens import Lens
from host.config import Config, config_text
from host.depth.estimator import Estimator
from host.errors import InputError
from host.link.clock import SystemClock
from host.link.robot import Robot
from host.link.transport import Transport
from host.nav.drive import drive
from host.nav.odometry import Odometry, WheelReading
from host.nav.pilot import Pilot, View
from host.nav.result import DriveLog
from host.nav.task import Explore
from host.record import ros
from host.record.journal import FORMAT, lens_as_dict
from host.record.mcap_reader import Recording
from host.record.mcap_writer import Told, Writer
from host.record.recorder import Recorder
from host.record.replayed import Tally, replay
from host.record.versions import differences
from host.sim.board import Line
from host.sim.session import Simulation

ROOT = Path(__file__).resolve().parents[2]


def tally_of(recording: Recording, config=None) -> Tally:
    tally = Tally()
    for step in replay(recording, config, tally):
        tally.count(step)
    return tally


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join(filter(None, [os.environ.get("PYTHONPATH"), str(ROOT)]))
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, capture_output=True, text=True, timeout=300, check=False,
        env={**os.environ, "PYTHONPATH": path},
    )  # fmt: skip


def test_a_drive_is_the_same_to_the_bit_in_another_process_without_the_simulator(recorded_drive, tmp_path):
    command = (
        "import sys; sys.argv = ['replay', *sys.argv[1:]]\n"
        "from host.replay import main\n"
        "code = main()\n"
        "assert 'host.sim.session' not in sys.modules and 'host.sim.scoring' not in sys.modules\n"
        "sys.exit(code)"
    )
    done = run(tmp_path, "-c", command, str(recorded_drive), "--json", "out.json")
    assert done.returncode == 0, done.stdout + done.stderr
    told = json.loads((tmp_path / "out.json").read_text())
    assert told["same"] and told["first_difference"] is None and told["notes"] == told["changed"] == []
    assert told["pictures"] >= 33
    assert told["commands_between_pictures"] > 0  # pictures come late in this drive
    assert f"the same to the bit: {told['pictures']} pictures" in done.stdout


def test_another_setting_of_steering_shows_in_the_first_command_and_in_nothing_before(
    recorded_drive, tmp_path
):
    config = Recording(recorded_drive).config
    file = tmp_path / "robot.toml"
    file.write_text(config_text(replace(config, nav=replace(config.nav, creep_cm_s=7.0))))
    done = run(
        tmp_path, "-m", "host.replay", str(recorded_drive), "--config", str(file), "--json", "out.json"
    )
    assert done.returncode == 6, done.stderr
    told = json.loads((tmp_path / "out.json").read_text())
    first = told["first_difference"]
    assert (first["part"], first["frame"], first["t_s"]) == ("command", 0, 0.0)
    assert "80.0 mm/s" in first["was"] and "70.0 mm/s" in first["now"]
    assert "picture 0" in done.stdout and "other settings were asked for" in done.stdout


def test_another_setting_of_the_net_shows_in_regions(recorded_drive):
    recording = Recording(recorded_drive)
    config = replace(recording.config, net=replace(recording.config.net, max_polygons=12))
    first = tally_of(recording, config).first
    assert first is not None and first.part == "regions"
    assert "regions" in first.was or "region" in first.was


def test_a_depth_that_changes_by_its_last_bit_is_found_where_it_does(recorded_drive, monkeypatch):
    update, calls = Estimator.update, []

    def changed(self, snapshot, pose):
        report = update(self, snapshot, pose)
        calls.append(1)
        if len(calls) != 31:
            return report
        region = next(r for r, depth in report.regions.items() if depth.depth_cm is not None)
        depth = report.regions[region]
        other = replace(depth, depth_cm=depth.depth_cm * (1 + 2.3e-16))
        return replace(report, regions={**report.regions, region: other})

    monkeypatch.setattr(Estimator, "update", changed)
    tally = tally_of(Recording(recorded_drive))
    assert tally.first is not None
    assert (tally.first.part, tally.first.frame) == ("depth", 30)
    assert tally.first.was.split("±")[0] != tally.first.now.split("±")[0]


def test_a_program_that_fails_on_a_picture_is_told_with_its_line(recorded_drive, monkeypatch):
    take = Pilot.take

    def failing(self, frame, now_s):
        if frame.seq >= 5:
            raise ZeroDivisionError("nothing to divide by")
        return take(self, frame, now_s)

    monkeypatch.setattr(Pilot, "take", failing)
    tally = tally_of(Recording(recorded_drive))
    assert tally.first is not None and tally.first.seq == 5
    assert (
        "ZeroDivisionError: nothing to divide by" in tally.first.now and "test_replay.py" in tally.first.now
    )


def test_a_picture_that_decodes_otherwise_is_named_as_the_first_thing(recorded_drive, monkeypatch):
    recording = Recording(recorded_drive)
    entries = list(recording.journal())
    number = 7
    for entry in entries:
        if entry["do"] == "frame" and entry["frame"] == number:
            entry["pixels"] ^= 1
    monkeypatch.setattr(recording, "journal", lambda: iter(entries))
    tally = tally_of(recording)
    assert tally.first is not None and (tally.first.part, tally.first.frame) == ("picture", number)
    assert tally.pictures_different == 1  # the pixels were the same, so all that follows is


class TroubledCamera:
    """Black pictures for a while; later the robot's board restarts."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation, self.lens = simulation, simulation.camera.lens
        self._restarted = False

    def read(self, timeout_s: float) -> Frame | None:
        frame, now_s = self._simulation.camera.read(timeout_s), self._simulation.clock.now_s()
        if now_s > 1.6 and not self._restarted:
            self._restarted = True
            self._simulation.board.reset()
        assert frame is not None
        black = replace(frame, image=np.zeros_like(frame.image), encoded=None)
        return black if 0.7 < now_s < 0.9 else frame

    def close(self) -> None:
        pass


def test_a_drive_in_which_much_goes_wrong_is_the_same_again_too(tmp_path):
    simulation, config = Simulation("sim:room?seed=5&rough=1"), Config()
    clock, path = simulation.clock, tmp_path / "run.mcap"
    with Recorder(path) as recorder:

        def line() -> Transport:
            return recorder.line(Line(simulation.board), clock)

        with Robot(line(), clock, line) as robot:
            robot.connect()
            pilot = recorder.pilot(clock, simulation.world.lens, Explore(), config, {})

            def on_view(view: View, log: DriveLog) -> None:
                recorder.drove(view, log, robot)
                if log.frames == 36:
                    pilot.forget()

            drive(
                TroubledCamera(simulation), robot, clock, pilot, config.nav, 3.0, 600.0, on_view,
                on_refusal=lambda frame, why, log: recorder.refused(frame, why, log, robot),
            )  # fmt: skip
    recording = Recording(path)
    done = Counter(entry["do"] for entry in recording.journal())
    assert done["forget"] and done["restarted"] and done["refused"] and done["decided"]
    assert done["take"] < done["frame"] == recording.frame_count
    texts = " ".join(event.text for event in recording.events())
    assert "picture is black" in texts and "connected again" in texts
    tally = tally_of(recording)
    assert tally.same and (tally.pictures, tally.commands) == (done["made"], done["decided"])


def test_a_failure_that_ended_the_drive_fails_again_and_is_told_as_such(tmp_path, monkeypatch):
    def failing(self, snapshot, pose):
        raise ZeroDivisionError("nothing to divide by")

    monkeypatch.setattr(Estimator, "update", failing)
    lens = Lens(64, 48, 60.0, 60.0, 31.5, 23.5)
    picture = Frame(np.random.default_rng(1).integers(0, 256, (48, 64, 3), np.uint8), 0.1, 4)
    with pytest.raises(ZeroDivisionError), Recorder(tmp_path / "run.mcap") as recorder:
        pilot = recorder.pilot(SystemClock(), lens, Explore(), Config(), {})
        pilot.hear(WheelReading(0.05, 0, 0, None, None))
        pilot.hear(WheelReading(0.15, 0, 0, None, None))
        pilot.take(picture, 0.2)
    tally = tally_of(Recording(tmp_path / "run.mcap"))
    assert tally.same and tally.pictures == 0
    (note,) = tally.notes
    assert "fails here, where it ended live too: ZeroDivisionError: nothing to divide by" in note
    monkeypatch.undo()
    tally = tally_of(Recording(tmp_path / "run.mcap"))
    assert tally.notes == ["the recording ends while picture 0 was being worked on"]


def test_a_failure_over_the_wheels_fails_again_too(tmp_path, monkeypatch):
    def failing(self, reading):
        raise ZeroDivisionError("no wheels")

    monkeypatch.setattr(Odometry, "add", failing)
    lens = Lens(64, 48, 60.0, 60.0, 31.5, 23.5)
    with pytest.raises(ZeroDivisionError), Recorder(tmp_path / "run.mcap") as recorder:
        pilot = recorder.pilot(SystemClock(), lens, Explore(), Config(), {})
        pilot.hear(WheelReading(0.05, 0, 0, None, None))
    (note,) = tally_of(Recording(tmp_path / "run.mcap")).notes
    assert "fails here, where it ended live too: ZeroDivisionError: no wheels" in note


def written(path: Path, begin: dict, toml: str, *entries: dict) -> Path:
    writer, body = Writer(path), Config().body
    lens = Lens(64, 48, 60.0, 60.0, 31.5, 23.5)
    base = {"do": "begin", "format": FORMAT, "lens": lens_as_dict(lens), "task": {"kind": "explore"}}
    writer.write(Told("begin", 0, (base | begin, toml, lens, body)), 0)
    for entry in entries:
        writer.write(Told("entry", 0, entry), 0)
    writer.finish({"do": "end"}, begun=True)
    return path


@pytest.mark.parametrize(
    ("begin", "toml", "entries", "says"),
    [
        ({"format": 99}, "[nav]", (), "a recording of format 99, here 1 is read"),
        ({"lens": {"width": 3}}, "[nav]", (), "its lens cannot be understood"),
        ({"task": {"kind": "dance"}}, "[nav]", (), "task 'dance' is not known here"),
        ({}, "[nav]\nwings = 2", (), "recorded by a program with other settings .*unknown key nav.wings"),
        ({"do": "entry"}, "[nav]", (), "nothing was recorded, or it was cut off"),
        ({}, "[nav]", ({"do": "hear", "t_s": 1.0},), "an entry of its journal cannot be followed"),
    ],
)
def test_recordings_of_other_programs_are_told_in_one_line(tmp_path, begin, toml, entries, says):
    path = written(tmp_path / "run.mcap", begin, toml, *entries)
    with pytest.raises(InputError, match=says) as told:
        tally_of(Recording(path))
    assert "\n" not in str(told.value)


def test_an_mcap_file_of_something_else_is_told_as_such(tmp_path):
    with open(tmp_path / "bag.mcap", "wb") as file:
        writer = McapWriter(file)
        writer.start(profile="ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/chatter", "cdr", schema)
        for k in range(3):
            writer.add_message(channel, k, ros.string("hello"), k)
        writer.finish()
    with pytest.raises(InputError, match="is MCAP, but no recording of a drive"):
        Recording(tmp_path / "bag.mcap")


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda path: path.write_bytes(b""), "is empty"),
        (lambda path: path.write_bytes(b"hello" * 9), "no MCAP file"),
        (lambda path: path.mkdir(), "Is a directory"),
        (lambda path: None, "no such file"),
    ],
)
def test_what_is_no_recording_is_told_in_one_line(tmp_path, make, says):
    path = tmp_path / "run.mcap"
    make(path)
    with pytest.raises(InputError, match=says) as told:
        Recording(path)
    assert str(path) in str(told.value) and "\n" not in str(told.value)


def test_a_damaged_recording_ends_the_command_with_one_line_and_code_3(recorded_drive, tmp_path):
    content = bytearray(recorded_drive.read_bytes())
    content[len(content) // 2] ^= 0x10
    (tmp_path / "run.mcap").write_bytes(content)
    done = run(tmp_path, "-m", "host.replay", "run.mcap")
    assert done.returncode == 3 and done.stdout == ""
    assert done.stderr.startswith("error: run.mcap: damaged at byte ") and done.stderr.count("\n") == 1
    assert "copy it again" in done.stderr


def test_what_changed_since_is_named(recorded_drive):
    then = Recording(recorded_drive).begin["versions"]
    assert differences(then, then) == []
    now = {**then, "opencv": "4.11.0", "code of depth": "0123456789abcdef"}
    assert differences(then, now) == [
        f"opencv was {then['opencv']}, is 4.11.0",
        "code of depth changed",
    ]
