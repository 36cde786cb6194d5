"""Sigma: as many errors within it as it says, for every method."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from drives import Run, ahead, boards_before_a_wall, drive, shaken, table_drives, ticked
from solid_scene import Eye

METHODS = ("fused", "outline", "area", "vertex")


@cache
def board_drives() -> tuple[Run, ...]:
    """Drives before boards, with unknown turns and an encoder's steps."""
    out = []
    for seed in range(25):
        rng = np.random.default_rng(seed)
        noise_px = float(rng.uniform(0.08, 0.25))
        path = ahead(int(rng.integers(6, 12)), float(rng.uniform(5, 11)))
        eye = Eye(boards_before_a_wall(100 + seed), noise_px=noise_px, vertex_noise_px=noise_px, seed=seed)
        out.append(drive(eye, shaken(path, 0.5, seed), ticked(path, seed, told=True)))
    return tuple(out)


def runs(kind: str) -> tuple[Run, ...]:
    return table_drives() if kind == "tables" else board_drives()


def ratios(kind: str, method: str) -> np.ndarray:
    """Error over sigma of all regions in the last frames."""
    out = []
    for run in runs(kind):
        truth = run.eye.truth(run.poses[-1])
        for name, found in run.last.regions.items():
            said = found if method == "fused" else found.estimates.get(method)
            if said is not None and said.depth_cm is not None and name in truth and not found.moving:
                out.append((said.depth_cm - truth[name]) / said.sigma_cm)
    return np.array(out)


@pytest.mark.parametrize("method", ["fused", "outline", "vertex"])
def test_sigma_on_tables_is_honest(method: str):
    z = np.abs(ratios("tables", method))
    assert len(z) > 30
    assert 0.60 < np.mean(z < 1) < 0.80
    assert 0.90 < np.mean(z < 2) < 0.99


@pytest.mark.parametrize("method", METHODS)
def test_sigma_of_boards_with_poor_odometry_is_not_too_small(method: str):
    z = np.abs(ratios("boards", method))
    assert len(z) > 30
    assert np.mean(z < 1) > 0.60
    assert np.mean(z < 2) > 0.90


def test_sigma_of_corners_is_honest():
    z = []
    for kind in ("tables", "boards"):
        for run in runs(kind):
            true = run.eye.corner_truth(run.poses[-1])
            found = run.last.vertices
            for vertex, xyz, sigma in zip(found.ids.tolist(), found.xyz_cm, found.sigma_cm, strict=True):
                if vertex in true and np.isfinite(sigma):
                    z.append(abs(xyz[2] - true[vertex]) / sigma)
    assert len(z) > 300
    assert 0.60 < np.mean(np.array(z) < 1) < 0.85
    assert np.mean(np.array(z) < 2) > 0.90
