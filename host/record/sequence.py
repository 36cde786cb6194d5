"""Sequence folders: camera.json, poses.csv and the images it names; every fault found at reading is named."""

from __future__ import annotations

import csv
import io
import math
import os
import shutil
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from host.camera.lens import Lens
from host.camera.lens_file import read_lens, write_lens
from host.errors import InputError, UsageError
from host.pose import Pose
from host.record.image_file import JPEG_SIGNATURE, encoded_size, image_size, read_image

COLUMNS = ("frame", "file", "t_s", "x_cm", "y_cm", "z_cm", "qw", "qx", "qy", "qz")
SIGMA_COLUMNS = ("sigma_z_cm", "sigma_rot_rad")
QUATERNION_TOLERANCE = 0.01  # files round to as few as three decimals
LARGEST_VALUE = 1e10  # of any pose column: 100,000 km, or 300 years


@dataclass(frozen=True)
class SequenceFrame:
    """One row of poses.csv."""

    number: int  # ascending, not always without gaps
    path: Path  # of the image
    pose: Pose  # camera to world, with its time; sigmas 0 where the file does not tell them


@dataclass(frozen=True)
class Sequence:
    """A sequence folder whose every file was found whole. Images are decoded when asked for."""

    folder: Path
    lens: Lens
    frames: tuple[SequenceFrame, ...]

    def image(self, index: int) -> np.ndarray:
        """The picture of ``frames[index]``, (H, W, 3) uint8, BGR.

        Raises
        ------
        InputError
            where its data turn out to be damaged, or the file changed since the sequence was read.
        """
        path = self.frames[index].path
        image = read_image(path)
        _check_size(path, (image.shape[1], image.shape[0]), self.lens)
        return image


def read_sequence(folder: Path, poses_file: Path | None = None) -> Sequence:
    """Read a sequence folder and check all of it but the compressed image data.

    Parameters
    ----------
    folder
        Holds camera.json, poses.csv and the images.
    poses_file
        Read instead of the folder's poses.csv. Image names in it are relative to `folder`.

    Raises
    ------
    InputError
        naming file, line or key, and remedy.
    """
    if not os.path.isdir(folder):  # Path.is_dir raises where a name is too long
        what = "is a file, not a sequence folder" if os.path.exists(folder) else "no such folder"
        raise InputError(f"{folder}: {what}; give a folder with camera.json, poses.csv and images")
    lens = read_lens(folder / "camera.json")
    frames = read_poses(folder / "poses.csv" if poses_file is None else poses_file, folder)
    for frame in frames:
        _check_size(frame.path, image_size(frame.path), lens)
    return Sequence(folder, lens, frames)


def read_poses(path: Path, folder: Path) -> tuple[SequenceFrame, ...]:
    """Read a poses.csv whose image names are relative to `folder`; the images are not looked at.

    Raises
    ------
    InputError
        naming line, column and remedy.
    """
    rows = _rows(path)
    if not rows:
        raise InputError(f"{path}: empty; its first line must be {','.join(COLUMNS)}")
    (_, header), body = rows[0], rows[1:]
    header = [name.strip() for name in header]
    _check_header(path, header)
    if not body:
        raise InputError(f"{path}: has no frames; add one line for each image")
    frames: list[SequenceFrame] = []
    for line, row in body:
        if len(row) != len(header):
            raise InputError(
                f"{path}: line {line}: {len(row)} values under {len(header)} columns; give one value for each"
            )
        frame = _frame(path, folder, line, dict(zip(header, row, strict=True)))
        if frames and frame.number <= frames[-1].number:
            raise InputError(
                f"{path}: line {line}, column frame: {frame.number} follows {frames[-1].number}; "
                f"sort the lines by frame and give each frame once"
            )
        if frames and frame.pose.t_s <= frames[-1].pose.t_s:
            raise InputError(
                f"{path}: line {line}, column t_s: {frame.pose.t_s} s is not after {frames[-1].pose.t_s} s "
                f"of the frame before; time must go forward"
            )
        frames.append(frame)
    return tuple(frames)


def write_sequence(folder: Path, lens: Lens, frames: Iterable[tuple[np.ndarray | bytes, Pose]]) -> None:
    """Write a sequence folder, with lossless images, that `read_sequence` reads.

    Parameters
    ----------
    folder
        Must not exist yet, or be empty. It appears only once all of it is written.
    frames
        Images (H, W, 3) uint8 BGR of the lens's size, each with its pose and time; or, to be kept as they
        are, the bytes of PNG or JPEG files.

    Raises
    ------
    UsageError
        where something is in the folder already or it cannot be written.
    InputError
        where an image has another size than the lens, or there is none.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"{folder}: exists already; choose a new folder or empty this one")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        draft = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}."))
    except OSError as error:
        raise UsageError(f"{folder}: cannot be written ({error.strerror}); choose another place") from error
    try:
        (draft / "frames").mkdir()
        text = io.StringIO()
        table = csv.writer(text, lineterminator="\n")
        table.writerow(COLUMNS + SIGMA_COLUMNS)
        number = -1
        for number, (image, pose) in enumerate(frames):
            name, size, content = _encoded(folder, number, image)
            _check_size(folder / name, size, lens)
            (draft / name).write_bytes(content)
            table.writerow([number, name, *_pose_values(pose)])
        if number < 0:
            raise InputError(f"{folder}: there are no frames to write; record at least one")
        (draft / "poses.csv").write_text(text.getvalue(), encoding="utf-8")
        write_lens(draft / "camera.json", lens)
        draft.chmod(0o755)  # mkdtemp makes folders that only their owner can enter
        draft.replace(folder)
    except OSError as error:
        raise UsageError(f"{folder}: cannot be written ({error.strerror}); choose another place") from error
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _encoded(folder: Path, number: int, image: np.ndarray | bytes) -> tuple[str, tuple[int, int], bytes]:
    """Name, size in pixels and content of a picture's file."""
    if not isinstance(image, bytes):
        size = image.shape[1], image.shape[0]
        return f"frames/{number:06d}.png", size, cv2.imencode(".png", image)[1].tobytes()
    name = f"frames/{number:06d}.{'jpg' if image.startswith(JPEG_SIGNATURE) else 'png'}"
    return name, encoded_size(folder / name, image), image


def rotation_of_quaternion(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrix (3, 3) of a unit quaternion (w, x, y, z)."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_of_rotation(rotation: np.ndarray) -> np.ndarray:
    """Unit quaternion (w, x, y, z), w >= 0, of a rotation matrix (3, 3)."""
    r = np.asarray(rotation, float)
    # Four times the outer product of the quaternion with itself; its longest row is well conditioned.
    outer = np.array(
        [
            [1 + r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], 1 + r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
            [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 1 - r[0, 0] + r[1, 1] - r[2, 2], r[1, 2] + r[2, 1]],
            [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1 - r[0, 0] - r[1, 1] + r[2, 2]],
        ]
    )
    longest = outer[np.argmax(np.diag(outer))]
    quaternion = longest / np.linalg.norm(longest)
    return -quaternion if quaternion[0] < 0 else quaternion


def _check_size(path: Path, size: tuple[int, int], lens: Lens) -> None:
    if size != (lens.width, lens.height):
        raise InputError(
            f"{path}: image of {size[0]}x{size[1]} px, but camera.json says {lens.width}x{lens.height}; "
            f"use the camera.json made for this size"
        )


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Line number and fields of every line that is not blank."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; give one with the columns {','.join(COLUMNS)}") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not text; it must be CSV in UTF-8") from error
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    rows = []
    try:
        for row in reader:
            if any(field.strip() for field in row):
                rows.append((reader.line_num, row))
    except csv.Error as error:
        raise InputError(f"{path}: line {reader.line_num}: not CSV ({error}); correct it there") from error
    return rows


def _check_header(path: Path, header: list[str]) -> None:
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        raise InputError(
            f"{path}: line 1: column {', '.join(missing)} is missing; the header must be {','.join(COLUMNS)}"
        )
    twice = sorted({name for name in header if header.count(name) > 1})
    if twice:
        raise InputError(f"{path}: line 1: column {', '.join(twice)} appears twice; keep one of them")
    for name in header:
        # Columns of other programs are left alone, but a misspelt sigma must not be silently without effect.
        if name.startswith("sigma") and name not in SIGMA_COLUMNS:
            raise InputError(
                f"{path}: line 1: unknown column {name}; the sigma columns are {' and '.join(SIGMA_COLUMNS)}"
            )


def _frame(path: Path, folder: Path, line: int, row: dict[str, str]) -> SequenceFrame:
    def number(column: str) -> float:
        try:
            value = float(row[column])
        except ValueError as error:
            raise InputError(
                f"{path}: line {line}, column {column}: {row[column]!r} is not a number; give a decimal"
            ) from error
        if not math.isfinite(value):
            raise InputError(f"{path}: line {line}, column {column}: {value} is not finite; give a number")
        if abs(value) > LARGEST_VALUE:
            raise InputError(f"{path}: line {line}, column {column}: {value:g} is beyond {LARGEST_VALUE:g}")
        return value

    frame = number("frame")
    if frame != int(frame) or frame < 0:
        raise InputError(f"{path}: line {line}, column frame: {row['frame']!r} is not a whole number >= 0")
    name = row["file"].strip()
    if not name or "\0" in name:
        raise InputError(f"{path}: line {line}, column file: names no image; give its path in {folder}")
    quaternion = np.array([number(column) for column in ("qw", "qx", "qy", "qz")])
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1) > QUATERNION_TOLERANCE:
        raise InputError(
            f"{path}: line {line}, columns qw to qz: a quaternion of length {length:.4g} "
            f"is no rotation; scale it to 1"
        )
    sigmas = {column: number(column) for column in SIGMA_COLUMNS if column in row}
    for column, value in sigmas.items():
        if value < 0:
            raise InputError(f"{path}: line {line}, column {column}: {value:g} is negative; a sigma is not")
    pose = Pose(
        rotation=rotation_of_quaternion(quaternion / length),
        position_cm=np.array([number(column) for column in ("x_cm", "y_cm", "z_cm")]),
        t_s=number("t_s"),
        **sigmas,
    )
    return SequenceFrame(int(frame), folder / name, pose)


def _pose_values(pose: Pose) -> list[str]:
    numbers = [
        pose.t_s,
        *pose.position_cm,
        *quaternion_of_rotation(pose.rotation),
        pose.sigma_z_cm,
        pose.sigma_rot_rad,
    ]
    return [repr(float(value)) for value in numbers]
