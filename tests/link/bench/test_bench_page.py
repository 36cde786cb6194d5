"""Numbers as people read them, and plots of every kind as pictures."""

from __future__ import annotations

import math

import pytest

from host.link.bench.page import page
from host.link.bench.result import Cell, Plot, Result, Series
from host.link.bench.terminal import cell_text
from host.link.bench.verdict import Verdict

KINDS = [
    Plot("h", "histogram", "ms", "n", [Series("a", [0.0, 1.0, 2.0], [3.0, 4.0])], limit=1.5),
    Plot("l", "line", "rate", "ms", [Series("a", [1e-6, 1e-3], [1.0, 5.0])], log_x=True, limit=60.0),
    Plot("p", "points", "s", "ms", [Series("a", [0.0, 1.0], [1.0, 2.0])]),
    Plot("b", "bars", "", "ms", [Series("a", [0.0, 1.0], [1.0, 2.0]), Series("b", [0.0, 1.0], [2.0, 3.0])],
         limit=400.0, ticks=["one", "two"]),
]  # fmt: skip


@pytest.mark.parametrize(
    ("cell", "text"),
    [
        (None, "–"),
        ("1e-4", "1e-4"),
        (1234567, "1,234,567"),
        (0.0, "0.00"),
        (-3e-11, "0.00"),
        (1.5e-5, "1.5e-05"),
        (3.14159, "3.14"),
        (31.4159, "31.4"),
        (3141.59, "3,142"),
        (math.inf, "–"),
        (math.nan, "–"),
    ],
)
def test_numbers_have_the_digits_that_mean_something(cell: Cell, text: str) -> None:
    assert cell_text(cell) == text


def test_a_page_holds_every_plot_and_escapes_what_it_is_told() -> None:
    result = Result("cut", "sim:?a&b", {"only": "<x>"}, ["a<b"], [["1 & 2"]], Verdict(()), KINDS)
    text = page([result]).decode()
    assert text.count("<svg") == len(KINDS)
    assert "a&lt;b" in text and "1 &amp; 2" in text and "&lt;x&gt;" in text and "<x>" not in text
