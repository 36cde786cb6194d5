"""The firmware's own division against Python's, on the simulated processor."""

from __future__ import annotations

import random
import struct
import subprocess
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import pytest

from host.sim.avr.board import AvrBoard

ROOT = Path(__file__).resolve().parents[3]

PROGRAM = """
#include <avr/io.h>
#include <stdint.h>
static void say(uint32_t v, uint8_t n)
{
    for (; n > 0; n--, v >>= 8) { while (!(UCSR0A & 1 << UDRE0)) {} UDR0 = (uint8_t)v; }
}
static uint32_t hear(void)
{
    uint32_t v = 0;
    for (uint8_t k = 0; k < 4; k++) { while (!(UCSR0A & 1 << RXC0)) {} v |= (uint32_t)UDR0 << 8 * k; }
    return v;
}
int main(void)
{
    UCSR0A = 1 << U2X0; UBRR0 = 7; UCSR0C = 6; UCSR0B = 1 << RXEN0 | 1 << TXEN0; TCCR1B = 1;
    for (;;) {
        uint32_t a = hear(), b = hear();
        TCNT1 = 0;
        uint32_t quotient = a / b, rest = a % b;
        uint16_t cycles = TCNT1;
        say(quotient, 4); say(rest, 4);
        int32_t signed_a = (int32_t)a, signed_b = (int32_t)b;
        say((uint32_t)(signed_a / signed_b), 4); say((uint32_t)(signed_a % signed_b), 4);
        say(cycles, 2);
    }
}
"""


@pytest.fixture
def divider(make_board: Callable[..., AvrBoard], tmp_path: Path) -> AvrBoard:
    """A board that divides what it is sent."""
    source, elf = tmp_path / "program.c", tmp_path / "program.elf"
    source.write_text(PROGRAM)
    command = ["avr-gcc", "-mmcu=atmega328p", "-Os", "-std=gnu11", source]
    subprocess.run([*command, ROOT / "firmware/src/avr/divide.S", "-o", elf], check=True, capture_output=True)
    board = make_board(elf=elf)
    board.step(1000)
    return board


def signed(number: int) -> int:
    """The same 32 bits as a number with a sign."""
    return number - (1 << 32) if number >> 31 else number


def towards_zero(number: int, by: int) -> tuple[int, int]:
    """C's quotient and remainder."""
    size = abs(number) // abs(by)
    quotient = size if (number < 0) == (by < 0) else -size
    return signed(quotient & 0xFFFF_FFFF), number - quotient * by


def some_number(chance: random.Random) -> int:
    """Of any size, with those on whose edges mistakes are made."""
    size = 1 << chance.randint(0, 31)
    kind = chance.randint(0, 5)
    edges = {0: size, 1: size - 1, 2: -chance.getrandbits(31), 3: chance.choice([0, 2**32 - 1, 2**31])}
    return edges.get(kind, chance.getrandbits(chance.randint(1, 32))) & 0xFFFF_FFFF


def test_quotients_and_remainders_are_right_and_quick(divider: AvrBoard) -> None:
    chance = random.Random(1)
    cycles: dict[str, list[int]] = defaultdict(list)
    for _ in range(5000):
        number, by = some_number(chance), some_number(chance) or 1
        divider.write(struct.pack("<II", number, by))
        divider.step(1300)
        quotient, rest, signed_quotient, signed_rest, took = struct.unpack("<IIiiH", divider.read())
        assert (quotient, rest) == divmod(number, by), (number, by)
        told = signed_quotient, signed_rest
        assert told == towards_zero(signed(number), signed(by)), (signed(number), signed(by))
        cycles["power of two" if by & (by - 1) == 0 else "other"].append(took)
    assert max(cycles["power of two"]) < 150
    assert max(cycles["other"]) < 520
    assert sum(cycles["other"]) / len(cycles["other"]) < 330
