"""The visit: part after part, what can be tried is tried; one that fails spares those that need it."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from host.config import Config
from host.doctor.finding import Finding, Outcome, Part
from host.doctor.installation import SET_UP, check_installation
from host.doctor.person import AtTerminal, Person, says_yes
from host.errors import RobotError, UsageError

if TYPE_CHECKING:  # so that --help need not wait for OpenCV
    from host.camera.config import WebcamConfig
    from host.camera.frame import FrameSource
    from host.camera.lens import Lens
    from host.doctor.camera import Taken
    from host.doctor.robot import Heard
    from host.link.bench.target import Target
    from host.link.clock import Clock
    from host.link.parameters import Param
    from host.link.robot import Robot

RUNS = Path("runs")
WEBCAM = Path("/dev/video0")
NOMINAL_FPS = 15.0


@dataclass(frozen=True)
class DoctorOptions:
    """Look for what is wrong with installation, camera, robot, wheels, calibration and timing."""

    camera: str | None = None
    """a webcam's number or device, video, folder or sim:room?seed=N; else /dev/video0 if there is one"""
    robot: str | None = None  # a port such as /dev/ttyACM0, auto to look for it, or sim:
    lens: Path | None = None  # camera.json of that camera
    wheels_up: bool = False  # the wheels are off the floor and free: turn them without asking
    by_hand: bool = False  # you turn the wheels instead of the motors
    json: Path | None = None  # write the findings to this file

    def __post_init__(self) -> None:
        if self.by_hand and self.wheels_up:
            raise UsageError("--by-hand and --wheels-up exclude each other: give one")
        if self.by_hand and self.robot is None:
            raise UsageError("--by-hand needs --robot: name the port, such as /dev/ttyACM0")


@dataclass
class Known:
    """What later parts need of earlier ones."""

    taken: list[Taken] = field(default_factory=list)
    hz: float | None = None
    lens: Lens | None = None
    camera_name: str | None = None  # as it calls itself
    values: dict[Param, int] | None = None
    timing: list[Finding] = field(default_factory=list)  # of the link, shown with the rest of the timing


def visit(options: DoctorOptions, config: Config, person: Person | None = None) -> list[Finding]:
    """All findings, in the order in which to mend what is wrong."""
    person = person or AtTerminal()
    findings = _all_of("installation", check_installation(RUNS))
    known = Known()
    findings += _all_of("camera", look_at_camera(options, config, known))
    findings += _all_of("robot", look_at_robot(options, person, known))
    findings += _all_of("calibration", look_at_calibration(options, config, known))
    findings += _all_of("timing", look_at_timing(config, known))
    return findings


def look_at_camera(options: DoctorOptions, config: Config, known: Known) -> Iterator[Finding]:
    """Open it and watch it for two seconds."""
    from host.camera.source import camera_name
    from host.doctor.camera import check_driver, check_pictures, rate_hz, take_pictures

    part, uri = Part("camera"), options.camera
    if uri is None and WEBCAM.exists():
        uri = str(WEBCAM)
    if uri is None:
        yield part.untried("all", "no camera here; name one with --camera")
        return
    said: list[str] = []
    webcam = _of_lens_size(config.webcam, options.lens)
    try:
        with _open_camera(uri, webcam, said.append) as (camera, clock, live):
            taken, ended = take_pictures(camera, clock)
            known.taken, known.hz = taken, rate_hz(taken) if live else NOMINAL_FPS
            known.lens, known.camera_name = camera.lens, camera_name(uri)
    except RobotError as error:
        yield part.error("open", error)
        return
    yield part.ok("open", uri)
    yield from check_driver(said)
    yield from check_pictures(taken, ended, live)


def _of_lens_size(webcam: WebcamConfig, lens_file: Path | None) -> WebcamConfig:
    """Asked for the size that the lens was calibrated at; whether it is had is seen with the calibration."""
    from host.camera.lens_file import read_lens

    try:
        lens = None if lens_file is None else read_lens(lens_file)
    except RobotError:  # which is told with the calibration
        lens = None
    return webcam if lens is None else replace(webcam, width=lens.width, height=lens.height)


def look_at_robot(options: DoctorOptions, person: Person, known: Known) -> Iterator[Finding]:
    """Port, handshake, firmware, line, battery; then the wheels, if they may turn."""
    from host.doctor import robot as checks
    from host.link.bench.target import open_target
    from host.link.robot import Robot

    part, uri = Part("robot"), options.robot
    if uri is None:
        yield part.untried("all", _ports_here())
        yield Part("wheels").untried("all", "no robot was named")
        return
    simulated = _simulated(uri)
    unseen = Part("wheels").untried("all", "no robot answered")
    if not simulated and uri != "auto" and (missing := checks.check_port(uri)) is not None:
        yield from (missing, unseen)
        return
    seen, what = False, "port"
    try:
        with open_target(uri) as target:
            robot = Robot(target.near, target.clock)
            yield part.ok("port", "simulated" if simulated else f"{target.uri} opens")
            what = "link"
            hello, finding = checks.connect(target, robot)
            yield finding
            if hello is not None:
                with robot:
                    yield checks.check_firmware(hello, target.uri, simulated, checks.sources_build_id())
                    yield checks.check_start(hello)
                    assert robot.latest is not None, "connect waits for it"
                    yield checks.check_fault(robot.latest)
                    heard = checks.listen(target, robot)
                    yield checks.check_line(heard)
                    known.timing = _link_timing(robot, heard)
                    known.values = robot.read_params()
                    yield checks.check_battery(heard.reports, known.values)
                    seen = True
                    yield from look_at_wheels(options, person, target, robot, simulated, known.values)
    except RobotError as error:
        yield part.error(what, error)
    if not seen:
        yield unseen


def look_at_wheels(
    options: DoctorOptions,
    person: Person,
    target: Target,
    robot: Robot,
    simulated: bool,
    values: dict[Param, int],
) -> Iterator[Finding]:
    """Turned by the motors where that is safe, by a person where they want to."""
    from host.doctor import wheels

    part = Part("wheels")
    if options.by_hand:
        if not person.there:
            yield part.untried("by hand", "nobody at a terminal to turn them")
            return
        yield from wheels.check_by_hand(person, robot)
        return
    if not (simulated or options.wheels_up):
        if not person.there:
            yield part.untried("motors", "put the robot on blocks, wheels free, then add --wheels-up")
            return
        question = "The wheels will turn. Is the robot on blocks, all wheels free of the floor? [yes/no]"
        if not says_yes(person.ask(question, robot.poll)):
            yield part.untried("motors", "the wheels are not up, as you say; --by-hand drives nothing")
            return
    try:
        if (unready := wheels.check_ready(robot, target.clock)) is not None:
            yield unready
            return
        findings, pulses = wheels.check_driven(robot, target.clock, values)
        yield from findings
        if not simulated and all(f.outcome != Outcome.FAIL for f in findings):
            yield wheels.check_sides_seen(person, robot, target.clock, values)
        yield wheels.check_sag([report for one in pulses for report in one.reports])
    except RobotError as error:
        yield part.error("motors", error)


def look_at_calibration(options: DoctorOptions, config: Config, known: Known) -> Iterator[Finding]:
    """Lens, wheels, and whether they agree."""
    from host.doctor import calibration as checks

    part = Part("calibration")
    image = known.taken[0].frame.image if known.taken else None
    size = None if image is None else (image.shape[1], image.shape[0])
    if options.lens is not None:
        finding, known.lens = checks.check_lens_file(options.lens, size, known.camera_name)
        yield finding
    elif known.lens is not None:
        yield checks.check_lens(known.lens, "the camera's own", size)
    else:
        yield part.untried(
            "lens", "name camera.json with --lens; 'python -m host.calibrate camera' makes one"
        )
    if known.values is None:
        yield part.untried("wheels", "no robot answered")
        return
    yield checks.check_parameters(known.values)
    yield checks.check_body(known.values, config.body)


def look_at_timing(config: Config, known: Known) -> Iterator[Finding]:
    """This computer, and what it shares a clock with."""
    from host.camera.lens import Lens
    from host.doctor import timing as checks

    yield checks.check_pauses(checks.measure_pauses())
    if len(known.taken) < 3 or known.hz is None:
        yield Part("timing").untried("picture time", "no pictures to try it with")
    else:
        height, width = known.taken[0].frame.image.shape[:2]
        lens = known.lens
        if lens is None or (lens.width, lens.height) != (width, height):
            lens = Lens(width, height, width, width, (width - 1) / 2, (height - 1) / 2)
        frames = [one.frame for one in known.taken]
        yield checks.check_frame_time(checks.time_frames(frames, lens, config.net, config.depth), known.hz)
    yield from known.timing or [Part("timing").untried("link", "no robot answered")]


def _simulated(robot: str) -> bool:
    from host.sim.kinds import is_simulated

    return is_simulated(robot)


def _link_timing(robot: Robot, heard: Heard) -> list[Finding]:
    from host.doctor.timing import check_clocks, check_round_trip

    return [check_round_trip(heard.echoes), check_clocks(heard.echoes, robot.host_time_s)]


@contextlib.contextmanager
def _open_camera(
    uri: str, webcam: WebcamConfig, tell: Callable[[str], None]
) -> Iterator[tuple[FrameSource, Clock, bool]]:
    """(camera, its clock, whether its pictures come by themselves); closed at the end."""
    if uri.startswith("sim:"):
        from host.sim.session import Simulation

        simulation = Simulation(uri)
        yield simulation.camera, simulation.clock, True
        return
    from host.camera.source import is_live, open_camera
    from host.link.clock import SystemClock

    camera = open_camera(uri, config=webcam, tell=tell)
    try:
        yield camera, SystemClock(), is_live(uri)
    finally:
        camera.close()


def _ports_here() -> str:
    from host.link.ports import list_devices

    ports = ", ".join(map(str, list_devices())) or "no serial port"
    return f"none was named; here: {ports}; name one with --robot, or --robot auto"


def _all_of(part: str, findings: Iterator[Finding]) -> list[Finding]:
    """The findings of a part, also where it cannot go on; who watches sees what is being looked at."""
    if sys.stderr.isatty():
        print(f"looking at the {part} ...", file=sys.stderr, flush=True)
    out: list[Finding] = []
    try:
        for finding in findings:
            out.append(finding)
    except ImportError as error:
        out.append(Part(part).fail("library", f"{error.name or error} not found", SET_UP))
    return out
