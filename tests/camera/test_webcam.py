"""A webcam is agreed with, locked and looked at; what is not as asked is told with its remedy."""

from __future__ import annotations

import contextlib
import re
import shutil
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from fake_webcam import (
    AUTO_EXPOSURE,
    AUTO_FOCUS,
    AUTO_WHITE,
    EXPOSURE,
    FOCUS,
    RATE_MAY_DROP,
    WHITE,
    FakeWebcam,
)

from host.camera import v4l2, webcam
from host.camera.config import WebcamConfig
from host.camera.lens import Lens
from host.camera.source import open_camera
from host.camera.v4l2 import Driver
from host.camera.webcam import Webcam, cameras, lasting_path, open_webcam
from host.errors import DeviceError

LENS = Lens(160, 120, 180, 180, 80, 60)


@pytest.fixture
def opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Opens a fake as if it were there: (webcam, what was told)."""
    device = tmp_path / "video0"
    device.touch()

    def opened(fake: FakeWebcam, lens: Lens | None = LENS, **config) -> tuple[Webcam, list[str]]:
        monkeypatch.setattr(webcam.cv2, "VideoCapture", lambda *_: fake)
        monkeypatch.setattr(webcam, "time", SimpleNamespace(monotonic=fake.arrived_s))
        monkeypatch.setattr(webcam, "Driver", lambda device: Driver(device, fake.ioctl))
        told: list[str] = []
        settings = WebcamConfig(**{"width": 160, "height": 120} | config)
        camera = open_webcam(device, lens, settings, told.append)
        return camera, [text.replace(str(device), "/dev/video0") for text in told]

    return opened


def test_a_good_webcam_is_locked_without_a_word_and_gives_its_own_jpeg(opened):
    fake = FakeWebcam()
    camera, told = opened(fake)
    assert told == []
    assert fake.values == {
        AUTO_EXPOSURE: 1, EXPOSURE: 157, RATE_MAY_DROP: 0, AUTO_WHITE: 0, WHITE: 4600, 0x00980913: 10,
        AUTO_FOCUS: 0, FOCUS: 0,
    }  # fmt: skip
    shot = camera.read()
    assert shot is not None and isinstance(shot.picture, bytes) and shot.picture.startswith(b"\xff\xd8")
    assert shot.t_s == pytest.approx(fake.arrived_s() - 0.03)  # the driver's time, not the arrival's
    camera.release()
    assert fake.released


def test_its_pictures_are_as_bright_locked_as_automatic_had_them_though_it_does_not_tell_its_exposure(opened):
    fake = FakeWebcam(light=0.2, exposure_of_long_ago=20)
    _, told = opened(fake)
    assert told == []
    assert fake.values[AUTO_EXPOSURE] == 1
    assert fake.light * fake.sensor_exposure / 157 == pytest.approx(1.0, rel=0.5)


def test_the_focus_is_held_where_it_was_when_the_lens_was_calibrated(opened):
    """Also where the driver rounds it to its steps."""
    fake = FakeWebcam()
    _, told = opened(fake, focus=33)
    assert told == []
    assert (fake.values[AUTO_FOCUS], fake.values[FOCUS]) == (0, 30)


def test_an_exposure_that_is_set_is_taken_as_it_is(opened):
    fake = FakeWebcam()
    _, told = opened(fake, exposure=300)
    assert told == []
    assert (fake.values[AUTO_EXPOSURE], fake.values[EXPOSURE]) == (1, 300)


def test_nothing_is_touched_where_locking_is_not_wanted(opened):
    fake = FakeWebcam()
    before = dict(fake.values)
    opened(fake, lock=False)
    assert fake.values == before


@pytest.mark.parametrize("how", ["stubborn", "refuses"])
@pytest.mark.parametrize(
    ("control", "words"),
    [
        (
            AUTO_EXPOSURE,
            "its exposure stays automatic; run "
            "'v4l2-ctl -d /dev/video0 -c auto_exposure=1,exposure_time_absolute=157'",
        ),
        (
            AUTO_WHITE,
            "its white balance stays automatic; run "
            "'v4l2-ctl -d /dev/video0 -c white_balance_automatic=0,white_balance_temperature=4600'",
        ),
        (
            AUTO_FOCUS,
            "its focus stays automatic; run "
            "'v4l2-ctl -d /dev/video0 -c focus_automatic_continuous=0,focus_absolute=0'",
        ),
    ],
)
def test_what_stays_automatic_is_told_with_the_exact_command(opened, how: str, control: int, words: str):
    _, told = opened(FakeWebcam(**{how: {control}}))
    assert told == [f"camera /dev/video0: {words}"]


@pytest.mark.parametrize(
    ("fake", "words"),
    [
        (FakeWebcam(hunts=0.08), r"its brightness varies by \d+ % though locked"),
        (FakeWebcam(reddens=0.015), r"its red varies by \d+ % though locked"),
    ],
)
def test_what_goes_on_changing_in_secret_is_seen_in_the_pictures(opened, fake: FakeWebcam, words: str):
    """All controls read back as they were set."""
    _, told = opened(fake)
    assert len(told) == 1
    assert re.search(words + "; with nothing moving before it, run 'v4l2-ctl -d /dev/video0 -c ", told[0])
    assert "auto_exposure=1,exposure_time_absolute=" in told[0]
    assert "white_balance_automatic=0,white_balance_temperature=4600,focus_auto" in told[0]


def test_a_camera_without_manual_exposure_is_told(opened):
    _, told = opened(FakeWebcam(lacks={AUTO_EXPOSURE, EXPOSURE}))
    assert told == [
        "camera /dev/video0: its exposure cannot be locked; keep the light even, or take another camera"
    ]


def test_a_camera_in_the_dark_is_told(opened):
    _, told = opened(FakeWebcam(light=1e-6))
    assert told == [
        "camera /dev/video0: its picture is dark; uncover the lens or make light, then start again"
    ]


def test_controls_that_cannot_be_reached_are_told(opened, monkeypatch: pytest.MonkeyPatch):
    def refuse(self: Driver) -> dict:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(Driver, "controls", refuse)
    _, told = opened(FakeWebcam())
    assert "its controls cannot be reached ([Errno 5] Input/output error)" in told[0]
    assert "'v4l2-ctl -d /dev/video0 -l'" in told[0]


OFFERS = "it offers MJPG 160x120 at 30, MJPG 320x180 at 60, YUYV 160x120 at 30: set webcam.width"


@pytest.mark.parametrize(
    ("fake", "config", "words"),
    [
        (FakeWebcam(codes=("YUYV",)), {}, "gives YUYV, not MJPG; " + OFFERS),
        (FakeWebcam(), {"width": 200, "height": 150}, "gives 160x120 px, not 200x150; " + OFFERS),
        (FakeWebcam(top_fps=15), {}, "gives 15 pictures a second, not 30; " + OFFERS),
        (
            FakeWebcam(top_fps=15, codes=("YUYV",)),
            {},
            "gives YUYV, not MJPG and 15 pictures a second, not 30; " + OFFERS,
        ),
    ],
)
def test_what_it_gives_instead_of_what_was_asked_is_told_with_all_it_offers(opened, fake, config, words: str):
    camera, told = opened(fake, None, **config)
    assert [text.split(" and fps")[0] for text in told] == [f"camera /dev/video0: {words}, height"]
    shot = camera.read()
    assert isinstance(shot.picture, bytes) == ("YUYV" not in words.split(";")[0])


def test_a_lens_asks_for_its_own_size_and_another_is_refused(opened):
    fake = FakeWebcam()
    _, told = opened(fake, Lens(320, 180, 300, 300, 160, 90))
    assert told == [] and fake.get(cv2.CAP_PROP_FRAME_WIDTH) == 320
    fake = FakeWebcam()
    with pytest.raises(DeviceError, match="delivers 320x180 px, the lens is for 640x480; calibrate at"):
        opened(fake, Lens(640, 480, 600, 600, 320, 240))
    assert fake.released


def test_a_camera_that_hands_over_no_jpeg_is_decoded_by_opencv(opened):
    camera, told = opened(FakeWebcam(raw=False))
    assert told == [
        "camera /dev/video0: hands over no JPEG of its own; OpenCV decodes, and it is recorded anew"
    ]
    shot = camera.read()
    assert isinstance(shot.picture, np.ndarray) and shot.picture.shape == (120, 160, 3)


@pytest.mark.parametrize(
    ("stamp_late_s", "words"), [(None, "there are none"), (1.7e9, "ahead of its picture's arrival")]
)
def test_times_of_a_driver_that_cannot_be_right_are_told_and_not_used(opened, stamp_late_s, words: str):
    camera, told = opened(FakeWebcam(stamp_late_s=stamp_late_s))
    assert len(told) == 1 and words in told[0]
    shot = camera.read()
    assert shot is not None and shot.t_s == pytest.approx(webcam.time.monotonic())


def test_pictures_that_come_too_slowly_are_told(opened):
    _, told = opened(FakeWebcam(slow=2.5))
    assert told == [
        "camera /dev/video0: 12 pictures a second come, not 30; give it more light or a socket of its own"
    ]


@pytest.mark.parametrize(
    ("fake", "words"),
    [
        (FakeWebcam(dies_after=0), "no picture within 5 s; pull its plug and put it back"),
        (FakeWebcam(dies_after=9), "stopped delivering while it was set up; check its cable"),
        (FakeWebcam(opens=False), "Some Webcam does not open; close the other program that has it ('fuser "),
        (FakeWebcam(opens=False, is_camera=False), "does not open as a camera (present: none); name another"),
    ],
)
def test_a_camera_that_does_not_work_is_told_with_a_remedy_and_let_go(opened, fake: FakeWebcam, words: str):
    with pytest.raises(DeviceError) as told:
        opened(fake)
    assert words in str(told.value)
    assert "\n" not in str(told.value)
    assert fake.released


def test_a_camera_that_may_not_be_opened_is_told_with_the_command(tmp_path: Path, monkeypatch):
    device = tmp_path / "video0"
    device.touch()
    monkeypatch.setattr(webcam.os, "access", lambda *_: False)
    with pytest.raises(DeviceError, match=r"no permission; run 'sudo usermod -aG video \$USER'"):
        open_webcam(device, None, WebcamConfig(), lambda _: None)


def test_a_device_that_is_no_camera_is_not_listed():
    assert cameras() == {device: name for device, name in cameras().items() if name}
    with Driver(Path("/dev/null")) as driver, pytest.raises(OSError):
        driver.card()


def test_a_camera_is_found_again_by_the_name_that_lasts(tmp_path: Path, monkeypatch):
    device, other = tmp_path / "video2", tmp_path / "video3"
    device.touch()
    other.touch()
    (tmp_path / "by-id").mkdir()
    (tmp_path / "by-id/usb-Some_Webcam-index0").symlink_to(device)
    monkeypatch.setattr(webcam, "BY_ID", str(tmp_path / "by-id"))
    assert lasting_path(device) == tmp_path / "by-id/usb-Some_Webcam-index0"
    assert lasting_path(other) == other


def test_a_webcam_that_is_plugged_in_anew_is_set_up_anew(monkeypatch: pytest.MonkeyPatch):
    """From /dev to frames, with a camera that dies and a second that comes in its place."""
    fakes = [FakeWebcam(dies_after=60), FakeWebcam()]
    waiting = list(fakes)
    current: list[FakeWebcam] = []

    def plug_in(*_: object) -> FakeWebcam:
        current.append(waiting.pop(0))
        return current[-1]

    monkeypatch.setattr(webcam.cv2, "VideoCapture", plug_in)
    monkeypatch.setattr(webcam, "Driver", lambda device: Driver(device, current[-1].ioctl))
    monkeypatch.setattr(webcam, "time", SimpleNamespace(monotonic=lambda: current[-1].arrived_s()))
    monkeypatch.setattr("host.camera.live.REOPEN_PERIOD_S", 0.05)
    told: list[str] = []
    camera = open_camera("/dev/null", LENS, tell=told.append)  # a device that can be opened
    until_s = time.monotonic() + 5
    while not told and time.monotonic() < until_s:
        with contextlib.suppress(DeviceError):
            camera.read(0.1)
    camera.close()
    assert told == ["camera /dev/null: delivers again"]
    assert all(fake.released and fake.values[AUTO_EXPOSURE] == 1 for fake in fakes)


HEADER = Path("/usr/include/linux/videodev2.h")


@pytest.mark.skipif(not (HEADER.exists() and shutil.which("cc")), reason="needs cc and the kernel's headers")
def test_numbers_and_sizes_are_those_of_the_kernels_header(tmp_path: Path):
    ours = {
        "VIDIOC_QUERYCAP": v4l2.QUERY_CAPABILITY, "VIDIOC_ENUM_FMT": v4l2.ENUMERATE_FORMATS,
        "VIDIOC_ENUM_FRAMESIZES": v4l2.ENUMERATE_SIZES, "VIDIOC_QUERYCTRL": v4l2.QUERY_CONTROL,
        "VIDIOC_ENUM_FRAMEINTERVALS": v4l2.ENUMERATE_INTERVALS, "VIDIOC_G_CTRL": v4l2.GET_CONTROL,
        "VIDIOC_S_CTRL": v4l2.SET_CONTROL, "sizeof(struct v4l2_capability)": v4l2.CAPABILITY.size,
        "sizeof(struct v4l2_fmtdesc)": v4l2.FORMAT.size, "sizeof(struct v4l2_frmsizeenum)": v4l2.SIZE.size,
        "sizeof(struct v4l2_frmivalenum)": v4l2.INTERVAL.size,
        "sizeof(struct v4l2_queryctrl)": v4l2.CONTROL.size, "sizeof(struct v4l2_control)": v4l2.VALUE.size,
        "V4L2_CTRL_FLAG_NEXT_CTRL": v4l2.NEXT_CONTROL,
        "V4L2_CTRL_FLAG_DISABLED": v4l2.DISABLED, "V4L2_CAP_VIDEO_CAPTURE": v4l2.CAN_CAPTURE,
        "V4L2_FRMSIZE_TYPE_DISCRETE": v4l2.DISCRETE, "V4L2_FRMIVAL_TYPE_DISCRETE": v4l2.DISCRETE,
        "V4L2_CID_EXPOSURE_AUTO": AUTO_EXPOSURE, "V4L2_CID_EXPOSURE_ABSOLUTE": EXPOSURE,
        "V4L2_CID_EXPOSURE_AUTO_PRIORITY": RATE_MAY_DROP, "V4L2_CID_AUTO_WHITE_BALANCE": AUTO_WHITE,
        "V4L2_CID_WHITE_BALANCE_TEMPERATURE": WHITE, "V4L2_CID_FOCUS_AUTO": AUTO_FOCUS,
        "V4L2_CID_FOCUS_ABSOLUTE": FOCUS, "V4L2_CID_GAIN": 0x00980913, "V4L2_CID_AUTOGAIN": 0x00980912,
        "V4L2_EXPOSURE_MANUAL": 1, "V4L2_EXPOSURE_APERTURE_PRIORITY": 3,
        "offsetof(struct v4l2_queryctrl, minimum)": 40, "offsetof(struct v4l2_queryctrl, flags)": 56,
        "offsetof(struct v4l2_capability, capabilities)": 84,
        "offsetof(struct v4l2_fmtdesc, pixelformat)": 44, "offsetof(struct v4l2_frmsizeenum, discrete)": 12,
        "offsetof(struct v4l2_frmivalenum, discrete)": 20,
    }  # fmt: skip
    source = tmp_path / "numbers.c"
    lines = "".join(f'printf("%lu\\n", (unsigned long)({name}));' for name in ours)
    includes = "#include <linux/videodev2.h>\n#include <stddef.h>\n#include <stdio.h>\n"
    source.write_text(f"{includes}int main(void) {{ {lines} }}")
    subprocess.run(["cc", "-o", tmp_path / "numbers", source], check=True)
    said = subprocess.run([tmp_path / "numbers"], capture_output=True, text=True, check=True).stdout
    assert dict(zip(ours, map(int, said.split()), strict=True)) == ours
