"""From a camera's name to a source of frames: webcam, network camera, video, folder of images, recording."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import cv2

from host.camera.config import WebcamConfig
from host.camera.files import ImageFolder, VideoFile
from host.camera.frame import FrameSource
from host.camera.lens import Lens
from host.camera.live import Capture, LiveCamera
from host.camera.webcam import lasting_path, open_webcam
from host.errors import DeviceError, InputError, UsageError, tell

# The messages of OpenCV go past Python; what matters in them is said in our words.
LOG_ERRORS = 2
set_log_level = getattr(cv2, "setLogLevel", None) or cv2.utils.logging.setLogLevel  # of OpenCV 4, and of 5
set_log_level(LOG_ERRORS)

FIRST_FRAME_S = 5.0
VIDEO_DEVICES = Path("/sys/class/video4linux")
STREAMS = ("http://", "https://")
KINDS = (
    "a number for a webcam, /dev/videoN, http://... for an MJPEG stream, a video file, a folder of images or "
    "a recording .mcap"
)


def is_live(uri: str) -> bool:
    """Does the name stand for a camera whose pictures are of now? Not for the simulator's."""
    return (uri.isascii() and uri.isdigit()) or uri.startswith(("/dev/", *STREAMS))


def camera_name(uri: str) -> str | None:
    """What a webcam calls itself, which two of one make do alike; None where that is not known."""
    if not is_live(uri) or uri.startswith(STREAMS):
        return None
    device = Path(f"/dev/video{uri}" if uri.isdigit() else uri)
    try:
        text = (VIDEO_DEVICES / device.resolve().name / "name").read_text()
    except (OSError, UnicodeDecodeError):
        return None
    return text.strip() or None


def open_camera(
    uri: str,
    lens: Lens | None = None,
    config: WebcamConfig | None = None,
    tell: Callable[[str], None] = tell,
) -> FrameSource:
    """Open the camera that `uri` names.

    Parameters
    ----------
    uri
        ``0`` or ``/dev/video0`` for a webcam, ``http://...`` for an MJPEG stream, a video file, a folder of
        images, or a recording ``run.mcap``.
    lens
        Intrinsics; those of a folder's camera.json or of a recording come before it.
    config
        What a webcam is asked for.
    tell
        Hears in one line each what of a live camera is not as it should be, and how to change it.

    Raises
    ------
    UsageError
        where `uri` names no kind of camera; the simulator has no camera of its own and is refused too.
    InputError
        where a file or folder is missing or damaged.
    DeviceError
        where a live camera does not open, or delivers another size than the lens was calibrated for.
    """
    if uri.startswith("sim:"):
        raise UsageError(
            f"camera {uri}: the simulated camera rides on the simulated robot; use host.nav_loop"
        )
    if uri.startswith(STREAMS):
        from host.camera.stream import MjpegStream  # here, because HTTP takes a while to load

        return _live(uri, lens, lambda: MjpegStream(uri), lambda: MjpegStream(uri), tell)
    if is_live(uri):
        device = Path(uri if uri.startswith("/dev/") else f"/dev/video{uri}")
        lasting = lasting_path(device)  # found again by this where it is plugged in anew
        settings = config or WebcamConfig()
        return _live(
            str(device),
            lens,
            lambda: open_webcam(device, lens, settings, tell),
            lambda: open_webcam(lasting, lens, settings, tell),
            tell,
        )
    path = Path(uri)
    if os.path.isdir(path):  # Path.is_dir raises where a name is too long
        return ImageFolder(path, lens)
    if path.suffix == ".mcap":
        from host.record.playback import PlayedCamera  # here, because mcap takes a while to load

        return PlayedCamera(path)
    if os.path.isfile(path):
        return VideoFile(path, lens)
    raise InputError(f"camera {uri}: no such file or folder; give {KINDS}")


def _live(
    name: str,
    lens: Lens | None,
    open_first: Callable[[], Capture],
    open_again: Callable[[], Capture],
    tell: Callable[[str], None],
) -> LiveCamera:
    """With its first picture there, which `read` gives again."""
    camera = LiveCamera(open_first(), name, lens, open_again, tell)
    try:
        camera.await_first(FIRST_FRAME_S)
    except DeviceError:
        camera.close()
        raise
    return camera
