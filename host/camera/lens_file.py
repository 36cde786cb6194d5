"""The lens as camera.json keeps it."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from host.camera.lens import Lens
from host.errors import InputError
from host.record.atomic import write_whole

DISTORTION_TERMS = ("k1", "k2", "p1", "p2", "k3")
LARGEST_SIDE_PX = 20000
LARGEST_DISTORTION = 100.0


def read_lens(path: Path) -> Lens:
    """Read a camera.json.

    Raises
    ------
    InputError
        naming the file and the line or key that is wrong.
    """
    values = _values(path)
    width, height = _side(path, values, "width"), _side(path, values, "height")
    return Lens(
        width=width,
        height=height,
        fx=_focal(path, values, "fx", width),
        fy=_focal(path, values, "fy", height),
        cx=_centre(path, values, "cx", width),
        cy=_centre(path, values, "cy", height),
        distortion=_distortion(path, values),
    )


def read_about(path: Path) -> dict[str, Any]:
    """What a camera.json says beside the lens: whose it is, when and how well it was calibrated.

    Raises
    ------
    InputError
        as `read_lens`.
    """
    lens = {field.name for field in fields(Lens)}
    return {key: value for key, value in _values(path).items() if key not in lens}


def check_camera(path: Path, camera_name: str | None) -> None:
    """See that a lens was calibrated with the camera that it is to be used with, where both names are known.

    Raises
    ------
    InputError
        It was another camera's.
    """
    theirs = read_about(path).get("camera_name")
    if isinstance(theirs, str) and camera_name is not None and theirs != camera_name:
        raise InputError(
            f"{path}: is the lens of another camera, {theirs[:60]!r}, and this one is {camera_name[:60]!r}; "
            "calibrate this one with host.calibrate camera"
        )


def _values(path: Path) -> dict[str, Any]:
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; 'python -m host.calibrate camera' writes one") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not text; it must be JSON in UTF-8") from error
    except json.JSONDecodeError as error:
        raise InputError(
            f"{path}: line {error.lineno}: not valid JSON ({error.msg}); correct it there"
        ) from error
    except (RecursionError, ValueError) as error:  # ValueError: a number of thousands of digits
        raise InputError(f"{path}: not a camera file; it must be one JSON object") from error
    if not isinstance(values, dict):
        raise InputError(f'{path}: must be one JSON object like {{"width": 320, "height": 240, ...}}')
    return values


def write_lens(path: Path, lens: Lens, about: dict[str, Any] | None = None) -> None:
    """Write a camera.json that `read_lens` gives back unchanged, with whatever else is to be known of it."""
    write_whole(path, (json.dumps({**asdict(lens), **(about or {})}, indent=1) + "\n").encode())


def _entry(path: Path, values: dict, key: str) -> object:
    if key not in values:
        undistorted = "[0, 0, 0, 0, 0] for undistorted images"
        remedy = undistorted if key == "distortion" else "the camera's calibration gives it"
        raise InputError(f'{path}: key "{key}" is missing; add it ({remedy})')
    return values[key]


def _number(path: Path, key: str, value: object, remedy: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not _finite(value):
        raise InputError(f'{path}: key "{key}": {json.dumps(value)[:40]} is not a finite number; {remedy}')
    return float(value)


def _finite(value: int | float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer of hundreds of digits
        return False


def _side(path: Path, values: dict, key: str) -> int:
    value = _entry(path, values, key)
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= LARGEST_SIDE_PX:
        raise InputError(
            f'{path}: key "{key}": {json.dumps(value)[:40]} is not an image side; '
            f"give whole pixels from 1 to {LARGEST_SIDE_PX}"
        )
    return value


def _focal(path: Path, values: dict, key: str, side_px: int) -> float:
    value = _number(path, key, _entry(path, values, key), "give the focal length in pixels")
    if value <= 0:
        raise InputError(f'{path}: key "{key}": {value:g} is not above 0; give the focal length in pixels')
    if not side_px / 50 <= value <= 1000 * side_px:
        raise InputError(
            f'{path}: key "{key}": {value:g} is no focal length for {side_px} px; give it in pixels'
        )
    return value


def _centre(path: Path, values: dict, key: str, side_px: int) -> float:
    value = _number(path, key, _entry(path, values, key), "give pixels")
    if abs(value) > 10 * side_px:
        raise InputError(
            f'{path}: key "{key}": {value:g} is far outside an image of {side_px} px; give pixels'
        )
    return value


def _distortion(path: Path, values: dict) -> tuple[float, ...]:
    value = _entry(path, values, "distortion")
    names = ", ".join(DISTORTION_TERMS)
    if not isinstance(value, list) or len(value) != len(DISTORTION_TERMS):
        raise InputError(f'{path}: key "distortion": must be a list of the five numbers {names}')
    terms = tuple(
        _number(path, f"distortion.{name}", term, f"give the five numbers {names}")
        for name, term in zip(DISTORTION_TERMS, value, strict=True)
    )
    for name, term in zip(DISTORTION_TERMS, terms, strict=True):
        if abs(term) > LARGEST_DISTORTION:
            raise InputError(
                f'{path}: key "distortion": {name} = {term:g} is beyond any lens; calibrate again'
            )
    return terms
