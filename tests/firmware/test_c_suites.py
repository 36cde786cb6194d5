"""The firmware's C specifications, each compiled under AddressSanitizer and UBSan and run as one test."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).parent
FIRMWARE = HERE.parents[1] / "firmware/src"
SUITES = sorted(HERE.glob("test_*.c"))
HELPERS = [HERE / f"{name}.c" for name in ("fake_hal", "host_frames", "rolling_robot")]
COMPILER = os.environ.get("CC", "cc")
FLAGS = [
    *("-std=gnu11", "-O1", "-g", "-Wall", "-Wextra", "-Wconversion", "-Werror"),
    *("-fsanitize=address,undefined", "-fno-sanitize-recover=all"),
    *(f"-I{FIRMWARE}", f"-I{HERE}"),
]


def _compile(*arguments: str | Path) -> None:
    done = subprocess.run([COMPILER, *FLAGS, *arguments], capture_output=True, text=True)
    if done.returncode:
        pytest.fail(f"{COMPILER} says:\n{done.stderr}", pytrace=False)


@pytest.fixture(scope="module")
def objects(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The firmware and what it is tested on, compiled once."""
    folder = tmp_path_factory.mktemp("firmware")
    compiled = []
    for source in [*sorted(FIRMWARE.glob("*.c")), *HELPERS]:
        compiled.append(folder / f"{source.stem}.o")
        _compile("-c", source, "-o", compiled[-1])
    return compiled


@pytest.mark.parametrize("suite", SUITES, ids=lambda path: path.stem.removeprefix("test_"))
def test_the_firmware_does_what_its_c_specification_says(
    suite: Path, cmocka: None, objects: list[Path], tmp_path: Path
) -> None:
    program = tmp_path / suite.stem
    _compile(suite, *objects, "-lcmocka", "-lm", "-o", program)
    done = subprocess.run([program], capture_output=True, text=True, timeout=120)
    if done.returncode:
        pytest.fail(f"{done.stdout}\n{done.stderr}", pytrace=False)
    assert "[  PASSED  ]" in done.stdout + done.stderr, "the suite ran no test"


def test_every_file_of_the_firmware_has_a_specification() -> None:
    specified = {suite.stem.removeprefix("test_") for suite in SUITES}
    assert {source.stem for source in FIRMWARE.glob("*.c")} <= specified
