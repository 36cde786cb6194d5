"""A recorded drive as a moving picture: it opens, moves, and is refused where it cannot be written."""

from __future__ import annotations

import sys

import cv2
import numpy as np
import pytest

from host.errors import UsageError
from host.record.mcap_reader import Recording
from host.view import animate


def test_a_recorded_drive_becomes_a_moving_picture_of_camera_and_map(recorded_drive, tmp_path):
    pictures = animate.animate(Recording(recorded_drive))
    assert len(pictures) >= 3 and len({picture.shape for picture in pictures}) == 1
    camera, plan = np.split(pictures[-1], [-animate.MAP_PX], axis=1)
    assert camera.shape[0] == plan.shape[0] == animate.HEIGHT_PX
    assert (pictures[0][:, -animate.MAP_PX :] != plan).any()  # the robot has moved, or the map grown
    out = tmp_path / "drive.webp"
    animate.write(pictures, out)
    opened, found = cv2.imreadanimation(str(out))
    assert opened and len(found.frames) == len(pictures)
    assert out.stat().st_size < 20_000 * len(pictures)


def test_another_kind_of_file_is_refused_before_any_work(recorded_drive, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["animate", str(recorded_drive), "--out", str(tmp_path / "drive.mp4")])
    with pytest.raises(UsageError, match=r"drive.mp4: name a file that ends in .webp or .gif"):
        animate.main()
    assert not list(tmp_path.iterdir())
