"""The map a drive ends with, small enough to be kept in its result: cells as a picture, fronts as lines."""

from __future__ import annotations

import base64
import math
from typing import Any

import cv2
import numpy as np

from host.nav.config import BodyConfig
from host.nav.map import ObstacleMap
from host.nav.odometry import body_of
from host.nav.result import DriveLog

TAKEN = (96, 88, 176, 150)  # BGRA, to lie on light or dark
FREE = (110, 176, 110, 60)


def floor_of(obstacle_map: ObstacleMap, body: BodyConfig, log: DriveLog) -> dict[str, Any]:
    """As result.json has it: the known cells as a PNG, one pixel each, and the things that stand there.

    Lengths are in cm on the map; the picture's lower left corner is at ``left_cm``, ``near_cm``.
    """
    taken, free = obstacle_map.occupied, obstacle_map.free
    floor: dict[str, Any] = {"png": None}
    if (taken | free).any():
        rows, cols = np.nonzero(taken | free)
        inside = np.s_[rows.min() : rows.max() + 1, cols.min() : cols.max() + 1]
        picture = np.zeros((*taken[inside].shape, 4), np.uint8)
        picture[free[inside]] = FREE
        picture[taken[inside]] = TAKEN
        _, data = cv2.imencode(".png", picture[::-1])
        cell = obstacle_map.config.cell_cm
        floor = {
            "png": base64.b64encode(data.tobytes()).decode(),
            "left_cm": round(float(cols.min() * cell - obstacle_map.half_cm), 2),
            "near_cm": round(float(rows.min() * cell - obstacle_map.half_cm), 2),
            "width_cm": round(int(np.ptp(cols) + 1) * cell, 2),
            "height_cm": round(int(np.ptp(rows) + 1) * cell, 2),
        }
    standing = set(obstacle_map.region[taken].tolist())
    floor["things"] = [
        {
            "region": one.region,
            "ends_cm": [[round(float(v), 1) for v in end] for end in (one.left_cm, one.right_cm)],
            "told": str(one),
        }
        for one in obstacle_map.obstacles.values()
        if one.region in standing
    ]
    floor["robot"] = None
    if log.last_pose is not None:
        x, z, heading = body_of(log.last_pose, body.camera_ahead_cm)
        floor["robot"] = {
            "x_cm": round(x, 2),
            "z_cm": round(z, 2),
            "heading_deg": round(math.degrees(heading), 2),
            "radius_cm": body.radius_cm,
        }
    return floor
