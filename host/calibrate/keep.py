"""Measured settings into robot.toml, whose other lines and comments stay as they are."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from host.config import DEFAULT_FILE, parse_config
from host.record.atomic import check_writable, write_whole

Settings = Mapping[str, Mapping[str, float]]  # by section


def toml_lines(settings: Settings) -> list[str]:
    """What to write into robot.toml."""
    out = []
    for section, values in settings.items():
        out.append(f"[{section}]")
        out += [f"{key} = {value!r}" for key, value in values.items()]
    return out


def keep(settings: Settings, path: Path = DEFAULT_FILE) -> None:
    """Change these values in a robot.toml, or add them; it need not be there yet.

    Raises
    ------
    UsageError
        It cannot be read or written, or a value is out of its range.
    """
    text = path.read_bytes().decode("utf-8-sig") if path.is_file() else ""
    end = "\r\n" if "\r\n" in text else "\n"
    text = text.replace("\r\n", "\n")
    wanted = parse_config(text, path)
    for section, values in settings.items():
        wanted = replace(wanted, **{section: replace(getattr(wanted, section), **values)})
        for key, value in values.items():
            text = _with(text, section, key, repr(value))
    if parse_config(text, path) != wanted:
        from host.errors import UsageError

        raise UsageError(
            f"{path}: is written so that it cannot be changed line by line; write {toml_lines(settings)}"
        )
    write_whole(path, text.replace("\n", end).encode())


def check_keepable(save: bool) -> None:
    """See before the robot drives that what it is to measure can be kept, where that is asked for."""
    if save:
        check_writable(DEFAULT_FILE, folder=False)


def tell(settings: Settings, save: bool) -> None:
    """Write the settings into robot.toml, or say what to write there."""
    if not save:
        print("For robot.toml (or --save):", *toml_lines(settings), sep="\n")
        return
    keep(settings)
    for section, values in settings.items():
        for key, value in values.items():
            print(f"Written to {DEFAULT_FILE}: {section}.{key} = {value}")


def _with(text: str, section: str, key: str, value: str) -> str:
    """The text with one value changed, its comment kept, or added at the end of its section."""
    lines = text.splitlines()
    begin = next((k for k, line in enumerate(lines) if re.match(rf"\s*\[{section}\]\s*(#|$)", line)), None)
    if begin is None:
        return "\n".join([*lines, *([""] if lines else []), f"[{section}]", f"{key} = {value}", ""])
    end = next((k for k in range(begin + 1, len(lines)) if re.match(r"\s*\[", lines[k])), len(lines))
    for k in range(begin + 1, end):
        found = re.match(rf"(\s*{key}\s*=\s*)[^#]*?(\s*#.*)?$", lines[k])
        if found:
            lines[k] = f"{found[1]}{value}{found[2] or ''}"
            break
    else:
        lines.insert(begin + 1, f"{key} = {value}")
    return "\n".join([*lines, ""])
