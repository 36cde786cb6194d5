"""How far a wheel comes where no edge tells it: before the first edge of a start, after the last of a stop.

The speed of a geared motor tends to what its duty, less the friction's, would give it, and follows with a
lag. What its friction and its lag are is not known, only what they may be; so each pair of them is tried,
with the gain that fits the edges' times best, and counts as likely as it then explains them.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from typing import NamedTuple

import numpy as np

FRICTIONS = np.linspace(0.03, 0.17, 8)  # duty below which a geared motor stands
LAGS_S = np.array([0.03, 0.04, 0.05, 0.06, 0.075, 0.09])
# Speed at full duty without friction, by the firmware's defaults; what its logarithm may be off by.
GAIN_CM_S, GAIN_SIGMA = 76.0, 0.3
EDGE_SIGMA_COUNTS = 0.04  # by which an edge may be off its place
FIRST_SPEED_SIGMA = 0.3  # relative: of the first cell's mean speed, as that at its first edge
BEYOND_SIGMA_COUNTS = 0.06  # past an edge that did not come nothing is likely
LONGEST_GAP_S = 0.035  # between two readings; after a longer one the duty in between is not known
LATE_S = 0.0025  # a duty is put out at a tick and held for 5 ms: as if it changed evenly, so much later
STEP_S = 0.0025  # in which a motor's push is followed that begins to overcome friction
AHEAD_STEP_S = 0.01  # in which it is told how a wheel goes on
BACK_S, EDGES_BACK = 0.6, 9  # of a stop's past are looked at
ROLLS_S = 0.35  # longest that a wheel without a duty rolls on
MOMENT_S, LESS = 0.15, 0.85  # driven less than this part of the most in that time, a motor slows down
LONGEST_START_S = 1.2  # from the first duty to the last edge that is looked at


class Duties:
    """What one motor was driven with, -1 to 1, at the times of the readings; they come in order."""

    def __init__(self) -> None:
        self._t: list[float] = []
        self._duty: list[float] = []

    def add(self, t_s: float, duty: float) -> None:
        """One reading."""
        if self._t and t_s - self._t[-1] > LONGEST_GAP_S:
            self._t.clear()
            self._duty.clear()
        self._t.append(t_s)
        self._duty.append(duty)

    @property
    def slowing(self) -> bool:
        """The motor is driven clearly less than a moment ago, or not at all."""
        if not self._t:
            return False
        before = bisect_left(self._t, self._t[-1] - MOMENT_S)
        return abs(self._duty[-1]) < LESS * max(map(abs, self._duty[before:])) or self._duty[-1] == 0.0

    @property
    def oldest_s(self) -> float:
        """From here on they are known; inf where none is."""
        return self._t[0] if self._t else math.inf

    def forget(self, t_s: float) -> None:
        """Nobody will ask for times before this one."""
        keep = max(0, bisect_right(self._t, t_s) - 1)
        del self._t[:keep], self._duty[:keep]

    def from_rest(self, edge_s: float, sign: int) -> tuple[np.ndarray, np.ndarray] | None:
        """(times, duties) from the last reading without a duty before an edge; None if there was none."""
        k = bisect_left(self._t, edge_s) - 1
        while k >= 0 and self._duty[k] != 0.0:
            k -= 1
        return self._between(k, len(self._t), sign) if k >= 0 else None

    def since(self, begin_s: float, sign: int) -> tuple[np.ndarray, np.ndarray]:
        """(times, duties) from before a time on, or from the oldest known; after them the last holds."""
        k, end = max(0, bisect_right(self._t, begin_s) - 1), len(self._t)
        while end > k + 2 and self._duty[end - 2] == self._duty[end - 1]:
            end -= 1
        return self._between(k, end, sign)

    def _between(self, k: int, end: int, sign: int) -> tuple[np.ndarray, np.ndarray]:
        return np.array(self._t[k:end]) + LATE_S, sign * np.array(self._duty[k:end])


def lead_in(
    duties: Duties, edges_s: np.ndarray, places_cm: np.ndarray, cell_cm: float, sign: int
) -> tuple[float, float] | None:
    """How far a wheel had come from rest at the first of some edges.

    Parameters
    ----------
    edges_s, places_cm
        (N,) times and places of the first edges of a start, 2 or more.
    sign
        1 forward, -1 backward.

    Returns
    -------
    (way, its standard error), cm, or None where the duties are not known.
    """
    known = duties.from_rest(float(edges_s[0]), sign)
    if known is None or edges_s[-1] - known[0][0] > LONGEST_START_S:
        return None
    t_s = np.arange(known[0][0], edges_s[-1] + STEP_S, STEP_S)
    push = np.maximum(np.interp(t_s, *known) - FRICTIONS[:, None], 0.0)  # until then it stands
    gone, _ = _driven(t_s, push, edges_s)
    way, since = np.abs(places_cm - places_cm[0])[1:, None, None], gone[1:] - gone[0]
    gain = (way * since).sum(0) / np.maximum((since * since).sum(0), 1e-12)
    first = gain * gone[0]
    cost = (((gain * since - way) / (EDGE_SIGMA_COUNTS * cell_cm)) ** 2).sum(0) + _oddity(gain)
    weight = _likely(cost, first, cell_cm)
    mean = float((weight * first).sum())
    return min(mean, cell_cm), math.sqrt(float((weight * (first - mean) ** 2).sum()))


class Ahead(NamedTuple):
    """How far a wheel goes on after its last edge, if its motor's duty stays as it is."""

    t_s: np.ndarray  # (T,) from the edge on
    way_cm: np.ndarray  # (T,)
    sigma_cm: np.ndarray  # (T,)

    def at(self, t_s: float) -> tuple[float, float]:
        """(way, its standard error), cm, at a time; after the last as then."""
        place = min((t_s - self.t_s[0]) / AHEAD_STEP_S, len(self.t_s) - 1.001)
        k = max(0, int(place))
        part = max(0.0, place - k)
        way, sigma = self.way_cm, self.sigma_cm
        return (
            float(way[k] + part * (way[k + 1] - way[k])),
            float(sigma[k] + part * (sigma[k + 1] - sigma[k])),
        )


def ahead(
    duties: Duties, edges_s: np.ndarray, places_cm: np.ndarray, cell_cm: float, sign: int, heard_s: float
) -> Ahead | None:
    """How far a wheel goes on after the last of some edges.

    Parameters
    ----------
    edges_s, places_cm
        (N,) times and places of its last edges in one direction.
    heard_s
        No further edge has come up to then.

    Returns
    -------
    None where fewer than three edges came while the duties are known, or not one after the other.
    """
    begin_s = max(float(edges_s[-1]) - BACK_S, duties.oldest_s)
    recent = slice(max(len(edges_s) - EDGES_BACK, bisect_left(edges_s, begin_s)), None)
    edges_s, places_cm = edges_s[recent], places_cm[recent]
    if len(edges_s) < 3 or not (np.diff(places_cm) * sign > 0.0).all():
        return None
    known = duties.since(float(edges_s[0]), sign)
    t_s = np.concatenate([edges_s[:1], known[0][known[0] > edges_s[0]]])
    push = np.interp(t_s, *known) - FRICTIONS[:, None]
    on_s = edges_s[-1] + np.arange(0.0, ROLLS_S, AHEAD_STEP_S)
    by_push, by_speed = _driven(t_s, push, np.concatenate([edges_s[1:], on_s]))
    earlier = len(edges_s) - 1
    a, b = by_push[:earlier], by_speed[:earlier]
    way = np.abs(places_cm - places_cm[0])[1:, None, None]
    # the gain and the speed at the first edge that fit best, the latter not far from the first cell's
    sigma = EDGE_SIGMA_COUNTS * cell_cm
    usual = way[0] / (edges_s[1] - edges_s[0])
    pull = (sigma / (FIRST_SPEED_SIGMA * usual)) ** 2
    aa, ab, bb = (a * a).sum(0), (a * b).sum(0), (b * b).sum(0) + pull
    aw, bw = (a * way).sum(0), (b * way).sum(0) + pull * usual
    det = np.maximum(aa * bb - ab * ab, 1e-15)
    gain, speed = (bb * aw - ab * bw) / det, (aa * bw - ab * aw) / det
    off = (gain * a + speed * b - way) / sigma
    cost = (off * off).sum(0) + ((speed - usual) / (FIRST_SPEED_SIGMA * usual)) ** 2 + _oddity(gain)
    on = gain * by_push[earlier:] + speed * by_speed[earlier:] - way[-1]
    on = np.maximum.accumulate(on, axis=0)  # friction stops a wheel, it does not turn it back
    now = on[min(int((heard_s - edges_s[-1]) / AHEAD_STEP_S), len(on) - 1)]
    weight = _likely(cost, now, cell_cm)
    mean = (weight * on).sum(axis=(1, 2))
    variance = (weight * (on - mean[:, None, None]) ** 2).sum(axis=(1, 2))
    return Ahead(on_s, np.clip(mean, 0.0, cell_cm), np.sqrt(variance))


def _oddity(gain: np.ndarray) -> np.ndarray:
    """What gains cost that no such motor has."""
    return (np.log(np.maximum(gain, 1e-3) / GAIN_CM_S) / GAIN_SIGMA) ** 2


def _driven(t_s: np.ndarray, push: np.ndarray, at_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Way of motors at some times, of each friction and lag.

    Parameters
    ----------
    t_s, push : (K,) times and (F, K) speeds that the motor tends to, even in between, then constant.
    at_s : (M,)

    Returns
    -------
    (M, F, L) from rest at the first time, and (M, 1, L) of a speed of 1 then that nothing pushes.
    """
    since = np.maximum(at_s[:, None, None] - t_s[:, None], 0.0)  # (M, K, 1)
    fading = LAGS_S * (1.0 - np.exp(-since / LAGS_S))  # (M, K, L)
    by_step = since[:, :1] - fading[:, :1]
    by_slope = since * since / 2 - LAGS_S * (since - fading)
    slopes = np.diff(push, axis=1) / np.diff(t_s)
    change = np.diff(slopes, axis=1, prepend=0.0, append=0.0)
    return push[:, 0, None] * by_step + np.einsum("fk,mkl->mfl", change, by_slope), fading[:, :1]


def _likely(cost: np.ndarray, way: np.ndarray, cell_cm: float) -> np.ndarray:
    """Weights with a sum of 1 of ways that end within a cell, each as likely as it costs little."""
    beyond = np.maximum(way - cell_cm, 0.0) + np.maximum(-way, 0.0)
    cost = cost + (beyond / (BEYOND_SIGMA_COUNTS * cell_cm)) ** 2
    weight = np.exp(-0.5 * (cost - cost.min()))
    return weight / weight.sum()
