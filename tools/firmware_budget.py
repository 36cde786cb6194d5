#!/usr/bin/env python3
"""Prints what the built firmware takes of the ATmega328P, beside what it may take; fails above that."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import build_firmware

FLASH_MAX = 24 * 1024
RAM_MAX = 1228  # 1.2 KB


def sizes(elf: Path) -> tuple[int, int]:
    """Bytes of flash and of static RAM."""
    done = subprocess.run(["avr-size", "-A", "-d", elf], capture_output=True, text=True, check=True)
    section = {row.split()[0]: int(row.split()[1]) for row in done.stdout.splitlines() if row.startswith(".")}
    variables = section.get(".data", 0)
    return section[".text"] + variables, variables + section.get(".bss", 0) + section.get(".noinit", 0)


def main() -> None:
    too_much = False
    for name in build_firmware.environments():
        flash, ram = sizes(build_firmware.OUTPUT / f"{name}.elf")
        print(f"{name:6} flash {flash:6} of {FLASH_MAX} B   static RAM {ram:5} of {RAM_MAX} B")
        too_much |= flash > FLASH_MAX or ram > RAM_MAX
    if too_much:
        sys.exit("error: the firmware has outgrown its budget")


if __name__ == "__main__":
    main()
