"""Recordings: what is told is read back, and what a crash, damage or a full disk leave is whole."""

from __future__ import annotations

import itertools
import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from host.camera.frame import Frame
from host.camera.lens import Lens
from host.config import Config, config_text
from host.errors import InputError, UsageError
from host.link.clock import SystemClock
from host.link.protocol import Decoder, Telemetry
from host.nav.odometry import WheelReading
from host.nav.task import Approach, Explore, MeasureOnly, Route
from host.record import recorder as recorder_module
from host.record.journal import FORMAT, lens_as_dict, lens_of, reading_of, task_as_dict, task_of
from host.record.mcap_reader import Recording
from host.record.mcap_writer import Told, Writer
from host.record.playback import PlayedCamera
from host.record.recorder import Recorder

ROOT = Path(__file__).resolve().parents[2]
LENS = Lens(32, 24, 30.0, 31.0, 15.5, 11.5, (0.1, -0.2, 0.001, 0.0, 0.03))


class StillClock:
    """Virtual time that stands."""

    def now_s(self) -> float:
        return 5.0

    def sleep_s(self, duration_s: float) -> None:
        pass


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (24, 32, 3), np.uint8)


def jpeg_frame(seed: int, t_s: float) -> Frame:
    data = cv2.imencode(".jpg", noise(seed))[1].tobytes()
    return Frame(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), t_s, seed, data)


def begun(path: Path, **more) -> Recorder:
    recorder = Recorder(path, **more)
    recorder.pilot(StillClock(), LENS, Explore(), Config(), {"camera": "0"})
    return recorder


# --- What is told is read back -----------------------------------------------------------------

times = st.floats(0, 1e6)
counts = st.integers(-(2**31), 2**31 - 1)
readings = st.builds(
    WheelReading, times, counts, counts, st.none() | times, st.none() | times,
    st.sampled_from([-1, 0, 1]), st.sampled_from([-1, 0, 1]),
)  # fmt: skip
frames = st.builds(
    lambda seed, t_s, jpeg: jpeg_frame(seed, t_s) if jpeg else Frame(noise(seed), t_s, seed),
    st.integers(0, 2**31), times, st.booleans(),
)  # fmt: skip
things = st.one_of(
    readings,
    frames,
    st.tuples(st.sampled_from(["rx", "tx"]), st.binary(max_size=300)),
    st.text(max_size=80).map(lambda text: text.rstrip("\0")),
)


@settings(max_examples=30, deadline=None)
@given(st.lists(things, max_size=12))
def test_all_that_is_told_is_read_back_as_it_was(tmp_path_factory, told):
    path = tmp_path_factory.mktemp("round") / "run.mcap"
    with begun(path) as recorder:
        for thing in told:
            if isinstance(thing, WheelReading):
                recorder.hear(thing)
            elif isinstance(thing, Frame):
                recorder.frame_number(thing)
            elif isinstance(thing, tuple):
                recorder.put_bytes(*thing)
            else:
                recorder.event(20, "drive", thing)
    recording = Recording(path)
    assert recording.closed and recording.note is None
    assert (recording.lens, recording.config) == (LENS, Config())
    assert [reading_of(e) for e in recording.journal() if e["do"] == "hear"] == [
        thing for thing in told if isinstance(thing, WheelReading)
    ]
    assert [("tx" if s.sent else "rx", s.data) for s in recording.serial()] == [
        thing for thing in told if isinstance(thing, tuple)
    ]
    assert [e.text for e in recording.events()] == [thing for thing in told if isinstance(thing, str)]
    pictures = [thing for thing in told if isinstance(thing, Frame)]
    found = list(recording.frames())
    assert len(found) == len(pictures) == recording.frame_count
    for recorded, live in zip(found, pictures, strict=True):
        again = recorded.frame()
        assert (again.t_s, again.seq, again.encoded) == (live.t_s, live.seq, live.encoded)
        assert np.array_equal(again.image, live.image) and recorded.is_as_live(again.image)


@given(st.floats(), st.floats(), st.floats(0, 100))
def test_tasks_and_lenses_come_back_from_json_to_the_bit(x, z, stop_cm):
    for task in (Route([(x, z), (z, x)]), Approach(stop_cm), Explore(), MeasureOnly()):
        entry = json.loads(json.dumps(task_as_dict(task)))
        again = task_of(entry)
        assert type(again) is type(task)
        assert json.dumps(task_as_dict(again)) == json.dumps(entry)
    lens = Lens(640, 480, x, z, stop_cm, 1.0, (x, z, 0.0, 0.0, 0.0))
    entry = {"width": 640, "height": 480, "fx": x, "fy": z, "cx": stop_cm, "cy": 1.0}
    again = lens_of(json.loads(json.dumps({**entry, "distortion": [x, z, 0.0, 0.0, 0.0]})))
    assert repr(again) == repr(lens)


def test_ros_tools_find_their_own_messages_in_a_drive(recorded_drive):
    found: dict[str, list] = {}
    with open(recorded_drive, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        for schema, channel, _, message in reader.iter_decoded_messages():
            assert schema is not None
            found.setdefault(channel.topic, []).append((schema.name, message))
    names = {topic: messages[0][0] for topic, messages in found.items()}
    assert names == {
        "/camera/image/compressed": "sensor_msgs/msg/CompressedImage",
        "/camera/camera_info": "sensor_msgs/msg/CameraInfo",
        "/odom": "nav_msgs/msg/Odometry",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/battery": "sensor_msgs/msg/BatteryState",
        "/serial/rx": "std_msgs/msg/UInt8MultiArray",
        "/serial/tx": "std_msgs/msg/UInt8MultiArray",
        "/journal": "std_msgs/msg/String",
        "/config": "std_msgs/msg/String",
        "/events": "rcl_interfaces/msg/Log",
    }
    recording = Recording(recorded_drive)
    lens = recording.lens
    info = found["/camera/camera_info"][0][1]
    assert (info.width, info.height, info.distortion_model) == (lens.width, lens.height, "plumb_bob")
    assert np.array_equal(np.reshape(info.k, (3, 3)), lens.matrix) and tuple(info.d) == lens.distortion
    assert 6 < found["/battery"][0][1].voltage < 9
    last = found["/odom"][-1][1]
    x_cm, z_cm, heading = [e for e in recording.journal() if e["do"] == "drove"][-1]["odometry"]
    ahead = recording.config.body.camera_ahead_cm
    place, turn = last.pose.pose.position, last.pose.pose.orientation
    assert 100 * place.x == pytest.approx(z_cm - ahead * math.cos(heading))
    assert 100 * place.y == pytest.approx(-x_cm + ahead * math.sin(heading))
    assert 2 * math.atan2(turn.z, turn.w) == pytest.approx(-heading)
    assert last.twist.twist.linear.x == pytest.approx(0.08, abs=0.03)  # it creeps at first
    links = {(t.header.frame_id, t.child_frame_id) for t in found["/tf"][-1][1].transforms}
    assert links == {("map", "odom"), ("odom", "base_link"), ("base_link", "camera_optical")}


def test_the_lines_bytes_are_those_that_went_over_it(recorded_drive):
    recording = Recording(recorded_drive)
    decoder = Decoder(to_host=True)
    heard = [m for s in recording.serial() if not s.sent for _, m in decoder.feed(s.data)]
    reports = [message for message in heard if isinstance(message, Telemetry)]
    assert len(reports) > 200
    hears = [entry for entry in recording.journal() if entry["do"] == "hear"]
    told = [[report.count_left, report.count_right] for report in reports]
    assert len(hears) > 200
    assert [entry["counts"] for entry in hears] == told[len(told) - len(hears) :]


def test_nothing_that_only_the_simulator_knows_gets_into_a_recording(recorded_drive):
    text = " ".join(json.dumps(entry) for entry in Recording(recorded_drive).journal())
    for word in ("true", "truth", "collision", "clearance_cm", "error"):
        assert f'"{word}' not in text.lower().replace('"hands_off": true', "")


def test_a_recording_plays_as_a_camera(recorded_drive):
    camera = PlayedCamera(recorded_drive)
    recording = Recording(recorded_drive)
    assert camera.lens == recording.lens
    entries = [entry for entry in recording.journal() if entry["do"] == "frame"]
    for entry in entries:
        frame = camera.read(0.0)
        assert frame is not None and (frame.seq, frame.t_s) == (entry["seq"], entry["t_s"])
        assert zlib.crc32(frame.image.tobytes()) == entry["pixels"]
    assert camera.read(0.0) is None


# --- What is left of a file that was cut or damaged ---------------------------------------------


@pytest.fixture(scope="module")
def small(tmp_path_factory) -> Path:
    """Of several chunks, with all kinds of things in them."""
    path = tmp_path_factory.mktemp("small") / "run.mcap"
    writer = Writer(path)
    begin = {"do": "begin", "format": FORMAT, "lens": lens_as_dict(LENS), "task": {"kind": "explore"}}
    writer.write(Told("begin", 0, (begin, config_text(Config()), LENS, Config().body)), 0)
    for k in range(6):
        for thing in range(3):
            writer.write(Told("rx", k, bytes([k, thing]) * 20), 0)
            writer.write(Told("hear", k, WheelReading(k + thing / 10, k, thing, None, 0.1 * k)), 0)
        writer.write(Told("frame", k, (k, jpeg_frame(k, 0.1 * k))), 0)
        writer.flush()
    writer.finish({"do": "end"}, begun=True)
    return path


def content(path: Path) -> list:
    recording = Recording(path)
    return [recording.closed, *recording.messages()]


def record_ends(data: bytes) -> list[int]:
    """Where each record of the file ends, and the magic before the first."""
    ends = [8]
    while ends[-1] < len(data) - 8:
        ends.append(ends[-1] + 9 + int.from_bytes(data[ends[-1] + 1 : ends[-1] + 9], "little"))
    return ends


def test_a_file_cut_anywhere_is_whole_up_to_there_or_told_to_be_empty(small, tmp_path):
    data, whole = small.read_bytes(), content(small)[1:]
    ends, rng = record_ends(data), np.random.default_rng(1)
    near = {end + by for end in ends for by in (0, 1, 10)}
    cuts = sorted({0, 4, *near, *rng.integers(0, len(data), 40).tolist()})
    path, before = tmp_path / "cut.mcap", 0
    for cut in (cut for cut in cuts if cut < len(data)):
        path.write_bytes(data[:cut])
        try:
            closed, *found = content(path)
        except InputError as error:
            assert before == 0 and ("empty" in str(error) or "nothing was" in str(error) or cut < 8)
            continue
        assert found == whole[: len(found)] and len(found) >= before
        assert closed == (len(found) == len(whole))
        note = Recording(path).note
        assert (note is None) == closed and (closed or "was not closed" in str(note))
        before = len(found)
    assert before == len(whole)  # all of it is there before the index and the end are


def test_a_flipped_bit_anywhere_is_noticed_or_of_no_effect(small, tmp_path):
    data, whole = small.read_bytes(), content(small)
    path, rng, noticed = tmp_path / "flipped.mcap", np.random.default_rng(2), 0
    heads = [end + by for end in record_ends(data)[:-1] for by in range(10)]  # kinds and lengths
    places = [*heads, *rng.integers(0, len(data), 200).tolist()]
    for at, bit in zip(places, itertools.cycle(range(8)), strict=False):
        flipped = bytearray(data)
        flipped[at] ^= 1 << bit
        path.write_bytes(flipped)
        try:
            assert content(path) == whole
        except InputError as error:
            noticed += 1
            assert str(path) in str(error) and "\n" not in str(error)
    assert noticed > 100


SLOWLY = """
import sys, time
from pathlib import Path
from host.camera.lens import Lens
from host.config import Config
from host.link.clock import SystemClock
from host.nav.odometry import WheelReading
from host.nav.task import Explore
from host.record.recorder import Recorder
recorder = Recorder(Path("run.mcap"))
recorder.pilot(SystemClock(), Lens(32, 24, 30, 30, 15, 11), Explore(), Config(), {})
while True:
    t_s = time.monotonic()
    recorder.hear(WheelReading(t_s, 0, 0, None, None))
    print(t_s, flush=True)
    time.sleep(0.01)
"""


def test_a_process_that_is_killed_leaves_all_but_its_last_second(tmp_path):
    child = subprocess.Popen(
        [sys.executable, "-c", SLOWLY], cwd=tmp_path, stdout=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([os.environ.get("PYTHONPATH", ""), str(ROOT)])},
    )  # fmt: skip
    assert child.stdout is not None
    first = float(child.stdout.readline())
    last = first
    while last < first + 1.6:
        last = float(child.stdout.readline())
    child.send_signal(signal.SIGKILL)
    rest, _ = child.communicate()
    last = max([last, *(float(line) for line in rest.splitlines()[:-1])])
    recording = Recording(tmp_path / "run.mcap")
    assert not recording.closed and "was not closed" in str(recording.note)
    times_s = [entry["t_s"] for entry in recording.journal() if entry["do"] == "hear"]
    assert times_s[0] == first
    assert times_s[-1] > last - 1.0


# --- Full disks, slow disks, places that are taken -----------------------------------------------


ON_A_SMALL_DISK = """
import errno, os, sys
import host.record.mcap_writer as writer
from host.errors import run_command
from host.nav_loop import main

class SmallDisk:
    def __getattr__(self, name):
        return getattr(os, name)

    def write(self, handle, data):
        room = 120_000 - os.fstat(handle).st_size
        if room <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return os.write(handle, data[:room])

writer.os = SmallDisk()
run_command(main)
"""


def test_on_a_full_disk_the_recording_ends_with_one_line_and_the_drive_goes_on(tmp_path):
    path = os.pathsep.join(filter(None, [os.environ.get("PYTHONPATH"), str(ROOT)]))
    done = subprocess.run(
        [sys.executable, "-c", ON_A_SMALL_DISK, "--camera", "sim:room?seed=3", "--max-time", "2.5",
         "--max-wall", "300", "--record", "run.mcap", "--json", "out.json"],
        cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False,
        env={**os.environ, "PYTHONPATH": path},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stderr.splitlines() if "run.mcap" in line]
    why = "No space left on device"
    assert lines == [f"run.mcap: the recording ends here ({why}); the drive goes on without it"]
    result = json.loads((tmp_path / "out.json").read_text())
    assert result["outcome"] == "timeout" and result["duration_s"] == pytest.approx(2.5, abs=0.2)
    assert result["recording"]["ended_early"] == why
    recording = Recording(tmp_path / "run.mcap")
    assert not recording.closed and 0 < recording.frame_count < result["frames"]
    assert recording.frame_count == result["recording"]["frames"]
    with open(tmp_path / "run.mcap", "rb") as file:  # other programs can read it as it is
        assert len(list(make_reader(file).iter_messages(topics=["/journal"]))) == recording.entry_count


def test_an_error_of_the_disk_at_any_write_leaves_a_file_that_is_whole_up_to_there(tmp_path, monkeypatch):
    write = os.write
    for fails_at in (1, 2, 5, 12, 20, 30):
        path, calls, said = tmp_path / f"{fails_at}.mcap", itertools.count(1), []

        def failing(handle, data, calls=calls, fails_at=fails_at):
            if next(calls) == fails_at:
                write(handle, bytes(data)[: len(data) // 2])
                raise OSError(28, "No space left on device")
            return write(handle, data)

        monkeypatch.setattr("host.record.mcap_writer.os.write", failing)
        monkeypatch.setattr(recorder_module, "FLUSH_S", 0.0)
        recorder = begun(path, say=said.append)
        for k in range(12):
            recorder.frame_number(jpeg_frame(k, 0.1 * k))
            while recorder._queue:
                time.sleep(0.001)
        recorder.close()
        monkeypatch.setattr("host.record.mcap_writer.os.write", write)
        assert len(said) == 1 and "No space left on device" in said[0] and str(path) in said[0]
        assert recorder.summary()["ended_early"] == "No space left on device"
        try:
            recording = Recording(path)
            assert [f.seq for f in recording.frames()] == list(range(recording.frame_count))
        except InputError as error:
            assert fails_at <= 5 and ("empty" in str(error) or "nothing was recorded" in str(error))


def test_a_disk_that_hangs_costs_pictures_and_not_the_loops_time(tmp_path, monkeypatch):
    hangs, said = threading.Event(), []
    write = Writer.write

    def hanging(self, told, wall_ns):
        hangs.wait(20)
        write(self, told, wall_ns)

    monkeypatch.setattr(Writer, "write", hanging)
    monkeypatch.setattr(recorder_module, "QUEUE_BYTES", 100_000)
    recorder = Recorder(tmp_path / "run.mcap", say=said.append)
    recorder.pilot(SystemClock(), LENS, Explore(), Config(), {})
    begin_s = time.process_time()
    for k in range(200):
        recorder.frame_number(Frame(noise(k), 0.1 * k, k))
    assert time.process_time() - begin_s < 1.0
    assert not hangs.is_set()  # nobody waited for the disk
    hangs.set()
    recorder.close()
    told = recorder.summary()
    assert told["lost_frames"] > 100 and told["frames"] + told["lost_frames"] == 200
    assert said == [
        f"{tmp_path / 'run.mcap'}: {told['lost_frames']} pictures and 0 other entries did not get into the "
        "recording: the disk or this machine is slow"
    ]
    recording = Recording(tmp_path / "run.mcap")
    assert recording.frame_count == told["frames"]
    end = list(recording.journal())[-1]
    assert (end["do"], end["lost_frames"]) == ("end", told["lost_frames"])


def test_what_is_there_is_never_written_over(tmp_path):
    path = tmp_path / "run.mcap"
    path.write_text("precious")
    for taken in (path, tmp_path, Path("/dev/full")):
        with pytest.raises(UsageError, match="exists already, and a recording is never written over"):
            Recorder(taken)
    assert path.read_text() == "precious"
    with pytest.raises(UsageError, match="cannot be written"):
        Recorder(path / "below.mcap")


def test_a_drive_that_does_not_begin_leaves_no_recording(tmp_path):
    with Recorder(tmp_path / "run.mcap") as recorder:
        recorder.put_bytes("tx", b"hello?")
    assert list(tmp_path.iterdir()) == []
