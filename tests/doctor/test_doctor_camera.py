"""A camera with each of its faults: what the doctor says of it, and the remedy."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest

from host.camera.frame import Frame
from host.doctor import camera as checks
from host.doctor.camera import Taken, check_pictures, take_pictures
from host.doctor.finding import Finding, Outcome
from host.errors import DeviceError
from host.sim.camera_faults import CameraFault, FaultyCamera
from host.sim.session import Simulation


@dataclass
class Clock:
    """Time that passes when told to."""

    t_s: float = 0.0

    def now_s(self) -> float:
        return self.t_s

    def sleep_s(self, duration_s: float) -> None:
        self.t_s += max(duration_s, 0.0)


class Played:
    """Pictures taken before, each at its time; a FrameSource."""

    lens = None

    def __init__(self, frames: list[Frame], clock: Clock) -> None:
        self._frames, self._clock = frames, clock
        self._next = 0

    def read(self, timeout_s: float) -> Frame | None:
        if self._next == len(self._frames):
            return None
        frame = self._frames[self._next]
        if frame.t_s > self._clock.t_s + timeout_s:
            self._clock.t_s += timeout_s
            raise DeviceError("camera: no picture; check its cable")
        self._clock.t_s = max(self._clock.t_s, frame.t_s)
        self._next += 1
        return frame

    def close(self) -> None:
        """Nothing to close."""


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    """What a simulated webcam delivers in a second, three times over with other noise."""
    camera = Simulation("sim:room?seed=1").camera
    seen = [camera.read(1.0) for _ in range(15)]
    chance = np.random.default_rng(1)
    out = []
    for k in range(45):
        base = seen[k % 15]
        assert base is not None
        noise = chance.integers(-1, 2, base.image.shape, np.int16)
        out.append(Frame(np.clip(base.image + noise, 0, 255).astype(np.uint8), k / 15, k))
    return out


def findings(frames: list[Frame], *faults: CameraFault, live: bool = True) -> dict[str, Finding]:
    clock = Clock()
    taken, ended = take_pictures(FaultyCamera(Played(frames, clock), clock, faults), clock)
    return {f.name: f for f in check_pictures(taken, ended, live)}


def test_a_good_camera_passes_every_check(frames):
    found = findings(frames)
    assert {f.outcome for f in found.values()} == {Outcome.OK}
    assert set(found) == {"pictures", "rate", "times", "light", "news", "exposure", "sharpness"}
    assert "320x240" in found["pictures"].told and "15.0 a second" in found["rate"].told


@pytest.mark.parametrize(
    ("kind", "name", "outcome", "told", "fix"),
    [
        ("black", "light", "FAIL", "black", "lens cap"),
        ("white", "light", "FAIL", "one even colour", "less light"),
        ("blurred", "sharpness", "warn", "hardly any sharp edge", "focus the lens"),
        ("frozen", "news", "FAIL", "all pictures are the same", "unplug the camera"),
        ("repeating", "news", "FAIL", "seen before", "unplug the camera"),
        ("silent", "pictures", "FAIL", "no picture within", "check its cable"),
        ("gone", "pictures", "FAIL", "stopped delivering", "check its cable"),
        ("late", "times", "FAIL", "533 ms old", "USB port"),
    ],
)
def test_every_fault_of_a_camera_is_told_with_its_remedy(frames, kind, name, outcome, told, fix):
    found = findings(frames, CameraFault(kind, 0.3 if kind == "repeating" else 0.0, 100.0))[name]
    assert found.outcome == outcome
    assert told in found.told and fix in found.fix


@pytest.mark.parametrize("kind", ["silent", "gone"])
def test_a_camera_that_dies_while_it_is_watched_is_told_though_it_gave_pictures(frames, kind):
    found = findings(frames, CameraFault(kind, 1.0, 100.0))
    assert found["pictures"].outcome == Outcome.FAIL and found["light"].outcome == Outcome.OK


def test_a_camera_that_sets_its_own_exposure_gets_the_command_that_locks_it(frames):
    brighter = [
        replace(f, image=np.minimum(f.image * (1 + 0.1 * f.t_s), 255).astype(np.uint8)) for f in frames
    ]
    found = findings(brighter)["exposure"]
    assert found.outcome == Outcome.WARN
    assert "brightness changes by" in found.told and "v4l2-ctl" in found.fix


def test_a_picture_burnt_out_by_a_window_is_told(frames):
    def glaring(image: np.ndarray) -> np.ndarray:
        out = image.copy()
        out[:, : image.shape[1] // 2] = 255
        return out

    found = findings([replace(f, image=glaring(f.image)) for f in frames])["light"]
    assert found.outcome == Outcome.WARN and "white" in found.told and "exposure" in found.fix


def test_a_slow_camera_and_one_with_gaps_are_told_apart(frames):
    slow = findings([replace(f, t_s=0.2 * f.seq) for f in frames])["rate"]
    assert slow.outcome == Outcome.WARN and "5.0 a second" in slow.told and "light" in slow.fix
    gap = findings(
        [replace(f, t_s=f.t_s + 0.5 * (f.seq > 10), seq=f.seq + 7 * (f.seq > 10)) for f in frames]
    )["rate"]
    assert gap.outcome == Outcome.FAIL and "7 dropped" in gap.told and "USB port" in gap.fix


def at(t_s: float, got_s: float, seq: int) -> Taken:
    return Taken(Frame(np.zeros((2, 2, 3), np.uint8), t_s, seq), got_s)


@pytest.mark.parametrize(
    ("times_s", "outcome", "told"),
    [
        ([(0.0, 0.01), (0.1, 0.11), (0.2, 0.21)], "ok", "10 ms old"),
        ([(0.0, 0.01), (0.0, 0.11), (0.2, 0.21)], "FAIL", "not after that of the one before"),
        ([(0.1, 0.0), (0.2, 0.1), (0.3, 0.2)], "FAIL", "before they are taken"),
        ([(0.0, 0.5), (0.1, 0.6), (0.2, 0.7)], "FAIL", "500 ms old"),
        ([(0.0, 0.01), (0.1, 0.26), (0.2, 0.27)], "warn", "to within 150 ms"),
    ],
)
def test_times_that_cannot_be_true_are_told(times_s, outcome, told):
    found = checks.check_times([at(t_s, got_s, k) for k, (t_s, got_s) in enumerate(times_s)])
    assert found.outcome == outcome and told in found.told and (outcome == "ok" or found.fix)


def test_what_was_said_while_the_camera_was_opened_is_told_with_its_remedy():
    said = "camera 0: gives 640x480 px, not 1280x720; it offers MJPG 640x480: set webcam.width"
    (found,) = checks.check_driver([said, said])
    assert found.outcome == Outcome.WARN
    assert found.told == "camera 0: gives 640x480 px, not 1280x720" and "set webcam.width" in found.fix
    (found,) = checks.check_driver([])
    assert found.outcome == Outcome.OK


def test_pictures_from_files_are_not_asked_for_their_times(frames):
    same = [replace(frames[0], t_s=k / 15, seq=k) for k in range(8)]
    found = findings(same, live=False)
    assert "rate" not in found and "news" not in found
    assert {f.outcome for f in found.values()} == {Outcome.OK}


def test_a_source_without_pictures_and_one_with_few_are_told():
    assert "none came" in findings([])["pictures"].told
    image = cv2.resize(np.eye(24, dtype=np.uint8) * 255, (320, 240))
    few = findings([Frame(cv2.merge([image] * 3), 0.1 * k, k) for k in range(3)])
    assert few["exposure"].outcome == Outcome.UNTRIED and "3 came" in few["exposure"].told
