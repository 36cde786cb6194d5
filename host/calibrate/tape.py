"""Who measures where the robot came to stand: a person with a tape, or in simulation one who knows."""

from __future__ import annotations

import math
import select
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

import numpy as np

from host.errors import UsageError

if TYPE_CHECKING:  # so that --help need not wait for the simulator
    from host.sim.rolling import RollingRobot

READING_MM = 1.0  # error of the simulated person's reading, in each direction
AIM_RAD = math.radians(0.5)  # and of putting the robot straight on its mark


class Tape(Protocol):
    """Measures from a mark on the floor."""

    def mark(self, what_next: str) -> None:
        """The robot stands on the mark, its axle's middle over it, looking along the line; then drives."""
        ...

    def read(self) -> tuple[float, float]:
        """Where the axle's middle now is: mm ahead of the mark, and to its right."""
        ...


class SimulatedTape:
    """A person who reads the true place to a millimetre and aims to half a degree."""

    def __init__(self, rolling: RollingRobot, seed: int) -> None:
        self._rolling = rolling
        self._chance = np.random.default_rng((0x7A9E, seed))
        self._mark = (0.0, 0.0, 0.0)

    def mark(self, what_next: str) -> None:
        """Where it stands now; nobody moves it."""
        x, z, heading = self._rolling.body.axle
        self._mark = (x, z, heading + float(self._chance.normal(0.0, AIM_RAD)))

    def read(self) -> tuple[float, float]:
        """The truth, nearly."""
        ahead, right = self.truth()
        error = self._chance.normal(0.0, READING_MM, 2)
        return ahead + float(error[0]), right + float(error[1])

    def truth(self) -> tuple[float, float]:
        """Exactly, from the mark as it was aimed."""
        x, z, _ = self._rolling.body.axle
        x0, z0, heading = self._mark
        dx, dz = 10 * (x - x0), 10 * (z - z0)
        return (
            dx * math.sin(heading) + dz * math.cos(heading),
            dx * math.cos(heading) - dz * math.sin(heading),
        )


class PersonWithTape:
    """Asks on the terminal; `meanwhile` is called ten times a second, so that the robot is not left alone."""

    def __init__(self, meanwhile: Callable[[], object], ask: Callable[[str], None] | None = None) -> None:
        self._meanwhile = meanwhile
        self._ask = ask or (lambda text: print(text, end="", file=sys.stderr, flush=True))

    def mark(self, what_next: str) -> None:
        """Wait until the robot has been put on its mark."""
        how = "Put the robot on its mark, looking along the line, then press Enter: "
        self.await_enter(f"\n{what_next}\n{how}")

    def await_enter(self, text: str) -> None:
        """Say this, and wait until Enter is pressed."""
        self._ask(text)
        self._line()

    def read(self) -> tuple[float, float]:
        """Ask until two numbers come."""
        self._ask("Where does the axle's middle stand? mm ahead of the mark, mm to the right (left: minus): ")
        while True:
            try:
                ahead, right = (float(part) for part in self._line().replace(",", " ").split())
                if math.isfinite(ahead) and math.isfinite(right):
                    return ahead, right
            except ValueError:
                pass
            self._ask("Two numbers, such as 1993 -12: ")

    def _line(self) -> str:
        while not select.select([sys.stdin], [], [], 0.1)[0]:
            self._meanwhile()
        line = sys.stdin.readline()
        if not line:
            raise UsageError("nobody answers: calibrating a real robot needs a person at a terminal")
        return line
