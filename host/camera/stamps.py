"""When a picture was taken: by its driver where that can be believed, else by when it arrived."""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Callable

EARLY_S = 0.002  # a picture cannot arrive before it was taken, but for rounding
LATE_S = 1.0  # later than this by the host's clock it was another clock
ERRORS_ALLOWED = 3
REMEMBERED = 32


class Stamps:
    """Times on the host's monotonic clock, never going back.

    A driver's time is believed when it lies between the last one and the arrival, not long before that. One
    that does not is replaced by the arrival less the usual delay; after a few of these all are.

    Parameters
    ----------
    name
        Of the camera.
    tell
        Hears once that the driver is not believed, and why.
    """

    def __init__(self, name: str, tell: Callable[[str], None]) -> None:
        self._name, self._tell = name, tell
        self._errors = 0
        self._driver_s = self._last_s = float("-inf")
        self._delays_s: deque[float] = deque(maxlen=REMEMBERED)

    @property
    def by_driver(self) -> bool:
        """Whether the driver is still believed."""
        return self._errors <= ERRORS_ALLOWED

    @property
    def delay_s(self) -> float:
        """From capture to arrival, as a rule; 0 where that is not known."""
        return statistics.median(self._delays_s) if self._delays_s else 0.0

    def taken_s(self, driver_s: float, arrived_s: float) -> float:
        """When a picture was taken that came at `arrived_s` with the driver's time `driver_s`."""
        delay_s = arrived_s - driver_s
        objection = self._objection(driver_s, delay_s) if self.by_driver else None
        if self.by_driver and objection is None:
            self._delays_s.append(delay_s)
            self._driver_s = taken_s = driver_s
        else:
            taken_s = arrived_s - self.delay_s
        if objection is not None:
            self._errors += 1
            if not self.by_driver:
                less = f" less {1e3 * self.delay_s:.0f} ms" if self._delays_s else ""
                self._tell(
                    f"camera {self._name}: its driver's times cannot be right ({objection}): "
                    f"times of arrival{less} are used"
                )
        self._last_s = max(self._last_s, taken_s)
        return self._last_s

    def _objection(self, driver_s: float, delay_s: float) -> str | None:
        if driver_s <= 0.0:
            return "there are none"
        if delay_s < -EARLY_S:
            return f"one lay {1e3 * -delay_s:.0f} ms ahead of its picture's arrival"
        if delay_s > LATE_S:
            return f"one lay {delay_s:.0f} s before its picture's arrival"
        return f"one did not follow the last, at {driver_s:.3f} s" if driver_s <= self._driver_s else None
