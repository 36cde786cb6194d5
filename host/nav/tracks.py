"""Which things move: each is followed by its own foot on the floor, for depth from motion is wrong of them.

Only edges that are its own count: not where the picture ends or something nearer hides the rest. What moves
evenly, and too fast for an error, is a mover; its line is kept for a while after it has left the view.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from host.nav import _nav
from host.nav.mover import NAMELESS, SIGMA_RAY, TURNED_CM, Mover, Sight
from host.nav.stand import CUT_PART, Feet, quantile

OVER_S = 0.7  # a velocity across the view is that over so long
ALONG_S = 1.5  # and one along it, where feet are known less well
LEAST_S = 0.3
LEAST_SIGHTINGS = 5
FASTEST_CM_S = 40.0  # what is faster are regions that merge or split
ASIDE_CM_S = 6.0  # across the view what stands still never wanders as fast
ASIDE_SHARE = 0.06  # nor by more than this part of its distance in a second
ALONG_CM_S = 8.0
ALONG_SIGMAS = 2.5  # along it, it must have gone farther than a foot may be off
SURE_SIGMAS = 4.0
STRAY_CM = 1.5  # rms of the places about an even motion across the view
STRAY_SHARE = 0.06  # and along it, of the distance
UNLIKE = 0.35  # both edges go as fast, but for this part
ONE_EDGE_CM = 7.0  # of something of which one edge alone is seen, that must go as far
ONE_EDGE_SHARE = 0.08  # and this part of its distance
FARTHEST_CM = 220.0
WIDEST_CM = 60.0  # what is wider is furniture
HALF_CM = 9.0  # of something of which only one edge was ever seen
HIDES = 0.96  # what is nearer than this part of its distance hides a part of a thing
LEAST_COLUMNS = 3
CONFIRMED = 3  # even motions one after the other, until it counts as a mover
LINE_S = 85.0  # where it would be looked for if it came back
NEAR_CM = 60.0  # the foot of what stands nearer may be below the picture
ABOUT_CM = 8.0  # it is then taken for the mover that should be so near to there
BESIDE_CM = 25.0  # the same mover comes back on its line, off by so much
LIKE_RAD = math.radians(35)
STILL_CM = 2.5  # who goes no farther across the view in ALONG_S stands
LONG_HELD_S = 6.0
UNSEEN_S = 0.25  # so long after it was last seen it is looked for
PLACES = 6  # of those where it can be
GONE_S = 1.5  # who was last seen so long ago may be who is seen now
HELD_S = 1.0  # a region that moved still does, so long after that was last seen
MISSED_S = 0.1  # so long after its own region was last seen the net may have made it one with the floor


@dataclass(frozen=True)
class _Sight:
    """Where the foot of a region stands at one time: its ends (x, z), None where they are not its own."""

    t_s: float
    left: tuple[float, float] | None
    right: tuple[float, float] | None
    depth_cm: float
    sigma_cm: float  # along the view
    ray: tuple[float, float]  # unit vector from the camera to it


class Tracks:
    """Where every thing has lately been seen to stand, and what moves."""

    def __init__(self) -> None:
        self._seen: dict[int, deque[_Sight]] = {}
        self._known = Movers()
        self.turns = False  # the robot does: all outlines go far, and the heading errs

    @property
    def movers(self) -> list[Mover]:
        """What surely moves, also if it is out of sight."""
        return self._known.sure

    def keep_movers(self, others: Tracks) -> None:
        """Remember what somebody else knows to move, but not the names that another net gave it."""
        self._known = others._known
        self._known.unname()

    def velocity(self, region: int, feet: Feet, t_s: float) -> tuple[float, float] | None:
        """(x, z) in cm/s of a thing that surely moves, None otherwise; told of every region once a frame."""
        sight = _sight_of(region, feet, t_s)
        if sight is None:
            self._see_on_line(region, feet, t_s)
            return self._known.velocity(region, t_s)
        seen = self._lately(region, sight)
        known = self._known.velocity(region, t_s) is not None
        velocity = _even_motion(list(seen), known) if known or not self.turns else None
        place, half = _disc(sight, self._known.half_cm(region))
        if velocity is not None:
            self._known.note(region, place, velocity, half)
            return velocity
        if _stands(seen):
            self._known.drop(region)
            return None
        self._known.glimpse(region, place)
        return self._known.velocity(region, t_s)

    def see_mixed(self, region: int, feet: Feet, t_s: float) -> None:
        """What stands in a region that is also floor may be a known mover; told of each once a frame."""
        sight = _sight_of(region, feet, t_s)
        if sight is None:
            return
        seen = self._lately(region, sight)
        velocity = None if self.turns else _even_motion(list(seen), known=False)
        self._known.seen_mixed(*_disc(sight, HALF_CM), velocity)

    def _lately(self, region: int, sight: _Sight) -> deque[_Sight]:
        """A region's sights of the last while, with this one."""
        seen = self._seen.setdefault(region, deque())
        seen.append(sight)
        while seen[-1].t_s - seen[0].t_s > ALONG_S:
            seen.popleft()
        return seen

    def stands(self, region: int) -> bool:
        """Whether its own foot says that it has not moved for a while."""
        return region in self._seen and _stands(self._seen[region])

    def forget(self, t_s: float, turns: bool = False) -> None:
        """What was not seen for a while; where the robot turns nothing that moves is found anew."""
        if self.turns and not turns:
            self._seen.clear()
        self.turns = turns
        self._seen = {k: seen for k, seen in self._seen.items() if t_s - seen[-1].t_s < OVER_S}
        self._known.forget(t_s)

    def look_for(self, feet: Feet, t_s: float) -> None:
        """What is out of sight: whether it is where it should be."""
        self._known.look_for(t_s, feet.seen_free)

    def _see_on_line(self, region: int, feet: Feet, t_s: float) -> None:
        """Something whose foot is below the picture, on a line that is known, where the mover should be."""
        columns = feet.columns_of(region)[1]
        if len(columns) < LEAST_COLUMNS or columns[0] == 0 or columns[-1] == len(feet.region) - 1:
            return
        middle = int(columns[len(columns) // 2])
        eye, far = np.array(feet.point(middle, 0.0)), np.array(feet.point(middle, 100.0))
        for mover in self._known.sure:
            (at0, off0), (at1, off1) = mover.along(*eye), mover.along(*far)
            part = off0 / (off0 - off1) if abs(off0 - off1) > 1.0 else -1.0
            if not 0.0 < part * 100.0 < NEAR_CM or feet.width_cm(columns, part * 100.0) > 4 * mover.half_cm:
                continue
            at = at0 + part * (at1 - at0)
            low, high = mover.reach(np.array([t_s]))
            if low[0] - ABOUT_CM < at < high[0] + ABOUT_CM:
                x, z = eye + part * (far - eye)
                ray = (far - eye) / np.hypot(*(far - eye))
                self._known.seen_on_line(mover, region, Sight(t_s, x, z, (ray[0], ray[1]), part * 100.0))
                return


class Movers:
    """The movers that are remembered, and those that may prove to be some."""

    def __init__(self) -> None:
        self._all: list[Mover] = []
        self._t_s = -math.inf

    @property
    def sure(self) -> list[Mover]:
        """What surely moves, also if it is out of sight."""
        return [m for m in self._all if m.goes and m.seen >= CONFIRMED and self._t_s - m.t_s < m.lasts_s]

    def velocity(self, region: int, t_s: float) -> tuple[float, float] | None:
        """(x, z) in cm/s of a region that was lately seen to move; of what surely does, not so lately."""
        for mover in self._all:
            held_s = LONG_HELD_S if mover.certain else HELD_S
            called = mover.region == region and t_s - mover.named_s < held_s
            if called and mover.goes and mover.seen >= CONFIRMED:
                return mover.velocity_cm_s
        return None

    def half_cm(self, region: int) -> float:
        """Half the width of a region, if it is known to move."""
        return next((m.half_cm for m in self._all if m.region == region), HALF_CM)

    def note(self, region: int, place: Sight, velocity: tuple[float, float], half_cm: float) -> None:
        """An even motion was seen: of a mover that is known, or of a new one."""
        speed = math.hypot(*velocity)
        for k, mover in enumerate(self._all):
            at, beside = mover.along(place.x_cm, place.z_cm)
            cosine = _cosine(velocity, mover)
            low, high = mover.reach(np.array([place.t_s]))
            same = (
                abs(beside) < BESIDE_CM
                and abs(cosine) > math.cos(LIKE_RAD)
                and low[0] - BESIDE_CM < at < high[0] + BESIDE_CM
            )
            named = mover.region != region and place.t_s - mover.named_s < MISSED_S
            if same and named and not _should_be(mover, place):  # its shadow goes with it
                return
            if same or (not mover.understood and mover.region == region and place.t_s - mover.t_s < 0.5):
                now = replace(mover.told(place, region, half_cm, cosine < 0), seen=mover.seen + 1)
                self._all[k] = now
                self._all = [one for one in self._all if one is now or not _replaces(now, one)]
                return
            there = abs(beside) < ABOUT_CM and low[0] - ABOUT_CM < at < high[0] + ABOUT_CM
            if there and mover.understood and not mover.lost:  # coming into view it seems to go elsewhere
                self._all[k] = mover.told(place, region, None)
                return
        ahead = velocity[0] / speed, velocity[1] / speed
        at = (place.x_cm, place.z_cm)
        old = next((one for one in self._all if one.region == region and not one.understood), None)
        if old is not None:  # on another line than it seemed
            self._all.remove(old)
        sights = (*(() if old is None else old.sights), place)
        seen = 1 if old is None else old.seen
        leg = (place.t_s, 0.0)
        new = Mover(
            region, place.t_s, at, ahead, 0.0, speed, half_cm, sights, leg, seen=seen, since_s=place.t_s,
            named_s=place.t_s,
        )  # fmt: skip
        self._all.append(new)

    def glimpse(self, region: int, place: Sight) -> None:
        """A region that is known to move is here, whether or not its motion shows."""
        for k, mover in enumerate(self._all):
            if mover.region == region and place.t_s - mover.named_s < HELD_S:
                if not mover.lost and _may_be(mover, place):
                    self._all[k] = mover.told(place, region, None)
                    return

    def seen_on_line(self, mover: Mover, region: int, place: Sight) -> None:
        """A mover was seen where only the direction to it is known, and that it is on its line."""
        if mover.lost or not _should_be(mover, place):  # too badly seen to tell more
            return
        k = next(k for k, one in enumerate(self._all) if one is mover)
        self._all[k] = mover.told(place, region, None)

    def seen_mixed(self, place: Sight, half_cm: float, velocity: tuple[float, float] | None) -> None:
        """Something without a region of its own may be a mover: if it goes along its line, where that can be.

        Without a motion it must be just where a mover should be whose own region was seen a moment ago.
        """
        for k, mover in enumerate(self._all):
            unseen_s = place.t_s - mover.t_s
            if mover.seen < CONFIRMED or unseen_s < MISSED_S or half_cm > 2 * mover.half_cm:
                continue
            if velocity is not None:
                cosine = _cosine(velocity, mover)
                if abs(cosine) > math.cos(LIKE_RAD) and _may_be(mover, place):
                    told = mover.told(place, None, None, cosine < 0)
                    self._all[k] = replace(told, seen=mover.seen + 1)
                    return
            elif unseen_s < HELD_S and not mover.lost:
                beside = mover.along(place.x_cm, place.z_cm)[1]
                if abs(beside) < ABOUT_CM and _should_be(mover, place):
                    self._all[k] = mover.told(place, None, None)
                    return

    def unname(self) -> None:
        """From now on any region may be any of them."""
        self._all = [replace(one, region=NAMELESS, named_s=-math.inf) for one in self._all]

    def drop(self, region: int) -> None:
        """It stands."""
        self._all = [
            m for m in self._all if m.region != region or m.understood or self._t_s - m.named_s > HELD_S
        ]

    def look_for(self, t_s: float, seen_free: Callable[[np.ndarray, float], np.ndarray]) -> None:
        """Where what is out of sight should be, is it there?

        Parameters
        ----------
        seen_free : whether at places (N, 2) = (x, z), and so far to both sides, floor is seen, (N,) bool.
        """
        for k, mover in enumerate(self._all):
            if not mover.understood or mover.lost or t_s - mover.t_s < UNSEEN_S:
                continue
            low, high = mover.reach(np.array([t_s]))
            on = np.linspace(low[0], high[0], PLACES)
            places = np.array(mover.origin_cm) + on[:, None] * np.array(mover.ahead)
            missed = mover.missed + 1 if seen_free(places, mover.half_cm).all() else 0
            if missed != mover.missed:
                self._all[k] = replace(mover, missed=missed)

    def forget(self, t_s: float) -> None:
        """What was not seen for a while."""
        self._t_s = t_s
        self._all = [m for m in self._all if t_s - m.t_s < (LINE_S if m.seen >= CONFIRMED else 1.0)]


def _cosine(velocity: tuple[float, float], mover: Mover) -> float:
    """Of the angle between a velocity and a mover's line."""
    return (velocity[0] * mover.ahead[0] + velocity[1] * mover.ahead[1]) / math.hypot(*velocity)


def _may_be(mover: Mover, place: Sight) -> bool:
    """Whether it can be there by now, beside its line by hardly more than sights err."""
    at, beside = mover.along(place.x_cm, place.z_cm)
    low, high = mover.reach(np.array([place.t_s]))
    return bool(abs(beside) < BESIDE_CM and low[0] - ABOUT_CM < at < high[0] + ABOUT_CM)


def _should_be(mover: Mover, place: Sight) -> bool:
    """Whether it is there along its line if it went on as it did."""
    now = np.array([place.t_s])
    off = abs(mover.along(place.x_cm, place.z_cm)[0] - float(mover.place(now)[0]))
    return bool(off <= TURNED_CM + float(mover.sigma_cm(now)[0]))


def _replaces(now: Mover, old: Mover) -> bool:
    """Whether what was lately seen so often is what was long ago seen on the same line."""
    at, beside = old.along(*now.origin_cm)
    cosine = abs(now.ahead[0] * old.ahead[0] + now.ahead[1] * old.ahead[1])
    low, high = old.extent_cm
    alike = cosine > math.cos(LIKE_RAD) and abs(beside) < BESIDE_CM and low < at < high
    return now.understood and alike and now.t_s - old.t_s > GONE_S


def _disc(sight: _Sight, known_half_cm: float) -> tuple[Sight, float]:
    """Middle and radius of something as round as it is wide, its front towards the robot."""
    ray_x, ray_z = sight.ray  # and (ray_z, -ray_x) is to the right
    if sight.left is not None and sight.right is not None:
        half = max(math.dist(sight.left, sight.right) / 2, 1.0)
        x, z = (sight.left[0] + sight.right[0]) / 2, (sight.left[1] + sight.right[1]) / 2
    else:
        half, ends = known_half_cm, (sight.left, sight.right)
        x, z = next(
            (end[0] + side * half * ray_z, end[1] - side * half * ray_x)
            for end, side in zip(ends, (1, -1), strict=True)
            if end is not None
        )
    return Sight(sight.t_s, x + half * ray_x, z + half * ray_z, sight.ray, sight.depth_cm + half), half


def _stands(seen: deque[_Sight]) -> bool:
    """Whether it has not moved for a while, as far as its foot can tell."""
    if seen[-1].t_s - seen[0].t_s < 0.9 * ALONG_S:
        return False
    for side in ("left", "right"):
        ends = [(one.t_s, *end) for one in seen if (end := getattr(one, side)) is not None]
        if len(ends) > 0.8 * len(seen):
            aside, along = _nav.extent(ends, seen[-1].ray)
            if aside < STILL_CM and along < ALONG_SIGMAS * seen[-1].sigma_cm:
                return True
    return False


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
    sigma = SIGMA_RAY * depth**2 / feet.height_cm
    return _Sight(t_s, moved[0], moved[1], depth, sigma, ray)


def _even_motion(seen: list[_Sight], known: bool) -> tuple[float, float] | None:
    """Velocity of a thing whose edges move evenly and alike; None where nothing surely moves.

    One edge is enough of what is known to move, or goes far; of a wall that is seen in part one edge wanders.
    """
    lately = [one for one in seen if seen[-1].t_s - one.t_s <= OVER_S]
    return _velocity(lately, known, across=True) or _velocity(seen, known, across=False)


def _velocity(seen: list[_Sight], known: bool, across: bool) -> tuple[float, float] | None:
    ways = [
        [(s.t_s, *s.left) for s in seen if s.left is not None],
        [(s.t_s, *s.right) for s in seen if s.right is not None],
    ]
    ways = [way for way in ways if len(way) >= LEAST_SIGHTINGS and len(way) > 0.8 * len(seen)]
    if not ways or (len(ways) == 1 and not known and not (across and _goes_far(ways[0], seen[-1]))):
        return None
    fits = [fit for way in ways if (fit := _line(way, seen[-1], across)) is not None]
    if len(fits) < len(ways):
        return None
    velocity = sum(x for x, _ in fits) / len(fits), sum(z for _, z in fits) / len(fits)
    speed = math.hypot(*velocity)
    if speed > FASTEST_CM_S or (len(fits) == 2 and math.dist(*fits) > UNLIKE * speed):
        return None
    return velocity


def _goes_far(way: list[tuple[float, float, float]], last: _Sight) -> bool:
    """Whether one edge alone has gone farther across the view than edges of walls seen in part wander."""
    (_, x0, z0), (_, x1, z1) = way[0], way[-1]
    gone = abs((x1 - x0) * last.ray[1] - (z1 - z0) * last.ray[0])
    return gone > max(ONE_EDGE_CM, ONE_EDGE_SHARE * last.depth_cm)


def _line(way: list[tuple[float, float, float]], last: _Sight, across: bool) -> tuple[float, float] | None:
    """Velocity (x, z) of places (time, x, z) that go evenly across the view, or else along it.

    None where it is not even, or too slow to be no error.
    """
    lasts_s = way[-1][0] - way[0][0]
    if lasts_s < (LEAST_S if across else ALONG_S / 2):
        return None
    along, aside, stray_along, stray_aside, lever2 = _nav.even_motion(way, last.ray)
    if stray_aside > STRAY_CM or stray_along > STRAY_SHARE * last.depth_cm:
        return None
    sure, (ray_x, ray_z) = SURE_SIGMAS / math.sqrt(lever2), last.ray
    if across:
        goes = abs(aside) > max(ASIDE_CM_S, ASIDE_SHARE * last.depth_cm, sure * stray_aside)
    else:
        goes = abs(along) > max(ALONG_CM_S, ALONG_SIGMAS * last.sigma_cm / lasts_s, sure * stray_along)
    return (along * ray_x + aside * ray_z, along * ray_z - aside * ray_x) if goes else None
