"""Which regions are floor: told by their depths against the floor's plane, by place and by colour.

The camera's height is known, so the floor's depth along every ray below the horizon is too. A region lies
on that plane or stands on it. Where a weak edge has made one region of floor and wall, the picture itself
is asked for the wall's foot; where it shows none, nothing is known.
"""

from __future__ import annotations

import math

import numpy as np

from host.depth.report import DepthReport
from host.nav.picture import Picture
from host.nav.seam import STRIP, WINDOW, find_foot, strips_of
from host.pose import Pose
from host.rbdn.snapshot import Region, Snapshot

FARTHEST_CM = 500.0  # above the row where the floor is this far away nothing counts as floor
CROSSING = 0.02  # a region with more than this share above that row is not floor alone
LIKE_FLOOR = 20.0  # mean colours nearer than this to a proven floor's are floor too
LIKE_MIXED = 35.0  # and what lies all before the robot, or is floor and wall in one, is nearer than this
MOST_OF_BORDER = 0.6  # while no floor is known, what covers this share of the lower border is floor at least
PART_OF_BORDER = 0.3  # and what covers this and is nothing else is floor alone
SIGMA_RAY = 0.01  # of the tilt of the floor's plane against the camera, rad
LIKE_HUE = 0.05  # colours over their brightness that differ by less are the same, at the lower border
LIKE_LIGHT = 1.3  # if one is no brighter than this times the other
LOOK_EVERY = 5  # frames, to learn the floor's colour at the lower border
AT_HORIZON_PX = 6  # what ends so little above it is floor as far as it goes, and gets lighter far away
OUTLINE_PX = 3  # so near to an outline colours are mixed
VOTE = 0.2  # what one frame's depths count; a new region begins at 1 or -0.1 by its looks
PLAIN = 0.6  # and what its colour does where the region lies all before the robot
CERTAIN = 3.0  # votes are kept within this


class FloorFinder:
    """Votes of all frames on every region; one bad frame changes nothing.

    Attributes
    ----------
    foot : (W / 2,) where in each column a region that is floor and wall in one begins to be wall, in pixels
        above the lower border; -1 where nobody knows
    strange : (W / 2,) bool, it is no floor even at the lower border
    """

    def __init__(self, height_cm: float) -> None:
        self._height_cm = height_cm
        self._votes: dict[int, float] = {}
        self._mixed: set[int] = set()
        self._mixed_rgb: tuple[float, float, float] | None = None
        self._crossing: set[int] = set()
        self._frames = 0
        self._floor_rgb: tuple[float, float, float] | None = None
        self._bottom_rgb: np.ndarray | None = None  # of floor at the lower border
        self.foot, self.strange = np.empty(0, int), np.empty(0, bool)

    def is_floor(self, region_id: int) -> bool:
        """Floor and nothing else; what reaches above the horizon is none, whatever its name once was."""
        return self._votes.get(region_id, 0.0) > 0.0 and region_id not in self._crossing

    def is_mixed(self, region_id: int) -> bool:
        """Floor and something else in one region."""
        return region_id in self._mixed

    def update(
        self,
        snapshot: Snapshot,
        report: DepthReport,
        pose: Pose,
        picture: Picture,
        image: np.ndarray | None = None,
    ) -> None:
        """Take in one frame, with the BGR image itself if it is at hand."""
        self._mixed.clear()
        high = picture.total(picture.rays.flatter(self._height_cm / FARTHEST_CM)).tolist()
        reach = picture.total(picture.rays.reach).tolist()
        pixels, at_border = picture.pixels.tolist(), picture.at_border.tolist()
        corners = _Corners(report, pose, self._height_cm)
        width = picture.shape[0]
        crossed, self._crossing = self._crossing, set()
        for k, region in enumerate(snapshot.regions):
            if pixels[k] == 0:
                continue
            share = at_border[k] / width
            if high[k] > CROSSING * pixels[k]:
                self._crossing.add(region.id)
                self._vote_on_crossing(region, share)
                continue
            if region.id in crossed:  # what reaches above the horizon does so from anywhere: this is another
                self._votes.pop(region.id, None)
            depth = self._vote_of_depth(region, picture, report, reach[k] / pixels[k])
            self._vote(region, share, depth, corners.vote(region))
        self._votes = {r.id: self._votes[r.id] for r in snapshot.regions if r.id in self._votes}
        self._learn_colour(snapshot, at_border)
        self.foot = np.full(width, -1)
        self.strange = np.zeros(width, bool)
        self._frames += 1
        if image is not None and (self._mixed or self._frames % LOOK_EVERY == 1):
            self._look_for_feet(picture, strips_of(image))

    def _look_for_feet(self, picture: Picture, strips: np.ndarray) -> None:
        """Where regions that are floor and wall in one end to be floor."""
        of_column = np.minimum(np.arange(picture.shape[0]) // STRIP, len(strips) - 1)
        bottom_rgb = strips[:, :WINDOW].mean(axis=1)[of_column]
        ids = picture.ids.tolist()
        proven = [self.is_floor(i) and self._votes[i] > 0.4 for i in ids]
        sure = np.array(proven)[picture.labels[:, 0]]
        if self._mixed:
            horizon = picture.rays.steeper(self._height_cm / FARTHEST_CM)
            mine = np.array([i in self._mixed for i in ids])[picture.labels]
            ends = np.where(mine.all(axis=1), mine.shape[1], mine.argmin(axis=1))
            self.foot = find_foot(strips, mine, np.minimum(horizon, ends - OUTLINE_PX - WINDOW))
            self.foot[(ends >= horizon) & (ends < horizon + AT_HORIZON_PX)] = -1
            up_to_thing = (self.foot < 0) & (ends > 0) & (ends < horizon)
            self.foot[up_to_thing] = ends[up_to_thing]
            sure |= mine[:, 0] & (self.foot > 0)
            if self._bottom_rgb is not None:
                self.strange = mine[:, 0] & ~_alike(bottom_rgb, self._bottom_rgb)
                self.foot[self.strange] = 0
                sure &= ~self.strange
        if sure.any():
            rgb = bottom_rgb[sure].mean(axis=0)
            known = self._bottom_rgb
            self._bottom_rgb = rgb if known is None else 0.9 * known + 0.1 * rgb

    def _vote_on_crossing(self, region: Region, share: float) -> None:
        """On what reaches up higher than floor does."""
        before = self._votes.get(region.id)
        mixed = self._looks_mixed(region, share) or ((before or 0.0) > 0 and share > 0.0)
        if mixed:
            self._mixed.add(region.id)
            self._mixed_rgb = region.mean_rgb
        if before is None:
            self._votes[region.id] = 1.0 if mixed else -CERTAIN

    def _vote(self, region: Region, share: float, depth: float, corners: float) -> None:
        before = self._votes.get(region.id)
        like = self._looks_like_floor(region, share)
        vote = depth + corners
        if before is None:
            vote += 1.0 if like else -0.1
        elif like and share > PART_OF_BORDER:
            vote = PLAIN  # its outline and its corners are mostly those of things before it
        elif like and share > 0.0:
            vote += VOTE / 2
        self._votes[region.id] = max(-CERTAIN, min(CERTAIN, (before or 0.0) + vote))

    def _looks_like_floor(self, region: Region, share: float) -> bool:
        """By colour, and before a floor's colour is known by lying in front of the robot."""
        if self._floor_rgb is None:
            return share > PART_OF_BORDER
        limit = LIKE_MIXED if share > PART_OF_BORDER else LIKE_FLOOR
        return math.dist(region.mean_rgb, self._floor_rgb) < limit

    def _looks_mixed(self, region: Region, share: float) -> bool:
        """Does a region that reaches up to the walls hold the floor before the robot as well?"""
        known = self._floor_rgb or self._mixed_rgb
        if known is None:
            return share > MOST_OF_BORDER
        return share > PART_OF_BORDER and math.dist(region.mean_rgb, known) < LIKE_MIXED

    def _vote_of_depth(
        self, region: Region, picture: Picture, report: DepthReport, mean_reach: float
    ) -> float:
        """Does the region's depth fit a thing lying on the floor, or one standing on its lowest row?"""
        found = report.regions.get(region.id)
        if found is None or found.depth_cm is None or found.sigma_cm is None:
            return 0.0
        lowest = picture.lowest[picture.place[region.id]]
        columns = np.flatnonzero(lowest >= 0)
        lying = self._height_cm * mean_reach
        standing = self._height_cm * float((1.0 / picture.rays.down[columns, lowest[columns]]).mean())
        if lying - standing < 2 * found.sigma_cm:
            return 0.0
        return VOTE if found.depth_cm**2 > lying * standing else -VOTE

    def _learn_colour(self, snapshot: Snapshot, at_border: list[int]) -> None:
        """Of floor right before the robot, once any is known.

        Where that is one region with a wall, some far thing taken for floor would else teach its own colour,
        and the floor before the robot be none any more.
        """
        proven = [
            region
            for region, border in zip(snapshot.regions, at_border, strict=False)  # the last is of no region
            if self.is_floor(region.id) and self._votes[region.id] > 0.4
            if border > 0 or self._floor_rgb is None
        ]
        if not proven:
            return
        r, g, b = max(proven, key=lambda r: r.area_px).mean_rgb
        if self._floor_rgb is not None:
            r, g, b = (0.9 * old + 0.1 * new for old, new in zip(self._floor_rgb, (r, g, b), strict=True))
        self._floor_rgb = (r, g, b)


def _alike(rgb: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Which colours (N, 3) are a known one in more or less light."""
    light = np.maximum(rgb.mean(axis=1), 1.0)
    hue_off = np.sqrt(((rgb / light[:, None] - known / max(float(known.mean()), 1.0)) ** 2).sum(axis=1))
    brighter = light / max(float(known.mean()), 1.0)
    return (hue_off < LIKE_HUE) & (brighter > 1 / LIKE_LIGHT) & (brighter < LIKE_LIGHT)


class _Corners:
    """The net's vertices that lie on the floor, and those that are surely above it."""

    def __init__(self, report: DepthReport, pose: Pose, height_cm: float) -> None:
        vertices = report.vertices
        xyz, sigma_z = vertices.xyz_cm, vertices.sigma_cm
        with np.errstate(invalid="ignore"):
            down = xyz @ pose.rotation[1]
            slope = np.abs(down) / np.maximum(xyz[:, 2], 1.0)
            sigma = np.hypot(sigma_z * slope, xyz[:, 2] * SIGMA_RAY)
            over = height_cm - down
            sure = (sigma < 2.0) & np.isfinite(sigma_z)
            on, above = np.abs(over) < 2 * sigma + 1.0, over > 2 * sigma + 2.0
        self._on = set(vertices.ids[sure & on].tolist())
        self._above = set(vertices.ids[sure & above].tolist())

    def vote(self, region: Region) -> float:
        """Of a region's vertices."""
        if not self._on and not self._above:
            return 0.0
        ids = {i for loop in region.loop_vertices for i in loop.tolist()}
        on, above = len(ids & self._on), len(ids & self._above)
        return VOTE * (on - 2 * above) / (on + above) if on + above >= 3 else 0.0
