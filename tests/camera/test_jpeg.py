"""A JPEG that did not arrive whole is no picture."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from pictures import jpeg

from host.camera.jpeg import decode_jpeg, is_whole, without_padding


@pytest.mark.parametrize(
    "settings",
    [(), (cv2.IMWRITE_JPEG_RST_INTERVAL, 4), (cv2.IMWRITE_JPEG_PROGRESSIVE, 1)],
    ids=["plain", "with restarts", "progressive"],
)
def test_a_whole_picture_is_decoded_as_opencv_does(settings):
    data = jpeg(1, *settings)
    image = decode_jpeg(data)
    assert image is not None
    assert np.array_equal(image, cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR))


def test_padding_with_zeros_is_taken_off():
    data = jpeg(0)
    assert without_padding(data + bytes(1000)) == data
    assert without_padding(data) == data
    assert decode_jpeg(without_padding(data + bytes(1000))) is not None


def test_every_way_of_being_cut_short_is_noticed():
    data = jpeg(0)
    assert all(not is_whole(data[:length]) for length in range(len(data)))
    assert all(decode_jpeg(data[:length]) is None for length in range(0, len(data), 97))


def test_half_of_one_picture_and_half_of_the_next_is_no_picture():
    first, second = jpeg(1), jpeg(2)
    torn = first[: len(first) // 2] + second
    assert torn.startswith(b"\xff\xd8") and torn.endswith(b"\xff\xd9")
    assert decode_jpeg(torn) is None


def test_a_gap_among_restarts_is_noticed():
    data = jpeg(3, cv2.IMWRITE_JPEG_RST_INTERVAL, 4)
    begin, end = data.index(b"\xff\xd2"), data.index(b"\xff\xd5")
    assert is_whole(data)
    assert not is_whole(data[:begin] + data[end:])


@pytest.mark.parametrize(
    "data", [b"", b"\xff\xd8\xff\xd9", b"\x89PNG", bytes(100), b"\xff\xd8" + bytes(50) + b"\xff\xd9"]
)
def test_what_is_no_jpeg_is_none(data):
    assert decode_jpeg(data) is None
