"""The firmware is tested and analysed by PlatformIO's commands as by ours, and neither finds anything."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
FIRMWARE = ROOT / "firmware"
sys.path.insert(0, str(ROOT / "tools"))
import check_firmware  # noqa: E402

RunPio = Callable[..., "subprocess.CompletedProcess[str]"]

pytestmark = pytest.mark.usefixtures("checking_tools")


def broken_project(folder: Path) -> Path:
    """The firmware, one function of which reads past the end of an array."""
    shutil.copytree(FIRMWARE, folder / "firmware")
    source = folder / "firmware/src/drive.c"
    with source.open("a") as file:
        file.write("int past(void); int past(void) { int a[2] = {0}; return a[2]; }\n")
    return folder / "firmware"


def test_pio_test_runs_every_c_specification_and_all_pass(pio: RunPio, tmp_path: Path) -> None:
    done = pio(tmp_path, "test", "-d", FIRMWARE, "-e", "native")
    assert done.returncode == 0, done.stdout + done.stderr
    passed = set(re.findall(r"native +test_(\w+) +PASSED", done.stdout))
    assert passed == {path.stem.removeprefix("test_") for path in (ROOT / "tests/firmware").glob("test_*.c")}
    assert len(re.findall(r"\[ +OK \]", done.stdout)) > 50


def test_pio_test_fails_when_a_specification_does(pio: RunPio, tmp_path: Path) -> None:
    shutil.copytree(FIRMWARE, tmp_path / "firmware")
    shutil.copytree(ROOT / "tests/firmware", tmp_path / "tests/firmware")
    specified = tmp_path / "tests/firmware/test_drive.c"
    specified.write_text(specified.read_text().replace("assert_int_equal(", "assert_int_not_equal(", 1))
    done = pio(tmp_path, "test", "-d", tmp_path / "firmware", "-e", "native", "-f", "test_drive")
    assert done.returncode == 1
    assert re.search(r"native +test_drive +(FAILED|ERRORED)", done.stdout + done.stderr), done.stdout


def test_pio_check_finds_nothing_in_the_firmware(pio: RunPio, tmp_path: Path) -> None:
    done = pio(tmp_path, "check", "-d", FIRMWARE, "--fail-on-defect", "low")
    assert done.returncode == 0, done.stdout + done.stderr
    assert len(re.findall("No defects found", done.stdout)) == 2  # uno, nano


def test_pio_check_finds_what_is_broken(pio: RunPio, tmp_path: Path) -> None:
    project = broken_project(tmp_path)
    done = pio(tmp_path, "check", "-d", project, "-e", "uno", "--fail-on-defect", "high")
    assert done.returncode == 1
    assert "arrayIndexOutOfBounds" in done.stdout, done.stdout


def test_cppcheck_and_clang_tidy_find_nothing_in_the_firmware() -> None:
    assert check_firmware.findings() == ""


def test_cppcheck_and_clang_tidy_find_what_is_broken(tmp_path: Path) -> None:
    said = check_firmware.findings(broken_project(tmp_path) / "src", only="drive.c")
    assert "arrayIndexOutOfBounds" in said
    assert "clang-diagnostic-array-bounds" in said
