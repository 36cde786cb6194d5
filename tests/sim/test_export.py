"""Exported sequences: readable as sequences, with truth that fits the pictures."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from host.errors import UsageError
from host.record.sequence import read_sequence
from host.sim.export import Way, export
from host.sim.render import IDEAL, WebcamModel
from host.sim.world import boxes, room


def test_an_exported_sequence_is_read_back_with_its_poses_and_lens(tmp_path):
    world = room(2)
    way = Way(frames=3, step_cm=2.0, turn_rad=0.1)
    export(tmp_path / "out", world, way, WebcamModel())
    sequence = read_sequence(tmp_path / "out")
    assert sequence.lens == world.lens
    assert len(sequence.frames) == 3
    for frame, pose in zip(sequence.frames, way.poses(), strict=True):
        assert np.allclose(frame.pose.position_cm, pose.position_cm, atol=1e-4)
        assert np.allclose(frame.pose.rotation, pose.rotation, atol=1e-6)
    assert (sequence.image(0) != sequence.image(1)).any()


def test_truth_tells_areas_depths_corners_and_what_is_hidden(tmp_path):
    export(tmp_path / "out", boxes(), Way(frames=2, step_cm=5.0), IDEAL)
    truth = json.loads((tmp_path / "out" / "truth" / "truth.json").read_text())
    front = next(p["id"] for p in truth["parts"] if p["name"] == "red_box/front")
    red = next(o["id"] for o in truth["objects"] if o["name"] == "red_box")
    for frame, depth in zip(truth["frames"], (85.0, 80.0), strict=True):
        part = frame["parts"][str(front)]
        assert part["z_mean"] == pytest.approx(depth)
        assert frame["objects"][str(red)]["visible_fraction"] == pytest.approx(1.0)
        assert not frame["objects"][str(red)]["touches_border"]
        # Table 1: x -26 to -5.5, y 16.25 above to 8.7 below the camera
        exact = {
            (159.5 + 371 * x / depth, 119.5 + 371 * y / depth) for x in (-26, -5.5) for y in (-16.25, 8.7)
        }
        for corner in part["corners_px"]:
            assert min(math.dist(corner, e) for e in exact) < 1e-9
    with (
        np.load(tmp_path / "out" / "truth" / "ids.npz") as ids,
        np.load(tmp_path / "out" / "truth" / "depth.npz") as depths,
    ):
        assert ids["part_id"].shape == ids["object_id"].shape == depths["depth"].shape == (2, 240, 320)
        assert (depths["depth"][1][ids["part_id"][1] == front] == 80.0).all()


def test_a_folder_with_something_in_it_is_left_alone(tmp_path):
    (tmp_path / "note.txt").write_text("mine")
    with pytest.raises(UsageError, match="exists already"):
        export(tmp_path, boxes(), Way(frames=1), IDEAL)
    assert [p.name for p in tmp_path.iterdir()] == ["note.txt"]
