"""Do lens file, pictures, robot.toml and the robot's own parameters belong together?"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from host.camera.lens import Lens
from host.camera.lens_file import check_camera, read_lens
from host.doctor.finding import Finding, Part
from host.errors import InputError
from host.link.parameters import PARAMETERS, Param
from host.nav.config import BodyConfig

NARROW_DEG, WIDE_DEG = 25.0, 130.0  # horizontally
OFF_CENTRE = 0.15  # of the image side
UNEVEN_FOCAL = 0.05
FOLDED_PX = 0.5
AGREE = 0.02  # relative; as far as a calibration may be off
MEASURED = (Param.UM_PER_COUNT_LEFT, Param.UM_PER_COUNT_RIGHT, Param.TRACK_UM)
PART = Part("calibration")
CALIBRATE = "'python -m host.calibrate camera' makes a new one"


def check_lens_file(
    path: Path, size: tuple[int, int] | None, camera_name: str | None = None
) -> tuple[Finding, Lens | None]:
    """Can it be read, and is it of this camera and for pictures of this size (width, height)?"""
    try:
        lens = read_lens(path)
        check_camera(path, camera_name)
    except InputError as error:
        return PART.error("lens", error), None
    return check_lens(lens, str(path), size), lens


def check_lens(lens: Lens, name: str, size: tuple[int, int] | None) -> Finding:
    """Is there such a lens, and is it for these pictures?"""
    if size is not None and size != (lens.width, lens.height):
        return PART.fail(
            "lens",
            f"{name} is for {lens.width}x{lens.height} px, the camera delivers {size[0]}x{size[1]}",
            f"calibrate at the size that is used: {CALIBRATE}",
        )
    if wrong := _implausible(lens):
        return PART.fail("lens", f"{name}: {wrong}", CALIBRATE)
    told = f"{name}: {_width_deg(lens):.0f} degrees wide, {lens.width}x{lens.height} px"
    return PART.ok("lens", told if size is not None else f"{told}; no picture to compare its size with")


def _implausible(lens: Lens) -> str | None:
    wide = math.degrees(2 * math.atan((lens.width - 1) / 2 / lens.fx))
    if not NARROW_DEG <= wide <= WIDE_DEG:
        return f"a picture {wide:.0f} degrees wide is no webcam's"
    if abs(lens.fx / lens.fy - 1) > UNEVEN_FOCAL:
        return f"focal lengths {lens.fx:.0f} and {lens.fy:.0f} px differ too much: pixels are square"
    off = (abs(lens.cx / (lens.width - 1) - 0.5), abs(lens.cy / (lens.height - 1) - 0.5))
    if max(off) > OFF_CENTRE:
        return f"its centre ({lens.cx:.0f}, {lens.cy:.0f}) is far from the picture's"
    edge = np.linspace(0.0, 1.0, 9)
    x, y = edge * (lens.width - 1), edge * (lens.height - 1)
    border = np.concatenate([
        np.column_stack([x, np.zeros(9)]), np.column_stack([x, np.full(9, lens.height - 1.0)]),
        np.column_stack([np.zeros(9), y]), np.column_stack([np.full(9, lens.width - 1.0), y]),
    ])  # fmt: skip
    with np.errstate(all="ignore"):
        rays = lens.to_rays(border)
        off_px = np.abs(lens.to_pixels(rays) - border).max()
        flat = (border - (lens.cx, lens.cy)) / (lens.fx, lens.fy)
        turned = np.linalg.norm(rays, axis=1) / np.maximum(np.linalg.norm(flat, axis=1), 1e-9)
    if not (off_px < FOLDED_PX and turned.min() > 0.3 and turned.max() < 3.0):
        return "its distortion folds the picture's corners over"
    return None


def check_parameters(values: Mapping[Param, int]) -> Finding:
    """Were wheels and track measured? The robot has just started from what its EEPROM holds."""
    told = (
        f"{values[Param.UM_PER_COUNT_LEFT]} and {values[Param.UM_PER_COUNT_RIGHT]} um a count, "
        f"track {values[Param.TRACK_UM] / 1000:.1f} mm"
    )
    if all(values[param] == PARAMETERS[param].default for param in MEASURED):
        return PART.warn(
            "wheels",
            f"{told}, as flashed: never measured",
            "'python -m host.calibrate wheels' measures and saves them",
        )
    return PART.ok("wheels", told)


def check_body(values: Mapping[Param, int], body: BodyConfig) -> Finding:
    """Does robot.toml say the same of the wheels as the robot itself?"""
    left, right = values[Param.UM_PER_COUNT_LEFT], values[Param.UM_PER_COUNT_RIGHT]
    true_cm, true_track_cm = (left + right) / 2e4, values[Param.TRACK_UM] / 1e4
    wrong = []
    if abs(body.cm_per_count / true_cm - 1) > AGREE:
        wrong.append(("cm_per_count", f"{body.cm_per_count:g}", f"{true_cm:.4f}"))
    if abs(body.track_cm / true_track_cm - 1) > AGREE:
        wrong.append(("track_cm", f"{body.track_cm:g}", f"{true_track_cm:.2f}"))
    if abs(body.wheel_ratio * right / left - 1) > AGREE:
        wrong.append(("wheel_ratio", f"{body.wheel_ratio:g}", f"{left / right:.4f}"))
    if wrong:
        told = "; ".join(f"body.{key} = {ours}, the robot has {theirs}" for key, ours, theirs in wrong)
        fix = ", ".join(f"{key} = {theirs}" for key, _, theirs in wrong)
        return PART.fail("robot.toml", told, f"write into robot.toml, [body]: {fix}")
    return PART.ok("robot.toml", f"agrees with the robot's wheels and track to within {100 * AGREE:.0f} %")


def _width_deg(lens: Lens) -> float:
    ends = lens.to_rays(np.array([[0.0, lens.cy], [lens.width - 1.0, lens.cy]]))[:, 0]
    return math.degrees(math.atan(ends[1]) - math.atan(ends[0]))
