"""One image's regions: found, drawn and told as JSON; `python -m host.measure --still` calls this.

The net is made for the cameras of robots: a photograph larger than LARGEST_PX is shrunk to that first.
"""

from __future__ import annotations

import json
import os
from math import ceil
from pathlib import Path
from typing import Any

import cv2

from host.errors import InputError
from host.rbdn import Net, NetConfig, Region, Snapshot
from host.rbdn.net import SMALLEST_IMAGE_PX
from host.record.atomic import check_writable, write_whole
from host.record.image_file import read_image
from host.view.net_picture import draw_regions

LARGEST_PX = 1280  # longer side: a photograph's edges are too soft for its many pixels


def run_still(path: Path, folder: Path, config: NetConfig) -> None:
    """Write ``NAME_net.png`` and ``NAME_net.json`` into a folder and print what was found.

    Raises
    ------
    InputError
        where the image is missing, damaged or too small.
    UsageError
        where the folder cannot be written.
    """
    if not os.path.isfile(path):  # Path.is_file raises where a name is too long
        hint = "is a folder; give an image, or leave out --still to measure a sequence"
        raise InputError(f"{path}: {hint if os.path.isdir(path) else 'no such image; check its name'}")
    image = read_image(path)
    picture, result = (folder / f"{path.stem}_net.{kind}" for kind in ("png", "json"))
    for target in (picture, result):
        check_writable(target, folder=False)
    height, width = image.shape[:2]
    shrink = max(1.0, max(width, height) / LARGEST_PX)
    if min(width, height) / shrink < SMALLEST_IMAGE_PX:
        raise InputError(
            f"{path}: image of {width}x{height} px is too small for the net: give at least "
            f"{ceil(SMALLEST_IMAGE_PX * shrink)} px a side"
        )
    if shrink > 1.0:
        image = cv2.resize(image, None, fx=1 / shrink, fy=1 / shrink, interpolation=cv2.INTER_AREA)
    snapshot = Net(config).track(image)
    _, png = cv2.imencode(".png", draw_regions(image, snapshot, f"{path.name}   {width}x{height} px"))
    write_whole(picture, png.tobytes())
    write_whole(result, (json.dumps(still_dict(path.name, width, height, shrink, snapshot)) + "\n").encode())
    took_ms = snapshot.net_ms + snapshot.refine_ms
    written = f"{picture}, {result}".encode("utf-8", "replace").decode()  # a file's name may be no UTF-8
    print(f"{len(snapshot.regions)} regions in {took_ms:.0f} ms: {written}")
    for limit in snapshot.limits:
        print(limit)


def still_dict(name: str, width_px: int, height_px: int, shrink: float, snapshot: Snapshot) -> dict[str, Any]:
    """The JSON of a still, in pixels of the file: integer = pixel centre, x right, y down.

    Parameters
    ----------
    shrink
        How many times smaller the image was that `snapshot` is of.
    """
    return {
        "image": name,
        "width": width_px,
        "height": height_px,
        "shrink": shrink,
        "time_ms": {"net": snapshot.net_ms, "refine": snapshot.refine_ms},
        "limits": list(snapshot.limits),
        "regions": [_region_dict(region, shrink) for region in snapshot.regions],
    }


def _region_dict(region: Region, shrink: float) -> dict[str, Any]:
    return {
        "id": region.id,
        "area_px": region.area_px * shrink**2,
        "sigma_area_px": region.sigma_area_px * shrink**2,
        "touches_border": region.touches_border,
        "mean_rgb": list(region.mean_rgb),
        "loops": [((loop + 0.5) * shrink - 0.5).tolist() for loop in region.loops],
    }
