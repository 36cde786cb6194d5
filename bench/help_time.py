"""How long every command takes to answer --help.

    python -m bench.help_time [--rounds N] [--only TEXT] [--json FILE]

Commands are the modules of host/ and bench/ that call run_command when they are run, and their subcommands.
Processor time of the whole process, median of several runs, and the shortest time by the clock.
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from bench.figures_file import check_json, write_json
from bench.options import at_least
from host.config import read_options
from host.errors import UsageError, run_command

ROOT = Path(__file__).resolve().parent.parent
WANTED_S = 0.5
IS_COMMAND = re.compile(r'^if __name__ == "__main__":\n( {4}.*\n)*?    run_command\(', re.MULTILINE)


@dataclass(frozen=True)
class Options:
    """Time what every command takes to answer --help."""

    rounds: int = 5  # runs of each command
    only: str = ""  # commands whose name holds this text
    json: Path | None = None  # also write the figures to this file


@dataclass(frozen=True)
class Time:
    """What one command took."""

    command: str
    processor_s: float  # median
    clock_s: float  # shortest


def commands(root: Path = ROOT) -> list[str]:
    """All of them, as ``host.link.bench echo``."""
    found = []
    for path in sorted([*root.glob("host/**/*.py"), *root.glob("bench/**/*.py")]):
        text = path.read_text(encoding="utf-8")
        if IS_COMMAND.search(text):
            name = ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__main__")
            found += [name, *(f"{name} {one}" for one in _subcommands(text))]
    return found


def _subcommands(text: str) -> list[str]:
    for node in ast.parse(text).body:
        if isinstance(node, ast.Assign) and [getattr(t, "id", "") for t in node.targets] == ["COMMANDS"]:
            return list(ast.literal_eval(node.value))
    return []


def time_help(command: str, rounds: int) -> Time:
    """Run it so often; UsageError where --help fails."""
    processor_s, clock_s = [], []
    for _ in range(rounds):
        before, began_s = os.times(), time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-m", *command.split(), "--help"], cwd=ROOT, capture_output=True, text=True
        )
        after = os.times()
        clock_s.append(time.perf_counter() - began_s)
        processor_s.append(
            after.children_user + after.children_system - before.children_user - before.children_system
        )
        if done.returncode != 0 or done.stderr or not done.stdout.strip():
            raise UsageError(f"{command} --help does not answer: {done.stderr.strip()[-200:]}")
    return Time(command, median(processor_s), min(clock_s))


def main() -> None:
    """Measure and print the table."""
    from rich.console import Console
    from rich.table import Table

    options = read_options(Options)
    at_least("rounds", options.rounds, 1)
    check_json(options.json)
    chosen = [command for command in commands() if options.only in command]
    if not chosen:
        raise UsageError(f"--only {options.only}: no command is called so; leave it out to see them all")
    table = Table(title="seconds until --help is answered", title_justify="left")
    table.add_column("python -m")
    table.add_column("processor", justify="right")
    table.add_column("clock", justify="right")
    times, silent = [], []
    for command in chosen:
        try:
            times.append(time_help(command, options.rounds))
        except UsageError as error:
            silent.append(str(error))
            continue
        late = times[-1].processor_s > WANTED_S
        table.add_row(
            command,
            f"{times[-1].processor_s:.2f}",
            f"{times[-1].clock_s:.2f}",
            style="bold" if late else None,
        )
    Console().print(table)
    slow = sum(one.processor_s > WANTED_S for one in times)
    print(f"{slow} of {len(times)} take more than {WANTED_S:g} s of processor time")
    write_json(options.json, {one.command: vars(one) for one in times})
    if silent:
        raise UsageError("; ".join(silent))


if __name__ == "__main__":
    run_command(main)
