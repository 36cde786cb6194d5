"""Do the pictures move as the wheels do? Where they do not, the wheels slip, or the robot is carried about.

Points whose depth is known, corners of the net and ends of whole regions, are looked for in a picture of a
moment later: where they would be had the robot moved as its wheels did, and where they were. Edges that are
still where they were tell slipping; points that went ways nobody expected tell a robot that is pushed or
lifted. One that was put elsewhere between two pictures is told by regions that are no longer there, or by a
picture that changed as a whole while the wheels stood.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from host.camera.lens import Lens
from host.nav import _nav
from host.nav.odometry import heading_of
from host.nav.pilot import View
from host.pose import Pose, wrap
from host.rbdn import Contour, Region

LEAST_POINTS = 6
LEAST_PX = 8.0  # expected way from which slipping can be told: depths may be wrong, and a pixel is nothing
SIGMAS = 6.0  # and it must be this much longer than what the heading by the wheels may be off by
SLIPS_BELOW = 0.5  # share of the expected way, of points that are known by name
STANDS_PX, STANDS_BELOW = 1.0, 0.35  # and of shorter ways: no depths are so wrong that so little is left
SHARE_SIGMA = 0.12  # how well it must be known
TURN_RAD_PER_CM = 0.002  # may be unknown to the wheels: 3 % between their sizes
POINT_PX = 1.0  # standard error of a point's way
NOD_PX = 2.0  # and of the camera's pitch
OFF_PX = 2.0  # points that are on the mean so far from any edge are not where they should be,
STILL_SHARE = 0.4  # and where they were they are nearer to one by this factor
FAR_PX = 8.0
SURE = 0.15  # relative standard error of a depth to go by
SLIP_LOOKS = 3  # in a row must find so: in one alone corners are taken for others
STRANGE_PICTURES = 2  # one after the other, or a single one
AT_ONCE_PX = 20.0  # by this much
ASTRAY_PX = 25.0  # or that many since a while ago
AGREE_SHARE = 0.75  # of the points went astray in one way; where a region changed its shape they scatter
STRANGE_PX = 10.0  # ways that differ by more than this from what is expected,
LOST_SHARE = 1 / 3  # of the points that are due, found: the others are lost, if the robot turns by less than
LOST_TURN_PX = 5.0  # from picture to picture; a moment of poor sight loses them too, but changes no picture
RECENT = 4  # and by more than any way expected in so many pictures, are no error of the wheels or of times
SAME_SHARE = 0.7  # of the picture shows the same regions as the last one; less is another place
SAME_LEVELS = 20.0  # a region's colour changes by less, 0 to 255
EVERY_ROW = 4  # is looked at
SMALL = (32, 20)  # parts of the picture that are compared as a whole
MEAN_LEVEL = 100.0
OTHER_LEVELS = 10.0  # change of a part in brightness that shows something else
OTHER_SHARE = 0.25  # of all parts
BUSY_SHARE = 0.6  # or so much, where something moves: its shadow is seen beside it
LEAST_REST = 0.4  # of its columns must be free of what is known to move
SOME_SHARE = 0.1  # of all parts, where regions are gone as well
STILL_PX, STILL_CM = 2.0, 0.5  # motion by the wheels from picture to picture that changes no part as a whole
TURN_COSTS = 2.0  # times the part of the picture that a turn brings in may be new
TURN_ONLY_CM = 2.0  # less travel moves even what is not known, and so may be near, by less than STRANGE_PX
WINDOW_S = 1.5  # a picture further back is no moment ago
EVERY_S = 0.1  # pictures that come faster are not all looked at
HALF_FRAME_S = 0.01


@dataclass(frozen=True)
class _Points:
    """Points of one picture, and where the wheels said it was taken."""

    pose: Pose
    ids: np.ndarray  # (N,) int64, of corners from 0 up, of regions' ends below; in order
    rays: np.ndarray  # (N, 2) x/z, y/z
    xyz_cm: np.ndarray  # (N, 3) in the camera; nan where not known

    @staticmethod
    def of(view: View, lens: Lens) -> _Points:
        vertices, depths = view.snapshot.vertices, view.depths
        good = np.isfinite(vertices.sigma_px)
        ids, pixels = [vertices.ids[good]], [vertices.xy_px[good]]
        z, sigma = depths.vertices.xyz_cm[good, 2], depths.vertices.sigma_cm[good]
        z_cm = [np.where(sigma < SURE * z, z, np.nan)]
        for region in view.snapshot.regions:
            depth = depths.regions.get(region.id)
            if region.touches_border or depth is None or depth.depth_cm is None or depth.sigma_cm is None:
                continue
            if depth.sigma_cm > SURE * depth.depth_cm:
                continue
            loop = region.loops[0]
            ends = [*loop.argmin(axis=0), *loop.argmax(axis=0)]
            ids.append(-1 - 4 * region.id - np.arange(4))
            pixels.append(loop[ends])
            z_cm.append(np.full(4, depth.silhouette_cm or depth.depth_cm))
        rays = lens.to_rays(np.concatenate(pixels))
        rests = ~moves_at(rays[:, 0], view)
        rays, all_z_cm, all_ids = rays[rests], np.concatenate(z_cm)[rests], np.concatenate(ids)[rests]
        xyz_cm = np.column_stack([rays, np.ones(len(rays))]) * all_z_cm[:, None]
        order = np.argsort(all_ids)
        return _Points(view.dead_reckoning, all_ids[order], rays[order], xyz_cm[order])


@dataclass(frozen=True, eq=False)
class _Ways:
    """How points moved from one picture to another, in px at the middle of the picture."""

    expected: np.ndarray  # (N, 2) by the wheels
    found: np.ndarray  # (N, 2)
    inside: np.ndarray  # (M,) bool: which of all points of the first picture can be seen in the other
    rays: np.ndarray  # (M, 2) and where there

    @cached_property
    def expected_px(self) -> float:
        return _middle(np.hypot(*self.expected.T))

    def share(self, heading_px: float) -> tuple[float, float]:
        """Of the expected way that was gone, and its standard error.

        A shift of the whole picture by a wrong heading or a nod of the camera is solved for beside it.
        """
        count = len(self.found)
        design = np.zeros((2 * count, 3))
        design[:, 0] = self.expected.ravel()
        design[::2, 1] = design[1::2, 2] = 1.0
        found, weight = self.found.ravel(), np.ones(2 * count)
        prior = np.diag([0.0, 1 / max(heading_px, POINT_PX) ** 2, 1 / NOD_PX**2])
        for _ in range(4):
            normal = (design * weight[:, None]).T @ design / POINT_PX**2 + prior + 1e-9 * np.eye(3)
            solved = np.linalg.solve(normal, design.T @ (weight * found) / POINT_PX**2)
            weight = 1 / (1 + ((found - design @ solved) / (2 * POINT_PX)) ** 2)  # a few may go astray
        return float(solved[0]), math.sqrt(float(np.linalg.inv(normal)[0, 0]))

    @cached_property
    def strange_px(self) -> float:
        """By how much the points went another way than expected, if it is one way for most of them."""
        other = self.found - self.expected
        one = np.sort(other, axis=0)[len(other) // 2]
        way_px = float(np.hypot(*one))
        agree = np.hypot(*(other - one).T) < max(way_px / 2, POINT_PX)
        return way_px if np.count_nonzero(agree) >= AGREE_SHARE * len(agree) else 0.0


class WheelWatch:
    """Compares every picture with one of a moment ago."""

    def __init__(self, lens: Lens):
        self._lens = lens
        self._from: _Points | None = None  # where ways begin
        self._halfway: _Points | None = None  # where the next ways begin once these are too long
        self._last: _Points | None = None
        self._small: np.ndarray | None = None
        self._moved = np.zeros(SMALL[0], bool)  # its columns in which something moved
        self._strange_ones = 0  # pictures in a row
        self._lost: list[float] = []  # shares of the last pictures that changed while points were lost
        self._slip_looks = 0  # in a row
        self._regions: dict[int, Region] = {}
        self._expected_px: deque[float] = deque(maxlen=RECENT)

    def forget(self) -> None:
        """Begin anew with the next picture."""
        self._from = self._halfway = self._last = self._small = None
        self._strange_ones = self._slip_looks = 0
        self._lost, self._regions = [], {}

    def doubt(self, view: View) -> str | None:
        """What speaks against the wheels, in one line; None where nothing does."""
        last, begin = self._last, self._from
        if last is not None and view.dead_reckoning.t_s - last.pose.t_s < EVERY_S - HALF_FRAME_S:
            return None
        now = self._last = _Points.of(view, self._lens)
        regions = {region.id: region for region in view.snapshot.regions}
        before, self._regions = self._regions, regions
        changed = self._changed(view)
        if begin is None or last is None or now.pose.t_s - last.pose.t_s > WINDOW_S:
            self._from, self._slip_looks = now, 0
            return None
        begin = self._begin(begin, last, now)
        found = self._other(changed, last.pose, now.pose)
        calm = not self._moved.any()  # else it may be what moves that is another region now
        if changed > SOME_SHARE and calm:  # or else it is the net that sees the same differently
            found = found or self._elsewhere(before, regions, last.pose, now.pose)
        short = ways_between(last, now, self._lens)
        found = found or self._strange(short, last, now)
        found = self._gone(short, changed if calm else 0.0, last.pose, now.pose) or found
        long = short if begin is last else ways_between(begin, now, self._lens)
        found = found or self._astray(long, begin, now)
        return found or self._slips(long, begin, now, view.snapshot.contour)

    def _begin(self, begin: _Points, last: _Points, now: _Points) -> _Points:
        """The picture that ways begin in: half a window ago or more, where there is such a one."""
        halfway = self._halfway
        if halfway is not None and halfway.pose.t_s <= begin.pose.t_s:
            halfway = None
        if now.pose.t_s - begin.pose.t_s > WINDOW_S:
            begin = self._from = halfway or last
            halfway, self._slip_looks = None, 0
        if halfway is None and last.pose.t_s - begin.pose.t_s >= WINDOW_S / 2:
            halfway = last
        self._halfway = halfway
        return begin

    def _elsewhere(
        self, before: dict[int, Region], regions: dict[int, Region], last: Pose, now: Pose
    ) -> str | None:
        all_px = sum(region.area_px for region in before.values())
        if all_px == 0.0:
            return None
        turned_px = abs(wrap(heading_of(now) - heading_of(last))) * self._lens.fx
        share = same_px(before, regions) / all_px
        if share > SAME_SHARE - TURN_COSTS * turned_px / self._lens.width:
            return None
        return (
            f"picture shows another place: {100 * share:.0f} % of it is as a moment ago, which wheels do not "
            "explain; carried away, or the camera was hit"
        )

    def _changed(self, view: View) -> float:
        """Share of the picture in which something else is seen, whatever the exposure.

        What only moves by less than a part is as bright as before, or as what was beside it. Where something
        is known to move nothing is told by that; where it hides most of the picture, nothing at all.
        """
        image = view.frame.image
        rows = -(-image.shape[0] // EVERY_ROW)
        small = _nav.tile_means(np.ascontiguousarray(image), EVERY_ROW, rows, *SMALL)
        before, self._small = self._small, small
        moved, self._moved = self._moved, self._columns_of(view)
        rest = ~(moved | self._moved)
        if before is None or np.count_nonzero(rest) < LEAST_REST * SMALL[0]:
            return 0.0
        small = small * (MEAN_LEVEL / max(float(small[:, rest].mean()), 1.0))
        before = before * (MEAN_LEVEL / max(float(before[:, rest].mean()), 1.0))
        near = np.ones((3, 3), np.uint8)
        off = cv2.max(small - cv2.dilate(before, near), cv2.erode(before, near) - small)[:, rest]
        return np.count_nonzero(off > OTHER_LEVELS) / off.size

    def _columns_of(self, view: View) -> np.ndarray:
        """Parts of the picture, from left to right, in which something is known to move."""
        if not view.moving:
            return np.zeros(SMALL[0], bool)
        middles = (np.arange(SMALL[0]) + 0.5) * self._lens.width / SMALL[0]
        rays = self._lens.to_rays(np.column_stack([middles, np.full(SMALL[0], self._lens.cy)]))
        return moves_at(rays[:, 0], view)

    def _other(self, changed: float, last: Pose, now: Pose) -> str | None:
        turned_px = abs(wrap(heading_of(now) - heading_of(last))) * self._lens.fx
        way_cm = math.dist(last.position_cm, now.position_cm)
        least = BUSY_SHARE if self._moved.any() else OTHER_SHARE
        if changed < least or turned_px > STILL_PX or way_cm > STILL_CM:
            return None
        return (
            f"picture shows another place: {100 * changed:.0f} % of it changed at once as the wheels stood; "
            "lifted and put elsewhere, or the camera was hit"
        )

    def _strange(self, ways: _Ways, last: _Points, now: _Points) -> str | None:
        if len(ways.found) < LEAST_POINTS:
            return None
        self._expected_px.append(ways.expected_px)
        allowed = max(STRANGE_PX, *self._expected_px, SIGMAS * self._heading_px(last, now))
        self._strange_ones = self._strange_ones + 1 if ways.strange_px > allowed else 0
        at_once = ways.strange_px > max(allowed, AT_ONCE_PX)
        if self._strange_ones < STRANGE_PICTURES and not at_once:
            return None
        return f"picture moved {ways.strange_px:.0f} px otherwise than the wheels: pushed, lifted or slipping"

    def _gone(self, ways: _Ways, changed: float, last: Pose, now: Pose) -> str | None:
        """Points that are due are lost, picture after picture, and what the pictures show changes."""
        turned_px = abs(wrap(heading_of(now) - heading_of(last))) * self._lens.fx
        due = np.count_nonzero(ways.inside)
        lost = due >= LEAST_POINTS and len(ways.found) <= LOST_SHARE * due and turned_px <= LOST_TURN_PX
        self._lost = [*self._lost, changed][-STRANGE_PICTURES:] if lost else []
        if len(self._lost) < STRANGE_PICTURES or sum(self._lost) < SOME_SHARE:
            return None
        return (
            f"picture shows another place: of {due} points {len(ways.found)} are left though the wheels "
            "hardly turned; lifted or carried away, or the camera was hit"
        )

    def _astray(self, ways: _Ways, begin: _Points, now: _Points) -> str | None:
        """The same over a longer while, in which little adds up."""
        if len(ways.found) < LEAST_POINTS:
            return None
        if ways.strange_px <= max(ASTRAY_PX, ways.expected_px, SIGMAS * self._heading_px(begin, now)):
            return None
        self._from = now
        return f"picture moved {ways.strange_px:.0f} px otherwise than the wheels: slipping, pushed or lifted"

    def _slips(self, ways: _Ways, begin: _Points, now: _Points, contour: Contour) -> str | None:
        """Are points, or at least the edges, where they were and not where the wheels would have them?"""
        heading_px = self._heading_px(begin, now)
        if len(ways.found) >= LEAST_POINTS:
            if ways.expected_px < STANDS_PX:
                return None
            way_cm = math.dist(begin.pose.position_cm, now.pose.position_cm)
            unknown_px = self._lens.fx * TURN_RAD_PER_CM * way_cm
            share, sigma = ways.share(math.hypot(heading_px, unknown_px))
            if sigma > SHARE_SIGMA:
                return None
            shown = f"of the way they count the picture shows {100 * max(0.0, share):.0f} %"
            if ways.expected_px >= LEAST_PX:
                return self._surely(share + 3 * sigma <= SLIPS_BELOW, shown, now)
            if abs(share) + 3 * sigma <= STANDS_BELOW:
                return self._surely(True, shown, now)
            self._slip_looks = 0
            return None
        inside, rays = ways.inside, ways.rays
        if inside.sum() < LEAST_POINTS:
            self._from = now
            return None
        scale = (self._lens.fx, self._lens.fy)
        expected_px = _middle(np.hypot(*((rays - begin.rays)[inside] * scale).T))
        if expected_px < max(LEAST_PX, SIGMAS * heading_px):
            return None
        by_wheels = distances_px(self._lens.to_pixels(rays[inside]), contour, self._lens)
        standing = distances_px(self._lens.to_pixels(begin.rays[inside]), contour, self._lens)
        stand = by_wheels.mean() >= OFF_PX and standing.mean() <= STILL_SHARE * by_wheels.mean()
        return self._surely(stand, f"edges have not moved where {expected_px:.0f} px were due", now)

    def _surely(self, slips: bool, shown: str, now: _Points) -> str | None:
        """That the wheels slip, where enough looks back at one picture found it; else a new one begins."""
        self._slip_looks = self._slip_looks + 1 if slips else 0
        if 0 < self._slip_looks < SLIP_LOOKS:
            return None
        self._from = now
        return f"wheels slip: {shown}" if slips else None

    def _heading_px(self, a: _Points, b: _Points) -> float:
        return self._lens.fx * math.hypot(a.pose.sigma_rot_rad, b.pose.sigma_rot_rad)


def moves_at(rays_x: np.ndarray, view: View) -> np.ndarray:
    """(N,) bool, at which x/z something that is known to move may be seen."""
    moves = np.zeros(len(rays_x), bool)
    for low, high in view.moving:
        moves |= (rays_x > low) & (rays_x < high)
    return moves


def aims_of(a: _Points, pose: Pose, lens: Lens) -> tuple[np.ndarray, np.ndarray]:
    """Which points of one picture can be seen from a pose, (N,) bool, and at which rays there, (N, 2)."""
    shift = a.pose.position_cm - pose.position_cm
    points = a.xyz_cm.copy()
    if math.hypot(*shift) < TURN_ONLY_CM:  # how far away things are hardly matters then
        unknown = ~np.isfinite(points[:, 2])
        points[unknown] = 1e4 * np.column_stack([a.rays[unknown], np.ones(unknown.sum())])
    there = (points @ a.pose.rotation.T + shift) @ pose.rotation
    with np.errstate(invalid="ignore", divide="ignore"):
        rays = there[:, :2] / there[:, 2:]
        aim = rays * (lens.fx, lens.fy) + (lens.cx, lens.cy)
        size = (lens.width - 1.0, lens.height - 1.0)
        inside = (there[:, 2] > 1.0) & (aim > 0).all(axis=1) & (aim < size).all(axis=1)
    return inside, rays


def ways_between(a: _Points, b: _Points, lens: Lens) -> _Ways:
    """How the points known in both pictures moved, and how they had to by the wheels."""
    inside, rays = aims_of(a, b.pose, lens)
    at_b = np.minimum(np.searchsorted(b.ids, a.ids), len(b.ids) - 1)
    if len(at_b) == 0 or len(b.ids) == 0:
        return _Ways(np.zeros((0, 2)), np.zeros((0, 2)), inside, rays)
    at_a = np.flatnonzero(inside & (b.ids[at_b] == a.ids))
    begin, scale = a.rays[at_a], (lens.fx, lens.fy)
    return _Ways((rays[at_a] - begin) * scale, (b.rays[at_b[at_a]] - begin) * scale, inside, rays)


def _middle(values: np.ndarray) -> float:
    return float(np.sort(values)[len(values) // 2])


def distances_px(pixels: np.ndarray, contour: Contour, lens: Lens) -> np.ndarray:
    """From points of the picture (N, 2) to the nearest edge, px, at most FAR_PX."""
    empty = np.ones((lens.height, lens.width), np.uint8)
    at = np.clip(np.rint(contour.xy_px), 0, (lens.width - 1, lens.height - 1)).astype(int)
    empty[at[:, 1], at[:, 0]] = 0
    far = cv2.distanceTransform(empty, cv2.DIST_L2, 3)
    at = np.clip(np.rint(pixels), 0, (lens.width - 1, lens.height - 1)).astype(int)
    return np.minimum(far[at[:, 1], at[:, 0]], FAR_PX)


def same_px(before: dict[int, Region], now: dict[int, Region]) -> float:
    """How much of a picture shows what it did before: the area of regions that kept id and colour."""
    same = 0.0
    for id_, old in before.items():
        new = now.get(id_)
        if new is not None and np.abs(np.subtract(old.mean_rgb, new.mean_rgb)).max() < SAME_LEVELS:
            same += min(old.area_px, new.area_px)
    return same
