"""The ATmega's program: two builds give one hex, it fits, and it holds nothing that takes long."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools"))
import firmware_budget  # noqa: E402

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


def test_the_program_is_within_its_budget(built: Path) -> None:
    flash, ram = firmware_budget.sizes(built / "uno.elf")
    assert 2048 < flash <= firmware_budget.FLASH_MAX
    assert 256 < ram <= firmware_budget.RAM_MAX


def test_the_program_holds_no_floating_point_no_64_bit_division_and_no_heap(built: Path) -> None:
    done = subprocess.run(["avr-nm", built / "uno.elf"], capture_output=True, text=True, check=True)
    names = {line.split()[-1] for line in done.stdout.splitlines()}
    assert "main" in names
    slow = {f"__{op}{kind}3" for op in ("add", "sub", "mul", "div") for kind in ("sf", "df")}
    slow |= {"__fixsfsi", "__floatsisf", "__divdi3", "__udivdi3", "__moddi3", "__umoddi3", "__udivmod64"}
    assert not names & (slow | {"malloc", "free"})


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
