"""The firmware on the real processor, simulated: beside the other board, and where only it can be wrong."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from board_bench import Bench, Wheel

from host.link.protocol import Hello, ResetCause, Telemetry
from host.sim.avr.board import AvrBoard
from host.sim.board import Board, Side

OFF = (0.0, 0.0)
MakeBoard = Callable[..., AvrBoard]


@pytest.fixture
def bench(make_board: MakeBoard) -> Bench:
    """With an open session."""
    made = Bench(make_board())
    made.run_ms(50)
    made.open_session()
    return made


def test_the_processor_drives_as_the_firmware_compiled_for_this_machine_does(make_board: MakeBoard) -> None:
    def path(board: Board | AvrBoard) -> list[tuple[float, ...]]:
        bench = Bench(board, wheels=(Wheel(mm_s_at_full=800), Wheel(mm_s_at_full=600)))  # type: ignore[arg-type]
        bench.run_ms(50)
        bench.open_session()
        places = []
        for v_mm_s, omega_mrad_s in ((200, 0), (-150, 2000), (300, -1000)):
            bench.drive_for_ms(700, v_mm_s, omega_mrad_s)
            places.append(tuple(wheel.position_mm for wheel in bench.wheels))
        return places

    for real, other in zip(path(make_board()), path(Board()), strict=True):
        assert real == pytest.approx(other, abs=5.0)  # one count


# --- Counting -----------------------------------------------------------------------------------


def test_every_transition_counts_as_the_c_decoder_says(bench: Bench) -> None:
    reference = Bench(Board())
    pins = [(bool(n & 1), bool(n & 2)) for n in (0, 1, 3, 2, 3, 0, 2, 0, 3, 1, 0, 0, 3, 2, 1, 3, 1, 2, 0)]
    for one in (bench, reference):
        for k, (a, b) in enumerate(pins):
            one.board.set_encoder_pins(Side.LEFT, a, b, one.board.time_us + 1000 * k)
            one.board.set_encoder_pins(Side.RIGHT, b, a, one.board.time_us + 1000 * k + (k % 3) * 5)
        one.run_ms(60)
    told, expected = bench.hear_telemetry(), reference.hear_telemetry()
    for name in ("count_left", "count_right", "illegal_left", "illegal_right"):
        assert getattr(told, name) == getattr(expected, name), name
    assert expected.illegal_left > 2


# --- Starts -------------------------------------------------------------------------------------


def test_resets_in_a_row_give_nonces_that_differ_and_boards_that_differ(make_board: MakeBoard) -> None:
    nonces = set()
    for seed in range(3):
        bench = Bench(make_board(seed))
        for cause in (ResetCause.EXTERNAL, ResetCause.EXTERNAL, ResetCause.WATCHDOG, ResetCause.POWER_ON):
            bench.run_ms(40)
            nonces |= {message.boot_nonce for message in bench.hear() if isinstance(message, Hello)}
            bench.board.reset(cause)
    assert len(nonces) == 12


# --- The line -----------------------------------------------------------------------------------


def test_a_babbling_line_neither_moves_motors_nor_stops_the_ticks(bench: Bench) -> None:
    bench.hear()
    for _ in range(50):
        bench.board.write(bytes(range(1, 251)))
        bench.run_ms(10)
        assert bench.duties == OFF
    reports = [message for message in bench.hear() if isinstance(message, Telemetry)]
    assert 49 <= len(reports) <= 50
    assert bench.board.stats().resets == 0  # type: ignore[attr-defined]
