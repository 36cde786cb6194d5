"""Two drives side by side: what differs, which is better, and one page with both.

    python -m host.compare runs/20261123-101500 runs/latest
    python -m host.compare before.json after.json --html both.html

Each is a run's folder or its result.json.
"""

from __future__ import annotations

from host.errors import EXIT_DONE, InputError, UsageError, begin_command, run_command

if __name__ == "__main__":
    begin_command()

import html
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional, arg

from host.config import read_options
from host.view.figures import FIGURES, REACHED, Figure, outcome_text

MARKS = {1: "better", -1: "worse", 0: ""}
NEEDED = {"outcome": str, "reason": str, "camera": str, "robot": str, "task": str, "duration_s": int | float}


@dataclass(frozen=True)
class Options:
    """Set two drives side by side: a table here, and a page with the ways, depths and times of both."""

    first: Positional[Annotated[Path, arg(metavar="A")]]  # a run's folder, or its result.json
    second: Positional[Annotated[Path, arg(metavar="B")]]  # and what is compared with it
    html: Path = Path("runs/compare.html")  # where the page goes


@dataclass(frozen=True)
class Run:
    """One of the two."""

    name: str
    result: dict[str, Any]


def read_run(path: Path) -> Run:
    """A run from its folder or result.json.

    Raises
    ------
    InputError
        It cannot be read, or is no result of a drive.
    """
    file = _file_of(path)
    try:
        result = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror}); name a folder in runs/") from None
    except (ValueError, RecursionError):
        raise InputError(f"{file}: is no JSON; name a run's folder or its result.json") from None
    lacks = [
        key
        for key, kind in NEEDED.items()
        if not isinstance(result, dict) or not isinstance(result.get(key), kind)
    ]
    if lacks:
        raise InputError(
            f"{file}: is no result of a drive, it has no {lacks[0]}; name a run's folder or its result.json"
        )
    return Run(path.resolve().name if path.is_dir() else path.name, result)


def _file_of(path: Path) -> Path:
    return path / "result.json" if path.is_dir() else path


def notes(first: dict[str, Any], second: dict[str, Any]) -> list[str]:
    """What else differs, so that figures may not be comparable."""
    said = []
    worlds = first["camera"], second["camera"]
    if worlds[0] != worlds[1]:
        said.append(
            f"Different worlds: {worlds[0]} and {worlds[1]}. Better and worse say little about the robot."
        )
    for name, key in (("robots", "robot"), ("tasks", "task")):
        if first[key] != second[key]:
            said.append(f"Different {name}: {first[key]} and {second[key]}.")
    settings = [
        {name: one["value"] for name, one in (run.get("settings") or {}).items()} for run in (first, second)
    ]
    changed = sorted(
        name for name in {**settings[0], **settings[1]} if settings[0].get(name) != settings[1].get(name)
    )
    if changed:
        said.append(f"Different settings: {', '.join(changed)}.")
    versions = [run.get("versions") or {} for run in (first, second)]
    changed = [name for name in versions[0] if versions[0][name] != versions[1].get(name, versions[0][name])]
    if changed:
        said.append(f"Different versions: {', '.join(changed)}.")
    return said


def rows(first: dict[str, Any], second: dict[str, Any]) -> list[tuple[str, str, str, str]]:
    """(name, first, second, whether the second is better or worse) of all that is known of either."""
    reached = [run["outcome"] in REACHED for run in (first, second)]
    out = [("outcome", first["outcome"], second["outcome"], MARKS[reached[1] - reached[0]])]
    for figure in FIGURES:
        values = figure.of(first), figure.of(second)
        if values != (None, None):
            out.append((_starred(figure), *map(figure.text, values), MARKS[figure.compare(*values)]))
    return out


def _starred(figure: Figure) -> str:
    return f"{figure.name} *" if figure.truth else figure.name


def page(first: Run, second: Run) -> bytes:
    """Both on one page."""
    from host.view import html_page
    from host.view.drive_plots import TRUTH, depth_plot, error_plot, time_plot, way_plot
    from host.view.report import figure

    runs = first, second
    heads = "".join(
        f"<p><b>{html.escape(letter)}: {html.escape(run.name)}</b><br>"
        f"{html.escape(outcome_text(run.result))}<br>"
        f'<span class="about">{html.escape(run.result["camera"] + " · " + run.result["task"])}</span></p>\n'
        for letter, run in zip("AB", runs, strict=True)
    )
    said = notes(first.result, second.result)
    note = f'<div class="verdict note">{"<br>".join(map(html.escape, said))}</div>\n' if said else ""
    table = html_page.table(("", "A", "B", "B is"), rows(first.result, second.result))
    for mark in ("better", "worse"):
        table = table.replace(f"<td>{mark}</td>", f'<td class="{mark}">{mark}</td>')
    plots = ""
    for make in (way_plot, depth_plot, error_plot, time_plot):
        both = [make(run.result) for run in runs]
        if any(plot is not None for plot in both):
            plots += "".join(
                "<p>Not known.</p>\n" if plot is None else figure(plot, f"{letter}: {run.name}")
                for letter, run, plot in zip("AB", runs, both, strict=True)
            )
    body = f'<div class="plots">{heads}</div>\n{note}{table}<p class="about">* {TRUTH}</p>\n'
    return html_page.page(
        f"{first.name} and {second.name}", f'{body}<div class="plots pairs">\n{plots}</div>\n'
    )


def main() -> int:
    """The command."""
    options = read_options(Options)
    from host.record.atomic import check_writable, write_whole

    check_writable(options.html, folder=False)
    runs = read_run(options.first), read_run(options.second)
    for path in (options.first, options.second):
        if options.html.resolve() == _file_of(path).resolve():
            raise UsageError(f"--html {options.html}: is one of the two results; name another file")
    try:
        both = page(*runs)
        show(*runs)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{options.first} or {options.second}: is damaged, or was written by another version "
            f"({type(error).__name__}: {error}); name runs that this program made"
        ) from None
    write_whole(options.html, both)
    print(f"page: {options.html}")
    return EXIT_DONE


def show(first: Run, second: Run) -> None:
    """The table on stdout."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console()
    for note in notes(first.result, second.result):
        console.print(Text(f"Note: {note}", style="yellow"))
    table = Table()
    for k, name in enumerate(("", f"A: {first.name}", f"B: {second.name}", "B is")):
        table.add_column(Text(name), justify="right" if k in (1, 2) else "left", overflow="fold")
    colours = {"better": "green", "worse": "red"}
    for *cells, mark in rows(first.result, second.result):
        table.add_row(*map(Text, cells), Text(mark, style=colours.get(mark, "")))
    console.print(table)
    console.print("* truth of the simulator")


if __name__ == "__main__":
    run_command(main)
