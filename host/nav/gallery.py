"""The pictures a drive leaves: some frames with net and depths, and the floor from above."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from host.nav.config import BodyConfig
from host.nav.map import ObstacleMap
from host.nav.odometry import heading_of
from host.nav.pilot import View
from host.nav.result import DriveLog
from host.nav.steer import body_of
from host.record.atomic import write_whole
from host.view.floor_picture import Floor, FloorObstacle, draw_floor
from host.view.net_picture import draw_net

MOST = 8  # frames kept; beyond, every second one is let go


class Gallery:
    """Keeps frames spread evenly over the drive, the last one always, and draws them when it is over."""

    def __init__(self) -> None:
        self._kept: list[View] = []
        self._last: View | None = None
        self._every_s = 1.0

    def add(self, view: View) -> None:
        self._last = view
        if self._kept and view.frame.t_s - self._kept[-1].frame.t_s < self._every_s:
            return
        self._kept.append(view)
        if len(self._kept) > MOST:
            self._kept = self._kept[::2]
            self._every_s *= 2

    def write(
        self,
        folder: Path,
        obstacle_map: ObstacleMap,
        body: BodyConfig,
        goal_cm: tuple[float, float] | None,
        log: DriveLog,
    ) -> None:
        """frame_SEQ.png for every frame kept, and path.png."""
        views = list(self._kept)
        if self._last is not None and self._last is not views[-1]:
            views.append(self._last)
        for view in views:
            caption = f"{view.frame.t_s:.1f} s  {view.command.reason}"
            picture = draw_net(view.frame.image, view.snapshot, view.depths, caption)
            _write_png(folder / f"frame_{view.frame.seq:05d}.png", picture)
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


def _write_png(path: Path, picture: np.ndarray) -> None:
    _, data = cv2.imencode(".png", picture)
    write_whole(path, data.tobytes())
