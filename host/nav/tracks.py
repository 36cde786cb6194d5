"""Which things move, and how: along a straight line, perhaps to and fro.

A thing is followed by its foot on the floor alone, for depth from the robot's own motion is wrong of what
moves. Only edges that are its own count: not where the picture ends or something nearer hides the rest. What
moves evenly, and too fast for an error, is a mover; the line on which it goes, how fast, and where it turns
round is kept for a while after it has left the view.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from host.nav.stand import CUT_PART, Feet, quantile

OVER_S = 0.7  # a velocity is that over so long
LEAST_S = 0.3
LEAST_SIGHTINGS = 5
FASTEST_CM_S = 40.0  # what is faster are regions that merge or split
ASIDE_CM_S = 6.0  # across the view what stands still never wanders as fast
ASIDE_SHARE = 0.06  # nor by more than this part of its distance in a second
ALONG_CM_S = 10.0  # along it errors of the foot do more
ALONG_SHARE = 0.12
SURE_SIGMAS = 4.0
STRAY_CM = 1.5  # rms of the places about an even motion across the view
STRAY_SHARE = 0.06  # and along it, of the distance
UNLIKE = 0.35  # both edges go as fast, but for this part
FARTHEST_CM = 220.0
WIDEST_CM = 60.0  # what is wider is furniture
HALF_CM = 9.0  # of something of which only one edge was ever seen
HIDES = 0.96  # what is nearer than this part of its distance hides a part of a thing
LEAST_COLUMNS = 3
CONFIRMED = 3  # even motions one after the other, until it counts as a mover
REMEMBERED_S = 14.0  # a mover out of sight
BRIEFLY_S = 2.0  # one that has not yet been seen to go far
FORESEEN_S = 20.0  # one of which it is known where it turns round, on both sides
LINE_S = 25.0  # where it would be looked for if it came back
NEAR_CM = 60.0  # the foot of what stands nearer may be below the picture
ABOUT_CM = 15.0  # it is then taken for the mover that should be so near to there
BESIDE_CM = 25.0  # the same mover comes back on its line, off by so much
LIKE_RAD = math.radians(35)
TURNED_CM = 7.0  # so much behind where it should be: it has turned round
STILL_CM = 2.5  # who goes no farther in OVER_S stands
LONG_CM = 15.0  # a way this long tells direction and speed
LONG_S = 0.8
LEG_GAP_S = 1.5  # out of sight for longer: it may have turned round twice
PLACES_APART_CM = 3.0
MOST_PLACES = 80


@dataclass(frozen=True)
class Mover:
    """Something that moves along a line.

    Attributes
    ----------
    region : last seen as this
    t_s : when
    origin_cm, ahead : a point (x, z) of the line and its direction
    at_cm, speed_cm_s : along the line from there; the speed is negative on the way back
    half_cm : half its width
    low_cm, high_cm : where it turns round, as far as that has shown
    seen : even motions that were seen
    places_cm : (x, z) where it was, the newest last
    leg : (time, place on the line) since when it has gone this way
    """

    region: int
    t_s: float
    origin_cm: tuple[float, float]
    ahead: tuple[float, float]
    at_cm: float
    speed_cm_s: float
    half_cm: float
    low_cm: float | None = None
    high_cm: float | None = None
    seen: int = 1
    places_cm: tuple[tuple[float, float], ...] = ()
    leg: tuple[float, float] | None = None

    @property
    def lasts_s(self) -> float:
        """So long after it was last seen it is reckoned with."""
        low, high = self.least_reach_cm
        if high - low < LONG_CM:
            return BRIEFLY_S
        return REMEMBERED_S if self.low_cm is None or self.high_cm is None else FORESEEN_S

    @cached_property
    def least_reach_cm(self) -> tuple[float, float]:
        """Between where and where on its line it has been: it will hardly turn round before."""
        been = [self.along(x, z)[0] for x, z in self.places_cm] or [self.at_cm]
        return min([*been, self.at_cm]), max([*been, self.at_cm])

    def along(self, x_cm: float, z_cm: float) -> tuple[float, float]:
        """(along the line, beside it) of a place."""
        dx, dz = x_cm - self.origin_cm[0], z_cm - self.origin_cm[1]
        return dx * self.ahead[0] + dz * self.ahead[1], dx * self.ahead[1] - dz * self.ahead[0]

    def place(self, t_s: float) -> float:
        """Where on the line it should be if it goes on and turns round where it did before."""
        at = self.at_cm + self.speed_cm_s * (t_s - self.t_s)
        low = -math.inf if self.low_cm is None else self.low_cm
        high = math.inf if self.high_cm is None else self.high_cm
        while at < low or at > high:
            if high - low < 1.0:
                return (low + high) / 2
            at = 2 * low - at if at < low else 2 * high - at
        return at

    def seen_at(self, at_cm: float, t_s: float, region: int, back: bool | None = None) -> Mover:
        """Told where it is now, and if known whether it is on the way back; it may have turned round."""
        gone = self.speed_cm_s * (t_s - self.t_s)
        was_back = self.speed_cm_s < 0
        if back is None:
            behind = -(at_cm - self.at_cm - gone) if not was_back else at_cm - self.at_cm - gone
            back = was_back != (behind > TURNED_CM)
        low, high, speed = self.low_cm, self.high_cm, self.speed_cm_s
        if back != was_back:
            end = (self.at_cm + at_cm + gone) / 2
            low, high, speed = (end, high, -speed) if was_back else (low, end, -speed)
        low = low if low is None else min(low, at_cm)
        high = high if high is None else max(high, at_cm)
        return replace(self, region=region, t_s=t_s, at_cm=at_cm, low_cm=low, high_cm=high, speed_cm_s=speed)


@dataclass(frozen=True)
class _Sight:
    """Where the foot of a region stands at one time: its ends (x, z), None where they are not its own."""

    t_s: float
    left: tuple[float, float] | None
    right: tuple[float, float] | None
    depth_cm: float
    ray: tuple[float, float]  # unit vector from the camera to it


class Tracks:
    """Where every thing has lately been seen to stand, and what moves."""

    def __init__(self) -> None:
        self._seen: dict[int, deque[_Sight]] = {}
        self._candidates: list[Mover] = []
        self._t_s = -math.inf

    @property
    def movers(self) -> list[Mover]:
        """What surely moves, also if it is out of sight."""
        return [m for m in self._candidates if m.seen >= CONFIRMED and self._t_s - m.t_s < m.lasts_s]

    def velocity(self, region: int, feet: Feet, t_s: float) -> tuple[float, float] | None:
        """(x, z) in cm/s of a thing that surely moves, None otherwise; told of every region once a frame."""
        sight = _sight_of(region, feet, t_s)
        if sight is None:
            self._see_on_line(region, feet, t_s)
            return self._known(region, t_s)
        seen = self._seen.setdefault(region, deque())
        seen.append(sight)
        while seen[-1].t_s - seen[0].t_s > OVER_S:
            seen.popleft()
        velocity = _even_motion(list(seen), known=self._known(region, t_s) is not None)
        place, half = self._disc(sight, region)
        if velocity is not None:
            self._note(region, t_s, place, velocity, half)
            return velocity
        for k, mover in enumerate(self._candidates):
            if mover.region == region and t_s - mover.t_s < 1.0:
                at, beside = mover.along(*place)
                if abs(beside) < BESIDE_CM:
                    self._candidates[k] = mover.seen_at(at, t_s, region)
                if self._stands(seen):
                    del self._candidates[k]
                    return None
                break
        return self._known(region, t_s)

    def forget(self, t_s: float) -> None:
        """What was not seen for a while."""
        self._seen = {k: seen for k, seen in self._seen.items() if t_s - seen[-1].t_s < OVER_S}
        self._t_s = t_s
        self._candidates = [
            mover
            for mover in self._candidates
            if t_s - mover.t_s < (LINE_S if mover.seen >= CONFIRMED else 1.0)
        ]

    def _see_on_line(self, region: int, feet: Feet, t_s: float) -> None:
        """Something whose foot is below the picture, on a line that is known, where the mover should be."""
        columns = feet.columns_of(region)[1]
        if len(columns) < LEAST_COLUMNS or columns[0] == 0 or columns[-1] == len(feet.region) - 1:
            return
        middle = int(columns[len(columns) // 2])
        eye, far = np.array(feet.point(middle, 0.0)), np.array(feet.point(middle, 100.0))
        for k, mover in enumerate(self._candidates):
            if mover.seen < CONFIRMED:
                continue
            (at0, off0), (at1, off1) = mover.along(*eye), mover.along(*far)
            part = off0 / (off0 - off1) if abs(off0 - off1) > 1.0 else -1.0
            if not 0.0 < part * 100.0 < NEAR_CM or feet.width_cm(columns, part * 100.0) > 4 * mover.half_cm:
                continue
            at = at0 + part * (at1 - at0)
            if abs(at - mover.place(t_s)) < ABOUT_CM + 0.2 * abs(mover.speed_cm_s) * (t_s - mover.t_s):
                self._candidates[k] = mover.seen_at(at, t_s, region)
                return

    def _known(self, region: int, t_s: float) -> tuple[float, float] | None:
        for mover in self.movers:
            if mover.region == region and t_s - mover.t_s < 1.0:
                return mover.speed_cm_s * mover.ahead[0], mover.speed_cm_s * mover.ahead[1]
        return None

    def _stands(self, seen: deque[_Sight]) -> bool:
        ends = [s.left or s.right for s in seen]
        points = np.array([p for p in ends if p is not None])
        long = seen[-1].t_s - seen[0].t_s > 0.9 * OVER_S
        return long and float(np.ptp(points, axis=0).max()) < STILL_CM

    def _disc(self, sight: _Sight, region: int) -> tuple[tuple[float, float], float]:
        """Middle and radius of something as round as it is wide, its front towards the robot."""
        known = next((m.half_cm for m in self._candidates if m.region == region), HALF_CM)
        ray = np.array(sight.ray)
        across = np.array([ray[1], -ray[0]])  # to the right
        if sight.left is not None and sight.right is not None:
            half = max(math.dist(sight.left, sight.right) / 2, 1.0)
            middle = (np.array(sight.left) + sight.right) / 2
        elif sight.left is not None:
            half, middle = known, np.array(sight.left) + known * across
        else:
            half, middle = known, np.array(sight.right) - known * across
        middle = middle + half * ray
        return (float(middle[0]), float(middle[1])), half

    def _note(self, region: int, t_s: float, place, velocity, half: float) -> None:
        """An even motion was seen: of a mover that is known, or of a new one."""
        speed = math.hypot(*velocity)
        for k, mover in enumerate(self._candidates):
            at, beside = mover.along(*place)
            cosine = (velocity[0] * mover.ahead[0] + velocity[1] * mover.ahead[1]) / speed
            far = abs(mover.speed_cm_s) * (t_s - mover.t_s) * 1.5 + BESIDE_CM
            same = (
                abs(beside) < BESIDE_CM and abs(cosine) > math.cos(LIKE_RAD) and abs(at - mover.at_cm) < far
            )
            if not same and not (mover.region == region and t_s - mover.t_s < 0.5):
                continue
            mover = mover.seen_at(at, t_s, region, cosine < 0)
            share = 1 / min(mover.seen + 1, 10)
            pace = abs(mover.speed_cm_s) + 0.5 * share * (speed - abs(mover.speed_cm_s))
            mover = replace(
                mover,
                speed_cm_s=math.copysign(pace, mover.speed_cm_s),
                half_cm=mover.half_cm + share * (half - mover.half_cm),
                seen=mover.seen + 1,
            )
            self._candidates[k] = _on_its_line(mover, place)
            return
        ahead = velocity[0] / speed, velocity[1] / speed
        self._candidates.append(
            Mover(region, t_s, place, ahead, 0.0, speed, half, places_cm=(place,), leg=(t_s, 0.0))
        )


def _on_its_line(mover: Mover, place: tuple[float, float]) -> Mover:
    """With the line through all places where it was seen, and the speed of all it has gone this way."""
    places = mover.places_cm
    if math.dist(places[-1], place) > PLACES_APART_CM:
        places = (*places[-MOST_PLACES:], place)
    points = np.array(places)
    middle = points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(points - middle, full_matrices=False)
    ahead = np.array(mover.ahead)
    if len(places) >= 5 and sizes[0] > 3 * sizes[1] and np.ptp((points - middle) @ axes[0]) > LONG_CM:
        ahead = axes[0] * math.copysign(1.0, float(axes[0] @ ahead))
    origin = middle + float((mover.origin_cm - middle) @ ahead) * ahead
    mover = replace(
        mover,
        origin_cm=(float(origin[0]), float(origin[1])),
        ahead=(float(ahead[0]), float(ahead[1])),
        places_cm=places,
    )
    at = mover.along(*place)[0]
    speed = mover.speed_cm_s
    if mover.leg is not None and abs(at - mover.leg[1]) > LONG_CM and mover.t_s - mover.leg[0] > LONG_S:
        speed = (at - mover.leg[1]) / (mover.t_s - mover.leg[0])
    if speed * mover.speed_cm_s <= 0.0:
        speed = mover.speed_cm_s
    return replace(mover, at_cm=at, speed_cm_s=speed)


def _sight_of(region: int, feet: Feet, t_s: float) -> _Sight | None:
    own, cut = feet.columns_of(region)
    if len(own) < LEAST_COLUMNS or len(own) < (1 - CUT_PART) * (len(own) + len(cut)):
        return None
    depth = feet.height_cm / quantile(np.sort(feet.slope[own]), 0.9)
    width = feet.width_cm(own, depth)
    if depth > FARTHEST_CM or width > WIDEST_CM:
        return None
    left, right = int(own[0]), int(own[-1])
    last = len(feet.region) - 1

    def is_own(edge: int, beyond: int) -> bool:
        if edge in (0, last) or not 0 <= beyond <= last:
            return False
        hidden = feet.depth_cm[beyond] < HIDES * depth and feet.region[beyond] != region
        return not hidden and not feet.cut[beyond]

    far = depth * (1 + width / depth / 2)  # where the edges of something round are
    ends = [
        feet.point(edge, far) if is_own(edge, beyond) else None
        for edge, beyond in ((left, left - 2), (right, right + 2))
    ]
    if ends == [None, None]:
        return None
    eye, front = feet.point(left, 0.0), feet.point((left + right) // 2, depth)
    away = math.dist(eye, front)
    ray = (front[0] - eye[0]) / away, (front[1] - eye[1]) / away
    half = width / 2
    moved = [None if end is None else (end[0] - half * ray[0], end[1] - half * ray[1]) for end in ends]
    return _Sight(t_s, moved[0], moved[1], depth, ray)


def _even_motion(seen: list[_Sight], known: bool) -> tuple[float, float] | None:
    """Velocity of a thing whose edges move evenly and alike; None where nothing surely moves.

    One edge is enough of what is known to move; of a wall that is seen in part one edge wanders.
    """
    sides = [(s.t_s, s.left) for s in seen], [(s.t_s, s.right) for s in seen]
    ways = [[(t_s, *end) for t_s, end in side if end is not None] for side in sides]
    ways = [way for way in ways if len(way) >= LEAST_SIGHTINGS and len(way) > 0.8 * len(seen)]
    if len(ways) < (1 if known else 2):
        return None
    fits = [fit for way in ways if (fit := _line(way, seen[-1])) is not None]
    if len(fits) < len(ways):
        return None
    velocity = sum(x for x, _ in fits) / len(fits), sum(z for _, z in fits) / len(fits)
    speed = math.hypot(*velocity)
    if speed > FASTEST_CM_S:
        return None
    if len(fits) == 2 and math.dist(*fits) > UNLIKE * speed:
        return None
    return velocity


def _line(way: list[tuple[float, float, float]], last: _Sight) -> tuple[float, float] | None:
    """Velocity (x, z) of places (time, x, z); None where it is not even, or too slow to be no error."""
    if way[-1][0] - way[0][0] < LEAST_S:
        return None
    count = len(way)
    middle_s, middle_x, middle_z = (sum(values) / count for values in zip(*way, strict=True))
    ray_x, ray_z = last.ray
    # since the middle of the times, and from the middle of the places: along the ray, and aside to the right
    steps = [
        (t_s - middle_s, (x - middle_x) * ray_x + (z - middle_z) * ray_z,
         (x - middle_x) * ray_z - (z - middle_z) * ray_x)
        for t_s, x, z in way
    ]  # fmt: skip
    lever2 = sum(t * t for t, _, _ in steps)
    along = sum(t * a for t, a, _ in steps) / lever2
    aside = sum(t * b for t, _, b in steps) / lever2
    stray_along = math.sqrt(sum((a - t * along) ** 2 for t, a, _ in steps) / count)
    stray_aside = math.sqrt(sum((b - t * aside) ** 2 for t, _, b in steps) / count)
    if stray_aside > STRAY_CM or stray_along > STRAY_SHARE * last.depth_cm:
        return None
    sure = SURE_SIGMAS / math.sqrt(lever2)
    goes_aside = abs(aside) > max(ASIDE_CM_S, ASIDE_SHARE * last.depth_cm, sure * stray_aside)
    goes_along = abs(along) > max(ALONG_CM_S, ALONG_SHARE * last.depth_cm, sure * stray_along)
    if not goes_aside and not goes_along:
        return None
    return along * ray_x + aside * ray_z, along * ray_z - aside * ray_x
