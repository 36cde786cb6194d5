"""The names that udev gives to plugs, the same after every plugging in."""

from __future__ import annotations

import os


def lasting_names(folder: str) -> dict[str, str]:
    """From the real path of each device to its name in a folder such as /dev/serial/by-id."""
    try:
        names = sorted(os.listdir(folder))
    except OSError:  # no udev, or nothing plugged in
        return {}
    return {os.path.realpath(f"{folder}/{name}"): f"{folder}/{name}" for name in names}
