"""Plots as SVG from plain numbers, without any library; the page around them brings the colours (STYLE)."""

from __future__ import annotations

import html
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import Literal

Kind = Literal["histogram", "line", "points", "bars", "plan"]

WIDTH, HEIGHT = 420, 260  # of a plot without its legend; as wide as a phone, so that letters stay readable
LEFT, RIGHT, TOP, BOTTOM = 46, 10, 24, 34
LETTER = 5.6  # px, of the average letter
LEGEND_ROW = 16
COLOURS = 8
MOST_HOVERS = 150  # of one line
ALONE = 0.1  # of a value, or of 1 if that is more, shown on either side where all values are this one
BAR_ROW = 17
STYLE = """
:root { --grid: #e3e3e3; --ink: #222; --muted: #666; --back: #fff; --limit: #b5302e; --free: #d9ead6;
  --c0: #1f5fa8; --c1: #b5442e; --c2: #3c8a55; --c3: #b87a14; --c4: #7a5aa6; --c5: #666; --c6: #178a95;
  --c7: #b0447e; }
@media (prefers-color-scheme: dark) { :root { --grid: #3a3d42; --ink: #e8e8e8; --muted: #a5a9ae;
  --back: #17191c; --limit: #ff7b72; --free: #2c4433; --c0: #7db3f0; --c1: #f08a72; --c2: #7fcf9a;
  --c3: #e8b860; --c4: #b99be6; --c5: #b0b0b0; --c6: #5fd0da; --c7: #f08fc0; } }
svg.plot { width: 100%; height: auto; display: block; font: 10px system-ui, sans-serif; fill: var(--muted); }
svg.plot .title { font-size: 12px; font-weight: 600; fill: var(--ink); }
svg.plot .grid { stroke: var(--grid); fill: none; } svg.plot .limit { stroke: var(--limit); }
svg.plot .limit, svg.plot .mark { stroke-dasharray: 4 3; } svg.plot .mark { stroke: var(--muted); }
svg.plot .line { fill: none; stroke: var(--c); stroke-width: 1.5; stroke-linejoin: round; }
svg.plot .thick { stroke-width: 4; } svg.plot .dashed { stroke-dasharray: 3 3; }
svg.plot .band { fill: var(--c); opacity: 0.2; } svg.plot .dot, svg.plot .bar { fill: var(--c); }
svg.plot .whisker { stroke: var(--c); opacity: 0.5; }
svg.plot .ring { fill: transparent; stroke: var(--c); }
svg.plot .over { fill: transparent; } svg.plot .over:hover { fill: var(--c); }
svg.plot image { image-rendering: pixelated; }
"""


@dataclass(frozen=True)
class Series:
    """One set of points of a plot."""

    name: str
    x: list[float]
    y: list[float]
    sigma: list[float] = field(default_factory=list)  # of y: a band around a line, a whisker through a point
    titles: list[str] = field(default_factory=list)  # shown where the pointer rests; else the numbers are
    look: Literal["", "points", "rings", "dashed", "thick"] = ""  # unlike the others of its plot
    colour: int | None = None  # of STYLE's, instead of the next


@dataclass(frozen=True)
class Underlay:
    """A picture that lies under a plan."""

    href: str
    x: float  # of its left edge
    y: float  # of its lower edge
    width: float
    height: float


@dataclass(frozen=True)
class Mark:
    """Something that happened at one x."""

    x: float
    title: str


@dataclass(frozen=True)
class Plot:
    """A plot as data. Of a histogram `x` holds the left ends of its bins and one more."""

    title: str
    kind: Kind  # a plan has the same scale both ways
    x_label: str
    y_label: str
    series: list[Series]
    log_x: bool = False
    log_y: bool = False
    limit: float | None = None  # what y should not exceed; of a histogram, what x should not
    ticks: list[str] = field(default_factory=list)  # names along x, of bars
    marks: list[Mark] = field(default_factory=list)
    underlay: Underlay | None = None


def draw(plot: Plot) -> str:
    """The plot as an SVG element."""
    return _Bars(plot).svg() if plot.kind == "bars" else _Chart(plot).svg()


class _Axis:
    """Numbers to pixels along one side."""

    def __init__(
        self, values: Sequence[float], log: bool, from_px: float, to_px: float, slack: float
    ) -> None:
        self.log = log
        known = [v for v in values if math.isfinite(v) and (v > 0 or not log)] or [1.0]
        low, high = (self._scaled(v) for v in (min(known), max(known)))
        least = max(abs(low), abs(high), 1.0) * 1e-6 if not log else 0.5
        alone = max(abs(low), abs(high), 1.0) * ALONE if not log else 0.5
        widen = alone if high - low < least else slack * (high - low)
        self.low, self.high = low - widen * (low != 0 or log), high + widen
        self._from_px, self._to_px = from_px, to_px

    def _scaled(self, value: float) -> float:
        return math.log10(max(value, 1e-300)) if self.log else value

    def fits(self, value: float) -> bool:
        """Whether there is a place for it."""
        return math.isfinite(value) and (value > 0 or not self.log)

    def at(self, value: float) -> float:
        share = (self._scaled(value) - self.low) / (self.high - self.low)
        return self._from_px + share * (self._to_px - self._from_px)

    def widen(self, span: float) -> None:
        """Show so much, with what is shown now in the middle."""
        more = (span - (self.high - self.low)) / 2
        self.low, self.high = self.low - more, self.high + more

    def ticks(self, most: int) -> list[float]:
        """Round values, at most about so many."""
        if self.log:
            first, last = math.ceil(self.low - 1e-9), math.floor(self.high + 1e-9)
            parts = (1, 2, 5) if last - first < 2 else (1,)
            every = max(1, math.ceil((last - first) / most))
            found = [p * 10.0**k for k in range(first - 1, last + 1) for p in parts if k % every == 0]
            return [v for v in found if self.low <= math.log10(v) <= self.high]
        step = round_step((self.high - self.low) / most)
        first = math.ceil(self.low / step - 1e-9)
        return [k * step for k in range(first, math.floor(self.high / step + 1e-9) + 1)]


def round_step(least: float) -> float:
    """The next of 1, 2, 5, 10, ... that is no less."""
    size = 10.0 ** math.floor(math.log10(least))
    return next(part * size for part in (1, 2, 5, 10) if part * size >= least * (1 - 1e-9))


def brief(value: float) -> str:
    """As few digits as tell it: 0.05, 2.5, 1200, 1e-06."""
    return f"{value:.4g}".replace("e-0", "e-").replace("e+0", "e") if value else "0"


class _Chart:
    """Two axes with lines, points or a histogram between them."""

    def __init__(self, plot: Plot) -> None:
        self.plot = plot
        points = [_points(one, plot.kind) for one in plot.series]
        xs = [x for found in points for x, *_ in found]
        ys = [y + way * s for found in points for _, y, s, _ in found for way in (-1, 1)]
        if plot.kind == "histogram":
            xs += [x for one in plot.series for x in _numbers(one.x)]
        if plot.limit is not None:
            (xs if plot.kind == "histogram" else ys).append(plot.limit)
        if plot.kind in ("histogram", "line") and not plot.log_y:
            ys.append(0.0)
        if plot.underlay is not None:
            xs += [plot.underlay.x, plot.underlay.x + plot.underlay.width]
            ys += [plot.underlay.y, plot.underlay.y + plot.underlay.height]
        self.height = HEIGHT
        if plot.kind == "plan":
            self.height = self._plan_height(xs, ys)
        even = plot.kind == "plan"
        self.x = _Axis(xs, plot.log_x and not even, LEFT, WIDTH - RIGHT, 0.04 if even else 0.01)
        self.y = _Axis(ys, plot.log_y and not even, self.height - BOTTOM, TOP, 0.05)
        if plot.kind == "plan":
            cm_px = max(
                (self.x.high - self.x.low) / (WIDTH - RIGHT - LEFT),
                (self.y.high - self.y.low) / (self.height - BOTTOM - TOP),
            )
            self.x.widen(cm_px * (WIDTH - RIGHT - LEFT))
            self.y.widen(cm_px * (self.height - BOTTOM - TOP))
        self.points = points

    @staticmethod
    def _plan_height(xs: list[float], ys: list[float]) -> int:
        """As its shape wants, within reason."""
        wide, high = (max(1.0, max(v, default=0) - min(v, default=0)) for v in (xs, ys))
        inner = (WIDTH - LEFT - RIGHT) * high / wide
        return TOP + BOTTOM + round(min(max(inner, 150), 480))

    def svg(self) -> str:
        height = self.height + _legend_height(self.plot)
        parts = [_head(self.plot, height), *self._under(), *self._grid(), *self._marks()]
        for k, (one, points) in enumerate(zip(self.plot.series, self.points, strict=True)):
            parts += [f'<g style="--c:var(--c{_colour(one, k)})">', *self._series(one, points), "</g>"]
        return "".join([*parts, _legend(self.plot, self.height), "</svg>\n"])

    def _under(self) -> Iterator[str]:
        under = self.plot.underlay
        if under is None:
            return
        left, right = self.x.at(under.x), self.x.at(under.x + under.width)
        low, high = self.y.at(under.y), self.y.at(under.y + under.height)
        yield f'<image x="{left:.1f}" y="{high:.1f}" width="{right - left:.1f}" height="{low - high:.1f}"'
        yield f' preserveAspectRatio="none" href="{html.escape(under.href)}"/>'

    def _grid(self) -> Iterator[str]:
        bottom, right = self.height - BOTTOM, WIDTH - RIGHT
        for value in self.x.ticks(7):
            x = self.x.at(value)
            yield f'<path class="grid" d="M{x:.1f} {TOP}V{bottom}"/>'
            yield f'<text x="{x:.1f}" y="{bottom + 12}" text-anchor="middle">{brief(value)}</text>'
        for value in self.y.ticks(6):
            y = self.y.at(value)
            yield f'<path class="grid" d="M{LEFT} {y:.1f}H{right}"/>'
            yield f'<text x="{LEFT - 4}" y="{y + 3.5:.1f}" text-anchor="end">{brief(value)}</text>'
        middle = (TOP + bottom) / 2
        yield f'<text x="{(LEFT + right) / 2:.0f}" y="{bottom + 26}" text-anchor="middle">'
        yield f"{html.escape(self.plot.x_label)}</text>"
        yield f'<text transform="translate(11 {middle:.0f}) rotate(-90)" text-anchor="middle">'
        yield f"{html.escape(self.plot.y_label)}</text>"
        limit = self.plot.limit
        if limit is not None and self.plot.kind == "histogram" and self.x.fits(limit):
            yield f'<path class="limit" d="M{self.x.at(limit):.1f} {TOP}V{bottom}"/>'
        elif limit is not None and self.plot.kind != "histogram" and self.y.fits(limit):
            yield f'<path class="limit" d="M{LEFT} {self.y.at(limit):.1f}H{right}"/>'

    def _marks(self) -> Iterator[str]:
        for mark in self.plot.marks:
            if self.x.fits(mark.x) and self.x.low <= mark.x <= self.x.high:
                yield f'<path class="mark" d="M{self.x.at(mark.x):.1f} {TOP}V{self.height - BOTTOM}">'
                yield f"{_title(mark.title)}</path>"

    def _series(self, one: Series, points: list[tuple[float, float, float, str]]) -> Iterator[str]:
        if self.plot.kind == "histogram":
            yield from self._steps(one)
            return
        runs = [list(run) for placed, run in groupby(points, self._placed) if placed]
        if self.plot.kind == "points" or one.look in ("points", "rings"):
            radius = 4.5 if self.plot.kind == "plan" else 2.2 if len(points) <= 200 else 1.4
            look = "ring" if one.look == "rings" else "dot"
            yield from self._dots([p for run in runs for p in run], look, radius)
            return
        for run in runs:
            if any(sigma for _, _, sigma, _ in run):
                above = [self._place(x, y + s) for x, y, s, _ in run]
                below = [self._place(x, y - s) for x, y, s, _ in reversed(run)]
                yield f'<path class="band" d="M{"L".join(above + below)}Z"/>'
            way = "L".join(self._place(x, y) for x, y, _, _ in run)
            yield f'<path class="line {one.look}" d="M{way}{"h0.1" if len(run) == 1 else ""}"/>'
        every = math.ceil(len(points) / MOST_HOVERS) or 1
        few = len(points) <= 40 and self.plot.kind != "plan" and not one.look
        yield from self._dots(
            [p for run in runs for p in run][::every], "dot" if few else "over", 2.2 if few else 4
        )

    def _placed(self, point: tuple[float, float, float, str]) -> bool:
        return self.x.fits(point[0]) and self.y.fits(point[1])

    def _place(self, x: float, y: float) -> str:
        if self.y.log:
            y = max(y, 10**self.y.low)
        return f"{self.x.at(x):.1f} {self.y.at(y):.1f}"

    def _dots(
        self, points: Sequence[tuple[float, float, float, str]], look: str, radius: float
    ) -> Iterator[str]:
        for x, y, sigma, title in points:
            left, top = self.x.at(x), self.y.at(y)
            if sigma and look == "dot":
                ends = (self._place(x, y - sigma), self._place(x, y + sigma))
                yield f'<path class="whisker" d="M{ends[0]}L{ends[1]}"/>'
            said = title or f"{brief(x)}, {brief(y)}"
            yield f'<circle class="{look}" cx="{left:.1f}" cy="{top:.1f}" r="{radius}">'
            yield f"{_title(said)}</circle>"

    def _steps(self, one: Series) -> Iterator[str]:
        edges, floor = _numbers(one.x), self.height - BOTTOM
        for k, count in enumerate(_numbers(one.y)):
            low, high = edges[k], edges[k + 1]
            if not (self.x.fits(low) and self.x.fits(high) and self.y.fits(count)) or count == 0:
                continue
            left, right, top = self.x.at(low), self.x.at(high), self.y.at(count)
            title = _title(f"{brief(low)} to {brief(high)}: {brief(count)}")
            yield f'<rect class="bar" x="{left:.1f}" y="{top:.1f}" width="{max(right - left, 0.5):.1f}"'
            yield f' height="{max(floor - top, 0):.1f}">{title}</rect>'


class _Bars:
    """Lying bars, so that their names can be read."""

    def __init__(self, plot: Plot) -> None:
        self.plot = plot
        self.left = min(190, 14 + LETTER * max((len(name) for name in plot.ticks), default=4))
        self.rows = max(len(plot.ticks), max((len(one.y) for one in plot.series), default=0), 1)
        self.bottom = TOP + BAR_ROW * self.rows
        values = [0.0, *(y for one in plot.series for y in _numbers(one.y))]
        if plot.log_x:
            values = values[1:]
        if plot.limit is not None:
            values.append(plot.limit)
        self.axis = _Axis(values, plot.log_x, self.left, WIDTH - RIGHT, 0.02)

    def svg(self) -> str:
        height = self.bottom + BOTTOM
        parts = [_head(self.plot, height + _legend_height(self.plot))]
        for value in self.axis.ticks(5):
            x = self.axis.at(value)
            parts.append(f'<path class="grid" d="M{x:.1f} {TOP}V{self.bottom}"/>')
            parts.append(
                f'<text x="{x:.1f}" y="{self.bottom + 12}" text-anchor="middle">{brief(value)}</text>'
            )
        middle = (self.left + WIDTH - RIGHT) / 2
        parts.append(f'<text x="{middle:.0f}" y="{self.bottom + 26}" text-anchor="middle">')
        parts.append(f"{html.escape(self.plot.y_label)}</text>")
        letters = int((self.left - 6) / LETTER)
        for k, name in enumerate(self.plot.ticks):
            short = name if len(name) <= letters else name[: letters - 1] + "…"
            at = TOP + BAR_ROW * (k + 0.5)
            parts.append(f'<text x="{self.left - 4:.0f}" y="{at + 3.5:.1f}" text-anchor="end">')
            parts.append(f"{html.escape(short)}{_title(name)}</text>")
        thick = 0.8 * BAR_ROW / max(1, len(self.plot.series))
        for j, one in enumerate(self.plot.series):
            parts.append(f'<g style="--c:var(--c{_colour(one, j)})">')
            for k, value in enumerate(_numbers(one.y)):
                if self.axis.fits(value):
                    y = TOP + BAR_ROW * (k + 0.1) + j * thick
                    end = self.axis.at(value)
                    said = (
                        f"{self.plot.ticks[k] if k < len(self.plot.ticks) else k}, {one.name}: {brief(value)}"
                    )
                    parts.append(f'<rect class="bar" x="{self.left:.1f}" y="{y:.1f}" height="{thick:.1f}"')
                    parts.append(f' width="{max(0.0, end - self.left):.1f}">{_title(said)}</rect>')
            parts.append("</g>")
        if self.plot.limit is not None and self.axis.fits(self.plot.limit):
            x = self.axis.at(self.plot.limit)
            parts.append(f'<path class="limit" d="M{x:.1f} {TOP}V{self.bottom}"/>')
        return "".join([*parts, _legend(self.plot, height), "</svg>\n"])


def _numbers(values: Sequence[float | None]) -> list[float]:
    """With nan for what is none."""
    return [math.nan if v is None else float(v) for v in values]


def _points(one: Series, kind: Kind) -> list[tuple[float, float, float, str]]:
    """(x, y, sigma, title) of each; 0 and "" where there is none."""
    if kind == "histogram":
        return [(x, y, 0.0, "") for x, y in zip(_numbers(one.x), _numbers(one.y), strict=False)]
    sigmas = _numbers(one.sigma) or [0.0] * len(one.x)
    titles = one.titles or [""] * len(one.x)
    return [
        (x, y, s if math.isfinite(s) else 0.0, t)
        for x, y, s, t in zip(_numbers(one.x), _numbers(one.y), sigmas, titles, strict=True)
    ]


def _colour(one: Series, k: int) -> int:
    return (k if one.colour is None else one.colour) % COLOURS


def _title(text: str) -> str:
    return f"<title>{html.escape(text)}</title>"


def _head(plot: Plot, height: float) -> str:
    name = html.escape(plot.title)
    return (
        f'<svg class="plot" viewBox="0 0 {WIDTH} {height:.0f}" role="img" aria-label="{name}">'
        f'<text class="title" x="{LEFT}" y="14">{name}</text>'
    )


def _legend_rows(plot: Plot) -> list[list[tuple[float, int, str]]]:
    """(left, colour, name) row by row; nothing where one series explains itself."""
    named = {one.name: _colour(one, k) for k, one in reversed(list(enumerate(plot.series))) if one.name}
    if len(named) < 2 and plot.kind != "plan":
        return []
    rows: list[list[tuple[float, int, str]]] = []
    right = math.inf
    for name, colour in reversed(named.items()):
        width = 16 + LETTER * len(name) + 12
        if right + width > WIDTH:
            rows.append([])
            right = LEFT
        rows[-1].append((right, colour, name))
        right += width
    return rows


def _legend_height(plot: Plot) -> int:
    return LEGEND_ROW * len(_legend_rows(plot))


def _legend(plot: Plot, top: float) -> str:
    out = []
    for k, row in enumerate(_legend_rows(plot)):
        y = top + LEGEND_ROW * (k + 0.5)
        for left, colour, name in row:
            out.append(
                f'<rect style="fill:var(--c{colour})" x="{left:.0f}" y="{y - 5:.0f}" width="10" height="10"/>'
            )
            out.append(f'<text x="{left + 14:.0f}" y="{y + 3.5:.1f}">{html.escape(name)}</text>')
    return "".join(out)
