"""A board on a bench: a hand on the line, and two wheels that turn as their motors drive them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from host.link.protocol import (
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    Decoder,
    Drive,
    Hello,
    HelloRequest,
    Message,
    Telemetry,
    encode,
)
from host.sim.board import Board, Side

MakeBoard = Callable[..., Board]  # of seed and EEPROM, of either kind

MM_PER_COUNT = 5.0
COAST_LAG_S = 0.5
FORWARD_PINS = ((False, False), (True, False), (True, True), (False, True))  # (a, b)


@dataclass
class Wheel:
    """A gear motor with dry friction and a lag; shorted, it brakes, and open, it rolls out."""

    mm_s_at_full: float = 700.0
    dead_zone: float = 0.08
    lag_s: float = 0.06
    speed_mm_s: float = 0.0
    position_mm: float = 0.0
    count: int = 0

    def turn(self, board: Board, side: Side, duration_us: int) -> None:
        """Move on by `duration_us` under the present duty; its edges come during the next step."""
        duty = board.duty(side)
        was_mm_s, was_mm, duration_s = self.speed_mm_s, self.position_mm, duration_us * 1e-6
        if was_mm_s or abs(duty) > self.dead_zone:
            free = duty - math.copysign(self.dead_zone, was_mm_s or duty)
            aim_mm_s = free / (1.0 - self.dead_zone) * self.mm_s_at_full
            lag_s = COAST_LAG_S if board.coasting(side) else self.lag_s
            self.speed_mm_s += (aim_mm_s - was_mm_s) * min(1.0, duration_s / lag_s)
        if self.speed_mm_s * was_mm_s < 0.0:
            self.speed_mm_s = 0.0  # friction stops a wheel and does not turn it
        self.position_mm += (was_mm_s + self.speed_mm_s) / 2 * duration_s
        while (count := math.floor(self.position_mm / MM_PER_COUNT)) != self.count:
            forward = count > self.count
            edge_mm = (self.count + forward) * MM_PER_COUNT
            share = (edge_mm - was_mm) / (self.position_mm - was_mm)
            self.count += 1 if forward else -1
            at_us = board.time_us + int(share * duration_us)
            board.set_encoder_pins(side, *FORWARD_PINS[self.count % 4], at_us)


@dataclass
class Bench:
    """One board, its wheels, and the host's end of the line; also a clock that lets time pass."""

    board: Board = field(default_factory=Board)
    wheels: tuple[Wheel, Wheel] = field(default_factory=lambda: (Wheel(), Wheel()))
    decoder: Decoder = field(default_factory=lambda: Decoder(to_host=True))
    seq: int = 0
    started_us: int = 0  # on the bench's clock, where the board's clock stood at 0

    def run_ms(self, milliseconds: int) -> None:
        """Let time pass, wheels and board in turn."""
        for _ in range(milliseconds):
            for side, wheel in zip(Side, self.wheels, strict=True):
                wheel.turn(self.board, side, 1000)
            self.board.step(1000)

    def now_s(self) -> float:
        """The bench's clock, for host.link.robot."""
        return self.board.time_us * 1e-6

    def sleep_s(self, duration_s: float) -> None:
        """Let time pass, for host.link.robot."""
        self.run_ms(max(1, round(duration_s * 1000)))

    @property
    def duties(self) -> tuple[float, float]:
        """Left and right."""
        return self.board.duty(Side.LEFT), self.board.duty(Side.RIGHT)

    def frame(self, message: Message) -> bytes:
        """The bytes of a message with the next sequence number."""
        self.seq = (self.seq + 1) % 256
        return encode(message, self.seq)

    def tell(self, message: Message) -> None:
        """Put a message on the line."""
        self.board.write(self.frame(message))

    def hear(self) -> list[Message]:
        """What the board has said since the last call."""
        return [received.message for received in self.decoder.feed(self.board.read())]

    def hear_telemetry(self) -> Telemetry:
        """The latest of what the board has said since the last call."""
        return [message for message in self.hear() if isinstance(message, Telemetry)][-1]

    def open_session(self) -> Hello:
        """Say hello and wait for the answer."""
        self.tell(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH))
        self.run_ms(3)
        return [message for message in self.hear() if isinstance(message, Hello)][-1]

    def drive(self, v_mm_s: int, omega_mrad_s: int = 0, hold_ms: int = 200) -> Drive:
        """A DRIVE that dies `hold_ms` from now."""
        mcu_us = self.board.time_us - self.started_us
        return Drive(v_mm_s, omega_mrad_s, (mcu_us + hold_ms * 1000) % 2**32)

    def drive_for_ms(self, milliseconds: int, v_mm_s: int, omega_mrad_s: int = 0) -> None:
        """Drive as a host does, with a DRIVE every 50 ms."""
        for _ in range(milliseconds // 50):
            self.tell(self.drive(v_mm_s, omega_mrad_s))
            self.run_ms(50)
