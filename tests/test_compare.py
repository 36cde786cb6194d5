"""Two drives side by side: what is better, what is not comparable, what is no drive at all."""

from __future__ import annotations

import json
import sys

import pytest

from host import compare
from host.errors import InputError, UsageError
from tests.view.test_report import a_result

SLOWER = {"frame_time_ms": {"median": 50.0, "p95": 90.0}}


def run(monkeypatch, capsys, *arguments: object) -> str:
    monkeypatch.setattr(sys, "argv", ["compare", *map(str, arguments)])
    assert compare.main() == 0
    return capsys.readouterr().out


@pytest.fixture
def two(tmp_path):
    """A run's folder and a lone result of the same world, slower and nearer to its goal."""
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / "result.json").write_text(json.dumps(a_result()))
    other = a_result() | {"outcome": "timeout", "reason": "not there", "min_clearance_cm": 20.0}
    other["final_pose_error"] = {"position_cm": 3.0}
    other["frame_time_ms"] = {"median": 5.2, "p95": 90.0}
    (tmp_path / "two.json").write_text(json.dumps(other))
    return tmp_path


def test_each_figure_is_marked_by_what_is_better_for_it(two, monkeypatch, capsys):
    page = two / "both.html"
    out = run(monkeypatch, capsys, two / "one", two / "two.json", "--html", page)
    marks = {
        line.split("│")[1].strip(): line.split("│")[4].strip() for line in out.splitlines() if "│" in line
    }
    assert marks["outcome"] == "worse"
    assert marks["closest approach *"] == "better"  # more is
    assert marks["final pose off by *"] == "worse"
    assert marks["distance"] == "" and marks["collisions *"] == ""
    found = dict(
        (row[0], row[3]) for row in compare.rows(a_result(), json.loads((two / "two.json").read_text()))
    )
    assert found["picture to command, median"] == ""  # real times vary
    assert found["95 % of them below"] in ("worse", "")
    assert "Note" not in out
    text = page.read_text()
    assert text.count("The way, from above</text>") == 2 and "not there" in text


def test_runs_of_different_worlds_and_settings_are_noted(two, monkeypatch, capsys):
    other = a_result() | {"camera": "sim:corridor?seed=2", "settings": {}, "versions": {"python": "3.13"}}
    (two / "two.json").write_text(json.dumps(other))
    out = " ".join(run(monkeypatch, capsys, two / "one", two / "two.json", "--html", two / "x.html").split())
    assert "Different worlds: sim:room?seed=1 and sim:corridor?seed=2" in out
    assert "Different settings: nav.speed_cm_s" in out and "Different versions: python" in out
    assert "Different worlds" in (two / "x.html").read_text()


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (None, "cannot be read"), ("{", "is no JSON"), ("[]", "no result of a drive"),
        ("{}", "has no outcome"), (json.dumps({"outcome": 3}), "has no outcome"),
    ],
)  # fmt: skip
def test_what_is_no_result_is_said_to_be_none(two, monkeypatch, content, complaint):
    (two / "two.json").unlink() if content is None else (two / "two.json").write_text(content)
    monkeypatch.setattr(
        sys, "argv", ["compare", str(two / "one"), str(two / "two.json"), "--html", str(two / "x")]
    )
    with pytest.raises(InputError, match=complaint) as told:
        compare.main()
    assert "name a" in str(told.value) and not (two / "x").exists()


@pytest.mark.parametrize(
    "damage",
    [
        {"settings": [1]}, {"settings": {"a": 1}}, {"versions": ["x"]}, {"trace": {"x_cm": [1, 2]}},
        {"depths": [{"a": 1}]}, {"floor": [1]}, {"goal_cm": [1]},
    ],
)  # fmt: skip
def test_a_damaged_result_is_told_in_one_line_and_leaves_no_page(two, monkeypatch, damage):
    (two / "two.json").write_text(json.dumps(a_result() | damage))
    arguments = [str(two / "one"), str(two / "two.json"), "--html", str(two / "x")]
    monkeypatch.setattr(sys, "argv", ["compare", *arguments])
    with pytest.raises(InputError, match=r"two\.json: is damaged, or was written by another version"):
        compare.main()
    assert not (two / "x").exists()


@pytest.mark.parametrize("file", ["two.json", "one/result.json"])
def test_a_result_is_never_overwritten_by_the_page(two, monkeypatch, file):
    before = (two / file).read_text()
    arguments = [str(two / "one"), str(two / "two.json"), "--html", str(two / file)]
    monkeypatch.setattr(sys, "argv", ["compare", *arguments])
    with pytest.raises(UsageError, match="is one of the two results"):
        compare.main()
    assert (two / file).read_text() == before
