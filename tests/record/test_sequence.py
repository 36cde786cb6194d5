"""Sequence folders: what is written is read back, and what is broken is named."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from host.camera.lens import Lens
from host.errors import InputError, UsageError
from host.pose import Pose
from host.record.image_file import image_size, read_image
from host.record.sequence import (
    quaternion_of_rotation,
    read_sequence,
    rotation_of_quaternion,
    write_sequence,
)

finite = st.floats(-1e6, 1e6)


def test_poses_and_images_are_read_as_the_files_have_them(sequence_folder: Path):
    sequence = read_sequence(sequence_folder)
    assert [frame.number for frame in sequence.frames] == [0, 1, 2, 3]
    assert sequence.lens == Lens(96, 72, 110.0, 110.0, 47.5, 35.5)
    last = sequence.frames[3].pose
    assert last.position_cm.tolist() == [0, 0, 6]
    assert last.t_s == 0.3
    assert np.array_equal(last.rotation, np.eye(3))
    assert np.array_equal(sequence.image(1), cv2.imread(str(sequence_folder / "frames/001.png")))


def test_sigmas_are_zero_where_the_file_has_none_and_read_where_it_does(sequence_folder: Path):
    assert read_sequence(sequence_folder).frames[2].pose.sigma_z_cm == 0
    lines = (sequence_folder / "poses.csv").read_text().split()
    more = ["sigma_z_cm,sigma_rot_rad", "0,0.001", "0.1,0.002", "0.2,0.003", "0.3,0.004"]
    (sequence_folder / "poses.csv").write_text("\n".join(map(",".join, zip(lines, more, strict=True))))
    pose = read_sequence(sequence_folder).frames[2].pose
    assert (pose.sigma_z_cm, pose.sigma_rot_rad) == (0.2, 0.003)


def test_a_quarter_turn_to_the_right_looks_along_x(sequence_folder: Path):
    text = (sequence_folder / "poses.csv").read_text()
    (sequence_folder / "poses.csv").write_text(text.replace("6.0,1,0,0,0", "6.0,0.7071,0,0.7071,0"))
    rotation = read_sequence(sequence_folder).frames[3].pose.rotation
    assert rotation @ [0, 0, 1] == pytest.approx([1, 0, 0], abs=1e-6)
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)


def test_files_from_other_systems_are_read_too(sequence_folder: Path):
    text = (sequence_folder / "poses.csv").read_text().replace("\n", "\r\n\r\n").replace("qz", "qz,note", 1)
    body = [line + ",x" if line[:1].isdigit() else line for line in text.split("\r\n")]
    (sequence_folder / "poses.csv").write_bytes(b"\xef\xbb\xbf" + "\r\n".join(body).encode())
    assert len(read_sequence(sequence_folder).frames) == 4


def test_other_poses_may_be_given_and_name_images_of_the_folder(sequence_folder: Path, tmp_path: Path):
    other = tmp_path / "other.csv"
    other.write_text("\n".join((sequence_folder / "poses.csv").read_text().split()[:3]))
    assert len(read_sequence(sequence_folder, other).frames) == 2


def test_an_image_that_changes_after_reading_is_noticed(sequence_folder: Path):
    sequence = read_sequence(sequence_folder)
    cv2.imwrite(str(sequence_folder / "frames/001.png"), np.zeros((10, 10, 3), np.uint8))
    with pytest.raises(InputError, match=r"001\.png.*10x10"):
        sequence.image(1)


def test_grey_images_come_as_three_channels_and_phone_rotation_is_not_followed(tmp_path: Path):
    upright = cv2.imencode(".jpg", np.zeros((20, 30), np.uint8))[1].tobytes()
    exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"  # orientation 6
    tagged = upright[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + upright[2:]
    (tmp_path / "a.jpg").write_bytes(tagged)
    assert image_size(tmp_path / "a.jpg") == (30, 20)
    assert read_image(tmp_path / "a.jpg").shape == (20, 30, 3)


@given(st.binary(max_size=60), st.integers(0, 2**32), st.sampled_from([".png", ".jpg"]))
@settings(max_examples=150, deadline=None)
def test_no_damage_to_an_image_brings_more_than_an_input_error(tmp_path_factory, junk, place, suffix):
    path = tmp_path_factory.mktemp("image") / f"a{suffix}"
    content = bytearray(cv2.imencode(suffix, np.full((9, 9, 3), 90, np.uint8))[1].tobytes())
    place %= len(content)
    content[place : place + len(junk)] = junk
    path.write_bytes(content)
    try:
        image = read_image(path)
    except InputError as error:
        assert str(path) in str(error)
        assert "\n" not in str(error)
    else:
        assert image.shape[:2] == image_size(path)[::-1]


@given(st.integers(0, 10**6), st.sampled_from([".png", ".jpg"]))
@settings(max_examples=100, deadline=None)
def test_an_image_cut_anywhere_is_refused(tmp_path_factory, place, suffix):
    path = tmp_path_factory.mktemp("image") / f"a{suffix}"
    noise = np.random.default_rng(3).integers(0, 255, (24, 24, 3), np.uint8)
    content = cv2.imencode(suffix, noise)[1].tobytes()
    path.write_bytes(content[: place % len(content)])
    with pytest.raises(InputError, match=r"a\.(png|jpg)"):
        read_image(path)


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1))
@settings(max_examples=200)
def test_quaternions_become_rotations_and_come_back(values):
    quaternion = np.array(values) / np.linalg.norm(values)
    rotation = rotation_of_quaternion(quaternion)
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)
    assert rotation_of_quaternion(quaternion_of_rotation(rotation)) == pytest.approx(rotation, abs=1e-12)


@given(
    st.lists(
        st.tuples(finite, finite, finite, st.floats(-3.1, 3.1), st.floats(0, 9)), min_size=1, max_size=4
    ),
    st.tuples(*[st.floats(0.1, 4e3)] * 2, *[st.floats(-40, 40)] * 2, *[st.floats(-100, 100)] * 5),
)
@settings(max_examples=50, deadline=None)
def test_what_is_written_is_read_back(tmp_path_factory, places, lens_values):
    folder = tmp_path_factory.mktemp("written") / "run"
    fx, fy, cx, cy, *distortion = lens_values
    lens = Lens(5, 4, fx, fy, cx, cy, tuple(distortion))
    poses = [
        Pose(Pose.planar(0, 0, a).rotation, np.array([x, y, z]), 0.1 * k, sigma, sigma / 2)
        for k, (x, y, z, a, sigma) in enumerate(places)
    ]
    images = [np.full((4, 5, 3), 10 * k, np.uint8) for k in range(len(poses))]
    write_sequence(folder, lens, zip(images, poses, strict=True))
    sequence = read_sequence(folder)
    assert sequence.lens == lens
    for k, (frame, pose) in enumerate(zip(sequence.frames, poses, strict=True)):
        assert frame.pose.position_cm.tolist() == pose.position_cm.tolist()
        assert frame.pose.rotation == pytest.approx(pose.rotation, abs=1e-9)
        assert (frame.pose.t_s, frame.pose.sigma_z_cm) == (pose.t_s, pose.sigma_z_cm)
        assert frame.pose.sigma_rot_rad == pose.sigma_rot_rad
        assert np.array_equal(sequence.image(k), images[k])


@pytest.mark.parametrize(
    ("key", "value"),
    [("fx", 371e300), ("fy", 1e-300), ("cx", 1e300), ("distortion", [1e9, 0, 0, 0, 0])],
)
def test_a_lens_beyond_any_camera_is_refused_by_key(sequence_folder: Path, key, value):
    file = sequence_folder / "camera.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {key: value}))
    with pytest.raises(InputError, match=f'"{key}"'):
        read_sequence(sequence_folder)


def test_a_pose_beyond_any_robot_is_refused_by_line_and_column(sequence_folder: Path):
    file = sequence_folder / "poses.csv"
    header, first, *rest = file.read_text().splitlines()
    cells = first.split(",")
    cells[header.split(",").index("z_cm")] = "1e30"
    file.write_text("\n".join([header, ",".join(cells), *rest]) + "\n")
    with pytest.raises(InputError, match="line 2, column z_cm"):
        read_sequence(sequence_folder)


def test_writing_never_adds_to_a_folder_that_holds_something(sequence_folder: Path):
    before = sorted(sequence_folder.rglob("*"))
    with pytest.raises(UsageError, match="exists already"):
        write_sequence(sequence_folder, Lens(5, 4, 1, 1, 2, 2), [])
    assert sorted(sequence_folder.rglob("*")) == before


def test_a_write_that_fails_leaves_nothing_behind(tmp_path: Path):
    lens, pose = Lens(5, 4, 1.0, 1.0, 2.0, 2.0), Pose(np.eye(3), np.zeros(3))
    frames = [(np.zeros((4, 5, 3), np.uint8), pose), (np.zeros((3, 3, 3), np.uint8), pose)]
    with pytest.raises(InputError, match="3x3"):
        write_sequence(tmp_path / "run", lens, frames)
    assert list(tmp_path.iterdir()) == []
