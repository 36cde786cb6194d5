"""From one picture to one command: net, depth, map, steering, in the order of the design's picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from host.camera.frame import Frame
from host.camera.lens import Lens
from host.depth.config import DepthConfig
from host.depth.estimator import Estimator
from host.depth.report import DepthReport
from host.nav.config import BodyConfig, NavConfig
from host.nav.map import ObstacleMap
from host.nav.odometry import Odometry
from host.nav.steer import Command, body_of
from host.nav.task import Task
from host.pose import Pose
from host.rbdn import Net, NetConfig, Snapshot


@dataclass(frozen=True)
class View:
    """Everything that was made of one frame."""

    frame: Frame
    pose: Pose  # of the camera when the frame was taken
    snapshot: Snapshot
    depths: DepthReport
    command: Command


class Pilot:
    """Sees, remembers and decides; touches neither camera nor robot.

    Feed ``odometry`` with every wheel reading, then call ``take`` for each frame that may be driven on.
    """

    def __init__(
        self,
        lens: Lens,
        task: Task,
        *,
        net: NetConfig,
        depth: DepthConfig,
        body: BodyConfig,
        nav: NavConfig,
    ) -> None:
        self.odometry = Odometry(body)
        self.map = ObstacleMap(body, nav)
        self._lens, self._task, self._body = lens, task, body
        self._net = Net(net, lens)
        self._depth = Estimator(lens, depth)
        self._last_rotation: np.ndarray | None = None

    def take(self, frame: Frame, now_s: float) -> View:
        """Make a command of one frame; the decision is for ``now_s``, when the robot is further on."""
        pose = self.odometry.pose_at(frame.t_s)
        turned = None if self._last_rotation is None else self._last_rotation.T @ pose.rotation
        self._last_rotation = pose.rotation
        snapshot = self._net.track(frame.image, turned)
        depths = self._depth.update(snapshot, pose)
        here = self.odometry.pose_at(now_s)
        x, z, _ = body_of(here, self._body.camera_ahead_cm)
        self.map.stand_on(x, z)
        self.map.update(snapshot, depths, pose, self._lens)
        command = self._task.decide(self.map, here)
        return View(frame, pose, snapshot, depths, command)

    def path_step_cm(self, before: Pose | None, after: Pose) -> float:
        """Length of the straight line between two poses' axle middles, cm."""
        if before is None:
            return 0.0
        ahead = self._body.camera_ahead_cm
        return math.dist(body_of(before, ahead)[:2], body_of(after, ahead)[:2])
