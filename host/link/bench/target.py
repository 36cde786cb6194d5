"""The robot under test: a simulated one in virtual time, or one on a port."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from host.errors import UsageError
from host.link.bench.tap import Tap
from host.link.clock import Clock, SystemClock
from host.link.faults import FaultyLine
from host.link.ports import RobotPort
from host.link.transport import Transport
from host.sim.kinds import is_simulated

if TYPE_CHECKING:  # so that --help need not wait for the simulator
    from host.sim.rolling import RollingRobot


@dataclass(frozen=True)
class Target:
    """One robot and the line to it: host - `near` - `faults` - `far` - robot."""

    uri: str
    clock: Clock
    near: Tap  # what the host sends and gets; what a client is given as its transport
    faults: FaultyLine  # perfect until told otherwise
    far: Tap  # what really reaches the robot, and what it really says
    rolling: RollingRobot | None  # the truth, where it is simulated

    def wait_s(self, duration_s: float) -> None:
        """Let time pass."""
        self.clock.sleep_s(duration_s)


@contextmanager
def open_target(uri: str, *, seed: int = 0) -> Iterator[Target]:
    """Open a robot's line; let go of it at the end.

    Parameters
    ----------
    uri
        ``sim:`` or ``avr:`` with options, a port's path, or ``auto``.
    seed
        Decides the chances of the faults.

    Raises
    ------
    UsageError, DeviceError
        As the simulated robot and the serial port say.
    """
    from host.sim.rolling import open_rolling

    rolling = open_rolling(uri) if is_simulated(uri) else None
    clock: Clock = SystemClock() if rolling is None else rolling.clock
    port = RobotPort(uri)
    line: Transport = port.open() if rolling is None else rolling.line()
    far = Tap(line, clock)
    faults = FaultyLine(far, clock, seed=seed)
    near = Tap(faults, clock)
    if rolling is not None:
        rolling.watchers.append(faults.pump)  # what is late comes to the millisecond
    try:
        yield Target(port.name, clock, near, faults, far, rolling)
    finally:
        near.close()


def check_wheels_up(uri: str, wheels_up: bool) -> None:
    """UsageError unless the wheels of a robot that is not simulated may turn."""
    if not (wheels_up or is_simulated(uri)):
        raise UsageError(
            f"robot {uri}: this makes the wheels turn: put the robot on blocks, wheels free, "
            "then add --wheels-up"
        )
