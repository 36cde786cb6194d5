"""Whole drives in which something fails for a while: it stands, says why, and goes on when it is over."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from driving import run, stands

from host.errors import EXIT_SAFETY
from host.nav.config import NavConfig
from host.nav.result import DriveLog
from host.sim.camera_faults import CameraFault, FaultyCamera
from host.sim.session import Simulation

AISLE = "sim:corridor?seed=5"  # straight ahead for a long way
FROM_S = 3.0
STOPS_WITHIN_CM = 8.0  # at 20 cm/s: 0.2 s and the braking


class Watched:
    """A simulation whose robot somebody does something to, and who looks where its wheels roll."""

    def __init__(self, uri: str, at: dict | None = None):
        self.simulation = Simulation(uri)
        self._todo = dict(at or {})
        self.way: list[tuple[float, float, float, float]] = []  # time, x, z, fastest wheel
        self.lens = self.simulation.camera.lens

    def read(self, timeout_s: float):
        """A camera in between, called all the time."""
        assert timeout_s >= 0.0
        now_s, body = self.simulation.clock.now_s(), self.simulation.body
        self.way.append((now_s, *body.axle[:2], max(map(abs, body.wheel_speeds_cm_s))))
        for time_s in [t for t in self._todo if now_s >= t]:
            self._todo.pop(time_s)(body)
        return self.simulation.camera.read(timeout_s)

    def close(self) -> None: ...

    def went_cm(self, from_s: float, until_s: float) -> float:
        places = [(x, z) for t, x, z, _ in self.way if from_s <= t <= until_s]
        return sum(math.dist(a, b) for a, b in pairwise(places))

    def wheels_stood(self, from_s: float, until_s: float) -> bool:
        return all(speed < 0.5 for t, _, _, speed in self.way if from_s <= t <= until_s)


def said(log: DriveLog, words: str) -> bool:
    return any(words in decision.reason and decision.stands for decision in log.decisions)


@pytest.mark.parametrize(
    "words",
    [
        {"frozen": "has not changed", "black": "black"},
        {"repeating": "was seen before", "white": "one even colour"},
        {"late": "ms old", "silent": "no picture for"},
        {"blurred": "blurred", "gone": "stopped delivering"},
    ],
    ids=lambda words: " and ".join(words),
)
def test_a_camera_that_fails_for_two_seconds_stops_the_robot_for_as_long(words):
    """Two faults one after the other, with two seconds in between."""
    watched = Watched(AISLE)
    faults = [CameraFault(kind, FROM_S + 4.0 * k, FROM_S + 4.0 * k + 2.0) for k, kind in enumerate(words)]
    faulty = FaultyCamera(watched, watched.simulation.clock, faults)
    log, _ = run(watched.simulation, camera=faulty, max_time_s=faults[-1].until_s + 3.0)
    assert log.outcome == "timeout", log.reason
    for fault in faults:
        assert said(log, words[fault.kind]), [d.reason for d in log.decisions]
        if fault.kind in ("silent", "gone"):
            said_s = min(d.t_s for d in log.decisions if words[fault.kind] in d.reason)
            assert watched.way[0][0] + said_s - fault.from_s <= 0.3
        went_cm = watched.went_cm(fault.from_s, fault.until_s)
        print(f"\n{fault.kind}: went on for {went_cm:.1f} cm")
        assert went_cm < STOPS_WITHIN_CM
        assert watched.wheels_stood(fault.from_s + 1.0, fault.until_s)
        assert not watched.wheels_stood(fault.until_s, fault.until_s + 3.0)  # and soon goes on
    assert not watched.wheels_stood(FROM_S - 0.3, FROM_S)  # it was on its way
    assert (log.times_forgotten, watched.simulation.body.collisions) == (0, 0)
    assert stands(watched.simulation)


def test_a_picture_that_stays_soft_is_waited_for_and_then_crept_through():
    watched = Watched(AISLE)
    faulty = FaultyCamera(watched, watched.simulation.clock, [CameraFault("blurred", FROM_S, 13.0)])
    log, _ = run(watched.simulation, camera=faulty, max_time_s=14.0)
    assert log.outcome == "timeout", log.reason
    assert said(log, "blurred")
    (until_s,) = [d.t_s + d.pictures / 15 for d in log.decisions if "blurred" in d.reason]
    assert 3.0 < until_s - FROM_S < 5.0  # not for ever
    fastest = max(speed for t, _, _, speed in watched.way if FROM_S + 1.0 < t < 13.0)
    assert fastest < 1.5 * NavConfig().creep_cm_s
    assert watched.simulation.body.collisions == 0


def test_light_that_is_switched_off_twice_is_waited_for():
    watched = Watched(AISLE)
    faults = [CameraFault("black", 2.5, 4.0), CameraFault("black", 5.0, 7.0)]
    faulty = FaultyCamera(watched, watched.simulation.clock, faults)
    log, _ = run(watched.simulation, camera=faulty, max_time_s=9.0)
    assert log.outcome == "timeout" and said(log, "no light")
    assert watched.wheels_stood(3.2, 4.0) and watched.wheels_stood(5.7, 7.0)
    assert watched.went_cm(4.0, 5.0) > 2.0 and watched.went_cm(7.0, 9.0) > 4.0
    assert (log.times_forgotten, watched.simulation.body.collisions) == (0, 0)


@pytest.mark.parametrize(("left", "right"), [(1.0, 1.0), (0.0, 1.0)], ids=["both wheels", "one wheel"])
def test_wheels_that_slip_are_found_out_by_the_picture(left, right):
    watched = Watched("sim:room?seed=3", {FROM_S: lambda body: body.slip(left, right, 2.0)})
    log, _ = run(watched.simulation, camera=watched, max_time_s=12.0)
    assert log.outcome == "timeout", log.reason
    assert said(log, "slip"), [d.reason for d in log.decisions]
    if left:  # the other may as well be a push
        assert any("stepping back" in decision.reason for decision in log.decisions)
    assert log.times_forgotten >= 1
    assert watched.went_cm(6.5, 12.0) > 8.0
    assert watched.simulation.body.collisions == 0
    assert stands(watched.simulation)


def test_a_robot_that_is_lifted_and_put_elsewhere_stands_forgets_and_goes_on():
    watched = Watched("sim:room?seed=3")
    x, z, heading = watched.simulation.body.axle
    watched._todo = {FROM_S: lambda body: body.lift(), 4.4: lambda body: body.put_down(x, z, heading + 0.6)}
    log, _ = run(watched.simulation, camera=watched, max_time_s=14.0)
    assert log.outcome in ("timeout", "goal"), log.reason
    assert said(log, "lifted") or said(log, "carried away"), [d.reason for d in log.decisions]
    assert log.times_forgotten >= 1
    assert watched.wheels_stood(FROM_S + 0.9, 4.5)  # all the time in the air
    assert watched.went_cm(8.0, 14.0) > 8.0
    assert watched.simulation.body.collisions == 0
    assert stands(watched.simulation)


def hold(body, for_s: float) -> None:
    """A hand on the left wheel."""
    roll, until_us = body._left.roll, body.time_us + round(1e6 * for_s)

    def held(duty: float, voltage: float, start_us: int) -> float:
        if start_us >= until_us:
            return roll(duty, voltage, start_us)
        body._left.speed_cm_s = 0.0
        return 0.0

    body._left.roll = held


def hold_once_it_steps_back(body, after_s: float, for_s: float) -> list[int]:
    """A hand on the left wheel, a while after it was driven backwards; when, in us, comes into the list."""
    roll, backwards_us, held_us = body._left.roll, [], []

    def held(duty: float, voltage: float, start_us: int) -> float:
        if duty < 0.0:
            backwards_us.append(start_us)
        if not held_us and backwards_us and start_us >= backwards_us[0] + round(1e6 * after_s):
            held_us.append(start_us)
        if held_us and start_us < held_us[0] + round(1e6 * for_s):
            body._left.speed_cm_s = 0.0
            return 0.0
        return roll(duty, voltage, start_us)

    body._left.roll = held
    return held_us


def test_between_slow_pictures_it_waits_and_steps_back_too_until_a_wheel_is_held():
    watched = Watched("sim:room?seed=5&fps=6", {FROM_S: lambda body: body.slip(1.0, 1.0, 2.0)})
    held_us = hold_once_it_steps_back(watched.simulation.body, 0.5, 1.0)
    log, _ = run(watched.simulation, camera=watched, max_time_s=13.0)
    until_s = 1e-6 * held_us[0]
    times = {
        words: [watched.way[0][0] + one.t_s for one in log.decisions if words in one.reason]
        for words in ("waiting for", "stepping back", "is a wheel held")
    }
    waits_s, back_s, held_s = (min(times[words]) for words in times)
    assert waits_s + 1.0 < back_s < held_s, times
    assert watched.wheels_stood(waits_s + 0.5, back_s)
    back = [(x, z) for t, x, z, _ in watched.way if back_s <= t <= until_s]
    assert watched.went_cm(back_s, until_s) < 1.001 * math.dist(back[0], back[-1])  # and does not turn
    assert max(times["stepping back"]) < held_s
    assert watched.simulation.body.collisions == 0


def test_where_it_was_carried_to_it_does_not_step_back_as_before_something_it_ran_into():
    watched = Watched("sim:room?seed=4&fps=6", {FROM_S: lambda body: body.lift()})
    wall_cm = watched.simulation.world.room.front_cm  # which hides all floor
    watched._todo[FROM_S + 0.6] = lambda body: body.put_down(0.0, wall_cm - 14.0, 0.0)
    log, _ = run(watched.simulation, camera=watched, max_time_s=8.5)
    assert log.times_forgotten == 2 and said(log, "looking again"), [d.reason for d in log.decisions]
    assert not any("stepping back" in decision.reason for decision in log.decisions)


@pytest.mark.parametrize(("for_s", "goes_on"), [(2.0, True), (1000.0, False)])
def test_a_wheel_that_is_blocked_stops_the_robot_until_it_is_free(for_s, goes_on):
    watched = Watched("sim:room?seed=3", {FROM_S: lambda body: hold(body, for_s)})
    log, code = run(watched.simulation, camera=watched, max_time_s=12.0 if goes_on else 60.0)
    assert said(log, "is a wheel held"), [d.reason for d in log.decisions]
    assert watched.simulation.body.collisions == 0
    if goes_on:
        assert log.outcome == "timeout", log.reason
        assert watched.went_cm(7.0, 12.0) > 8.0
    else:
        assert (log.outcome, code) == ("stopped", EXIT_SAFETY)
        assert "stopped itself" in log.reason
    assert stands(watched.simulation)
