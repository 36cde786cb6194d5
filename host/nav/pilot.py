"""From one picture to one command: net, depth, map, steering, in the order of the design's picture."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from host.camera.frame import Frame
from host.camera.lens import Lens
from host.depth.config import DepthConfig
from host.depth.estimator import Estimator
from host.depth.report import DepthReport
from host.nav.command import Command
from host.nav.config import BodyConfig, NavConfig
from host.nav.delay import Delay
from host.nav.localise import Localiser
from host.nav.map import ObstacleMap
from host.nav.mover import Mover
from host.nav.odometry import Odometry, WheelReading, body_of
from host.nav.stand import Standing
from host.nav.task import Task
from host.pose import Pose
from host.rbdn import Net, NetConfig, Snapshot

FADE_CM = 20.0  # a correction of the pose by so much leaves 1/e of the map's evidence
NEW_MAP_CM = 60.0  # and after one by so much nothing is where it was
DISTRACTS_CM, DISTRACTS_S = 60.0, 3.0  # what moves is so near then, and was seen no longer ago
SPACING_PX = 5.0  # of the outline samples, at least: every thing is measured again a moment later


@dataclass(frozen=True)
class View:
    """Everything that was made of one frame."""

    frame: Frame
    pose: Pose  # of the camera when the frame was taken, in the map's frame: the best there is
    dead_reckoning: Pose  # the same by the wheels alone, with the measures they were configured with
    snapshot: Snapshot
    depths: DepthReport
    command: Command
    stage_ms: dict[str, float]  # real time by stage: net, depth, localise, map, steer
    smooth: Pose  # in a frame that never jumps: for comparing this frame with those shortly before
    standing: tuple[Standing, ...]  # what the map took from this frame, but for what moves
    moving: tuple[tuple[float, float], ...] = ()  # between which x/z something that moves may be seen


class Stages:
    """Real time by stage, in the order they were passed."""

    def __init__(self) -> None:
        self.ms: dict[str, float] = {}

    @contextmanager
    def of(self, stage: str) -> Iterator[None]:
        began_s = time.perf_counter()
        yield
        self.ms[stage] = self.ms.get(stage, 0.0) + 1e3 * (time.perf_counter() - began_s)


class Pilot:
    """Sees, remembers and decides; touches neither camera nor robot.

    Let it ``hear`` every wheel reading, then call ``take`` for each frame that may be driven on. All that it
    makes follows from these calls and from those of ``decide``, ``react_within``, ``restarted`` and
    ``forget``: the same ones on another pilot give the same commands to the bit.
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
        self.delay = Delay(body)
        self.localiser = Localiser(body, lens)
        self.map = ObstacleMap(body, nav)
        self._lens, self._task, self._body = lens, task, body
        self._edge = float(lens.to_rays(np.array([[lens.width - 1.0, lens.cy]]))[0, 0])  # x/z of its border
        depth = replace(depth, outline_spacing_px=max(depth.outline_spacing_px, SPACING_PX))
        self._configs = net, depth, nav
        self._net = Net(net, lens)
        self._depth = Estimator(lens, depth)
        self._last_rotation: np.ndarray | None = None
        self._distracted = False  # by something that moved in the last picture

    def hear(self, reading: WheelReading) -> None:
        """Take one wheel reading; readings out of order are ignored."""
        self.odometry.add(reading)

    def restarted(self) -> None:
        """The robot restarted, and its counts begin at zero again."""
        self.odometry.restart()

    def take(self, frame: Frame, now_s: float) -> View:
        """Make a command of one frame; the decision is for ``now_s``, when the robot is further on."""
        stages = Stages()
        odometry = self.odometry.pose_at(self.delay.exposed_s(frame.t_s))
        with stages.of("localise"):
            smooth = self.localiser.move(odometry)
        with stages.of("net"):
            snapshot = self._net.track(frame.image, self._turned(smooth))
        with stages.of("depth"):
            depths = self._depth.update(snapshot, smooth)
        with stages.of("localise"):
            self.delay.learn(smooth, depths.motion, self.odometry, self.localiser)
            pose = self.localiser.update(snapshot, depths, self._distracted)
            self._move_map()
            here = self.localiser.ahead_of(self.odometry.pose_at(now_s))
        with stages.of("map"):
            x, z, _ = body_of(here, self._body.camera_ahead_cm)
            self.map.stand_on(x, z)
            self.map.update(snapshot, depths, pose, self._lens, frame.image)
        moving = [(one, rays) for one in self.map.movers if (rays := one.seen_between(pose)) is not None]
        self._distracted = any(self._is_distracted_by(one, rays, pose) for one, rays in moving)
        with stages.of("steer"):
            command = self._task.decide(self.map, here)
        standing = () if self.map.sight is None else self.map.sight.standing
        shown = tuple(rays for _, rays in moving)
        return View(frame, pose, odometry, snapshot, depths, command, stages.ms, smooth, standing, shown)

    def decide(self, now_s: float) -> Command:
        """The command for ``now_s`` without a new frame: the robot is further on, the map as it was."""
        return self._task.decide(self.map, self.localiser.ahead_of(self.odometry.pose_at(now_s)))

    def react_within(self, reaction_s: float) -> None:
        """From now on it takes this long from the capture of a frame until the wheels act on it."""
        if reaction_s != self.map.config.reaction_s:
            self.map.config = replace(self.map.config, reaction_s=reaction_s)

    def forget(self) -> None:
        """The robot is somewhere else than its wheels say: see and remember everything anew."""
        net, depth, nav = self._configs
        before, self.map = self.map, ObstacleMap(self._body, nav)
        self.map.keep_movers(before)
        self._net = Net(net, self._lens)
        self._depth = Estimator(self._lens, depth)
        self._last_rotation = None
        self.localiser.lose_place()

    def _move_map(self) -> None:
        """What was remembered relative to a place that turns out to be another is worth less, or nothing."""
        jump_cm = self.localiser.jump_cm
        if jump_cm > NEW_MAP_CM:
            self.map = ObstacleMap(self._body, self.map.config)
        elif jump_cm > self.map.config.cell_cm:
            self.map.evidence *= math.exp(-jump_cm / FADE_CM)

    def _is_distracted_by(self, mover: Mover, between: tuple[float, float], pose: Pose) -> bool:
        """Whether something that moves may fill so much of the picture that it looks like a turn."""
        inside = between[0] < self._edge and between[1] > -self._edge
        lately = pose.t_s - mover.t_s <= DISTRACTS_S
        return inside and lately and mover.nearest_cm(pose) <= DISTRACTS_CM

    def _turned(self, pose: Pose) -> np.ndarray | None:
        """Rotation since the last frame, by the wheels."""
        last, self._last_rotation = self._last_rotation, pose.rotation
        return None if last is None else last.T @ pose.rotation

    def path_step_cm(self, before: Pose | None, after: Pose) -> float:
        """Length of the straight line between two poses' axle middles, cm."""
        if before is None:
            return 0.0
        ahead = self._body.camera_ahead_cm
        return math.dist(body_of(before, ahead)[:2], body_of(after, ahead)[:2])
