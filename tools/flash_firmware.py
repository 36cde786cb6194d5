#!/usr/bin/env python3
"""Builds the firmware, uploads it, and asks the robot what it now runs.

    make flash PORT=/dev/ttyACM0               # an Uno
    make flash PORT=/dev/ttyUSB0 BOARD=nano    # a Nano, with its old bootloader or its new one
    make flash                                 # where there is only one USB serial port

Ends well only if the robot answers with the very build that was uploaded.
"""

from __future__ import annotations

import argparse
import contextlib
import errno
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import serial

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "firmware")]

import build_firmware  # noqa: E402
from build_id import build_id  # noqa: E402

from host.errors import DeviceError, UsageError, run_command  # noqa: E402
from host.link.clock import SystemClock  # noqa: E402
from host.link.ports import list_devices  # noqa: E402
from host.link.protocol import Hello  # noqa: E402
from host.link.robot import Robot  # noqa: E402
from host.link.serial_port import SerialPort, why_not_open  # noqa: E402

OLD_NANO_BAUD = 57_600  # of the bootloader in Nanos sold before 2018
IN_SYNC_ASKED, IN_SYNC = b"0 ", b"\x14\x10"  # of the STK500 protocol
LISTEN_S = 0.2
ATTEMPTS = 8
RESET_S = 0.1
START_S = 8.0  # opening the port may reset the board, whose bootloader then waits up to 2 s


def upload_bauds(board: str, options: dict[str, str]) -> list[int]:
    """Speeds at which the board's bootloader may be listening, likeliest first."""
    facts = json.loads((build_firmware.PLATFORM / "boards" / f"{options['board']}.json").read_text())
    return [facts["upload"]["speed"], *([OLD_NANO_BAUD] if board == "nano" else [])]


def only_port() -> str:
    """The one USB serial port; a blank board cannot be asked whether it is a robot."""
    devices = [device for device in list_devices() if device.usb]
    if len(devices) != 1:
        names = ", ".join(map(str, devices)) or "no USB serial port is here"
        raise UsageError(
            f"on which port is the robot ({names})? Say, for instance, make flash PORT=/dev/ttyACM0"
        )
    print(f"on {devices[0]}", flush=True)
    return devices[0].path


def check_port(port: str) -> None:
    """DeviceError, with the remedy, if this port cannot be opened."""
    number = 0
    if not os.path.exists(port):
        number = errno.ENOENT
    elif not os.access(port, os.R_OK | os.W_OK):
        number = errno.EACCES
    if number:
        raise DeviceError(why_not_open(port, OSError(number, os.strerror(number))))


def answering_baud(port: str, bauds: list[int], board: str) -> int:
    """Speed at which a bootloader answers; DeviceError if none does.

    avrdude would find out too, but take most of a minute for every speed.
    """
    for baud in bauds:
        try:
            with serial.Serial(port, baud, timeout=LISTEN_S, exclusive=True) as line:
                _reset(line)
                for _ in range(ATTEMPTS):
                    line.write(IN_SYNC_ASKED)
                    if IN_SYNC in line.read(64):
                        return baud
        except OSError as error:
            raise DeviceError(why_not_open(port, error)) from None
        finally:
            time.sleep(RESET_S)
    spoken = " nor at ".join(map(str, bauds))
    raise DeviceError(
        f"no bootloader answers on {port} at {spoken} baud: "
        + ("is it a Nano, then add BOARD=nano; " if board == "uno" else "is it an Uno, then add BOARD=uno; ")
        + "is the port another device's; is the wire from its USB chip to RESET there"
    )


def _reset(line: serial.Serial) -> None:
    """Opening the port has reset the board where it was closed for long; this does it elsewhere."""
    with contextlib.suppress(OSError):  # a pseudo terminal has no such wire
        line.dtr = False
        time.sleep(RESET_S)
        line.dtr = True
    time.sleep(RESET_S)


def upload(hex_file: Path, port: str, baud: int) -> None:
    """Write a program and read it back, by avrdude."""
    print(f"uploading to {port} at {baud} baud", flush=True)
    command = ["avrdude", "-q", "-p", "atmega328p", "-c", "arduino", "-P", port, "-b", str(baud), "-D"]
    done = subprocess.run([*command, "-U", f"flash:w:{hex_file}:i"], capture_output=True, text=True)
    if done.returncode:
        raise DeviceError(f"avrdude could not upload to {port}; it says:\n{done.stderr.strip()}")


def ask(port: str) -> Hello:
    """What the robot says it runs."""
    with Robot(SerialPort(port), SystemClock()) as robot:
        return robot.connect(START_S)


def flash(port: str, board: str) -> None:
    """Build, upload, read back."""
    environments = build_firmware.environments()
    if board not in environments:
        raise UsageError(f"BOARD={board} is no board of platformio.ini: take {' or '.join(environments)}")
    port = port or only_port()
    missing = [name for name in ("avr-gcc", "avrdude") if shutil.which(name) is None]
    if missing:
        raise UsageError(f"no {' and no '.join(missing)} on this machine: run tools/setup_avr")
    check_port(port)
    wanted = build_id(build_firmware.FIRMWARE)
    elf = build_firmware.build(board, environments[board])
    baud = answering_baud(port, upload_bauds(board, dict(environments[board])), board)
    upload(elf.with_suffix(".hex"), port, baud)
    hello = ask(port)
    if hello.build_id != wanted:
        raise DeviceError(
            f"{port} answers with build {hello.build_id:08x}, not {wanted:08x}: "
            "the sources changed meanwhile, or this is another board; upload again"
        )
    print(f"{port} runs build {hello.build_id:08x}, protocol {hello.protocol_version}, as uploaded")


def main() -> None:
    parser = argparse.ArgumentParser(description="Upload the firmware and check that it runs.")
    parser.add_argument("port", nargs="?", default="", help="such as /dev/ttyACM0")
    parser.add_argument("--board", default="uno", help="a board of firmware/platformio.ini: uno or nano")
    arguments = parser.parse_args()
    run_command(lambda: flash(arguments.port, arguments.board))


if __name__ == "__main__":
    main()
