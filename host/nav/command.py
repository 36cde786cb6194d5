"""What a decision tells the wheels, in numbers and in words."""

from __future__ import annotations

import math
from dataclasses import dataclass

from host.nav.config import NavConfig

SLOWEST_TURN_RAD_S = 0.35  # slower turns stick, and their edges come too far apart to tell the heading


@dataclass(frozen=True)
class Command:
    """What the wheels should do until the next frame, and why."""

    v_mm_s: float
    omega_rad_s: float  # positive to the right
    reason: str
    outcome: str | None = None  # such as "goal" or "blocked", when the drive is over
    hands_off: bool = False  # send the robot nothing
    way: tuple[tuple[float, float], ...] = ()  # points (x, z) in cm that it leads along, for who looks on


def turn_rad_s(off: float, config: NavConfig) -> float:
    """How fast to turn in place towards what is so far off straight ahead."""
    return math.copysign(min(config.turn_rad_s, max(SLOWEST_TURN_RAD_S, 1.5 * abs(off))), off)


def by_degrees(off: float) -> str:
    return f"turn {'right' if off > 0 else 'left'} by {abs(math.degrees(off)):.0f} deg"
