"""The simulated ATmega where simavr differs from silicon: small programs show each correction at work."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from host.errors import DeviceError, UsageError
from host.link.protocol import ResetCause
from host.sim.avr.board import AvrBoard
from host.sim.board import Side

MakeBoard = Callable[..., AvrBoard]
RunProgram = Callable[..., AvrBoard]

HEAD = """
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>
static void line(unsigned divider)
{
    UCSR0A = 1 << U2X0; UBRR0 = divider; UCSR0C = 6; UCSR0B = 1 << RXEN0 | 1 << TXEN0;
}
static void say(unsigned char byte)
{
    while (!(UCSR0A & 1 << UDRE0)) {}
    UDR0 = byte;
}
"""


@pytest.fixture
def run_program(make_board: MakeBoard, tmp_path: Path) -> RunProgram:
    """Compiles a program for the ATmega and puts it on a board."""

    def run(program: str) -> AvrBoard:
        source, elf = tmp_path / "program.c", tmp_path / "program.elf"
        source.write_text(HEAD + program)
        command = ["avr-gcc", "-mmcu=atmega328p", "-Os", "-std=gnu11", source, "-o", elf]
        subprocess.run(command, check=True, capture_output=True)
        return make_board(elf=elf)

    return run


def test_an_empty_interrupt_takes_the_11_cycles_of_silicon(run_program: RunProgram) -> None:
    board = run_program(
        "ISR(TIMER0_OVF_vect, ISR_NAKED) { reti(); }"
        "int main(void) { TCCR0B = 1; TIMSK0 = 1; sei(); for (;;) {} }"
    )
    board.step(1000)
    clock = board.stats().interrupts["clock"]
    assert clock.runs == 62  # one in 256 cycles
    assert clock.worst_cycles == 4 + 3 + 4  # entry, the vector's jump, return


def test_interrupts_that_wait_together_run_in_the_order_of_their_vectors(run_program: RunProgram) -> None:
    board = run_program(
        "volatile unsigned char at, order[4];"
        "ISR(TIMER0_OVF_vect) { order[at++] = 'o'; TIMSK0 = 0; }"
        "ISR(TIMER2_COMPA_vect) { order[at++] = 'm'; TIMSK2 = 0; }"
        "ISR(PCINT1_vect) { order[at++] = 'e'; }"
        "int main(void) { line(7); TCCR0B = 1; TCCR2B = 1; OCR2A = 100; PCMSK1 = 15; PCICR = 2;"
        " TIMSK0 = 1; TIMSK2 = 2; while (!(PINC & 1)) {} while (!(TIFR0 & 1 && TIFR2 & 2 && PCIFR & 2)) {}"
        " sei(); while (at < 3) {} for (char k = 0; k < 3; k++) say(order[k]); for (;;) {} }"
    )
    board.step(500)
    board.set_encoder_pins(Side.LEFT, True, False)
    board.step(500)
    assert board.read() == b"emo"


def test_a_byte_takes_ten_bit_times_either_way(run_program: RunProgram) -> None:
    board = run_program(
        "int main(void) { line(7); for (;;) { while (!(UCSR0A & 1 << RXC0)) {} say(UDR0); } }"
    )
    board.step(1000)
    board.write(b"ab")
    board.step(79)
    assert board.read() == b""
    board.step(3)  # and as long as the program takes to turn a byte round
    assert board.read() == b"a"
    board.step(37)
    assert board.read() == b""
    board.step(3)
    assert board.read() == b"b"


def test_the_fourth_unread_byte_is_lost_and_shows_as_overrun(run_program: RunProgram) -> None:
    board = run_program(
        "int main(void) { line(7); while (!(UCSR0A & 1 << DOR0)) {}"
        " for (char k = 0; k < 3; k++) say(UDR0); say(UCSR0A & (1 << RXC0 | 1 << DOR0)); for (;;) {} }"
    )
    board.step(1000)
    board.write(b"abcd")
    board.step(1000)
    assert board.stats().rx_overruns == 1
    assert board.read() == b"abc\0"


@pytest.mark.parametrize(("divider", "fits"), [(7, True), (6, False), (8, False), (16, False)])
def test_bytes_at_another_baud_rate_are_not_understood(
    run_program: RunProgram, divider: int, fits: bool
) -> None:
    board = run_program(f"int main(void) {{ line({divider}); for (;;) say('x'); }}")
    board.step(10_000)
    assert (len(board.read()) > 200) == fits
    assert (board.stats().rx_wrong_baud == 0) == fits


def test_a_port_write_leaves_driven_inputs_as_they_are(run_program: RunProgram) -> None:
    board = run_program(
        "int main(void) { line(7); PORTC = 0x0F;"
        " for (;;) { PORTC = 0x1F; DDRC = 0x10; PORTC = 0x0F; say(PINC & 0x0F); } }"
    )
    board.set_encoder_pins(Side.LEFT, True, False)
    board.set_encoder_pins(Side.RIGHT, False, True)
    board.step(1000)
    assert set(board.read()) == {0b1001}


def test_edges_and_bytes_to_come_outlive_a_reset(run_program: RunProgram) -> None:
    board = run_program(
        "int main(void) { wdt_enable(WDTO_15MS); line(7); char was = PINC & 1; say(MCUSR);"
        " for (;;) { if (UCSR0A & 1 << RXC0) say(UDR0);"
        " if ((PINC & 1) != was) { was = PINC & 1; say(was ? 'e' : 'E'); } } }"
    )
    board.set_encoder_pins(Side.LEFT, True, False, 21_000)
    board.step(500)
    board.write(bytes(600) + b"!")  # 24 ms
    board.step(29_500)
    said = board.read().replace(b"\0", b"")
    assert said == b"\x01\x08e!"
    assert board.stats().resets == 1
    board.step(1_000_000)
    assert board.time_us == 1_030_000
    assert 50 < board.stats().resets < 70


def test_one_word_additions_are_skipped_as_one_word(run_program: RunProgram) -> None:
    # ldi 0; skip the next if bit 0 is clear; adiw 15; adiw 1. A skip of two words would lose the last.
    board = run_program(
        "int main(void) { line(7); unsigned r; unsigned char bit = 0; for (;;) { bit ^= 1;"
        ' __asm__ volatile("clr %A0\\n clr %B0\\n sbrc %1, 0\\n adiw %0, 15\\n adiw %0, 1\\n"'
        ' : "=&w"(r) : "r"(bit)); say(r); } }'
    )
    board.step(2000)
    assert set(board.read()) == {1, 16}


def test_an_address_that_looks_like_a_skip_is_an_address(run_program: RunProgram) -> None:
    # The function lies at word 0x1000, which as an instruction would be cpse r0, r0.
    board = run_program(
        '__asm__(".text\\n .p2align 13\\n far: ret");'
        "int main(void) { line(7); for (;;) { unsigned r = 1;"
        ' __asm__ volatile("call far\\n adiw %0, 15" : "+w"(r)); say(r); } }'
    )
    board.step(2000)
    assert set(board.read()) == {16}


def test_ram_is_noise_at_power_on_and_outlives_other_resets(run_program: RunProgram) -> None:
    board = run_program(
        'unsigned char kept __attribute__((section(".noinit")));'
        "int main(void) { line(7); say(kept); kept = 0x5A; for (;;) {} }"
    )
    board.step(1000)
    first = board.read()
    board.reset(ResetCause.EXTERNAL)
    board.step(1000)
    assert board.read() == b"\x5a"
    board.reset(ResetCause.POWER_ON)
    board.step(1000)
    assert board.read() not in (first, b"\x5a")


EEPROM = """
static void begin(unsigned at, unsigned char byte)
{
    EEAR = at; EEDR = byte; EECR = 1 << EEMPE; EECR |= 1 << EEPE;
}
static unsigned char fetch(unsigned at)
{
    EEAR = at; EECR |= 1 << EERE; return EEDR;
}
"""


def test_an_eeprom_byte_takes_3_4_ms_to_write_and_reads_as_before_until_then(run_program: RunProgram) -> None:
    board = run_program(
        EEPROM + "int main(void) { line(7); say(fetch(3)); begin(3, 0x5A); say('b');"
        " while (EECR & 1 << EEPE) {} say(fetch(3)); say(EECR); for (;;) {} }"
    )
    board.step(3300)
    assert board.read() == b"\xffb"
    assert board.eeprom == bytes([0xFF] * 1024)
    board.step(300)
    assert board.read() == b"\x5a\0"
    assert board.eeprom == b"\xff\xff\xff\x5a" + bytes([0xFF] * 1020)


def test_the_eeprom_is_deaf_while_it_writes_and_unless_armed_within_4_cycles(run_program: RunProgram) -> None:
    board = run_program(
        EEPROM + "int main(void) { line(7); begin(0, 1); begin(1, 2); EEDR = 9; EECR |= 1 << EERE; say(EEDR);"
        " while (EECR & 1 << EEPE) {} EEAR = 2; EEDR = 3; EECR = 1 << EEMPE;"
        ' __asm__ volatile("nop\\n nop\\n nop\\n nop\\n"); EECR |= 1 << EEPE;'
        " say(EECR & 1 << EEPE); for (;;) {} }"
    )
    board.step(5000)
    assert board.read() == b"\x09\0"
    assert board.eeprom == b"\x01" + bytes([0xFF] * 1023)


@pytest.mark.parametrize("cause", ResetCause)
def test_the_eeprom_outlives_resets_but_not_the_byte_being_written_when_power_goes(
    run_program: RunProgram, cause: ResetCause
) -> None:
    board = run_program(
        EEPROM + "int main(void) { if (fetch(0) == 0xFF) {"
        " begin(0, 1); while (EECR & 1 << EEPE) {} begin(1, 2); } for (;;) {} }"
    )
    board.step(3400 + 1000)
    board.reset(cause)
    board.step(5000)
    torn = cause in (ResetCause.POWER_ON, ResetCause.BROWN_OUT)
    assert (board.eeprom[1] in (2, 0xFF)) != torn
    assert board.eeprom[:1] + board.eeprom[2:] == b"\x01" + bytes([0xFF] * 1022)


def test_the_load_is_what_is_not_slept(run_program: RunProgram) -> None:
    asleep = run_program('int main(void) { SMCR = 1; sei(); for (;;) __asm__ volatile("sleep"); }')
    asleep.step(10_000)
    assert asleep.stats().load < 0.01
    awake = run_program("int main(void) { for (;;) {} }")
    awake.step(10_000)
    assert awake.stats().load == 1.0


def test_the_stack_is_measured_to_the_byte_or_two(run_program: RunProgram) -> None:
    board = run_program(
        "__attribute__((noinline)) void deep(volatile char *p) { for (char k = 0; k < 100; k++) p[k] = k; }"
        "int main(void) { volatile char room[100]; deep(room); for (;;) {} }"
    )
    board.step(1000)
    assert 100 <= board.stack_bytes <= 115


def test_a_pwm_mode_that_is_not_ours_is_refused(run_program: RunProgram) -> None:
    board = run_program(
        "int main(void) { DDRB = 7; DDRD = 0xF0; PORTD = 0xC0; TCCR1A = 0x82; TCCR1B = 0x19; for (;;) {} }"
    )
    board.step(100)
    with pytest.raises(DeviceError, match="PWM"):
        board.duty(Side.LEFT)
    assert board.duty(Side.RIGHT) == 0.0


def test_a_crash_is_told(run_program: RunProgram) -> None:
    board = run_program("int main(void) { ((void (*)(void))0x3F00)(); }")
    with pytest.raises(DeviceError, match="crashed"):
        board.step(100_000)


def test_what_is_not_built_or_does_not_fit_is_told_with_its_remedy(built: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="make avr"):
        AvrBoard(elf=tmp_path / "none.elf")
    with pytest.raises(UsageError, match="setup_avr"):
        AvrBoard(elf=built / "uno.elf", library=tmp_path / "none.so")
    with pytest.raises(UsageError, match="no 32-bit ELF"):
        AvrBoard(elf=built / "uno.hex")
    with pytest.raises(UsageError, match="no Intel hex"):
        AvrBoard(bootloader=built / "uno.elf", library=built / "librig.so")
    with pytest.raises(ValueError, match="1024"):
        AvrBoard(eeprom=bytes(1025))
