"""Virtual time as a program sees it, and virtual time kept at real time for somebody who watches."""

from __future__ import annotations

import time
from collections.abc import Callable

LATE_S = 0.05  # behind by more is lost time, which is not made up for
GRAIN_S = 0.002  # ahead by less is not worth sleeping for


class SimulatedClock:
    """Virtual time, a ``host.link.clock.Clock``: it passes only while somebody waits."""

    def __init__(self, now_us: Callable[[], int], advance_to: Callable[[int], None]) -> None:
        self._now_us, self._advance_to = now_us, advance_to
        self._owed_s = 0.0  # of sleep, less than a microsecond

    def now_s(self) -> float:
        """Seconds since the simulation began."""
        return self._now_us() * 1e-6

    def sleep_s(self, duration_s: float) -> None:
        """Let the world go on for `duration_s` seconds."""
        self._owed_s += max(duration_s, 0.0)
        whole_us = int(self._owed_s * 1e6)
        self._owed_s -= whole_us * 1e-6
        self._advance_to(self._now_us() + whole_us)


class Pacer:
    """Virtual time kept at real time, as far as the machine can."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._start_s = now_s()
        self.lost_s = 0.0  # real time that the simulation did not live through
        self.worst_s = 0.0  # furthest it was ever behind

    def due_us(self, reached_us: int) -> int:
        """Virtual time that should be reached by now."""
        passed_s = self._now_s() - self._start_s - self.lost_s
        behind_s = passed_s - reached_us * 1e-6
        self.worst_s = max(self.worst_s, behind_s)
        if behind_s > LATE_S:
            self.lost_s += behind_s
            passed_s -= behind_s
        return int(passed_s * 1e6)

    def hold(self, reached_us: int) -> None:
        """Wait until virtual time that was reached is due."""
        ahead_s = (reached_us - self.due_us(reached_us)) * 1e-6
        if ahead_s > GRAIN_S:
            time.sleep(ahead_s)

    def real_s(self, virtual_s: float) -> float:
        """When, on the real clock, a virtual time was due or will be."""
        return self._start_s + self.lost_s + virtual_s
