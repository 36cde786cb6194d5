"""Pictures that were not driven on are kept, one for each kind of reason, and told of as they are written."""

from __future__ import annotations

import cv2
import numpy as np

from host.camera.frame import Frame
from host.nav.config import BodyConfig, NavConfig
from host.nav.gallery import MOST_REFUSED, Gallery
from host.nav.map import ObstacleMap
from host.nav.result import DriveLog


def frame(seq: int) -> Frame:
    return Frame(np.full((24, 32, 3), 10 * seq, np.uint8), 1.0 + 0.1 * seq, seq)


def test_of_each_kind_of_refusal_the_first_picture_is_kept_and_written(tmp_path):
    gallery = Gallery()
    gallery.refuse(None, "no picture for 0.4 s")  # nothing to keep
    gallery.refuse(frame(1), "the picture is black (mean 3)")
    gallery.refuse(frame(2), "the picture is black (mean 4)")
    for k in range(20):
        gallery.refuse(frame(3 + k), f"torn {'abcdefghijklmnopqrstuvwxyz'[k]}")
    told = gallery.pictures(1.0)
    assert len(told) == MOST_REFUSED
    assert told[0] == {"file": "refused_00001.png", "t_s": 0.1, "told": "stop: the picture is black (mean 3)"}
    gallery.write(tmp_path, ObstacleMap(BodyConfig(), NavConfig()), BodyConfig(), None, DriveLog())
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(one["file"] for one in told)
    assert int(cv2.imread(str(tmp_path / "refused_00001.png")).mean()) == 10
