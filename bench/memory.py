"""How much memory tracking needs, told by a process that does nothing else.

python -m bench.memory IMAGE...
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import cv2

from bench.flat_scenes import FlatScene
from host.rbdn import Net


def peak_mb_of_tracking(width: int, height: int) -> float:
    """Peak memory of a process that tracks frames of this size, above what it had after its imports."""
    with tempfile.TemporaryDirectory() as folder:
        paths = []
        for k in range(6):
            path = Path(folder) / f"{k}.png"
            cv2.imwrite(str(path), FlatScene(1).draw(width, height, 2.5 * k)[0])
            paths.append(str(path))
        child = [sys.executable, "-m", "bench.memory", *paths]
        return float(subprocess.run(child, check=True, capture_output=True, text=True).stdout)


def _track_files(paths: list[str]) -> float:
    before_kb = peak_kb()
    net = Net()
    for path in paths:
        image = cv2.imread(path)
        assert image is not None, path
        net.track(image)
    return (peak_kb() - before_kb) / 1024


def peak_kb() -> int:
    """Most memory that this process ever had, since it was started."""
    # Not getrusage: its peak is inherited from the process that started this one.
    status = Path("/proc/self/status").read_text()
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM"))


if __name__ == "__main__":
    print(_track_files(sys.argv[1:]))
