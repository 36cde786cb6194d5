"""What stands around the robot: regions with depth become obstacles on a grid in the odometry frame.

Three things tell where a region stands. Its depth, measured from motion. Its foot: in each image column
the lowest point of what is not floor, which meets the floor at height / ray_y. And its vertices with
depth, which lie on the floor's plane or above it. A region that is floor is no obstacle but frees the
ground up to the first foot. Cells nobody looked at stay unknown: unseen is not free.

Each cell holds log-odds; contradictory evidence wins within a few frames, all evidence fades with time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from host.camera.lens import Lens
from host.depth.report import DepthReport
from host.nav.config import BodyConfig, NavConfig
from host.nav.floor import FARTHEST_CM, NO_REGION, SIGMA_RAY, STEP_PX, FloorFinder, Rays, label_image, rays_of
from host.nav.odometry import heading_of
from host.pose import Pose
from host.rbdn.snapshot import Region, Snapshot

RANGE_CM = 300.0  # evidence is taken up to here
SHELL_CM = 8.0  # how far behind a seen surface its cells are filled
DEEPEST_CM = 40.0  # things are taken to be as deep as they are wide, up to this, until floor is seen there
OCCUPIED, FREE = 0.8, -0.4  # log-odds beyond which a cell counts as one or the other
LIMIT = 4.0
BARELY_FREE = 1.5 * FREE  # what may be floor never counts for more
PRESUMED = 1.0  # what is only presumed behind a surface never counts for more


@dataclass(frozen=True)
class Obstacle:
    """One region as it stands in the odometry frame."""

    region: int
    depth_cm: float  # along the optical axis of the frame that showed it
    sigma_cm: float
    how: str  # depth method, or "foot" where it only stands on the floor there
    left_cm: tuple[float, float]  # (x, z) of its ends as seen from the camera
    right_cm: tuple[float, float]
    t_s: float

    def __str__(self) -> str:
        return f"region {self.region} at {self.depth_cm:.0f} ±{self.sigma_cm:.1f} cm ({self.how})"


class ObstacleMap:
    """Grid of evidence in the odometry frame, and the last sighting of every region.

    ``evidence`` is (N, N) float32 log-odds, row = z, column = x, cell centres at
    ``(index + 0.5) * cell - half``; ``region`` holds the id that last filled each cell.
    """

    def __init__(self, body: BodyConfig, config: NavConfig):
        self.body, self.config = body, config
        side = 2 * round(config.map_half_cm / config.cell_cm)
        self.evidence = np.zeros((side, side), np.float32)
        self.region = np.full((side, side), NO_REGION, np.int32)
        self.obstacles: dict[int, Obstacle] = {}
        self._half = side // 2 * config.cell_cm
        self.centres_cm = (np.arange(side) + 0.5) * config.cell_cm - self._half
        self._t_s: float | None = None
        self.floor = FloorFinder(body.camera_height_cm)

    # ---- asking ----

    @property
    def occupied(self) -> np.ndarray:
        return self.evidence > OCCUPIED

    @property
    def free(self) -> np.ndarray:
        return self.evidence < FREE

    def cell_of(self, x_cm: float, z_cm: float) -> tuple[int, int]:
        """(row, column) of a point, kept within the grid."""
        last = len(self.centres_cm) - 1
        cell = self.config.cell_cm
        row, col = (math.floor((v + self._half) / cell) for v in (z_cm, x_cm))
        return min(max(row, 0), last), min(max(col, 0), last)

    def point_of(self, row: int, col: int) -> tuple[float, float]:
        """(x, z) of a cell's centre, cm."""
        return float(self.centres_cm[col]), float(self.centres_cm[row])

    def points_where(self, mask: np.ndarray) -> np.ndarray:
        """(N, 2) x, z of the cells of a mask, cm."""
        rows, cols = np.nonzero(mask)
        return np.column_stack([self.centres_cm[cols], self.centres_cm[rows]])

    def obstacle_at(self, row: int, col: int) -> Obstacle | None:
        return self.obstacles.get(int(self.region[row, col]))

    # ---- learning ----

    def stand_on(self, x_cm: float, z_cm: float) -> None:
        """The robot stands here, so here is free."""
        r = self.body.radius_cm
        near = (self.centres_cm[None, :] - x_cm) ** 2 + (self.centres_cm[:, None] - z_cm) ** 2 < r * r
        self.evidence[near] = np.minimum(self.evidence[near], 2 * FREE)

    def update(self, snapshot: Snapshot, report: DepthReport, pose: Pose, lens: Lens) -> None:
        """Take in one frame. The pose is the camera's, level up to SIGMA_RAY."""
        self._fade(pose.t_s)
        labels = label_image(snapshot, lens)
        rays = rays_of(labels.shape, lens, pose)
        floor, unsure = self.floor.update(snapshot, report, pose, labels, rays)
        feet = _Feet(labels, floor, rays, self.body.camera_height_cm)
        free_to = feet.depth_cm - 2 * feet.sigma_cm
        bars = []  # (columns, depth per column, sigma, region, weight)
        for region in snapshot.regions:
            if self.floor.is_floor(region.id) or self.floor.is_mixed(region.id):
                continue
            found = self._place(region, report, feet, labels, pose)
            if found is not None:
                obstacle, columns, depth, weight = found
                self.obstacles[region.id] = obstacle
                bars.append((columns, depth, obstacle.sigma_cm, region.id, weight))
                free_to[columns] = np.minimum(free_to[columns], depth - 2 * obstacle.sigma_cm)
        self._paint(pose, lens, feet, free_to, unsure.any(axis=0), bars)

    def _fade(self, t_s: float) -> None:
        if self._t_s is not None:
            self.evidence *= math.exp(-max(0.0, t_s - self._t_s) / self.config.memory_s)
        self._t_s = t_s
        self.obstacles = {k: o for k, o in self.obstacles.items() if t_s - o.t_s < 2 * self.config.memory_s}

    # ---- where a region stands ----

    def _place(self, region: Region, report: DepthReport, feet: _Feet, labels, pose: Pose):
        """(obstacle, image columns, depth per column, weight) of a region, or None while nothing is known.

        With a foot, its shape across the columns is the foot's and its mean is the weighted mean of
        measured depth and foot; where the two contradict each other the nearer one counts.
        """
        z = s = None
        how = "foot"
        measured = _depth_of(report, region)
        if measured is not None and measured[1] < 0.25 * measured[0] and measured[0] < 1.5 * RANGE_CM:
            z, s, how = measured
        columns = np.nonzero((feet.region == region.id) & ~feet.cut)[0]
        if len(columns) >= 3:
            foot = feet.depth_cm[columns]
            mean = float(foot.mean())
            sigma = float(feet.sigma_cm[columns].mean())
            if sigma > 0.3 * mean and z is None:
                return None
            if z is None or s is None:
                z, s, scale, weight = mean, sigma, 1.0, 0.5
            elif abs(z - mean) < 3 * math.hypot(s, sigma):
                share = sigma**2 / (s**2 + sigma**2)
                z = share * z + (1 - share) * mean
                s = s * sigma / math.hypot(s, sigma)
                scale, weight = z / mean, 1.0
            elif z < mean:
                scale, weight = z / mean, 0.7
            else:
                z, s, scale, how, weight = mean, sigma, 1.0, "foot", 0.5
            depth = foot * scale
        else:
            columns = np.nonzero((labels == region.id).any(axis=0))[0]
            if len(columns) == 0:
                return None
            if z is None or s is None:
                cut = np.nonzero((feet.region == region.id) & feet.cut)[0]
                if len(cut) < 3 or self._filled_within(feet, cut, pose):
                    return None
                columns, how, weight = cut, "at the lower border", 0.3
                z = float(feet.depth_cm[cut].mean())
                s = 0.25 * z
            else:
                weight = 0.7
            depth = np.full(len(columns), z)
        left = feet.point(pose, int(columns[0]), float(depth[0]))
        right = feet.point(pose, int(columns[-1]), float(depth[-1]))
        obstacle = Obstacle(region.id, float(z), float(s), how, left, right, pose.t_s)
        return obstacle, columns, depth, weight

    def _filled_within(self, feet: _Feet, columns: np.ndarray, pose: Pose) -> bool:
        """Whether the map already remembers something nearer than the lower border in these columns."""
        middle = int(columns[len(columns) // 2])
        for d in np.arange(0.0, float(feet.depth_cm[middle]) + self.config.cell_cm, self.config.cell_cm):
            if self.evidence[self.cell_of(*feet.point(pose, middle, d))] > OCCUPIED:
                return True
        return False

    # ---- the grid ----

    def _paint(self, pose: Pose, lens: Lens, feet: _Feet, free_to, unsure, bars) -> None:
        width = len(free_to)
        x0, z0 = float(pose.position_cm[0]), float(pose.position_cm[2])
        r0, c0 = self.cell_of(x0 - RANGE_CM, z0 - RANGE_CM)
        r1, c1 = self.cell_of(x0 + RANGE_CM, z0 + RANGE_CM)
        dx = self.centres_cm[None, c0 : c1 + 1] - x0
        dz = self.centres_cm[r0 : r1 + 1, None] - z0
        heading = heading_of(pose)
        depth = (dx * math.sin(heading) + dz * math.cos(heading)).ravel()
        side = (dx * math.cos(heading) - dz * math.sin(heading)).ravel()
        ahead = np.nonzero((depth > 1.0) & (np.abs(side) < depth * lens.width / lens.fx))[0]
        depth, side = depth[ahead], side[ahead]
        pixel = lens.to_pixels(np.column_stack([side / depth, np.zeros(len(depth))]))[:, 0]
        column = np.floor((pixel + 0.5) / STEP_PX).astype(int)
        seen = (column >= 0) & (column < width) & (depth < RANGE_CM)
        ahead, depth, column = ahead[seen], depth[seen], column[seen]

        rows, cols = np.divmod(ahead, c1 - c0 + 1)
        rows, cols = rows + r0, cols + c0
        before = self.evidence[rows, cols]
        change = np.zeros(len(depth), np.float32)
        half = self.config.cell_cm / 2
        empty = (depth < free_to[column] - half) & (depth > feet.nearest_cm)
        doubtful = empty & unsure[column]
        change[empty] = -0.4
        change[doubtful] = np.where((before > OCCUPIED) | (before < BARELY_FREE), 0.0, -0.2)[doubtful]
        filled = np.full(len(depth), NO_REGION, np.int32)
        for columns, bar, sigma, region, weight in bars:
            at = np.full(width, np.nan)
            at[columns] = bar
            back = max(SHELL_CM, sigma)
            front = min(half + 0.5 * sigma, 3 * half)
            wide = bar.mean() * len(columns) * STEP_PX / lens.fx
            off = depth - at[column]
            hit = (off > -front) & (off < back)
            if weight < 0.5:
                hit &= before < PRESUMED
            change[hit] = np.maximum(change[hit], weight)
            behind = (off >= back) & (off < min(wide, DEEPEST_CM)) & (np.abs(before) < PRESUMED)
            change[behind] = np.maximum(change[behind], weight)
            filled[hit | behind] = region
        self.evidence[rows, cols] = np.clip(before + change, -LIMIT, LIMIT)
        self.region[rows, cols] = np.where(filled != NO_REGION, filled, self.region[rows, cols])


def _depth_of(report: DepthReport, region: Region) -> tuple[float, float, str] | None:
    """(depth in cm, sigma in cm, method) of a region, or None where the motion supports none."""
    found = report.regions.get(region.id)
    if found is None or found.depth_cm is None or found.sigma_cm is None:
        return None
    return found.depth_cm, found.sigma_cm, found.method or "depth"


class _Feet:
    """Per image column the first thing above the floor: its region, depth of its foot and sigma.

    ``cut`` marks columns where the floor is not seen at all: the foot is at or below the image's border.
    """

    def __init__(self, labels: np.ndarray, floor: np.ndarray, rays: Rays, height_cm: float):
        rows, cols = labels.shape
        floor = floor | (labels == NO_REGION)
        stop = np.argmax(~floor[::-1], axis=0)  # floor pixels from the bottom up to the first foot
        open_ended = floor.all(axis=0)
        row = np.where(open_ended, 0, rows - 1 - stop)
        column = np.arange(cols)
        self.region = np.where(open_ended, NO_REGION, labels[row, column])
        self.cut = (stop == 0) & ~open_ended
        # the foot's ray passes between the foot's pixel and the floor's pixel below it
        below = np.minimum(row + 1, rows - 1)
        down = np.maximum(0.5 * (rays.down[row, column] + rays.down[below, column]), 1e-6)
        self.depth_cm = np.minimum(height_cm / down, FARTHEST_CM)
        self.sigma_cm = self.depth_cm**2 / height_cm * SIGMA_RAY
        self.nearest_cm = float(height_cm / rays.down[-1].max())
        self._across = rays.across

    def point(self, pose: Pose, column: int, depth_cm: float) -> tuple[float, float]:
        """(x, z) in the odometry frame of a depth in an image column."""
        heading = heading_of(pose)
        side = self._across[column] * depth_cm
        x = pose.position_cm[0] + depth_cm * math.sin(heading) + side * math.cos(heading)
        z = pose.position_cm[2] + depth_cm * math.cos(heading) - side * math.sin(heading)
        return float(x), float(z)
