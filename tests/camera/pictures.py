"""Pictures for cameras that are not there."""

from __future__ import annotations

import cv2
import numpy as np


def image(number: int, width: int = 160, height: int = 120) -> np.ndarray:
    """Something to see, another one for every number. BGR."""
    noise = np.random.default_rng(number).integers(40, 215, (6, 8, 3), np.uint8)
    return cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC)


def jpeg(number: int, *settings: int, width: int = 160, height: int = 120) -> bytes:
    """The same as a camera sends it."""
    return cv2.imencode(".jpg", image(number, width, height), settings)[1].tobytes()
