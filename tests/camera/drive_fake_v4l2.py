"""Opens the fake camera as a webcam, makes it hang and go away, and prints what came of it as JSON."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

from host.camera.config import WebcamConfig
from host.camera.live import LiveCamera
from host.camera.source import open_camera
from host.camera.v4l2 import Driver
from host.errors import DeviceError


def until_failed(camera: LiveCamera, word: str) -> float:
    """Seconds until it says so."""
    began_s = time.monotonic()
    while True:
        try:
            camera.read(0.05)
        except DeviceError as error:
            if word in str(error):
                return time.monotonic() - began_s


def until_back(camera: LiveCamera) -> None:
    while True:
        try:
            camera.read(0.05)
            return
        except DeviceError:
            time.sleep(0.02)


def main(device: str, pictures: Path) -> None:
    told: list[str] = []
    files = {(pictures / f"{k}.jpg").read_bytes(): k for k in range(40)}
    camera = open_camera(device, None, WebcamConfig(width=800, height=600, fps=60), told.append)
    assert isinstance(camera, LiveCamera)
    ages_s, numbers, shapes = [], [], set()
    for _ in range(8):
        frame = camera.read(2.0)
        assert frame is not None and frame.encoded is not None
        ages_s.append(time.monotonic() - frame.t_s)
        numbers.append(files.get(frame.encoded))
        shapes.add(frame.image.shape)
    with Driver(Path(device)) as driver:
        name, modes = driver.card(), [str(mode) for mode in driver.modes()]
        controls = {control.name: driver.get(control) for control in driver.controls().values()}
    (pictures / "hang").touch()
    silent_s = until_failed(camera, "no frame")
    hung_s = until_failed(camera, "stopped delivering")
    (pictures / "gone").touch()
    (pictures / "hang").unlink()
    absent_s = until_failed(camera, "does not open as a camera")
    (pictures / "gone").unlink()
    until_back(camera)
    camera.close()
    result = {
        "ages_s": ages_s, "numbers": numbers, "shapes": list(shapes), "damaged": camera.damaged,
        "name": name, "modes": modes, "controls": controls, "silent_s": silent_s, "hung_s": hung_s,
        "absent_s": absent_s, "told": told,
    }  # fmt: skip
    print(json.dumps(result))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
