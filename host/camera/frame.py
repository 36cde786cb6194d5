"""One picture from a camera, with the time it was taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from host.camera.lens import Lens


@dataclass(frozen=True)
class Frame:
    """A captured image. Never written to after capture."""

    image: np.ndarray  # (H, W, 3) uint8, BGR as OpenCV has it
    t_s: float  # capture time on the host's clock
    seq: int  # counts every frame the camera took, also those dropped
    encoded: bytes | None = None  # the camera's own JPEG, of which image is exactly what cv2.imdecode makes


class FrameSource(Protocol):
    """Where frames come from: webcam, file, folder or simulator."""

    lens: Lens | None  # None where nothing is known of the lens

    def read(self, timeout_s: float) -> Frame | None:
        """The newest frame not yet read; None at the end of the stream.

        Raises
        ------
        DeviceError
            when no frame came within the timeout.
        """
        ...

    def close(self) -> None: ...
