"""The loop: newest picture, fresh wheel readings, one command; and what ends it or makes it stand still."""

from __future__ import annotations

import contextlib
import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace

from host.camera.frame import Frame, FrameSource
from host.errors import EXIT_DEVICE, EXIT_DONE, EXIT_INTERRUPTED, EXIT_SAFETY, DeviceError
from host.link.clock import Clock
from host.link.protocol import Fault, State
from host.link.robot import Robot
from host.nav.command import Command
from host.nav.config import NavConfig
from host.nav.odometry import WheelReading, body_of
from host.nav.pace import Pace
from host.nav.pilot import Pilot, Stages, View
from host.nav.result import DriveLog, Lateness, LostAndFound
from host.nav.slip import WheelWatch
from host.nav.trace import Took, damaged
from host.nav.watch import FrameWatch
from host.nav.yielding import leads_into_a_line
from host.pose import Pose

PICTURE_S = 0.07  # without a new picture for this long the wheels are steered on by the last one
UNDERSTAND_S = 0.12  # longest time to understand one; with the above it is less than the robot's dead-man
FRESH_PICTURES = 3  # that must be good again, one after the other, until the robot moves with the last
BLIND_S = 10.0  # no picture to drive on for this long ends the drive
LISTEN_S = 0.005
AWHILE_S = 60.0  # within which
FAULTS_ALLOWED = 5  # a robot that stops itself more often has a reason
RECONNECTIONS_ALLOWED = 5  # and so has a line that is lost more often
SLIPS_ALLOWED = 5  # or one that slips or is carried about
BACK_OFF_CM = 20.0  # from what it ran into, over floor it has just come over
SLIPPED_CM = 5.0  # of what the wheels counted last may not have been gone
HIDDEN_SHARE = 0.5  # of the lower border, by what stands right before the robot
CALM_S = 1.5  # without anything strange before moving again; each time so much more
TRY_AGAIN_S = 2.0  # after a wheel did not turn
CLEARS_IN_S = 0.1  # from clearing a fault until telemetry shows it
HELD = (Fault.STALL, Fault.ENCODER_DEAD)  # what a wheel that is held looks like
HOLDS_ALLOWED = 3


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
    on_refusal: Callable[[Frame | None, str, DriveLog], None] = lambda frame, why, log: None,
) -> tuple[DriveLog, int]:
    """Drive until something ends it; the motors are stopped before anything else happens then.

    A robot that is unplugged or restarts stands; where it can be connected again, the drive goes on. One that
    was halted from another thread ends it with EXIT_SAFETY.

    Parameters
    ----------
    robot : with an open session.
    max_time_s : by the clock given.
    max_wall_s : by the wall's, against a simulation that is slow on this machine.
    on_view : told of every frame that was driven on.
    bound_for : there is a place to get to; running out of time then means not to be there.
    on_refusal : told of every frame that was not, None where none came, and why.

    Returns
    -------
    (log, exit code)
    """
    log = DriveLog(began_s=clock.now_s())
    trip = _Trip(camera, robot, clock, pilot, config, log, on_view, on_refusal)
    begin_s, begin_wall_s = clock.now_s(), time.monotonic()
    code = EXIT_DONE
    late = "not there after" if bound_for else "ended after"
    try:
        while True:
            try:
                trip.await_wheels()
                trip.one_frame()
            except DeviceError:
                if robot.connected:
                    raise
                trip.reconnect()
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
    """Brake, or off for good after a halt; where the line is gone the robot's own dead-man does it."""
    with contextlib.suppress(DeviceError):
        if robot.halted is None:
            robot.stop()
        else:
            robot.estop()


class _Trip:
    """What one pass of the loop needs from the last."""

    def __init__(self, camera, robot, clock, pilot, config, log, on_view, on_refusal):
        self.camera: FrameSource = camera
        self.robot: Robot = robot
        self.clock: Clock = clock
        self.pilot: Pilot = pilot
        self.config: NavConfig = config
        self.log: DriveLog = log
        self.on_view: Callable[[View, DriveLog], None] = on_view
        self.on_refusal: Callable[[Frame | None, str, DriveLog], None] = on_refusal
        self.pictures = FrameWatch(config)
        assert camera.lens is not None, "whoever opens a camera to drive by sees to that"
        self.wheels = WheelWatch(camera.lens)
        self.pace = Pace(config.reaction_s)
        self.begin_s = self.picture_s = clock.now_s()  # when the newest picture was taken
        self.seeing_s = self.begin_s  # when there last was a picture to drive on
        self.last_seq: int | None = None
        self.under_way = False  # the wheels do what was made of the last picture
        self.instead: Command | None = None  # of what the pilot wants, until the next picture
        self.fresh_wanted = 0  # pictures to look at before moving again
        self.calm_s = -math.inf  # and not before this
        self.carried = False  # since when it has not moved by itself
        self.came_from: Pose | None = None  # straight ahead, without a turn since
        self.back_off_cm = 0.0  # before all else
        self.back_from: Pose | None = None
        self.cleared_s = -math.inf
        self.faults = _Often(FAULTS_ALLOWED)
        self.holds = _Often(HOLDS_ALLOWED)
        self.losses = _Often(RECONNECTIONS_ALLOWED)
        self.slips = _Often(SLIPS_ALLOWED)

    def await_wheels(self) -> None:
        """Hear from the wheels before the first picture; `poll` complains of a robot that stays silent."""
        while self.pilot.odometry.newest_s == -math.inf:
            self.clock.sleep_s(LISTEN_S)
            self._listen()

    def one_frame(self) -> None:
        """Newest picture in, one command out, or a stop with its reason."""
        frame, objection = self._next_frame()
        began_s, stages = time.perf_counter(), Stages()
        with stages.of("wheels"):
            self._listen()
        now_s = self.clock.now_s()
        if frame is not None:
            with stages.of("watch"):
                objection = self.pictures.objection(frame, now_s, self.pilot.odometry.rolled_cm)
        if frame is None or objection is not None or self._deaf():
            self._refuse(frame, objection or self._deaf() or "no picture")
            return
        view = self._understand(frame, now_s)
        if view is None:
            return
        self.seeing_s = now_s
        with stages.of("watch"):
            doubt = self.wheels.doubt(view)
        # stepping back from so near changes all that is seen; it begins anew after that
        if doubt is not None and self.back_from is None:
            self._refuse(frame, doubt)
            # doubts while it stands: somebody carries it, and what is behind it now nobody knows
            self.back_off_cm = 0.0 if self.carried else self._may_back_off(view, doubt)
            self._forget(doubt)
            return
        command, waiting = self._careful(view.command), self._waiting_for(now_s)
        self.instead = None
        if command.outcome is None and not command.hands_off:
            if waiting is not None:
                self.instead = Command(0.0, 0.0, f"stop: {waiting}")
            elif self.back_off_cm > 0.0:
                self.instead = self._back_off(view)
            command = self.instead or command
        with stages.of("wheels"):
            self._obey(command)
            self._remember_piece(command, view)
        frame_ms = 1e3 * (time.perf_counter() - began_s)
        self.log.took(Took(frame_ms, 1e3 * (self.clock.now_s() - frame.t_s), stages.ms | view.stage_ms))
        self._note(replace(view, command=command, stage_ms=stages.ms | view.stage_ms))
        self._end_where_over(command)

    def reconnect(self) -> None:
        """Stand until the lost robot is back, then go on; where it is not, DeviceError."""
        self._heed_halt()
        log = self.log
        if self.losses.too_often(self.clock.now_s()):
            raise DeviceError(
                f"the robot was lost more than {RECONNECTIONS_ALLOWED} times in {AWHILE_S:g} s: "
                "check its cable"
            )
        back = self.robot.reconnect()
        if back.restarted:
            self.pilot.restarted()
        t_s = self.clock.now_s() - self.begin_s
        log.reconnections.append(LostAndFound(round(t_s, 3), round(back.away_s, 3), back.restarted, back.why))
        log.decide(t_s, 0.0, 0.0, f"stop: {back}")
        # It was the robot that was away, not the camera.
        self.seeing_s = self.picture_s = self.clock.now_s()
        self.last_seq = None
        self._stay_here()
        self._stand()

    # --- Pictures ------------------------------------------------------------------------------

    def _next_frame(self) -> tuple[Frame | None, str | None]:
        """(the newest frame, None), or (None, why there is none).

        Where pictures come slowly, what was made of the last one is steered by until it is stale.
        """
        while True:
            asked_s = self.clock.now_s()
            good_for_s = self.picture_s + self.config.frame_stale_s - asked_s  # the last one
            wait_s = max(LISTEN_S, good_for_s) if 0.0 < good_for_s < PICTURE_S else PICTURE_S
            try:
                frame = self._await_frame(wait_s)
            except DeviceError as error:
                early_s = wait_s - (self.clock.now_s() - asked_s)
                why = str(error) if early_s > wait_s / 2 else None
                self.clock.sleep_s(max(0.0, early_s))
                self._listen()
                now_s = self.clock.now_s()
                late_s = now_s - self.picture_s
                if late_s > self.config.frame_stale_s:
                    return None, why or f"no picture for {late_s:.1f} s: check the camera's cable"
                self._steer_on(now_s)
                continue
            if frame is None:
                raise _Ended("stopped", "the camera has no more pictures")
            if self.last_seq is not None:
                self.log.dropped_frames += max(0, frame.seq - self.last_seq - 1)
            self.last_seq, self.picture_s = frame.seq, frame.t_s
            self.log.frames += 1
            return frame, None

    def _await_frame(self, wait_s: float) -> Frame | None:
        """As the camera's `read`; what the wheels tell meanwhile is heard at once, and takes no time then."""
        until_s = self.clock.now_s() + wait_s
        while True:
            asked_s = self.clock.now_s()
            short_s = min(LISTEN_S, max(0.0, until_s - asked_s))  # listening may have waited a fault out
            try:
                return self.camera.read(short_s)
            except DeviceError:
                now_s = self.clock.now_s()
                is_gone = now_s - asked_s < short_s / 2  # it did not even wait
                if is_gone or now_s >= until_s:
                    raise
            self._listen()

    def _understand(self, frame: Frame, now_s: float) -> View | None:
        """What is made of a frame; None where that took so long that it is nothing to drive on any more."""
        view = self.pilot.take(frame, now_s)
        ready_s = self.clock.now_s()
        for since_s, allowed_s in ((now_s, UNDERSTAND_S), (frame.t_s, self.config.frame_stale_s)):
            if ready_s - since_s > allowed_s:
                self._refuse(
                    frame,
                    f"picture understood {1e3 * (ready_s - since_s):.0f} ms after it "
                    f"{'came' if since_s == now_s else 'was taken'}, {1e3 * allowed_s:.0f} are allowed: "
                    "the machine is slow",
                )
                return None
        return view

    # --- Wheels --------------------------------------------------------------------------------

    def _listen(self) -> None:
        """Wheel readings into the odometry; a robot that stopped itself is asked why."""
        for report in self.robot.poll():
            t_s = self.robot.host_time_s(report.mcu_time_us)
            self.pilot.hear(WheelReading.of(report, t_s))
        self._heed_halt()
        latest, now_s = self.robot.latest, self.clock.now_s()
        if latest is None or latest.state != State.FAULT or now_s - self.cleared_s < CLEARS_IN_S:
            return
        why = f"the robot stopped itself: {latest.fault.name.lower().replace('_', ' ')}"
        if latest.fault in HELD:
            often = self.holds.too_often(now_s)
        else:
            often = latest.fault != Fault.LINK_LOST or self.faults.too_often(now_s)
        if often:
            raise _Ended("stopped", why, EXIT_SAFETY)
        self.log.faults_cleared += 1
        if latest.fault in HELD:
            self._wait_out(why)
        self.robot.clear()
        self.cleared_s = self.clock.now_s()

    def _heed_halt(self) -> None:
        if self.robot.halted is not None:
            raise _Ended("stopped", self.robot.halted, EXIT_SAFETY)

    def _wait_out(self, why: str) -> None:
        if self.back_from is not None:  # there is something behind it
            self._stay_here()
        self._stand()
        self.log.decide(
            self.clock.now_s() - self.begin_s, 0.0, 0.0, f"stop: {why}; is a wheel held? Trying again"
        )
        until_s = self.clock.now_s() + TRY_AGAIN_S
        while self.clock.now_s() < until_s:
            self.clock.sleep_s(LISTEN_S)
            self._heed_halt()
            for report in self.robot.poll():
                t_s = self.robot.host_time_s(report.mcu_time_us)
                self.pilot.hear(WheelReading.of(report, t_s))
        self.seeing_s = self.picture_s = self.clock.now_s()

    def _deaf(self) -> str | None:
        silent_s = self.clock.now_s() - self.pilot.odometry.newest_s
        return "no fresh word from the wheels" if silent_s > self.config.link_stale_s else None

    def _steer_on(self, now_s: float) -> None:
        """Where the robot has got to since the last picture the map knows what to do next."""
        if not self.under_way or self._deaf():
            return
        command = self.instead or self._careful(self.pilot.decide(now_s))
        self._obey(command)
        self._end_where_over(command)

    def _careful(self, command: Command) -> Command:
        """The same way, but creeping, where pictures are not what they were."""
        caution, creep_mm_s = self.pictures.caution, 10 * self.config.creep_cm_s
        if caution is None or command.v_mm_s <= creep_mm_s:
            return command
        slower = creep_mm_s / command.v_mm_s  # on the same curve
        return replace(
            command,
            v_mm_s=creep_mm_s,
            omega_rad_s=slower * command.omega_rad_s,
            reason=f"{command.reason}; creeping: {caution}",
        )

    def _obey(self, command: Command) -> None:
        self.under_way = command.outcome is None and not command.hands_off
        if command.outcome is not None:
            self.robot.stop()
        elif self.under_way:
            self.robot.drive(command.v_mm_s, command.omega_rad_s)
            self.pace.commanded(self.picture_s, self.clock.now_s())
            self.pilot.react_within(self.pace.reaction_s)

    def _end_where_over(self, command: Command) -> None:
        if command.outcome is not None:
            raise _Ended(command.outcome, command.reason)

    # --- After a contact -----------------------------------------------------------------------

    def _remember_piece(self, command: Command, view: View) -> None:
        if command.v_mm_s > 0.0:
            self.came_from = self.came_from or view.dead_reckoning
        elif command.v_mm_s < 0.0 or command.omega_rad_s != 0.0:
            self.came_from = None

    def _may_back_off(self, view: View, doubt: str) -> float:
        """How far it has come straight to where its wheels slip or most floor is hidden; else 0.

        And 0 where something that moves may come by there.
        """
        sight = self.pilot.map.sight
        hidden = sight is not None and float(sight.feet.cut.mean()) > HIDDEN_SHARE
        if self.came_from is None or not (hidden or doubt.startswith("wheels slip")):
            return 0.0
        came_cm = math.dist(self.came_from.position_cm, view.dead_reckoning.position_cm)
        back_cm = min(BACK_OFF_CM, max(0.0, came_cm - SLIPPED_CM))
        body = self.pilot.map.body
        x, z, heading = body_of(view.pose, body.camera_ahead_cm)
        is_shut = leads_into_a_line(self.pilot.map.movers, (x, z), heading, back_cm, body.radius_cm)
        return 0.0 if is_shut else back_cm

    def _back_off(self, view: View) -> Command:
        """Straight back the way it came, and then a stop to see everything anew."""
        self.back_from = self.back_from or view.dead_reckoning
        left_cm = self.back_off_cm - math.dist(self.back_from.position_cm, view.dead_reckoning.position_cm)
        if left_cm < 1.0:
            self._stay_here()
            self._start_anew()  # so near to a thing it may have taken that for floor
            self.fresh_wanted = FRESH_PICTURES
            return Command(0.0, 0.0, "stop: looking again before going on")
        return Command(
            -10 * self.config.creep_cm_s, 0.0, f"stepping back {left_cm:.0f} cm from what it ran into"
        )

    def _stay_here(self) -> None:
        """What it came over last is not behind it any more, or was gone back over."""
        self.came_from, self.back_off_cm, self.back_from = None, 0.0, None

    # --- Standing still ------------------------------------------------------------------------

    def _stand(self) -> None:
        self.robot.stop()
        self.pace.stopped()
        self.under_way = False
        self.fresh_wanted = FRESH_PICTURES

    def _waiting_for(self, now_s: float) -> str | None:
        """Why not to move yet, though this picture may be driven on."""
        self.fresh_wanted = max(0, self.fresh_wanted - 1)
        if now_s < self.calm_s:
            return f"waiting for {CALM_S:g} s or more in which nothing strange happens"
        if self.carried:
            self.carried = False
            self._start_anew()  # what was seen on the way here is no more true than what was before
            self.fresh_wanted = FRESH_PICTURES
        return "looking again before going on" if self.fresh_wanted > 0 else None

    def _refuse(self, frame: Frame | None, objection: str) -> None:
        """Stand still; after a while of this give up."""
        self._stand()
        log, now_s = self.log, self.clock.now_s()
        log.refused_frames += 1
        log.decide(now_s - self.begin_s, 0.0, 0.0, f"stop: {objection}")
        log.duration_s = now_s - self.begin_s
        self._trace(Command(0.0, 0.0, objection))
        self.on_refusal(frame, objection, log)
        if now_s - self.seeing_s > BLIND_S:
            raise _Ended("stopped", f"nothing to drive on for {BLIND_S:g} s: {objection}", EXIT_DEVICE)

    def _forget(self, why: str) -> None:
        """The robot is not where its wheels say, and nothing stands where it is remembered."""
        if self.slips.too_often(self.clock.now_s()):
            raise _Ended("stopped", f"more than {SLIPS_ALLOWED} times in {AWHILE_S:g} s: {why}", EXIT_SAFETY)
        self.calm_s = self.clock.now_s() + CALM_S * self.slips.lately(self.clock.now_s())
        self.carried = True
        self._start_anew()
        self.log.times_forgotten += 1

    def _start_anew(self) -> None:
        self.pilot.forget()
        self.wheels.forget()

    # --- Notes ---------------------------------------------------------------------------------

    def _note(self, view: View) -> None:
        log, command = self.log, view.command
        log.distance_cm += self.pilot.path_step_cm(log.last_pose, view.pose)
        log.limited_frames += bool(view.snapshot.limits)
        log.be_at(view.pose, view.dead_reckoning)
        log.pictures_late = Lateness(self.pilot.delay.late_s, *self.pilot.delay.estimate)
        log.duration_s = self.clock.now_s() - self.begin_s
        log.decide(log.duration_s, command.v_mm_s, command.omega_rad_s, command.reason)
        log.trace.see(view.frame.t_s - self.begin_s, view.depths)
        self._trace(command)
        self.on_view(view, log)

    def _trace(self, command: Command) -> None:
        log, robot = self.log, self.robot
        told = command.v_mm_s, command.omega_rad_s
        lost = damaged(robot.counters, robot.robot_counters)
        log.trace.note(log.duration_s, log.last_pose, told, robot.latest, lost)


class _Often:
    """Counts what may happen, but not all the time."""

    def __init__(self, allowed: int):
        self._times_s: deque[float] = deque(maxlen=allowed)

    def too_often(self, now_s: float) -> bool:
        """Whether it happened as often as allowed in the last while already; this one is counted."""
        times = self._times_s
        often = self.lately(now_s) == times.maxlen
        times.append(now_s)
        return often

    def lately(self, now_s: float) -> int:
        """How often in the last while."""
        return sum(now_s - time_s < AWHILE_S for time_s in self._times_s)
