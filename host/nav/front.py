"""The front of what stands ahead of a straight drive, strip by strip along the way.

A foot on the floor is seen well from near and is below the picture at the very end. So every strip of the way
remembers where its foot was, as a mean that is weighted by variance, and wheels carry that on. A worse
measurement, such as a late depth of something cut off, then changes next to nothing. What is
looked at again and is not there is forgotten; what was seen for a moment only, before a front that was seen
often and then is seen again, was a fleck of the floor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from host.nav.picture import NO_REGION
from host.nav.stand import AT_BORDER, FAINT, Feet, Standing

STRIP_CM = 1.0
HALF_CM = 24.0  # the strips reach so far to either side of the way
NEAR = 1.06  # feet nearer than this times the border of the picture may be those of what is cut off by it
FAR_CM = 150.0  # farther feet are of no use yet
SIGMA_SLOPE = 0.005  # of a foot's ray: a pixel and a half at 280 px focal length
SIGMA_CM = 0.3  # of a foot besides
ALIKE = 6.0  # so many frames have the same error
DRIFT = 0.02  # of travel; what is remembered gets less sure by that
GATE = 3.0  # sigmas
GATE_CM = 1.5
MOST_SUPPORT = 6.0
DOUBTED_CM = 1.5  # what is less sure is forgotten when floor is seen beyond it
PASSED_CM = 4.0  # by so much
SURE_SUPPORT = 1.5  # frames from near that saw it
FIRM_SUPPORT = 5.5  # and that saw it, and did not see past it, where it surely is no fleck
EDGES = 0.003  # rms of feet about one or two lines: straight fronts, of which rows of 2 px make 0.002
EDGE_COLUMNS = 25  # the flank of a ball in fewer is as straight; it is at the side, out of the way
SLIVER = 0.03  # feet that jump by this at either end are another thing's, through a gap of the outline
SLIVER_COLUMNS = 4
MOST_VOTES = 20.0  # frames that tell of a front's shape
FLANK_CM = 7.5  # what a map's cells hold so near to a front's edge is that front
SIDE_CM = 20.0  # or its side, up to so far behind
CLEAR_CM = np.arange(0.0, 60.0, 5.0)  # beyond the border where it is looked whether floor is seen


@dataclass(frozen=True)
class Sight:
    """What a frame shows of feet on the floor."""

    feet: Feet
    standing: tuple[Standing, ...]
    position_cm: tuple[float, float]  # (x, z) of the camera
    heading_rad: float
    t_s: float


@dataclass(frozen=True)
class Met:
    """What a disc that goes straight on touches first."""

    room_cm: float  # the rim's way to it
    sigma_cm: float
    region: int
    along_cm: float  # of the place it touches, from its middle
    by_foot: bool  # its foot was seen
    firm: bool  # often, and not contradicted since


class Profile:
    """Fronts along one straight way, in strips beside each other."""

    def __init__(self, x_cm: float, z_cm: float, heading_rad: float) -> None:
        self._x, self._z = x_cm, z_cm
        self._sine, self._cosine = math.sin(heading_rad), math.cos(heading_rad)
        self._heading = heading_rad
        self.aside_cm = np.arange(-HALF_CM, HALF_CM + 1e-6, STRIP_CM)
        count = len(self.aside_cm)
        self.along_cm = np.full(count, np.inf)
        self._variance = np.full(count, np.inf)
        self._support = np.zeros(count)
        self._region = np.full(count, NO_REGION)
        self._by_foot = np.zeros(count, bool)
        self._clear_cm = np.full(count, -np.inf)  # floor was seen up to here
        self._camera_cm: float | None = None  # along the way
        self._behind_cm = np.full(count, np.inf)  # the firm front that a nearer one took the place of
        self._again = np.zeros(count)  # how often it was seen since
        self._edged: set[int] = set()  # regions that stand on straight edges
        self._shaped = np.zeros(count)  # votes for a front of known shape; below 0 it is curved somehow

    def place_of(self, x_cm: float, z_cm: float) -> tuple[float, float]:
        """(along, aside) of a point."""
        dx, dz = x_cm - self._x, z_cm - self._z
        return dx * self._sine + dz * self._cosine, dx * self._cosine - dz * self._sine

    def see(self, sight: Sight) -> None:
        """Take in one frame."""
        feet = sight.feet
        camera, aside = self.place_of(*sight.position_cm)
        if self._camera_cm is not None:
            self._variance += (DRIFT * (camera - self._camera_cm)) ** 2
        self._camera_cm = camera
        turned = math.remainder(sight.heading_rad - self._heading, 2 * math.pi)
        sine, cosine = math.sin(turned), math.cos(turned)
        border = NEAR * feet.nearest_cm

        depth, doubt, known = self._fronts_of(feet, sight.standing, border)
        self._look_again(feet, depth, known, (camera, aside), turned, border)
        columns = np.flatnonzero(known)
        if len(columns) == 0:
            return
        z = depth[columns]
        side = feet.across[columns] * z
        along = camera + z * cosine - side * sine
        across = aside + z * sine + side * cosine
        strip = np.rint((across + HALF_CM) / STRIP_CM).astype(int)
        inside = (strip >= 0) & (strip < len(self.aside_cm)) & (z < FAR_CM)
        cut = feet.cut[columns]
        if cut.any():  # no worse news than of a foot that was seen
            seen = self._by_foot & (self._support >= SURE_SUPPORT) & (self.along_cm > camera)
            near = np.abs(self.aside_cm - aside) < STRIP_CM * 12
            if (seen & near & (self.along_cm < camera + 1.2 * border)).any():
                inside &= ~cut
            inside[inside & cut] = along[inside & cut] > self._clear_cm[strip[inside & cut]]
        order = np.flatnonzero(inside)
        order = order[np.argsort(-along[order], kind="stable")]  # the nearest of a strip is written last
        nearest = np.full(len(self.aside_cm), -1)
        nearest[strip[order]] = order
        hit = np.flatnonzero(nearest >= 0)
        of = nearest[hit]
        shaped = _votes_for_shape(feet, sight.standing)[columns[of]]
        self._take(hit, along[of], z[of], doubt[columns[of]], feet, columns[of], shaped)

    def _fronts_of(
        self, feet: Feet, standing: tuple[Standing, ...], border: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Depth of the first thing in each column, its sigma besides that of a foot, and is there any."""
        depth = feet.depth_cm.copy()
        known = (feet.region != NO_REGION) & ~feet.cut & feet.sure & (depth > border)
        doubt = np.zeros(len(depth))
        for thing in standing:
            mine = thing.columns[feet.region[thing.columns] == thing.region]
            if len(mine) == 0 or thing.how == AT_BORDER:
                continue
            if thing.round_cm > 0.0 and not self._is_edged(feet, thing.region, mine):
                # its nearest point lies before its foot
                front = _round_front(feet, thing)
                seen = mine[~feet.cut[mine]]
                depth[seen] = front[np.searchsorted(thing.columns, seen)]
                doubt[seen] = 0.1 * thing.round_cm
            if thing.weight == FAINT or thing.seam:
                doubt[mine] = np.maximum(doubt[mine], thing.sigma_cm)
            cut = thing.columns[feet.cut[thing.columns] & (feet.region[thing.columns] == thing.region)]
            if len(cut) and thing.how != "foot":
                front = thing.by_column(len(depth))[cut]
                depth[cut], doubt[cut], known[cut] = front, thing.sigma_cm, front > 1.0
        return depth, doubt, known & np.isfinite(depth)

    def _is_edged(self, feet: Feet, region: int, columns: np.ndarray) -> bool:
        """Whether what looks round by its outer feet is a box, seen at a corner or cut off by the picture."""
        slopes = _without_slivers(feet.slope[columns[~feet.cut[columns]]])
        if len(slopes) >= EDGE_COLUMNS:  # else as it was when more of it was to be seen
            change = self._edged.add if _rms_about_edges(slopes) < EDGES else self._edged.discard
            change(region)
        return region in self._edged

    def _look_again(
        self,
        feet: Feet,
        depth: np.ndarray,
        known: np.ndarray,
        here: tuple[float, float],
        turned: float,
        border: float,
    ) -> None:
        """Fronts that would be seen and are not lose support; where floor is seen is noted."""
        seen_to = np.where(known & ~feet.cut, depth, np.where(feet.cut, 0.0, feet.floor_cm))
        away = self.along_cm - here[0]
        beyond = self._seen_at(feet, seen_to, np.where(np.isfinite(away), away, 1e9), here, turned)
        sigma = np.sqrt(np.where(np.isfinite(self._variance), self._variance, 0.0) + _variance_of(away, feet))
        gone = (away > border) & (away < FAR_CM) & (beyond > away + GATE * sigma + GATE_CM)
        self._support[gone] -= _weight_of(away[gone])
        doubtful = ~self._by_foot | (self._variance > DOUBTED_CM**2)
        lost = (self._support <= 0.0) | (doubtful & (self.along_cm < self._clear_cm - PASSED_CM))
        self.along_cm[lost], self._variance[lost], self._support[lost] = np.inf, np.inf, 0.0
        self._region[lost], self._shaped[lost] = NO_REGION, 0.0
        for z in (border + CLEAR_CM).tolist():
            at = np.full(len(self.aside_cm), z)
            clear = self._seen_at(feet, seen_to, at, here, turned) > z
            joined = clear & (self._clear_cm >= here[0] + z - CLEAR_CM[1] - 1.0)
            begins = clear & (z == border)
            further = joined | begins
            self._clear_cm[further] = np.maximum(self._clear_cm[further], here[0] + z)
        sure = ~doubtful & ~lost  # a foot that is seen wins against floor seen there before
        self._clear_cm[sure] = np.minimum(self._clear_cm[sure], self.along_cm[sure])

    def _seen_at(
        self, feet: Feet, seen_to: np.ndarray, away: np.ndarray, here: tuple[float, float], turned: float
    ) -> np.ndarray:
        """How far it is seen along the rays to places in the strips, 0 where they are out of view."""
        beside = self.aside_cm - here[1]
        z = away * math.cos(turned) + beside * math.sin(turned)
        side = beside * math.cos(turned) - away * math.sin(turned)
        column = np.searchsorted(feet.across, side / np.maximum(z, 1.0))
        inside = (column > 0) & (column < len(feet.across))
        column = np.where(inside, column, 0)
        return np.where(inside, np.minimum(seen_to[column], seen_to[np.maximum(column - 1, 0)]), 0.0)

    def _take(
        self,
        strips: np.ndarray,
        along: np.ndarray,
        z: np.ndarray,
        doubt: np.ndarray,
        feet: Feet,
        columns: np.ndarray,
        shaped: np.ndarray,
    ) -> None:
        """Fuse by variance what agrees; believe what is nearer, and what is new."""
        noise = _variance_of(z, feet) + doubt**2
        before, variance = self.along_cm[strips], self._variance[strips]
        off = along - before
        with np.errstate(invalid="ignore"):
            limit = GATE * np.sqrt(variance + noise) + GATE_CM
        agrees = np.isfinite(before) & (np.abs(off) < limit)
        new = ~np.isfinite(before) | (~agrees & (off < 0.0))
        self._behind_cm[self._support >= FIRM_SUPPORT] = np.inf
        firm = new & np.isfinite(before) & self._by_foot[strips] & (self._support[strips] >= FIRM_SUPPORT)
        self._behind_cm[strips[firm]], self._again[strips[firm]] = before[firm], 0.0
        self._again[strips[agrees]] = 0.0
        new |= self._is_again(strips, along, z, ~agrees & ~new & ~feet.cut[columns], limit)
        one = strips[agrees]
        gain = variance[agrees] / (variance[agrees] + ALIKE * noise[agrees])
        self.along_cm[one] += gain * off[agrees]
        self._variance[one] *= 1.0 - gain
        self._support[one] = np.minimum(self._support[one] + _weight_of(z[agrees]), MOST_SUPPORT)
        two = strips[new]
        self.along_cm[two], self._variance[two] = along[new], noise[new]
        self._support[two] = _weight_of(z[new])
        changed = agrees | new
        self._region[strips[changed]] = feet.region[columns[changed]]
        self._shaped[two] = 0.0
        votes = self._shaped[strips[changed]] + shaped[changed]
        self._shaped[strips[changed]] = np.clip(votes, -MOST_VOTES, MOST_VOTES)
        self._by_foot[strips[changed]] = ~feet.cut[columns[changed]] | (
            self._by_foot[strips[changed]] & agrees[changed]
        )

    def _is_again(
        self, strips: np.ndarray, along: np.ndarray, z: np.ndarray, beyond: np.ndarray, limit: np.ndarray
    ) -> np.ndarray:
        """Where a firm front is seen again more often than what stood before it for a moment: a fleck."""
        again = beyond & (np.abs(along - self._behind_cm[strips]) < limit)
        self._again[strips[again]] += _weight_of(z[again])
        return again & (self._again[strips] > self._support[strips])

    def met(self, x_cm: float, z_cm: float, radius_cm: float) -> Met | None:
        """What a disc at a place meets first; None while nothing is surely there."""
        along, aside = self.place_of(x_cm, z_cm)
        off = np.abs(self.aside_cm - aside)
        lies = (self._support >= SURE_SUPPORT) & (off < radius_cm) & (self.along_cm > along)
        if not lies.any():
            return None
        at = np.flatnonzero(lies)
        ways = self.along_cm[at] - along - np.sqrt(radius_cm**2 - off[at] ** 2)
        k = int(ways.argmin())
        strip = int(at[k])
        return Met(
            float(ways[k]),
            math.sqrt(float(self._variance[strip])),
            int(self._region[strip]),
            float(self.along_cm[strip] - along),
            bool(self._by_foot[strip]),
            bool(self._support[strip] >= FIRM_SUPPORT),
        )

    def is_flank(self, points_cm: np.ndarray, here_cm: tuple[float, float], radius_cm: float) -> np.ndarray:
        """(N,) bool: places (N, 2) at fronts of known shape, seen often, that a disc from here goes past."""
        return self._at_front_beside(points_cm, here_cm, radius_cm, self._shaped > 0.0)

    def may_hang_over(
        self, place_cm: tuple[float, float], here_cm: tuple[float, float], radius_cm: float
    ) -> bool:
        """Whether a place is at something curved beside the disc that nobody knows to be a ball, or not.

        Floor is seen under the side of a ball, even of one that the net has made one region with a wall.
        """
        return bool(self._at_front_beside(np.array([place_cm]), here_cm, radius_cm, self._shaped < 0.0)[0])

    def _at_front_beside(
        self, points_cm: np.ndarray, here_cm: tuple[float, float], radius_cm: float, shaped: np.ndarray
    ) -> np.ndarray:
        dx, dz = points_cm[:, 0] - self._x, points_cm[:, 1] - self._z
        along = dx * self._sine + dz * self._cosine
        across = dx * self._cosine - dz * self._sine
        aside = self.place_of(*here_cm)[1]
        firm = self._by_foot & (self._support >= FIRM_SUPPORT)
        front = np.flatnonzero(firm & shaped & (np.abs(self.aside_cm - aside) >= radius_cm))
        off = np.abs(across[:, None] - self.aside_cm[front])
        behind = along[:, None] - self.along_cm[front]
        one_side = (across[:, None] > aside) == (self.aside_cm[front] > aside)
        return (one_side & (off < FLANK_CM) & (behind > -FLANK_CM) & (behind < SIDE_CM)).any(axis=1)

    def clear_cm(self, x_cm: float, z_cm: float, radius_cm: float) -> float:
        """How far the disc can go over floor that was seen from near."""
        along, aside = self.place_of(x_cm, z_cm)
        off = np.abs(self.aside_cm - aside)
        under = off < radius_cm
        return float((self._clear_cm[under] - along - np.sqrt(radius_cm**2 - off[under] ** 2)).min())


def _variance_of(z: np.ndarray, feet: Feet) -> np.ndarray:
    """Of a foot at a depth, cm^2."""
    away = np.minimum(np.maximum(z, 0.0), 500.0)
    return (SIGMA_SLOPE * away**2 / feet.height_cm) ** 2 + SIGMA_CM**2


def _weight_of(z: np.ndarray) -> np.ndarray:
    """What a frame is worth: from afar little."""
    return np.minimum(1.0, (60.0 / np.maximum(z, 1.0)) ** 2)


def _round_front(feet: Feet, thing: Standing) -> np.ndarray:
    """Depth of a round thing's front in its columns."""
    nearest, radius = float(thing.depth_cm.min()), thing.round_cm
    middle = nearest + radius
    centre = 0.5 * float(feet.across[thing.columns[0]] + feet.across[thing.columns[-1]]) * middle
    off = np.minimum(np.abs(feet.across[thing.columns] * middle - centre) / radius, 1.0)
    return middle - radius * np.sqrt(1.0 - off**2)


def _votes_for_shape(feet: Feet, standing: tuple[Standing, ...]) -> np.ndarray:
    """(W / 2,) 1 where a foot has straight edges or is of a thing known to be round, -1 where else curved."""
    votes = np.zeros(len(feet.slope))
    breaks = (np.diff(feet.region) != 0) | (np.abs(np.diff(feet.slope)) > SLIVER) | np.diff(feet.cut)
    ends = [0, *(np.flatnonzero(breaks) + 1).tolist(), len(votes)]
    for begin, end in pairwise(ends):
        if end - begin >= EDGE_COLUMNS and feet.region[begin] != NO_REGION and not feet.cut[begin]:
            votes[begin:end] = 1.0 if _rms_about_edges(feet.slope[begin:end]) < EDGES else -1.0
    for thing in standing:
        if thing.round_cm > 0.0:
            votes[thing.columns[feet.region[thing.columns] == thing.region]] = 1.0
    return votes


def _without_slivers(slopes: np.ndarray) -> np.ndarray:
    jumps = np.flatnonzero(np.abs(np.diff(slopes)) > SLIVER) + 1
    begin = max(jumps[jumps <= SLIVER_COLUMNS], default=0)
    end = min(jumps[jumps >= len(slopes) - SLIVER_COLUMNS], default=len(slopes))
    return slopes[begin:end]


def _rms_about_edges(slopes: np.ndarray) -> float:
    """Of feet about the two lines that fit them best: a straight edge on the floor is one in the picture."""
    first, second = _squares_about_line(slopes), _squares_about_line(slopes[::-1])[::-1]
    return math.sqrt(max(0.0, float((first[:-1] + second[1:]).min())) / len(slopes))


def _squares_about_line(values: np.ndarray) -> np.ndarray:
    """Sum of squares about the line that fits best the values up to each one."""
    count = np.arange(1.0, len(values) + 1)
    middle, mean = (count - 1) / 2, values.cumsum() / count
    spread = count * (count**2 - 1) / 12
    along = (values * (count - 1)).cumsum() - count * middle * mean
    about = (values**2).cumsum() - count * mean**2
    return about - along**2 / np.maximum(spread, 1.0)
