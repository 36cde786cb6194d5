"""The loop: newest picture, fresh wheel readings, one command; and what ends it or makes it stand still."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable

from host.camera.frame import Frame, FrameSource
from host.errors import EXIT_DEVICE, EXIT_DONE, EXIT_INTERRUPTED, EXIT_SAFETY, DeviceError
from host.link.clock import Clock
from host.link.protocol import Fault, State
from host.link.robot import Robot
from host.nav.config import NavConfig
from host.nav.odometry import WheelReading
from host.nav.pilot import Pilot, View
from host.nav.result import DriveLog, LostAndFound
from host.nav.steer import Command
from host.nav.watch import FrameWatch

CLEARS_ALLOWED = 5  # a robot that stops itself more often than this has a reason
RECONNECTIONS_ALLOWED = 5  # and so has a line that is lost more often
LISTEN_S = 0.005
BLIND_S = 3.0  # no picture to drive on for this long ends the drive


class _Ended(Exception):
    """The drive is over: outcome, reason, exit code."""

    def __init__(self, outcome: str, reason: str, code: int = EXIT_DONE):
        super().__init__(reason)
        self.outcome, self.reason, self.code = outcome, reason, code


def drive(
    camera: FrameSource,
    robot: Robot,
    clock: Clock,
    pilot: Pilot,
    config: NavConfig,
    max_time_s: float,
    max_wall_s: float,
    on_view: Callable[[View, DriveLog], None],
    bound_for: bool = True,
) -> tuple[DriveLog, int]:
    """Drive until something ends it; the motors are stopped before anything else happens then.

    A robot that is unplugged or restarts stands; where it can be connected again, the drive goes on.

    Parameters
    ----------
    robot : with an open session.
    max_time_s : by the clock given.
    max_wall_s : by the wall's, against a simulation that is slow on this machine.
    on_view : told of every frame that was driven on.
    bound_for : there is a place to get to; running out of time then means not to be there.

    Returns
    -------
    (log, exit code)
    """
    log = DriveLog()
    trip = _Trip(camera, robot, clock, pilot, config, log, on_view)
    begin_s, begin_wall_s = clock.now_s(), time.monotonic()
    code = EXIT_DONE
    late = "not there after" if bound_for else "ended after"
    try:
        trip.await_wheels()
        while True:
            try:
                trip.one_frame(begin_s)
            except DeviceError:
                if robot.connected:
                    raise
                trip.reconnect(begin_s)
            if clock.now_s() - begin_s >= max_time_s:
                raise _Ended("timeout", f"{late} {max_time_s:g} s")
            if time.monotonic() - begin_wall_s >= max_wall_s:
                raise _Ended("timeout", f"{late} {max_wall_s:g} s of real time: the machine is slow")
    except _Ended as end:
        stop_motors(robot)
        log.end(end.outcome, end.reason)
        code = end.code
    except DeviceError as error:
        stop_motors(robot)
        log.end("stopped", str(error))
        code = EXIT_DEVICE
    except KeyboardInterrupt:
        stop_motors(robot)
        log.end("stopped", "interrupted")
        code = EXIT_INTERRUPTED
    except BaseException:
        stop_motors(robot)
        raise
    log.duration_s = clock.now_s() - begin_s
    log.decide(log.duration_s, 0.0, 0.0, f"{log.outcome}: {log.reason}")
    return log, code


def stop_motors(robot: Robot) -> None:
    """Brake; where the line is gone the robot's own dead-man does it."""
    with contextlib.suppress(DeviceError):
        robot.stop()


class _Trip:
    """What one pass of the loop needs from the last."""

    def __init__(self, camera, robot, clock, pilot, config, log, on_view):
        self.camera: FrameSource = camera
        self.robot: Robot = robot
        self.clock: Clock = clock
        self.pilot: Pilot = pilot
        self.config: NavConfig = config
        self.log: DriveLog = log
        self.on_view: Callable[[View, DriveLog], None] = on_view
        self.watch = FrameWatch(config)
        self.last_seq: int | None = None
        self.seeing_s: float | None = None  # when there last was a picture to drive on

    def await_wheels(self) -> None:
        """Hear from the wheels before the first picture; `poll` complains of a robot that stays silent."""
        while self.pilot.odometry.newest_s == -math.inf:
            self.clock.sleep_s(LISTEN_S)
            self._listen()

    def one_frame(self, begin_s: float) -> None:
        """Newest picture in, one command out, or a stop with its reason."""
        frame, objection = self._newest_frame()
        self._listen()
        now_s = self.clock.now_s()
        if self.seeing_s is None:
            self.seeing_s = now_s
        if frame is not None:
            objection = self.watch.objection(frame, now_s, self.pilot.odometry.rolled_cm)
        if objection is None and now_s - self.pilot.odometry.newest_s > self.config.link_stale_s:
            objection = "no fresh word from the wheels"
        if frame is None or objection is not None:
            self._refuse(now_s, begin_s, objection or "no picture")
            return
        self.seeing_s = now_s

        began = time.perf_counter()
        view = self.pilot.take(frame, now_s)
        self.log.frame_ms.append(1e3 * (time.perf_counter() - began))
        command = view.command
        late_s = self.clock.now_s() - frame.t_s
        if late_s > self.config.frame_stale_s:
            self._refuse(now_s, begin_s, f"picture took {1000 * late_s:.0f} ms to understand")
            return
        if command.outcome is not None:
            self.robot.stop()
        elif not command.hands_off:
            self.robot.drive(command.v_mm_s, command.omega_rad_s)
        self._note(view, now_s - begin_s, command)
        if command.outcome is not None:
            raise _Ended(command.outcome, command.reason)

    def reconnect(self, begin_s: float) -> None:
        """Stand until the lost robot is back, then go on; where it is not, DeviceError."""
        log = self.log
        if len(log.reconnections) >= RECONNECTIONS_ALLOWED:
            raise DeviceError(f"the robot was lost more than {RECONNECTIONS_ALLOWED} times: check its cable")
        back = self.robot.reconnect()
        if back.restarted:
            self.pilot.odometry.restart()
        t_s = self.clock.now_s() - begin_s
        log.reconnections.append(LostAndFound(round(t_s, 3), round(back.away_s, 3), back.restarted, back.why))
        log.decide(t_s, 0.0, 0.0, f"stop: {back}")
        self.seeing_s = self.last_seq = None  # it was the robot that was away, not the camera

    def _newest_frame(self) -> tuple[Frame | None, str | None]:
        """(frame, None), or (None, why there is none)."""
        try:
            frame = self.camera.read(self.config.frame_stale_s)
        except DeviceError as error:
            return None, str(error)
        if frame is None:
            raise _Ended("stopped", "the camera has no more pictures")
        if self.last_seq is not None:
            self.log.dropped_frames += max(0, frame.seq - self.last_seq - 1)
        self.last_seq = frame.seq
        self.log.frames += 1
        return frame, None

    def _listen(self) -> None:
        """Wheel readings into the odometry; a robot that stopped itself is asked why."""
        for report in self.robot.poll():
            t_s = self.robot.host_time_s(report.mcu_time_us)
            self.pilot.odometry.add(WheelReading.of(report, t_s))
        latest = self.robot.latest
        if latest is None or latest.state != State.FAULT:
            return
        why = latest.fault.name.lower().replace("_", " ")
        if latest.fault != Fault.LINK_LOST or self.log.faults_cleared >= CLEARS_ALLOWED:
            raise _Ended("stopped", f"the robot stopped itself: {why}", EXIT_SAFETY)
        self.robot.clear()
        self.log.faults_cleared += 1

    def _refuse(self, now_s: float, begin_s: float, objection: str) -> None:
        """Stand still; after a while of this give up."""
        self.robot.stop()
        self.log.refused_frames += 1
        self.log.decide(now_s - begin_s, 0.0, 0.0, f"stop: {objection}")
        if self.seeing_s is not None and now_s - self.seeing_s > BLIND_S:
            raise _Ended("stopped", f"nothing to drive on for {BLIND_S:g} s: {objection}", EXIT_DEVICE)

    def _note(self, view: View, t_s: float, command: Command) -> None:
        log = self.log
        before = log.path[-1] if log.path else None
        log.distance_cm += self.pilot.path_step_cm(before, view.pose)
        log.limited_frames += bool(view.snapshot.limits)
        log.path.append(view.pose)
        log.duration_s = t_s
        log.decide(t_s, command.v_mm_s, command.omega_rad_s, command.reason)
        self.on_view(view, log)
