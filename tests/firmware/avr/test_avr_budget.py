"""What the firmware takes of the processor, measured as `make budget` does it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

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
