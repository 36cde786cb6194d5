#!/usr/bin/env python3
"""Builds build/avr/librig.so, the simulated ATmega that host/sim/avr/board.py loads."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "host/sim/avr/rig.c"
LIBRARY = ROOT / "build/avr/librig.so"
FLAGS = ["-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-I/usr/include/simavr"]


def build(library: Path = LIBRARY) -> Path:
    """Compile the library; returns its path. Ends the program with the compiler's own words if that fails."""
    library.parent.mkdir(parents=True, exist_ok=True)
    compiler = os.environ.get("CC", "cc")
    command = [compiler, *FLAGS, SOURCE, "-o", library, "-lsimavr", "-lelf", "-lm"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"error: {compiler} could not build {library.name}: run tools/setup_avr\n{done.stderr}")
    return library


if __name__ == "__main__":
    print(build().relative_to(ROOT))
