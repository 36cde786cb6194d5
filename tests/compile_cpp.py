"""C++ files compiled as a few: most of the time would go into reading the same headers again."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

STANDARD = ["-std=c++20", "-ffp-contract=off"]
SANITIZED = ["-O1", "-g1", "-fno-omit-frame-pointer", "-D_GLIBCXX_ASSERTIONS",
             "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]  # fmt: skip


def compile_cpp(sources: Sequence[Path], target: Path, flags: Sequence[str], pieces: int = 1) -> Path:
    """Compile and link; skips the test where there is no compiler.

    Parameters
    ----------
    sources
        Of one engine: their file-local names differ.
    pieces
        Compiled at the same time.

    Returns
    -------
    target
        Its folder is made.
    """
    compiler = shutil.which("c++")
    if compiler is None:
        pytest.skip("no C++ compiler: run 'sudo apt-get install g++'")
    target.parent.mkdir(parents=True, exist_ok=True)
    flags = [*STANDARD, *flags]

    def build(piece: int) -> Path:
        together = target.with_name(f"{target.name}_{piece}.cpp")
        together.write_text("".join(f'#include "{source}"\n' for source in sources[piece::pieces]))
        made = together.with_suffix(".o")
        subprocess.run([compiler, *flags, "-c", together, "-o", made], check=True, timeout=900)
        return made

    with ThreadPoolExecutor(pieces) as pool:
        objects = list(pool.map(build, range(pieces)))
    subprocess.run([compiler, *flags, *objects, "-o", target], check=True, timeout=900)
    return target
