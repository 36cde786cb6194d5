"""Motors of any make under the firmware's control, their true motion known: figures are measured here."""

from __future__ import annotations

import math
import os
import random
import subprocess
from collections.abc import Iterator
from dataclasses import astuple, dataclass, replace
from pathlib import Path
from typing import Any

import cffi

HERE = Path(__file__).parent
FIRMWARE = HERE.parents[1] / "firmware/src"
PARTS = ("encoder", "wheel", "motor", "move")
LEFT, RIGHT = 0, 1
TICK_S = 0.005
TRACK_MM = 150.0

DECLARATIONS = """
    struct rig_motor { double full_mm_s, dead_zone, stiction, lag_s, rub; double edges[4]; double phase; };
    struct rig *rig_new(const struct rig_motor *l, const struct rig_motor *r, double v, double sag_v);
    void rig_tick(struct rig *, int16_t left_q4, int16_t right_q4);
    int rig_move(struct rig *, bool turns, int16_t amount, uint16_t speed, int pause_at, int ticks_most);
    void rig_hold(struct rig *, uint8_t side, bool held);
    void rig_blind(struct rig *, uint8_t side);
    double rig_mm_s(struct rig *, uint8_t side);
    double rig_mm(struct rig *, uint8_t side);
    int16_t rig_encoder_q4(struct rig *, uint8_t side);
    int16_t rig_wheel_q4(struct rig *, uint8_t side);
    void free(void *);
"""


@dataclass(frozen=True)
class Motor:
    """A gear motor and its encoder; as it is by default, it is what the parameters' defaults believe."""

    full_mm_s: float = 700.0
    dead_zone: float = 0.08
    stiction: float = 1.0
    lag_s: float = 0.06
    rub: float = 0.0
    edges: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    phase: float = 0.5


@dataclass(frozen=True)
class Robot:
    """Two motors and a battery."""

    left: Motor = Motor()
    right: Motor = Motor()
    battery_v: float = 7.4
    sag_v: float = 0.0


def unequal_robots(count: int, seed: int = 1) -> Iterator[Robot]:
    """Motors up to 15 % off either way, slow or quick; a wheel may stand anywhere in its first count."""
    chance = random.Random(seed)
    for _ in range(count):
        lag_s, rub = chance.uniform(0.03, 0.09), float(chance.getrandbits(1))

        def motor(lag_s: float = lag_s, rub: float = rub) -> Motor:
            full_mm_s = 700 * (1 + chance.uniform(-0.15, 0.15))
            return Motor(full_mm_s, lag_s=lag_s, rub=rub, phase=chance.random())

        yield Robot(motor(), motor())


def any_robots(count: int, seed: int = 1) -> Iterator[Robot]:
    """Besides: dead zones of 5 to 15 %, stiction, edges off by up to 12 % of a count, any battery."""
    chance = random.Random(seed)

    def motor(like: Motor) -> Motor:
        dead_zone, stiction = chance.uniform(0.05, 0.15), chance.uniform(1.0, 1.2)
        a, b, c, d = (chance.uniform(-0.12, 0.12) for _ in range(4))
        return replace(
            like,
            dead_zone=dead_zone,
            stiction=stiction,
            lag_s=like.lag_s * chance.uniform(0.9, 1.1),
            edges=(a, b, c, d),
        )

    for robot in unequal_robots(count, seed):
        yield Robot(motor(robot.left), motor(robot.right), chance.uniform(6.6, 8.4), chance.uniform(0, 0.4))


class Rig:
    """One robot from rest. Its true motion is known here, and nowhere in the firmware."""

    def __init__(self, motion: Motion, robot: Robot) -> None:
        self._c = motion.c
        left, right = (motion.struct(motor) for motor in (robot.left, robot.right))
        self._rig = motion.hold(self._c.rig_new(left, right, robot.battery_v, robot.sag_v))

    def drive(self, left_mm_s: float, right_mm_s: float, ticks: int = 1) -> None:
        """Run the loop at these setpoints."""
        for _ in range(ticks):
            self._c.rig_tick(self._rig, round(left_mm_s * 16), round(right_mm_s * 16))

    def move(self, distance_mm: int, speed_mm_s: int, pause_at: int = 0) -> float | None:
        """MOVE; seconds it took, or None: it has not ended within 60."""
        return self._seconds(self._c.rig_move(self._rig, False, distance_mm, speed_mm_s, pause_at, 12_000))

    def turn(self, angle_mrad: int, rate_mrad_s: int) -> float | None:
        """TURN."""
        return self._seconds(self._c.rig_move(self._rig, True, angle_mrad, rate_mrad_s, 0, 12_000))

    def hold(self, held: bool) -> None:
        """Hold both wheels, or let them loose."""
        self._c.rig_hold(self._rig, LEFT, held)
        self._c.rig_hold(self._rig, RIGHT, held)

    def break_encoder(self, side: int) -> None:
        """No edge comes any more."""
        self._c.rig_blind(self._rig, side)

    def speed_mm_s(self, side: int) -> float:
        """True speed of a wheel."""
        return float(self._c.rig_mm_s(self._rig, side))

    def told_mm_s(self, side: int) -> float:
        """Speed by its encoder."""
        return float(self._c.rig_encoder_q4(self._rig, side)) / 16

    @property
    def way_mm(self) -> float:
        """True way of the axle's middle."""
        return float(self._c.rig_mm(self._rig, LEFT) + self._c.rig_mm(self._rig, RIGHT)) / 2

    @property
    def heading_deg(self) -> float:
        """True heading, to the right."""
        return math.degrees((self._c.rig_mm(self._rig, LEFT) - self._c.rig_mm(self._rig, RIGHT)) / TRACK_MM)

    def _seconds(self, ticks: int) -> float | None:
        return None if ticks < 0 else ticks * TICK_S


class Motion:
    """The firmware's motion control in C, and motors for it."""

    def __init__(self, build_folder: Path) -> None:
        library = build_folder / "libmotion.so"
        flags = ["-std=gnu11", "-O1", "-g", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-shared", "-fPIC"]
        checks = ["-fsanitize=undefined", "-fno-sanitize-recover=all"]
        sources = [HERE / "motion_rig.c", *(FIRMWARE / f"{part}.c" for part in PARTS)]
        compiler = os.environ.get("CC", "cc")
        command = [compiler, *flags, *checks, f"-I{FIRMWARE}", *sources, "-lm", "-o", library]
        subprocess.run(command, check=True)
        self._ffi = cffi.FFI()
        self._ffi.cdef(DECLARATIONS)
        self.c: Any = self._ffi.dlopen(str(library))

    def struct(self, motor: Motor) -> Any:
        """A motor for C."""
        return self._ffi.new("struct rig_motor *", astuple(motor))

    def hold(self, made: Any) -> Any:
        """Free it with the last of its users."""
        return self._ffi.gc(made, self.c.free)

    def rig(self, robot: Robot) -> Rig:
        """A robot at rest."""
        return Rig(self, robot)
