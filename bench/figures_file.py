"""The file that a benchmark's figures go to: looked at before the work, written after it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from host.record.atomic import check_writable, write_whole


def check_json(path: Path | None) -> None:
    """Raise UsageError where the figures could not be written later."""
    if path is not None:
        check_writable(path, folder=False)


def write_json(path: Path | None, figures: Any) -> None:
    """Write the figures, if a file was asked for; UsageError where that fails."""
    if path is not None:
        write_whole(path, (json.dumps(figures, indent=2) + "\n").encode())
