"""Pictures' times taken back to when they were exposed."""

from __future__ import annotations

from dataclasses import replace

from host.camera.frame import Frame, FrameSource


class Timely:
    """A camera that is known to stamp its pictures late; as a ``host.camera.frame.FrameSource`` itself.

    Parameters
    ----------
    camera
        Whose pictures they are.
    late_s
        From the exposure of a picture's middle row to its time.
    """

    def __init__(self, camera: FrameSource, late_s: float) -> None:
        self.lens = camera.lens
        self._camera, self._late_s = camera, late_s

    def read(self, timeout_s: float) -> Frame | None:
        """As the camera's own, with the time of exposure."""
        frame = self._camera.read(timeout_s)
        return None if frame is None else replace(frame, t_s=frame.t_s - self._late_s)

    def close(self) -> None:
        """Close the camera."""
        self._camera.close()
