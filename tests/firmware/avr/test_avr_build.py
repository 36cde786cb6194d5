"""The ATmega's program: two builds give one hex, it fits, and it holds nothing that takes long."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools"))
sys.path.insert(0, str(ROOT / "tools/pio_offline"))
import firmware_budget  # noqa: E402
import make_core  # noqa: E402


def test_platformio_and_the_plain_build_give_the_same_hex(built: Path, tmp_path: Path) -> None:
    environment = os.environ | {
        "PLATFORMIO_CORE_DIR": str(make_core.make_core(tmp_path / "core")),
        "PLATFORMIO_WORKSPACE_DIR": str(tmp_path / "pio"),
        "PLATFORMIO_SETTING_ENABLE_TELEMETRY": "no",
        "PLATFORMIO_SETTING_CHECK_PLATFORMIO_INTERVAL": "100000",
    }
    command = [ROOT / "build/pio-venv/bin/pio", "run", "-d", ROOT / "firmware"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    for name in ("uno", "nano"):
        from_pio = (tmp_path / f"pio/build/{name}/firmware.hex").read_bytes()
        assert from_pio == (built / f"{name}.hex").read_bytes()


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
