"""A webcam that is not there: what OpenCV and the kernel's interface show of it, and the light it sees."""

from __future__ import annotations

import errno
import functools
from dataclasses import dataclass, field

import cv2
import numpy as np
from pictures import image

from host.camera import v4l2

AUTO_EXPOSURE, EXPOSURE, RATE_MAY_DROP = 0x009A0901, 0x009A0902, 0x009A0903
AUTO_WHITE, WHITE = 0x0098090C, 0x0098091A
GAIN = 0x00980913
AUTO_FOCUS, FOCUS = 0x009A090C, 0x009A090A
NAMES = {
    AUTO_WHITE: b"White Balance, Automatic", GAIN: b"Gain", WHITE: b"White Balance Temperature",
    AUTO_EXPOSURE: b"Auto Exposure", EXPOSURE: b"Exposure Time, Absolute",
    RATE_MAY_DROP: b"Exposure, Dynamic Framerate", FOCUS: b"Focus, Absolute",
    AUTO_FOCUS: b"Focus, Automatic Continuous",
}  # fmt: skip
MODES = {b"YUYV": {(160, 120): (30, 15)}, b"MJPG": {(160, 120): (30, 15), (320, 180): (60, 30)}}
STEPS = {FOCUS: 5}  # others go by 1


@functools.cache
def scene_of(width: int, height: int) -> np.ndarray:
    return image(1, width, height).astype(np.float32)


def fourcc(code: str) -> int:
    return cv2.VideoWriter.fourcc(*code)


@dataclass
class FakeWebcam:
    """One object for both: `video()` for OpenCV's side, `ioctl` for the kernel's.

    How bright its pictures are depends on light and controls, as with a real one.
    """

    light: float = 1.0
    stubborn: set[int] = field(default_factory=set)  # controls that stay as they are, saying nothing
    refuses: set[int] = field(default_factory=set)  # those that answer with an error
    lacks: set[int] = field(default_factory=set)
    hunts: float = 0.0  # its brightness goes up and down by this share, whatever its controls say
    reddens: float = 0.0  # its red grows by this share with every picture
    exposure_of_long_ago: int | None = None  # what it goes back to without automatic
    sizes: tuple[tuple[int, int], ...] = ((160, 120), (320, 180))
    codes: tuple[str, ...] = ("YUYV", "MJPG")
    top_fps: float = 30.0
    stamp_late_s: float | None = -0.03  # the driver's time against the arrival; None: it has none
    raw: bool = True  # hands JPEGs over when asked
    opens: bool = True
    is_camera: bool = True
    dies_after: int | None = None  # pictures
    slow: float = 1.0  # times come that much further apart than agreed

    def __post_init__(self) -> None:
        self.values = {
            AUTO_EXPOSURE: 3, EXPOSURE: 157, RATE_MAY_DROP: 1, AUTO_WHITE: 1, WHITE: 4600, GAIN: 10,
            AUTO_FOCUS: 1, FOCUS: 32,
        }  # fmt: skip
        for control in self.lacks:
            del self.values[control]
        self.count = 0
        self.released = False
        self.properties = {
            cv2.CAP_PROP_FOURCC: float(fourcc(self.codes[0])), cv2.CAP_PROP_FRAME_WIDTH: 160.0,
            cv2.CAP_PROP_FRAME_HEIGHT: 120.0, cv2.CAP_PROP_FPS: self.top_fps, cv2.CAP_PROP_CONVERT_RGB: 1.0,
        }  # fmt: skip
        self.asked_size = [160, 120]

    # --- OpenCV's side -------------------------------------------------------------------------

    def isOpened(self) -> bool:
        return self.opens

    def set(self, number: int, value: float) -> bool:
        if number == cv2.CAP_PROP_FOURCC and value not in map(fourcc, self.codes):
            return False
        if number in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT):
            self.asked_size[number == cv2.CAP_PROP_FRAME_HEIGHT] = int(value)
            width, height = min(self.sizes, key=lambda size: abs(size[0] - self.asked_size[0]))
            self.properties[cv2.CAP_PROP_FRAME_WIDTH] = float(width)
            self.properties[cv2.CAP_PROP_FRAME_HEIGHT] = float(height)
            return True
        self.properties[number] = min(value, self.top_fps) if number == cv2.CAP_PROP_FPS else value
        return True

    def get(self, number: int) -> float:
        if number == cv2.CAP_PROP_POS_MSEC:
            return 0.0 if self.stamp_late_s is None else 1e3 * (self.arrived_s() + self.stamp_late_s)
        return self.properties.get(number, 0.0)

    def arrived_s(self) -> float:
        """When the last picture came: the only clock here."""
        return 1000.0 + self.count * self.slow / self.properties[cv2.CAP_PROP_FPS]

    def read(self) -> tuple[bool, np.ndarray | None]:
        self.count += 1
        if self.dies_after is not None and self.count > self.dies_after:
            return False, None
        if self.values.get(AUTO_EXPOSURE) != 1:
            self.sensor_exposure = 157 / self.light
        elif self.exposure_of_long_ago is not None and self.values[EXPOSURE] == 157:
            self.sensor_exposure = self.exposure_of_long_ago
        else:
            self.sensor_exposure = self.values[EXPOSURE]
        width = int(self.properties[cv2.CAP_PROP_FRAME_WIDTH])
        height = int(self.properties[cv2.CAP_PROP_FRAME_HEIGHT])
        bright = (self.light * self.sensor_exposure / 157) ** 0.5 * (1 + self.hunts * (self.count % 3 - 1))
        if self.light < 0.01:
            bright = 0.0
        red = 1 + self.reddens * (self.count % 12)
        scene = scene_of(width, height) * (bright * np.array([1, 1, red], np.float32))
        picture = np.clip(scene, 0, 255).astype(np.uint8)
        picture[0, :, 0] = (np.arange(width) * (7 + self.count)).astype(np.uint8)  # no two are the same
        is_jpeg = self.properties[cv2.CAP_PROP_FOURCC] == fourcc("MJPG")
        if is_jpeg and not self.properties[cv2.CAP_PROP_CONVERT_RGB]:
            raw = cv2.imencode(".jpg", picture)[1].reshape(1, -1)
            return True, raw if self.raw else np.zeros((1, 500), np.uint8)
        return True, picture

    def release(self) -> None:
        self.released = True

    # --- The kernel's side ---------------------------------------------------------------------

    def ioctl(self, file: int, request: int, buffer: bytearray) -> int:
        if request == v4l2.QUERY_CAPABILITY:
            if not self.is_camera:
                raise OSError(errno.ENOTTY, "Inappropriate ioctl for device")
            buffer[:] = v4l2.CAPABILITY.pack(b"uvcvideo", b"Some Webcam", b"usb-1", 0, 1, 1)
        elif request == v4l2.ENUMERATE_FORMATS:
            index = v4l2.FORMAT.unpack(buffer)[0]
            buffer[:] = v4l2.FORMAT.pack(index, 1, 0, b"", self._nth(list(MODES), index))
        elif request == v4l2.ENUMERATE_SIZES:
            index, code = v4l2.SIZE.unpack(buffer)[:2]
            buffer[:] = v4l2.SIZE.pack(index, code, 1, *self._nth(list(MODES[code]), index))
        elif request == v4l2.ENUMERATE_INTERVALS:
            index, code, width, height = v4l2.INTERVAL.unpack(buffer)[:4]
            fps = self._nth(MODES[code][width, height], index)
            buffer[:] = v4l2.INTERVAL.pack(index, code, width, height, 1, 1, fps)
        elif request == v4l2.QUERY_CONTROL:
            asked = v4l2.CONTROL.unpack(buffer)[0] & 0x7FFF_FFFF
            number = self._nth(sorted(number for number in self.values if number > asked), 0)
            buffer[:] = v4l2.CONTROL.pack(number, 1, NAMES[number], 0, 10_000, STEPS.get(number, 1), 0, 0)
        elif request == v4l2.GET_CONTROL:
            number, _ = v4l2.VALUE.unpack(buffer)
            buffer[:] = v4l2.VALUE.pack(number, self.values[number])
        elif request == v4l2.SET_CONTROL:
            number, value = v4l2.VALUE.unpack(buffer)
            if number in self.refuses:
                raise OSError(errno.EINVAL, "Invalid argument")
            if number not in self.stubborn:
                self.values[number] = value - value % STEPS.get(number, 1)
        else:
            raise OSError(errno.ENOTTY, "Inappropriate ioctl for device")
        return 0

    @staticmethod
    def _nth(values, index: int):
        if index >= len(values):
            raise OSError(errno.EINVAL, "Invalid argument")
        return values[index]
