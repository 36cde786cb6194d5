"""From a camera's name to a source of frames: a webcam, a video file or a folder of images."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

from host.camera.frame import Frame, FrameSource
from host.camera.lens import Lens
from host.camera.lens_file import read_lens
from host.errors import DeviceError, InputError, UsageError
from host.record.image_file import read_image
from host.record.sequence import read_sequence

# The messages of OpenCV and FFmpeg go past Python; what matters in them is said in our words.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")
FOLDER_FPS = 15.0  # of a folder that does not tell its times
FIRST_FRAME_S = 5.0  # webcams take up to this long to deliver their first frame
KINDS = "a number for a webcam, /dev/videoN, a video file or a folder of images"


def open_camera(uri: str, lens: Lens | None = None) -> FrameSource:
    """Open the camera that `uri` names.

    Parameters
    ----------
    uri
        ``0`` or ``/dev/video0`` for a webcam, a video file, or a folder of images.
    lens
        Intrinsics; a folder's camera.json comes before it.

    Raises
    ------
    UsageError
        where `uri` names no kind of camera; the simulator has no camera of its own and is refused too.
    InputError
        where a file or folder is missing or damaged.
    DeviceError
        where a webcam does not open.
    """
    if uri.startswith("sim:"):
        raise UsageError(
            f"camera {uri}: the simulated camera rides on the simulated robot; use host.nav_loop"
        )
    if uri.isascii() and uri.isdigit():
        return _open_webcam(Path(f"/dev/video{uri}"), lens)
    path = Path(uri)
    if uri.startswith("/dev/"):
        return _open_webcam(path, lens)
    if os.path.isdir(path):  # Path.is_dir raises where a name is too long
        return ImageFolder(path, lens)
    if os.path.isfile(path):
        return VideoFile(path, lens)
    raise InputError(f"camera {uri}: no such file or folder; give {KINDS}")


class ImageFolder:
    """The images of a folder, each given once, in the order of their names or of poses.csv.

    A sequence folder is checked whole at opening and gives its own times; another is played at 15 frames/s.
    """

    def __init__(self, folder: Path, lens: Lens | None = None) -> None:
        if (folder / "poses.csv").exists():
            sequence = read_sequence(folder)
            self.lens: Lens | None = sequence.lens
            self._paths = [frame.path for frame in sequence.frames]
            self._times_s = [frame.pose.t_s for frame in sequence.frames]
        else:
            file = folder / "camera.json"
            self.lens = read_lens(file) if file.exists() else lens
            self._paths = sorted(p for p in folder.iterdir() if p.suffix.lower() in IMAGE_SUFFIXES)
            self._times_s = [k / FOLDER_FPS for k in range(len(self._paths))]
        if not self._paths:
            raise InputError(f"{folder}: holds no images; put PNG or JPEG files there")
        self._next = 0
        self._shape: tuple[int, ...] | None = None

    def read(self, timeout_s: float) -> Frame | None:
        """The next image; None after the last. Never waits.

        Raises
        ------
        InputError
            for a damaged image or one of another size than the lens or the first.
        """
        if self._next == len(self._paths):
            return None
        seq, self._next = self._next, self._next + 1
        path = self._paths[seq]
        image = read_image(path)
        expected = (self.lens.height, self.lens.width) if self.lens else self._shape or image.shape[:2]
        if image.shape[:2] != expected:
            raise InputError(
                f"{path}: image of {image.shape[1]}x{image.shape[0]} px where {expected[1]}x{expected[0]} "
                f"is expected; keep to one size in a folder"
            )
        self._shape = expected
        return Frame(image, self._times_s[seq], seq)

    def close(self) -> None:
        self._next = len(self._paths)


class VideoFile:
    """The frames of a video file, each given once, with the file's own times."""

    def __init__(self, path: Path, lens: Lens | None = None) -> None:
        self.lens = lens
        self._path = path
        self._capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
        self._seq = 0
        if not self._capture.isOpened():
            raise InputError(
                f"{path}: cannot be read as video; give one that FFmpeg plays, or a folder of images"
            )
        if lens is not None:
            size = tuple(
                int(self._capture.get(p)) for p in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
            )
            if size != (lens.width, lens.height):
                self._capture.release()
                raise InputError(
                    f"{path}: video of {size[0]}x{size[1]} px, the lens is of {lens.width}x{lens.height}; "
                    f"use the lens that was calibrated at the video's size"
                )

    def read(self, timeout_s: float) -> Frame | None:
        """The next frame; None after the last. Never waits.

        Raises
        ------
        InputError
            where not even a first frame can be decoded.
        """
        ok, image = self._capture.read()
        if not ok:
            if self._seq == 0:
                raise InputError(
                    f"{self._path}: no frame can be decoded; the video is damaged, copy it again"
                )
            return None
        t_s = (
            self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
        )  # of the frame just read only when asked after it
        frame = Frame(image, t_s, self._seq)
        self._seq += 1
        return frame

    def close(self) -> None:
        self._capture.release()


class Capture(Protocol):
    """What of cv2.VideoCapture a live camera needs."""

    def read(self) -> tuple[bool, np.ndarray | None]: ...

    def release(self) -> None: ...


class LiveCamera:
    """A camera that runs by itself: a thread takes every frame, the reader gets the newest.

    Times are those of the frame's arrival on the host's monotonic clock, later than its exposure by the
    camera's own delay.
    """

    def __init__(self, capture: Capture, name: str, lens: Lens | None = None) -> None:
        self.lens = lens
        self._capture = capture
        self._name = name
        self._news = threading.Condition()
        self._frame: Frame | None = None
        self._given = -1
        self._ended = False
        self._thread = threading.Thread(target=self._run, name=f"camera {name}", daemon=True)
        self._thread.start()

    def read(self, timeout_s: float) -> Frame | None:
        """The newest frame, each given once; its number jumps where frames were dropped. Never None.

        Raises
        ------
        DeviceError
            when no new frame came within the timeout or the camera is gone.
        """
        with self._news:
            self._news.wait_for(lambda: self._ended or self._fresh(), timeout_s)
            frame = self._fresh()
            if frame is not None:
                self._given = frame.seq
                return frame
            if self._ended:
                raise DeviceError(
                    f"camera {self._name}: stopped delivering; check its cable, then start again"
                )
            raise DeviceError(
                f"camera {self._name}: no frame for {timeout_s:g} s; check its cable, and that no other "
                f"program has it"
            )

    def close(self) -> None:
        with self._news:
            self._ended = True
        self._thread.join(timeout=1.0)  # a dead V4L2 camera blocks in its driver for up to 10 s
        if not self._thread.is_alive():
            self._capture.release()

    def _fresh(self) -> Frame | None:
        return self._frame if self._frame is not None and self._frame.seq > self._given else None

    def _run(self) -> None:
        seq = 0
        while not self._ended:
            ok, image = self._capture.read()
            t_s = time.monotonic()
            with self._news:
                if ok and image is not None:
                    self._frame = Frame(image, t_s, seq)
                    seq += 1
                else:
                    self._ended = True
                self._news.notify_all()


def _open_webcam(device: Path, lens: Lens | None) -> LiveCamera:
    if not device.exists():
        present = ", ".join(sorted(str(p) for p in Path("/dev").glob("video*"))) or "none"
        raise DeviceError(f"camera {device}: not there (present: {present}); plug it in or name another")
    if not os.access(device, os.R_OK | os.W_OK):
        raise DeviceError(
            f"camera {device}: no permission; run 'sudo usermod -aG video $USER' and log in again"
        )
    capture = cv2.VideoCapture(str(device), cv2.CAP_V4L2)
    # Asked for first: by itself OpenCV takes raw YUYV, which leaves a USB 2 camera few frames a second.
    capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))
    if lens is not None:
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, lens.width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, lens.height)
    if not capture.isOpened():
        raise DeviceError(f"camera {device}: does not open as a camera; close other programs or name another")
    camera = LiveCamera(capture, str(device), lens)
    try:
        first = camera.read(FIRST_FRAME_S)
    except DeviceError:
        camera.close()
        raise
    if lens is not None and first is not None and first.image.shape[:2] != (lens.height, lens.width):
        camera.close()
        raise DeviceError(
            f"camera {device}: delivers {first.image.shape[1]}x{first.image.shape[0]} px, the lens is for "
            f"{lens.width}x{lens.height}; calibrate at the size it delivers"
        )
    return camera
