"""Cameras that fail: what comes of them, when, and that they work again afterwards."""

from __future__ import annotations

import numpy as np
import pytest

from host.camera.frame import Frame
from host.camera.lens import Lens
from host.errors import DeviceError
from host.sim.camera_faults import KINDS, CameraFault, FaultyCamera, Kind

FPS = 10.0
EPS_S = 1e-9


class FakeClock:
    def __init__(self) -> None:
        self.t_s = 0.0

    def now_s(self) -> float:
        return self.t_s

    def sleep_s(self, duration_s: float) -> None:
        self.t_s += max(duration_s, 0.0)


class SteadyCamera:
    """Ten pictures a second, each of another texture, there as soon as they are taken."""

    def __init__(self, clock: FakeClock) -> None:
        self.lens: Lens | None = None
        self._clock, self._last = clock, -1

    def read(self, timeout_s: float) -> Frame | None:
        seq = max(self._last + 1, int(self._clock.t_s * FPS + EPS_S))
        if seq / FPS > self._clock.t_s + timeout_s + EPS_S:
            self._clock.t_s += timeout_s
            raise DeviceError("nothing")
        self._clock.t_s = max(self._clock.t_s, seq / FPS)
        self._last = seq
        return Frame(texture(seq), seq / FPS, seq)

    def close(self) -> None:
        self._last = 10**9


def texture(seq: int) -> np.ndarray:
    return np.random.default_rng(seq).integers(0, 256, (60, 80, 3), np.uint8)


def watch(
    *faults: CameraFault, for_s: float, timeout_s: float = 0.3
) -> list[tuple[float, Frame | DeviceError]]:
    """All that comes of a camera, and when."""
    clock = FakeClock()
    camera = FaultyCamera(SteadyCamera(clock), clock, faults)
    seen: list[tuple[float, Frame | DeviceError]] = []
    while clock.t_s < for_s:
        try:
            frame = camera.read(timeout_s)
            assert frame is not None
            seen.append((clock.t_s, frame))
        except DeviceError as error:
            seen.append((clock.t_s, error))
            if clock.t_s == seen[-2][0]:
                clock.t_s += 0.05  # a program that fails at once has to wait by itself
    return seen


def images(kind: Kind) -> list[np.ndarray]:
    """The pictures taken from 1 s on until 2 s under a fault that lasts as long."""
    seen = watch(CameraFault(kind, 1.0, 2.0), for_s=3.0)
    frames = [frame for _, frame in seen if isinstance(frame, Frame)]
    assert [f.seq for f in frames] == list(range(len(frames))) and frames[-1].t_s >= 2.9
    for frame in frames:
        if not 1.0 <= frame.t_s < 2.0:
            assert (frame.image == texture(frame.seq)).all()
    return [f.image for f in frames if 1.0 <= f.t_s < 2.0]


def test_a_covered_camera_is_black_with_a_little_noise_of_its_own() -> None:
    dark = images("black")
    assert len(dark) == 10 and max(image.max() for image in dark) < 4
    assert (dark[0] != dark[1]).any()


def test_a_blinded_camera_is_white() -> None:
    assert all((image == 255).all() for image in images("white"))


def test_a_blurred_camera_shows_next_to_nothing_of_what_is_there() -> None:
    assert all(0 < image.std() < 0.1 * texture(0).std() for image in images("blurred"))


def test_a_frozen_camera_shows_its_last_good_picture_as_if_it_were_new() -> None:
    assert all((image == texture(9)).all() for image in images("frozen"))


def test_a_repeating_camera_shows_its_last_three_good_pictures_in_turn() -> None:
    found = [next(k for k in range(10) if (texture(k) == image).all()) for image in images("repeating")]
    assert sorted(found[:3]) == [7, 8, 9] and found[3:6] == found[:3] == found[6:9]


def test_a_camera_that_hangs_before_its_first_picture_hangs_on_the_first() -> None:
    seen = watch(CameraFault("frozen", 0.0, 1.0), for_s=0.8)
    assert all(isinstance(frame, Frame) and (frame.image == texture(0)).all() for _, frame in seen)


def test_late_pictures_tell_their_true_time_and_come_later_after_a_gap() -> None:
    seen = watch(CameraFault("late", 1.0, 2.0, late_s=0.5), for_s=3.0)
    frames = [(t_s, frame) for t_s, frame in seen if isinstance(frame, Frame)]
    late = [(t_s, f) for t_s, f in frames if 1.0 <= f.t_s < 2.0]
    assert late and all(t_s - f.t_s == pytest.approx(0.5) for t_s, f in late)
    assert all((f.image == texture(f.seq)).all() for _, f in frames)
    assert any(isinstance(error, DeviceError) for t_s, error in seen if 1.0 < t_s < 1.5)
    times = [f.t_s for _, f in frames]
    assert times == sorted(set(times))
    assert all(t_s == pytest.approx(f.t_s) for t_s, f in frames if f.t_s >= 2.0)


def test_a_silent_camera_lets_every_timeout_pass() -> None:
    seen = watch(CameraFault("silent", 1.0, 2.0), for_s=3.0, timeout_s=0.3)
    errors = [t_s for t_s, error in seen if isinstance(error, DeviceError)]
    assert errors == pytest.approx([1.2, 1.5, 1.8])
    assert next(t_s for t_s, frame in seen if t_s > 1.8 and isinstance(frame, Frame)) == pytest.approx(2.0)


def test_a_camera_that_is_gone_fails_at_once_until_it_is_back() -> None:
    seen = watch(CameraFault("gone", 1.0, 2.0), for_s=3.0)
    errors = [t_s for t_s, error in seen if isinstance(error, DeviceError)]
    assert len(errors) > 10 and min(errors) > 0.9 and max(errors) < 2.0
    assert isinstance(seen[-1][1], Frame)


def test_the_first_fault_that_holds_counts() -> None:
    seen = watch(CameraFault("white", 0.5, 1.0), CameraFault("black", 0.0, 2.0), for_s=1.5)
    white = [f.t_s for _, f in seen if isinstance(f, Frame) and (f.image == 255).all()]
    assert white == pytest.approx([0.5, 0.6, 0.7, 0.8, 0.9])


@pytest.mark.parametrize("kind", KINDS)
def test_a_faulty_camera_is_closed_with_the_one_within(kind: Kind) -> None:
    clock = FakeClock()
    camera = FaultyCamera(SteadyCamera(clock), clock, [CameraFault(kind, 5.0, 6.0)])
    camera.close()
    with pytest.raises(DeviceError):
        camera.read(0.1)


def test_a_fault_of_no_known_kind_is_refused() -> None:
    with pytest.raises(ValueError, match="no camera fault 'dirty'; known are black"):
        CameraFault("dirty", 0.0, 1.0)  # type: ignore[arg-type]
