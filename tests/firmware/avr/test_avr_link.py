"""The client, a bad line and the real program: the figures of tests/link, on the ATmega.

``MOVES=200 pytest -s tests/firmware/avr/test_avr_link.py`` takes a minute more.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from host.link.faults import Faults
from host.link.protocol import Move
from host.sim import rolling
from host.sim.avr.board import AvrBoard

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "link"))
from bad_line_bench import (
    NOISY,
    ROUGH,
    Bench,
    lose_during_a_move,
    move_often,
    percentile,
    setpoint_ages_ms,
    write_often,
)  # fmt: skip

MOVES = int(os.environ.get("MOVES", "60"))


@pytest.fixture(autouse=True)
def real_program(make_board: Callable[..., AvrBoard], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rolling, "AvrBoard", make_board)


def test_with_bit_errors_setpoints_stay_fresh_and_nothing_stops():
    ages_ms = setpoint_ages_ms(Bench(NOISY, 1, avr=True), 40.0)
    p99 = percentile(ages_ms, 0.99)
    print(f"\nsetpoint age p50 {percentile(ages_ms, 0.5):.1f}, p99 {p99:.1f}, most {max(ages_ms):.1f} ms")
    assert p99 <= 60.0


def test_moves_are_each_done_exactly_once():
    move_often(Bench(ROUGH, 5, avr=True), MOVES)


def test_parameters_are_written_and_saved_exactly_once():
    write_often(Bench(ROUGH, 6, avr=True), 100)


@pytest.mark.parametrize("how", ["unplugged", "restarted", "paused"])
def test_a_move_that_loses_its_robot_ends_and_is_never_begun_again(how: str):
    lose_during_a_move(Bench(Faults(), seed=7, avr=True), Move, how)
