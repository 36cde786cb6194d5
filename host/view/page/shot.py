"""One picture's worth of the live page, as the loop hands it over in passing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the page is there before any of these is loaded
    import numpy as np

    from host.camera.frame import Frame
    from host.link.robot import Robot
    from host.nav.config import BodyConfig
    from host.nav.map import Mover
    from host.nav.pilot import View
    from host.nav.result import DriveLog


@dataclass(frozen=True)
class Job:
    """What stays the same all through a drive."""

    words: str  # what the drive is for
    goals_cm: tuple[tuple[float, float], ...]
    body: BodyConfig
    robot: Robot


@dataclass(frozen=True)
class Shot:
    """What the loop knew when it was done with a picture. Only the log and the robot go on changing."""

    number: int
    exposed_s: float  # on time.monotonic's clock
    done_s: float  # likewise: its command was sent
    frame: Frame | None
    view: View | None  # None where the picture was not driven on
    log: DriveLog
    evidence: np.ndarray  # (N, N) log-odds, a copy
    movers: tuple[Mover, ...]
    half_cm: float
    cell_cm: float
