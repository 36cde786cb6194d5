"""The log over time: bounded however long the drive, and slow pictures are not thinned away."""

from __future__ import annotations

import json
from itertools import pairwise

from host.depth.report import DepthReport, RegionDepth, VertexDepths
from host.link.protocol import Counters
from host.nav.result import without_times
from host.nav.trace import MOST_DEPTHS, MOST_MOMENTS, Took, Trace, damaged
from host.pose import Pose


def report_of(regions: int) -> DepthReport:
    found = {k: RegionDepth(100.0 + k, 2.0, "outline", None) for k in range(regions)}
    found[99] = RegionDepth(None, None, None, "no baseline")
    return DepthReport(found, VertexDepths([], [], []))  # type: ignore[arg-type]


def long_trace(slow_at: int, seconds: int = 3600, ms: float = 5.0) -> Trace:
    trace, report = Trace(), report_of(30)
    for k in range(seconds * 5):
        trace.took(Took(400.0 if k == slow_at else ms, 40.0, {"net": ms}))
        trace.note(0.2 * k, Pose.planar(0.0, 0.1 * k, 0.0), (200.0, 0.0), None, 0)
        trace.see(0.2 * k, report)
    return trace


def test_an_hour_takes_no_more_room_than_a_minute_and_is_spread_evenly():
    trace = long_trace(7_777)
    times = [moment.t_s for moment in trace.moments]
    assert MOST_MOMENTS / 3 < len(times) <= MOST_MOMENTS
    steps = [b - a for a, b in pairwise(times)]
    assert times[0] == 0.0 and times[-1] > 3500 and max(steps) < 2.5 * min(steps)
    depths = trace.depths_as_dict()
    assert set(depths) == {str(k) for k in range(30)}  # and not the one that has no depth
    assert MOST_DEPTHS / 3 < sum(len(one["t_s"]) for one in depths.values()) <= MOST_DEPTHS
    assert len(json.dumps([trace.as_dict(), depths], allow_nan=False)) < 400_000


def test_the_slowest_picture_is_kept_however_often_moments_are_thinned():
    for slow_at in (1, 2_345, 17_998):
        assert max(ms or 0.0 for ms in long_trace(slow_at).as_dict()["frame_time_ms"]) == 400.0


def test_without_real_times_two_runs_are_alike():
    one, other = long_trace(3, 60, 5.0).as_dict(), long_trace(4, 60, 6.0).as_dict()
    assert one != other and without_times(one) == without_times(other)


def test_before_the_first_picture_there_is_no_place_and_no_time():
    trace = Trace()
    trace.note(0.0, None, (0.0, 0.0), None, damaged(Counters(crc=2, lost=1, frames=9), None))
    found = trace.as_dict()
    assert found["x_cm"] == found["left_mm_s"] == found["frame_time_ms"] == [None]
    assert found["damaged"] == [3]
