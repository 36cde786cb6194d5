"""A camera that runs by itself: a thread takes every picture, the reader gets the newest."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from host.camera.frame import Frame
from host.camera.jpeg import decode_jpeg, whole_jpeg
from host.camera.lens import Lens
from host.errors import DeviceError, RobotError

SPOILT_S = 0.2  # pictures that repeat or are damaged for so long, and no other: the camera has failed
REMEMBERED = 8  # pictures among which one that is sent again is found: as many as drivers have buffers
RESTART_S = 2.0  # of a camera that still fails, by opening it anew
REOPEN_PERIOD_S = 0.3
CLOSE_S = 1.5  # a camera that hangs lets its thread go after a second
BLANK_LEVELS = 3.0  # standard deviation of a picture with nothing in it, which may well come twice
BLANK_EVERY_PX = 16


class Shot(NamedTuple):
    """One picture as a camera hands it over."""

    picture: bytes | np.ndarray  # a JPEG, or BGR (H, W, 3) uint8
    t_s: float  # when it was taken, on the host's monotonic clock
    skipped: int = 0  # older ones thrown away unseen since the last


class Capture(Protocol):
    """An open camera."""

    def read(self) -> Shot | None:
        """The next picture, waited for; None where none comes any more."""
        ...

    def release(self) -> None: ...


class LiveCamera:
    """The newest picture of a camera that runs by itself, as a ``host.camera.frame.FrameSource``.

    A picture that comes again, bit for bit, is no new one: sensors are never still. One that is damaged is
    dropped. A camera that is gone, or does nothing else for a while, is opened again for as long as it takes.

    Parameters
    ----------
    capture
        The open camera.
    name
        For messages.
    lens
        Pictures must have its size; without one, that of the first.
    reopen
        Opens it anew; None where that cannot be.
    tell
        Hears in one line that it is back.

    Attributes
    ----------
    damaged, repeated : int
        Pictures that were dropped for it.
    """

    def __init__(
        self,
        capture: Capture,
        name: str,
        lens: Lens | None = None,
        reopen: Callable[[], Capture] | None = None,
        tell: Callable[[str], None] = lambda text: None,
    ) -> None:
        self.lens = lens
        self.damaged = self.repeated = 0
        self._capture, self._name = capture, name
        self._reopen, self._tell = reopen, tell
        self._size = None if lens is None else (lens.width, lens.height)
        self._news = threading.Condition()
        self._closed = threading.Event()
        self._frame: Frame | None = None
        self._given = -1
        self._seq = 0  # of the next picture
        self._recent: deque[int] = deque(maxlen=REMEMBERED)
        self._spoilt: str | None = None  # what is wrong with all pictures since the last good one
        self._good_s = time.monotonic()  # when that came
        self._gone: str | None = None
        self._thread = threading.Thread(target=self._run, name=f"camera {name}", daemon=True)
        self._thread.start()

    def await_first(self, timeout_s: float) -> None:
        """Wait for a picture, which the next `read` gives; DeviceError as `read`."""
        self.read(timeout_s)
        self._given = -1

    def read(self, timeout_s: float) -> Frame | None:
        """The newest frame, each given once; its number jumps where frames were dropped. Never None.

        Raises
        ------
        DeviceError
            No new frame came within the timeout; or the camera is known to fail, then at once.
        """
        with self._news:
            self._news.wait_for(lambda: self._fresh() or self._failure(), timeout_s)
            frame = self._fresh()
            if frame is not None:
                self._given = frame.seq
                return frame
            why = self._failure() or (
                f"no frame for {timeout_s:g} s; check its cable, and that no other program has it"
            )
        raise DeviceError(f"camera {self._name}: {why}")

    def close(self) -> None:
        """Let go of the camera."""
        self._closed.set()
        with self._news:
            self._news.notify_all()
        self._thread.join(timeout=CLOSE_S)

    def _fresh(self) -> Frame | None:
        return self._frame if self._frame is not None and self._frame.seq > self._given else None

    def _failure(self) -> str | None:
        if self._closed.is_set():
            return "was closed; open it again"
        if self._gone is not None:
            return self._gone
        return self._spoilt if time.monotonic() - self._good_s >= SPOILT_S else None

    # --- Its thread ----------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._closed.is_set():
            shot = self._capture.read()
            if shot is None:
                self._lose("stopped delivering; check its cable" + ("" if self._reopen else ", start again"))
            else:
                self._take(shot)
                failing = self._spoilt is not None and time.monotonic() - self._good_s > RESTART_S
                if not failing or self._reopen is None:
                    continue
            if self._reopen is None or not self._open_again(self._reopen):
                break
        self._capture.release()

    def _take(self, shot: Shot) -> None:
        """See whether it is a new picture and whole, and give it to whoever waits."""
        picture, encoded = shot.picture, None
        key = hash(picture if isinstance(picture, bytes) else picture.tobytes())
        again = key in self._recent
        self._recent.append(key)
        if again and not self._blank():
            self.repeated += 1
            self._spoil("the same pictures again and again: it hangs; pull its plug and put it back")
            return
        if isinstance(picture, bytes):
            encoded = whole_jpeg(picture)
            image = None if encoded is None else decode_jpeg(encoded)
        else:
            image = picture
        self._seq += shot.skipped + 1
        if image is None:
            self.damaged += 1
            self._spoil("damaged pictures; take a shorter cable or another socket")
            return
        size = (image.shape[1], image.shape[0])
        self._size = self._size or size
        if size != self._size:
            right = "the lens is for" if self.lens else "the first was"
            width, height = self._size
            self._spoil(f"{size[0]}x{size[1]} px, {right} {width}x{height}; set the camera to one size")
            return
        with self._news:
            if self._gone is not None:
                self._tell(f"camera {self._name}: delivers again")
            self._frame = Frame(image, shot.t_s, self._seq - 1, encoded)
            self._good_s, self._spoilt, self._gone = time.monotonic(), None, None
            self._news.notify_all()

    def _blank(self) -> bool:
        if self._frame is None:
            return False
        return float(self._frame.image[::BLANK_EVERY_PX, ::BLANK_EVERY_PX].std()) < BLANK_LEVELS

    def _spoil(self, what: str) -> None:
        with self._news:
            self._spoilt = what
            self._news.notify_all()

    def _lose(self, why: str) -> None:
        with self._news:
            self._gone = why
            self._news.notify_all()

    def _open_again(self, reopen: Callable[[], Capture]) -> bool:
        """Whether it could be, before the camera was closed."""
        self._capture.release()
        while not self._closed.wait(REOPEN_PERIOD_S):
            try:
                capture = reopen()
            except RobotError as error:
                self._lose(str(error).removeprefix(f"camera {self._name}: "))
                continue
            self._capture = capture
            self._recent.clear()
            self._good_s, self._spoilt = time.monotonic(), None
            return True
        return False
