"""Wheels wired wrongly in each way, on the simulated body: what the doctor says; and that all stand after."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import ClassVar

import pytest

from host.doctor import wheels
from host.doctor.finding import Finding, Outcome
from host.errors import DeviceError
from host.link.bench.target import Target, open_target
from host.link.parameters import PARAMETERS
from host.link.protocol import Drive, Fault
from host.link.robot import Robot
from host.sim.board import Board, Side
from host.sim.body import PHASES

VALUES = {param: known.default for param, known in PARAMETERS.items()}


class MiswiredBoard(Board):
    """A board whose wires go elsewhere; tests set what is wrong."""

    encoder_of: ClassVar[dict[Side, Side | None]] = {}  # the input at which a wheel's encoder ends
    channels_swapped: ClassVar[set[Side]] = set()
    motor_of: ClassVar[dict[Side, tuple[Side, int]]] = {}  # the output that a motor hangs on, and its sense
    jitters: ClassVar[set[Side]] = set()  # inputs with impossible steps

    def set_encoder_pins(self, side: Side, a: bool, b: bool, at_us: int | None = None) -> None:
        ends_at = self.encoder_of.get(side, side)
        if side in self.channels_swapped:
            a, b = b, a
        if ends_at is not None:
            if ends_at in self.jitters and a == b:
                return  # every second step is not seen: two at once
            super().set_encoder_pins(ends_at, a, b, at_us)

    def duty(self, side: Side) -> float:
        output, sense = self.motor_of.get(side, (side, 1))
        return sense * super().duty(output)


@pytest.fixture
def wired(monkeypatch) -> Iterator[Callable[..., tuple[Target, Robot]]]:
    """Opens a robot with these wires, whose frames to the robot can be looked at."""
    opened = []

    def make(**wires) -> tuple[Target, Robot]:
        board = type("Board", (MiswiredBoard,), wires)
        monkeypatch.setattr("host.sim.rolling.Board", board)
        context = open_target("sim:")
        target = context.__enter__()
        opened.append(context)
        robot = Robot(target.near, target.clock)
        robot.connect()
        return target, robot

    yield make
    for context in opened:
        context.__exit__(None, None, None)


def driven(target: Target, robot: Robot) -> dict[str, Finding]:
    findings, _ = wheels.check_driven(robot, target.clock, VALUES)
    return {f.name: f for f in findings}


def stands(target: Target) -> bool:
    """No motor is driven and no wheel turns, now and for a second."""
    assert target.rolling is not None
    target.wait_s(1.0)
    speeds = target.rolling.body.wheel_speeds_cm_s
    return speeds == (0.0, 0.0) and all(target.rolling.board.duty(side) == 0.0 for side in Side)


def test_wheels_wired_as_they_should_pass_and_stand_again(wired):
    target, robot = wired()
    found = driven(target, robot)
    assert {f.outcome for f in found.values()} == {Outcome.OK}
    assert set(found) == {"left wheel", "right wheel", "both motors", "encoder signals", "stop"}
    assert stands(target)


@pytest.mark.parametrize(
    ("wires", "failing", "told", "fix"),
    [
        ({"channels_swapped": {Side.LEFT}}, {"left wheel"}, "forward, it counts backward", "swap A and B"),
        ({"channels_swapped": {Side.RIGHT}}, {"right wheel"}, "it counts backward", "A and B of the right"),
        ({"motor_of": {Side.LEFT: (Side.LEFT, -1)}}, {"left wheel"}, "counts backward", "motor's two wires"),
        ({"motor_of": {Side.RIGHT: (Side.RIGHT, -1)}}, {"right wheel"}, "counts backward", "two wires"),
        (
            {"encoder_of": {Side.LEFT: Side.RIGHT, Side.RIGHT: Side.LEFT}},
            {"left wheel", "right wheel"}, "the right wheel counts", "swap the two encoders' plugs",
        ),
        (
            {"motor_of": {Side.LEFT: (Side.RIGHT, 1), Side.RIGHT: (Side.LEFT, 1)}},
            {"left wheel", "right wheel"}, "the right wheel counts", "the two motors' if the right one did",
        ),
        ({"encoder_of": {Side.LEFT: None}}, {"left wheel"}, "it does not count", "left encoder's plug"),
        ({"encoder_of": {Side.RIGHT: None}}, {"right wheel"}, "it does not count", "right encoder's plug"),
        ({"encoder_of": dict.fromkeys(Side)}, {"left wheel", "right wheel"}, "does not count", "plug"),
        ({"motor_of": {Side.LEFT: (Side.LEFT, 0)}}, {"left wheel"}, "it does not count", "if not: motor"),
    ],
)  # fmt: skip
def test_each_wrong_wire_is_told_with_its_remedy_and_the_wheels_stand_again(wired, wires, failing, told, fix):
    target, robot = wired(**wires)
    found = driven(target, robot)
    assert {name for name, f in found.items() if f.outcome == Outcome.FAIL} == failing
    first = found[min(failing)]
    assert told in first.told and fix in first.fix
    assert found["both motors"].outcome == Outcome.UNTRIED
    assert stands(target)


def test_impossible_steps_of_an_encoder_are_told(wired):
    target, robot = wired(jitters={Side.LEFT})
    found = driven(target, robot)["encoder signals"]
    assert found.outcome == Outcome.WARN and "left encoder" in found.fix


def test_a_stiff_motor_is_told_by_the_duty_it_needs(wired, monkeypatch):
    target, robot = wired(
        duty=lambda self, side: Board.duty(self, side) * (0.5 if side == Side.LEFT else 1.0)
    )
    found = driven(target, robot)["both motors"]
    assert found.outcome == Outcome.WARN and ("left wheel" in found.fix or "battery" in found.fix)


def test_the_wheels_are_stopped_also_when_it_is_broken_off(wired, monkeypatch):
    target, robot = wired()
    sent = []
    target.near.on_frame.append(lambda frame: sent.append(frame.message) if not frame.to_host else None)
    until_s = target.clock.now_s() + 1.0

    def interrupted(seconds: float) -> None:
        if target.clock.now_s() > until_s:
            raise KeyboardInterrupt
        target.wait_s(seconds)

    clock = type(
        "Clock", (), {"now_s": staticmethod(target.clock.now_s), "sleep_s": staticmethod(interrupted)}
    )()
    with pytest.raises(KeyboardInterrupt):
        wheels.check_driven(robot, clock, VALUES)
    last_drive = max(k for k, message in enumerate(sent) if isinstance(message, Drive))
    assert "Stop" in {type(message).__name__ for message in sent[last_drive + 1 :]}
    assert stands(target)


def test_a_robot_whose_fault_persists_is_not_driven(wired):
    target, robot = wired()
    assert target.rolling is not None
    target.rolling.board.press_estop(True)
    found = wheels.check_ready(robot, target.clock)
    assert found is not None and found.outcome == Outcome.UNTRIED
    assert "emergency stop button" in found.fix and "release it" in found.fix
    with pytest.raises(DeviceError, match="emergency stop button"):
        driven(target, robot)
    assert stands(target)


# --- A person -----------------------------------------------------------------------------------


class Hand:
    """A person who does as asked, on a robot wired in some way."""

    there = True

    def __init__(
        self, target: Target, turns: dict[str, Callable[[], None]] | None = None, says: str = "yes"
    ) -> None:
        self.target, self.says, self.asked = target, says, []
        self._phase = dict.fromkeys(Side, 0)

    def ask(self, question: str, meanwhile: Callable[[], object]) -> str:
        self.asked.append(question)
        meanwhile()
        if question.startswith("Turn the"):
            self.turn(Side.LEFT if "LEFT" in question else Side.RIGHT)
        return self.says

    def turn(self, side: Side, steps: int = 40) -> None:
        assert self.target.rolling is not None
        for _ in range(steps):
            self._phase[side] += 1
            a, b = PHASES[self._phase[side] % 4]
            self.target.rolling.board.set_encoder_pins(side, a, b)
            self.target.wait_s(0.005)


@pytest.mark.parametrize(
    ("wires", "outcomes", "told"),
    [
        ({}, ("ok", "ok"), "+40 counts, the other one +0"),
        ({"channels_swapped": {Side.LEFT}}, ("FAIL", "ok"), "swap A and B of this"),
        (
            {"encoder_of": {Side.LEFT: Side.RIGHT, Side.RIGHT: Side.LEFT}},
            ("FAIL", "FAIL"),
            "the two encoders' plugs",
        ),
        ({"encoder_of": {Side.LEFT: None}}, ("FAIL", "ok"), "check its plug"),
    ],
)
def test_wheels_turned_by_hand_tell_which_wire_is_wrong_and_nothing_is_driven(wired, wires, outcomes, told):
    target, robot = wired(**wires)
    sent = []
    target.near.on_frame.append(lambda frame: sent.append(frame.message))
    hand = Hand(target)
    found = list(wheels.check_by_hand(hand, robot))
    assert tuple(f.outcome for f in found) == outcomes
    assert told in f"{found[0].told} {found[0].fix}"
    assert ["LEFT" in question for question in hand.asked] == [True, False]
    assert not [message for message in sent if isinstance(message, Drive)]


@pytest.mark.parametrize(("says", "outcome"), [("yes", "ok"), ("no", "FAIL"), ("", "FAIL")])
def test_only_who_sees_the_robot_can_tell_its_left(wired, says, outcome):
    target, robot = wired()
    hand = Hand(target, says=says)
    found = wheels.check_sides_seen(hand, robot, target.clock, VALUES)
    assert found.outcome == outcome and "LEFT wheel" in hand.asked[0]
    assert stands(target)


def test_a_battery_that_gives_way_under_load_is_told(wired):
    target, robot = wired()
    one = wheels.pulse(robot, target.clock, 1, 1, 150.0)
    assert wheels.check_sag(one.reports).outcome == Outcome.OK
    weak = [replace(r, battery_mv=7400 - 40 * k) for k, r in enumerate(one.reports)]
    found = wheels.check_sag(weak)
    assert found.outcome == Outcome.WARN and "stronger cells" in found.fix
    assert one.fault == Fault.NONE
