"""A tiny flat world to drive in: ideal regions, noisy late depths, counted wheels. A tool of the tests.

Boxes stand on a floor within four walls. The camera sees label images ray-cast column by column; depth of
a region appears once the robot has driven a few centimetres, with a constant error and noise on top.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from host.camera.lens import Lens
from host.depth.report import DepthReport, RegionDepth, VertexDepths
from host.nav.config import BodyConfig
from host.nav.odometry import WheelReading, advance
from host.rbdn.snapshot import Contour, Region, Snapshot, Vertices

LENS = Lens(320, 240, 260.0, 260.0, 159.5, 119.5)
FLOOR_ID, WALL_ID, SKY_ID = 1, 2, 3
BASELINE_CM = 6.0  # travel before a region has a depth


@dataclass(frozen=True)
class Box:
    """A box on the floor, sides along the axes; the camera looks over it where it is low."""

    x0: float
    z0: float
    x1: float
    z1: float
    height: float = 30.0

    def distance(self, x: float, z: float) -> float:
        return math.hypot(max(self.x0 - x, 0.0, x - self.x1), max(self.z0 - z, 0.0, z - self.z1))


@dataclass(frozen=True)
class Shuttle:
    """A box that goes to and fro along x at one speed."""

    box: Box
    reach_cm: float
    speed_cm_s: float

    def at(self, t_s: float) -> Box:
        gone = self.speed_cm_s * t_s % (2 * self.reach_cm)
        off = min(gone, 2 * self.reach_cm - gone)
        return replace(self.box, x0=self.box.x0 + off, x1=self.box.x1 + off)


@dataclass
class PlanarWorld:
    """Truth: boxes, room, and the robot's body with its wheels."""

    boxes: list[Box]
    room: tuple[float, float, float, float] = (-150.0, -60.0, 150.0, 320.0)  # x0, z0, x1, z1
    body: BodyConfig = field(default_factory=BodyConfig)
    seed: int = 0
    depth_error: float = 0.03
    mismatch: float = 0.0  # the left wheel turns this part faster than told
    fps: float = 10.0
    shuttles: tuple[Shuttle, ...] = ()

    def __post_init__(self) -> None:
        self.random = np.random.default_rng(self.seed)
        self.t_s = 0.0
        self.x, self.z, self.heading = 0.0, -self.body.camera_ahead_cm, 0.0
        self.wheel_cm = self.random.uniform(0.0, self.body.cm_per_count, 2)  # where in its cell each begins
        self.counts = [0, 0]
        self.edges: list[float | None] = [None, None]
        self.speed = np.zeros(2)
        self.command = (0.0, 0.0)
        self.driven_cm = 0.0
        self.least_gap_cm = self.least_driving_gap_cm = self.gap_cm()
        self.first_seen: dict[int, float] = {}
        self.bias: dict[int, float] = {}
        self.seq = 0

    def gap_cm(self) -> float:
        """Between the rim and the nearest thing; negative in a collision."""
        x0, z0, x1, z1 = self.room
        walls = min(self.x - x0, x1 - self.x, self.z - z0, z1 - self.z)
        return min([walls, *(b.distance(self.x, self.z) for b in self.things())]) - self.body.radius_cm

    def things(self) -> list[Box]:
        """Where all boxes are now, those that move last."""
        return [*self.boxes, *(shuttle.at(self.t_s) for shuttle in self.shuttles)]

    def camera_xz(self) -> tuple[float, float]:
        ahead = self.body.camera_ahead_cm
        return self.x + ahead * math.sin(self.heading), self.z + ahead * math.cos(self.heading)

    def run(self, seconds: float) -> list[WheelReading]:
        """Drive on as last commanded; readings every 10 ms."""
        readings = []
        dt = 0.002
        for k in range(round(seconds / dt)):
            v, omega = self.command
            half = omega * self.body.track_cm / 2
            target = np.array([(v + half) * (1 + self.mismatch), v - half])
            self.speed += np.clip(target - self.speed, -80 * dt, 80 * dt)
            step = self.speed * dt
            self.x, self.z, self.heading = advance(
                self.x, self.z, self.heading, step[0], step[1], self.body.track_cm
            )
            self.driven_cm += abs(step.mean())
            self.t_s += dt
            for i in (0, 1):
                before, self.wheel_cm[i] = self.wheel_cm[i], self.wheel_cm[i] + step[i]
                count = math.floor(self.wheel_cm[i] / self.body.cm_per_count)
                if count != self.counts[i]:
                    border = max(count, self.counts[i]) * self.body.cm_per_count
                    self.edges[i] = self.t_s - dt * (self.wheel_cm[i] - border) / (self.wheel_cm[i] - before)
                    self.counts[i] = count
            gap = self.gap_cm()
            self.least_gap_cm = min(self.least_gap_cm, gap)
            if abs(self.speed.mean()) > 1.0:
                self.least_driving_gap_cm = min(self.least_driving_gap_cm, gap)
            if k % 5 == 4:
                readings.append(WheelReading(self.t_s, *self.counts, *self.edges))
        return readings

    def see(self) -> tuple[Snapshot, DepthReport]:
        """What net and depth would say of the present view."""
        labels, depth = self._cast()
        regions, found = [], {}
        for region_id in np.unique(labels):
            mask = (labels == region_id).astype(np.uint8)
            if mask.sum() < 30:
                continue
            # of four quarters of each pixel, so that an outline runs between the pixels as the net's do
            halves = mask.repeat(2, axis=0).repeat(2, axis=1)
            outlines, _ = cv2.findContours(halves, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
            loops = tuple((o // 2 + o % 2 - 0.5).reshape(-1, 2) for o in outlines)
            border = bool(mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any())
            rng = np.random.default_rng(int(region_id))
            rgb = (120.0, 100.0, 80.0) if region_id == FLOOR_ID else tuple(rng.uniform(130, 250, 3))
            none = tuple(np.zeros(len(loop), np.int64) for loop in loops)
            regions.append(
                Region(int(region_id), None, 0, float(mask.sum()), 1.0, border, rgb, loops, none, none)
            )
            found[int(region_id)] = self._measure(int(region_id), float(depth[mask > 0].mean()))
        self.seq += 1
        empty = np.empty(0)
        none = np.empty(0, np.int64)
        nowhere = np.empty((0, 2))
        contour = Contour(nowhere, nowhere, none, none, empty, empty)
        snapshot = Snapshot(
            self.seq, tuple(regions), Vertices(none, nowhere, empty), contour, (), 1, 1.0, 1.0
        )
        return snapshot, DepthReport(found, VertexDepths(none, np.empty((0, 3)), empty))

    def _measure(self, region_id: int, truth_cm: float) -> RegionDepth:
        since = self.first_seen.setdefault(region_id, self.driven_cm)
        bias = self.bias.setdefault(region_id, self.random.normal(0.0, self.depth_error))
        if region_id <= SKY_ID or self.driven_cm - since < BASELINE_CM:
            return RegionDepth(None, None, None, "too little motion")
        z = truth_cm * (1 + bias + self.random.normal(0.0, 0.01))
        return RegionDepth(z, truth_cm * math.hypot(self.depth_error, 0.01), "area", None)

    def _cast(self) -> tuple[np.ndarray, np.ndarray]:
        """(labels, depth along the axis) of every pixel."""
        cx, cz = self.camera_xz()
        height = self.body.camera_height_cm
        x0, z0, x1, z1 = self.room
        columns = np.arange(LENS.width)
        side = (columns - LENS.cx) / LENS.fx
        dx = math.sin(self.heading) + side * math.cos(self.heading)
        dz = math.cos(self.heading) - side * math.sin(self.heading)
        rows = np.arange(LENS.height)[:, None]
        down = (rows - LENS.cy) / LENS.fy
        with np.errstate(divide="ignore", invalid="ignore"):
            wall = np.min(
                [np.where(dx > 0, (x1 - cx) / dx, np.where(dx < 0, (x0 - cx) / dx, np.inf)),
                 np.where(dz > 0, (z1 - cz) / dz, np.where(dz < 0, (z0 - cz) / dz, np.inf))], axis=0
            )  # fmt: skip
            depth = np.broadcast_to(wall, (LENS.height, LENS.width)).copy()
            labels = np.full(depth.shape, WALL_ID)
            labels[down * wall < height - 120.0] = SKY_ID
            floor = np.where(down > 0, height / down, np.inf)
            on_floor = floor < depth
            labels[on_floor] = FLOOR_ID
            depth = np.where(on_floor, floor, depth)
            for k, box in enumerate(self.things()):
                tx = np.sort([(box.x0 - cx) / dx, (box.x1 - cx) / dx], axis=0)
                tz = np.sort([(box.z0 - cz) / dz, (box.z1 - cz) / dz], axis=0)
                near = np.maximum(tx[0], tz[0])
                hit = (near < np.minimum(tx[1], tz[1])) & (near > 0)
                y = down * near
                seen = hit & (y <= height) & (y >= height - box.height) & (near < depth)
                labels[seen] = 10 + k
                depth = np.where(seen, near, depth)
        return labels, depth


def random_boxes(seed: int, count: int = 6) -> list[Box]:
    """Boxes that leave the start and the goal at (0, 220) alone."""
    random = np.random.default_rng(seed)
    boxes: list[Box] = []
    while len(boxes) < count:
        x, z = random.uniform(-110, 110), random.uniform(50, 260)
        w, d = random.uniform(10, 40, 2)
        box = Box(x, z, x + w, z + d, random.uniform(8, 60))
        if box.distance(0, -12) > 45 and box.distance(0, 0) > 40 and box.distance(0, 220) > 30:
            boxes.append(box)
    return boxes
