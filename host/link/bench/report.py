"""Results of earlier runs on one page, with one table and the worst verdict."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from host.errors import UsageError
from host.link.bench.page import page
from host.link.bench.result import Cell, Result, read_result
from host.link.bench.verdict import Finding, Verdict
from host.record.atomic import check_writable, write_whole


@dataclass(frozen=True)
class ReportOptions:
    """Put results written with --json on one page, and say the worst of them."""

    results: Positional[Annotated[tuple[Path, ...], arg(metavar="RESULT.json ...")]]  # written with --json
    html: Path | None = None  # write the page to this file
    json: Path | None = None  # write the table and verdict to this file

    def __post_init__(self) -> None:
        if not self.results:
            raise UsageError("no results to report: name files written with --json")


def run(options: ReportOptions) -> Result:
    """The page, and what it says in short."""
    results = [read_result(path) for path in options.results]
    if options.html is not None:
        check_writable(options.html, folder=False)
        write_whole(options.html, page(results))
    findings = [Finding(f.grade, f"{one.command}: {f.text}") for one in results for f in one.verdict.findings]
    worst = Verdict(tuple(sorted(findings, key=lambda finding: -finding.grade)))
    rows: list[list[Cell]] = [
        [one.command, one.robot, one.when, one.verdict.grade.name.lower()] for one in results
    ]
    files = [str(path) for path in options.results]
    return Result(
        "report",
        f"{len(results)} results",
        {"files": files},
        ["command", "robot", "when", "grade"],
        rows,
        worst,
    )
