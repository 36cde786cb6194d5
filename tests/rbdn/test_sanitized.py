"""The engine under AddressSanitizer and UBSan, on scenes that no photographer would take."""

from __future__ import annotations

import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CORE = ROOT / "host" / "rbdn" / "core"
FLAGS = ["-std=c++20", "-O1", "-g", "-fno-omit-frame-pointer", "-fsanitize=address,undefined",
         "-fno-sanitize-recover=all", "-D_GLIBCXX_ASSERTIONS", "-ffp-contract=off", f"-I{CORE}"]  # fmt: skip


@pytest.fixture(scope="module")
def fuzz_core(tmp_path_factory: pytest.TempPathFactory) -> Path:
    compiler = shutil.which("c++")
    if compiler is None:
        pytest.skip("no C++ compiler: run 'sudo apt-get install g++'")
    out = tmp_path_factory.mktemp("fuzz")
    sources = [p for p in sorted(CORE.glob("*.cpp")) if p.name != "bindings.cpp"]
    sources.append(Path(__file__).with_name("fuzz_core.cpp"))

    def build(source: Path) -> Path:
        target = out / (source.stem + ".o")
        subprocess.run([compiler, *FLAGS, "-c", str(source), "-o", str(target)], check=True)
        return target

    with ThreadPoolExecutor(2) as pool:
        objects = [str(o) for o in pool.map(build, sources)]
    program = out / "fuzz_core"
    subprocess.run([compiler, "-fsanitize=address,undefined", *objects, "-o", str(program)], check=True)
    return program


def test_random_scenes_never_tear_the_net_nor_touch_foreign_memory(fuzz_core: Path):
    run = subprocess.run([str(fuzz_core), "60", "12", "1"], capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr[-2000:]
    assert "60 sequences of 12 frames: sound" in run.stdout
