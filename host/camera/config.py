"""What a user may want of a webcam."""

from __future__ import annotations

from dataclasses import dataclass

from host.ranges import check_ranges

RANGES = {
    "width": (16, 20000),
    "height": (16, 20000),
    "fps": (1.0, 1000.0),
    "exposure": (0, 100000),
    "focus": (0, 100000),
    "late_s": (-0.1, 0.3),
}


@dataclass(frozen=True)
class WebcamConfig:
    """What a webcam is asked for. Other cameras are as they are."""

    width: int = 640
    """pixels; with a calibrated lens its size is asked for instead"""
    height: int = 480  # pixels; the same
    fps: float = 30.0  # pictures a second
    lock: bool = True
    """hold exposure, white balance, gain and focus still, as measuring by colour and size needs it"""
    exposure: int = 0
    """to lock it at, in the camera's own units, often 0.1 ms; 0: as bright as automatic exposure is"""

    focus: int = 0
    """to hold it at, in the camera's own units; 0 is far on most; a lens is calibrated at one of them"""

    late_s: float = 0.0
    """by how much pictures are stamped later than they are exposed; host.calibrate delay measures it"""

    def __post_init__(self) -> None:
        check_ranges(self, RANGES)
