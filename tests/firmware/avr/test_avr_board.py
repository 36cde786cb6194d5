"""The firmware on the real processor, simulated: it behaves as on the other board, and in time."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import pytest
from board_bench import FORWARD_PINS, Bench, Wheel

from host.link.protocol import (
    Clear,
    Fault,
    Hello,
    LinkStatus,
    Nack,
    Ping,
    Pong,
    Refusal,
    ResetCause,
    Telemetry,
)
from host.link.robot import Robot
from host.sim.avr.board import AvrBoard
from host.sim.board import Board, Line, Side

BYTE_US = 40
OFF = (0.0, 0.0)
MakeBoard = Callable[..., AvrBoard]


@pytest.fixture
def fresh(make_board: MakeBoard) -> Bench:
    """Just switched on."""
    return Bench(make_board())


@pytest.fixture
def bench(make_board: MakeBoard) -> Bench:
    """With an open session."""
    made = Bench(make_board())
    made.run_ms(50)
    made.open_session()
    return made


# --- Driving ------------------------------------------------------------------------------------


def test_a_processor_that_nobody_talks_to_says_hello_reports_at_100_hz_and_stands_still(fresh: Bench) -> None:
    fresh.run_ms(1000)
    said = fresh.hear()
    assert isinstance(said[0], Hello)
    assert said[0].reset_cause == ResetCause.POWER_ON
    assert said[0].build_id != 0
    reports = [message for message in said if isinstance(message, Telemetry)]
    gaps_us = [b.mcu_time_us - a.mcu_time_us for a, b in pairwise(reports)]
    assert gaps_us == pytest.approx([10_000] * len(gaps_us), abs=50)
    assert 97 <= len(reports) <= 99
    assert reports[-1].battery_mv == pytest.approx(7400, abs=20)
    assert fresh.duties == OFF
    assert fresh.decoder.counters.frames == len(said)


def test_drive_moves_the_wheels_at_the_commanded_speed(bench: Bench) -> None:
    bench.drive_for_ms(2000, 200, 1000)
    assert [wheel.speed_mm_s for wheel in bench.wheels] == pytest.approx([275, 125], rel=0.02)
    told = bench.hear_telemetry()
    assert [told.speed_left_mm_s, told.speed_right_mm_s] == pytest.approx([275, 125], rel=0.03)


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


def test_the_edge_age_told_leads_back_to_the_moment_of_the_edge(bench: Bench) -> None:
    ping = bench.frame(Ping(1))
    received_us = bench.board.time_us + BYTE_US * len(ping)
    bench.board.write(ping)
    bench.run_ms(10)
    pong = next(message for message in bench.hear() if isinstance(message, Pong))
    behind_us = received_us - pong.mcu_time_us  # the processor's clock started later; and it took the ping in
    edge_us = bench.board.time_us + 3210
    bench.board.set_encoder_pins(Side.LEFT, *FORWARD_PINS[1], edge_us)
    bench.board.step(30_000)
    told = bench.hear_telemetry()
    assert told.mcu_time_us - told.edge_age_left_us + behind_us == pytest.approx(edge_us, abs=150)
    assert told.count_left == 1


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


# --- Stopping -----------------------------------------------------------------------------------


def test_when_the_host_falls_silent_the_motors_are_off_within_200_ms_and_a_tick(bench: Bench) -> None:
    bench.drive_for_ms(450, 300)
    bench.tell(bench.drive(300))
    bench.run_ms(199)
    assert all(bench.duties)
    bench.run_ms(7)
    assert bench.duties == OFF
    bench.run_ms(200)
    assert [wheel.speed_mm_s for wheel in bench.wheels] == pytest.approx([0, 0], abs=15)
    assert bench.hear_telemetry().fault == Fault.LINK_LOST


def test_the_button_stops_within_a_tick_and_holds_until_released_and_cleared(bench: Bench) -> None:
    bench.drive_for_ms(500, 300)
    bench.board.press_estop(True)
    bench.board.step(6000)
    assert bench.duties == OFF
    bench.run_ms(20)
    told = bench.hear_telemetry()
    assert told.fault == Fault.ESTOP_BUTTON
    bench.board.press_estop(False)
    bench.run_ms(20)
    bench.tell(Clear(told.boot_nonce))
    bench.drive_for_ms(100, 300)
    assert all(bench.duties)


def test_a_low_battery_ends_the_drive(bench: Bench) -> None:
    bench.board.set_battery_mv(6000)
    bench.drive_for_ms(450, 300)
    assert all(bench.duties)
    bench.drive_for_ms(100, 300)
    assert bench.duties == OFF
    told = bench.hear_telemetry()
    assert (told.fault, told.battery_mv) == (Fault.BATTERY_LOW, pytest.approx(6000, abs=20))


def test_a_hung_main_loop_has_its_motors_off_within_130_ms_and_says_why(bench: Bench) -> None:
    bench.drive_for_ms(500, 300)
    bench.hear()
    bench.board.hang(1_000_000)
    bench.board.step(20_000)
    assert all(bench.duties)
    bench.board.step(110_000)
    assert bench.duties == OFF
    bench.run_ms(50)
    hello = next(message for message in bench.hear() if isinstance(message, Hello))
    assert hello.reset_cause == ResetCause.WATCHDOG
    assert bench.board.stats().resets == 1  # type: ignore[attr-defined]


@pytest.mark.parametrize("cause", [ResetCause.POWER_ON, ResetCause.EXTERNAL, ResetCause.BROWN_OUT])
def test_a_reset_turns_the_motors_off_at_once_and_ends_the_session(bench: Bench, cause: ResetCause) -> None:
    bench.drive_for_ms(500, 300)
    nonce = bench.hear_telemetry().boot_nonce
    bench.board.reset(cause)
    assert bench.duties == OFF
    bench.board.write(bench.frame(bench.drive(300)))
    for _ in range(60):
        bench.run_ms(1)
        assert bench.duties == OFF
    bench.tell(bench.drive(300))
    bench.run_ms(30)
    said = bench.hear()
    hello = next(message for message in said if isinstance(message, Hello))
    assert hello.reset_cause == cause
    assert hello.boot_nonce != nonce
    assert [message.reason for message in said if isinstance(message, Nack)][-1] == Refusal.NO_SESSION
    assert bench.duties == OFF


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


def test_bytes_beyond_the_receive_ring_are_lost_and_counted(bench: Bench) -> None:
    bench.board.hang(20_000)
    bench.board.write(bytes(100))
    bench.run_ms(500)
    status = [message for message in bench.hear() if isinstance(message, LinkStatus)][-1]
    assert status.rx_overrun == 37  # the ring holds 63


def test_the_hosts_client_connects_drives_and_hears(bench: Bench) -> None:
    with Robot(Line(bench.board), bench) as robot:  # type: ignore[arg-type]
        robot.connect()
        for _ in range(20):
            robot.drive(200, 0.0)
            bench.run_ms(50)
            robot.poll()
        assert robot.latest is not None
        assert robot.latest.speed_left_mm_s == pytest.approx(200, rel=0.1)
        assert robot.refusals == 0


# --- Repeatable ---------------------------------------------------------------------------------


def test_equal_runs_are_equal_however_they_are_cut(make_board: MakeBoard) -> None:
    def said(step_us: int) -> bytes:
        bench = Bench(make_board(seed=5))
        bench.board.write(bench.frame(Ping(1)) * 30)
        for k in range(1, 100):
            bench.board.set_encoder_pins(Side.RIGHT, *FORWARD_PINS[k % 4], 1_000 + 1_777 * k)
        for _ in range(300_000 // step_us):
            bench.board.step(step_us)
        return bench.board.read()

    assert said(1000) == said(40) == said(300_000) == said(12_500)
