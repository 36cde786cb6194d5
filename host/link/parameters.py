"""What may differ between two robots, and is kept in the robot's EEPROM: the schema of the parameters.

Part of the link's schema: a change here changes SCHEMA_HASH, and a firmware with another list starts with
defaults.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class Param(IntEnum):
    """What PARAM_READ and PARAM_WRITE name."""

    UM_PER_COUNT_LEFT = 0
    UM_PER_COUNT_RIGHT = 1
    TRACK_UM = 2
    SPEED_MAX_MM_S = 3
    ACCELERATION_MM_S2 = 4
    STATIC_DUTY_LEFT = 5
    STATIC_DUTY_RIGHT = 6
    VELOCITY_Q8_LEFT = 7
    VELOCITY_Q8_RIGHT = 8
    ACCELERATION_Q8 = 9
    PROPORTIONAL_Q8 = 10
    INTEGRAL_Q12 = 11
    INTEGRAL_LIMIT = 12
    BATTERY_FULL_MV = 13
    BATTERY_MIN_MV = 14


class Parameter(NamedTuple):
    """One parameter: what it is at first, and what it may be."""

    default: int
    lowest: int
    highest: int
    meaning: str


PARAMETERS: dict[Param, Parameter] = {
    Param.UM_PER_COUNT_LEFT: Parameter(5000, 100, 40_000, "travel of the left wheel's rim in one count, um"),
    Param.UM_PER_COUNT_RIGHT: Parameter(5000, 100, 40_000, "the same, right wheel"),
    Param.TRACK_UM: Parameter(150_000, 20_000, 1_000_000, "between the wheels' contact points, um"),
    Param.SPEED_MAX_MM_S: Parameter(600, 20, 2000, "fastest a wheel may be asked to go, mm/s"),
    Param.ACCELERATION_MM_S2: Parameter(1000, 50, 10_000, "most a wheel's speed is made to change, mm/s^2"),
    Param.STATIC_DUTY_LEFT: Parameter(2600, 0, 32_767, "duty that just overcomes friction, 32767 = full"),
    Param.STATIC_DUTY_RIGHT: Parameter(2600, 0, 32_767, "the same, right motor"),
    Param.VELOCITY_Q8_LEFT: Parameter(690, 0, 32_767, "duty per 1/16 mm/s of speed, times 256, left motor"),
    Param.VELOCITY_Q8_RIGHT: Parameter(690, 0, 32_767, "the same, right motor"),
    Param.ACCELERATION_Q8: Parameter(0, 0, 32_767, "duty per 1/16 mm/s of speed gained in a tick, times 256"),
    Param.PROPORTIONAL_Q8: Parameter(345, 0, 32_767, "duty per 1/16 mm/s of error, times 256"),
    Param.INTEGRAL_Q12: Parameter(140, 0, 32_767, "duty per 1/16 mm/s of error and tick, times 4096"),
    Param.INTEGRAL_LIMIT: Parameter(8000, 0, 32_767, "duty the integral alone may reach"),
    Param.BATTERY_FULL_MV: Parameter(7400, 1000, 30_000, "voltage at which the duties above hold, mV"),
    Param.BATTERY_MIN_MV: Parameter(6400, 0, 30_000, "less for 0.5 s stops the robot, mV; 0: not watched"),
}
