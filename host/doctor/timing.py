"""Is this computer fast enough, are its pauses short, and do its clock and the robot's go together?"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from host.camera.frame import Frame
from host.camera.lens import Lens
from host.depth.config import DepthConfig
from host.doctor.finding import Finding, Part
from host.pose import Pose
from host.rbdn.config import NetConfig

SPEED_CM_S = 20.0  # at which the camera is taken to move, so that depth has something to do
SLOW_TRIP_MS, LATE_TRIP_MS = 20.0, 100.0
APART_MS, FAR_APART_MS = 4.0, 20.0  # the first is what depth counts on
NAP_S, NAPS = 0.002, 150
PAUSE_MS, LONG_PAUSE_MS = 20.0, 100.0  # a command lives for 200
PART = Part("timing")
BUSY = "close other programs; on a laptop plug in the power"


def time_frames(frames: Sequence[Frame], lens: Lens, net: NetConfig, depth: DepthConfig) -> list[float]:
    """Milliseconds that net and depth take for each picture but the first, as if the robot drove."""
    from host.depth.estimator import Estimator
    from host.rbdn import Net

    tracker, estimator, took_ms = Net(net, lens), Estimator(lens, depth), []
    for frame in frames:
        t_s = frame.t_s - frames[0].t_s
        began_s = time.perf_counter()
        snapshot = tracker.track(frame.image, np.eye(3))
        estimator.update(snapshot, Pose.planar(0.0, SPEED_CM_S * t_s, 0.0, t_s=t_s))
        took_ms.append(1000 * (time.perf_counter() - began_s))
    return took_ms[1:]


def check_frame_time(took_ms: Sequence[float], hz: float) -> Finding:
    """Is a picture done before the next one comes?"""
    period_ms = 1000 / hz
    usual, worst = float(np.median(took_ms)), float(np.percentile(took_ms, 95))
    told = f"net and depth take {usual:.1f} ms, 95 % below {worst:.1f} ms; a picture every {period_ms:.0f} ms"
    fix = f"{BUSY}; else a smaller picture, or --net.max-ms {max(1, round(0.6 * period_ms))}"
    if usual > period_ms:
        return PART.fail("picture time", told, fix)
    if worst > 0.8 * period_ms:
        return PART.warn("picture time", told, fix)
    return PART.ok("picture time", told)


def check_round_trip(echoes: Sequence[tuple[float, float, int]]) -> Finding:
    """How long does the line take there and back?"""
    if not echoes:
        return PART.fail("round trip", "no PING was answered", "shorten the cable, use another USB port")
    trips_ms = [1000 * (heard - sent) for sent, heard, _ in echoes]
    usual, worst = float(np.median(trips_ms)), float(max(trips_ms))
    told = f"median {usual:.1f} ms, longest {worst:.1f} ms of {len(trips_ms)}"
    if usual > LATE_TRIP_MS:
        return PART.fail("round trip", told, "use another USB port without a hub")
    if usual > SLOW_TRIP_MS or worst > LATE_TRIP_MS:
        return PART.warn(
            "round trip", told, "use another USB port without a hub; of an FTDI chip set latency_timer to 1"
        )
    return PART.ok("round trip", told)


def check_clocks(echoes: Sequence[tuple[float, float, int]], host_time_s: Callable[[int], float]) -> Finding:
    """Is the robot's time known on this computer's clock? Halfway through the faster round trips tells."""
    if len(echoes) < 3:
        return PART.untried("clocks", "too few PINGs were answered")
    usual_s = float(np.median([heard - sent for sent, heard, _ in echoes]))
    quick = [one for one in echoes if one[1] - one[0] <= usual_s + 1e-6]  # the others were read late
    off_ms = np.array([1000 * (host_time_s(mcu_us) - (sent + heard) / 2) for sent, heard, mcu_us in quick])
    off = float(np.percentile(np.abs(off_ms), 90))
    told = f"the robot's clock is known to within {off:.2f} ms"
    if off > FAR_APART_MS:
        return PART.fail("clocks", told, "use another USB port without a hub; close other programs")
    if off > APART_MS:
        return PART.warn("clocks", told, "close other programs; use another USB port without a hub")
    return PART.ok("clocks", told)


def measure_pauses(
    nap: Callable[[float], None] = time.sleep, now_s: Callable[[], float] = time.perf_counter
) -> list[float]:
    """By how many ms each of many short naps was too long."""
    late_ms = []
    for _ in range(NAPS):
        began_s = now_s()
        nap(NAP_S)
        late_ms.append(1000 * (now_s() - began_s - NAP_S))
    return late_ms


def check_pauses(late_ms: Sequence[float]) -> Finding:
    """Does this computer wake up when it should?"""
    worst, usual = max(late_ms), float(np.median(late_ms))
    told = f"wakes up {usual:.1f} ms late, {worst:.1f} ms at worst"
    if worst > LONG_PAUSE_MS:
        return PART.fail("pauses", told, BUSY)
    if worst > PAUSE_MS:
        return PART.warn("pauses", told, BUSY)
    return PART.ok("pauses", told)
