"""Error against baseline, area, noise and slant, for the paper's way, ours, and the limit of Eq. 16."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from host.experiments.summary import Findings
from host.experiments.tables import BOXES

matplotlib.use("Agg")

TURNED = ("turned_left", "turned_right", "leaning")
STYLES = {
    "paper area": ("paper mode, area (Eq. 16)", "#b5442e", "s-"),
    "paper vertex": ("paper mode, corners (Eq. 10)", "#d99a3c", "d-"),
    "exact areas": ("Eq. 16 on the exact areas", "#8a8a8a", "x:"),
    "area": ("ours, area", "#7fb0d8", "o--"),
    "vertex": ("ours, corners", "#5f9e6e", "^--"),
    "fused": ("ours, fused", "#1f5fa8", "o-"),
}
SMALLEST = 0.01  # percent; less is drawn there


def errors_plot(findings: Findings) -> bytes:
    """Four panels as a PNG."""
    figure = Figure(figsize=(10.5, 7.6), dpi=90, layout="constrained")
    (baseline, area), (noise, slant) = figure.subplots(2, 2)
    exact = findings.where(odometry="exact")
    first = exact.where(at="first")
    things = first.where(course="experiment_1")
    corners = things.where(lambda f: f.true_place_cm is not None)
    _lines(baseline, things.where(thing=BOXES), "travel_cm", ("paper area", "exact areas", "area", "fused"))
    _lines(baseline, corners, "travel_cm", ("paper vertex", "vertex"))
    _label(baseline, "Baseline (experiment 1, shaking)", "driven, cm")
    boards = exact.where(course="area", thing="board", at="first")
    _lines(area, boards, "setting", ("paper area", "exact areas", "area", "fused"))
    area.set_xscale("log")
    sides = [float(str(side)) for side in boards.values("setting")]
    area.set_xticks(sides, [f"{side * side:.0f}" for side in sides], minor=False)
    area.set_xticks([], minor=True)
    _label(area, "Area (square board at 85 cm, 10 cm driven)", "area of the board, cm²")
    noisy = first.where(course="noise", thing=BOXES)
    _lines(noise, noisy, "setting", ("paper area", "exact areas", "area", "fused"))
    _label(noise, "Noise (experiment 1, 10 cm driven)", "noise, times that of an ordinary webcam")
    slanted = exact.where(course="slant", at="last", thing=TURNED)
    _lines(slant, slanted, "setting", ("paper area", "exact areas", "area", "fused"))
    _label(slant, "Slant (boards turned and leaning, 10 cm driven)", "slant, degrees")
    handles = {line.get_label(): line for axes in (baseline, area) for line in axes.get_lines()}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3, frameon=False)
    out = io.BytesIO()
    figure.savefig(out, format="png", metadata={"Software": None})
    return out.getvalue()


def _lines(axes: Axes, findings: Findings, along: str, methods: Sequence[str]) -> None:
    """Median of the absolute error against one field."""
    for method in methods:
        rows = findings.where(method=method)
        points = [(float(str(x)), rows.where(**{along: x}).summary) for x in rows.values(along)]
        points = sorted((x, max(SMALLEST, s.median)) for x, s in points if s.found)
        name, colour, style = STYLES[method]
        axes.plot(*zip(*points, strict=True) if points else ([], []), style, color=colour, label=name, ms=4.5)


def _label(axes: Axes, title: str, along: str) -> None:
    axes.set_title(title, fontsize=10)
    axes.set_xlabel(along)
    axes.set_ylabel("median error, %")
    axes.set_yscale("log")
    axes.grid(True, which="major", color="#dddddd", linewidth=0.6)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())
    low, high = (math.log10(limit) for limit in axes.get_ylim())
    axes.set_ylim(10 ** math.floor(low), 10 ** math.ceil(high))  # whole decades, so that there are labels
