"""A pseudo-terminal that is pulled out and put back in, in real time, with the errors that a port gives."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest
from plugged_robot import Plug, drive, plugged_in

from host.errors import DeviceError
from host.link.clock import SystemClock
from host.link.protocol import State
from host.link.robot import Robot
from host.link.serial_port import SerialPort


@pytest.fixture
def plug(tmp_path: Path):
    with plugged_in(tmp_path / "robot") as plug:
        yield plug


def test_a_port_that_goes_and_comes_back_is_opened_again(plug: Plug):
    path = str(plug.path)
    open_files = len(os.listdir("/proc/self/fd"))
    with Robot(SerialPort(path), SystemClock(), lambda: SerialPort(path)) as robot:
        robot.connect()
        for _ in range(2):
            drive(robot, 0.3)
            plug.put_in(False)
            with pytest.raises(DeviceError):
                drive(robot, 2.0)
            threading.Timer(0.5, plug.put_in, [True]).start()
            back = robot.reconnect()
            assert not back.restarted
            assert "plug the robot in again" in back.why
        drive(robot, 0.3)
        assert robot.latest is not None
        assert robot.latest.state == State.DRIVING
    assert len(os.listdir("/proc/self/fd")) == open_files


def test_a_port_that_stays_away_is_named(plug: Plug):
    path = str(plug.path)
    with Robot(SerialPort(path), SystemClock(), lambda: SerialPort(path)) as robot:
        robot.connect()
        plug.put_in(False)
        with pytest.raises(DeviceError):
            drive(robot, 2.0)
        with pytest.raises(DeviceError, match=r"not back after 1 s: .*robot does not exist"):
            robot.reconnect(timeout_s=1.0)
