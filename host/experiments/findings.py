"""What a run hands over: depths beside their truth, how honest the sigmas were, and the times."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from host.depth.report import DepthReport
from host.rbdn.snapshot import Snapshot

At = Literal["first", "last"]  # the camera that a depth belongs to: of the first frame, or of the present one


@dataclass(frozen=True)
class Finding:
    """One depth that a method gave, or declined to give, beside the truth."""

    course: str
    seed: int
    odometry: str  # "exact" or "encoder"
    method: str  # "area", "outline", "vertex", "fused"; "paper area", "paper vertex"; "exact areas"
    thing: str  # an object, or a corner such as "red_box A"
    travel_cm: float  # driven so far
    at: At
    true_cm: float
    found_cm: float | None  # None where the method has no answer
    sigma_cm: float | None = None
    true_place_cm: tuple[float, float, float] | None = None  # X right, Y up, Z; corners only
    place_cm: tuple[float, float, float] | None = None
    growth: float | None = None  # px (vertex) or px^2 (area) over the whole travel
    setting: float | None = None  # what a sweep varies

    @property
    def error(self) -> float:
        """In percent of the depth, positive when too far; nan without an answer."""
        return np.nan if self.found_cm is None else 100.0 * (self.found_cm / self.true_cm - 1.0)


@dataclass(frozen=True)
class Pull:
    """An error in units of the sigma stated with it."""

    course: str
    method: str
    sigmas: float


@dataclass(frozen=True)
class Times:
    """Thread CPU time of one run."""

    course: str
    method: str  # "paper" or "ours"
    first_frame_ms: float
    tracking_ms: float  # all later frames together, refinement included
    frames: int
    depth_ms: float  # a frame, median


@dataclass(frozen=True)
class Turn:
    """What was left of the camera's unknown turn in one frame."""

    course: str
    seed: int
    was_rad: float  # larger one of pitch and yaw, against odometry
    left_rad: float  # the same against what the estimator made of it
    step_left_rad: float  # the same of the turn since the frame before alone


@dataclass(frozen=True)
class Still:
    """A frame with what was made of it, to be drawn."""

    travel_cm: float
    image: np.ndarray
    snapshot: Snapshot
    report: DepthReport


@dataclass(frozen=True)
class RunResult:
    """Everything from one drive through one scene."""

    findings: list[Finding] = field(default_factory=list)
    pulls: list[Pull] = field(default_factory=list)
    times: list[Times] = field(default_factory=list)
    turns: list[Turn] = field(default_factory=list)
    stills: list[Still] = field(default_factory=list)
