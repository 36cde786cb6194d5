"""What results depend on besides their input: versions of libraries, and checksums of our own code."""

from __future__ import annotations

import functools
import hashlib
import platform
import subprocess
from importlib import import_module, metadata
from pathlib import Path

import cv2
import numpy as np

from host.link.protocol import PROTOCOL_VERSION, SCHEMA_HASH

HOST = Path(__file__).resolve().parents[1]
# What net, depth and commands are made by; checksums of it tell whether code changed.
CODE = {
    "net": (HOST / "rbdn", "host.rbdn._core"),
    "depth": (HOST / "depth", "host.depth._depth"),
    "nav": (HOST / "nav", "host.nav._nav"),
}


@functools.cache
def versions() -> dict[str, str]:
    """By name: libraries, machine, protocol, and checksums of our own code."""
    return {
        "program": _program(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "opencv": cv2.__version__,
        "machine": platform.machine(),
        "system": platform.platform(),
        "protocol": f"{PROTOCOL_VERSION}, schema {SCHEMA_HASH:08x}",
        **{f"code of {name}": _code(*where) for name, where in CODE.items()},
    }


def commit() -> str | None:
    """The commit that is checked out, where this runs from a checkout."""
    try:
        asked = ["git", "-C", str(HOST), "rev-parse", "HEAD"]
        told = subprocess.run(asked, capture_output=True, text=True, timeout=2.0, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return told.stdout.strip()


def differences(then: dict[str, str], now: dict[str, str]) -> list[str]:
    """What of it is another now, in words."""
    return [
        f"{name} changed" if name.startswith("code of") else f"{name} was {then[name]}, is {now.get(name)}"
        for name in then
        if then[name] != now.get(name)
    ]


def _program() -> str:
    try:
        return metadata.version("rbdn-robot")
    except metadata.PackageNotFoundError:
        return "not installed"


def _code(folder: Path, native: str) -> str:
    """Checksum of a room's Python files and of its compiled engine."""
    sums = hashlib.blake2b(digest_size=8)
    compiled = import_module(native).__file__
    for path in [*sorted(folder.rglob("*.py")), *([Path(compiled)] if compiled else [])]:
        sums.update(path.read_bytes())
    return sums.hexdigest()
