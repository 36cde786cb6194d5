"""The ROS 2 messages of a recording: their definitions, and their bytes as ROS 2 sends them (CDR).

Written here and not by a general encoder, which takes an image byte by byte. Lengths are in metres and axes
as ROS has them: x ahead, y left, z up; for a camera x right, y down, z ahead.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass

from host.camera.lens import Lens

ENCAPSULATION = b"\x00\x01\x00\x00"  # CDR, little endian
INFO, WARN, ERROR = 20, 30, 40  # levels of rcl_interfaces/msg/Log

TIME = "int32 sec\nuint32 nanosec\n"
HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
VECTOR = "float64 x\nfloat64 y\nfloat64 z\n"
QUATERNION = "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
POSE = "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
TWIST = "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"

_HEADERS = (("std_msgs/Header", HEADER), ("builtin_interfaces/Time", TIME))


def _definition(text: str, *parts: tuple[str, str]) -> str:
    """A message's definition with those of the messages in it."""
    return ("=" * 80 + "\n").join([text, *(f"MSG: {name}\n{part}" for name, part in parts)])


DEFINITIONS = {
    "std_msgs/msg/String": "string data\n",
    "std_msgs/msg/UInt8MultiArray": _definition(
        "std_msgs/MultiArrayLayout layout\nuint8[] data\n",
        ("std_msgs/MultiArrayLayout", "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n"),
        ("std_msgs/MultiArrayDimension", "string label\nuint32 size\nuint32 stride\n"),
    ),
    "rcl_interfaces/msg/Log": _definition(
        "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\n"
        "string function\nuint32 line\n",
        ("builtin_interfaces/Time", TIME),
    ),
    "sensor_msgs/msg/CompressedImage": _definition(
        "std_msgs/Header header\nstring format\nuint8[] data\n", *_HEADERS
    ),
    "sensor_msgs/msg/CameraInfo": _definition(
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\n"
        "float64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\n"
        "sensor_msgs/RegionOfInterest roi\n",
        *_HEADERS,
        (
            "sensor_msgs/RegionOfInterest",
            "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n",
        ),
    ),
    "sensor_msgs/msg/BatteryState": _definition(
        "std_msgs/Header header\nfloat32 voltage\nfloat32 temperature\nfloat32 current\nfloat32 charge\n"
        "float32 capacity\nfloat32 design_capacity\nfloat32 percentage\nuint8 power_supply_status\n"
        "uint8 power_supply_health\nuint8 power_supply_technology\nbool present\nfloat32[] cell_voltage\n"
        "float32[] cell_temperature\nstring location\nstring serial_number\n",
        *_HEADERS,
    ),
    "nav_msgs/msg/Odometry": _definition(
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
        "geometry_msgs/TwistWithCovariance twist\n",
        *_HEADERS,
        ("geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance\n"),
        ("geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist twist\nfloat64[36] covariance\n"),
        ("geometry_msgs/Pose", POSE),
        ("geometry_msgs/Twist", TWIST),
        ("geometry_msgs/Point", VECTOR),
        ("geometry_msgs/Vector3", VECTOR),
        ("geometry_msgs/Quaternion", QUATERNION),
    ),
    "tf2_msgs/msg/TFMessage": _definition(
        "geometry_msgs/TransformStamped[] transforms\n",
        (
            "geometry_msgs/TransformStamped",
            "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
        ),
        *_HEADERS,
        (
            "geometry_msgs/Transform",
            "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
        ),
        ("geometry_msgs/Vector3", VECTOR),
        ("geometry_msgs/Quaternion", QUATERNION),
    ),
}


class _Writer:
    """CDR bytes: every number lies at a multiple of its size."""

    def __init__(self) -> None:
        self._out = bytearray()

    def number(self, kind: str, *values: float) -> None:
        size = struct.calcsize(kind)
        self._out += bytes(-len(self._out) % size)
        self._out += struct.pack(f"<{len(values)}{kind}", *values)

    def text(self, text: str) -> None:
        self.data(text.encode() + b"\0")

    def data(self, data: bytes) -> None:
        self.number("I", len(data))
        self._out += data

    def header(self, stamp_ns: int, frame: str) -> None:
        self.stamp(stamp_ns)
        self.text(frame)

    def stamp(self, stamp_ns: int) -> None:
        seconds, rest = divmod(stamp_ns, 10**9)
        self.number("i", seconds)
        self.number("I", rest)

    def bytes(self) -> bytes:
        return ENCAPSULATION + bytes(self._out)


class _Reader:
    """The inverse; struct.error where the bytes end too early."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = memoryview(data)[len(ENCAPSULATION) :], 0

    def number(self, kind: str) -> int:
        size = struct.calcsize(kind)
        self._at += -self._at % size
        (value,) = struct.unpack_from(f"<{kind}", self._data, self._at)
        self._at += size
        return value

    def data(self) -> bytes:
        length = self.number("I")
        if self._at + length > len(self._data):
            raise struct.error("cut short")
        self._at += length
        return bytes(self._data[self._at - length : self._at])

    def text(self) -> str:
        return self.data().rstrip(b"\0").decode()

    def stamp(self) -> int:
        return self.number("i") * 10**9 + self.number("I")


@dataclass(frozen=True)
class Place:
    """Where one frame lies in another, on the floor but for its height: metres and radians, turned left."""

    x_m: float
    y_m: float
    yaw_rad: float
    z_m: float = 0.0

    def of(self, other: Place) -> Place:
        """What `other`, given in this frame, is in this one's own."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        x, y = c * other.x_m - s * other.y_m, s * other.x_m + c * other.y_m
        return Place(self.x_m + x, self.y_m + y, self.yaw_rad + other.yaw_rad, self.z_m + other.z_m)

    def inverse(self) -> Place:
        """This one's own frame as seen from here."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        x, y = -c * self.x_m - s * self.y_m, s * self.x_m - c * self.y_m
        return Place(x, y, -self.yaw_rad, -self.z_m)

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """(x, y, z, w)."""
        return 0.0, 0.0, math.sin(self.yaw_rad / 2), math.cos(self.yaw_rad / 2)


OPTICAL = (-0.5, 0.5, -0.5, 0.5)  # quaternion that turns ROS's axes of a body into those of a camera


def string(text: str) -> bytes:
    """A std_msgs/String."""
    out = _Writer()
    out.text(text)
    return out.bytes()


def read_string(data: bytes) -> str:
    """The text of a std_msgs/String."""
    return _Reader(data).text()


def byte_array(data: bytes) -> bytes:
    """A std_msgs/UInt8MultiArray without a layout."""
    out = _Writer()
    out.number("I", 0, 0)
    out.data(data)
    return out.bytes()


def read_byte_array(data: bytes) -> bytes:
    """The bytes of a std_msgs/UInt8MultiArray without a layout."""
    reader = _Reader(data)
    _dimensions, _offset = reader.number("I"), reader.number("I")
    return reader.data()


def log(stamp_ns: int, level: int, name: str, text: str) -> bytes:
    """A rcl_interfaces/Log."""
    out = _Writer()
    out.stamp(stamp_ns)
    out.number("B", level)
    for part in (name, text, "", ""):
        out.text(part)
    out.number("I", 0)
    return out.bytes()


def read_log(data: bytes) -> tuple[int, int, str, str]:
    """(stamp in ns, level, name, text) of a rcl_interfaces/Log."""
    reader = _Reader(data)
    return reader.stamp(), reader.number("B"), reader.text(), reader.text()


def compressed_image(stamp_ns: int, frame: str, kind: str, data: bytes) -> bytes:
    """A sensor_msgs/CompressedImage; `kind` is jpeg or png."""
    out = _Writer()
    out.header(stamp_ns, frame)
    out.text(kind)
    out.data(data)
    return out.bytes()


def read_compressed_image(data: bytes) -> tuple[int, str, bytes]:
    """(stamp in ns, kind, file's bytes) of a sensor_msgs/CompressedImage."""
    reader = _Reader(data)
    stamp_ns, _ = reader.stamp(), reader.text()
    return stamp_ns, reader.text(), reader.data()


def camera_info(stamp_ns: int, frame: str, lens: Lens) -> bytes:
    """A sensor_msgs/CameraInfo."""
    out = _Writer()
    out.header(stamp_ns, frame)
    out.number("I", lens.height, lens.width)
    out.text("plumb_bob")
    out.number("I", len(lens.distortion))
    out.number("d", *lens.distortion)
    fx, fy, cx, cy = lens.fx, lens.fy, lens.cx, lens.cy
    out.number("d", fx, 0, cx, 0, fy, cy, 0, 0, 1)
    out.number("d", 1, 0, 0, 0, 1, 0, 0, 0, 1)
    out.number("d", fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0)
    out.number("I", 0, 0, 0, 0, 0, 0)
    out.number("B", 0)
    return out.bytes()


def battery_state(stamp_ns: int, frame: str, voltage_v: float) -> bytes:
    """A sensor_msgs/BatteryState of which nothing but the voltage is known."""
    out = _Writer()
    out.header(stamp_ns, frame)
    out.number("f", voltage_v, *[math.nan] * 6)
    out.number("B", 0, 0, 0, 1)
    out.number("I", 0, 0)
    out.text("")
    out.text("")
    return out.bytes()


def odometry(
    stamp_ns: int,
    frames: tuple[str, str],
    place: Place,
    sigma_m: float,
    sigma_rad: float,
    v_m_s: float,
    omega_rad_s: float,
) -> bytes:
    """A nav_msgs/Odometry on the floor; `frames` are the one it is in and the one that moves."""
    out = _Writer()
    out.header(stamp_ns, frames[0])
    out.text(frames[1])
    out.number("d", place.x_m, place.y_m, place.z_m, *place.quaternion)
    out.number("d", *_covariance(sigma_m, sigma_rad))
    out.number("d", v_m_s, 0, 0, 0, 0, omega_rad_s)
    out.number("d", *[0.0] * 36)
    return out.bytes()


def _covariance(sigma_m: float, sigma_rad: float) -> list[float]:
    out = [0.0] * 36
    out[0] = out[7] = sigma_m**2
    out[35] = sigma_rad**2
    return out


def transforms(
    stamp_ns: int,
    links: Sequence[tuple[str, str, Place, tuple[float, float, float, float]]],
) -> bytes:
    """A tf2_msgs/TFMessage of links (frame, its child, where that lies, how it is turned)."""
    out = _Writer()
    out.number("I", len(links))
    for frame, child, place, quaternion in links:
        out.header(stamp_ns, frame)
        out.text(child)
        out.number("d", place.x_m, place.y_m, place.z_m, *quaternion)
    return out.bytes()
