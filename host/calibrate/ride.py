"""A robot driven through a few motions, with every picture on the way and what the wheels told of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from host.calibrate.paths import Path, WheelTrace
from host.calibrate.tape import PersonWithTape
from host.calibrate.umbmark import Sizes
from host.camera.lens import Lens
from host.errors import DeviceError
from host.link.explain import FAULTS
from host.link.protocol import NO_EDGE_US, State
from host.nav.config import BodyConfig
from host.nav.rig import Rig

PICTURE_S = 0.07  # without a new picture for so long the robot is told again what to do: it stops by itself
GONE_S = 2.0  # without a picture for so long there is no camera
SETTLE_S = 0.5
READY_S = 5.0


@dataclass(frozen=True)
class Drive:
    """The robot drives like this for so long, or until it has turned to a heading or come so far."""

    v_mm_s: float
    omega_rad_s: float
    lasts_s: float  # at most
    heading_rad: float | None = None  # by the wheels, to the right of where the ride began
    way_mm: float | None = None  # of the axle's middle, from where the ride began

    def over(self, heading_rad: float, way_mm: float) -> bool:
        """Is the robot where it was to get to?"""
        if self.heading_rad is not None:
            return (heading_rad - self.heading_rad) * self.omega_rad_s >= 0.0
        return self.way_mm is not None and (way_mm - self.way_mm) * self.v_mm_s >= 0.0


@dataclass(frozen=True)
class Picture:
    """One picture of the ride."""

    t_s: float  # as the camera stamped it
    gray: np.ndarray  # (H, W) uint8
    part: int  # number of the motion it was taken in


@dataclass(frozen=True)
class Ride:
    """What was seen and what the wheels told, on one clock."""

    lens: Lens
    pictures: list[Picture]
    wheels: Path


def sizes_of(body: BodyConfig) -> Sizes:
    """Wheels and track as they are configured."""
    um, ratio = 1e4 * body.cm_per_count, body.wheel_ratio
    return Sizes(2 * um * ratio / (1 + ratio), 2 * um / (1 + ratio), 1e4 * body.track_cm)


def ride(rig: Rig, motions: Sequence[Drive], sizes: Sizes, what: str) -> Ride:
    """Drive these motions one after the other, from rest to rest.

    Parameters
    ----------
    sizes
        Of wheels and track, to know when a motion is over.
    what
        Said to a person, who then presses Enter; a simulated robot needs nobody.

    Raises
    ------
    DeviceError
        The robot stops itself, or camera or robot are gone.
    """
    _await_ready(rig)
    if rig.score is None:
        PersonWithTape(rig.robot.poll).await_enter(f"\n{what}\nPress Enter to start, Ctrl-C to leave it: ")
    try:
        return _ride(rig, [Drive(0.0, 0.0, SETTLE_S), *motions, Drive(0.0, 0.0, SETTLE_S)], sizes)
    finally:
        rig.robot.stop()


def _await_ready(rig: Rig) -> None:
    give_up_s = rig.clock.now_s() + READY_S
    while (latest := rig.robot.latest) is None or latest.state != State.READY:
        if latest is not None and latest.state == State.FAULT:
            raise DeviceError(f"the robot stopped itself: {FAULTS[latest.fault]}")
        if rig.clock.now_s() > give_up_s:
            raise DeviceError("the robot does not come to rest")
        rig.clock.sleep_s(0.01)
        rig.robot.poll()


def _ride(rig: Rig, motions: Sequence[Drive], sizes: Sizes) -> Ride:
    robot, clock = rig.robot, rig.clock
    pictures: list[Picture] = []
    traces: list[WheelTrace] = []
    counts = begun = (0, 0)

    def listen() -> None:
        nonlocal counts, begun
        for report in robot.poll():
            t_s = robot.host_time_s(report.mcu_time_us)
            counts = (report.count_left, report.count_right)
            if not traces:
                begun = counts
                traces.extend(WheelTrace(t_s, count) for count in counts)
            ages = (report.edge_age_left_us, report.edge_age_right_us)
            for trace, count, age in zip(traces, counts, ages, strict=True):
                trace.add(t_s, count, None if age == NO_EDGE_US else t_s - 1e-6 * age)
        latest = robot.latest
        if latest is not None and latest.state == State.FAULT:
            raise DeviceError(f"the robot stopped itself: {FAULTS[latest.fault]}")

    def over(motion: Drive) -> bool:
        left, right = (sizes.um_left * (counts[0] - begun[0]), sizes.um_right * (counts[1] - begun[1]))
        return motion.over((left - right) / sizes.track_um, (left + right) / 2000)

    seen_s = clock.now_s()
    for part, motion in enumerate(motions):
        until_s = clock.now_s() + motion.lasts_s
        while (now_s := clock.now_s()) < until_s and not over(motion):
            if motion.v_mm_s or motion.omega_rad_s:
                robot.drive(motion.v_mm_s, motion.omega_rad_s)
            else:
                robot.stop()
            try:
                frame = rig.camera.read(min(PICTURE_S, max(until_s - now_s, 0.005)))
            except DeviceError:
                if clock.now_s() - seen_s > GONE_S:
                    raise
                frame = None
                clock.sleep_s(0.001)
            listen()
            if frame is not None:
                seen_s = clock.now_s()
                pictures.append(Picture(frame.t_s, cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY), part))
    listen()
    if not traces:
        raise DeviceError("the robot does not tell of its wheels")
    for trace in traces:
        trace.rest(clock.now_s())
    times = np.unique(np.concatenate([trace.t_s for trace in traces]))
    left, right = (np.interp(times, trace.t_s, trace.counts) for trace in traces)
    return Ride(rig.lens, pictures, Path(times, left, right))


def corners(gray: np.ndarray, most: int, mask: np.ndarray | None = None) -> np.ndarray:
    """(N, 2) float32 points that can be found again."""
    found = cv2.goodFeaturesToTrack(gray, most, 0.01, 7, mask=mask)
    return np.zeros((0, 2), np.float32) if found is None else np.asarray(found, np.float32).reshape(-1, 2)


def follow(
    a: np.ndarray, b: np.ndarray, points: np.ndarray, guess: np.ndarray | None = None, side: int = 15
) -> tuple[np.ndarray, np.ndarray]:
    """((N, 2) where points of one picture are in another, (N,) whether they are found back from there)."""
    if not len(points):
        return points, np.zeros(0, bool)
    flags = 0 if guess is None else cv2.OPTFLOW_USE_INITIAL_FLOW
    start = points.copy() if guess is None else guess.astype(np.float32)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 30, 0.003)
    there, ok, _ = cv2.calcOpticalFlowPyrLK(
        a, b, points.reshape(-1, 1, 2), start.reshape(-1, 1, 2),
        winSize=(side, side), maxLevel=3, criteria=stop, flags=flags,
    )  # fmt: skip
    there = np.asarray(there, np.float32)
    back, ok_too, _ = cv2.calcOpticalFlowPyrLK(
        b, a, there, points.reshape(-1, 1, 2).copy(),
        winSize=(side, side), maxLevel=3, criteria=stop, flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )  # fmt: skip
    off = np.hypot(*(np.asarray(back).reshape(-1, 2) - points).T)
    there = there.reshape(-1, 2)
    inside = (there > 2).all(1) & (there < (a.shape[1] - 3, a.shape[0] - 3)).all(1)
    return there, (np.asarray(ok).ravel() == 1) & (np.asarray(ok_too).ravel() == 1) & (off < 0.3) & inside
