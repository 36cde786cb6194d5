"""Uploading: the real avrdude, a real bootloader, and then the program answers for itself."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from upload_bench import UploadBench

from host.errors import DeviceError, UsageError
from host.link.ports import SerialDevice
from host.sim.avr.board import AvrBoard, read_hex

ROOT = Path(__file__).resolve().parents[3]
BOOTLOADERS = ROOT / "build/bootloaders"
sys.path[:0] = [str(ROOT / "firmware"), str(ROOT / "tools")]
import flash_firmware  # noqa: E402
from build_id import build_id  # noqa: E402

pytestmark = pytest.mark.usefixtures("uploading_tools")


def flash(port: str, *options: str) -> subprocess.CompletedProcess[str]:
    """What `make flash` runs."""
    command = [sys.executable, ROOT / "tools/flash_firmware.py", port, *options]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize(
    ("bootloader", "board", "baud"),
    [
        pytest.param("uno.hex", "uno", 115200, id="uno"),
        pytest.param("old_nano.hex", "nano", 57600, id="nano before 2018"),
    ],
)
def test_the_program_goes_through_the_bootloader_and_says_which_build_it_is(
    built: Path, bootloader: str, board: str, baud: int
) -> None:
    blank = AvrBoard(bootloader=BOOTLOADERS / bootloader, library=built / "librig.so")
    with UploadBench(blank) as bench:
        done = flash(bench.path, "--board", board)
    assert done.returncode == 0, done.stderr
    assert f"uploading to {bench.path} at {baud} baud" in done.stdout
    assert f"runs build {build_id(ROOT / 'firmware'):08x}" in done.stdout
    address, program = read_hex(built / f"{board}.hex")
    assert address == 0
    assert blank.flash[: len(program)] == program
    assert set(blank.flash[len(program) + 256 : 0x7800]) == {0xFF}  # but for what fills the last page


def test_a_board_that_does_not_answer_is_told_with_what_to_look_at(built: Path) -> None:
    board = AvrBoard(elf=built / "uno.elf", library=built / "librig.so")  # runs, but has no bootloader
    with UploadBench(board) as bench:
        done = flash(bench.path)
    assert done.returncode == 4
    assert "no bootloader answers" in done.stderr
    assert "BOARD=nano" in done.stderr


def test_another_build_than_the_one_uploaded_is_told(built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flash_firmware, "answering_baud", lambda *_: 115200)
    monkeypatch.setattr(flash_firmware, "upload", lambda *_: None)  # which thus remains without effect
    monkeypatch.setattr(flash_firmware.build_firmware, "build", lambda *_: built / "uno.elf")
    monkeypatch.setattr(flash_firmware, "build_id", lambda _: 0x01020304)
    with (
        UploadBench(AvrBoard(elf=built / "uno.elf", library=built / "librig.so")) as bench,
        pytest.raises(DeviceError, match=r"answers with build [0-9a-f]{8}, not 01020304"),
    ):
        flash_firmware.flash(bench.path, "uno")


def test_a_port_that_is_not_there_or_not_ours_is_told_before_anything_is_built(tmp_path: Path) -> None:
    missing = flash("/dev/ttyNONE")
    assert (missing.returncode, missing.stdout) == (4, "")
    assert "/dev/ttyNONE does not exist" in missing.stderr
    unnamed = flash("")
    assert (unnamed.returncode, unnamed.stdout) == (2, "")
    assert "PORT=" in unnamed.stderr
    wrong = flash("/dev/null", "--board", "mega")
    assert (wrong.returncode, wrong.stdout) == (2, "")
    assert "uno or nano" in wrong.stderr


@pytest.mark.parametrize("count", [0, 1, 2])
def test_without_a_name_the_only_usb_port_is_taken_and_of_several_none(count: int, monkeypatch):
    plugged = [SerialDevice(f"/dev/ttyUSB{k}", "CH340", (0x1A86, 0x7523)) for k in range(count)]
    monkeypatch.setattr(flash_firmware, "list_devices", lambda: [*plugged, SerialDevice("/dev/ttyS0")])
    if count == 1:
        assert flash_firmware.only_port() == "/dev/ttyUSB0"
        return
    with pytest.raises(UsageError, match=r"on which port is the robot .*PORT=") as told:
        flash_firmware.only_port()
    assert all(str(device) in str(told.value) for device in plugged)
