"""The firmware on a board: from bytes and edges to motors, in virtual time.

What takes `bench` or `make_board` runs twice: compiled for this machine, and as the ELF on its processor.
"""

from __future__ import annotations

from itertools import pairwise

import pytest
from board_bench import FORWARD_PINS, Bench, MakeBoard, Wheel
from hypothesis import given, settings
from hypothesis import strategies as st

from host.errors import DeviceError
from host.link.protocol import (
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    Clear,
    EStop,
    Fault,
    Hello,
    HelloRequest,
    LinkStatus,
    Nack,
    Ping,
    Pong,
    Refusal,
    ResetCause,
    State,
    Stop,
    Telemetry,
    encode,
)
from host.link.robot import Robot
from host.sim.board import Board, Line, Side

BYTE_US = 40
OFF = (0.0, 0.0)


@pytest.fixture
def bench(make_board: MakeBoard) -> Bench:
    """With an open session."""
    return in_session(make_board())


def in_session(board: Board, *wheels: Wheel) -> Bench:
    """A board that has started, and has been said hello to."""
    made = Bench(board, wheels) if wheels else Bench(board)  # type: ignore[arg-type]
    made.run_ms(50)
    made.open_session()
    return made


# --- Driving ------------------------------------------------------------------------------------


def test_a_board_that_nobody_talks_to_says_hello_reports_at_100_hz_and_stands_still(
    make_board: MakeBoard, slack_us: int
) -> None:
    bench = Bench(make_board())
    bench.run_ms(1000)
    said = bench.hear()
    assert isinstance(said[0], Hello)
    assert said[0].reset_cause == ResetCause.POWER_ON
    reports = [message for message in said if isinstance(message, Telemetry)]
    assert len(reports) == (98 if slack_us else 99)  # the last is on the line; a real start takes 20 ms
    gaps_us = [b.mcu_time_us - a.mcu_time_us for a, b in pairwise(reports)]
    assert gaps_us == pytest.approx([10_000] * len(gaps_us), abs=slack_us / 20)
    assert said[-1].state == State.BOOT
    assert bench.duties == OFF
    assert bench.decoder.counters.frames == len(said)


def test_drive_moves_the_wheels_at_the_commanded_speed(bench: Bench) -> None:
    bench.drive_for_ms(2000, 200)
    assert [wheel.speed_mm_s for wheel in bench.wheels] == pytest.approx([200, 200], rel=0.02)
    told = bench.hear_telemetry()
    assert (told.state, told.fault) == (State.DRIVING, Fault.NONE)
    assert [told.speed_left_mm_s, told.speed_right_mm_s] == pytest.approx([200, 200], rel=0.02)


def test_omega_to_the_right_is_a_faster_left_wheel(bench: Bench) -> None:
    bench.drive_for_ms(2000, 200, 1000)
    assert [wheel.speed_mm_s for wheel in bench.wheels] == pytest.approx([275, 125], rel=0.02)


def test_unequal_motors_go_straight_once_the_loop_has_learnt_them(make_board: MakeBoard) -> None:
    bench = in_session(make_board(), Wheel(mm_s_at_full=800), Wheel(mm_s_at_full=600, dead_zone=0.12))
    bench.drive_for_ms(3000, 200)
    before_mm = [wheel.position_mm for wheel in bench.wheels]
    bench.drive_for_ms(2000, 200)
    left_mm, right_mm = (wheel.position_mm - was for wheel, was in zip(bench.wheels, before_mm, strict=True))
    assert left_mm == pytest.approx(400, rel=0.01)
    assert right_mm == pytest.approx(400, rel=0.01)


def test_the_counts_told_are_the_edges_that_came(bench: Bench) -> None:
    bench.drive_for_ms(1000, 300, 1500)
    bench.drive_for_ms(1000, -300, 1500)
    bench.tell(Stop())
    bench.run_ms(1000)
    told = bench.hear_telemetry()
    assert (told.count_left, told.count_right) == tuple(wheel.count for wheel in bench.wheels)
    assert (told.illegal_left, told.illegal_right) == (0, 0)
    assert told.state == State.READY


def test_the_edge_age_told_leads_back_to_the_moment_of_the_edge(bench: Bench, slack_us: int) -> None:
    ping = bench.frame(Ping(1))
    pinged_us = bench.board.time_us + BYTE_US * len(ping)
    bench.board.write(ping)
    bench.run_ms(10)
    pong = next(message for message in bench.hear() if isinstance(message, Pong))
    behind_us = pinged_us - pong.mcu_time_us  # a real clock started later; and took its time to see the ping
    edge_us = bench.board.time_us + 3210
    bench.board.set_encoder_pins(Side.LEFT, *FORWARD_PINS[1], edge_us)
    bench.board.step(30_000)
    told = bench.hear_telemetry()
    moment_us = told.mcu_time_us - told.edge_age_left_us + behind_us
    assert moment_us == pytest.approx(edge_us, abs=4 + 0.15 * slack_us)
    assert told.count_left == 1


# --- Stopping -----------------------------------------------------------------------------------


@pytest.mark.parametrize("driven_ms", [50, 350, 1000])
def test_when_the_host_falls_silent_the_motors_are_off_within_200_ms(
    make_board: MakeBoard, driven_ms: int
) -> None:
    bench = in_session(make_board())
    bench.drive_for_ms(driven_ms - 50, 300)
    bench.tell(bench.drive(300))
    bench.run_ms(190)
    assert all(bench.duties)
    bench.run_ms(10)  # the DRIVE, too, took its time to come
    assert bench.duties == OFF
    bench.run_ms(200)
    assert [wheel.speed_mm_s for wheel in bench.wheels] == pytest.approx([0, 0], abs=15)
    assert bench.hear_telemetry().fault == Fault.LINK_LOST


def test_half_a_frame_and_then_nothing_is_silence_too(bench: Bench) -> None:
    bench.drive_for_ms(500, 300)
    bench.board.write(bench.frame(bench.drive(300))[:-4])
    bench.run_ms(206)
    assert bench.duties == OFF


def test_pings_alone_do_not_keep_the_motors_on(bench: Bench) -> None:
    bench.drive_for_ms(500, 300)
    for number in range(30):
        bench.tell(Ping(number))
        bench.run_ms(10)
    assert bench.duties == OFF
    assert bench.hear_telemetry().fault == Fault.LINK_LOST


def test_the_motors_are_off_before_the_line_could_carry_another_byte_after_an_estop() -> None:
    bench = in_session(Board())  # how long the real processor takes stands in avr/test_avr_safety.py
    bench.drive_for_ms(500, 300)
    frame = bench.frame(EStop())
    bench.board.write(frame)
    bench.board.step(BYTE_US * len(frame) - 1)
    assert all(bench.duties)
    bench.board.step(1)
    assert bench.duties == OFF


def test_the_button_stops_within_a_tick_and_holds_until_released_and_cleared(
    bench: Bench, slack_us: int
) -> None:
    bench.drive_for_ms(500, 300)
    bench.board.press_estop(True)
    bench.board.step(5000 + slack_us)
    assert bench.duties == OFF
    bench.run_ms(20)
    told = bench.hear_telemetry()
    assert told.fault == Fault.ESTOP_BUTTON
    bench.tell(Clear(told.boot_nonce))
    bench.run_ms(20)
    assert bench.hear_telemetry().state == State.FAULT
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
    assert (told.fault, told.battery_mv) == (Fault.BATTERY_LOW, pytest.approx(6000, abs=20))  # two steps


@pytest.mark.parametrize("cause", [ResetCause.POWER_ON, ResetCause.EXTERNAL, ResetCause.BROWN_OUT])
def test_a_restart_turns_the_motors_off_forgets_the_session_and_shows_itself(
    bench: Bench, cause: ResetCause
) -> None:
    bench.drive_for_ms(500, 300)
    nonce = bench.hear_telemetry().boot_nonce
    bench.board.reset(cause)
    for _ in range(60):
        assert bench.duties == OFF
        bench.run_ms(1)
    bench.tell(bench.drive(300))
    bench.run_ms(30)
    said = bench.hear()
    hello = next(message for message in said if isinstance(message, Hello))
    assert hello.reset_cause == cause
    assert hello.boot_nonce != nonce
    assert [message.reason for message in said if isinstance(message, Nack)] == [Refusal.NO_SESSION]
    assert said[-1].mcu_time_us <= 90_000
    assert bench.duties == OFF


def test_wheels_that_still_roll_after_a_restart_are_no_fault(bench: Bench) -> None:
    bench.drive_for_ms(1000, 500)
    for wheel in bench.wheels:
        wheel.lag_s = 0.3  # heavy
    bench.board.reset(ResetCause.BROWN_OUT)
    bench.run_ms(100)
    assert bench.hear_telemetry().speed_left_mm_s > 100
    bench.tell(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH))
    bench.run_ms(15)
    told = bench.hear_telemetry()
    assert (told.state, told.fault) == (State.STOPPED, Fault.NONE)
    bench.run_ms(1500)
    told = bench.hear_telemetry()
    assert (told.state, told.fault) == (State.READY, Fault.NONE)


# --- A hung main loop ---------------------------------------------------------------------------


def test_a_drive_that_waited_out_a_hang_is_too_old_to_obey() -> None:
    bench = in_session(Board())  # the real clock is behind, and its watchdog would not bear much more
    bench.board.hang(40_000)
    bench.tell(bench.drive(300, hold_ms=30))
    bench.run_ms(50)
    assert bench.duties == OFF
    assert [message.reason for message in bench.hear() if isinstance(message, Nack)] == [Refusal.EXPIRED]


def test_bytes_beyond_the_receive_buffer_are_lost_and_counted(bench: Bench, slack_us: int) -> None:
    bench.board.hang(20_000)
    bench.board.write(bytes(100))
    bench.run_ms(500)
    status = [message for message in bench.hear() if isinstance(message, LinkStatus)][-1]
    assert status.rx_overrun == (37 if slack_us else 36)  # one place of the real ring stays free
    bench.tell(Ping(7))
    bench.run_ms(20)
    assert Pong in map(type, bench.hear())


# --- What is no message never moves a motor -----------------------------------------------------


@settings(max_examples=100, deadline=None)
@given(noise=st.lists(st.binary(min_size=1, max_size=200), max_size=10))
def test_noise_never_moves_a_motor(noise: list[bytes]) -> None:
    bench = Bench()
    bench.open_session()
    for burst in noise:
        bench.board.write(burst)
        bench.run_ms(10)
        assert bench.duties == OFF


@settings(max_examples=200, deadline=None)
@given(
    v_mm_s=st.integers(-500, 500),
    flips=st.sets(st.integers(0, 15 * 8 - 1), min_size=1, max_size=6),
    cut=st.integers(0, 15),
)
def test_a_damaged_drive_never_moves_a_motor(v_mm_s: int, flips: set[int], cut: int) -> None:
    bench = Bench()
    bench.open_session()
    damaged = bytearray(bench.frame(bench.drive(v_mm_s, 1000)))
    for bit in flips:
        damaged[bit // 8 % len(damaged)] ^= 1 << bit % 8
    bench.board.write(bytes(damaged[:cut] if cut else damaged) + b"\0")
    bench.run_ms(15)
    assert bench.duties == OFF


@settings(max_examples=100, deadline=None)
@given(
    requests=st.lists(
        st.builds(HelloRequest, st.integers(0, 255), st.integers(0, 2**32 - 1)).filter(
            lambda one: (one.protocol_version, one.schema_hash) != (PROTOCOL_VERSION, SCHEMA_HASH)
        ),
        max_size=5,
    )
)
def test_without_a_host_of_the_same_schema_no_drive_moves_a_motor(requests: list[HelloRequest]) -> None:
    bench = Bench()
    for request in requests:
        bench.tell(request)
        bench.tell(bench.drive(300))
        bench.run_ms(10)
        assert bench.duties == OFF


# --- The line and time --------------------------------------------------------------------------


def test_bytes_take_40_us_each_both_ways() -> None:
    board = Board()
    hello_bytes = 14 + 6 + 2
    board.step(hello_bytes * BYTE_US - 1)
    assert len(board.read()) == hello_bytes - 1
    board.step(1)
    assert board.read() == b"\0"
    ping = encode(Ping(1), 0)
    board.write(ping)
    asked_us = board.time_us
    board.step(5000)
    decoder = Bench().decoder
    pong = decoder.feed(board.read())[0].message
    assert isinstance(pong, Pong)
    assert pong.mcu_time_us == asked_us + BYTE_US * len(ping)


def test_the_size_of_the_steps_makes_no_difference(make_board: MakeBoard) -> None:
    def said(step_us: int) -> bytes:
        bench = Bench(make_board(5))
        bench.tell(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH))
        bench.tell(bench.drive(300))
        bench.board.set_encoder_pins(Side.RIGHT, *FORWARD_PINS[1], 12_345)
        for k in range(1, 100):
            bench.board.set_encoder_pins(Side.LEFT, *FORWARD_PINS[k % 4], 1_000 + 1_777 * k)
        for _ in range(300_000 // step_us):
            bench.board.step(step_us)
        return bench.board.read()

    assert said(1000) == said(40) == said(300_000) == said(12_500)


def test_boards_live_side_by_side_and_equal_ones_behave_equally(make_board: MakeBoard) -> None:
    one, same, other = (in_session(make_board(seed)) for seed in (1, 1, 2))
    one.drive_for_ms(500, 200)
    same.drive_for_ms(500, 200)
    other.run_ms(500)
    assert one.board.read() == same.board.read()
    assert one.duties == same.duties != OFF
    assert other.duties == OFF
    one.run_ms(20)
    assert one.hear_telemetry().boot_nonce != other.hear_telemetry().boot_nonce


def test_pins_are_found_as_they_are_at_a_restart(make_board: MakeBoard) -> None:
    bench = Bench(make_board())
    for count in range(1, 5):
        bench.board.set_encoder_pins(Side.LEFT, *FORWARD_PINS[count % 4])
        bench.board.reset()
        bench.run_ms(60)
        told = bench.hear_telemetry()
        assert (told.count_left, told.illegal_left) == (0, 0)


def test_what_cannot_be_is_refused(make_board: MakeBoard) -> None:
    board = make_board()
    board.step(1000)
    with pytest.raises(ValueError, match="comes too late"):
        board.set_encoder_pins(Side.LEFT, True, False, 999)
    with pytest.raises(ValueError, match="time does not go back"):
        board.step(-1)
    with pytest.raises(ValueError, match="1024 bytes"):
        make_board(0, bytes(1025))


# --- The host's own client on it ----------------------------------------------------------------


def test_the_hosts_client_connects_drives_and_hears(make_board: MakeBoard) -> None:
    bench = Bench(make_board())
    with Robot(Line(bench.board), bench) as robot:
        robot.connect()
        for _ in range(20):
            robot.drive(200, 0.0)
            bench.run_ms(50)
            robot.poll()
        assert robot.latest is not None
        assert robot.latest.speed_left_mm_s == pytest.approx(200, rel=0.1)
        assert robot.refusals == 0
    bench.run_ms(10)
    assert bench.duties == OFF


def test_a_closed_line_carries_nothing() -> None:
    line = Line(Board())
    line.close()
    with pytest.raises(DeviceError, match="closed"):
        line.write(b"x")
    with pytest.raises(DeviceError, match="closed"):
        line.read()
