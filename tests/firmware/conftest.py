"""What the firmware's tests share: its parts in C, tools and what they build, boards of both kinds."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from board_bench import MakeBoard
from firmware_in_c import FirmwareInC

from host.sim.avr.board import AvrBoard
from host.sim.board import Board

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
import build_firmware  # noqa: E402
import build_rig  # noqa: E402

sys.path.insert(0, str(ROOT / "tools/pio_offline"))
import make_core  # noqa: E402

RunPio = Callable[..., "subprocess.CompletedProcess[str]"]


BUILDING = {
    "avr-gcc": Path("/usr/bin/avr-gcc"),
    "avr-libc": Path("/usr/lib/avr/include/avr/io.h"),
    "libsimavr-dev": Path("/usr/include/simavr/sim_avr.h"),
    "libelf-dev": Path("/usr/include/libelf.h"),
    "PlatformIO": ROOT / "build/pio-venv/bin/pio",
}
CHECKING = {
    "cppcheck": Path("/usr/bin/cppcheck"),
    "clang-tidy": Path("/usr/bin/clang-tidy"),
    "cmocka": Path("/usr/include/cmocka.h"),
}
UPLOADING = {
    "avrdude": Path("/usr/bin/avrdude"),
    "Arduino's bootloaders": ROOT / "build/bootloaders/uno.hex",
}


def _need(wanted: dict[str, Path]) -> None:
    """Skips where tools are missing; in CI fetches them, and fails if that fails."""

    def missing() -> list[str]:
        return [name for name, path in wanted.items() if not path.exists() and not shutil.which(path.name)]

    if not missing():
        return
    if os.environ.get("CI", "").lower() not in ("1", "true"):
        pytest.skip(f"not on this machine: {', '.join(missing())}; run tools/setup_avr")
    done = subprocess.run([ROOT / "tools/setup_avr"], capture_output=True, text=True)
    if done.returncode or missing():
        pytest.fail(f"tools/setup_avr failed: {done.stdout}{done.stderr}", pytrace=False)


@pytest.fixture(scope="session")
def firmware(tmp_path_factory: pytest.TempPathFactory) -> FirmwareInC:
    """The firmware's parts, compiled once."""
    return FirmwareInC(tmp_path_factory.mktemp("firmware_in_c"))


@pytest.fixture(scope="session")
def cmocka() -> None:
    """Skips where the C test framework is missing, except in CI, where that is a failure."""
    headers = ("stdarg", "stddef", "stdint", "setjmp", "cmocka")
    program = "".join(f"#include <{header}.h>\n" for header in headers)
    look = [os.environ.get("CC", "cc"), "-E", "-x", "c", "-", "-o", os.devnull]
    if subprocess.run(look, input=program, capture_output=True, text=True).returncode:
        why = "the C test framework cmocka is missing: sudo apt-get install libcmocka-dev"
        if os.environ.get("CI", "").lower() in ("1", "true"):
            pytest.fail(why, pytrace=False)
        pytest.skip(why)


@pytest.fixture(scope="session")
def avr_tools() -> None:
    """What building and simulating needs."""
    _need(BUILDING)


@pytest.fixture(scope="session")
def checking_tools(avr_tools: None) -> None:
    """What static analysis needs, and the C specifications."""
    _need(CHECKING)


@pytest.fixture(scope="session")
def uploading_tools(avr_tools: None) -> None:
    """What an upload needs, and what it is tested on."""
    _need(UPLOADING)


@pytest.fixture(scope="session")
def built(avr_tools: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with uno.elf, nano.elf, their hex files and librig.so."""
    folder = tmp_path_factory.mktemp("avr")
    for name, options in build_firmware.environments().items():
        build_firmware.build(name, options, folder)
    build_rig.build(folder / "librig.so")
    return folder


@pytest.fixture(scope="session")
def pio(avr_tools: None, tmp_path_factory: pytest.TempPathFactory) -> RunPio:
    """Runs PlatformIO on a project without a network, in a folder that it may fill; returns what it did."""
    core = make_core.make_core(tmp_path_factory.mktemp("core"))
    # Where this machine allows it, in a network of nobody but itself.
    alone = ["unshare", "--map-root-user", "--net"]
    lonely = subprocess.run([*alone, "true"], capture_output=True).returncode == 0
    settings = {
        "PLATFORMIO_CORE_DIR": str(core),
        "PLATFORMIO_SETTING_ENABLE_TELEMETRY": "no",
        "PLATFORMIO_SETTING_CHECK_PLATFORMIO_INTERVAL": "100000",
        "HTTP_PROXY": "http://127.0.0.1:9",
        "HTTPS_PROXY": "http://127.0.0.1:9",
    }

    def run(workspace: Path, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        command = [*(alone if lonely else []), ROOT / "build/pio-venv/bin/pio", *arguments]
        environment = os.environ | settings | {"PLATFORMIO_WORKSPACE_DIR": str(workspace)}
        return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=240)

    return run


@pytest.fixture(scope="session")
def make_avr_board(built: Path) -> Callable[..., AvrBoard]:
    """Makes boards with the real processor, simulated; arguments as AvrBoard's."""

    def make(seed: int = 0, eeprom: bytes = b"", elf: Path = built / "uno.elf") -> AvrBoard:
        return AvrBoard(seed, eeprom, elf=elf, library=built / "librig.so")

    return make


@pytest.fixture(params=["host", "ELF"])
def make_board(request: pytest.FixtureRequest) -> MakeBoard:
    """Makes boards, (seed, eeprom): once with the firmware compiled for this machine, once the real ones."""
    return Board if request.param == "host" else request.getfixturevalue("make_avr_board")


@pytest.fixture
def slack_us(make_board: MakeBoard) -> int:
    """How much later than on paper a board may do something because work takes it time."""
    return 0 if make_board is Board else 1000
