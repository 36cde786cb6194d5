"""The ATmega's program: two builds give one hex, and its build id names what it was made of."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
RunPio = Callable[..., "subprocess.CompletedProcess[str]"]


def test_platformio_and_the_plain_build_give_the_same_hex(built: Path, pio: RunPio, tmp_path: Path) -> None:
    done = pio(tmp_path, "run", "-d", ROOT / "firmware")
    assert done.returncode == 0, done.stdout + done.stderr
    for name in ("uno", "nano"):
        from_pio = (tmp_path / f"build/{name}/firmware.hex").read_bytes()
        assert from_pio == (built / f"{name}.hex").read_bytes()


def test_platformio_understands_every_line_of_its_description(pio: RunPio, tmp_path: Path) -> None:
    done = pio(tmp_path, "project", "config", "-d", ROOT / "firmware", "--lint", "--json-output")
    assert ast.literal_eval(done.stdout) == {"errors": [], "warnings": []}


def test_the_build_id_follows_the_sources(tmp_path: Path) -> None:
    def told(folder: Path) -> str:
        return subprocess.run(
            [sys.executable, folder / "build_id.py"], capture_output=True, text=True, check=True
        ).stdout

    (tmp_path / "src").mkdir()
    (tmp_path / "build_id.py").write_bytes((ROOT / "firmware/build_id.py").read_bytes())
    (tmp_path / "platformio.ini").write_text("[env:uno]\n")
    (tmp_path / "src/a.c").write_text("int a;\n")
    before = told(tmp_path)
    assert told(tmp_path) == before
    (tmp_path / "src/a.c").write_text("int b;\n")
    assert told(tmp_path) != before
