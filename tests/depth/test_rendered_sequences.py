"""The depth room on rendered webcam sequences, outlines re-measured around the true masks.

The sequences are not part of the project: RBDN_DATA names their folder, else ../shared/data beside the
checkout is tried.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from truth_snapshots import load_lens, truth_sequence

from host.depth.config import DepthConfig
from host.depth.estimator import Estimator

BESIDE = Path(__file__).resolve().parents[3] / "shared" / "data"
DATA = Path(os.environ.get("RBDN_DATA", BESIDE))


def last_errors(name: str) -> np.ndarray:
    """Relative depth errors of the complete objects of a sequence in its last frame, nan for no depth."""
    folder = DATA / name
    if not (folder / "truth" / "ids.npz").exists():
        pytest.skip(f"no sequence {name} in {DATA}; set RBDN_DATA to the folder that holds the sequences")
    estimator = Estimator(load_lens(folder), DepthConfig())
    for snapshot, pose in truth_sequence(folder):
        report = estimator.update(snapshot, pose)
    truth = json.loads((folder / "truth" / "truth.json").read_text())
    seen = truth["frames"][-1]["objects"]
    errors = []
    for thing in truth["objects"]:
        facts = seen.get(str(thing["id"]))
        if thing["background"] or not facts or facts["touches_border"] or facts["visible_fraction"] < 0.993:
            continue
        found = report.regions[thing["id"]].depth_cm
        errors.append(np.nan if found is None else found / facts["z_mean"] - 1)
    return np.array(errors)


def test_both_boxes_of_the_first_experiment_are_right_within_two_percent():
    assert np.abs(last_errors("exp1_boxes")).max() < 0.02


def test_complete_objects_on_tables_are_right_within_two_and_a_half_percent_at_the_median():
    errors = np.concatenate([last_errors(f"tabletop_0{k}") for k in (0, 2, 8)])
    assert len(errors) >= 8
    assert np.nanmedian(np.abs(errors)) < 0.025
    assert np.isnan(errors).mean() < 0.1
