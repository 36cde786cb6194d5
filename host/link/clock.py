"""Time on both ends of the link: the host's clock, and what the robot's clock shows beside it."""

from __future__ import annotations

import time
from collections import deque
from typing import NamedTuple, Protocol


class Clock(Protocol):
    """The host's time, real or simulated."""

    def now_s(self) -> float:
        """Seconds since some fixed moment; never goes back."""
        ...

    def sleep_s(self, duration_s: float) -> None:
        """Let `duration_s` seconds pass."""
        ...


class SystemClock:
    """Real time."""

    def now_s(self) -> float:
        """Seconds of the monotonic clock."""
        return time.monotonic()

    def sleep_s(self, duration_s: float) -> None:
        """Let `duration_s` seconds pass."""
        time.sleep(duration_s)


class _RoundTrip(NamedTuple):
    sent_s: float  # host clock
    mcu_s: float  # robot clock, not wrapped
    received_s: float  # host clock


WINDOW = 64  # round trips remembered
DRIFT_PRIOR = 1e-3  # robot's clock against the host's, one sigma: crystals stay below 1e-4, resonators 5e-3
DELAY_SIGMA_S = 1.5e-3  # scatter of one transmission, as on USB
_DRIFT_RIDGE_S2 = (DELAY_SIGMA_S / DRIFT_PRIOR) ** 2


class RobotClock:
    """Host time of every robot time, from PING and PONG.

    A message cannot arrive before it was sent: each PING says that the robot's clock showed `mcu_time_us` at
    `sent_s` or later, each PONG that it did so at `received_s` or earlier. The tightest of either, once the
    drift is taken out by a line through the PINGs, enclose the offset; the shortest way there and back is
    taken as halved between the two. A host that reads late only loosens the PONGs, so the round trip learnt
    while connecting, when it reads at once, is kept.
    """

    def __init__(self) -> None:
        self._trips: deque[_RoundTrip] = deque(maxlen=WINDOW)
        self._newest_us = 0  # robot clock, not wrapped
        self._shortest_s = float("inf")
        self._middle_s = 0.0  # robot clock at which the line's offset holds
        self._offset_s = 0.0  # host minus robot
        self._drift = 0.0

    def add(self, sent_s: float, mcu_time_us: int, received_s: float) -> None:
        """Learn from one round trip."""
        if not self._trips:
            self._newest_us = mcu_time_us
        mcu_us = self._unwrap_us(mcu_time_us)
        self._newest_us = max(self._newest_us, mcu_us)
        self._trips.append(_RoundTrip(sent_s, mcu_us * 1e-6, received_s))
        self._fit()

    @property
    def round_trip_s(self) -> float:
        """Shortest way to the robot and back; the mapping is off by at most half of it, jitter apart."""
        return self._shortest_s

    @property
    def drift(self) -> float:
        """Host seconds per robot second, less one."""
        return self._drift

    def host_time_s(self, mcu_time_us: int) -> float:
        """Host time at which the robot's clock shows, or showed, `mcu_time_us` (within 2^31 us of now)."""
        mcu_s = self._unwrap_us(mcu_time_us) * 1e-6
        return mcu_s + self._offset_s + self._drift * (mcu_s - self._middle_s)

    def mcu_time_us(self, host_time_s: float) -> int:
        """What the robot's clock shows at `host_time_s`, wrapped to 32 bits."""
        since_middle_s = (host_time_s - self._offset_s - self._middle_s) / (1.0 + self._drift)
        return round((self._middle_s + since_middle_s) * 1e6) & 0xFFFF_FFFF

    def _unwrap_us(self, mcu_time_us: int) -> int:
        ahead = (mcu_time_us - self._newest_us) & 0xFFFF_FFFF
        return self._newest_us + (ahead - (1 << 32) if ahead >= 1 << 31 else ahead)

    def _fit(self) -> None:
        trips = self._trips
        self._middle_s = sum(trip.mcu_s for trip in trips) / len(trips)
        lead_s = [trip.sent_s - trip.mcu_s for trip in trips]
        mean_s = sum(lead_s) / len(trips)
        x = [trip.mcu_s - self._middle_s for trip in trips]
        covariance = sum(a * (b - mean_s) for a, b in zip(x, lead_s, strict=True))
        self._drift = covariance / (sum(a * a for a in x) + _DRIFT_RIDGE_S2)
        not_before_s = max(b - self._drift * a for a, b in zip(x, lead_s, strict=True))
        not_after_s = min(
            trip.received_s - trip.mcu_s - self._drift * a for a, trip in zip(x, trips, strict=True)
        )
        self._shortest_s = min(self._shortest_s, max(0.0, not_after_s - not_before_s))
        self._offset_s = not_before_s + self._shortest_s / 2
