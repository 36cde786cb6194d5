"""Every way in which a sequence folder may be broken, with the words its message must hold."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np


class Fault(NamedTuple):
    """Break a sequence folder, and what must then be said of it."""

    apply: Callable[[Path], object]
    words: tuple[str, ...]


def camera(**changes: Any) -> Callable[[Path], object]:
    """Keys of camera.json set, or removed where the value is Ellipsis."""

    def apply(folder: Path) -> None:
        values = json.loads((folder / "camera.json").read_text()) | changes
        values = {key: value for key, value in values.items() if value is not ...}
        (folder / "camera.json").write_text(json.dumps(values))

    return apply


def text(name: str, content: str | bytes) -> Callable[[Path], object]:
    """A file of the folder replaced."""
    content = content.encode() if isinstance(content, str) else content
    return lambda folder: (folder / name).write_bytes(content)


def cell(line: int, column: str, value: str) -> Callable[[Path], object]:
    """One value of poses.csv replaced; the header is line 1."""

    def apply(folder: Path) -> None:
        rows = [row.split(",") for row in (folder / "poses.csv").read_text().split()]
        rows[line - 1][rows[0].index(column)] = value
        (folder / "poses.csv").write_text("\n".join(",".join(row) for row in rows) + "\n")

    return apply


def poses(change: Callable[[list[str]], list[str]]) -> Callable[[Path], object]:
    """The lines of poses.csv changed."""

    def apply(folder: Path) -> None:
        lines = (folder / "poses.csv").read_text().split()
        (folder / "poses.csv").write_text("\n".join(change(lines)))

    return apply


def without_column(name: str) -> Callable[[Path], object]:
    def change(lines: list[str]) -> list[str]:
        gone = lines[0].split(",").index(name)
        return [",".join(v for k, v in enumerate(line.split(",")) if k != gone) for line in lines]

    return poses(change)


def cut(name: str, keep: float) -> Callable[[Path], object]:
    """Only the first part of a file kept."""

    def apply(folder: Path) -> None:
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(content[: round(keep * len(content))])

    return apply


def flipped_bit(name: str) -> Callable[[Path], object]:
    def apply(folder: Path) -> None:
        content = bytearray((folder / name).read_bytes())
        content[len(content) // 2] ^= 0x10
        (folder / name).write_bytes(content)

    return apply


def half_jpeg_with_an_end(folder: Path) -> None:
    """What a decoder fills up with grey: half of the data, and then the end marker."""
    noise = np.random.default_rng(1).integers(0, 255, (72, 96, 3), np.uint8)
    content = cv2.imencode(".jpg", noise)[1].tobytes()
    (folder / "frames/002.jpg").write_bytes(content[: len(content) // 2] + b"\xff\xd9")


def other_size(folder: Path) -> None:
    cv2.imwrite(str(folder / "frames/003.jpg"), np.zeros((40, 50, 3), np.uint8))


HEADER = "frame,file,t_s,x_cm,y_cm,z_cm,qw,qx,qy,qz"
DIGITS = "9" * 5000

FAULTS: dict[str, Fault] = {
    "no camera.json": Fault(lambda f: (f / "camera.json").unlink(), ("camera.json", "no such file")),
    "camera.json is a folder": Fault(
        lambda f: ((f / "camera.json").unlink(), (f / "camera.json").mkdir()),
        ("camera.json", "cannot be read"),
    ),
    "camera.json is empty": Fault(text("camera.json", ""), ("camera.json", "line 1", "JSON")),
    "camera.json is cut": Fault(text("camera.json", '{\n"width": 96,\n'), ("camera.json", "line 3", "JSON")),
    "camera.json is binary": Fault(text("camera.json", b"\xff\xfe\x00"), ("camera.json", "UTF-8")),
    "camera.json is a list": Fault(text("camera.json", "[96, 72]"), ("camera.json", "object")),
    "camera.json is deep": Fault(text("camera.json", "[" * 100000), ("camera.json",)),
    "camera.json has an endless number": Fault(text("camera.json", DIGITS), ("camera.json",)),
    "no focal length": Fault(camera(fx=...), ("camera.json", '"fx"', "missing")),
    "no distortion": Fault(
        camera(distortion=...), ("camera.json", '"distortion"', "missing", "[0, 0, 0, 0, 0]")
    ),
    "negative focal length": Fault(camera(fy=-110.0), ("camera.json", '"fy"', "-110")),
    "zero focal length": Fault(camera(fx=0), ("camera.json", '"fx"')),
    "focal length is NaN": Fault(camera(fx=float("nan")), ("camera.json", '"fx"', "finite")),
    "focal length is endless": Fault(camera(fx=10**400), ("camera.json", '"fx"')),
    "centre is a text": Fault(camera(cx="47"), ("camera.json", '"cx"', '"47"')),
    "centre is null": Fault(camera(cy=None), ("camera.json", '"cy"', "null")),
    "width is a fraction": Fault(camera(width=95.5), ("camera.json", '"width"', "95.5")),
    "width is zero": Fault(camera(width=0), ("camera.json", '"width"')),
    "height is true": Fault(camera(height=True), ("camera.json", '"height"', "true")),
    "four distortion terms": Fault(camera(distortion=[0, 0, 0, 0]), ("camera.json", '"distortion"', "five")),
    "distortion is a text": Fault(camera(distortion=[0, "a", 0, 0, 0]), ("camera.json", "distortion.k2")),
    "no poses.csv": Fault(lambda f: (f / "poses.csv").unlink(), ("poses.csv", "no such file")),
    "poses.csv is empty": Fault(text("poses.csv", ""), ("poses.csv", "empty")),
    "poses.csv is binary": Fault(text("poses.csv", b"\x89PNG\xff\xff"), ("poses.csv", "UTF-8")),
    "poses.csv has a header alone": Fault(text("poses.csv", HEADER + "\n"), ("poses.csv", "no frames")),
    "poses.csv has an open quote": Fault(
        text("poses.csv", HEADER + '\n0,"frames/000.png,0,0,0,0,1,0,0,0\n'), ("poses.csv", "line 2")
    ),
    "one frame": Fault(poses(lambda lines: lines[:2]), ("only 1 frame", "motion")),
    "no qz column": Fault(without_column("qz"), ("poses.csv", "line 1", "qz")),
    "no header": Fault(poses(lambda lines: lines[1:]), ("poses.csv", "line 1", "header")),
    "a column twice": Fault(
        poses(lambda lines: [f"{line},{'t_s' if k == 0 else 0}" for k, line in enumerate(lines)]),
        ("poses.csv", "line 1", "t_s", "twice"),
    ),
    "a misspelt sigma": Fault(
        poses(lambda lines: [f"{line},{'sigma_z' if k == 0 else 0}" for k, line in enumerate(lines)]),
        ("poses.csv", "line 1", "sigma_z", "sigma_z_cm"),
    ),
    "a negative sigma": Fault(
        poses(lambda lines: [f"{line},{'sigma_z_cm' if k == 0 else -1}" for k, line in enumerate(lines)]),
        ("poses.csv", "line 2", "sigma_z_cm", "negative"),
    ),
    "a short line": Fault(
        poses(lambda lines: [*lines[:3], lines[3].rsplit(",", 1)[0], *lines[4:]]),
        ("poses.csv", "line 4", "9 values"),
    ),
    "a word for a number": Fault(cell(3, "x_cm", "left"), ("poses.csv", "line 3", "x_cm", "'left'")),
    "an empty number": Fault(cell(3, "t_s", ""), ("poses.csv", "line 3", "t_s")),
    "NaN for a number": Fault(cell(4, "z_cm", "nan"), ("poses.csv", "line 4", "z_cm", "nan")),
    "infinity for a number": Fault(cell(4, "qx", "-inf"), ("poses.csv", "line 4", "qx", "inf")),
    "a frame and a half": Fault(cell(2, "frame", "1.5"), ("poses.csv", "line 2", "frame", "1.5")),
    "a frame twice": Fault(cell(4, "frame", "1"), ("poses.csv", "line 4", "frame", "1 follows 1")),
    "frames out of order": Fault(
        poses(lambda lines: [lines[0], lines[2], lines[1], *lines[3:]]),
        ("poses.csv", "line 3", "0 follows 1"),
    ),
    "time stands still": Fault(cell(4, "t_s", "0.1"), ("poses.csv", "line 4", "t_s")),
    "a quaternion of zeros": Fault(cell(3, "qw", "0"), ("poses.csv", "line 3", "qw", "length 0")),
    "a quaternion too long": Fault(cell(3, "qy", "0.5"), ("poses.csv", "line 3", "length 1.118")),
    "no image named": Fault(cell(3, "file", ""), ("poses.csv", "line 3", "file")),
    "an image that is not there": Fault(cell(3, "file", "frames/9.png"), ("frames/9.png", "no such image")),
    "an image that is a folder": Fault(cell(3, "file", "frames"), ("frames", "cannot be read")),
    "an empty image": Fault(text("frames/001.png", b""), ("001.png", "empty")),
    "a text for an image": Fault(text("frames/001.png", "hello\n" * 50), ("001.png", "PNG", "JPEG")),
    "half a PNG": Fault(cut("frames/001.png", 0.5), ("001.png", "truncated")),
    "a PNG without its last bytes": Fault(cut("frames/001.png", 0.98), ("001.png", "truncated")),
    "a PNG with a wrong bit": Fault(flipped_bit("frames/001.png"), ("001.png", "damaged", "checksum")),
    "half a JPEG": Fault(cut("frames/002.jpg", 0.7), ("002.jpg", "truncated")),
    "the beginning of a JPEG": Fault(cut("frames/002.jpg", 0.01), ("002.jpg", "truncated")),
    "a JPEG that fills up with grey": Fault(half_jpeg_with_an_end, ("002.jpg", "damaged")),
    "an image of another size": Fault(other_size, ("003.jpg", "50x40", "96x72")),
}
