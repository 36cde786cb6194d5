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


class _Window(NamedTuple):
    """What one PING and its PONG say: the robot's clock showed `mcu_s` between these two."""

    earliest_s: float  # host clock
    mcu_s: float  # robot clock, not wrapped
    latest_s: float  # host clock


REMEMBERED = 256  # windows; half a minute of driving
RECENT = 32  # windows over which an error of the drift does not yet matter
BURST_S = 0.2  # in which drift itself does not matter
DRIFT_SIGMA = 3e-3  # expected of one clock against the other before it is measured: a ceramic resonator's


class RobotClock:
    """Host time of every robot time, learnt from PING and PONG.

    A message cannot arrive before it was sent: a PING says when, by the host's clock, the robot's showed what
    it did at the earliest, its PONG at the latest. Once the drift is taken out by a line through the PINGs,
    the tightest of either enclose the offset, which is taken in the middle. A host busy with other things
    reads late and so loosens the PONGs; the narrowest enclosure ever seen, as a rule the one from connecting,
    where the host reads at once, therefore stays.

    On an even line the mapping is exact; with 5 ms of jitter each way and clocks that differ by up to 0.5 %
    it is within 1 ms, 99 times of 100.
    """

    def __init__(self) -> None:
        self._windows: deque[_Window] = deque(maxlen=REMEMBERED)
        self._newest_us = 0  # robot clock, not wrapped
        self._narrowest_s = float("inf")
        self._middle_s = 0.0  # robot clock at which the line's offset holds
        self._offset_s = 0.0  # host minus robot
        self._drift = 0.0  # host seconds per robot second, less one

    def add(self, earliest_s: float, mcu_time_us: int, latest_s: float) -> None:
        """Learn that the robot's clock showed `mcu_time_us` between two host times."""
        if not self._windows:
            self._newest_us = mcu_time_us
        mcu_us = self._unwrap_us(mcu_time_us)
        self._newest_us = max(self._newest_us, mcu_us)
        self._windows.append(_Window(earliest_s, mcu_us * 1e-6, latest_s))
        self._fit()

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
        earliest_s, mcu_s, latest_s = zip(*self._windows, strict=True)
        self._middle_s = middle_s = sum(mcu_s) / len(mcu_s)
        x = [mcu - middle_s for mcu in mcu_s]
        lead_s = [early - mcu for early, mcu in zip(earliest_s, mcu_s, strict=True)]
        self._drift = drift = _slope(x, lead_s)
        lead_s = [lead - drift * a for a, lead in zip(x, lead_s, strict=True)]
        burst_from = x[-1] - BURST_S
        burst = len([a for a in x if a >= burst_from])
        last = zip(x[-burst:], mcu_s[-burst:], latest_s[-burst:], strict=True)
        lag_s = min(late - mcu - drift * a for a, mcu, late in last)
        self._narrowest_s = min(self._narrowest_s, lag_s - max(lead_s[-burst:]))
        self._offset_s = max(lead_s[-RECENT:]) + self._narrowest_s / 2


def _slope(x: list[float], y: list[float]) -> float:
    """Slope of y over x, whose mean is 0; near 0 as long as the scatter of y leaves it open."""
    mean = sum(y) / len(y)
    xx = sum([a * a for a in x])  # lists, not generators: this is done for every PONG
    if xx == 0.0:
        return 0.0
    xy = sum([a * (b - mean) for a, b in zip(x, y, strict=True)])
    slope = xy / xx
    scatter2 = sum([(b - mean - slope * a) ** 2 for a, b in zip(x, y, strict=True)]) / len(y)
    return xy / (xx + scatter2 / DRIFT_SIGMA**2)
