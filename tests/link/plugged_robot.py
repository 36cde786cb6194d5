"""A simulated robot in real time on a pseudo-terminal that is pulled out and put back in."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from host.link.protocol import State
from host.link.robot import Robot
from host.sim.rolling import RollingRobot
from host.sim.serve import PACE_S, Pacer, Port


class Plug(threading.Thread):
    """A rolling robot that lives on, plugged in or not; `path` leads to its port as udev's links do."""

    def __init__(self, path: Path, seed: int = 1) -> None:
        super().__init__(daemon=True)
        self.path = path
        self._robot = RollingRobot(seed=seed)
        self._wanted = threading.Event()
        self._settled = threading.Event()
        self._done = False

    def put_in(self, wanted: bool) -> None:
        """Plug in, or pull out; returns when that is done."""
        self._settled.clear()
        (self._wanted.set if wanted else self._wanted.clear)()
        assert self._settled.wait(5)

    def end(self) -> None:
        self._done = True
        self.join(5)

    def run(self) -> None:
        port: Port | None = None
        pacer, line = Pacer(), self._robot.line()
        while not self._done:
            if port is None and self._wanted.is_set():
                port = Port()
                self.path.symlink_to(port.path)
            elif port is not None and not self._wanted.is_set():
                self.path.unlink()
                port.close()
                port = None
            self._settled.set()
            if port is None:
                time.sleep(PACE_S)
                line.read()  # nobody listens
            elif heard := port.read(PACE_S):
                line.write(heard)
            self._robot.advance_to(max(pacer.due_us(self._robot.board.time_us), self._robot.board.time_us))
            if port is not None and (said := line.read()):
                port.write(said)
        if port is not None:
            port.close()


@contextlib.contextmanager
def plugged_in(path: Path) -> Iterator[Plug]:
    """One that is plugged in at first."""
    plug = Plug(path)
    plug.start()
    plug.put_in(True)
    yield plug
    plug.end()


def drive(robot: Robot, seconds: float) -> None:
    """Drive; a robot that stopped itself, as on a busy machine, is told to go on."""
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        robot.poll()
        if robot.latest is not None and robot.latest.state == State.FAULT:
            robot.clear()
        robot.drive(150, 0)
        time.sleep(0.02)
