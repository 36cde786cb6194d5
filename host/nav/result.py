"""What a drive leaves behind: the log while it runs, result.json when it is over."""

from __future__ import annotations

import json
import math
import os
import re
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from host.errors import UsageError
from host.nav.histogram import Histogram
from host.nav.odometry import heading_of
from host.nav.trace import Took, Trace
from host.pose import Pose
from host.record.atomic import write_whole

# Keys of result.json that hold real times, and so differ from run to run.
REAL_TIMES = ("frame_time_ms", "stage_ms", "latency_ms")

MOST_DECISIONS = 2000  # entries kept: the first tenth of them, and the newest
MOST_PLACES = 2000  # of the path
PLACE_CM, PLACE_RAD = 1.0, math.radians(10)  # a new place of the path differs by this much
NUMBERS = re.compile(r"\[\n[\d\s,.eE+-]*(?:null[\d\s,.eE+-]*)*\]")  # of JSON, to go on one line
NUMBER = re.compile(r"(?<!region )(?<![\w.])-?\d+(\.\d+)?")  # a region's is a name


@dataclass
class Decision:
    """What the robot was told to do and why, from some time on and for some pictures.

    The numbers are those of the first picture.
    """

    t_s: float
    v_mm_s: float
    omega_rad_s: float
    reason: str
    pictures: int = 1

    @property
    def stands(self) -> bool:
        return self.v_mm_s == self.omega_rad_s == 0.0

    def is_like(self, other: Decision) -> bool:
        """Whether both say the same but for numbers."""
        alike = NUMBER.sub("#", self.reason) == NUMBER.sub("#", other.reason)
        return alike and self.stands == other.stands


@dataclass(frozen=True)
class LostAndFound:
    """The robot was lost on the way, and connected again."""

    t_s: float  # since the start of the drive, when it was back
    away_s: float
    restarted: bool  # and not only cut off
    why: str


@dataclass(frozen=True)
class Lateness:
    """By how much pictures are stamped later than they are exposed, beyond `webcam.late_s`, s."""

    used_s: float
    best_s: float  # believed or not
    sigma_s: float  # of that

    def as_ms(self) -> dict[str, float]:
        """As result.json has it."""
        return {name[:-2]: round(1e3 * value, 2) for name, value in asdict(self).items()}


@dataclass
class DriveLog:
    """Kept in a bounded memory while the robot drives; holds nothing but what it can know itself."""

    outcome: str = "stopped"  # goal, explored, approached, blocked, timeout or stopped
    reason: str = "not begun"
    duration_s: float = 0.0
    distance_cm: float = 0.0
    frames: int = 0
    dropped_frames: int = 0
    refused_frames: int = 0  # that must not be driven on; watch.py and slip.py say which
    limited_frames: int = 0  # in which a budget of the net acted
    times_stopped: int = 0  # from driving or turning to standing, whatever for
    times_forgotten: int = 0  # all that was known of the place, as the robot was no longer there
    faults_cleared: int = 0
    reconnections: list[LostAndFound] = field(default_factory=list)
    last_pose: Pose | None = None  # of the camera, at the last picture driven on
    last_dead_reckoning: Pose | None = None  # the same by the wheels alone
    path: list[Pose] = field(default_factory=list)  # of the camera, in steps
    decisions: list[Decision] = field(default_factory=list)  # one for each change of what is said
    decisions_left_out: int = 0
    frame_ms: Histogram = field(default_factory=Histogram)  # from having a picture to its command
    stage_ms: dict[str, Histogram] = field(default_factory=dict)
    latency_ms: Histogram = field(default_factory=Histogram)  # exposure to command, on the camera's clock
    pictures_late: Lateness | None = None  # None before the first picture driven on
    began_s: float = 0.0  # on the camera's clock
    trace: Trace = field(default_factory=Trace)
    _stands: bool = True
    _place_cm: float = PLACE_CM

    def decide(self, t_s: float, v_mm_s: float, omega_rad_s: float, reason: str) -> None:
        """Note what was told to the wheels, and why."""
        new = Decision(round(t_s, 4), round(v_mm_s, 1), round(omega_rad_s, 4), reason)
        self.times_stopped += new.stands and not self._stands
        self._stands = new.stands
        if self.decisions and self.decisions[-1].is_like(new):
            self.decisions[-1].pictures += 1
            return
        self.decisions.append(new)
        if len(self.decisions) > MOST_DECISIONS:
            first = MOST_DECISIONS // 10
            self.decisions_left_out += first
            del self.decisions[first : 2 * first]

    def be_at(self, pose: Pose, dead_reckoning: Pose) -> None:
        """Note where the robot is; the path is kept in steps, which double where it grows long."""
        self.last_pose, self.last_dead_reckoning = pose, dead_reckoning
        if self.path and not self._is_new_place(self.path[-1], pose):
            return
        self.path.append(pose)
        if len(self.path) > MOST_PLACES:
            self._place_cm *= 2
            self.path = self.path[::2]

    def _is_new_place(self, old: Pose, new: Pose) -> bool:
        way_cm = math.dist(old.position_cm, new.position_cm)
        turned = abs(math.remainder(heading_of(new) - heading_of(old), math.tau))
        return way_cm >= self._place_cm or (self._place_cm == PLACE_CM and turned >= PLACE_RAD)

    def took(self, took: Took) -> None:
        """Note the real times of a picture that was driven on."""
        self.frame_ms.add(took.frame_ms)
        self.latency_ms.add(took.latency_ms)
        self.spent(took.stage_ms)
        self.trace.took(took)

    def spent(self, stage_ms: dict[str, float]) -> None:
        """Note the real time each stage took."""
        for stage, ms in stage_ms.items():
            if stage not in self.stage_ms:
                self.stage_ms[stage] = Histogram()
            self.stage_ms[stage].add(ms)

    def end(self, outcome: str, reason: str) -> None:
        self.outcome, self.reason = outcome, reason

    def as_dict(self) -> dict[str, Any]:
        """The part of result.json that needs no truth."""
        pose, reckoned = self.last_pose, self.last_dead_reckoning
        return {
            "outcome": self.outcome,
            "reason": self.reason,
            "duration_s": round(self.duration_s, 3),
            "distance_cm": round(self.distance_cm, 2),
            "final_pose": None if pose is None else pose_as_dict(pose),
            "dead_reckoning": None if reckoned is None else pose_as_dict(reckoned),
            "frames": self.frames,
            "dropped_frames": self.dropped_frames,
            "refused_frames": self.refused_frames,
            "limited_frames": self.limited_frames,
            "times_stopped": self.times_stopped,
            "times_forgotten": self.times_forgotten,
            "faults_cleared": self.faults_cleared,
            "reconnections": [asdict(one) for one in self.reconnections],
            "frame_time_ms": self.frame_ms.summary(),
            "stage_ms": {stage: times.summary() for stage, times in self.stage_ms.items()},
            "latency_ms": self.latency_ms.summary(),
            "pictures_late_ms": None if self.pictures_late is None else self.pictures_late.as_ms(),
            "began_s": round(self.began_s, 4),
            "trace": self.trace.as_dict(),
            "depths_over_time": self.trace.depths_as_dict(),
            "decisions": [asdict(d) for d in self.decisions],
            "decisions_left_out": self.decisions_left_out,
        }


def without_times(result: dict[str, Any]) -> dict[str, Any]:
    """All of a result that is the same for the same seed: what holds real times is left out, at any depth."""

    def kept(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: kept(part) for key, part in value.items() if key not in REAL_TIMES}
        return [kept(part) for part in value] if isinstance(value, list) else value

    return kept(result)


def pose_as_dict(pose: Pose) -> dict[str, float]:
    """Planar pose in cm and degrees, as result.json has it."""
    return {
        "x_cm": round(float(pose.position_cm[0]), 3),
        "z_cm": round(float(pose.position_cm[2]), 3),
        "heading_deg": round(math.degrees(heading_of(pose)), 3),
    }


def write_json(result: dict[str, Any], path: Path) -> None:
    """Write whole or not at all; UsageError where the place does not allow it."""
    text = json.dumps(result, indent=1, allow_nan=False)
    text = NUMBERS.sub(lambda row: re.sub(r"\s+", " ", row[0]), text)
    write_whole(path, (text + "\n").encode())


def new_run_folder(runs: Path, name: str) -> Path:
    """Make ``runs/name``, or ``runs/name-2`` and so on where that exists, and point ``runs/latest`` to it."""
    try:
        runs.mkdir(parents=True, exist_ok=True)
        folder, k = runs / name, 2
        while not _made(folder):
            folder, k = runs / f"{name}-{k}", k + 1
        link = runs / f".latest-{folder.name}"  # of its own: other drives may end at this moment
        try:
            link.symlink_to(folder.name, target_is_directory=True)
            os.replace(link, runs / "latest")
        finally:
            link.unlink(missing_ok=True)
    except OSError as error:
        raise UsageError(f"{runs} cannot be written: {error.strerror}; run from another folder") from None
    return folder


def _made(folder: Path) -> bool:
    """Whether it was not there before."""
    try:
        folder.mkdir()
    except FileExistsError:
        return False
    return True
