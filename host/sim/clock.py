"""Virtual time as a program sees it."""

from __future__ import annotations

from collections.abc import Callable


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
