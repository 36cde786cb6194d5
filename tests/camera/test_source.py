"""Cameras behind one URI: folders, videos and live ones, and what is said when they fail."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from mjpeg_server import serving

from host.camera.lens import Lens
from host.camera.live import LiveCamera, Shot
from host.camera.source import open_camera
from host.errors import DeviceError, InputError, UsageError
from host.nav.rig import open_rig


class ScriptedCapture:
    """A camera that gives a frame whenever the test says so; frame k is filled with k."""

    def __init__(self) -> None:
        self.due = threading.Semaphore(0)
        self.unplugged = self.released = False
        self.count = 0

    def give(self, frames: int) -> None:
        before = self.count
        for _ in range(frames):
            self.due.release()
        while self.count < before + frames:
            time.sleep(0.001)
        time.sleep(0.02)  # until the thread has taken the last one in

    def read(self) -> Shot | None:
        self.due.acquire()
        if self.unplugged:
            return None
        self.count += 1
        return Shot(np.full((4, 4, 3), self.count, np.uint8), time.monotonic())

    def release(self) -> None:
        self.released = True


@pytest.fixture
def capture():
    capture = ScriptedCapture()
    yield capture
    capture.unplugged = True
    capture.due.release(10)


def test_a_sequence_folder_gives_its_images_lens_and_times(sequence_folder: Path):
    camera = open_camera(str(sequence_folder))
    assert camera.lens is not None and camera.lens.fx == 110.0
    frames = [camera.read(1.0) for _ in range(4)]
    assert [(f.seq, f.t_s) for f in frames if f] == [(0, 0.0), (1, 0.1), (2, 0.2), (3, 0.3)]
    first = cv2.imread(str(sequence_folder / "frames/000.png"))
    assert frames[0] is not None and np.array_equal(frames[0].image, first)
    assert camera.read(1.0) is None


def test_a_plain_folder_is_played_by_name(sequence_folder: Path):
    camera = open_camera(str(sequence_folder / "frames"))
    assert camera.lens is None
    times = [frame.t_s for frame in iter(lambda: camera.read(1.0), None)]
    assert times == pytest.approx([0, 1 / 15, 2 / 15, 3 / 15])


def test_a_folder_with_images_of_two_sizes_is_refused_at_the_second(sequence_folder: Path):
    cv2.imwrite(str(sequence_folder / "frames/001.png"), np.zeros((9, 9, 3), np.uint8))
    camera = open_camera(str(sequence_folder / "frames"))
    camera.read(1.0)
    with pytest.raises(InputError, match=r"001\.png.*9x9.*96x72"):
        camera.read(1.0)


def test_a_video_gives_all_frames_with_its_own_times(tmp_path: Path):
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (64, 48))
    for k in range(5):
        writer.write(np.full((48, 64, 3), 40 * k, np.uint8))
    writer.release()
    camera = open_camera(str(path))
    frames = list(iter(lambda: camera.read(1.0), None))
    assert [round(frame.image.mean() / 40) for frame in frames] == [0, 1, 2, 3, 4]
    assert [frame.t_s for frame in frames] == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])
    with pytest.raises(InputError, match=r"clip\.avi.*64x48.*32x24"):
        open_camera(str(path), Lens(32, 24, 30, 30, 16, 12))


@pytest.mark.parametrize(
    ("uri", "kind", "words"),
    [
        ("sim:room?seed=1", UsageError, "simulated"),
        ("nothing-there", InputError, "no such file or folder"),
        ("99", DeviceError, "/dev/video99.*not there"),
        ("/dev/video98", DeviceError, "/dev/video98.*not there"),
        ("/dev/null", DeviceError, "/dev/null.*does not open"),
        ("{tmp}", InputError, "no images"),
        ("{tmp}/a.mp4", InputError, r"a\.mp4.*video"),
        ("{tmp}/a.mcap", InputError, r"a\.mcap: is no MCAP file"),
        ("{tmp}/b.mcap", InputError, r"b\.mcap: no such file"),
    ],
)
def test_what_cannot_be_opened_is_named_with_a_remedy(uri, kind, words, tmp_path: Path, capfd):
    if uri.endswith(("a.mp4", "a.mcap")):
        (tmp_path / uri[-6:].strip("}/")).write_bytes(b"no video" * 100)
    with pytest.raises(kind, match=words) as error:
        open_camera(uri.format(tmp=tmp_path))
    assert "; " in str(error.value)
    assert "\n" not in str(error.value)
    assert capfd.readouterr().err == ""


def test_a_live_camera_gives_the_newest_frame_and_counts_the_dropped(capture: ScriptedCapture):
    camera = LiveCamera(capture, "test")
    capture.give(1)
    first = camera.read(1.0)
    capture.give(5)
    newest = camera.read(1.0)
    assert first is not None and newest is not None
    assert (first.seq, newest.seq) == (0, 5)
    assert newest.image[0, 0, 0] == 6
    assert newest.t_s > first.t_s


def test_a_live_camera_never_gives_a_frame_twice(capture: ScriptedCapture):
    camera = LiveCamera(capture, "test")
    capture.give(1)
    camera.read(1.0)
    start = time.monotonic()
    with pytest.raises(DeviceError, match=r"test: no frame for 0\.05 s"):
        camera.read(0.05)
    assert time.monotonic() - start < 1.0


def test_a_waiting_reader_gets_a_frame_as_soon_as_it_comes(capture: ScriptedCapture):
    camera = LiveCamera(capture, "test")
    threading.Timer(0.05, lambda: capture.give(1)).start()
    start = time.monotonic()
    assert camera.read(5.0) is not None
    assert time.monotonic() - start < 2.0


def test_an_unplugged_camera_is_noticed_at_once(capture: ScriptedCapture):
    camera = LiveCamera(capture, "test")
    capture.unplugged = True
    capture.due.release()
    start = time.monotonic()
    with pytest.raises(DeviceError, match="stopped delivering"):
        camera.read(5.0)
    assert time.monotonic() - start < 2.0


def test_closing_releases_the_device(capture: ScriptedCapture):
    camera = LiveCamera(capture, "test")
    capture.unplugged = True
    capture.due.release()
    camera.close()
    assert capture.released


@pytest.mark.parametrize("robot", ["sim:", "auto", "/dev/ttyACM0"])
def test_pictures_of_another_time_drive_nothing_and_where_they_are_measured_is_told(
    sequence_folder: Path, robot
):
    for folder, measurable in ((sequence_folder, True), (sequence_folder / "frames", False)):
        with pytest.raises(UsageError) as told, open_rig(str(folder), robot, None):
            pass
        assert "nothing can be driven by pictures that are not of now; name a webcam or a" in str(told.value)
        assert (f"'python -m host.measure {folder}'" in str(told.value)) == measurable


def test_a_real_camera_does_not_go_with_a_simulated_robot_and_how_to_find_a_real_one_is_told():
    with (
        pytest.raises(UsageError, match="simulate both or neither; --robot auto finds a real one"),
        open_rig("/dev/video0", "sim:", None),
    ):
        pass


def test_a_live_camera_without_a_lens_drives_nothing(monkeypatch: pytest.MonkeyPatch):
    with (
        serving() as server,
        pytest.raises(UsageError, match=r"its lens is not known; name its camera\.json with --lens"),
        open_rig(server.url, "/dev/ttyACM0", None),
    ):
        pass
