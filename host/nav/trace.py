"""How a drive went over time, for who looks at it afterwards; in a bounded memory however long it lasts."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

from host.depth.report import DepthReport
from host.link.protocol import Counters, LinkStatus, Telemetry
from host.nav.odometry import heading_of
from host.pose import Pose

MOST_MOMENTS = 600  # beyond, every second one is let go
MOST_DEPTHS = 6000
EVERY_S = 0.1  # between two moments, doubled each time
DEPTHS_EVERY_S = 0.5
STATES = ("t_s", "x_cm", "z_cm", "heading_deg", "v_mm_s", "omega_rad_s", "left_mm_s", "right_mm_s",
          "battery_mv", "damaged")  # fmt: skip


@dataclass(frozen=True)
class Took:
    """Real times of one picture."""

    frame_ms: float
    latency_ms: float
    stage_ms: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Moment:
    """Where the robot was, what it was told, what its wheels did; and the slowest picture since the last."""

    t_s: float  # since the drive began
    x_cm: float | None  # of the camera; None before the first picture
    z_cm: float | None
    heading_deg: float | None
    v_mm_s: float  # told
    omega_rad_s: float
    left_mm_s: int | None  # as the robot says
    right_mm_s: int | None
    battery_mv: int | None
    damaged: int  # frames on the line that came damaged so far, both ways, or not at all
    took: Took | None


class Trace:
    """Feed `took` with the times of every picture, then `note`; `see` with the depths."""

    def __init__(self) -> None:
        self.moments: list[Moment] = []
        self._every_s = EVERY_S
        self._slowest: Took | None = None
        self._depths: list[tuple[float, dict[int, tuple[float, float | None]]]] = []
        self._depths_every_s = DEPTHS_EVERY_S

    def took(self, took: Took) -> None:
        """Times of one picture that was driven on."""
        self._slowest = _slower(self._slowest, took)

    def note(
        self,
        t_s: float,
        pose: Pose | None,
        told: tuple[float, float],
        latest: Telemetry | None,
        damaged: int,
    ) -> None:
        """The state of things now, with the v in mm/s and omega told; most calls leave nothing."""
        if self.moments and t_s - self.moments[-1].t_s < self._every_s:
            return
        place = (None, None, None)
        if pose is not None:
            x_cm, _, z_cm = (round(float(v), 2) for v in pose.position_cm)
            place = x_cm, z_cm, round(math.degrees(heading_of(pose)), 2)
        wheels = (None, None, None)
        if latest is not None:
            wheels = latest.speed_left_mm_s, latest.speed_right_mm_s, latest.battery_mv or None
        speeds = round(told[0], 1), round(told[1], 3)
        self.moments.append(Moment(round(t_s, 3), *place, *speeds, *wheels, damaged, self._slowest))
        self._slowest = None
        if len(self.moments) > MOST_MOMENTS:
            pairs = zip(self.moments[::2], [*self.moments[1::2], None], strict=False)
            self.moments = [
                one if other is None else replace(one, took=_slower(one.took, other.took))
                for one, other in pairs
            ]
            self._every_s *= 2

    def see(self, t_s: float, report: DepthReport) -> None:
        """The depths that are known now; most calls leave nothing."""
        if self._depths and t_s - self._depths[-1][0] < self._depths_every_s:
            return
        known = {
            region: (round(found.depth_cm, 2), None if found.sigma_cm is None else round(found.sigma_cm, 2))
            for region, found in report.regions.items()
            if found.depth_cm is not None
        }
        self._depths.append((round(t_s, 3), known))
        while sum(len(depths) for _, depths in self._depths) > MOST_DEPTHS and len(self._depths) > 1:
            self._depths = self._depths[::2]
            self._depths_every_s *= 2

    def as_dict(self) -> dict[str, Any]:
        """In columns; real times have the names that result.REAL_TIMES lists."""
        columns: dict[str, Any] = {name: [getattr(m, name) for m in self.moments] for name in STATES}
        took = [m.took for m in self.moments]
        if took:
            took[-1] = _slower(took[-1], self._slowest)
        stages = dict.fromkeys(stage for one in took if one is not None for stage in one.stage_ms)
        columns["frame_time_ms"] = [one and round(one.frame_ms, 2) for one in took]
        columns["latency_ms"] = [one and round(one.latency_ms, 2) for one in took]
        columns["stage_ms"] = {
            stage: [one and round(one.stage_ms.get(stage, 0.0), 2) for one in took] for stage in stages
        }
        return columns

    def depths_as_dict(self) -> dict[str, dict[str, list[float | None]]]:
        """By region, in columns."""
        found: dict[str, dict[str, list[float | None]]] = {}
        for t_s, depths in self._depths:
            for region, values in depths.items():
                one = found.setdefault(str(region), {"t_s": [], "depth_cm": [], "sigma_cm": []})
                for column, value in zip(one.values(), (t_s, *values), strict=True):
                    column.append(value)
        return found


def damaged(host: Counters, robot: LinkStatus | None) -> int:
    """Frames that came damaged at either end of the line, or not at all."""
    ends = [host] if robot is None else [host, robot]
    return sum(end.crc + end.framing + end.overlong + end.lost for end in ends)


def _slower(one: Took | None, other: Took | None) -> Took | None:
    if one is None or other is None:
        return one or other
    return max(one, other, key=lambda took: took.latency_ms + took.frame_ms)
