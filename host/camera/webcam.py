"""A webcam on Linux: JPEG, size and rate agreed on, the driver's times taken, what is automatic locked."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

from host.by_id import lasting_names
from host.camera.config import WebcamConfig
from host.camera.jpeg import START, decode_jpeg, whole_jpeg
from host.camera.lens import Lens
from host.camera.live import Shot
from host.camera.lock import hold_still
from host.camera.stamps import Stamps
from host.camera.v4l2 import Driver, Mode
from host.errors import DeviceError

# Read by OpenCV at its first picture: without it a camera that hangs is waited for ten seconds.
os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")

BY_ID = "/dev/v4l/by-id"
JPEG_CODE = "MJPG"
FIRST_PICTURE_S = 5.0  # webcams take up to this long
RATE_PICTURES = 8
SLOW = 0.7  # of the rate that was agreed
MODES_TOLD = 12

Tell = Callable[[str], None]


class Video(Protocol):
    """What of cv2.VideoCapture a webcam needs."""

    def isOpened(self) -> bool: ...
    def set(self, propId: int, value: float, /) -> bool: ...
    def get(self, propId: int, /) -> float: ...
    def read(self) -> tuple[bool, np.ndarray | None]: ...
    def release(self) -> None: ...


class Webcam:
    """An open webcam; a ``host.camera.live.Capture``."""

    def __init__(self, video: Video, stamps: Stamps) -> None:
        self._video, self._stamps = video, stamps

    def read(self) -> Shot | None:
        """The next picture; None where none comes within a second or the camera is gone."""
        try:
            ok, raw = self._video.read()
        except cv2.error:
            return None
        arrived_s = time.monotonic()
        if not ok or raw is None:
            return None
        taken_s = self._stamps.taken_s(self._video.get(cv2.CAP_PROP_POS_MSEC) / 1e3, arrived_s)
        return Shot(raw if raw.ndim == 3 else raw.tobytes(), taken_s)

    def release(self) -> None:
        """Let go of it."""
        self._video.release()


def cameras() -> dict[Path, str]:
    """The cameras of this machine by device, with their names; not the nodes that take no pictures."""
    out = {}
    for device in sorted(Path("/dev").glob("video*")):
        try:
            with Driver(device) as driver:
                out[device] = driver.card()
        except OSError:
            continue
    return out


def lasting_path(device: Path) -> Path:
    """The camera's name below /dev/v4l/by-id, which it keeps when it is plugged in anew; else `device`."""
    return Path(lasting_names(BY_ID).get(os.path.realpath(device), device))


def open_webcam(device: Path, lens: Lens | None, config: WebcamConfig, tell: Tell) -> Webcam:
    """Open a webcam, agree with it on size and rate, and hold still what it does by itself.

    Parameters
    ----------
    device
        Such as /dev/video0.
    lens
        Its size is asked for and must be had; without one, that of `config`, or else what the camera gives.
    tell
        Hears in one line each what is not as asked, and how to change that.

    Raises
    ------
    DeviceError
        It is not there, may not be opened, takes no pictures, or not of the lens's size.
    """
    _check_there(device)
    video: Video = cv2.VideoCapture(str(device), cv2.CAP_V4L2)
    try:
        if not video.isOpened():
            raise DeviceError(_why_not_open(device))
        _agree(video, device, lens, config, tell)
        webcam = Webcam(video, Stamps(str(device), tell))
        _first_picture(webcam, video, device, lens, tell)
        if config.lock:
            _lock(webcam, device, config, tell)
        _check_rate(webcam, video, device, tell)
        return webcam
    except BaseException:
        video.release()
        raise


def _check_there(device: Path) -> None:
    if not device.exists():
        raise DeviceError(f"camera {device}: not there ({_present()}); plug it in or name another")
    if not os.access(device, os.R_OK | os.W_OK):
        raise DeviceError(
            f"camera {device}: no permission; run 'sudo usermod -aG video $USER' and log in again"
        )


def _present() -> str:
    return "present: " + (", ".join(f"{device} {name}" for device, name in cameras().items()) or "none")


def _why_not_open(device: Path) -> str:
    try:
        with Driver(device) as driver:
            name = driver.card()
    except OSError:
        return f"camera {device}: does not open as a camera ({_present()}); name another"
    return (
        f"camera {device}: {name} does not open; close the other program that has it "
        f"('fuser {device}' tells which)"
    )


def _agree(video: Video, device: Path, lens: Lens | None, config: WebcamConfig, tell: Tell) -> None:
    """Ask for format, size and rate, and read back what became of it."""
    width, height = (config.width, config.height) if lens is None else (lens.width, lens.height)
    # First, since by itself OpenCV takes raw YUYV, which leaves a USB 2 camera few pictures a second.
    video.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*JPEG_CODE))
    video.set(cv2.CAP_PROP_FRAME_WIDTH, width)
    video.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
    video.set(cv2.CAP_PROP_FPS, config.fps)
    code = int(video.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little").decode("latin-1")
    if code == JPEG_CODE:
        video.set(cv2.CAP_PROP_CONVERT_RGB, 0)  # the JPEG itself, to be recorded as it is
    got = [int(video.get(p)) for p in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)]
    fps = video.get(cv2.CAP_PROP_FPS)
    differing = []
    if code != JPEG_CODE:
        differing.append(f"{code.strip(chr(0)) or 'an unknown format'}, not {JPEG_CODE}")
    if got != [width, height]:
        differing.append(f"{got[0]}x{got[1]} px, not {width}x{height}")
    if abs(fps - config.fps) > 0.5:
        differing.append(f"{fps:g} pictures a second, not {config.fps:g}")
    if differing:
        tell(f"camera {device}: gives {' and '.join(differing)}; {_offers(device)}")


def _offers(device: Path) -> str:
    """The modes in words."""
    try:
        with Driver(device) as driver:
            modes: list[Mode] = driver.modes()
    except OSError:
        modes = []
    if not modes:
        return f"'v4l2-ctl -d {device} --list-formats-ext' tells what it offers"
    modes.sort(key=lambda mode: mode.code != JPEG_CODE)
    more = f" and {len(modes) - MODES_TOLD} more" if len(modes) > MODES_TOLD else ""
    return f"it offers {', '.join(map(str, modes[:MODES_TOLD]))}{more}: set webcam.width, height and fps"


def _first_picture(webcam: Webcam, video: Video, device: Path, lens: Lens | None, tell: Tell) -> None:
    """Wait for it; see that it is a JPEG where raw bytes come, and of the lens's size."""
    give_up_s = time.monotonic() + FIRST_PICTURE_S
    image = None
    while image is None and time.monotonic() < give_up_s:
        shot = webcam.read()
        if shot is not None and isinstance(shot.picture, bytes) and not shot.picture.startswith(START):
            video.set(cv2.CAP_PROP_CONVERT_RGB, 1)
            tell(f"camera {device}: hands over no JPEG of its own; OpenCV decodes, and it is recorded anew")
            continue
        image = None if shot is None else decoded(shot)
    if image is None:
        raise DeviceError(
            f"camera {device}: no picture within {FIRST_PICTURE_S:g} s; pull its plug and put it back, and "
            f"see that no other program has it"
        )
    height, width = image.shape[:2]
    if lens is not None and (width, height) != (lens.width, lens.height):
        raise DeviceError(
            f"camera {device}: delivers {width}x{height} px, the lens is for {lens.width}x{lens.height}; "
            f"calibrate at the size it delivers"
        )


def decoded(shot: Shot) -> np.ndarray | None:
    """The image of a shot; None where it is damaged."""
    if not isinstance(shot.picture, bytes):
        return shot.picture
    whole = whole_jpeg(shot.picture)
    return None if whole is None else decode_jpeg(whole)


def _lock(webcam: Webcam, device: Path, config: WebcamConfig, tell: Tell) -> None:
    def take() -> np.ndarray:
        for _ in range(3):  # one may be damaged
            shot = webcam.read()
            image = None if shot is None else decoded(shot)
            if image is not None:
                return image
        raise DeviceError(f"camera {device}: stopped delivering while it was set up; check its cable")

    try:
        with Driver(device) as driver:
            hold_still(driver, take, device, config, tell)
    except OSError as error:
        tell(
            f"camera {device}: its controls cannot be reached ({error}); lock exposure, white balance and "
            f"focus with 'v4l2-ctl -d {device} -l' and '-c'"
        )


def _check_rate(webcam: Webcam, video: Video, device: Path, tell: Tell) -> None:
    times_s = [shot.t_s for _ in range(RATE_PICTURES) if (shot := webcam.read()) is not None]
    agreed = video.get(cv2.CAP_PROP_FPS)
    if len(times_s) < 2 or times_s[-1] <= times_s[0]:
        return
    rate = (len(times_s) - 1) / (times_s[-1] - times_s[0])
    if rate < SLOW * agreed:
        tell(
            f"camera {device}: {rate:.0f} pictures a second come, not {agreed:.0f}; give it more light or a "
            f"socket of its own"
        )
