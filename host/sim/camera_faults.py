"""A camera that fails for a while as real ones do: covered, blinded, out of focus, hung, late, gone."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import cv2
import numpy as np

from host.camera.frame import Frame, FrameSource
from host.errors import DeviceError
from host.link.clock import Clock

Kind = Literal["black", "white", "blurred", "frozen", "repeating", "late", "silent", "gone"]
KINDS: tuple[Kind, ...] = get_args(Kind)
BLUR_PX = 8.0  # standard deviation: what stood in focus cannot be told from its surroundings
DARK_NOISE = 3  # screen values below this are what a covered sensor delivers
REPEATED = 3  # last pictures, given out in turn by a driver whose buffers got stuck
SHORTEST_WAIT_S = 1e-4


@dataclass(frozen=True)
class CameraFault:
    """What goes wrong, and when by the clock: of pictures taken from `from_s` on and before `until_s`.

    ``black`` and ``white`` show nothing, ``blurred`` next to nothing. ``frozen`` repeats the last good
    picture and ``repeating`` the last three in turn, as if they were new: with new times and numbers.
    ``late`` ones tell their true time but come `late_s` after it. ``silent`` gives nothing within any
    timeout; ``gone`` fails at once, as a camera does that is unplugged.
    """

    kind: Kind
    from_s: float
    until_s: float
    late_s: float = 0.5

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"no camera fault {self.kind!r}; known are {', '.join(KINDS)}")


class FaultyCamera:
    """A camera that works but for its faults; a ``host.camera.frame.FrameSource``.

    Parameters
    ----------
    camera
        The one that works.
    clock
        That it goes by; of a simulation.
    faults
        The first that holds at a time is the one that counts.
    """

    def __init__(self, camera: FrameSource, clock: Clock, faults: Sequence[CameraFault]) -> None:
        self.lens = camera.lens
        self._camera, self._clock, self._faults = camera, clock, tuple(faults)
        self._good: deque[np.ndarray] = deque(maxlen=REPEATED)
        self._waiting: deque[Frame] = deque()  # late ones

    def read(self, timeout_s: float) -> Frame | None:
        """The newest frame, or what the fault makes of it; None at the end of the stream.

        Raises
        ------
        DeviceError
            No frame came within the timeout, or the camera is gone.
        """
        until_s = self._clock.now_s() + timeout_s
        while True:
            now_s = self._clock.now_s()
            fault = self._fault_at(now_s)
            if fault is not None and fault.kind == "gone":
                raise DeviceError("camera: stopped delivering; check its cable, then start again")
            if fault is not None and fault.kind == "silent":
                self._clock.sleep_s(min(until_s, fault.until_s) - now_s)
                left_s = until_s - self._clock.now_s()
                if left_s < SHORTEST_WAIT_S:
                    raise _nothing_within(timeout_s)
                continue
            frame = self._camera.read(max(until_s - now_s, 0.0))
            if frame is None:
                return None
            fault = self._fault_at(frame.t_s)
            if fault is not None and fault.kind in ("silent", "gone"):
                continue
            if fault is None or fault.kind != "late":
                self._waiting.clear()
                return self._spoilt(frame, fault)
            arrived = self._late(frame, fault)
            if arrived is not None:
                return arrived
            if until_s - self._clock.now_s() < SHORTEST_WAIT_S:
                raise _nothing_within(timeout_s)

    def close(self) -> None:
        """Close the camera."""
        self._camera.close()

    def _fault_at(self, t_s: float) -> CameraFault | None:
        return next((fault for fault in self._faults if fault.from_s <= t_s < fault.until_s), None)

    def _spoilt(self, frame: Frame, fault: CameraFault | None) -> Frame:
        if fault is None:
            self._good.append(frame.image)
            return frame
        shape = frame.image.shape
        frame = replace(frame, encoded=None)  # what came over the cable is not this
        if fault.kind == "black":
            return replace(frame, image=_dark(shape, frame.seq))
        if fault.kind == "white":
            return replace(frame, image=np.full(shape, 255, np.uint8))
        if fault.kind == "blurred":
            return replace(frame, image=cv2.GaussianBlur(frame.image, (0, 0), BLUR_PX))
        if not self._good:  # nothing to repeat yet
            self._good.append(frame.image)
        if fault.kind == "repeating":
            self._good.rotate(-1)
            return replace(frame, image=self._good[0])
        return replace(frame, image=self._good[-1])

    def _late(self, frame: Frame, fault: CameraFault) -> Frame | None:
        """The newest frame that is late enough to have come by now."""
        self._waiting.append(frame)
        now_s, arrived = self._clock.now_s(), None
        while self._waiting and self._waiting[0].t_s + fault.late_s <= now_s:
            arrived = self._waiting.popleft()
        return arrived


def _dark(shape: tuple[int, ...], seq: int) -> np.ndarray:
    return np.random.default_rng((0xDA4C, seq)).integers(0, DARK_NOISE, shape, np.uint8)


def _nothing_within(timeout_s: float) -> DeviceError:
    return DeviceError(f"camera: no picture within {timeout_s:g} s; check its cable")
