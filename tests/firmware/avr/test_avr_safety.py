"""What only the processor itself can show: outputs from its first instruction on, watchdog, power cuts."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest
from board_bench import Bench

from host.link.parameters import PARAMETERS, Param
from host.link.protocol import (
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    Clear,
    EStop,
    Fault,
    Hello,
    HelloRequest,
    Move,
    Nack,
    Outcome,
    ParamRead,
    ParamSave,
    ParamValue,
    ParamWrite,
    Ping,
    Refusal,
    ResetCause,
    State,
    Telemetry,
)
from host.sim.avr.board import AvrBoard
from host.sim.board import Side

BYTE_US = 40
OFF = (0.0, 0.0)
MakeBoard = Callable[..., AvrBoard]

DDRB, PORTB, DDRD, PORTD, TCCR1A, OCR1AL = 0x24, 0x25, 0x2A, 0x2B, 0x80, 0x88
DRIVER_B, DRIVER_D = 0x07, 0xF0  # the pins that lead to the motor driver


def driving(board: AvrBoard, for_ms: int = 500) -> Bench:
    """A board that drives at 0.3 m/s."""
    bench = Bench(board)  # type: ignore[arg-type]
    bench.run_ms(50)
    say_hello(bench)
    bench.drive_for_ms(for_ms, 300)
    assert all(bench.duties)
    return bench


def say_hello(bench: Bench) -> Hello:
    """Open a session, while telemetry may be on the line."""
    bench.tell(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH))
    bench.run_ms(10)
    return [message for message in bench.hear() if isinstance(message, Hello)][-1]


def latest(bench: Bench) -> Telemetry:
    """Telemetry from now."""
    bench.run_ms(12)
    return bench.hear_telemetry()


# --- From reset on ------------------------------------------------------------------------------


@pytest.mark.parametrize("cause", ResetCause)
def test_from_the_first_instruction_on_no_motor_gets_a_pulse(
    make_board: MakeBoard, cause: ResetCause
) -> None:
    board = make_board()
    bench = driving(board)
    board.reset(cause)
    for us in range(80_000):
        if us == 5:  # until then the pins are inputs, which the driver's own resistors pull low
            assert (board.peek(DDRB) & DRIVER_B, board.peek(DDRD) & DRIVER_D) == (DRIVER_B, DRIVER_D)
        if us < 10_000:  # so long does the start take at least
            assert (board.peek(PORTB) & DRIVER_B, board.peek(PORTD) & DRIVER_D) == (0, 0)
            assert board.coasting(Side.LEFT) and board.coasting(Side.RIGHT)
        assert bench.duties == OFF
        board.step(1)
    assert not board.coasting(Side.LEFT)  # awake, and braking


# --- Stopping -----------------------------------------------------------------------------------


def estop_us(bench: Bench, before: bytes = b"") -> int:
    """Time from the last byte of an ESTOP to no voltage on either motor, within 10 us."""
    frame = before + bench.frame(EStop())
    bench.board.write(frame)
    bench.board.step(BYTE_US * len(frame))
    assert any(bench.duties)
    for us in range(0, 10_000, 10):
        if bench.duties == OFF:
            return us
        bench.board.step(10)
    pytest.fail("an ESTOP had no effect")


@pytest.mark.parametrize("phase_us", range(0, 10_000, 97))  # two ticks, one of which reports
def test_at_every_phase_of_the_tick_an_estop_zeroes_the_pwm_within_1_ms_of_its_last_byte(
    make_board: MakeBoard, phase_us: int
) -> None:
    bench = driving(make_board(), 150)
    bench.board.step(phase_us)
    full_line = b"".join(bench.frame(bench.drive(300)) for _ in range(20))
    assert estop_us(bench, (b"", bench.frame(Ping(1)), full_line)[phase_us % 3]) <= 1000


@pytest.mark.parametrize("phase_us", range(0, 10_000, 291))
def test_at_every_phase_of_the_tick_an_estop_ends_a_move_within_1_ms_of_its_last_byte(
    make_board: MakeBoard, phase_us: int
) -> None:
    bench = Bench(make_board())
    bench.run_ms(50)
    nonce = say_hello(bench).boot_nonce
    bench.tell(Move(nonce, 1, 1000, 300, bench.drive(0).expires_us))
    bench.run_ms(150)
    bench.board.step(phase_us)
    assert estop_us(bench) <= 1000


def test_after_a_hang_the_watchdog_s_fault_stands_until_cleared(make_board: MakeBoard) -> None:
    bench = driving(make_board())
    bench.board.hang(1_000_000)
    off_us = 0
    while bench.duties != OFF:
        bench.board.step(100)
        off_us += 100
    assert 20_000 < off_us <= 130_000
    bench.run_ms(100)
    hello = [message for message in bench.hear() if isinstance(message, Hello)][-1]
    assert hello.reset_cause == ResetCause.WATCHDOG
    bench.started_us = bench.board.time_us - latest(bench).mcu_time_us
    say_hello(bench)
    bench.tell(bench.drive(300))
    bench.run_ms(20)
    said = bench.hear()
    assert [message.reason for message in said if isinstance(message, Nack)] == [Refusal.FAULT_LATCHED]
    assert (said[-1].state, said[-1].fault) == (State.FAULT, Fault.WATCHDOG)
    assert bench.duties == OFF
    bench.tell(Clear(hello.boot_nonce))
    bench.run_ms(20)
    bench.drive_for_ms(100, 300)
    assert all(bench.duties)


@pytest.mark.parametrize("broken", ["the stack's guard", "the PWM's mode"])
def test_a_processor_that_is_not_as_it_should_be_starves_its_watchdog(
    make_board: MakeBoard, broken: str
) -> None:
    board = make_board()
    bench = driving(board)
    board.poke(*((board.static_end, 0) if broken == "the stack's guard" else (TCCR1A, 0xF0)))
    for _ in range(130):
        bench.tell(bench.drive(300))
        board.step(1000)
    assert board.stats().resets == 1
    assert bench.duties == OFF


# --- Parameters and power -----------------------------------------------------------------------


def test_power_cut_at_any_moment_of_a_save_leaves_the_old_parameters_or_the_new(
    make_board: MakeBoard,
) -> None:
    chance = random.Random(5)
    before = {Param.TRACK_UM: 151_000, Param.BATTERY_MIN_MV: 6100}
    after = {Param.TRACK_UM: 149_000, Param.BATTERY_MIN_MV: 6300}
    board = make_board()
    save(board, before)
    old = board.eeprom
    save_ms = save(board, after)
    assert old != board.eeprom
    seen = set()
    for _ in range(60):
        board = make_board(eeprom=old)
        bench = begin_save(board, after)
        bench.board.step(int(chance.uniform(0, 1.1 * save_ms * 1000)))
        board.reset(chance.choice([ResetCause.POWER_ON, ResetCause.BROWN_OUT, ResetCause.EXTERNAL]))
        bench.run_ms(60)
        say_hello(bench)
        values = tuple(read(bench, param) for param in before)
        assert values in (tuple(before.values()), tuple(after.values()))
        assert read(bench, Param.SPEED_MAX_MM_S) == PARAMETERS[Param.SPEED_MAX_MM_S].default
        seen.add(values)
    assert len(seen) == 2


def begin_save(board: AvrBoard, values: dict[Param, int]) -> Bench:
    """Write parameters and ask for them to be saved."""
    bench = Bench(board)  # type: ignore[arg-type]
    bench.run_ms(50)
    nonce = say_hello(bench).boot_nonce
    request = latest(bench).request
    for param, value in values.items():
        request += 1
        bench.tell(ParamWrite(nonce, request, param, value))
        bench.run_ms(3)
    bench.tell(ParamSave(nonce, request + 1))
    return bench


def save(board: AvrBoard, values: dict[Param, int]) -> int:
    """Write parameters and have them saved; how long that took, in ms."""
    bench = begin_save(board, values)
    for ms in range(0, 3000, 10):
        bench.run_ms(10)
        told = bench.hear_telemetry()
        assert told.outcome in (Outcome.RUNNING, Outcome.DONE)
        if told.outcome == Outcome.DONE and ms:
            return ms
    pytest.fail("a save did not end")


def read(bench: Bench, param: Param) -> int:
    """What the robot takes for a parameter's value."""
    bench.hear()
    bench.tell(ParamRead(param))
    bench.run_ms(10)
    return next(message.value for message in bench.hear() if isinstance(message, ParamValue))
