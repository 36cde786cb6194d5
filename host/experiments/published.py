"""What the paper printed: its Tables 1 to 3, its times, and the image measurements behind Table 1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from host.depth.two_frames import TwoViews

FOCAL_PX = 371.0  # not printed; Table 1's Y, Z and dy/dZ agree on it, and so do its areas


@dataclass(frozen=True)
class Corner:
    """One row of Table 1. X to the right and Y up, in cm at the first frame; errors in percent."""

    box: str
    name: str
    real_cm: tuple[float, float, float]
    vertex_cm: tuple[float, float, float]  # its X is that of the last frame (Eq. 12), see `table_1_views`
    vertex_error: tuple[float, float, float]
    vertex_growth_px: float  # "dy/dZ at dZ = 10 cm"
    area_cm: tuple[float, float, float]
    area_error: tuple[float, float, float]
    area_growth_px2: float  # "dA/dZ at dZ = 10 cm"


@dataclass(frozen=True)
class MeanDepth:
    """One row of Table 2 or 3."""

    thing: str
    travel_cm: float
    real_cm: float
    found_cm: float
    error: float  # percent


@dataclass(frozen=True)
class Time:
    """Seconds on a PC with 3 GHz."""

    first_frame_s: float
    tracking_s: float  # from the first frame to the last, or from location to location


TABLE_1_TRAVEL_CM = 10.0
# The printed growths of the red box's A and B are exchanged: with 13.05 and 12.24 px the focal length would
# be 395 and 347 px, exchanged it is 370 px as for all others.
TABLE_1 = (
    Corner("red_box", "A", (-26, 16.25, 85), (-19.7, 12.1, 65.72), (24.23, 25.53, 22.6), 12.24,
           (-26.46, 16.28, 84.86), (1.769, 0.184, 0.164), 2779),
    Corner("red_box", "B", (-5.5, 16.25, 85), (-4.26, 11.23, 61.66), (22.5, 30.8, 27.4), 13.05,
           (-5.73, 16.13, 84.86), (4.181, 0.738, 0.164), 2779),
    Corner("red_box", "C", (-5.5, -8.7, 85), (-27.07, -40.6, 345.2), (392.1, 366.6, 306.1), 1.3,
           (-5.7, -8.98, 84.86), (3.636, 3.218, 0.164), 2779),
    Corner("red_box", "D", (-26, -8.7, 85), (-75.99, -25.8, 224.8), (192.2, 196.5, 164.4), 1.97,
           (-26.5, -9.1, 84.86), (1.923, 4.597, 0.164), 2779),
    Corner("green_box", "A", (8.5, 15.2, 85), (5.67, 10.58, 62.5), (33.29, 30.39, 26.47), 11.94,
           (8.02, 15.029, 84.25), (5.647, 1.125, 0.882), 1937),
    Corner("green_box", "B", (23.5, 15.2, 85), (16.86, 11.43, 64.63), (28.25, 24.8, 23.96), 11.99,
           (22.887, 15.429, 84.25), (2.608, 1.506, 0.882), 1937),
    Corner("green_box", "C", (23.5, -8.7, 85), (54.9, -20.28, 185.2), (133.6, 133.1, 117.8), 2.31,
           (23.214, -8.2, 84.25), (1.217, 5.747, 0.882), 1937),
    Corner("green_box", "D", (8.5, -8.7, 85), (24.25, -24.95, 228), (185.2, 186.7, 168.2), 1.85,
           (8.09, -8.43, 84.25), (4.823, 3.103, 0.882), 1937),
)  # fmt: skip
TABLE_2 = (
    MeanDepth("box", 5.0, 92.33, 94.4, 2.2),
    MeanDepth("tomato", 5.0, 47.0, 46.93, 0.14),
    MeanDepth("pepper", 5.0, 68.5, 67.0, 2.1),
)
TABLE_3 = (
    MeanDepth("pot", 100.0, 612.5, 630.0, 2.85),
    MeanDepth("tree", 100.0, 625.0, 640.0, 2.4),
    MeanDepth("pot", 200.0, 512.5, 513.5, 0.195),
    MeanDepth("tree", 200.0, 525.0, 526.0, 0.19),
)
TIMES = {"experiment_1": Time(0.18, 0.13), "experiment_2": Time(0.2, 0.08), "experiment_3": Time(0.17, 0.15)}


def table_1_views() -> TwoViews:
    """The image measurements that Table 1 was computed from, without its real values.

    Y and Z of a vertex give its y in both frames (Eq. 7, 8). The printed X belongs to the last frame: taken
    so, the corners on one vertical edge agree within a pixel or two, and also with the X of the area method;
    taken as of the first frame they miss each other by 14 px. So x is known in the last frame only. The
    areas follow from their growth and the ratio that Eq. 16 made the depth of. y points down here.
    """
    boxes = sorted({corner.box for corner in TABLE_1}, reverse=True)
    x, y, z = np.array([corner.vertex_cm for corner in TABLE_1]).T
    z_last = z - TABLE_1_TRAVEL_CM
    first = np.column_stack([np.full(len(y), np.nan), -FOCAL_PX * y / z])
    last = np.column_stack([FOCAL_PX * x / z_last, -FOCAL_PX * y / z_last])
    face = np.array([boxes.index(corner.box) for corner in TABLE_1])
    of_box = [next(corner for corner in TABLE_1 if corner.box == box) for box in boxes]
    growth = np.array([corner.area_growth_px2 for corner in of_box], float)
    shrink = 1 - TABLE_1_TRAVEL_CM / np.array([corner.area_cm[2] for corner in of_box])
    area_last = growth / (1 - shrink**2)
    return TwoViews(first, last, face, area_last - growth, area_last)
