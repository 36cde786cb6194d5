"""A result's plots, drawn for the width of a phone."""

from __future__ import annotations

import io
import math
from typing import Literal

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from host.link.bench.result import Plot

matplotlib.use("Agg")

COLOURS = ("#1f5fa8", "#b5442e", "#5f9e6e", "#d99a3c", "#7a5aa6", "#6b6b6b")
SIZE_IN = (5.2, 3.3)


def draw(plot: Plot, form: Literal["svg", "png"] = "svg") -> bytes:
    """One plot as a picture file."""
    figure = Figure(figsize=SIZE_IN, dpi=120, layout="constrained")
    axes = figure.subplots()
    {"histogram": _histogram, "line": _lines, "points": _points, "bars": _bars}[plot.kind](axes, plot)
    _dress(axes, plot)
    if plot.kind == "bars" and len(plot.series) > 1:  # where there is no room inside
        figure.legend(loc="outside lower center", ncols=len(plot.series), fontsize=8, frameon=False)
    out = io.BytesIO()
    figure.savefig(out, format=form, metadata={"Date": None} if form == "svg" else {"Software": None})
    return out.getvalue()


def _histogram(axes: Axes, plot: Plot) -> None:
    for series, colour in zip(plot.series, COLOURS, strict=False):
        axes.stairs(series.y, series.x, fill=True, color=colour, alpha=0.85, label=series.name)


def _lines(axes: Axes, plot: Plot) -> None:
    for series, colour in zip(plot.series, COLOURS, strict=False):
        marker = "o" if len(series.x) <= 40 else None
        axes.plot(series.x, series.y, color=colour, marker=marker, ms=4, lw=1.4, label=series.name)


def _points(axes: Axes, plot: Plot) -> None:
    for series, colour in zip(plot.series, COLOURS, strict=False):
        size = 4 if len(series.x) <= 200 else 2
        axes.plot(series.x, series.y, ".", color=colour, ms=2 * size, label=series.name, alpha=0.7)


def _bars(axes: Axes, plot: Plot) -> None:
    """Lying bars, so that their names can be read."""
    count = len(plot.series)
    for k, (series, colour) in enumerate(zip(plot.series, COLOURS, strict=False)):
        at = [x + (k - (count - 1) / 2) * 0.8 / count for x in series.x]
        axes.barh(at, series.y, height=0.8 / count, color=colour, label=series.name)
    axes.set_yticks(range(len(plot.ticks)), plot.ticks, fontsize=7)
    axes.set_ylim(len(plot.ticks) - 0.4, -0.6)
    figure = axes.get_figure()
    if isinstance(figure, Figure):
        figure.set_size_inches(SIZE_IN[0], max(SIZE_IN[1], 1.2 + 0.21 * len(plot.ticks)))


def _dress(axes: Axes, plot: Plot) -> None:
    lying = plot.kind == "bars"
    axes.set_title(plot.title, fontsize=10)
    axes.set_xlabel(plot.y_label if lying else plot.x_label, fontsize=9)
    axes.set_ylabel(plot.x_label if lying else plot.y_label, fontsize=9)
    axes.tick_params(labelsize=7 if lying else 8)
    if plot.log_x:
        axes.set_xscale("log")
    if plot.log_y:
        axes.set_yscale("log")
    if plot.limit is not None and math.isfinite(plot.limit):
        line = axes.axvline if lying or plot.kind == "histogram" else axes.axhline
        line(plot.limit, color="#b5442e", lw=1, ls="--")
    if not (plot.log_y or plot.kind == "points" or lying):
        axes.set_ylim(bottom=0)
    axes.grid(True, which="major", axis="x" if lying else "both", color="#dddddd", lw=0.6)
    axes.set_axisbelow(True)
    if len(plot.series) > 1 and not lying:
        axes.legend(fontsize=8, frameon=False)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
