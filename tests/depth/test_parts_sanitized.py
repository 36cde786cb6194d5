"""The parts of the depth engine under AddressSanitizer and UBSan, on random runs of odd regions."""

from __future__ import annotations

import subprocess
from pathlib import Path

from compile_cpp import SANITIZED
from parts import HERE, compile_parts

RUNS = 100


def test_no_run_of_odd_regions_oversteps_a_bound_or_gives_an_impossible_answer(tmp_path: Path):
    program = compile_parts(HERE / "parts_fuzz.cpp", tmp_path / "parts_fuzz", SANITIZED)
    done = subprocess.run([str(program), str(RUNS)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-3000:]
    answers = int(done.stdout.split()[0])
    assert answers > RUNS


def test_answers_do_not_depend_on_optimisation(tmp_path: Path):
    said = []
    for level in ("-O0", "-O3"):
        program = compile_parts(HERE / "parts_fuzz.cpp", tmp_path / f"parts{level}", [level])
        said.append(
            subprocess.run(
                [str(program), "20"], capture_output=True, text=True, check=True, timeout=300
            ).stdout
        )
    assert said[0] == said[1]
