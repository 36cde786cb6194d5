"""Learning where an encoder's edges lie: true places found, changes of speed not taken for them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from host.nav.marks import CYCLE, Marks

shifts = st.lists(st.floats(-0.4, 0.4), min_size=CYCLE, max_size=CYCLE)


def gaps(place) -> list[float]:
    return [place(border + 1) - place(border) for border in range(CYCLE)]


@given(shifts, st.sampled_from([1, -1]), st.floats(5.0, 120.0))
@settings(max_examples=100)
def test_on_even_motion_the_true_gaps_between_edges_are_found(off, direction, counts_a_second):
    marks = Marks()
    times = sorted(  # a shift of 0.4 forward and back keeps the order
        ((direction * n + off[direction * n % CYCLE]) * direction / counts_a_second, direction * n)
        for n in range(1, 400)
    )
    for t_s, border in times:
        marks.hear(t_s, border)
    true = gaps(lambda border: border + off[border % CYCLE])
    assert gaps(marks.place) == pytest.approx(true, abs=0.01)


@given(shifts, st.integers(0, 3))
@settings(max_examples=30)
def test_an_edge_that_is_missed_now_and_then_does_no_harm(off, phase):
    marks = Marks()
    for n in range(1, 800):
        if n % 11 != phase:
            marks.hear((n + off[n % CYCLE]) / 30, n)
    true = gaps(lambda border: border + off[border % CYCLE])
    assert gaps(marks.place) == pytest.approx(true, abs=0.02)


def test_speeding_up_and_slowing_down_is_not_taken_for_uneven_edges():
    marks = Marks()
    place, t_s, n = 0.0, 0.0, 0
    for step in range(40_000):  # 20 s between 20 and 60 counts a second
        t_s = step * 5e-4
        place += (40 - 20 * math.cos(2 * math.pi * t_s / 2.5)) * 5e-4
        if place >= n + 1:
            n += 1
            marks.hear(t_s, n)
    assert np.abs(np.array(gaps(marks.place)) - 1).max() < 0.05


def test_rolling_to_and_fro_over_one_edge_teaches_nothing():
    marks = Marks()
    for n in range(100):
        marks.hear(0.1 * n, 5 if n % 3 else 6)
    assert gaps(marks.place) == [1.0] * CYCLE


def test_what_was_learnt_can_be_forgotten():
    marks = Marks()
    for n in range(1, 100):
        marks.hear((n + (0.3 if n % 2 else 0.0)) / 30, n)
    assert max(gaps(marks.place)) > 1.2
    marks.forget()
    assert gaps(marks.place) == [1.0] * CYCLE
