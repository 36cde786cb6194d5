#!/usr/bin/env python3
"""Static analysis of the firmware: cppcheck and clang-tidy over every C file of it; fails on any finding.

    tools/check_firmware.py    # says nothing when nothing is found

What clang-tidy looks for stands in firmware/.clang-tidy.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FIRMWARE = ROOT / "firmware"
SOURCES = FIRMWARE / "src"
TOOLS = ("cppcheck", "clang-tidy")

CPPCHECK = [
    *("cppcheck", "--quiet", "--error-exitcode=1", "--std=c11", "--platform=avr8", "--inline-suppr"),
    *("--enable=warning,style,performance,portability", "-DF_CPU=16000000L", f"-I{SOURCES}"),
]
CLANG_TIDY = ["clang-tidy", "--quiet", f"--config-file={FIRMWARE / '.clang-tidy'}"]

# As for the ATmega, whose int has 16 bits.
AVR = [
    *("--target=avr", "-mmcu=atmega328p", "-std=gnu11", "-Os", "-DF_CPU=16000000L"),
    *("-isystem", "/usr/lib/avr/include"),
    # avr/wdt.h holds assembly that clang rejects: nothing is lost by not looking into it.
    *("-D_AVR_WDT_H_", "-Dwdt_reset()=", "-Dwdt_disable()=", "-Dwdt_enable(timeout)="),
]


def findings(sources: Path = SOURCES, only: str = "*.c") -> str:
    """What both tools have to say about the C files in a folder like firmware/src; empty if nothing."""
    files = sorted(sources.glob(f"**/{only}"))
    commands = [[*CPPCHECK, *files], *([*CLANG_TIDY, file, "--", *AVR] for file in files)]

    def run(command: list[str | Path]) -> str:
        done = subprocess.run(command, capture_output=True, text=True)
        return done.stdout + done.stderr if done.returncode else ""

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return "".join(pool.map(run, commands))


def main() -> None:
    missing = [name for name in TOOLS if shutil.which(name) is None]
    if missing:
        sys.exit(f"error: no {' and no '.join(missing)} on this machine: run tools/setup_avr")
    said = findings()
    if said:
        sys.exit(f"{said}\nerror: static analysis has findings: mend them, or say in the file why not")


if __name__ == "__main__":
    main()
