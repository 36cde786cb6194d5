"""What the firmware takes of the processor, measured as `make budget` does it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from host.sim.avr.board import AvrBoard
from host.sim.board import Side

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools"))
import firmware_budget  # noqa: E402
from firmware_budget import Figure  # noqa: E402


@pytest.fixture(scope="module")
def figures(built: Path) -> dict[str, Figure]:
    """By what they tell."""
    measured = firmware_budget.measure(built / "uno.elf", built / "librig.so")
    return {figure.what: figure for figure in measured}


@pytest.mark.parametrize(
    ("what", "at_least", "at_most"),
    [
        ("flash", 8000, 24 * 1024),
        ("static RAM", 400, 1228),
        ("stack, deepest", 100, 400),
        ("encoder interrupt, one wheel", 70, 90),
        ("encoder interrupt, both wheels", 91, 140),
        ("interrupts off, longest", 91, 320),
        ("received byte until read", 60, 640),
        ("received bytes lost", 0, 0),
        ("processor load at 1 m/s", 5, 40),
        ("floating point, 64 bits, heap", 0, 0),
    ],
)
def test_the_firmware_keeps_to_its_budget(
    figures: dict[str, Figure], what: str, at_least: float, at_most: float
) -> None:
    assert figures[what].most == at_most
    assert at_least <= figures[what].value <= at_most
    assert len(figures) == 10


def test_what_is_too_much_is_told() -> None:
    kept, broken = Figure("flash", 10, 20, "B"), Figure("stack", 30, 20, "B")
    assert kept.kept and not broken.kept
    told = firmware_budget.table([kept, broken]).splitlines()
    assert [line.endswith("TOO MUCH") for line in told] == [False, False, True]


# --- The encoder interrupt by hand, from the data sheet's table of instructions --------------------

ENTRY = 4 + 3  # and the vector's jump
SAVED = 7 * 2 + 1  # seven registers, one of which holds the status
STAMP = 1 + 2 + 1 + 2  # low byte, high byte, no overflow is pending, past the rest
OVERFLOW = 1  # more if one is
PINS = 1 + 1 + 1 + 1  # now, last time, kept, changed
IS_LEFT = 1 + 1 + 1 + 1  # mask, branch not taken, the pins
IS_NOT_LEFT = 1 + 1 + 2
IS_RIGHT = 1 + 1 + 1 + 1 + 1
IS_NOT_RIGHT = 1 + 2
PHASE = 4 * 1 + 2 + 2 + 2 * 1 + 1  # Gray code to binary, the old one, kept, steps, some
COUNT = 3 * 1 + 2 + 2 + 1 + 2 + 2 * 2 + 2  # which way, told, count, added, kept, stamp, past the rest
RESTORED = 7 * 2 + 1 + 4  # and the return


@pytest.mark.parametrize(
    ("sides", "cycles"),
    [
        ((Side.LEFT,), IS_LEFT + PHASE + COUNT + IS_NOT_RIGHT),
        ((Side.RIGHT,), IS_NOT_LEFT + IS_RIGHT + PHASE + COUNT),
        (tuple(Side), IS_LEFT + IS_RIGHT + 2 * (PHASE + COUNT)),
    ],
    ids=["left", "right", "both"],
)
def test_the_encoder_interrupt_takes_what_its_instructions_add_up_to(
    make_board: Callable[..., AvrBoard], sides: tuple[Side, ...], cycles: int
) -> None:
    board, edges = make_board(), 4000
    chance = np.random.default_rng(7)
    board.step(50_000)
    board.clear_stats()
    at_us = board.time_us + np.cumsum(chance.integers(100, 400, edges))
    for side in sides:
        board.set_many_encoder_pins(np.full(edges, side), np.array([1, 3, 2, 0])[np.arange(edges) % 4], at_us)
    board.step(int(at_us[-1]) - board.time_us + 1000)
    measured = board.stats().interrupts["encoder"]
    counted = ENTRY + SAVED + STAMP + PINS + cycles + RESTORED
    assert measured.runs == edges
    assert measured.worst_cycles == counted + OVERFLOW  # seldom, but in 4000 edges it happens
    assert counted < measured.mean_cycles < counted + 0.05
