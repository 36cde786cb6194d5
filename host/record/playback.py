"""A recording as a camera: its pictures once more, each given once, with the times they had."""

from __future__ import annotations

import sys
from pathlib import Path

from host.camera.frame import Frame
from host.camera.lens import Lens
from host.record.mcap_reader import Recording


class PlayedCamera:
    """The pictures of a recording, a ``host.camera.frame.FrameSource``; never waits, drops none.

    Also those come that were refused live. Their numbers are the live camera's, so that what it dropped can
    be told; the lens is the recording's.

    Raises
    ------
    InputError
        There is no such file, it is damaged or no recording.
    """

    def __init__(self, path: Path) -> None:
        recording = Recording(path)
        if recording.note is not None:
            print(recording.note, file=sys.stderr)
        self.lens: Lens | None = recording.lens
        self._frames = recording.frames()

    def read(self, timeout_s: float) -> Frame | None:
        """The next picture; None after the last.

        Raises
        ------
        InputError
            A picture cannot be decoded.
        """
        recorded = next(self._frames, None)
        return None if recorded is None else recorded.frame()

    def close(self) -> None:
        """No more pictures from here."""
        self._frames = iter(())
