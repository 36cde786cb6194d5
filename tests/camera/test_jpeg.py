"""A JPEG that did not arrive whole is no picture."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from pictures import jpeg

from host.camera.jpeg import decode_jpeg, whole_jpeg


@pytest.mark.parametrize(
    "settings",
    [(), (cv2.IMWRITE_JPEG_RST_INTERVAL, 4), (cv2.IMWRITE_JPEG_PROGRESSIVE, 1)],
    ids=["plain", "with restarts", "progressive"],
)
def test_a_whole_picture_is_decoded_as_opencv_does(settings):
    data = jpeg(1, *settings)
    assert whole_jpeg(data) == data
    image = decode_jpeg(data)
    assert image is not None
    assert np.array_equal(image, cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR))


@pytest.mark.parametrize("rest", [bytes(1000), b"\xff" * 9, b"of an older picture" * 30, jpeg(1)[-500:]])
def test_what_a_camera_leaves_in_its_buffer_behind_the_picture_is_taken_off(rest: bytes):
    assert whole_jpeg(jpeg(0) + rest) == jpeg(0)
    assert whole_jpeg(jpeg(0)) == jpeg(0)


def test_every_way_of_being_cut_short_is_noticed():
    data = jpeg(0)
    assert all(whole_jpeg(data[:length]) is None for length in range(len(data)))


def test_half_of_one_picture_and_half_of_the_next_is_no_picture():
    first, second = jpeg(1), jpeg(2)
    torn = first[: len(first) // 2] + second
    assert torn.startswith(b"\xff\xd8") and torn.endswith(b"\xff\xd9")
    assert whole_jpeg(torn) is None


def test_a_gap_among_restarts_is_noticed():
    data = jpeg(3, cv2.IMWRITE_JPEG_RST_INTERVAL, 4)
    begin, end = data.index(b"\xff\xd2"), data.index(b"\xff\xd5")
    assert whole_jpeg(data) == data
    assert whole_jpeg(data[:begin] + data[end:]) is None


@pytest.mark.parametrize(
    "data", [b"", b"\xff\xd8\xff\xd9", b"\x89PNG", bytes(100), b"\xff\xd8" + bytes(50) + b"\xff\xd9"]
)
def test_what_is_no_jpeg_is_none(data):
    assert whole_jpeg(data) is None


def test_what_looks_whole_and_cannot_be_decoded_is_none():
    data = jpeg(0)
    size_at = data.index(b"\xff\xc0") + 5
    assert decode_jpeg(data[:size_at] + bytes(4) + data[size_at + 4 :]) is None
