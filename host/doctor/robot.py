"""Who is on the other end of the line: port, handshake, firmware, the line itself, the battery."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from host.doctor.finding import Finding, Part
from host.doctor.installation import ROOT
from host.errors import DeviceError
from host.link.bench.frames import Frame
from host.link.bench.target import Target
from host.link.explain import FAULTS, RESETS
from host.link.parameters import Param
from host.link.protocol import (
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    Fault,
    Hello,
    Ping,
    Pong,
    ResetCause,
    State,
    Telemetry,
)
from host.link.robot import Robot

LISTENED_S = 1.0
LOOK_S = 0.0005
TELEMETRY_HZ = 100.0
LATE_SHARE = 0.1
BROKEN_SHARE = 0.001  # of frames; a good line breaks none
LOW_MV = 300  # above the minimum, with a few minutes left
PART = Part("robot")


@dataclass
class Heard:
    """What came while the line was listened to."""

    seconds: float = 0.0
    reports: list[Telemetry] = field(default_factory=list)
    echoes: list[tuple[float, float, int]] = field(default_factory=list)  # sent, heard, robot's clock
    broken: int = 0  # frames of either direction, since connecting
    frames: int = 0


def listen(target: Target, robot: Robot, seconds: float = LISTENED_S) -> Heard:
    """Let the robot talk for a while; moves nothing."""
    heard, sent_s = Heard(), dict[int, float]()

    def see(frame: Frame) -> None:
        match frame.message:
            case Ping():
                sent_s[frame.message.host_time_us] = frame.t_s
            case Pong() if frame.message.host_time_us in sent_s:
                sent = sent_s.pop(frame.message.host_time_us)
                heard.echoes.append((sent, frame.t_s, frame.message.mcu_time_us))

    target.near.on_frame.append(see)
    try:
        robot.poll()
        begin_s = target.clock.now_s()
        while target.clock.now_s() < begin_s + seconds:
            target.wait_s(LOOK_S)
            heard.reports += robot.poll()
        heard.seconds = target.clock.now_s() - begin_s
    finally:
        target.near.on_frame.remove(see)
    ours, theirs = robot.counters, robot.robot_counters
    for counters in (ours, theirs):
        if counters is not None:
            heard.broken += (
                counters.crc + counters.framing + counters.overlong + counters.length + counters.lost
            )
            heard.frames += counters.frames
    return heard


def check_port(uri: str, permitted: bool | None = None) -> Finding | None:
    """Is the port there, and may it be opened? None where it is, since opening it tells more.

    Parameters
    ----------
    permitted
        Instead of asking the system, which refuses its administrator nothing.
    """
    from host.link.serial_port import why_not_open

    if not os.path.exists(uri):
        return PART.error("port", DeviceError(why_not_open(uri, FileNotFoundError(2, "not there"))))
    if not (os.access(uri, os.R_OK | os.W_OK) if permitted is None else permitted):
        return PART.error("port", DeviceError(why_not_open(uri, PermissionError(13, "forbidden"))))
    return None


def connect(target: Target, robot: Robot) -> tuple[Hello | None, Finding]:
    """Handshake: who answers, and what to make of it."""
    offers: list[Hello] = []

    def see(frame: Frame) -> None:
        if isinstance(frame.message, Hello):
            offers.append(frame.message)

    target.near.on_frame.append(see)
    try:
        hello = robot.connect()
    except DeviceError as error:
        spoken = [(one.protocol_version, one.schema_hash) for one in offers[-1:]]
        if spoken and spoken != [(PROTOCOL_VERSION, SCHEMA_HASH)]:
            return None, PART.fail(
                "firmware",
                f"it speaks protocol {spoken[0][0]}, schema {spoken[0][1]:08x}, not "
                f"{PROTOCOL_VERSION}, {SCHEMA_HASH:08x}",
                f"flash the firmware that belongs to this program: 'make flash PORT={target.uri}'",
            )
        heard = target.near.bytes_to_host
        if heard and not target.near.to_host.counters.frames:
            return None, PART.fail(
                "handshake",
                f"{heard} bytes came, and no frame of our protocol",
                f"is this the robot's port? If it is: 'make flash PORT={target.uri}'",
            )
        return None, PART.error("handshake", error)
    finally:
        target.near.on_frame.remove(see)
    return hello, PART.ok("handshake", f"{target.uri} answers, start {hello.boot_nonce:08x}")


def check_firmware(hello: Hello, port: str, simulated: bool, sources: int | None) -> Finding:
    """Was it built from these sources? `sources` is their build id, None where they are not here."""
    told = f"protocol {hello.protocol_version}, schema {hello.schema_hash:08x}, build {hello.build_id:08x}"
    fix = f"'make flash PORT={port}', and both are the same"
    if hello.build_id == 0:
        if simulated:
            return PART.ok("firmware", f"protocol {hello.protocol_version}, compiled for the simulator")
        return PART.warn("firmware", f"{told}: nobody knows from which sources", fix)
    if sources is not None and hello.build_id != sources:
        return PART.warn("firmware", f"{told}, but the sources here are {sources:08x}", fix)
    return PART.ok("firmware", told if sources is None else f"{told}, that of the sources here")


def sources_build_id(root: Path = ROOT) -> int | None:
    """Build id of the firmware's sources in this checkout; None where they are not here."""
    script = root / "firmware" / "build_id.py"
    if not script.exists():
        return None
    spec = importlib.util.spec_from_file_location("build_id", script)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.build_id(root / "firmware")


def check_start(hello: Hello) -> Finding:
    """Why did the robot start last?"""
    if hello.reset_cause == ResetCause.BROWN_OUT:
        return PART.warn(
            "last start", "its voltage had broken down", "charge the battery, check USB cable and plugs"
        )
    if hello.reset_cause == ResetCause.WATCHDOG:
        return PART.warn("last start", "its program had hung", "if it comes again, report it")
    return PART.ok("last start", RESETS[hello.reset_cause])


def check_fault(latest: Telemetry) -> Finding:
    """Does it complain?"""
    if latest.state != State.FAULT:
        return PART.ok("state", latest.state.name)
    what, _, fix = FAULTS[latest.fault].partition(": ")
    make = PART.warn if latest.fault == Fault.LINK_LOST else PART.fail
    return make("state", f"{latest.fault.name}: {what}", fix)


def check_line(heard: Heard) -> Finding:
    """Does all that is sent arrive, in time?"""
    hz = len(heard.reports) / heard.seconds if heard.seconds else 0.0
    told = f"{hz:.0f} reports a second, {heard.broken} of {heard.frames} frames broken or lost"
    fix = "shorten the cable, keep it away from the motors' wires, then 'python -m host.link.bench soak'"
    if hz < (1 - 3 * LATE_SHARE) * TELEMETRY_HZ or heard.broken > 0.05 * max(heard.frames, 1):
        return PART.fail("line", told, fix)
    if hz < (1 - LATE_SHARE) * TELEMETRY_HZ or heard.broken > BROKEN_SHARE * max(heard.frames, 1):
        return PART.warn("line", told, fix)
    return PART.ok("line", told)


def check_battery(reports: list[Telemetry], values: Mapping[Param, int]) -> Finding:
    """Is there power for the motors?"""
    if not reports:
        return PART.untried("battery", "no report came")
    mv, least_mv = reports[-1].battery_mv, values[Param.BATTERY_MIN_MV]
    told = f"{mv / 1000:.2f} V, it stops below {least_mv / 1000:.2f} V"
    if mv == 0:
        return PART.warn(
            "battery", "it is not measured", "wire it to A4 through two resistors, as docs/hardware.md shows"
        )
    if mv < 1000:
        return PART.fail(
            "battery",
            f"{mv / 1000:.2f} V: the motors have no power",
            "put the cells in, check fuse and switch",
        )
    if mv < least_mv:
        return PART.fail("battery", told, "charge the battery")
    if mv < least_mv + LOW_MV:
        return PART.warn("battery", told, "charge the battery soon")
    return PART.ok("battery", told)
