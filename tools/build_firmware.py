#!/usr/bin/env python3
"""Builds the ATmega firmware with plain avr-gcc, as firmware/platformio.ini describes it.

    tools/build_firmware.py    # build/firmware/NAME.elf and .hex for every board of platformio.ini

Flags come from platformio.ini, what PlatformIO's platform adds from tools/pio_offline/atmelavr; the result is
the same hex as `pio run -d firmware` gives.
"""

from __future__ import annotations

import configparser
import json
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FIRMWARE = ROOT / "firmware"
PLATFORM = ROOT / "tools" / "pio_offline" / "atmelavr"
OUTPUT = ROOT / "build" / "firmware"

sys.path.insert(0, str(PLATFORM / "builder"))
import bare  # noqa: E402


def _run(*command: str | Path) -> str:
    """Standard output of a command; ends the program with the command's own words if it fails."""
    done = subprocess.run(command, capture_output=True, text=True, cwd=FIRMWARE)
    if done.returncode:
        sys.exit(f"error: {command[0]} failed:\n{done.stderr.strip()}")
    return done.stdout


def environments() -> dict[str, configparser.SectionProxy]:
    """The robot's environments of platformio.ini by name; each holds the options of [env] too."""
    ini = configparser.ConfigParser(default_section="env", interpolation=None)
    ini.read(FIRMWARE / "platformio.ini")
    return {name: ini[f"env:{name}"] for name in ini["platformio"]["default_envs"].split(", ")}


def build(name: str, options: configparser.SectionProxy, output: Path = OUTPUT) -> Path:
    """Build one environment; returns its ELF, beside which the hex lies."""
    board = json.loads((PLATFORM / "boards" / f"{options['board']}.json").read_text())["build"]
    mcu = f"-mmcu={board['mcu']}"
    flags = [mcu, *bare.C, *bare.ALL, f"-DF_CPU={board['f_cpu']}", *shlex.split(board["extra_flags"])]
    flags += shlex.split(options["build_flags"]) + shlex.split(options["build_src_flags"])
    flags += shlex.split(_run(sys.executable, FIRMWARE / "build_id.py"))

    objects_folder = output / name
    shutil.rmtree(objects_folder, ignore_errors=True)
    objects = []
    # In PlatformIO's order: with link-time optimisation it decides where functions lie.
    for source in sorted((FIRMWARE / "src").glob("**/*.[cS]")):
        made = objects_folder / source.relative_to(FIRMWARE / "src").with_suffix(".o")
        made.parent.mkdir(parents=True, exist_ok=True)
        _run("avr-gcc", *flags, "-c", source, "-o", made)
        objects.append(made)
    elf = output / f"{name}.elf"
    _run("avr-gcc", mcu, *bare.LINK, *objects, *(f"-l{library}" for library in bare.LIBRARIES), "-o", elf)
    _run("avr-objcopy", "-O", "ihex", "-R", ".eeprom", elf, elf.with_suffix(".hex"))
    return elf


def main() -> None:
    if shutil.which("avr-gcc") is None:
        sys.exit("error: no avr-gcc on this machine: run tools/setup_avr")
    for name, options in environments().items():
        print(build(name, options).relative_to(ROOT).with_suffix(".hex"))


if __name__ == "__main__":
    main()
