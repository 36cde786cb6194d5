"""The pictures a drive leaves: some frames with net and depths, and the floor from above."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from host.camera.frame import Frame
from host.nav.config import BodyConfig
from host.nav.map import ObstacleMap
from host.nav.odometry import body_of, heading_of
from host.nav.pilot import View
from host.nav.result import NUMBER, DriveLog
from host.record.atomic import write_whole
from host.view.floor_picture import Floor, FloorObstacle, draw_floor
from host.view.net_picture import draw_net

MOST = 8  # frames kept; beyond, every second one is let go
MOST_STOPS = 6  # and of those at which it stopped for something, one for each thing
MOST_REFUSED = 6  # and of those that were not driven on, the first for each kind of reason


class Gallery:
    """Keeps frames spread evenly over the drive, the last one always, and draws them when it is over."""

    def __init__(self) -> None:
        self._kept: list[View] = []
        self._last: View | None = None
        self._every_s = 1.0
        self._stops: dict[str, View] = {}  # by what it stopped for
        self._refused: dict[str, tuple[Frame, str]] = {}  # by the reason without its numbers
        self._moved = False

    def add(self, view: View) -> None:
        """Look at a frame that was driven on."""
        self._last = view
        self._note_stop(view)
        if self._kept and view.frame.t_s - self._kept[-1].frame.t_s < self._every_s:
            return
        self._kept.append(view)
        if len(self._kept) > MOST:
            self._kept = self._kept[::2]
            self._every_s *= 2

    def refuse(self, frame: Frame | None, why: str) -> None:
        """Look at a frame that was not driven on."""
        self._moved = False
        kind = NUMBER.sub("#", why)
        if frame is not None and len(self._refused) < MOST_REFUSED:
            self._refused.setdefault(kind, (frame, why))

    def pictures(self, began_s: float) -> list[dict[str, Any]]:
        """File, time since the drive began, and what was told, of every picture that `write` writes."""
        views = [(name, view.frame, view.command.reason) for name, view in self._views()]
        refused = [(_name("refused", frame), frame, f"stop: {why}") for frame, why in self._refused.values()]
        return [
            {"file": name, "t_s": round(frame.t_s - began_s, 3), "told": told}
            for name, frame, told in [*views, *refused]
        ]

    def _views(self) -> list[tuple[str, View]]:
        """With the names of their files."""
        views = list(self._kept)
        if self._last is not None and self._last is not views[-1]:
            views.append(self._last)
        frames = [(_name("frame", view.frame), view) for view in views]
        return frames + [(_name("stop", view.frame), view) for view in self._stops.values()]

    def _note_stop(self, view: View) -> None:
        """Of stops for one thing the last is kept, where it is nearest and known best."""
        command = view.command
        stands = command.v_mm_s == command.omega_rad_s == 0.0
        thing = re.search(r"region \d+", command.reason)
        if stands and self._moved and thing is not None:
            self._stops.pop(thing[0], None)
            self._stops[thing[0]] = view
            if len(self._stops) > MOST_STOPS:
                del self._stops[next(iter(self._stops))]
        self._moved = not stands

    def write(
        self,
        folder: Path,
        obstacle_map: ObstacleMap,
        body: BodyConfig,
        goal_cm: tuple[float, float] | None,
        log: DriveLog,
    ) -> None:
        """frame_SEQ.png for every frame kept, stop_SEQ.png, refused_SEQ.png likewise, and path.png."""
        for name, view in self._views():
            caption = f"{view.frame.t_s:.1f} s  {view.command.reason}"
            _write_png(folder / name, draw_net(view.frame.image, view.snapshot, view.depths, caption))
        for frame, _ in self._refused.values():
            _write_png(folder / _name("refused", frame), frame.image)
        if log.last_pose is None:
            return
        standing = set(obstacle_map.region[obstacle_map.occupied].tolist())
        obstacles = tuple(
            FloorObstacle(o.region, np.array([o.left_cm, o.right_cm]), o.depth_cm, o.sigma_cm)
            for o in obstacle_map.obstacles.values()
            if o.region in standing
        )
        floor = Floor(
            path_cm=np.array(
                [body_of(pose, body.camera_ahead_cm)[:2] for pose in [*log.path, log.last_pose]]
            ),
            heading_rad=heading_of(log.last_pose),
            robot_radius_cm=body.radius_cm,
            goal_cm=goal_cm,
            obstacles=obstacles,
            occupied_cm=obstacle_map.points_where(obstacle_map.occupied),
            free_cm=obstacle_map.points_where(obstacle_map.free),
            cell_cm=obstacle_map.config.cell_cm,
        )
        _write_png(folder / "path.png", draw_floor(floor, f"{log.outcome}: {log.reason}"))


def _name(kind: str, frame: Frame) -> str:
    return f"{kind}_{frame.seq:05d}.png"


def _write_png(path: Path, picture: np.ndarray) -> None:
    _, data = cv2.imencode(".png", picture)
    write_whole(path, data.tobytes())
