"""The engine built into a small program of its own, with whatever compiler flags a test wants."""

from __future__ import annotations

import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

CORE = Path(__file__).resolve().parents[2] / "host" / "rbdn" / "core"
COMMON_FLAGS = ["-std=c++20", "-ffp-contract=off", f"-I{CORE}"]


def compile_core(main: Path, flags: list[str], folder: Path) -> Path:
    """Compile the engine with a C++ file that holds main(); skips the test where there is no compiler.

    Returns
    -------
    program
        In `folder`, which is made.
    """
    compiler = shutil.which("c++")
    if compiler is None:
        pytest.skip("no C++ compiler: run 'sudo apt-get install g++'")
    folder.mkdir(parents=True, exist_ok=True)

    def build(source: Path) -> str:
        target = folder / (source.stem + ".o")
        subprocess.run(
            [compiler, *COMMON_FLAGS, *flags, "-c", str(source), "-o", str(target)], check=True, timeout=600
        )
        return str(target)

    sources = [p for p in sorted(CORE.glob("*.cpp")) if p.name != "bindings.cpp"]
    with ThreadPoolExecutor(2) as pool:
        objects = list(pool.map(build, [*sources, main]))
    program = folder / main.stem
    subprocess.run([compiler, *flags, *objects, "-o", str(program)], check=True, timeout=600)
    return program
