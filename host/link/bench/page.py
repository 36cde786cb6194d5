"""Results as one HTML page that stands alone, made to be read on a phone."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

from host.errors import UsageError
from host.link.bench.result import Result
from host.link.bench.terminal import cell_text
from host.link.bench.verdict import Grade

STYLE = """
body { font: 16px/1.45 system-ui, sans-serif; margin: 0 auto; max-width: 46rem; padding: 0 0.9rem 3rem;
  color: #222; background: #fff; }
h1 { font-size: 1.4rem; } h2 { font-size: 1.15rem; margin: 2.2rem 0 0.3rem; }
.about { color: #666; font-size: 0.85rem; overflow-wrap: anywhere; margin: 0.2rem 0 0.8rem; }
.verdict { border-left: 0.4rem solid; padding: 0.5rem 0.8rem; border-radius: 0.2rem; margin: 0.6rem 0; }
.healthy { border-color: #3c8f57; background: #eaf5ee; }
.note { border-color: #7a8fa6; background: #eef2f6; }
.faulty { border-color: #d18b1f; background: #fdf3e1; }
.unsafe { border-color: #b5302e; background: #fbe7e6; }
.scroll { overflow-x: auto; } table { border-collapse: collapse; font-size: 0.88rem; width: 100%; }
th, td { padding: 0.3rem 0.6rem; border-bottom: 1px solid #e4e4e4; text-align: right; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; white-space: normal; }
th { font-weight: 600; color: #444; } img { width: 100%; height: auto; margin-top: 0.8rem; }
"""


def check_plots() -> None:
    """UsageError where the library that draws is missing; to be called before any work is done."""
    if find_spec("matplotlib") is None:
        raise UsageError("matplotlib not found, which draws the plots: .venv/bin/pip install -e '.[plots]'")


def page(results: Sequence[Result], title: str = "Robot link bench") -> bytes:
    """The page."""
    check_plots()
    worst = max((result.verdict.grade for result in results), default=Grade.HEALTHY)
    summary = "Healthy." if worst == Grade.HEALTHY else f"Worst finding: {worst.name.lower()}."
    head = (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{STYLE}</style></head><body>\n"
        f"<h1>{html.escape(title)}</h1>\n"
    )
    if len(results) > 1:
        head += f'<p class="about">{len(results)} measurements. {summary}</p>\n'
    return (head + "".join(map(_section, results)) + "</body></html>\n").encode()


def _section(result: Result) -> str:
    from host.link.bench.plots import draw

    settings = ", ".join(f"{name} {_setting(value)}" for name, value in result.settings.items())
    about = f"{result.robot} · {result.when}" + (f" · {settings}" if settings else "")
    grade = result.verdict.grade.name.lower()
    parts = [
        f"<h2>{html.escape(result.command)}</h2>\n",
        f'<p class="about">{html.escape(about)}</p>\n',
        f'<div class="verdict {grade}">{html.escape(result.verdict.text)}</div>\n',
        _table(result),
    ]
    for plot in result.plots:
        picture = base64.b64encode(draw(plot)).decode()
        parts.append(f'<img alt="{html.escape(plot.title)}" src="data:image/svg+xml;base64,{picture}">\n')
    return "".join(parts)


def _setting(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def _table(result: Result) -> str:
    heading = "".join(f"<th>{html.escape(name)}</th>" for name in result.columns)
    rows = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell_text(cell))}</td>" for cell in row) + "</tr>\n"
        for row in result.rows
    )
    return f'<div class="scroll"><table><tr>{heading}</tr>\n{rows}</table></div>\n'
