"""Which things move: each is followed by its own foot on the floor, for depth from motion is wrong of them.

Only edges that are its own count: not where the picture ends or something nearer hides the rest. What moves
evenly, and too fast for an error, is a mover; its line is kept for a while after it has left the view.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from host.nav import _nav
from host.nav.mover import NAMELESS, TURNED_CM, Mover, Sight
from host.nav.stand import Feet

FOLLOWED_S = 0.7  # after its foot was last seen
HALF_CM = 9.0  # of something of which only one edge was ever seen
LEAST_COLUMNS = 3
CONFIRMED = 3  # even motions one after the other, until it counts as a mover
LINE_S = 85.0  # where it would be looked for if it came back
NEAR_CM = 60.0  # the foot of what stands nearer may be below the picture
ABOUT_CM = 8.0  # it is then taken for the mover that should be so near to there
BESIDE_CM = 25.0  # the same mover comes back on its line, off by so much
LIKE_RAD = math.radians(35)
LONG_HELD_S = 6.0
UNSEEN_S = 0.25  # so long after it was last seen it is looked for
PLACES = 6  # of those where it can be
GONE_S = 1.5  # who was last seen so long ago may be who is seen now
HELD_S = 1.0  # a region that moved still does, so long after that was last seen
MISSED_S = 0.1  # so long after its own region was last seen the net may have made it one with the floor


class Tracks:
    """Where every thing has lately been seen to stand, and what moves."""

    def __init__(self) -> None:
        self._seen: dict[int, _nav.Track] = {}
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
        sight = feet.sight_of(region, t_s)
        if sight is None:
            self._see_on_line(region, feet, t_s)
            return self._known.velocity(region, t_s)
        track = self._track(region, sight)
        known = self._known.velocity(region, t_s) is not None
        velocity = track.velocity(known) if known or not self.turns else None
        place, half = _disc(sight, self._known.half_cm(region))
        if velocity is not None:
            self._known.note(region, place, velocity, half)
            return velocity
        if track.stands():
            self._known.drop(region)
            return None
        self._known.glimpse(region, place)
        return self._known.velocity(region, t_s)

    def see_mixed(self, region: int, feet: Feet, t_s: float) -> None:
        """What stands in a region that is also floor may be a known mover; told of each once a frame."""
        sight = feet.sight_of(region, t_s)
        if sight is None:
            return
        track = self._track(region, sight)
        velocity = None if self.turns else track.velocity(known=False)
        self._known.seen_mixed(*_disc(sight, HALF_CM), velocity)

    def _track(self, region: int, sight: _nav.FootSight) -> _nav.Track:
        """A region's sights of the last while, with this one."""
        track = self._seen.get(region)
        if track is None:
            track = self._seen[region] = _nav.Track(sight)
        else:
            track.see(sight)
        return track

    def stands(self, region: int) -> bool:
        """Whether its own foot says that it has not moved for a while."""
        return region in self._seen and self._seen[region].stands()

    def forget(self, t_s: float, turns: bool = False) -> None:
        """What was not seen for a while; where the robot turns nothing that moves is found anew."""
        if self.turns and not turns:
            self._seen.clear()
        self.turns = turns
        self._seen = {k: track for k, track in self._seen.items() if t_s - track.newest_s < FOLLOWED_S}
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


def _disc(sight: _nav.FootSight, known_half_cm: float) -> tuple[Sight, float]:
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
