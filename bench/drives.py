"""Drives of the main job, each in a process of its own, several at a time."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track as progress

NAV_LOOP = Path(__file__).resolve().parents[1] / "host" / "nav_loop.py"
WALL = 20.0  # a slow or busy machine must not decide what comes out


@dataclass(frozen=True)
class Drive:
    """What to run: URIs of camera and robot, and the task as on the command line."""

    camera: str
    robot: str = "sim:"
    task: tuple[str, ...] = ()
    max_time_s: float = 120.0

    def run(self) -> dict[str, Any]:
        """result.json; or only ``camera``, ``robot`` and the last line of what went wrong in ``failed``."""
        with tempfile.TemporaryDirectory() as folder:
            result = Path(folder) / "result.json"
            command = [
                sys.executable, str(NAV_LOOP), "--no-view", "--camera", self.camera, "--robot", self.robot,
                *self.task, "--max-time", str(self.max_time_s), "--max-wall", str(WALL * self.max_time_s),
                "--json", str(result),
            ]  # fmt: skip
            # One thread each, so that as many drives as cores do not fight for them.
            alone = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
            done = subprocess.run(command, capture_output=True, text=True, cwd=folder, env=alone)
            if not result.exists():
                why = (done.stderr.strip().splitlines() or ["no result"])[-1]
                return {"camera": self.camera, "robot": self.robot, "failed": why}
            return json.loads(result.read_text())


def run_all(drives: Sequence[Drive], jobs: int, title: str) -> list[dict[str, Any]]:
    """All results, in the order of the drives; a progress bar where somebody looks."""
    results: dict[Drive, dict[str, Any]] = {}
    with ThreadPoolExecutor(jobs) as pool:
        running = {pool.submit(drive.run): drive for drive in drives}
        console = Console(stderr=True)
        for done in progress(as_completed(running), title, len(running), console=console, transient=True):
            results[running[done]] = done.result()
    return [results[drive] for drive in drives]
