"""A driver's times are believed as long as they can be true."""

from __future__ import annotations

from itertools import pairwise

import pytest

from host.camera.stamps import Stamps


def run(driver_s, delay_s: float = 0.04, pictures: int = 20) -> tuple[list[float], list[float], list[str]]:
    """(times given, times of arrival, what was told) of pictures 1/30 s apart."""
    told: list[str] = []
    stamps = Stamps("/dev/video0", told.append)
    arrived = [1000.0 + k / 30 for k in range(pictures)]
    given = [stamps.taken_s(driver_s(k, t - delay_s), t) for k, t in enumerate(arrived)]
    return given, arrived, told


def test_plausible_times_are_used_as_they_are():
    given, arrived, told = run(lambda k, t: t)
    assert given == [t - 0.04 for t in arrived]
    assert told == []


@pytest.mark.parametrize(
    ("driver_s", "words"),
    [
        (lambda k, t: 0.0, "there are none"),
        (lambda k, t: t + 1.7e9, "ahead of its picture's arrival"),  # the wall's clock
        (lambda k, t: t - 500.0, "500 s before its picture's arrival"),  # a clock that stood while asleep
        (lambda k, t: 999.9, "did not follow the last, at 999.900 s"),  # one that stands
    ],
    ids=["none", "of another clock", "of the past", "always the same"],
)
def test_others_are_replaced_by_the_arrival_and_that_is_told_once(driver_s, words: str):
    given, arrived, told = run(driver_s)
    assert given[5:] == pytest.approx(arrived[5:], abs=0.11)
    assert all(a < b for a, b in pairwise(given[5:]))
    assert len(told) == 1
    assert told[0].startswith("camera /dev/video0: its driver's times cannot be right") and words in told[0]
    assert "times of arrival" in told[0]


def test_a_single_slip_is_mended_by_the_usual_delay():
    given, arrived, told = run(lambda k, t: t + 0.5 if k == 7 else t)
    assert given == pytest.approx([t - 0.04 for t in arrived])
    assert told == []


def test_a_clock_that_goes_wrong_later_leaves_no_jump():
    given, arrived, told = run(lambda k, t: t if k < 10 else t - 3000.0)
    assert given == pytest.approx([t - 0.04 for t in arrived])
    assert "times of arrival less 40 ms are used" in told[0]
