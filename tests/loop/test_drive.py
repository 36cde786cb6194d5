"""The loop against a world that fails: whatever breaks, the motors stop first and the log says why."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from driving import TamperedCamera, run, stands, travel_cm

from host.camera.frame import Frame
from host.errors import EXIT_DEVICE, EXIT_DONE, EXIT_INTERRUPTED, EXIT_SAFETY, DeviceError
from host.link.faults import Faults, FaultyLine
from host.link.protocol import ResetCause
from host.link.robot import RECONNECT_S, Robot
from host.nav.result import DriveLog
from host.nav.task import MeasureOnly
from host.rbdn import NetConfig
from host.sim.board import Line
from host.sim.session import Simulation


class TamperedLine:
    """A line that is cut at some time."""

    def __init__(self, simulation: Simulation, from_s: float, noisily: bool):
        self._line, self._clock = simulation.transport, simulation.clock
        self._from_s, self._noisily = from_s, noisily

    def _cut(self) -> bool:
        cut = self._clock.now_s() >= self._from_s
        if cut and self._noisily:
            raise DeviceError("the line is gone")
        return cut

    def write(self, data: bytes) -> None:
        if not self._cut():
            self._line.write(data)

    def read(self) -> bytes:
        return b"" if self._cut() else self._line.read()

    def close(self) -> None:
        self._line.close()


class Cable:
    """A cable that is pulled out at some time and plugged in again later."""

    def __init__(self, simulation: Simulation, from_s: float, for_s: float):
        self._simulation = simulation
        self._from_s, self._until_s = from_s, from_s + for_s
        self.opened = 0

    def open(self):
        """A line through it."""
        if self._out():
            raise DeviceError("no cable")
        self.opened += 1
        line, cable = Line(self._simulation.board), self

        class Plugged:
            gone = False

            def write(self, data: bytes) -> None:
                self._check()
                line.write(data)

            def read(self) -> bytes:
                self._check()
                return line.read()

            def close(self) -> None:
                line.close()

            def _check(self) -> None:
                self.gone |= cable._out()
                if self.gone:
                    raise DeviceError("the line is gone")

        return Plugged()

    def _out(self) -> bool:
        return self._from_s <= self._simulation.clock.now_s() < self._until_s


def test_it_drives_when_nothing_is_wrong():
    simulation = Simulation("sim:room?seed=3")
    log, code = run(simulation, max_time_s=3.0)
    assert (log.outcome, code) == ("timeout", EXIT_DONE)
    assert travel_cm(simulation) > 6
    assert (log.refused_frames, log.limited_frames) == (0, 0)
    assert stands(simulation)


@pytest.mark.parametrize(
    ("tamper", "said"),
    [
        (lambda frame, last: replace(frame, t_s=frame.t_s - 0.35), "350 ms old"),
        (lambda frame, last: replace(last, t_s=frame.t_s, seq=frame.seq), "has not changed"),
    ],
    ids=["stale", "frozen"],
)
def test_on_a_picture_that_must_not_be_driven_on_it_stands_still_and_at_last_gives_up(tamper, said):
    simulation = Simulation("sim:room?seed=3")
    camera = TamperedCamera(simulation, 2.0, tamper)
    log, code = run(simulation, camera=camera)
    assert (log.outcome, code) == ("stopped", EXIT_DEVICE)
    assert said in log.reason
    (broken,) = [d for d in log.decisions[:-1] if said in d.reason]
    assert broken.stands and broken.pictures > 10
    assert stands(simulation)


def test_stale_pictures_from_the_start_never_move_the_robot():
    simulation = Simulation("sim:room?seed=3")
    camera = TamperedCamera(simulation, 0.0, lambda frame, last: replace(frame, t_s=frame.t_s - 0.31))
    log, _ = run(simulation, camera=camera)
    assert log.outcome == "stopped"
    assert travel_cm(simulation) == 0.0


def test_a_frozen_picture_is_noticed_within_a_few_centimetres():
    simulation = Simulation("sim:room?seed=3")
    frozen_at = []

    def freeze(frame, last):
        if not frozen_at:
            frozen_at.append(travel_cm(simulation))
        return replace(last, t_s=frame.t_s, seq=frame.seq)

    run(simulation, camera=TamperedCamera(simulation, 3.0, freeze), max_time_s=5.0)
    assert stands(simulation)
    assert travel_cm(simulation) - frozen_at[0] < 4.0


def test_a_camera_that_fails_for_a_moment_is_waited_for():
    simulation = Simulation("sim:room?seed=3")

    def drop(frame, last):
        if simulation.clock.now_s() < 2.8:
            raise DeviceError("no picture")
        return frame

    log, code = run(simulation, camera=TamperedCamera(simulation, 2.0, drop), max_time_s=5.0)
    assert (log.outcome, code) == ("timeout", EXIT_DONE)
    assert any("no picture" in d.reason for d in log.decisions)
    assert not log.decisions[-2].stands


def test_a_camera_that_ends_ends_the_drive():
    simulation = Simulation("sim:room?seed=3")
    log, _ = run(simulation, camera=TamperedCamera(simulation, 1.5, lambda frame, last: None))
    assert log.outcome == "stopped"
    assert "no more pictures" in log.reason
    assert stands(simulation)


@pytest.mark.parametrize("noisily", [False, True], ids=["silent", "error"])
def test_on_a_dead_line_the_drive_ends_and_the_robot_stops_itself(noisily):
    simulation = Simulation("sim:room?seed=3")
    log, code = run(simulation, line=TamperedLine(simulation, 2.5, noisily))
    assert (log.outcome, code) == ("stopped", EXIT_DEVICE)
    assert log.duration_s < 3.0 + (0.0 if noisily else RECONNECT_S)
    assert ("does not answer HELLO" in log.reason) != noisily
    assert stands(simulation)


EXPOSURE_KNOWN_S = 5e-3


def off_cm(simulation: Simulation, log: DriveLog) -> float:
    """How wrong the drive's last idea of its place is."""
    last = log.last_pose
    assert last is not None
    # When a picture was taken is learnt from how it turns with the wheels, so that it may seem yet to come.
    t_s = min(last.t_s, simulation.clock.now_s())
    assert last.t_s - t_s < EXPOSURE_KNOWN_S
    return float(np.linalg.norm(last.position_cm - simulation.true_pose(t_s).position_cm))


def moved_after(log: DriveLog, t_s: float) -> bool:
    return any(
        math.dist(pose.position_cm, log.path[-1].position_cm) > 5 for pose in log.path if pose.t_s > t_s
    )


@pytest.mark.parametrize("for_s", [0.1, 1.0, 3.0])
def test_a_robot_that_is_unplugged_for_a_while_stands_and_then_goes_on(for_s: float):
    simulation = Simulation("sim:room?seed=3")
    cable = Cable(simulation, 2.5, for_s)
    log, code = run(simulation, line=cable.open(), reopen=cable.open, max_time_s=7.0)
    assert (log.outcome, code) == ("timeout", EXIT_DONE)
    (lost,) = log.as_dict()["reconnections"]
    assert (lost["why"], lost["restarted"]) == ("the line is gone", False)
    assert for_s - 0.1 <= lost["away_s"] <= for_s + 0.5
    assert cable.opened == 2
    assert moved_after(log, lost["t_s"] + 0.5)
    assert any("connected again" in decision.reason for decision in log.decisions)
    assert log.faults_cleared == 1  # it had stopped itself
    print(
        f"\nunplugged for {for_s} s: back after {lost['away_s']} s, off by {off_cm(simulation, log):.2f} cm"
    )
    assert off_cm(simulation, log) < 2.0
    assert stands(simulation)


@pytest.mark.parametrize("cause", [ResetCause.BROWN_OUT, ResetCause.WATCHDOG])
def test_a_robot_that_restarts_on_the_way_stands_and_then_goes_on_from_where_it_is(cause: ResetCause):
    simulation = Simulation("sim:room?seed=3")
    done = []

    def reset(frame, last):
        if not done:
            simulation.board.reset(cause)
            done.append(travel_cm(simulation))
        return frame

    log, code = run(simulation, camera=TamperedCamera(simulation, 3.0, reset), max_time_s=7.0)
    if cause == ResetCause.WATCHDOG:  # the firmware latches it, and somebody is to have a look
        assert (log.outcome, code) == ("stopped", EXIT_SAFETY)
    else:
        assert (log.outcome, code) == ("timeout", EXIT_DONE)
        assert moved_after(log, log.reconnections[0].t_s + 0.5)
    (lost,) = log.reconnections
    assert lost.restarted
    assert lost.away_s < 0.5
    assert "restarted" in lost.why
    print(f"\nrestarted: back after {lost.away_s} s, off by {off_cm(simulation, log):.2f} cm")
    assert off_cm(simulation, log) < 2.0
    assert stands(simulation)


def test_the_wheels_are_heard_while_the_next_picture_is_awaited():
    """What they tell is then worked out before the picture comes, and not in the time until its command."""
    simulation = Simulation("sim:room?seed=3")
    line, camera = simulation.transport, simulation.camera
    unheard: list[int] = []  # bytes on the line as pictures came
    came = [False]

    class Line:
        write, close = line.write, line.close

        def read(self) -> bytes:
            data = line.read()
            if came[0]:
                unheard.append(len(data))
                came[0] = False
            return data

    class Camera:
        lens, close = camera.lens, camera.close

        def read(self, timeout_s: float) -> Frame | None:
            frame = camera.read(timeout_s)
            came[0] = True
            return frame

    log, _ = run(simulation, line=Line(), camera=Camera(), max_time_s=3.0)
    assert log.frames > 40
    a_picture_bytes = 7 * 40  # of telemetry, at 15 pictures a second
    assert np.mean(unheard) < a_picture_bytes / 4


@pytest.mark.parametrize(
    "faults", [{"bit_error_rate": 1e-4}, {"drop": 0.1}], ids=["bit errors", "a tenth lost"]
)
def test_a_bad_line_stops_nothing_and_the_way_is_known_as_well(faults: dict[str, float]):
    simulation = Simulation("sim:room?seed=3")
    line = FaultyLine(simulation.transport, simulation.clock, Faults(**faults), Faults(**faults), seed=3)
    log, code = run(simulation, line=line, max_time_s=6.0)
    assert (log.outcome, code) == ("timeout", EXIT_DONE)
    assert (log.reconnections, log.faults_cleared, log.refused_frames) == ([], 0, 0)
    for injected in (line.injected_to_robot, line.injected_to_host):
        assert injected.damaged + injected.dropped >= 2
    assert off_cm(simulation, log) < 1.0


def test_a_line_that_takes_thirty_milliseconds_each_way_is_good_enough_to_drive_on():
    simulation = Simulation("sim:room?seed=3")
    slow = Faults(delay_s=0.03)
    line = FaultyLine(simulation.transport, simulation.clock, slow, slow, seed=2)
    log, code = run(simulation, line=line, max_time_s=4.0)
    assert (log.outcome, code) == ("timeout", EXIT_DONE)
    assert (log.reconnections, log.faults_cleared, log.refused_frames) == ([], 0, 0)
    assert travel_cm(simulation) > 8.0
    assert off_cm(simulation, log) < 2.0
    assert stands(simulation)


def test_a_cable_that_is_never_put_back_ends_the_drive():
    simulation = Simulation("sim:room?seed=3")
    cable = Cable(simulation, 2.0, 1e9)
    log, code = run(simulation, line=cable.open(), reopen=cable.open, max_time_s=30.0)
    assert (log.outcome, code) == ("stopped", EXIT_DEVICE)
    assert "not back after 8 s: no cable" in log.reason
    assert log.duration_s < 2.0 + RECONNECT_S
    assert stands(simulation)


def test_the_stop_button_ends_the_drive_as_a_safety_stop():
    simulation = Simulation("sim:room?seed=3")

    def press(frame, last):
        simulation.board.press_estop(True)
        return frame

    log, code = run(simulation, camera=TamperedCamera(simulation, 2.0, press))
    assert (log.outcome, code) == ("stopped", EXIT_SAFETY)
    assert "estop" in log.reason
    assert stands(simulation)


def test_an_interrupt_stops_the_motors_before_anything_else():
    simulation = Simulation("sim:room?seed=3")

    def interrupt(frame, last):
        raise KeyboardInterrupt

    log, code = run(simulation, camera=TamperedCamera(simulation, 2.0, interrupt))
    assert (log.outcome, log.reason, code) == ("stopped", "interrupted", EXIT_INTERRUPTED)
    assert stands(simulation)


def test_a_bug_stops_the_motors_too():
    simulation = Simulation("sim:room?seed=3")

    def stumble(frame, last):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run(simulation, camera=TamperedCamera(simulation, 2.0, stumble))
    assert stands(simulation)


def test_frames_in_which_a_budget_of_the_net_acted_are_counted():
    log, _ = run(Simulation("sim:room?seed=3"), net=NetConfig(max_polygons=3), max_time_s=1.0)
    assert 0 < log.limited_frames == log.as_dict()["limited_frames"] <= log.frames


def test_dropped_frames_are_counted():
    simulation = Simulation("sim:room?seed=3")

    def skip(frame, last):
        simulation.clock.sleep_s(0.14)
        return frame

    log, _ = run(simulation, camera=TamperedCamera(simulation, 1.0, skip), max_time_s=3.0)
    assert log.dropped_frames > 5


def test_measuring_only_sends_no_command_that_moves(monkeypatch):
    simulation = Simulation("sim:room?seed=3")
    driven = []
    monkeypatch.setattr(Robot, "drive", lambda *speeds: driven.append(speeds))
    log, code = run(simulation, task=MeasureOnly(), max_time_s=1.0)
    assert (log.outcome, code) == ("timeout", EXIT_DONE)
    assert not driven and travel_cm(simulation) == 0.0
    assert log.frames > 5 and "measuring only" in log.decisions[0].reason
