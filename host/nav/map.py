"""What stands around the robot: regions with depth become obstacles on a grid in the odometry frame.

Floor frees the ground up to the first thing that stands on it; cells nobody looked at stay unknown, for
unseen is not free. Each cell holds log-odds: contradictory evidence wins within a few frames, and all
evidence fades with time.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from host.camera.lens import Lens
from host.depth.report import DepthReport
from host.nav import _nav
from host.nav.config import BodyConfig, NavConfig
from host.nav.floor import FloorFinder
from host.nav.front import Sight
from host.nav.odometry import heading_of
from host.nav.picture import NO_REGION, STEP_PX, Picture, rays_of
from host.nav.stand import AT_BORDER, SURE, Feet, Standing, stand_of, usable_depth
from host.nav.tracks import LONG_HELD_S, Mover, Tracks
from host.pose import Pose
from host.rbdn.snapshot import Snapshot

FRONT_POINTS = 13  # of an obstacle's front that are looked at
RANGE_CM = 300.0  # evidence is taken up to here
SHELL_CM = 8.0  # how far behind a seen surface its cells are filled
DEEPEST_CM = 40.0  # things are taken to be as deep as they are wide, up to this, until floor is seen there
OCCUPIED, FREE = 0.8, -0.4  # log-odds beyond which a cell counts as one or the other
LIMIT = 4.0
SEEN_EMPTY = -0.4  # log-odds a frame of bare floor is worth
LOOKED_OVER = -0.2  # and what is known at least of a cell that something farther was seen over
LOOKED = -0.1  # log-odds below which a cell was looked at, if only over it
FRONT_GAIN = 0.1  # share of one frame in what is remembered of a thing's front
SURPRISE = 0.7  # log-odds a frame is worth that shows a thing below which the map knows nothing but floor
DOUBT = -0.5  # and what is left of that floor
NEARER = 0.5  # a thing whose foot is below the picture is taken to be this part nearer than the border
MEMORY_CM = 1500.0  # evidence fades to 1/e over so much travel
MEMORY_RAD = 30.0  # or so much turning
DRIFT = 0.02  # of the way gone since a thing was seen, its place may be off by
TURNS_RAD_S = 0.2  # who turns faster finds nothing new that moves
TURNS_OVER_S = 0.25  # taken over so long: from picture to picture the heading jitters
RESTLESS = 8  # pictures that show something move nobody knows where to, until that is believed
LEFT = -0.6  # log-odds of the floor that something left
KNOWN_CM = 50.0  # of its line on which what moves may be; on more, its place is better told by the picture
MOVER_CM = 30.0  # what stands no farther from where a mover should be, in its direction, is it
PASSED_S = 3.0  # where it was seen not longer ago than this nothing else stands
BRIEF = 2.0  # what moves, and what nobody knows the place of, never counts for more
VAGUE_CM = 20.0  # what is known no better shuts no cell: ways over it are dear, until it is seen from nearer,
VAGUE_FROM_CM = 120.0  # if it is as far as this
VAGUE = 0.5  # and never counts for more
ALIKE = 1.25  # parts of a wall whose depths differ by less than this factor have one sigma
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
    moving: bool = False
    velocity_cm_s: tuple[float, float] | None = None  # (x, z), where it is known to move
    eye_cm: tuple[float, float] | None = None  # (x, z) it was seen from
    gone_cm: float = 0.0  # how far the robot had gone by then

    def __str__(self) -> str:
        how = f"{self.how}, moving" if self.moving else self.how
        return f"region {self.region} at {self.depth_cm:.0f} ±{self.sigma_cm:.1f} cm ({how})"


class ObstacleMap:
    """Grid of evidence in the odometry frame, and the last sighting of every region.

    ``evidence`` is (N, N) float32 log-odds, row = z, column = x, cell centres at
    ``(index + 0.5) * cell - half``; ``region`` holds the id that last filled each cell, ``brief`` is True
    where that was something that moves, or that stood somewhere below the picture.
    """

    def __init__(self, body: BodyConfig, config: NavConfig):
        self.body, self.config = body, config
        side = 2 * round(config.map_half_cm / config.cell_cm)
        self.evidence = np.zeros((side, side), np.float32)
        self.region = np.full((side, side), NO_REGION, np.int32)
        self.brief = np.zeros((side, side), bool)
        self.obstacles: dict[int, Obstacle] = {}
        self.movers: list[Mover] = []  # also for a while after they went out of sight
        self._tracks = Tracks()
        self._restless: dict[int, int] = {}  # pictures one after the other in which a region's depth moved
        self._front_cm: dict[int, float] = {}  # before a region's mean depth
        self._half = side // 2 * config.cell_cm
        self.centres_cm = (np.arange(side) + 0.5) * config.cell_cm - self._half
        self._gone_cm = 0.0
        self._last: tuple[float, float, float, float] | None = None  # time, x, z, heading
        self._headings: deque[tuple[float, float]] = deque()  # of the last while, with their times
        self.floor = FloorFinder(body.camera_height_cm)
        self.sight: Sight | None = None  # of the newest frame

    # ---- asking ----

    @property
    def half_cm(self) -> float:
        """How far the grid reaches from the start on every side."""
        return self._half

    @property
    def occupied(self) -> np.ndarray:
        return self.evidence > OCCUPIED

    @property
    def lasting(self) -> np.ndarray:
        """What is occupied, but for where something moves that will be gone."""
        moving = {thing.region for thing in self.obstacles.values() if thing.moving}
        moving |= {mover.region for mover in self.movers}
        occupied = self.occupied
        return occupied & ~(self.brief & np.isin(self.region, list(moving))) if moving else occupied

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

    def sigma_at(self, obstacle: Obstacle, place_cm: tuple[float, float]) -> float:
        """Of where an obstacle stands about a place (x, z): as it was seen, and more for the way since then.

        Of a wall seen from near to far the mean's sigma says little: it grows as the distance squared.
        """
        share = 1.0 if obstacle.eye_cm is None else math.dist(obstacle.eye_cm, place_cm) / obstacle.depth_cm
        return math.hypot(obstacle.sigma_cm * share**2, DRIFT * (self._gone_cm - obstacle.gone_cm))

    def stands(self, obstacle: Obstacle) -> bool:
        """Whether what was seen to stand there still does: at least a part of its front is filled."""
        (x0, z0), (x1, z1) = obstacle.left_cm, obstacle.right_cm
        parts = np.linspace(0.0, 1.0, FRONT_POINTS).tolist()
        return any(self._filled_near(x0 + p * (x1 - x0), z0 + p * (z1 - z0)) for p in parts)

    def standing(self) -> list[Obstacle]:
        """The obstacles that still stand where they were last seen."""
        return [obstacle for obstacle in self.obstacles.values() if self.stands(obstacle)]

    def _filled_near(self, x_cm: float, z_cm: float) -> bool:
        row, col = self.cell_of(x_cm, z_cm)
        near = self.evidence[max(0, row - 1) : row + 2, max(0, col - 1) : col + 2]
        return bool((near > OCCUPIED).any())

    # ---- learning ----

    def stand_on(self, x_cm: float, z_cm: float) -> None:
        """The robot stands here, so here is free."""
        r = self.body.radius_cm
        most = r + self.config.cell_cm
        r0, c0 = self.cell_of(x_cm - most, z_cm - most)
        r1, c1 = self.cell_of(x_cm + most, z_cm + most)
        here = slice(r0, r1 + 1), slice(c0, c1 + 1)
        dx, dz = self.centres_cm[here[1]] - x_cm, self.centres_cm[here[0]] - z_cm
        square = dx[None, :] ** 2 + dz[:, None] ** 2
        evidence = self.evidence[here]
        evidence[square < r * r] = np.minimum(evidence[square < r * r], 2 * FREE)
        touched = (square < (r + self.config.cell_cm / 2) ** 2) & (np.abs(evidence) < -LOOKED_OVER)
        evidence[touched] = LOOKED_OVER

    def blind_spots(self, x_cm: float, z_cm: float, heading_rad: float, reach_cm: float) -> np.ndarray:
        """(N, 2) x, z of cells, never looked at, that the disc comes to on its way so far along a heading."""
        r, half = self.body.radius_cm, self.config.cell_cm / 2
        most = r + reach_cm + 2 * half
        r0, c0 = self.cell_of(x_cm - most, z_cm - most)
        r1, c1 = self.cell_of(x_cm + most, z_cm + most)
        evidence = self.evidence[r0 : r1 + 1, c0 : c1 + 1]
        rows, cols = np.nonzero((evidence >= LOOKED) & (evidence <= OCCUPIED))
        points = np.column_stack([self.centres_cm[cols + c0], self.centres_cm[rows + r0]])
        dx, dz = points[:, 0] - x_cm, points[:, 1] - z_cm
        along = dx * math.sin(heading_rad) + dz * math.cos(heading_rad)
        aside = np.abs(dx * math.cos(heading_rad) - dz * math.sin(heading_rad))
        gap = along - half - np.sqrt(r * r - np.minimum(aside, r) ** 2)
        return points[(along > 0) & (aside < r + half) & (gap < reach_cm)]

    def set_down(self, x_cm: float, z_cm: float, room_cm: float) -> None:
        """Whoever set the robot down here has looked so far around its rim."""
        dx, dz = self.centres_cm[None, :] - x_cm, self.centres_cm[:, None] - z_cm
        around = np.hypot(dx, dz) < self.body.radius_cm + room_cm
        self.evidence[around & (self.evidence == 0.0)] = LOOKED_OVER

    def shut(self, points_cm: np.ndarray) -> None:
        """Something hides these places (N, 2) from a camera that looks at them; not those seen by now."""
        for x, z in points_cm.tolist():
            at = self.cell_of(x, z)
            if LOOKED <= self.evidence[at] <= OCCUPIED:
                self.evidence[at], self.region[at], self.brief[at] = BRIEF, NO_REGION, True

    def update(
        self,
        snapshot: Snapshot,
        report: DepthReport,
        pose: Pose,
        lens: Lens,
        image: np.ndarray | None = None,
    ) -> None:
        """Take in one frame. The pose is the camera's, level up to SIGMA_RAY.

        The image, BGR, is looked at where the net has made one region of floor and wall.
        """
        self._fade(pose)
        picture = Picture(snapshot, lens, rays_of(lens, pose))
        self.floor.update(snapshot, report, pose, picture, image)
        feet = Feet(picture, self.floor, pose, self.body.camera_height_cm)
        standing: list[Standing] = []
        movers: set[int] = set()
        near = self._mover_near(feet, pose)
        for region in snapshot.regions:
            if self.floor.is_floor(region.id):
                continue
            mixed = self.floor.is_mixed(region.id)
            velocity = None
            if mixed:
                self._tracks.see_mixed(region.id, feet, pose.t_s)
            else:
                velocity = self._tracks.velocity(region.id, feet, pose.t_s)
            restless = self._count_restless(region.id, report)
            moving = velocity is not None or (restless >= RESTLESS and not self._tracks.stands(region.id))
            front = self._front_cm.get(region.id)
            found = stand_of(region.id, report, feet, picture, front, mixed, moving)
            if found is None or (found.how == AT_BORDER and self._remembers(found, feet)):
                continue
            if found.how == "foot" and (cut := found.where(feet.cut)) and self._remembers(cut, feet):
                if (rest := found.where(~feet.cut)) is not None:
                    standing.append(rest)
                continue
            if near is not None and found.how == AT_BORDER:  # where that is, it knows better than its foot
                mover, columns = near
                if not mixed and float(columns[found.columns].mean()) > 0.5:
                    movers.add(region.id)
                    self.obstacles[region.id] = _obstacle(
                        found, feet, pose.t_s, self._gone_cm, True, mover.velocity_cm_s
                    )
                    continue
                if (found := found.where(~columns)) is None:
                    continue
            standing.append(found)
            self._learn_front(found, report)
            if moving:
                movers.add(region.id)
            self.obstacles[region.id] = _obstacle(found, feet, pose.t_s, self._gone_cm, moving, velocity)
        self.movers = self._tracks.movers
        for region_id in movers:  # it is no longer where it was, and what it stood on is floor
            self.evidence[(self.region == region_id) & (self.evidence > 0.0)] = LEFT
        for mover in self.movers:  # by and by its region is something else, which the net gives the name to
            if mover.certain and pose.t_s - mover.named_s < LONG_HELD_S:
                self.evidence[(self.region == mover.region) & self.brief & (self.evidence > 0.0)] = LEFT
        self._tracks.look_for(feet, pose.t_s)
        resting = tuple(one for one in standing if one.region not in movers)
        camera = float(pose.position_cm[0]), float(pose.position_cm[2])
        self.sight = Sight(feet, resting, camera, heading_of(pose), pose.t_s)
        self._paint(pose, lens, feet, standing, movers)
        for mover in self.movers:
            if mover.understood:
                self._clear_line(mover, pose.t_s)

    def _count_restless(self, region_id: int, report: DepthReport) -> int:
        """In how many pictures on end its depth says that it moves; those taken in a turn do not count.

        In a turn all outlines go far and the heading errs with them: what stands seems to move for seconds.
        """
        told = report.regions.get(region_id)
        moves = told is not None and told.moving
        before = self._restless.get(region_id, 0)
        self._restless[region_id] = before + (not self._tracks.turns) if moves else 0
        return self._restless[region_id]

    def _mover_near(self, feet: Feet, pose: Pose) -> tuple[Mover, np.ndarray] | None:
        """The nearest mover whose foot may be below the picture, and in which columns (W / 2,).

        Only where its place is known better than a foot below the picture tells it.
        """
        near = []
        for mover in self.movers:
            if not mover.certain or mover.lost:
                continue
            low, high = mover.reach(np.array([pose.t_s]))
            seen = mover.seen_between(pose) if high[0] - low[0] < KNOWN_CM else None
            if seen is not None and (gap := mover.nearest_cm(pose)) < feet.nearest_cm + MOVER_CM:
                near.append((gap, mover, (feet.across > seen[0]) & (feet.across < seen[1])))
        return min(near, key=lambda one: one[0])[1:] if near else None

    def _clear_line(self, mover: Mover, t_s: float) -> None:
        """Nothing stands where a mover was just seen to pass; nothing out of sight where it ever does."""
        low, high = mover.been_cm
        ends = np.array(mover.origin_cm) + np.array([[low], [high]]) * mover.ahead
        row0, col0 = self.cell_of(*(ends.min(axis=0) - mover.half_cm))
        row1, col1 = self.cell_of(*(ends.max(axis=0) + mover.half_cm))
        window = slice(row0, row1 + 1), slice(col0, col1 + 1)
        x, z = np.meshgrid(self.centres_cm[window[1]], self.centres_cm[window[0]])
        on, off = mover.along(x, z)
        now_low, now_high = mover.reach(np.array([t_s]))
        passed = (np.abs(off) < mover.half_cm - self.config.cell_cm / 2) & (on > low) & (on < high)
        passed &= (on < now_low - mover.half_cm) | (on > now_high + mover.half_cm)
        seen = [mover.along(one.x_cm, one.z_cm)[0] for one in mover.sights if t_s - one.t_s < PASSED_S]
        just = (on > min(seen)) & (on < max(seen)) if seen else np.zeros_like(passed)
        evidence = self.evidence[window]
        evidence[passed & (self.brief[window] | just) & (evidence > LEFT)] = LEFT

    def keep_movers(self, before: ObstacleMap) -> None:
        """What moved before all else was forgotten does so still."""
        self._tracks.keep_movers(before._tracks)

    def _learn_front(self, standing: Standing, report: DepthReport) -> None:
        """By how much the front lies before the mean depth, from when the thing is seen to stand."""
        measured = usable_depth(report, standing.region)
        if measured is None or standing.weight != SURE:
            return
        front = max(0.0, measured[0] - _median(standing.depth_cm))
        before = self._front_cm.get(standing.region, front)
        self._front_cm[standing.region] = before + FRONT_GAIN * (front - before)

    def _remembers(self, standing: Standing, feet: Feet) -> bool:
        """Whether something was seen to stand at least as near as the lower border there."""
        column = int(standing.columns[len(standing.columns) // 2])
        border = float(feet.depth_cm[column])
        depths = np.arange(0.0, border + self.config.cell_cm, self.config.cell_cm).tolist()
        cells = [self.cell_of(*feet.point(column, d)) for d in depths]
        return any(self.evidence[cell] > OCCUPIED and not self.brief[cell] for cell in cells)

    def _fade(self, pose: Pose) -> None:
        """Less is known of what was seen long ago, and of where it is after much travel and many turns."""
        t_s, heading = pose.t_s, heading_of(pose)
        x, z = float(pose.position_cm[0]), float(pose.position_cm[2])
        turns = False
        if self._last is not None:
            last_s, last_x, last_z, last_heading = self._last
            turn = math.remainder(heading - last_heading, 2 * math.pi)
            turns = self._turns(t_s, heading)
            age = max(0.0, t_s - last_s) / self.config.memory_s
            gone_cm = math.hypot(x - last_x, z - last_z)
            self._gone_cm += gone_cm
            age += gone_cm / MEMORY_CM + abs(turn) / MEMORY_RAD
            self.evidence *= math.exp(-age)
        self._last = t_s, x, z, heading
        self.obstacles = {k: o for k, o in self.obstacles.items() if t_s - o.t_s < 2 * self.config.memory_s}
        self._tracks.forget(t_s, turns)
        self._restless = {k: count for k, count in self._restless.items() if count}
        self._front_cm = {k: front for k, front in self._front_cm.items() if k in self.obstacles}

    def _turns(self, t_s: float, heading: float) -> bool:
        """Whether the robot turns, over more than one picture: between two its heading jitters."""
        headings = self._headings
        headings.append((t_s, heading))
        while len(headings) > 2 and t_s - headings[1][0] >= TURNS_OVER_S:
            headings.popleft()
        since_s, before = headings[0]
        turned = abs(math.remainder(heading - before, 2 * math.pi))
        return turned > TURNS_RAD_S * max(t_s - since_s, 1e-3)

    # ---- the grid ----

    def _paint(self, pose: Pose, lens: Lens, feet: Feet, standing: list[Standing], movers: set[int]) -> None:
        """Change the evidence of the cells in view."""
        x0, z0 = float(pose.position_cm[0]), float(pose.position_cm[2])
        heading = heading_of(pose)
        sine, cosine = math.sin(heading), math.cos(heading)
        left, right = float(feet.across[0]) - 0.02, float(feet.across[-1]) + 0.02
        corners_x = [x0, *(x0 + RANGE_CM * (sine + a * cosine) for a in (left, right))]
        corners_z = [z0, *(z0 + RANGE_CM * (cosine - a * sine) for a in (left, right))]
        r0, c0 = self.cell_of(min(corners_x), min(corners_z))
        r1, c1 = self.cell_of(max(corners_x), max(corners_z))
        rays, pixels = _level_line(lens)
        _nav.paint(
            self.evidence,
            self.region,
            self.brief,
            self.centres_cm,
            _nav.View(x0, z0, sine, cosine, left, right, RANGE_CM, lens.fx, lens.cx, rays, pixels, STEP_PX),
            (r0, r1, c0, c1),
            _nav.Floor(feet.free_cm, feet.floor_cm, feet.cut | feet.unknown, feet.nearest_cm),
            [
                self._front(part, lens, feet, thing.region in movers)
                for thing in standing
                for part in _parts(thing)
            ],
            _nav.Rules(SEEN_EMPTY, LOOKED_OVER, PRESUMED, LIMIT, self.config.cell_cm),
        )

    def _front(self, thing: Standing, lens: Lens, feet: Feet, moves: bool) -> _nav.Front:
        """A thing and what it is worth to the cells where it stands."""
        half = self.config.cell_cm / 2
        if thing.how == AT_BORDER:  # there or nearer, where the map knows of nothing
            begins, ends, sure, at_least = -NEARER * feet.nearest_cm, SHELL_CM, math.inf, DOUBT
        else:
            begins, sure = -min(half + 0.5 * thing.sigma_cm, 3 * half), max(SHELL_CM, thing.sigma_cm)
            ends, at_least = max(sure, min(thing.width_cm(lens), DEEPEST_CM)), -math.inf
        fleeting = moves or thing.how == AT_BORDER
        if moves:  # it is there now
            at_least, change = 0.0, SURE
        else:
            change = SURPRISE if fleeting else thing.weight
        vague = thing.sigma_cm > VAGUE_CM and float(thing.depth_cm.min()) > VAGUE_FROM_CM
        most = VAGUE if vague else LIMIT
        return _nav.Front(
            thing.region,
            thing.columns,
            thing.depth_cm,
            thing.sigma_cm,
            begins,
            ends,
            sure,
            at_least,
            change,
            BRIEF if fleeting else most,
            fleeting,
        )


def _parts(thing: Standing) -> list[Standing]:
    """What reaches from near to far, in parts with a sigma each: it grows as the depth squared."""
    near, far = float(thing.depth_cm.min()), float(thing.depth_cm.max())
    if thing.how == AT_BORDER or far < ALIKE * near:
        return [thing]
    step = (np.log(thing.depth_cm / near) / math.log(ALIKE)).astype(np.int64)
    parts = []
    for k in range(int(step.max()) + 1):
        mine = (step == k).nonzero()[0]
        if len(mine) == 0:
            continue
        columns, depth = thing.columns[mine], thing.depth_cm[mine]
        mean = float(depth.sum()) / len(depth)
        sigma = thing.sigma_cm * (mean / thing.mean_cm) ** 2
        parts.append(replace(thing, columns=columns, depth_cm=depth, mean_cm=mean, sigma_cm=sigma))
    return parts


@lru_cache(maxsize=2)
def _level_line(lens: Lens) -> tuple[np.ndarray, np.ndarray]:
    """X/Z of level rays across the image and beyond it, and the image x of each; none without distortion."""
    if not any(lens.distortion):
        return np.empty(0), np.empty(0)
    rays = np.linspace(-1.2, 1.2, 4 * lens.width) * lens.width / lens.fx
    return rays, lens.to_pixels(np.column_stack([rays, np.zeros(len(rays))]))[:, 0]


def _median(values: np.ndarray) -> float:
    ordered = np.sort(values)
    return (float(ordered[(len(ordered) - 1) // 2]) + float(ordered[len(ordered) // 2])) / 2


def _obstacle(
    standing: Standing,
    feet: Feet,
    t_s: float,
    gone_cm: float,
    moving: bool,
    velocity: tuple[float, float] | None,
) -> Obstacle:
    left = feet.point(int(standing.columns[0]), float(standing.depth_cm[0]))
    right = feet.point(int(standing.columns[-1]), float(standing.depth_cm[-1]))
    z, sigma, eye = standing.mean_cm, standing.sigma_cm, feet.point(0, 0.0)
    return Obstacle(standing.region, z, sigma, standing.how, left, right, t_s, moving, velocity, eye, gone_cm)
