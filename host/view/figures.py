"""The figures of a drive, from its result.json: what each is called, and whether less of it is better."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

REACHED = ("goal", "explored", "approached")


@dataclass(frozen=True)
class Figure:
    """One number of a result."""

    name: str
    keys: tuple[str, ...]  # the way to it
    unit: str = ""
    digits: int = 0
    better: Literal["less", "more", ""] = ""
    truth: bool = False  # only the simulator knows it
    slack: float = 0.0  # two that differ by less of themselves are alike: real times vary

    def of(self, result: dict[str, Any]) -> float | None:
        """Its value; None where it is not known."""
        found: Any = result
        for key in self.keys:
            found = found.get(key) if isinstance(found, dict) else None
        if isinstance(found, list):
            return len(found)
        return found if isinstance(found, int | float) else None

    def text(self, value: float | None) -> str:
        return "–" if value is None else f"{value:.{self.digits}f} {self.unit}".rstrip()

    def compare(self, first: float | None, second: float | None) -> int:
        """1 where the second is better, -1 where it is worse, 0 where that cannot be said."""
        if first is None or second is None or not self.better:
            return 0
        if abs(first - second) <= self.slack * max(abs(first), abs(second)):
            return 0
        return 1 if (second < first) == (self.better == "less") else -1


FIGURES = (
    Figure("time", ("duration_s",), "s", 1),
    Figure("distance", ("distance_cm",), "cm"),
    Figure("collisions", ("collisions",), better="less", truth=True),
    Figure("run into by others", ("run_into",), better="less", truth=True),
    Figure("closest approach", ("min_clearance_cm",), "cm", 1, "more", truth=True),
    Figure("final pose off by", ("final_pose_error", "position_cm"), "cm", 1, "less", truth=True),
    Figure("the same by the wheels alone", ("dead_reckoning_error", "position_cm"), "cm", 1, truth=True),
    Figure(
        "depth error of things, median", ("depth_errors", "things", "median_percent"), "%", 1, "less", True
    ),
    Figure("90 % of them below", ("depth_errors", "things", "p90_percent"), "%", 1, "less", True),
    Figure("with walls and floor, median", ("depth_errors", "median_percent"), "%", 1, "less", True),
    Figure("90 % of them below", ("depth_errors", "p90_percent"), "%", 1, "less", True),
    Figure("pictures", ("frames",)),
    Figure("lost pictures", ("dropped_frames",), better="less"),
    Figure("pictures not driven on", ("refused_frames",), better="less"),
    Figure("stops, with that at the end", ("times_stopped",), better="less"),
    Figure("carried off or slipped", ("times_forgotten",), better="less"),
    Figure("faults of the robot", ("faults_cleared",), better="less"),
    Figure("robot lost", ("reconnections",), better="less"),
    Figure("picture to command, median", ("frame_time_ms", "median"), "ms", 1, "less", slack=0.1),
    Figure("95 % of them below", ("frame_time_ms", "p95"), "ms", 1, "less", slack=0.1),
    Figure("exposure to command, median", ("latency_ms", "median"), "ms", 1, "less", slack=0.1),
    Figure("95 % of them below", ("latency_ms", "p95"), "ms", 1, "less", slack=0.1),
)


def grade(result: dict[str, Any]) -> str:
    """How the drive ended, as a class of the page's colours."""
    if result.get("collisions"):
        return "unsafe"
    outcome = result["outcome"]
    return "healthy" if outcome in REACHED else "faulty" if outcome == "stopped" else "note"


def outcome_text(result: dict[str, Any]) -> str:
    """Outcome and reason, as one says it."""
    outcome, reason = result["outcome"], result["reason"]
    return reason if reason.startswith(outcome) else f"{outcome}: {reason}"
