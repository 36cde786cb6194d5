"""The findings as a table for a person, plain where the libraries are missing, and as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from host.doctor.finding import Finding, Outcome, exit_code
from host.record.atomic import write_whole

STYLES = {Outcome.OK: "green", Outcome.WARN: "yellow", Outcome.FAIL: "bold red", Outcome.UNTRIED: "dim"}


def as_dict(findings: Sequence[Finding]) -> dict[str, Any]:
    """For the JSON file, which may go into a report of a fault."""
    try:
        from host.record.versions import versions

        made_with = versions()
    except ImportError:  # which is among the findings
        made_with = {}
    checks = [
        {"part": f.part, "name": f.name, "outcome": f.outcome.value, "told": f.told, "fix": f.fix or None}
        for f in findings
    ]
    return {"exit_code": exit_code(findings), "versions": made_with, "checks": checks}


def write_json(findings: Sequence[Finding], path: Path) -> None:
    """As JSON, whole or not at all."""
    write_whole(path, (json.dumps(as_dict(findings), indent=1) + "\n").encode())


def summary(findings: Sequence[Finding]) -> str:
    """All of it in one line."""
    count = {outcome: sum(f.outcome == outcome for f in findings) for outcome in Outcome}
    if count[Outcome.FAIL]:
        said = f"{count[Outcome.FAIL]} of {len(findings)} checks failed: begin with the uppermost"
    elif count[Outcome.WARN]:
        plural = "" if count[Outcome.WARN] == 1 else "s"
        said = f"ready, with {count[Outcome.WARN]} warning{plural}"
    else:
        said = "all is well"
    return said + (f"; {count[Outcome.UNTRIED]} not tried" if count[Outcome.UNTRIED] else "")


def show(findings: Sequence[Finding]) -> None:
    """Table and summary on stdout."""
    if find_spec("rich") is None:
        for f in findings:
            print(f"{f.outcome:9} {f.part}, {f.name}: {f.told}" + (f"\n{'':9} -> {f.fix}" if f.fix else ""))
        print(summary(findings))
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console()
    if not console.is_terminal:
        console.width = 120
    table = Table(title="doctor", title_justify="left")
    for name in ("part", "check", ""):
        table.add_column(name, no_wrap=True)
    table.add_column("found", overflow="fold")
    last = ""
    for f in findings:
        if last and f.part != last:
            table.add_section()
        told = Text(f.told)
        if f.fix:
            told.append(f"\n→ {f.fix}", style="bold" if f.outcome == Outcome.FAIL else "")
        table.add_row(
            f.part if f.part != last else "", f.name, Text(f.outcome, style=STYLES[f.outcome]), told
        )
        last = f.part
    console.print(table)
    console.print(summary(findings), highlight=False, markup=False, soft_wrap=True)
