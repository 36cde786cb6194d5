"""What was recorded as an MCAP file with ROS 2 messages: topics, schemas, chunks, and an end that holds.

A chunk is written whole or not at all, so that a file that was never closed can be read up to its last chunk.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import zlib
from pathlib import Path
from typing import Any, NamedTuple

import cv2
from mcap.data_stream import RecordBuilder
from mcap.records import DataEnd, Footer
from mcap.writer import MCAP0_MAGIC
from mcap.writer import Writer as McapWriter

from host.camera.frame import Frame
from host.camera.lens import Lens
from host.errors import UsageError
from host.link.protocol import Telemetry
from host.nav.config import BodyConfig
from host.nav.odometry import body_of
from host.nav.pilot import View
from host.pose import Pose
from host.record import ros
from host.record.journal import LIBRARY, command_as_dict, made_as_dict, place_of, reading_as_dict

CHUNK_BYTES = 4_000_000  # a chunk is closed at the next message beyond
WHOLE_CHUNK = 1 << 40  # the library is never to close one by itself, amid a message's other half
BATTERY_NS = 10**9  # between two words of the battery

TOPICS = {
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


class Told(NamedTuple):
    """One thing to record."""

    kind: str
    t_ns: int  # wall clock
    what: Any


class Writer:
    """Writes what the recorder's queue holds; OSError where the disk does not take it.

    Raises
    ------
    UsageError
        The file exists already or cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = _File(path)
        self._mcap = McapWriter(self._file, chunk_size=WHOLE_CHUNK, enable_data_crcs=True)  # type: ignore[arg-type]
        self._channels: dict[str, int] = {}
        self._number = 0  # of messages in the file
        self._chunk_bytes = 0
        self._whole_bytes = 0  # of the file up to the last chunk
        self._frames = 0
        self.whole_frames = 0  # pictures in it up to there
        self._lens: Lens | None = None
        self._body = BodyConfig()
        self._battery_ns = -BATTERY_NS
        self._last_ns = 0

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return self._file.size

    # --- Messages -------------------------------------------------------------------------------

    def write(self, told: Told, wall_ns: int) -> None:
        """Write one thing down; `wall_ns` is the wall clock's time less the host clock's."""
        t_ns, what = told.t_ns, told.what
        match told.kind:
            case "begin":
                begin, toml, lens, body = what
                self._begin(t_ns, begin, toml, lens, body)
            case "entry":
                self._journal(t_ns, what)
            case "hear":
                self._journal(t_ns, reading_as_dict(what))
            case "frame":
                number, frame = what
                self._frame(t_ns, number, frame, wall_ns)
            case "made":
                self._journal(t_ns, made_as_dict(*what))
            case "decided":
                self._journal(t_ns, {"do": "decided", "command": command_as_dict(what)})
            case "drove":
                number, view, latency_ms, telemetry = what
                self._drove(t_ns, number, view, latency_ms, telemetry)
            case "rx" | "tx":
                self._message(f"/serial/{told.kind}", t_ns, ros.byte_array(what))
            case "event":
                level, name, text = what
                self._message("/events", t_ns, ros.log(t_ns, level, name, text))

    def _begin(self, t_ns: int, begin: dict[str, Any], toml: str, lens: Lens, body: BodyConfig) -> None:
        self._lens, self._body = lens, body
        self._journal(t_ns, begin)
        self._message("/config", t_ns, ros.string(toml))

    def _frame(self, t_ns: int, number: int, frame: Frame, wall_ns: int) -> None:
        stamp_ns = wall_ns + round(1e9 * frame.t_s)
        kind, data = "jpeg", frame.encoded
        if data is None:
            kind, data = "png", cv2.imencode(".png", frame.image)[1].tobytes()
        self._journal(
            t_ns,
            {
                "do": "frame",
                "frame": number,
                "seq": frame.seq,
                "t_s": frame.t_s,
                "pixels": zlib.crc32(frame.image.tobytes()),
            },
        )
        self._message(
            "/camera/image/compressed", t_ns, ros.compressed_image(stamp_ns, "camera_optical", kind, data)
        )
        self._frames += 1
        if self._lens is not None:
            info = ros.camera_info(stamp_ns, "camera_optical", self._lens)
            self._message("/camera/camera_info", t_ns, info)

    def _drove(
        self, t_ns: int, number: int, view: View, latency_ms: float, telemetry: Telemetry | None
    ) -> None:
        command = command_as_dict(view.command)
        entry = {"do": "drove", "frame": number, "command": command, "latency_ms": latency_ms}
        entry |= {"stage_ms": view.stage_ms, "odometry": place_of(view.dead_reckoning)}
        self._journal(t_ns, entry)
        v_m_s = omega_rad_s = 0.0
        if telemetry is not None:
            left, right = telemetry.speed_left_mm_s, telemetry.speed_right_mm_s
            v_m_s = (left + right) / 2e3
            omega_rad_s = (right - left) / (10 * self._body.track_cm)
            self._telemetry(t_ns, telemetry)
        stamp_ns = t_ns - round(1e6 * latency_ms)
        self._places(stamp_ns, t_ns, view, v_m_s, omega_rad_s)

    def _telemetry(self, t_ns: int, telemetry: Telemetry) -> None:
        self._journal(
            t_ns,
            {
                "do": "wheels",
                "state": telemetry.state.name,
                "fault": telemetry.fault.name,
                "speeds_mm_s": [telemetry.speed_left_mm_s, telemetry.speed_right_mm_s],
                "duties_permille": [telemetry.duty_left_permille, telemetry.duty_right_permille],
                "battery_mv": telemetry.battery_mv,
            },
        )
        if telemetry.battery_mv and t_ns - self._battery_ns >= BATTERY_NS:
            self._battery_ns = t_ns
            volts = telemetry.battery_mv / 1e3
            self._message("/battery", t_ns, ros.battery_state(t_ns, "base_link", volts))

    def _places(self, stamp_ns: int, t_ns: int, view: View, v_m_s: float, omega_rad_s: float) -> None:
        body = self._body
        rolled, best = view.dead_reckoning, view.pose
        in_odom, in_map = (_axle(pose, body.camera_ahead_cm) for pose in (rolled, best))
        sigma_m, frames = rolled.sigma_z_cm / 100, ("odom", "base_link")
        odometry = ros.odometry(stamp_ns, frames, in_odom, sigma_m, rolled.sigma_rot_rad, v_m_s, omega_rad_s)
        self._message("/odom", t_ns, odometry)
        correction = in_map.of(in_odom.inverse())
        camera = ros.Place(body.camera_ahead_cm / 100, 0.0, 0.0, body.camera_height_cm / 100)
        links = [
            ("map", "odom", correction, correction.quaternion),
            ("odom", "base_link", in_odom, in_odom.quaternion),
            ("base_link", "camera_optical", camera, ros.OPTICAL),
        ]
        self._message("/tf", t_ns, ros.transforms(stamp_ns, links))

    def _journal(self, t_ns: int, entry: dict[str, Any]) -> None:
        self._message("/journal", t_ns, ros.string(json.dumps(entry, separators=(",", ":"))))

    def _message(self, topic: str, t_ns: int, data: bytes) -> None:
        if not self._channels:
            self._open_channels()
        self._mcap.add_message(self._channels[topic], t_ns, data, t_ns, self._number)
        self._number = (self._number + 1) & 0xFFFF_FFFF
        self._last_ns = t_ns
        self._chunk_bytes += len(data)
        if self._chunk_bytes > CHUNK_BYTES:
            self.flush()

    def _open_channels(self) -> None:
        self._mcap.start(profile="ros2", library=LIBRARY)
        schemas = {
            name: self._mcap.register_schema(name, "ros2msg", text.encode())
            for name, text in ros.DEFINITIONS.items()
        }
        for topic, name in TOPICS.items():
            self._channels[topic] = self._mcap.register_channel(topic, "cdr", schemas[name])

    # --- The file -------------------------------------------------------------------------------

    def flush(self) -> None:
        """Put all that was written so far into the file, as a whole chunk."""
        if self._channels:
            self._mcap.flush()
            self._chunk_bytes = 0
            self._whole_bytes = self._file.size
            self.whole_frames = self._frames

    def finish(self, end: dict[str, Any], begun: bool) -> None:
        """Write the last entry and the index, and close; a file that nothing began in stays as it is."""
        if begun:
            self._journal(self._last_ns, end)
            self.flush()
            self._mcap.finish()
        self._file.close()

    def abandon(self) -> None:
        """Leave a file that ends after its last whole chunk, closed as well as may be."""
        with contextlib.suppress(OSError), contextlib.closing(self._file):
            self._file.cut(self._whole_bytes)
            if not self._whole_bytes:
                return
            end = RecordBuilder()
            DataEnd(0).write(end)
            Footer(summary_start=0, summary_offset_start=0, summary_crc=0).write(end)
            self._file.write(end.end() + MCAP0_MAGIC)

    def discard(self) -> None:
        """As if it had never been."""
        self._file.close()
        with contextlib.suppress(OSError):
            self._path.unlink()


class _File:
    """A new file that is written to without a buffer of our own: what it took is in the system's hands."""

    def __init__(self, path: Path) -> None:
        try:
            if not path.parent.exists():
                path.parent.mkdir(parents=True)
            self._handle: int | None = os.open(
                path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666
            )
        except FileExistsError:
            raise UsageError(
                f"{path}: exists already, and a recording is never written over; name another file"
            ) from None
        except OSError as error:
            raise UsageError(f"{path}: cannot be written ({error.strerror}); choose another place") from None
        self.size = 0

    def write(self, data: bytes) -> int:
        rest = memoryview(data)
        while rest:
            if self._handle is None:
                raise OSError("the file is closed")
            written = os.write(self._handle, rest)
            self.size += written
            rest = rest[written:]
        return len(data)

    def tell(self) -> int:
        return self.size

    def flush(self) -> None:
        pass

    def cut(self, size: int) -> None:
        if self._handle is not None:
            os.ftruncate(self._handle, size)
            os.lseek(self._handle, size, os.SEEK_SET)
            self.size = size

    def close(self) -> None:
        if self._handle is not None:
            handle, self._handle = self._handle, None
            os.close(handle)


def _axle(camera: Pose, ahead_cm: float) -> ros.Place:
    """The axle's middle behind a camera's pose, on ROS's axes."""
    x_cm, z_cm, heading = body_of(camera, ahead_cm)
    return ros.Place(z_cm / 100, -x_cm / 100, math.remainder(-heading, math.tau))
