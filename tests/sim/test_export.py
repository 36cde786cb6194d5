"""Exported sequences: readable as sequences, with truth that fits the pictures."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from host.errors import UsageError
from host.record.sequence import read_sequence
from host.sim.drive_scenes import boxes, room
from host.sim.export import Mover, Way, export, main
from host.sim.render import IDEAL, WebcamModel


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


# --- What the robot does not know ------------------------------------------------------------------


def test_shaking_turns_the_camera_within_bounds_and_odometry_does_not_know():
    way = Way(frames=40, step_cm=1.0, turn_rad=0.05, shake_rad=math.radians(1.0))
    assert np.array_equal(next(way.poses(4)).rotation, np.eye(3))
    pitches, yaws = [], []
    for true, path, said in zip(way.poses(4), Way(40, 1.0, 0.05).poses(), way.odometry(4), strict=True):
        assert np.allclose(true.position_cm, path.position_cm)
        assert np.allclose(said.rotation, path.rotation) and np.allclose(said.position_cm, path.position_cm)
        ahead = (path.rotation.T @ true.rotation)[:, 2]
        pitches.append(math.degrees(math.asin(-ahead[1])))
        yaws.append(math.degrees(math.atan2(ahead[0], ahead[2])))
        assert said.sigma_rot_rad == pytest.approx(math.radians(1.0) / math.sqrt(3))
    for angles in (pitches, yaws):
        assert 0.8 < max(angles) <= 1.0 and -1.0 <= min(angles) < -0.8
    assert [p.rotation.tolist() for p in way.poses(4)] != [p.rotation.tolist() for p in way.poses(5)]


def test_encoders_count_whole_steps_that_begin_anywhere_within_one():
    way = Way(frames=30, step_cm=0.33, encoder_cm=0.5)
    errors, firsts = [], set()
    for seed in range(400):
        said = np.array([pose.position_cm[2] for pose in way.odometry(seed)])
        assert said[0] == 0.0
        assert np.allclose(said / 0.5, np.round(said / 0.5))
        errors.append(said - 0.33 * np.arange(30))
        firsts.add(int(np.argmax(said > 0)))
    assert np.abs(errors).max() < 0.5
    assert abs(np.mean(errors)) < 0.03 and np.std(errors) == pytest.approx(0.5 / math.sqrt(6), rel=0.1)
    assert firsts == {1, 2}
    assert [p.position_cm[2] for p in way.poses(0)] == pytest.approx(0.33 * np.arange(30))


def test_truth_keeps_the_true_camera_where_odometry_is_wrong(tmp_path):
    way = Way(frames=3, step_cm=1.3, shake_rad=math.radians(2.0), encoder_cm=0.5)
    world = boxes(3)
    export(tmp_path / "out", world, way, IDEAL)
    truth = json.loads((tmp_path / "out" / "truth" / "truth.json").read_text())
    sequence = read_sequence(tmp_path / "out")
    for frame, true, said, read in zip(
        truth["frames"], way.poses(3), way.odometry(3), sequence.frames, strict=True
    ):
        assert np.allclose(frame["camera"]["rotation"], true.rotation)
        assert np.allclose(frame["camera"]["position_cm"], true.position_cm)
        assert np.allclose(read.pose.position_cm, said.position_cm)
        assert np.allclose(read.pose.rotation, np.eye(3))
        front = frame["parts"]["7"]
        corners = (np.array(front["corners_cam"]) @ true.rotation.T) + true.position_cm
        assert np.allclose(corners[:, 2], 85.0)


def test_a_mover_goes_to_the_right_and_is_marked(tmp_path):
    export(tmp_path / "out", boxes(), Way(frames=3, step_cm=1.0), IDEAL, Mover("green_box", 1.5))
    truth = json.loads((tmp_path / "out" / "truth" / "truth.json").read_text())
    assert {o["name"]: o["moving"] for o in truth["objects"]}["green_box"] is True
    assert sum(o["moving"] for o in truth["objects"]) == 1
    left = {
        part["name"]: [min(c[0] for c in f["parts"][str(part["id"])]["corners_cam"]) for f in truth["frames"]]
        for part in truth["parts"]
        if part["name"] in ("green_box/front", "red_box/front")
    }
    assert left["green_box/front"] == pytest.approx([8.5, 10.0, 11.5])
    assert left["red_box/front"] == pytest.approx([-26.0, -26.0, -26.0])


def test_a_mover_that_is_not_there_is_refused_with_the_names_that_are(tmp_path):
    with pytest.raises(UsageError, match=r"'blue_box'.*red_box, green_box"):
        export(tmp_path / "out", boxes(), Way(frames=1), IDEAL, Mover("blue_box", 1.0))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("option", "value"), [("--step", "nan"), ("--turn", "inf"), ("--move", "red_box=nan"), ("--shake", "nan")]
)
def test_numbers_that_are_none_are_refused_before_anything_is_written(tmp_path, monkeypatch, option, value):
    monkeypatch.setattr("sys.argv", ["export", str(tmp_path / "out"), option, value])
    with pytest.raises(UsageError, match=option):
        main()
    assert not (tmp_path / "out").exists()
