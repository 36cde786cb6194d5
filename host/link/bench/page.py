"""Results as one HTML page that stands alone, made to be read on a phone."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any

from host.link.bench.result import Result
from host.link.bench.terminal import cell_text
from host.link.bench.verdict import Grade
from host.view import html_page
from host.view.plot import draw


def page(results: Sequence[Result], title: str = "Robot link bench") -> bytes:
    """The page."""
    worst = max((result.verdict.grade for result in results), default=Grade.HEALTHY)
    summary = "Healthy." if worst == Grade.HEALTHY else f"Worst finding: {worst.name.lower()}."
    head = ""
    if len(results) > 1:
        head = f'<p class="about">{len(results)} measurements. {summary}</p>\n'
    return html_page.page(title, head + "".join(map(_section, results)))


def _section(result: Result) -> str:
    settings = ", ".join(f"{name} {_setting(value)}" for name, value in result.settings.items())
    about = f"{result.robot} · {result.when}" + (f" · {settings}" if settings else "")
    grade = result.verdict.grade.name.lower()
    plots = "".join(f"<figure>{draw(plot)}</figure>\n" for plot in result.plots)
    return (
        f"<h2>{html.escape(result.command)}</h2>\n"
        f'<p class="about">{html.escape(about)}</p>\n'
        f'<div class="verdict {grade}">{html.escape(result.verdict.text)}</div>\n'
        + html_page.table(result.columns, [[cell_text(cell) for cell in row] for row in result.rows])
        + (f'<div class="plots">{plots}</div>\n' if plots else "")
    )


def _setting(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
