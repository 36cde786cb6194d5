"""The engine built into a small program of its own, with whatever compiler flags a test wants."""

from __future__ import annotations

from pathlib import Path

from compile_cpp import compile_cpp

CORE = Path(__file__).resolve().parents[2] / "host" / "rbdn" / "core"


def compile_core(main: Path, flags: list[str], folder: Path) -> Path:
    """Compile the engine with a C++ file that holds main(); the program lies in `folder`."""
    sources = [p for p in sorted(CORE.glob("*.cpp")) if p.name != "bindings.cpp"]
    return compile_cpp([*sources, main], folder / main.stem, [f"-I{CORE}", *flags], pieces=2)
