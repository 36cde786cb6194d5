"""How old a picture is by the time the next command takes over from it: what it must be able to react in.

A command holds until the next one. What it was made of is by then older by the time between two pictures, the
camera's delay and the time it takes to understand a picture; speeds are chosen so that all of it is allowed
for, at 5 pictures a second as at 60, and on a slow machine as on a quick one.
"""

from __future__ import annotations

import math
from collections import deque

from host.nav.config import MOST_REACTION_S

MOTORS_S = 0.13  # from a command to its effect on the wheels
REMEMBERED = 8  # pictures: one that came late makes the robot careful for so long
STEP_S = 0.02  # reactions are given in steps of this


class Pace:
    """Learns from every command that was sent."""

    def __init__(self, least_s: float):
        self._least_s = least_s
        self._last_s: float | None = None
        self._acted_s: deque[float] = deque(maxlen=REMEMBERED)

    def commanded(self, picture_s: float, now_s: float) -> None:
        """A command made of the picture taken at `picture_s` goes out now, and ends the one before."""
        if self._last_s is not None and self._last_s != picture_s:
            self._acted_s.append(now_s - self._last_s)
        self._last_s = picture_s

    def stopped(self) -> None:
        """The robot was told to stand, which needs no picture."""
        self._last_s = None

    @property
    def reaction_s(self) -> float:
        """From what a picture shows to the wheels' answer to it, at worst; never less than configured."""
        found = max(self._acted_s, default=0.0) + MOTORS_S
        return min(max(self._least_s, STEP_S * math.ceil(found / STEP_S - 1e-6)), MOST_REACTION_S)
