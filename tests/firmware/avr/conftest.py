"""The AVR compiler, PlatformIO and simulator, and what they build, for the tests that need them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from host.sim.avr.board import AvrBoard

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools"))
import build_firmware  # noqa: E402
import build_rig  # noqa: E402


def _missing() -> list[str]:
    """Names of the tools that are not here."""
    programs = [name for name in ("avr-gcc", "avrdude") if shutil.which(name) is None]
    files = {
        "avr-libc": Path("/usr/lib/avr/include/avr/io.h"),
        "libsimavr-dev": Path("/usr/include/simavr/sim_avr.h"),
        "libelf-dev": Path("/usr/include/libelf.h"),
        "PlatformIO": ROOT / "build/pio-venv/bin/pio",
    }
    return programs + [name for name, path in files.items() if not path.exists()]


@pytest.fixture(scope="session")
def avr_tools() -> None:
    """Skips where the tools are missing; in CI fetches them, and fails if that fails."""
    missing = _missing()
    if not missing:
        return
    if os.environ.get("CI", "").lower() not in ("1", "true"):
        pytest.skip(f"not on this machine: {', '.join(missing)}; run tools/setup_avr")
    done = subprocess.run([ROOT / "tools/setup_avr"], capture_output=True, text=True)
    if done.returncode or _missing():
        pytest.fail(f"tools/setup_avr failed: {done.stdout}{done.stderr}", pytrace=False)


@pytest.fixture(scope="session")
def built(avr_tools: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with uno.elf, nano.elf, their hex files and librig.so."""
    folder = tmp_path_factory.mktemp("avr")
    for name, options in build_firmware.environments().items():
        build_firmware.build(name, options, folder)
    build_rig.build(folder / "librig.so")
    return folder


@pytest.fixture
def make_board(built: Path) -> Callable[..., AvrBoard]:
    """Makes boards; arguments as AvrBoard's."""

    def make(seed: int = 0, eeprom: bytes = b"", elf: Path = built / "uno.elf") -> AvrBoard:
        return AvrBoard(seed, eeprom, elf=elf, library=built / "librig.so")

    return make
