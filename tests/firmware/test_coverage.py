"""How many branches of the firmware's logic its C specifications take, by gcov."""

from __future__ import annotations

import gzip
import json
import shutil
import subprocess
from collections import defaultdict
from pathlib import Path

import pytest
from test_c_suites import FIRMWARE, HELPERS, HERE, SUITES

LEAST = 0.95  # of the branches of every file
FLAGS = ["-std=gnu11", "-O0", "-g", f"-I{FIRMWARE}", f"-I{HERE}"]


def _run(*command: str | Path, cwd: Path) -> None:
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True)
    if done.returncode:
        pytest.fail(f"{command[0]} says:\n{done.stdout[-2000:]}{done.stderr[-2000:]}", pytrace=False)


def _taken(folder: Path) -> dict[str, dict[tuple[int, int], bool]]:
    """Of every branch, by file, line and its number there: was it taken by anybody?"""
    taken: dict[str, dict[tuple[int, int], bool]] = defaultdict(dict)
    for report in sorted(folder.glob("*.gcov.json.gz")):
        for file in json.loads(gzip.decompress(report.read_bytes()))["files"]:
            name = Path(file["file"]).name
            for line in file["lines"]:
                for number, branch in enumerate(line["branches"]):
                    key = (line["line_number"], number)
                    taken[name][key] = taken[name].get(key, False) or branch["count"] > 0
    return taken


def test_the_c_specifications_take_at_least_95_percent_of_every_files_branches(
    tmp_path: Path, cmocka: None
) -> None:
    if shutil.which("gcc") is None or shutil.which("gcov") is None:
        pytest.skip("gcov comes with gcc: sudo apt-get install gcc")
    logic = sorted(FIRMWARE.glob("*.c"))
    objects = []
    for source in [*logic, *HELPERS]:
        objects.append(tmp_path / f"{source.stem}.o")
        counted = ["--coverage"] if source in logic else []
        _run("gcc", *FLAGS, *counted, "-c", source, "-o", objects[-1], cwd=tmp_path)
    for suite in SUITES:
        program = tmp_path / suite.stem
        _run("gcc", *FLAGS, suite, *objects, "--coverage", "-lcmocka", "-lm", "-o", program, cwd=tmp_path)
        _run(program, cwd=tmp_path)
    _run("gcov", "--branch-probabilities", "--json-format", *(tmp_path / f"{s.stem}.gcda" for s in logic),
         cwd=tmp_path)  # fmt: skip

    taken = _taken(tmp_path)
    too_few = []
    for source in logic:
        branches = taken[source.name]
        share = sum(branches.values()) / len(branches)
        print(f"{source.name:14} {100 * share:5.1f} % of {len(branches):4} branches")
        if share < LEAST:
            lines = sorted({line for (line, _), was in branches.items() if not was})
            too_few.append(f"{source.name}: {100 * share:.1f} %, not taken in lines {lines}")
    assert not too_few
