"""The same frames give the same bytes: in any process, with any threads, with vector code or without."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from compile_core import compile_core
from scenes import add_noise, random_scene

from host.rbdn import Net, NetConfig

ROOT = Path(__file__).resolve().parents[2]
RESULTS = (
    "region_ids",
    "vertex_ids",
    "vertices_px",
    "area_px",
    "sigma_area_px",
    "outline_px",
    "outline_sigma_px",
)
FRAMES, WIDTH, HEIGHT = 8, 160, 120
VECTORS = ["-ftree-vectorize", "-ftree-slp-vectorize", "-fvect-cost-model=unlimited", "-mavx2", "-mfma"]
BUILDS = {
    "without vectors": ["-O1", "-fno-tree-vectorize", "-fno-tree-slp-vectorize"],
    "with wide vectors": ["-O1", *VECTORS],
}


def frames() -> np.ndarray:
    """Two noisy scenes that slide to and fro, then a cut to another: (N, H, W, 3) BGR."""
    views = [np.roll(random_scene(11 + k // 5), 2 * (k % 5), axis=1) for k in range(FRAMES)]
    return np.stack([add_noise(view, 5, k) for k, view in enumerate(views)])


def digest(value) -> bytes:
    """Hash of a snapshot's contents, times left out."""
    if isinstance(value, np.ndarray):
        return hashlib.sha256(f"{value.dtype}{value.shape}".encode() + value.tobytes()).digest()
    if dataclasses.is_dataclass(value):
        names = (f.name for f in dataclasses.fields(value))
        value = tuple(getattr(value, name) for name in names if not name.endswith("_ms"))
    if isinstance(value, tuple):
        return hashlib.sha256(b"".join(digest(item) for item in value)).digest()
    return hashlib.sha256(repr(value).encode()).digest()


def digest_of_run(mode: str) -> str:
    net = Net(NetConfig(mode=mode))  # pyright: ignore[reportArgumentType]
    return digest(tuple(net.track(frame) for frame in frames())).hex()


def in_a_fresh_process(mode: str, threads: int, optimised: bool) -> str:
    code = (
        f"import sys; sys.path[:0] = {sys.path!r}\n"
        f"import cv2; cv2.setNumThreads({threads}); cv2.setUseOptimized({optimised})\n"
        f"import test_determinism; print(test_determinism.digest_of_run({mode!r}))\n"
    )
    counts = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), str(threads))
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=os.environ | counts, timeout=120
    )
    assert run.returncode == 0, run.stderr[-2000:]
    return run.stdout.strip()


@pytest.mark.parametrize("mode", ["ours", "paper"])
def test_fresh_processes_agree_whatever_their_threads(mode: str):
    expected = digest_of_run(mode)
    assert in_a_fresh_process(mode, threads=1, optimised=True) == expected
    assert in_a_fresh_process(mode, threads=4, optimised=False) == expected


def test_a_digest_notices_a_change_in_the_last_bit():
    snapshot = Net().track(frames()[0])
    changed = snapshot.contour.xy_px.copy()
    changed[-1, -1] = np.nextafter(changed[-1, -1], np.inf)
    contour = dataclasses.replace(snapshot.contour, xy_px=changed)
    assert digest(dataclasses.replace(snapshot, contour=contour)) != digest(snapshot)
    assert digest(dataclasses.replace(snapshot, net_ms=-1.0)) == digest(snapshot)


@pytest.mark.parametrize("build", BUILDS)
def test_every_build_of_the_engine_agrees_with_the_installed_one(build: str, tmp_path: Path):
    if build == "with wide vectors" and not _has_avx2():
        pytest.skip("this machine has no AVX2 vectors to compare with")
    program = compile_core(Path(__file__).with_name("trace_core.cpp"), BUILDS[build], tmp_path / "build")
    images = frames()
    for mode in ("ours", "paper"):
        net = Net(NetConfig(mode=mode))
        expected = b""
        for image in images:
            net._core.track(image, np.zeros(0, np.int32))  # and no refinement but the next: it learns
            fine = net._core.refine(image)
            expected += b"".join(fine[name].tobytes() for name in RESULTS)
        run = subprocess.run(
            [str(program), str(WIDTH), str(HEIGHT), mode],
            input=images.tobytes(),
            capture_output=True,
            timeout=120,
        )
        assert run.returncode == 0
        assert len(run.stdout) == len(expected) > 10_000
        assert run.stdout == expected


def _has_avx2() -> bool:
    processor = Path("/proc/cpuinfo")
    return processor.is_file() and {"avx2", "fma"} <= set(processor.read_text().split())
