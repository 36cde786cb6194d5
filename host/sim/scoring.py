"""How a drive truly went. Nothing in here may reach what drives; it is called beside it or afterwards."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from host.depth.report import DepthReport
from host.nav.picture import STEP_PX
from host.nav.stand import AT_BORDER, Standing
from host.pose import Pose
from host.rbdn.snapshot import Snapshot
from host.sim.render import Renderer, TrueFrame
from host.sim.session import Simulation

DEPTH_EVERY_S = 0.5  # neighbouring frames have nearly the same errors, and truth takes as long as a picture
MOST_SAMPLES = 20_000  # kept of a drive; beyond, those of every second look are let go
SMALLEST_PX = 20  # regions with fewer pixels have no truth worth the name
FALSE_STOP_CM = 20.0  # with so much room straight before the rim nothing was there to stop for
SLIPPED_S = 1.0  # but for a wheel that truly slipped within so long,
COMES_S = 10.0  # or something that moves and comes by so soon
COMES_CM = 60.0  # so near ahead of the rim
FARTHEST_CM = 150.0  # room ahead is looked for up to here
LOOK_STEP_CM = 0.1
NEAREST_PART = 5.0  # percent of what a region shows in a column that may lie nearer than its nearest there
LEAST_PX = 4  # of a region in a column to know its depth there
LEVEL = ("floor", "ceiling")  # what nothing stands on as a front


@dataclass(frozen=True)
class DepthSample:
    """One region's depth against the truth."""

    t_s: float
    region: int
    object_id: int  # that most of the region's pixels show
    background: bool  # part of the room: floor, wall or ceiling
    depth_cm: float
    sigma_cm: float | None
    true_cm: float  # mean over the region's pixels that show the object

    @property
    def error(self) -> float:
        """Relative, positive when too far."""
        return self.depth_cm / self.true_cm - 1.0


def score_depths(
    snapshot: Snapshot, report: DepthReport, truth: TrueFrame, background: Iterable[int], t_s: float = 0.0
) -> list[DepthSample]:
    """Every region that has a depth, against the truth of the same frame.

    Parameters
    ----------
    snapshot, report
        Of one frame.
    truth
        Of the same frame.
    background
        Ids of the objects that belong to the room.
    t_s
        When the frame was taken.
    """
    room = frozenset(background)
    samples = []
    for region in snapshot.regions:
        found = report.regions.get(region.id)
        if found is None or found.depth_cm is None:
            continue
        mask = region_mask(region.loops, truth.object_id.shape)
        ids = truth.object_id[mask]
        if len(ids) < SMALLEST_PX:
            continue
        owner = int(np.bincount(ids).argmax())
        if owner == 0:
            continue
        true_cm = float(truth.depth_cm[mask & (truth.object_id == owner)].mean(dtype=float))
        samples.append(
            DepthSample(t_s, region.id, owner, owner in room, found.depth_cm, found.sigma_cm, true_cm)
        )
    return samples


def score_fronts(
    standing: Iterable[Standing], snapshot: Snapshot, truth: TrueFrame, renderer: Renderer, t_s: float = 0.0
) -> list[DepthSample]:
    """Where everything stands on the map, by which it is driven, against the truth of the same frame.

    A front is compared column by column with the nearest that its region truly shows there; the sample's
    error is the middle one of all columns. What is only known to be somewhere below the picture has none.
    """
    level = [number for number, name in renderer.object_names.items() if name in LEVEL]
    upright = ~np.isin(truth.object_id, [0, *level])
    loops = {region.id: region.loops for region in snapshot.regions}
    samples = []
    for one in standing:
        if one.how == AT_BORDER or one.region not in loops:
            continue
        mask = region_mask(loops[one.region], truth.object_id.shape) & upright
        ids = truth.object_id[mask]
        depths, errors = [], []
        for column, depth_cm in zip(one.columns.tolist(), one.depth_cm.tolist(), strict=True):
            across = slice(STEP_PX * column, STEP_PX * (column + 1))
            seen = truth.depth_cm[:, across][mask[:, across]]
            if len(seen) >= LEAST_PX:
                depths.append(depth_cm)
                errors.append(depth_cm / float(np.percentile(seen, NEAREST_PART)) - 1.0)
        if len(ids) < SMALLEST_PX or not errors:
            continue
        owner = int(np.bincount(ids).argmax())
        depth_cm = float(np.median(depths))
        true_cm = depth_cm / (1.0 + float(np.median(errors)))
        room = owner in renderer.background_ids
        samples.append(DepthSample(t_s, one.region, owner, room, depth_cm, one.sigma_cm, true_cm))
    return samples


@dataclass(frozen=True)
class Stop:
    """The robot, until then on its way, commanded itself to stand."""

    t_s: float
    reason: str
    true_room_cm: float  # straight before the rim, until something stands there
    gives_way: bool = False  # something that truly moves is about to come by ahead
    slipped: bool = False  # a wheel truly slipped just before

    @property
    def is_false(self) -> bool:
        """Nothing was there to stop for."""
        return self.true_room_cm >= FALSE_STOP_CM and not self.gives_way and not self.slipped


def region_mask(loops: Sequence[np.ndarray], shape: tuple[int, int]) -> np.ndarray:
    """Pixels (H, W) whose centres lie inside, even-odd over all loops, each (N, 2) in pixels."""
    height, width = shape
    begin = np.concatenate(loops)
    end = np.concatenate([np.roll(loop, -1, axis=0) for loop in loops])
    down = (begin[:, 1] <= end[:, 1])[:, None]
    (x0, y0), (x1, y1) = np.where(down, begin, end).T, np.where(down, end, begin).T
    first = np.maximum(np.ceil(y0), 0).astype(int)
    count = np.maximum(np.minimum(np.ceil(y1), height).astype(int) - first, 0)  # rows that an edge crosses
    edge = np.repeat(np.arange(len(count)), count)
    rows = first[edge] + np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    mask = np.zeros(shape, bool)
    if len(rows) == 0:
        return mask
    crossing = x0[edge] + (rows - y0[edge]) * ((x1 - x0)[edge] / (y1 - y0)[edge])
    columns = np.clip(np.ceil(crossing), 0, width).astype(int)
    top, left, right = rows.min(), columns.min(), columns.max()
    high, wide = rows.max() - top + 1, right - left + 1
    flips = np.bincount((rows - top) * wide + columns - left, minlength=high * wide).reshape(high, wide)
    mask[top : top + high, left:right] = np.cumsum(flips, axis=1)[:, :-1] & 1
    return mask


def every_second(samples: Sequence[DepthSample]) -> list[DepthSample]:
    """Those of every second frame, the first one's among them."""
    times = dict.fromkeys(sample.t_s for sample in samples)
    kept = set(list(times)[::2])
    return [sample for sample in samples if sample.t_s in kept]


def summarise(samples: Sequence[DepthSample]) -> dict[str, Any]:
    """Count, median and 90th percentile of the absolute error in percent of the depth; None without any."""
    errors = np.abs([100.0 * s.error for s in samples])
    return {
        "count": len(errors),
        "median_percent": round(float(np.median(errors)), 3) if len(errors) else None,
        "p90_percent": round(float(np.percentile(errors, 90)), 3) if len(errors) else None,
    }


class Score:
    """Truth about one simulated drive.

    Attributes
    ----------
    samples : list[DepthSample]
        From the frames that were looked at, one each half second; fewer of a drive of hours.
    fronts : list[DepthSample]
        Of the same frames: where things stand on the map.
    way : list[tuple[float, float, float]]
        Time, x and z in cm of the camera at the same times.
    stops : list[Stop]
        Every change from driving or turning to standing that does not end the drive.
    """

    def __init__(self, simulation: Simulation) -> None:
        self.samples: list[DepthSample] = []
        self.fronts: list[DepthSample] = []
        self.way: list[tuple[float, float, float]] = []
        self.stops: list[Stop] = []
        self._moves = False
        self._simulation = simulation
        self._looked_s = -math.inf
        self._every_s = DEPTH_EVERY_S

    def watch(
        self, stamp_s: float, snapshot: Snapshot, report: DepthReport, standing: Iterable[Standing] = ()
    ) -> None:
        """Take in what was made of the frame with this time on it; call within 30 s of it."""
        t_s = self._simulation.exposed_s(stamp_s)
        if t_s - self._looked_s < self._every_s:
            return
        self._looked_s = t_s
        pose = self._simulation.true_pose(t_s)
        self.way.append((t_s, float(pose.position_cm[0]), float(pose.position_cm[2])))
        renderer = self._simulation.renderer_at(t_s)
        truth = renderer.truth(pose, areas=False)
        self.samples += score_depths(snapshot, report, truth, renderer.background_ids, t_s)
        self.fronts += score_fronts(standing, snapshot, truth, renderer, t_s)
        if max(len(self.samples), len(self.fronts)) > MOST_SAMPLES:
            self.samples, self.fronts = every_second(self.samples), every_second(self.fronts)
            self.way = self.way[::2]
            self._every_s *= 2

    def hear(self, moves: bool, reason: str) -> None:
        """Take in what the robot was just told to do, and why; not the end of a drive."""
        if self._moves and not moves:
            now_s = self._simulation.clock.now_s()
            slipped = now_s - 1e-6 * self._simulation.body.slipped_us < SLIPPED_S
            self.stops.append(Stop(now_s, reason, self.room_ahead_cm(), self._something_comes(), slipped))
        self._moves = moves

    def room_ahead_cm(self) -> float:
        """How far the robot can now truly go straight on, at most FARTHEST_CM."""
        return self._room_at(0.0)

    def _room_at(self, after_s: float) -> float:
        """The same with everything as it will stand a while from now."""
        body = self._simulation.body
        x, z, heading = body.axle
        steps = np.arange(0.0, FARTHEST_CM, LOOK_STEP_CM)
        places = np.column_stack([x + steps * math.sin(heading), z + steps * math.cos(heading)])
        world = self._simulation.world.at(body.time_us * 1e-6 + after_s)
        shut = world.distance_cm(places) < body.radius_cm
        return float(steps[max(0, int(np.argmax(shut)) - 1)]) if shut.any() else FARTHEST_CM

    def _something_comes(self) -> bool:
        """Whether what moves, and is not what stands there anyway, soon leaves less room ahead."""
        if not self._simulation.world.movers:
            return False
        rooms = [self._room_at(after_s) for after_s in np.arange(0.0, COMES_S, 0.25)]
        return min(rooms) < min(COMES_CM, max(rooms))

    def pose_error(self, estimate: Pose) -> dict[str, float]:
        """Distance in cm and angle in degrees from the true camera pose at ``estimate.t_s``, or now.

        Raises
        ------
        ValueError
            That is more than 30 s ago.
        """
        t_s = min(estimate.t_s, self._simulation.clock.now_s())  # the estimate's clock may be a little ahead
        return pose_difference(estimate, self._simulation.true_pose(t_s))

    def summary(self, final: Pose | None, dead_reckoning: Pose | None = None) -> dict[str, Any]:
        """The part of result.json that needs the truth.

        Parameters
        ----------
        final
            Last estimate of the camera's pose, its time in ``t_s``; None if there is none.
        dead_reckoning
            The same by the wheels alone.

        Returns
        -------
        dict
            ``collisions`` that the robot drove into; ``run_into``, how often a mover ran into it while it
            stood; ``min_clearance_cm`` from the rim, also while standing; ``true_distance_cm`` of the axle's
            middle; ``room_ahead_cm`` at the end; ``final_pose_error`` {position_cm, heading_deg} or None,
            and so ``dead_reckoning_error``; ``depth_errors`` {count, median_percent, p90_percent} of all
            regions, and the same of those that are no part of the room in ``things``.
        """
        body = self._simulation.body
        error = None if final is None else self.pose_error(final)
        error_by_wheels = None if dead_reckoning is None else self.pose_error(dead_reckoning)
        things = [s for s in self.samples if not s.background]
        return {
            "collisions": body.collisions,
            "run_into": body.run_into,
            "min_clearance_cm": round(body.min_clearance_cm, 2),
            "true_distance_cm": round(body.distance_cm, 2),
            "room_ahead_cm": round(self.room_ahead_cm(), 2),
            "final_pose_error": error,
            "dead_reckoning_error": error_by_wheels,
            "depth_errors": {**summarise(self.samples), "things": summarise(things)},
        }


def pose_difference(estimate: Pose, truth: Pose) -> dict[str, float]:
    """``position_cm`` and ``heading_deg`` (of the whole rotation) between two poses."""
    turned = estimate.rotation.T @ truth.rotation
    sine = np.linalg.norm(
        [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
    )
    angle = math.atan2(float(sine) / 2, (float(np.trace(turned)) - 1) / 2)
    return {
        "position_cm": round(float(np.linalg.norm(estimate.position_cm - truth.position_cm)), 3),
        "heading_deg": round(math.degrees(angle), 3),
    }
