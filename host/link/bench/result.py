"""What a command of the bench found: one table, plots as data, a verdict; to JSON and back."""

from __future__ import annotations

import json
import math
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import UnionType
from typing import Any, get_args

from host.errors import InputError
from host.link.bench.verdict import Finding, Grade, Verdict
from host.record.atomic import write_whole
from host.view.plot import Kind, Plot, Series

FORMAT = "robot link bench 1"
Cell = str | int | float | None


@dataclass(frozen=True)
class Result:
    """What a command found."""

    command: str
    robot: str
    settings: dict[str, Any]
    columns: list[str]
    rows: list[list[Cell]]
    verdict: Verdict
    plots: list[Plot] = field(default_factory=list)
    details: dict[str, Any] = field(default_factory=dict)  # counters and the like, for the JSON alone
    when: str = field(default_factory=lambda: time.strftime("%Y-%m-%d %H:%M:%S"))

    def as_dict(self) -> dict[str, Any]:
        """As the JSON file has it; null for what is no number."""
        told = {"format": FORMAT, **asdict(self)}
        told["verdict"] = {
            "grade": self.verdict.grade.name.lower(),
            "text": self.verdict.text,
            "findings": [{"grade": f.grade.name.lower(), "text": f.text} for f in self.verdict.findings],
        }
        return _finite(told)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_result(result: Result, path: Path) -> None:
    """As JSON, whole or not at all."""
    write_whole(path, (json.dumps(result.as_dict(), indent=1, allow_nan=False) + "\n").encode())


def read_result(path: Path) -> Result:
    """A result written earlier.

    Raises
    ------
    InputError
        The file is not readable or is no result of the bench.
    """
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, RecursionError):
        raise InputError(f"{path}: is no JSON; name files written with --json") from None
    try:
        return _result(told)
    except (KeyError, TypeError, ValueError, OverflowError):
        raise InputError(f"{path}: is no result of the bench; name files written with --json") from None


def _result(told: Any) -> Result:
    """From what a file holds; KeyError, TypeError, ValueError or OverflowError where that is no result."""
    if told["format"] != FORMAT:
        raise ValueError("another format")
    findings = tuple(
        Finding(Grade[_a(str, one["grade"]).upper()], _a(str, one["text"]))
        for one in _list(dict, told["verdict"]["findings"])
    )
    rows = [_list(str | int | float | None, row) for row in _list(list, told["rows"])]
    return Result(
        _a(str, told["command"]), _a(str, told["robot"]), _a(dict, told["settings"]),
        _list(str, told["columns"]), rows, Verdict(findings),
        [_plot(one) for one in _list(dict, told["plots"])],
        _a(dict, told["details"]), _a(str, told["when"]),
    )  # fmt: skip


def _plot(told: dict[str, Any]) -> Plot:
    series = [Series(**one) for one in _list(dict, told["series"])]
    plot = Plot(**{**told, "series": series})
    for text in (plot.title, plot.x_label, plot.y_label, *_list(str, plot.ticks)):
        _a(str, text)
    _a(bool, plot.log_x)
    _a(bool, plot.log_y)
    _a(int | float | None, plot.limit)
    if plot.kind not in get_args(Kind):
        raise ValueError("no kind of plot")
    if plot.marks or plot.underlay is not None:
        raise ValueError("more than the bench draws")
    for one in series:
        for text in (one.name, one.look, *_list(str, one.titles)):
            _a(str, text)
        _a(int | None, one.colour)
        edges = 1 if plot.kind == "histogram" else 0
        if len(_list(int | float | None, one.x)) != len(_list(int | float | None, one.y)) + edges:
            raise ValueError("points with one coordinate")
        if len(_list(int | float | None, one.sigma)) not in (0, len(one.x)) or len(one.titles) not in (
            0,
            len(one.x),
        ):
            raise ValueError("points without a sigma or title")
    return plot


def _a(kind: type | UnionType, value: Any) -> Any:
    if not isinstance(value, kind):
        raise TypeError
    if isinstance(value, int):
        float(value)  # OverflowError for one that no plot and no table has room for
    return value


def _list(kind: type | UnionType, value: Any) -> list[Any]:
    return [_a(kind, one) for one in _a(list, value)]
