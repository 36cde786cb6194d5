"""The paper's figures 9 to 11: first and later frames of each experiment, with net and depths over them."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from host.experiments.findings import Still
from host.view.net_picture import draw_net

WIDTH_PX = 1440  # of all frames beside each other
QUALITIES = (84, 76, 68, 60)
LARGEST_BYTES = 150_000


def overlay(stills: Sequence[Still]) -> bytes:
    """The frames beside each other as a JPEG of less than 150 kB."""
    pictures = [draw_net(s.image, s.snapshot, s.report, _caption(s)) for s in stills]
    row = cv2.hconcat(pictures)
    height = round(row.shape[0] * WIDTH_PX / row.shape[1])
    row = cv2.resize(row, (WIDTH_PX, height), interpolation=cv2.INTER_AREA)
    content = b""
    for quality in QUALITIES:
        content = np.asarray(cv2.imencode(".jpg", row, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]).tobytes()
        if len(content) < LARGEST_BYTES:
            break
    return content


def _caption(still: Still) -> str:
    return f"{still.travel_cm:.0f} cm driven" if still.travel_cm else "first frame"
