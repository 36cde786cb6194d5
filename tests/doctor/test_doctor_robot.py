"""Line and robot with each of their faults, on the simulated board: what the doctor says, and the remedy."""

from __future__ import annotations

import os
import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from host.doctor import robot as checks
from host.doctor.finding import Finding, Outcome
from host.doctor.timing import check_clocks, check_round_trip
from host.link.bench.tap import Tap
from host.link.bench.target import Target, open_target
from host.link.faults import FaultyLine
from host.link.parameters import PARAMETERS
from host.link.protocol import PROTOCOL_VERSION, SCHEMA_HASH, Fault, Hello, ResetCause, State, Telemetry
from host.link.robot import Robot
from host.sim.rolling import RollingRobot

VALUES = {param: known.default for param, known in PARAMETERS.items()}
HELLO = Hello(PROTOCOL_VERSION, SCHEMA_HASH, 0x1234ABCD, ResetCause.POWER_ON, 7)


@pytest.fixture
def target() -> Iterator[Target]:
    with open_target("sim:") as one:
        yield one


def connected(target: Target) -> tuple[Robot, Finding]:
    robot = Robot(target.near, target.clock)
    _, finding = checks.connect(target, robot)
    return robot, finding


def rolling(target: Target) -> RollingRobot:
    assert target.rolling is not None
    return target.rolling


def latest(robot: Robot) -> Telemetry:
    assert robot.latest is not None
    return robot.latest


# --- Port and handshake -------------------------------------------------------------------------


def test_a_port_that_is_not_there_is_told_with_those_that_are():
    found = checks.check_port("/dev/ttyNONE")
    assert found is not None and found.outcome == Outcome.FAIL
    assert "/dev/ttyNONE does not exist" in found.told and ("plug" in found.fix or "/dev/tty" in found.fix)


def test_a_forbidden_port_is_answered_with_the_command_that_permits_it(tmp_path: Path):
    (tmp_path / "port").write_text("")
    found = checks.check_port(str(tmp_path / "port"), permitted=False)
    assert found is not None and found.outcome == Outcome.FAIL
    assert "may not be opened by" in found.told and "sudo usermod -aG dialout" in found.fix
    if os.geteuid() != 0:
        (tmp_path / "port").chmod(0)
        assert checks.check_port(str(tmp_path / "port")) == found
    assert checks.check_port(str(tmp_path / "port"), permitted=True) is None


def test_a_robot_that_answers_is_well(target):
    robot, found = connected(target)
    assert found.outcome == Outcome.OK and robot.connected


def test_a_silent_port_is_told(target):
    target.faults.to_host.drop = 1.0
    _, found = connected(target)
    assert (found.name, found.outcome) == ("handshake", "FAIL")
    assert "does not answer HELLO" in found.told and "firmware is flashed" in found.fix


def test_a_robot_of_another_schema_is_told_with_how_to_flash_ours(target, monkeypatch):
    monkeypatch.setattr("host.link.robot.SCHEMA_HASH", 0xDEADBEEF)  # as if this program were another one
    monkeypatch.setattr("host.doctor.robot.SCHEMA_HASH", 0xDEADBEEF)
    _, found = connected(target)
    assert (found.name, found.outcome) == ("firmware", "FAIL")
    assert f"schema {SCHEMA_HASH:08x}, not {PROTOCOL_VERSION}, deadbeef" in found.told
    assert "make flash PORT=sim:" in found.fix


class Chatter:
    """A device that sends what no robot does."""

    def __init__(self) -> None:
        self._chance = random.Random(3)

    def write(self, data: bytes) -> None:
        """It does not listen."""

    def read(self) -> bytes:
        return self._chance.randbytes(20)

    def close(self) -> None:
        """It does not care."""


def test_another_device_on_the_port_is_told_from_a_silent_one(target):
    faults = FaultyLine(Chatter(), target.clock)
    chatting = replace(target, near=Tap(faults, target.clock), faults=faults)
    _, found = connected(chatting)
    assert (found.name, found.outcome) == ("handshake", "FAIL")
    assert "no frame of our protocol" in found.told and "is this the robot's port?" in found.fix


# --- Firmware and state -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("build_id", "simulated", "sources", "outcome", "told"),
    [
        (0x1234ABCD, False, 0x1234ABCD, "ok", "that of the sources here"),
        (0x1234ABCD, False, 0x11111111, "warn", "the sources here are 11111111"),
        (0x1234ABCD, False, None, "ok", "build 1234abcd"),
        (0, False, 0x11111111, "warn", "nobody knows from which sources"),
        (0, True, 0x11111111, "ok", "compiled for the simulator"),
    ],
)
def test_firmware_of_other_sources_is_told(build_id, simulated, sources, outcome, told):
    found = checks.check_firmware(replace(HELLO, build_id=build_id), "/dev/ttyACM0", simulated, sources)
    assert found.outcome == outcome and told in found.told
    assert outcome == "ok" or "make flash PORT=/dev/ttyACM0" in found.fix


def test_the_sources_have_a_build_id_where_they_are(tmp_path):
    assert checks.sources_build_id() not in (None, 0)
    assert checks.sources_build_id(tmp_path) is None


@pytest.mark.parametrize(
    ("cause", "told"), [(ResetCause.BROWN_OUT, "voltage had broken down"), (ResetCause.WATCHDOG, "had hung")]
)
def test_a_start_that_nobody_wanted_is_told(cause, told):
    found = checks.check_start(replace(HELLO, reset_cause=cause))
    assert found.outcome == Outcome.WARN and told in found.told and found.fix


def test_a_pressed_emergency_stop_is_told(target):
    rolling(target).board.press_estop(True)
    robot, _ = connected(target)
    checks.listen(target, robot, 0.1)
    found = checks.check_fault(latest(robot))
    assert found.outcome == Outcome.FAIL
    assert "ESTOP_BUTTON" in found.told and "release it" in found.fix


# --- Line, clocks, battery ----------------------------------------------------------------------


def test_a_good_line_is_well_and_its_clock_known(target):
    robot, _ = connected(target)
    heard = checks.listen(target, robot)
    assert checks.check_line(heard).outcome == Outcome.OK
    assert check_round_trip(heard.echoes).outcome == Outcome.OK
    assert check_clocks(heard.echoes, robot.host_time_s).outcome == Outcome.OK


@pytest.mark.parametrize(("drop", "outcome"), [(0.02, "warn"), (0.5, "FAIL")])
def test_a_line_that_loses_frames_is_told(target, drop, outcome):
    robot, _ = connected(target)
    target.faults.to_host.drop = drop
    found = checks.check_line(checks.listen(target, robot))
    assert found.outcome == outcome
    assert "broken or lost" in found.told and "cable" in found.fix


def test_a_line_with_bit_errors_is_told(target):
    robot, _ = connected(target)
    target.faults.to_host.bit_error_rate = 1e-4
    found = checks.check_line(checks.listen(target, robot))
    assert found.outcome in (Outcome.WARN, Outcome.FAIL) and "cable" in found.fix


@pytest.mark.parametrize(("delay_s", "outcome"), [(0.03, "warn"), (0.09, "FAIL")])
def test_a_slow_line_is_told(target, delay_s, outcome):
    target.faults.to_host.delay_s = target.faults.to_robot.delay_s = delay_s / 2
    robot, _ = connected(target)
    target.faults.to_host.delay_s = target.faults.to_robot.delay_s = delay_s
    heard = checks.listen(target, robot)
    found = check_round_trip(heard.echoes)
    assert found.outcome == outcome and "USB port" in found.fix


@pytest.mark.parametrize(
    ("mv", "outcome", "told", "fix"),
    [
        (7400, "ok", "7.40 V", ""),
        (6500, "warn", "6.50 V, it stops below 6.40 V", "charge"),
        (6000, "FAIL", "6.00 V", "charge"),
        (300, "FAIL", "the motors have no power", "cells"),
        (0, "warn", "not measured", "A4"),
    ],
)
def test_an_empty_battery_is_told(target, mv, outcome, told, fix):
    rolling(target).board.set_battery_mv(mv)
    robot, _ = connected(target)
    found = checks.check_battery(checks.listen(target, robot, 0.1).reports, VALUES)
    assert found.outcome == outcome and told in found.told and fix in found.fix


def test_states_that_a_robot_may_well_be_in_are_no_faults(target):
    robot, _ = connected(target)
    assert latest(robot).state == State.READY
    assert checks.check_fault(latest(robot)).outcome == Outcome.OK
    lost = replace(latest(robot), state=State.FAULT, fault=Fault.LINK_LOST)  # left behind by who drove before
    assert checks.check_fault(lost).outcome == Outcome.WARN
