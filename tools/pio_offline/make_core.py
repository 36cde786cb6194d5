#!/usr/bin/env python3
"""Assembles build/pio-core, a PlatformIO core directory that needs no registry; README.md says of what."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

HERE = Path(__file__).resolve().parent
CORE = HERE.parents[1] / "build" / "pio-core"

# Versions that platformio.ini, the platform and PlatformIO itself ask for.
TOOLS = {
    "toolchain-atmelavr": "1.50400.190710",
    "tool-scons": "4.41101.0",
    "tool-avrdude": "1.70100.0",
    "tool-cppcheck": "1.21100.0",
}
PLATFORMS = ("atmelavr", "native")

SCONS_LAUNCHER = "import SCons.Script\nSCons.Script.main()\n"


def _mark_installed(folder: Path, kind: str, name: str, version: str) -> None:
    """What PlatformIO's resolver looks at; only this owner keeps it from asking the registry."""
    spec = {"owner": "platformio", "id": None, "name": name, "requirements": None, "uri": None}
    mark = {"type": kind, "name": name, "version": version, "spec": spec}
    (folder / ".piopm").write_text(json.dumps(mark))


def make_core(core: Path = CORE) -> Path:
    """Build the directory anew; returns it."""
    shutil.rmtree(core, ignore_errors=True)
    for name, version in TOOLS.items():
        folder = core / "packages" / name
        folder.mkdir(parents=True)
        manifest = {"name": name, "version": version, "description": "Stands in for PlatformIO's package"}
        (folder / "package.json").write_text(json.dumps(manifest))
        _mark_installed(folder, "tool", name, version)
    (core / "packages/tool-scons/scons.py").write_text(SCONS_LAUNCHER)

    if cppcheck := shutil.which("cppcheck"):
        (core / "packages/tool-cppcheck/cppcheck").symlink_to(cppcheck)

    for name in PLATFORMS:
        platform = core / "platforms" / name
        shutil.copytree(HERE / name, platform, ignore=shutil.ignore_patterns("__pycache__"))
        version = json.loads((platform / "platform.json").read_text())["version"]
        _mark_installed(platform, "platform", name, version)
    return core


if __name__ == "__main__":
    print(make_core())
