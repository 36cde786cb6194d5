"""Plots as SVG: well-formed whatever the numbers, points where they belong, hover titles, round ticks."""

from __future__ import annotations

import math
import re
from xml.etree import ElementTree

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from host.view.plot import HEIGHT, WIDTH, Mark, Plot, Series, Underlay, brief, draw, round_step

NUMBER = st.one_of(st.none(), st.floats(width=32), st.integers(-5, 5).map(float))


def circles(svg: str) -> list[tuple[float, float]]:
    found = re.findall(r'<circle[^>]* cx="([-\d.]+)" cy="([-\d.]+)"', svg)
    return [(float(x), float(y)) for x, y in found]


@settings(max_examples=60, deadline=None)
@given(
    kind=st.sampled_from(["line", "points", "bars", "histogram", "plan"]),
    values=st.lists(st.tuples(NUMBER, NUMBER, st.floats(0, 9)), max_size=6),
    logs=st.tuples(st.booleans(), st.booleans()),
    limit=NUMBER,
)
def test_any_numbers_make_a_picture_that_parses_and_holds_no_nan(kind, values, logs, limit):
    xs, ys, sigmas = ([row[k] for row in values] for k in range(3))
    if kind == "histogram":
        one = Series("a<b", [float(k) for k in range(len(ys) + 1)], ys)
    else:
        one = Series("a<b", xs, ys, sigmas if kind in ("line", "points") else [])
    ticks = [f"<{k}>" for k in range(len(ys))] if kind == "bars" else []
    svg = draw(Plot("x & y", kind, "s", "ms", [one, one], *logs, limit, ticks, [Mark(1.0, "<stop>")]))
    ElementTree.fromstring(svg)
    assert "nan" not in svg and "inf" not in svg


def test_a_point_lies_where_its_numbers_say_and_tells_them_to_the_pointer():
    one = Series("a", [0.0, 5.0, 10.0], [0.0, 50.0, 100.0], titles=["low", "middle <1>", "high"])
    svg = draw(Plot("t", "points", "s", "cm", [one]))
    (x0, y0), (x1, y1), (x2, y2) = circles(svg)
    assert 0 < x0 < x2 < WIDTH and HEIGHT > y0 > y2 > 0
    assert (x1, y1) == pytest.approx(((x0 + x2) / 2, (y0 + y2) / 2), abs=0.1)
    assert "<title>middle &lt;1&gt;</title>" in svg


def test_a_plan_has_one_scale_both_ways():
    one = Series("way", [0.0, 100.0, 0.0], [0.0, 0.0, 100.0], look="points")
    (x0, y0), (x1, _), (_, y2) = circles(draw(Plot("t", "plan", "cm", "cm", [one])))
    assert x1 - x0 == pytest.approx(y0 - y2, abs=0.2)


def test_a_line_stops_where_a_number_is_missing():
    one = Series("a", [0.0, 1.0, 2.0, 3.0, 4.0], [1.0, 1.0, math.nan, 1.0, 1.0], [0.5] * 5)
    svg = draw(Plot("t", "line", "s", "cm", [one]))
    assert svg.count('class="line') == svg.count('class="band"') == 2


def test_a_long_line_has_few_places_to_point_at():
    one = Series("a", [float(k) for k in range(6000)], [1.0] * 6000)
    assert 100 < draw(Plot("t", "line", "s", "cm", [one])).count("<title>") < 200


@pytest.mark.parametrize(
    ("least", "step"), [(0.9, 1), (1.1, 2), (2.1, 5), (5.1, 10), (0.02, 0.02), (300, 500)]
)
def test_ticks_are_round(least, step):
    assert round_step(least) == pytest.approx(step)


def test_numbers_are_brief():
    assert [brief(v) for v in (0, 0.05, 2.5, 1200, 1e-6)] == ["0", "0.05", "2.5", "1200", "1e-6"]


def test_what_a_result_says_of_its_picture_does_not_become_part_of_the_page():
    under = Underlay('data:image/png;base64,"/><script>alert(1)</script>', 0.0, 0.0, 10.0, 10.0)
    svg = draw(Plot("way", "plan", "x", "y", [Series("way", [1.0, 2.0], [1.0, 2.0])], underlay=under))
    ElementTree.fromstring(svg)
    assert "<script" not in svg


def test_values_that_are_all_the_same_have_an_axis_that_tells_them_apart_from_others():
    for value in (0.0, 7.4, 1500.0):
        svg = draw(Plot("one", "points", "s", "V", [Series("one", [0.0, 1.0], [value, value])]))
        ticks = re.findall(r"text-anchor=\"end\"[^>]*>([^<]*)</text>", svg)
        assert len(ticks) > 1 and len(set(ticks)) == len(ticks), ticks
        assert not any("e-" in tick for tick in ticks)
