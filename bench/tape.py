"""What reaches the loop in a simulated drive, taped in memory and played back without the simulator.

Pictures, the line's bytes and the times between are the same to the bit as often as they are played, so the
loop does the same each time, and what differs is what the machine does besides.
"""

from __future__ import annotations

import pickle
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from unittest.mock import patch

from bench.memory import peak_kb
from host.camera.frame import Frame, FrameSource
from host.camera.lens import Lens
from host.config import Config
from host.errors import DeviceError
from host.link.clock import Clock
from host.link.robot import Robot
from host.link.transport import Transport
from host.nav.drive import drive
from host.nav.pilot import Pilot, View
from host.nav.result import DriveLog
from host.nav.task import Route
from host.sim.rolling import parse_uri
from host.sim.scenes import world_from_uri
from host.sim.session import Simulation


@dataclass
class Tape:
    """One drive, from connecting to its end."""

    lens: Lens
    goal_cm: tuple[float, float]
    begun_s: float
    pictures: list[tuple[Frame | str | None, float]] = field(default_factory=list)  # or why none; time after
    received: list[bytes] = field(default_factory=list)  # by each look at the line
    slept: list[float] = field(default_factory=list)  # times after


class _TapingClock:
    def __init__(self, clock: Clock, tape: Tape):
        self._clock, self._tape = clock, tape

    def now_s(self) -> float:
        return self._clock.now_s()

    def sleep_s(self, duration_s: float) -> None:
        self._clock.sleep_s(duration_s)
        self._tape.slept.append(self._clock.now_s())


class _TapingLine:
    def __init__(self, line: Transport, tape: Tape):
        self._line, self._tape = line, tape
        self.write, self.close = line.write, line.close

    def read(self) -> bytes:
        self._tape.received.append(self._line.read())
        return self._tape.received[-1]


class _TapingCamera:
    def __init__(self, camera: FrameSource, clock: Clock, tape: Tape):
        self._camera, self._clock, self._tape = camera, clock, tape
        self.lens, self.close = camera.lens, camera.close

    def read(self, timeout_s: float) -> Frame | None:
        try:
            frame = self._camera.read(timeout_s)
        except DeviceError as error:
            self._tape.pictures.append((str(error), self._clock.now_s()))
            raise
        self._tape.pictures.append((frame, self._clock.now_s()))
        return frame


class _TapedClock:
    def __init__(self, tape: Tape):
        self.time_s = tape.begun_s
        self._slept = iter(tape.slept)

    def now_s(self) -> float:
        return self.time_s

    def sleep_s(self, duration_s: float) -> None:
        self.time_s = next(self._slept)


class _TapedLine:
    def __init__(self, tape: Tape):
        self._received = iter(tape.received)
        self.written_s = 0.0  # when something was last sent, by the thread's own clock

    def write(self, data: bytes) -> None:
        self.written_s = time.thread_time()

    def read(self) -> bytes:
        return next(self._received, b"")

    def close(self) -> None:
        pass


class _TapedCamera:
    def __init__(self, tape: Tape, clock: _TapedClock):
        self._pictures, self._clock = iter(tape.pictures), clock
        self.lens: Lens | None = tape.lens
        self.given_s = 0.0  # when the last picture was handed over, by the thread's own clock

    def read(self, timeout_s: float) -> Frame | None:
        picture, self._clock.time_s = next(self._pictures)
        if isinstance(picture, str):
            raise DeviceError(picture)
        self.given_s = time.thread_time()
        return picture

    def close(self) -> None:
        pass


def record(camera_uri: str, robot_uri: str, longest_s: float) -> tuple[Tape, DriveLog]:
    """Drive to the world's own goal, in the simulator."""
    world = world_from_uri(camera_uri)
    assert world.goal_cm is not None, camera_uri
    avr, seed, body = parse_uri(robot_uri, world.seed)
    simulation = Simulation(camera_uri, body=body, body_seed=seed, avr=avr)
    tape = Tape(world.lens, world.goal_cm, simulation.clock.now_s())
    clock = _TapingClock(simulation.clock, tape)
    camera = _TapingCamera(simulation.camera, clock, tape)
    return tape, _drive(
        _TapingLine(simulation.transport, tape), clock, camera, tape, longest_s, lambda view: None
    )


def play(tape: Tape, longest_s: float) -> tuple[list[dict[str, float]], DriveLog]:
    """The loop on a tape; for each picture driven on the processor's ms by stage, and of the whole.

    ``command`` is from the picture until its command was sent, ``all`` until everything was noted as well.
    """
    clock = _TapedClock(tape)
    camera, line = _TapedCamera(tape, clock), _TapedLine(tape)
    rows: list[dict[str, float]] = []

    def on_view(view: View) -> None:
        times = {"command": line.written_s, "all": time.thread_time()}
        since = {name: 1e3 * (s - camera.given_s) for name, s in times.items()}
        rows.append({**view.stage_ms, **since})

    # other programs on the machine must not count as time of a stage
    with patch("time.perf_counter", time.thread_time):
        log = _drive(line, clock, camera, tape, longest_s, on_view)
    return rows, log


def _drive(
    line: Transport,
    clock: Clock,
    camera: FrameSource,
    tape: Tape,
    longest_s: float,
    on_view: Callable[[View], None],
) -> DriveLog:
    config = Config()
    with Robot(line, clock) as robot:
        robot.connect()
        task = Route([tape.goal_cm])
        pilot = Pilot(tape.lens, task, net=config.net, depth=config.depth, body=config.body, nav=config.nav)
        log, _ = drive(
            camera, robot, clock, pilot, config.nav, longest_s, 1e9, lambda view, log: on_view(view)
        )
    return log


if __name__ == "__main__":  # peak memory of one play, told by a process that does nothing else
    with open(sys.argv[1], "rb") as file:
        taped = pickle.load(file)
    before_kb = peak_kb()
    play(taped, float(sys.argv[2]))
    print((peak_kb() - before_kb) / 1024)
