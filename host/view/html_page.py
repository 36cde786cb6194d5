"""Pages that stand alone in one file: light or dark as the reader likes it, made to be read on a phone."""

from __future__ import annotations

import html
from collections.abc import Sequence

from host.view.plot import STYLE as PLOT_STYLE

STYLE = (
    PLOT_STYLE
    + """
body { font: 16px/1.45 system-ui, sans-serif; margin: 0 auto; max-width: 68rem; padding: 0 0.9rem 3rem;
  color: var(--ink); background: var(--back); }
h1 { font-size: 1.4rem; } h2 { font-size: 1.15rem; margin: 2.2rem 0 0.5rem; }
.about { color: var(--muted); font-size: 0.85rem; overflow-wrap: anywhere; margin: 0.2rem 0 0.8rem; }
.verdict { border-left: 0.4rem solid; padding: 0.5rem 0.8rem; border-radius: 0.2rem; margin: 0.6rem 0; }
.healthy { border-color: #3c8f57; background: #3c8f571c; }
.note { border-color: #7a8fa6; background: #7a8fa61c; }
.faulty { border-color: #d18b1f; background: #d18b1f22; }
.unsafe { border-color: #c5403e; background: #c5403e22; }
.better { color: var(--c2); } .worse { color: var(--limit); }
.scroll { overflow-x: auto; } table { border-collapse: collapse; font-size: 0.88rem; width: 100%; }
th, td { padding: 0.3rem 0.6rem; border-bottom: 1px solid var(--grid); text-align: right;
  white-space: nowrap; }
th:first-child, td:first-child, .words td, .words th { text-align: left; white-space: normal;
  overflow-wrap: anywhere; }
th { font-weight: 600; color: var(--muted); vertical-align: top; }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(22rem, 100%), 1fr)); gap: 1rem; }
.pairs { grid-template-columns: repeat(auto-fit, minmax(min(26rem, 100%), 1fr)); }
.plots > * { min-width: 0; margin: 0; } .plots img { width: 100%; height: auto; border-radius: 0.2rem; }
figcaption { font-size: 0.85rem; color: var(--muted); }
"""
)


def page(title: str, body: str) -> bytes:
    """The whole file, from a title as plain text and a body of HTML."""
    name = html.escape(title)
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f"<title>{name}</title><style>{STYLE}</style></head><body>\n<h1>{name}</h1>\n{body}</body></html>\n"
    ).encode(errors="replace")


def table(columns: Sequence[str], rows: Sequence[Sequence[str]], kind: str = "") -> str:
    """A table of plain texts; without a heading where there are no columns."""
    heading = "".join(f"<th>{html.escape(name)}</th>" for name in columns)
    heading = f"<tr>{heading}</tr>\n" if heading else ""
    lines = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>\n" for row in rows
    )
    return f'<div class="scroll"><table class="{kind}">{heading}{lines}</table></div>\n'
