"""What is remembered of something that moves: the line it goes on, how fast, and where it turns round.

From that follows between where and where it can be at a later time, also when nobody sees it. Where it is not
known where it turns round, it may do so anywhere beyond where it has been.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from host.nav.odometry import heading_of
from host.pose import Pose

LONG_CM = 15.0  # a way this long tells the direction
LEAST_SPAN_CM = 10.0  # who turns round sooner is not understood
STEPS = (0.1, 0.01, 0.1, 0.1)  # of place, speed and ends, for the slopes of the motion over them
ROUNDS = 3
TURNED_CM = 6.0  # so much behind where it should be: it has turned round
UNSEEN_S = 1.0  # not seen for longer: nobody knows what it did meanwhile
PLACES_APART_CM = 3.0
MOST_PLACES = 80
ALONG_WORSE = 4.0  # places err this much more along the view than across it
SIGMA_RAY = 0.01  # slope of the ray to a foot
END_CM = 4.0  # where it turned round is known to this
SPREAD_CM = 2.0  # and where it is to this
SURE_SIGMAS = 2.0  # besides what follows from the fit of its motion, to so many sigmas
SIGHT_CM = 3.0  # a sight is worth this: the errors of neighbouring ones are alike
SPEED_SHARE = 0.2  # before a motion is fitted its speed is known to this part of it,
DOUBT_CM = 10.0  # and where it turns round to this
MISFIT_CM = 5.0  # of the middle one of the sights off a motion, above which the older ones were of another
RECENT_S, LEAST_RECENT = 1.0, 4  # or of so many of the newest
STRAYS = 2  # so many of the farthest sights may be of something else
GUESSED_CM = 90.0  # where it turned out of sight is believed up to so far beyond where it has been
LEAST_CM_S = 5.0  # slower than any motion that is seen to be one: on the whole it stands
UNKNOWN_CM_S = 20.0  # as fast may go what was hardly seen to go at all
BEYOND_CM = 80.0  # so far beyond where it has been it may go
SEEN_BESIDE = 0.1  # x/z: its shadow, and what the net makes one region with it
MISSED = 4  # pictures without it where it should be, and it is elsewhere
OFTEN = 10  # even motions seen, until nobody doubts it
REMEMBERED_S = 32.0  # out of sight, it is reckoned with for so long
BRIEFLY_S = 3.0  # if that was seen only a few times,
HARDLY_S = 8.0  # and if it was seen to go hardly any way: nobody knows where to
NAMELESS = -2  # no region has this number
ASTRAY_S = 40.0  # if it is known where it turns round, on both sides, but it is not where it should be,
FORESEEN_S = 80.0  # and so long where nothing says that it goes no longer to and fro


@dataclass(frozen=True)
class Sight:
    """A place where it was seen."""

    t_s: float
    x_cm: float
    z_cm: float
    ray: tuple[float, float]  # unit vector (x, z) from the camera to it
    away_cm: float  # from the camera


@dataclass(frozen=True)
class Mover:
    """Something that goes along a line, perhaps to and fro.

    Attributes
    ----------
    region : last seen as this
    t_s : when
    named_s : and when it last was a region of its own, by that name
    origin_cm, ahead : a point (x, z) of the line and its direction
    at_cm, speed_cm_s : along the line from there; the speed is negative on the way back
    half_cm : half its width
    sights : where it was, some centimetres apart, the newest last
    leg : (time, place on the line) since when it was seen to go this way
    low_cm, high_cm : where it turns round, as far as that has shown
    doubt : (4, 4) covariance of place, speed and ends
    seen : even motions that were seen
    since_s : its motion is fitted to the sights from then on
    missed : pictures one after the other in which it was not where it should have been seen
    """

    region: int
    t_s: float
    origin_cm: tuple[float, float]
    ahead: tuple[float, float]
    at_cm: float
    speed_cm_s: float
    half_cm: float
    sights: tuple[Sight, ...]
    leg: tuple[float, float]
    low_cm: float | None = None
    high_cm: float | None = None
    seen: int = 1
    since_s: float = -math.inf
    missed: int = 0
    named_s: float = -math.inf
    doubt: np.ndarray = field(default_factory=lambda: np.diag([4.0, 9.0, 100.0, 100.0]), compare=False)

    @property
    def certain(self) -> bool:
        """It was seen to move so often that nobody doubts it."""
        return self.seen >= OFTEN

    @property
    def velocity_cm_s(self) -> tuple[float, float]:
        """(x, z)."""
        return self.speed_cm_s * self.ahead[0], self.speed_cm_s * self.ahead[1]

    @property
    def gone_cm(self) -> float:
        """From end to end of where it was seen."""
        low, high = self.been_cm
        return high - low

    @property
    def understood(self) -> bool:
        """It was seen to go far: what fits it badly is something else, or badly seen."""
        return self.certain and self.gone_cm > LONG_CM

    @property
    def lost(self) -> bool:
        """It is not where it should be: nobody knows where on its line it is."""
        return self.missed >= MISSED

    @property
    def goes(self) -> bool:
        """Its sights are of something that goes; of what stands, edges that wander fit no speed."""
        return abs(self.speed_cm_s) >= LEAST_CM_S

    @property
    def lasts_s(self) -> float:
        """So long after it was last seen it is reckoned with."""
        if not self.certain:
            return BRIEFLY_S
        if self.gone_cm < LONG_CM:
            return HARDLY_S
        if self.low_cm is None or self.high_cm is None:
            return REMEMBERED_S
        return ASTRAY_S if self.lost else FORESEEN_S

    @cached_property
    def been_cm(self) -> tuple[float, float]:
        """Between where and where on its line it has been: it will hardly turn round before."""
        places = [self.along(one.x_cm, one.z_cm)[0] for one in self.sights]
        low, high = min([*places, self.at_cm]), max([*places, self.at_cm])
        if self.low_cm is not None:
            low = min(low, self.low_cm)
        if self.high_cm is not None:
            high = max(high, self.high_cm)
        return low, high

    @cached_property
    def extent_cm(self) -> tuple[float, float]:
        """Between where and where on its line it may ever be."""
        low, high = self.been_cm
        return (
            low - (END_CM if self.low_cm is not None else BEYOND_CM),
            high + (END_CM if self.high_cm is not None else BEYOND_CM),
        )

    def along(self, x_cm: Any, z_cm: Any) -> tuple[Any, Any]:
        """(along the line, beside it) of a place, or of many."""
        dx, dz = x_cm - self.origin_cm[0], z_cm - self.origin_cm[1]
        return dx * self.ahead[0] + dz * self.ahead[1], dx * self.ahead[1] - dz * self.ahead[0]

    def place(self, t_s: np.ndarray) -> np.ndarray:
        """Where on the line it should be, or should have been, if it turns round nowhere but where it did."""
        return _wave(t_s - self.t_s, self._shape)

    @property
    def _shape(self) -> np.ndarray:
        """Place now, speed, and where it turns round below and above, infinite where that is unknown."""
        low = -math.inf if self.low_cm is None else self.low_cm
        high = math.inf if self.high_cm is None else self.high_cm
        return np.array([self.at_cm, self.speed_cm_s, low, high])

    def sigma_cm(self, t_s: np.ndarray) -> np.ndarray:
        """How well the place on the line is known at times."""
        slope = _slopes(t_s - self.t_s, self._shape)
        return np.sqrt(np.maximum(((slope @ self.doubt) * slope).sum(axis=1), 0.0))

    def reach(self, t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Between where and where on its line it can be at times from now on."""
        if self.lost:
            low_cm, high_cm = self.extent_cm
            return np.full(len(t_s), low_cm), np.full(len(t_s), high_cm)
        straight = abs(self.speed_cm_s) * np.maximum(t_s - self.t_s, 0.0)
        spread = SPREAD_CM + SURE_SIGMAS * self.sigma_cm(t_s)
        if self.gone_cm < LONG_CM:  # nobody knows yet how fast, nor which way
            spread = spread + UNKNOWN_CM_S * np.maximum(t_s - self.t_s, 0.0)
        way = math.copysign(1.0, self.speed_cm_s)
        should = self.place(t_s)
        low = high = should
        been = self.been_cm
        ends = (self.low_cm, self.high_cm)
        if (ends[1] if way > 0 else ends[0]) is None:  # it may turn anywhere beyond where it has been
            free = abs((been[1] if way > 0 else been[0]) - self.at_cm)
            turned = self.at_cm + way * np.minimum(straight, 2 * free - straight)
            onwards = self.at_cm + way * np.minimum(straight, free + BEYOND_CM)
            low, high = np.minimum(turned, onwards), np.maximum(turned, onwards)
        elif ends[0] is None or ends[1] is None:  # it will turn where it did; on the other side anywhere
            beyond = should < been[0] if way > 0 else should > been[1]
            again = 2 * (been[0] if way > 0 else been[1]) - should
            low, high = (
                np.where(beyond, np.minimum(should, again), should),
                np.where(beyond, np.maximum(should, again), should),
            )
        low, high = low - spread, high + spread
        extent = self.extent_cm
        return np.clip(low, *extent), np.clip(high, *extent)

    def gap_cm(self, places: np.ndarray, t_s: np.ndarray) -> np.ndarray:
        """(N,) how near its rim can be to places (N, 2) = (x, z) at times from now on."""
        low, high = self.reach(t_s)
        on, off = self._on_line(places)
        return np.hypot(np.maximum(np.maximum(low - on, on - high), 0.0), off) - self.half_cm

    def least_gap_cm(self, places: np.ndarray) -> np.ndarray:
        """(N,) how near it may ever come to places (N, 2)."""
        low, high = self.extent_cm
        on, off = self._on_line(places)
        return np.hypot(np.maximum(np.maximum(low - on, on - high), 0.0), off) - self.half_cm

    def seen_between(self, camera: Pose) -> tuple[float, float] | None:
        """Between which x/z it may be in a picture taken there and then; None where it is behind."""
        low, high = self.reach(np.array([camera.t_s]))
        at = np.array([low[0], high[0]])
        rel = np.array(self.origin_cm) + at[:, None] * self.ahead - camera.position_cm[[0, 2]]
        heading = heading_of(camera)
        ahead = rel @ (math.sin(heading), math.cos(heading))
        aside = rel @ (math.cos(heading), -math.sin(heading))
        if ahead.max() < self.half_cm:
            return None
        ahead = np.maximum(ahead, self.half_cm)
        wide = self.half_cm / ahead + SEEN_BESIDE
        return float((aside / ahead - wide).min()), float((aside / ahead + wide).max())

    def nearest_cm(self, camera: Pose) -> float:
        """How near to the camera it can be now."""
        eye = camera.position_cm[[0, 2]][None, :]
        return float(self.gap_cm(eye, np.array([camera.t_s]))[0])

    def _on_line(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rel = places - self.origin_cm
        return rel @ self.ahead, rel @ (self.ahead[1], -self.ahead[0])

    def told(
        self, sight: Sight, region: int | None, half_cm: float | None, back: bool | None = None
    ) -> Mover:
        """With a new sight of it, and if known whether it goes against the line's direction.

        Where it is no region of its own there, it has no new name either.
        """
        at = self.along(sight.x_cm, sight.z_cm)[0]
        since = sight.t_s - self.t_s
        mover = replace(self, t_s=sight.t_s, missed=0)
        if region is not None:
            mover = replace(mover, region=region, named_s=sight.t_s)
        if half_cm is not None:
            mover = replace(mover, half_cm=self.half_cm + (half_cm - self.half_cm) / min(self.seen + 1, 10))
        if self.lost:  # it goes on its line as before, but was elsewhere
            speed = math.copysign(self.speed_cm_s, -1.0 if back else 1.0)
            mover = replace(mover, at_cm=at, speed_cm_s=speed, leg=(sight.t_s, at), since_s=sight.t_s)
        elif self.understood and self.low_cm is not None and self.high_cm is not None:
            mover = mover._onwards(self, at)
        else:
            mover = mover._turned(self, at, since, back)
        if (
            math.dist((self.sights[-1].x_cm, self.sights[-1].z_cm), (sight.x_cm, sight.z_cm))
            > PLACES_APART_CM
        ):
            mover = replace(mover, sights=(*mover.sights[-MOST_PLACES:], sight))
        return mover._on_its_line(sight)

    def _onwards(self, before: Mover, at: float) -> Mover:
        """Where it is now, if it goes on as it always did: one strange sight proves nothing else."""
        back = _is_back(before, self.t_s)
        leg = before.leg if back == (before.speed_cm_s < 0) else (self.t_s, at)
        return replace(
            self, at_cm=at, speed_cm_s=math.copysign(before.speed_cm_s, -1.0 if back else 1.0), leg=leg
        )

    def _turned(self, before: Mover, at: float, since: float, back: bool | None) -> Mover:
        """Where it is now, whether it has turned round meanwhile, and where that was."""
        was_back = before.speed_cm_s < 0
        now = np.array([self.t_s])
        off = abs(at - float(before.place(now)[0]))
        should_back = _is_back(before, self.t_s)
        if off < TURNED_CM + float(before.sigma_cm(now)[0]) and back in (None, should_back):
            speed = math.copysign(before.speed_cm_s, -1.0 if should_back else 1.0)
            leg = before.leg if should_back == was_back and since < UNSEEN_S else (self.t_s, at)
            return replace(self, at_cm=at, speed_cm_s=speed, leg=leg)
        gone = before.speed_cm_s * since
        if back is None:
            behind = before.at_cm + gone - at if not was_back else at - before.at_cm - gone
            back = was_back != (behind > TURNED_CM)
        low, high, speed = before.low_cm, before.high_cm, before.speed_cm_s
        if back == was_back:
            low, high = low if low is None else min(low, at), high if high is None else max(high, at)
            leg = before.leg if since < UNSEEN_S else (self.t_s, at)
            return replace(self, at_cm=at, low_cm=low, high_cm=high, leg=leg)
        end = (before.at_cm + at + gone) / 2
        end = min(end, before.at_cm, at) if was_back else max(end, before.at_cm, at)
        turned = replace(self, at_cm=at, speed_cm_s=-speed, leg=(self.t_s, at))
        if (
            max(before.been_cm[0] - end, end - before.been_cm[1]) > GUESSED_CM
        ):  # it may have turned more often
            return replace(turned, low_cm=None, high_cm=None, since_s=self.t_s)
        return replace(turned, low_cm=end) if was_back else replace(turned, high_cm=end)

    def _on_its_line(self, sight: Sight) -> Mover:
        """With the line through all places where it was seen, and the motion along it that fits them best."""
        origin, ahead = _line_through(self.sights, self.origin_cm, self.ahead)
        mover = replace(self, origin_cm=origin, ahead=ahead)
        return replace(mover, at_cm=mover.along(sight.x_cm, sight.z_cm)[0])._fitted()

    def _fitted(self) -> Mover:
        """With the even motion to and fro that fits all sights; where none does, those of this leg."""
        before = self._shape
        unknown = ~np.isfinite(before)
        sigma = np.array([math.inf, SPEED_SHARE * max(abs(before[1]), 5.0), DOUBT_CM, DOUBT_CM])
        prior = np.diag(1.0 / sigma**2)
        lately = [one for one in self.sights if one.t_s >= self.since_s]
        times = np.array([one.t_s for one in lately]) - self.t_s
        places = np.array([self.along(one.x_cm, one.z_cm)[0] for one in lately])
        times, places = np.append(times, 0.0), np.append(places, self.at_cm)
        shape = before.copy()
        for _ in range(ROUNDS):
            slope = _slopes(times, shape)
            away = places - _wave(times, shape)
            weight = 1.0 / (1.0 + (away / (2 * SIGHT_CM)) ** 2) / SIGHT_CM**2  # a few may go astray
            normal = slope.T @ (weight[:, None] * slope) + prior
            off = np.where(unknown, 0.0, np.nan_to_num(before) - np.nan_to_num(shape))
            step = np.linalg.solve(normal, slope.T @ (weight * away) + prior @ off)
            shape = np.where(unknown, shape, shape + step)
        away = np.abs(places - _wave(times, shape))
        now = times > -RECENT_S
        misfits = float(np.median(away)) > MISFIT_CM
        strays = now.sum() >= LEAST_RECENT and float(np.median(away[now])) > MISFIT_CM
        turned = shape[1] * before[1] <= 0.0
        if (turned or abs(shape[1]) < LEAST_CM_S) and self.understood:
            speed = _even_speed(times[now], places[now])
            if abs(speed) > LEAST_CM_S:  # it goes, and not as slowly: it turned round unseen
                return self._anew(speed)
        if misfits or strays or turned or shape[3] - shape[2] < LEAST_SPAN_CM:
            since_s = self.t_s - RECENT_S if strays else self.leg[0]
            if self.since_s < since_s:
                way = places[-1] - places[int(now.argmax())] if strays else before[1]
                speed = math.copysign(self.speed_cm_s, way)
                return replace(self, since_s=since_s, speed_cm_s=speed, low_cm=None, high_cm=None)._fitted()
            return self
        low, high = (None if gone else float(end) for gone, end in zip(unknown[2:], shape[2:], strict=True))
        been = np.sort([self.along(one.x_cm, one.z_cm)[0] for one in self.sights])
        if len(been) > 2 * STRAYS:  # who has gone farther may do so again
            low = None if low is not None and low > been[STRAYS] + DOUBT_CM else low
            high = None if high is not None and high < been[-1 - STRAYS] - DOUBT_CM else high
        return replace(
            self,
            at_cm=float(shape[0]),
            speed_cm_s=float(shape[1]),
            low_cm=low,
            high_cm=high,
            doubt=np.linalg.inv(normal),
        )

    def _anew(self, speed_cm_s: float) -> Mover:
        """With a speed that the last second's sights alone tell, and ends that nobody knows."""
        return replace(
            self,
            since_s=self.t_s - RECENT_S,
            speed_cm_s=speed_cm_s,
            low_cm=None,
            high_cm=None,
            leg=(self.t_s, self.at_cm),
        )


def _even_speed(times: np.ndarray, places: np.ndarray) -> float:
    """Of places on a line if they are passed one after the other and evenly, else 0."""
    if len(times) < LEAST_RECENT or float(np.ptp(places)) < TURNED_CM:
        return 0.0
    after = times - times.mean()
    speed = float(after @ places / (after @ after))
    off = np.abs(places - places.mean() - speed * after)
    return speed if float(off.max()) < SIGHT_CM else 0.0


def _wave(after_s: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Places on the line at times from now, before or after."""
    at, speed, low, high = shape
    straight = at + speed * after_s
    if np.isfinite(low) and np.isfinite(high):
        length = max(high - low, 1.0)
        gone = np.mod(straight - low, 2 * length)
        return low + np.minimum(gone, 2 * length - gone)
    if np.isfinite(high):
        return np.minimum(straight, 2 * high - straight)
    return np.maximum(straight, 2 * low - straight)


def _slopes(after_s: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """(N, 4) by how much those places change with place, speed and ends."""
    there = _wave(after_s, shape)
    out = np.zeros((len(after_s), 4))
    for k, step in enumerate(STEPS):
        if np.isfinite(shape[k]):
            moved = shape.copy()
            moved[k] += step
            out[:, k] = (_wave(after_s, moved) - there) / step
    return out


def _is_back(mover: Mover, t_s: float) -> bool:
    """Whether at a time it should be on the way back."""
    there, then = mover.place(np.array([t_s, t_s + 0.1]))
    return bool(then < there)


def _line_through(
    sights: tuple[Sight, ...], origin_cm: tuple[float, float], ahead: tuple[float, float]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """A point of the line and its direction, about as before; near sights count for more."""
    points = np.array([(one.x_cm, one.z_cm) for one in sights])
    weight = np.array([1.0 / max(one.away_cm, 20.0) ** 4 for one in sights])
    weight /= weight.sum()
    middle = weight @ points
    if len(points) >= 5:
        ray = weight @ np.array([one.ray for one in sights])
        ray /= max(float(np.hypot(*ray)), 1e-9)
        across = np.array([ray[1], -ray[0]])
        off = points - middle
        shrunk = np.column_stack([off @ across, off @ ray / ALONG_WORSE]) * np.sqrt(weight)[:, None]
        _, sizes, axes = np.linalg.svd(shrunk, full_matrices=False)
        main = axes[0, 0] * across + ALONG_WORSE * axes[0, 1] * ray
        main /= np.hypot(*main)
        if sizes[0] > 3 * sizes[1] and np.ptp(off @ main) > LONG_CM:
            ahead_now = main * math.copysign(1.0, float(main @ ahead))
            ahead = float(ahead_now[0]), float(ahead_now[1])
    origin = middle + float((np.array(origin_cm) - middle) @ ahead) * np.array(ahead)
    return (float(origin[0]), float(origin[1])), ahead
