"""Pictures from files: the images of a folder, or a video."""

from __future__ import annotations

import os
from pathlib import Path

import cv2

from host.camera.frame import Frame
from host.camera.lens import Lens
from host.camera.lens_file import read_lens
from host.errors import InputError
from host.record.image_file import read_image
from host.record.sequence import read_sequence

# The messages of FFmpeg go past Python; what matters in them is said in our words.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")
FOLDER_FPS = 15.0  # of a folder that does not tell its times


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
