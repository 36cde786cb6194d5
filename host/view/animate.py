"""A recorded drive as a short moving picture: camera with net and depths, the map beside it.

    python -m host.view.animate run.mcap [--out drive.webp]

Net, depths and map are made again from the recording, as host.replay does.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in the drive: threads add in another order

from host.errors import InputError, UsageError, begin_command, run_command

if __name__ == "__main__":
    begin_command()

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from host.config import read_options
from host.progress import progress

if TYPE_CHECKING:  # so that --help need not wait for OpenCV
    import numpy as np

    from host.nav.map import ObstacleMap
    from host.record.mcap_reader import Recording

HEIGHT_PX = 330
MAP_PX = 300  # wide
MARGIN_CM = 20.0
EVERY_S = 0.25  # of the drive
SHOWN_S = 0.125  # each picture: twice as fast as it was
LAST_S = 2.0  # the last one
QUALITY = 78  # of WebP
KINDS = (".webp", ".gif")


@dataclass(frozen=True)
class Options:
    """Make a short moving picture of a recorded drive, twice as fast as it was."""

    recording: Positional[Annotated[Path, arg(metavar="RECORDING")]]  # made with nav_loop --record
    out: Path | None = None  # .webp or .gif to write, run.webp beside run.mcap if not given


@dataclass(frozen=True)
class _Moment:
    """What is needed to draw one picture of it."""

    camera: np.ndarray  # with net and depths
    taken: np.ndarray  # points on the map, cm
    free: np.ndarray
    body: tuple[float, float, float]  # x, z, heading
    way: tuple[tuple[float, float], ...]


def main() -> None:
    """The command."""
    options = read_options(Options)
    import cv2

    from host.record.atomic import check_writable
    from host.record.mcap_reader import Recording

    if not hasattr(cv2, "imencodeanimation"):
        raise UsageError(f"OpenCV {cv2.__version__} writes no moving pictures, 5.0 does: install that")
    recording = Recording(options.recording)
    out = options.out or options.recording.with_suffix(".webp")
    if out.suffix.lower() not in KINDS:
        raise UsageError(f"--out {out}: name a file that ends in {' or '.join(KINDS)}")
    check_writable(out, folder=False)
    pictures = animate(recording)
    write(pictures, out)
    print(f"{len(pictures)} pictures, {out.stat().st_size / 1e6:.1f} MB: {out}")


def animate(recording: Recording) -> list[np.ndarray]:
    """The pictures, all of one size, BGR.

    Raises
    ------
    InputError
        There is nothing in it to be seen.
    """
    moments = _moments(recording)
    if not moments:
        raise InputError(f"{recording.path}: no picture in it was driven on; there is nothing to show")
    goals = [(float(x), float(z)) for x, z in recording.begin["task"].get("goals_cm", [])]
    plan = _Plan(moments, goals, recording.config.body.radius_cm, recording.config.nav.cell_cm)
    return [plan.beside(k) for k in range(len(moments))]


def _moments(recording: Recording) -> list[_Moment]:
    from host.nav.odometry import body_of
    from host.record.replayed import replay
    from host.view.net_picture import draw_net

    moments: list[_Moment] = []
    shown_s = -math.inf
    ahead_cm = recording.config.body.camera_ahead_cm
    with progress("replaying", recording.frame_count) as advance:
        for step in replay(recording):
            advance()
            view = step.view
            if view is None or step.t_s - shown_s < EVERY_S:
                continue
            shown_s = step.t_s
            camera = draw_net(view.frame.image, view.snapshot, view.depths, view.command.reason)
            moments.append(
                _Moment(_fitted(camera), *_cells(step.map), body_of(view.pose, ahead_cm), view.command.way)
            )
    return moments


def _fitted(picture: np.ndarray) -> np.ndarray:
    import cv2

    size = round(picture.shape[1] * HEIGHT_PX / picture.shape[0]), HEIGHT_PX
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def _cells(obstacle_map: ObstacleMap) -> tuple[np.ndarray, np.ndarray]:
    return obstacle_map.points_where(obstacle_map.occupied), obstacle_map.points_where(obstacle_map.free)


class _Plan:
    """The map from above, in one scale for all pictures."""

    def __init__(
        self, moments: list[_Moment], goals: list[tuple[float, float]], radius_cm: float, cell_cm: float
    ) -> None:
        import numpy as np

        self._moments, self._goals, self._radius_cm, self._cell_cm = moments, goals, radius_cm, cell_cm
        way = np.array([moment.body[:2] for moment in moments])
        seen = [moments[-1].free, way - radius_cm, way + radius_cm, *([np.array(goals)] if goals else [])]
        every = np.vstack(seen)
        low, high = every.min(axis=0) - MARGIN_CM, every.max(axis=0) + MARGIN_CM
        self._scale = float(min(MAP_PX / (high[0] - low[0]), HEIGHT_PX / (high[1] - low[1])))
        self._middle = (low + high) / 2

    def _at(self, x_cm: float, z_cm: float) -> tuple[int, int]:
        x = MAP_PX / 2 + (x_cm - self._middle[0]) * self._scale
        y = HEIGHT_PX / 2 - (z_cm - self._middle[1]) * self._scale
        return round(float(x)), round(float(y))

    def beside(self, k: int) -> np.ndarray:
        """Picture k: the camera's and the map."""
        import cv2
        import numpy as np

        from host.view.floor_picture import FREE, GOAL, OCCUPIED, PATH, ROBOT
        from host.view.palette import MUTED, PAPER

        moment = self._moments[k]
        plan = np.full((HEIGHT_PX, MAP_PX, 3), PAPER, np.uint8)
        half = self._cell_cm / 2
        for points, colour in ((moment.free, FREE), (moment.taken, OCCUPIED)):
            for x, z in points:
                cv2.rectangle(plan, self._at(x - half, z + half), self._at(x + half, z - half), colour, -1)
        way = np.array([self._at(*place) for place in moment.way]).reshape(-1, 1, 2)
        if len(way) > 1:
            cv2.polylines(plan, [way.astype(np.int32)], False, MUTED, 1, cv2.LINE_AA)
        path = np.array([self._at(*one.body[:2]) for one in self._moments[: k + 1]]).reshape(-1, 1, 2)
        cv2.polylines(plan, [path.astype(np.int32)], False, PATH, 2, cv2.LINE_AA)
        for goal in self._goals:
            cv2.drawMarker(plan, self._at(*goal), GOAL, cv2.MARKER_TILTED_CROSS, 14, 2, cv2.LINE_AA)
        x, z, heading = moment.body
        radius = self._radius_cm
        cv2.circle(plan, self._at(x, z), round(radius * self._scale), ROBOT, -1, cv2.LINE_AA)
        nose = self._at(x + radius * math.sin(heading), z + radius * math.cos(heading))
        cv2.line(plan, self._at(x, z), nose, PATH, 2, cv2.LINE_AA)
        return np.hstack([moment.camera, plan])


def write(pictures: list[np.ndarray], out: Path) -> None:
    """Whole or not at all; UsageError where the place does not allow it."""
    import cv2

    from host.record.atomic import write_whole

    animation = cv2.Animation()
    animation.frames = pictures
    animation.durations = [round(1000 * SHOWN_S)] * (len(pictures) - 1) + [round(1000 * LAST_S)]
    done, data = cv2.imencodeanimation(out.suffix.lower(), animation, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])
    if not done:
        raise UsageError(f"{out}: this OpenCV writes no {out.suffix}; name another of {', '.join(KINDS)}")
    write_whole(out, data.tobytes())


if __name__ == "__main__":
    run_command(main)
