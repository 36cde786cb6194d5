"""Travel of one wheel at any time, from encoder counts and the times of their edges.

A count says that a wheel is somewhere within one cell of 0.5 cm; the time of an edge says when it stood
exactly on a cell's border. Between edges a wheel is taken to turn evenly, so that on steady motion the
travel is known to a small part of a count; where the borders lie, if not evenly, is learnt (see marks.py).

How it begins and ends to turn is not told either, only seen: how far the wheel had come before the first
edge, and how far it went on after the last one, follows from what its motor was driven with and from the
other edges' times (see motor.py). Where the duty is not known, the periods of the first cells have to say
it, and the speed at the last edge.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from host.nav import motor
from host.nav.marks import Marks

AHEAD_S = 0.1  # travel may be asked for this long after the newest reading
SAME_EDGE_S = 0.001  # an edge's time may shift by less than this as the clocks are compared anew
REST_S = 0.25  # a wheel without an edge for this long, and four times its last period, stands
REST_SIGMA_COUNTS = 1 / math.sqrt(12)  # a wheel of which nothing is known is anywhere within its cell
CREEP_S = 1.0  # a wheel whose next edge comes within this had not stopped for good
EVEN_SIGMA_COUNTS = 0.02  # between two edges of a wheel that turns evenly
BENT_SIGMA_COUNTS = 0.15  # and for each unit by which neighbouring periods differ, relatively
AHEAD_SIGMA_COUNTS = 0.1  # one cell after the last edge, beside what the last periods differ by
AHEAD_BENT = 2.0  # what those count there, over what they count between two edges
STOPS = 0.8  # of the speed over one cell is left over the next: a wheel is about to stop
STOPPED_SIGMA_COUNTS = 0.2  # of where it stands then

# What a start may be like: the firmware raises the speed by its ramp, which the motors follow with a lag.
RAMP_CM_S2, LAG_S = 100.0, 0.05
LEADS = (np.arange(24) + 0.5) / 24  # cells to the first edge
FINAL_SPEEDS_CM_S = np.geomspace(3.0, 40.0, 20)
LONGEST_START_S = 1.5
BRAKE_CM_S2 = 115.0  # at the end of a stop, as if even from the last edge on
CLEAR_CHANGE = 0.15  # relative, of the speed over a cell; uneven edges alone may seem to change it by less
PERIOD_SIGMA = 0.07  # relative: uneven edges, and motors that lag more or less


@cache
def _starts(cell_cm: float) -> np.ndarray:
    """(final speeds, leads, 2) periods in s of the two cells after the first edge of a start."""
    t = np.linspace(0.0, LONGEST_START_S, 600)
    edges = cell_cm * (LEADS[:, None] + np.arange(3))
    out = []
    for final in FINAL_SPEEDS_CM_S:
        up_s = final / RAMP_CM_S2
        rising, level = np.minimum(t, up_s), np.maximum(t - up_s, 0.0)
        behind = RAMP_CM_S2 * LAG_S * (1 - np.exp(-rising / LAG_S))  # what the lag takes off the speed
        way = RAMP_CM_S2 * rising * (rising / 2 - LAG_S) + LAG_S * behind
        way += final * level - LAG_S * behind * (1 - np.exp(-level / LAG_S))
        out.append(np.interp(edges, way, t, right=math.inf))
    with np.errstate(invalid="ignore"):  # slower starts than are looked at
        periods = np.diff(np.array(out), axis=2)
    periods[~np.isfinite(periods)] = LONGEST_START_S
    return periods


def lead_in(periods_s: list[float], cell_cm: float) -> tuple[float, float]:
    """(way from rest to the first edge, its standard error), cm, from the periods of the two cells after it.

    The mean over all starts, each as likely as it explains the periods.
    """
    cost = ((np.log(_starts(cell_cm) / np.array(periods_s[:2])) / PERIOD_SIGMA) ** 2).sum(axis=2)
    weight = np.exp(-0.5 * (cost - cost.min())).sum(axis=0)
    weight /= weight.sum()
    mean = float(weight @ LEADS)
    variance = float(weight @ (LEADS - mean) ** 2)
    return cell_cm * mean, cell_cm * math.sqrt(variance + 0.05**2)


class Start(NamedTuple):
    """Where in its cell a wheel began."""

    back_cm: float  # so much further back than was taken so far, with its sign
    sigma_cm: float
    by_motor: bool  # known from what its motor was driven with


class Wheel:
    """Travel of one wheel as a piecewise linear function of time through its encoder edges."""

    def __init__(self, cm_per_count: float, t_s: float, count: int):
        self._cell = cm_per_count
        self._zero = count + 0.5  # at the start the wheel is taken to stand in the middle of its cell
        self._count = count
        self._border = count  # of the last edge
        self._marks = Marks()
        self._edge_s: float | None = None
        self._sign = 1
        self._t = [t_s]  # knots: time, travel
        self._s = [0.0]
        self._resting = True  # the last knot says where the wheel stands, and moves on in time
        self._heard_s = t_s  # up to here it is known that no further edge has come
        self._pause_s = math.inf  # between the last two edges
        self._run = 0  # edges since it last stood or turned round
        self._duties = motor.Duties()
        self._ahead: motor.Ahead | None = None  # by its motor, on from the last edge
        self._ahead_as_of = (-math.inf, -math.inf)  # that edge, and the last reading by then
        self._rest_sigma_cm = cm_per_count * REST_SIGMA_COUNTS
        self.edges = 0

    @property
    def settled_s(self) -> float:
        """Up to here no later reading changes the travel."""
        return self._t[-1]

    def add(
        self, t_s: float, count: int, edge_s: float | None, direction: int = 0, duty: float | None = None
    ) -> None:
        """One reading; an edge without a count is the one known already, or there and back again.

        ``duty`` is what the motor was driven with then, -1 to 1.
        """
        heard_s, self._heard_s = self._heard_s, t_s
        if duty is not None:
            self._duties.add(t_s, duty)
        # What lies before the last reading was in it: a wheel that stands keeps its last edge, whose time
        # shifts the further the longer ago it was, also from before there was the first reading.
        known = edge_s is None or edge_s <= heard_s
        known |= edge_s is not None and self._edge_s is not None and abs(edge_s - self._edge_s) < SAME_EDGE_S
        if edge_s is not None and (count != self._count or not known):
            self._add_edge(edge_s, count, direction)
        elif self._resting:
            self._t[-1] = max(self._t[-1], t_s)
        elif t_s - self._t[-1] > self._patience_s():
            by_motor = self._by_motor()
            if by_motor is not None:
                way, sigma = by_motor.at(math.inf)
                self._rest_sigma_cm = min(sigma, self._cell * STOPPED_SIGMA_COUNTS)
            else:
                way, self._rest_sigma_cm = self._roll_out(), self._cell * STOPPED_SIGMA_COUNTS
            stands = self._s[-1] + self._sign * way
            for when in (self._t[-1] + REST_S / 2, t_s):
                self._t.append(when)
                self._s.append(stands)
            self._resting = True

    def _patience_s(self) -> float:
        """Without an edge for this long it stands."""
        speed = self._speed() or self._speed_at_edge()
        return max(REST_S, 4 * self._cell / speed) if speed else REST_S

    def _roll_out(self) -> float:
        """How far it goes on after the last edge when no other follows, cm."""
        way = self._speed_at_edge() ** 2 / (2 * BRAKE_CM_S2)
        if not self._slows():  # then it began to brake later, anywhere in the cell
            way = max(way, self._cell / 2)
        return min(way, 0.95 * self._cell)

    def _by_motor(self) -> motor.Ahead | None:
        """How it goes on after the last edge while its motor slows down; None where no duty tells."""
        if self._resting or self._run < 3 or not self._duties.slowing:
            return None
        if self._ahead_as_of != (as_of := (self._t[-1], self._heard_s)):
            self._ahead_as_of = as_of
            edges = slice(max(0, len(self._t) - self._run), None)
            times, places = np.array(self._t[edges]), np.array(self._s[edges])
            self._ahead = motor.ahead(self._duties, times, places, self._cell, self._sign, self._heard_s)
        return self._ahead

    def _slows(self) -> bool:
        """The last cell took it clearly longer than the one before."""
        if self._run < 3:
            return False
        (a, b, c), (p, q, r) = self._t[-3:], self._s[-3:]
        return abs((r - q) / (c - b)) < (1 - CLEAR_CHANGE) * abs((q - p) / (b - a))

    def _stopping(self) -> bool:
        """It slows down so fast that it seems about to stand."""
        if self._run < 4 or len(self._t) < 4:  # at a creep the older ones are forgotten
            return False
        (a, b, c, d), (p, q, r, s) = self._t[-4:], self._s[-4:]
        first, before, last = abs((q - p) / (b - a)), abs((r - q) / (c - b)), abs((s - r) / (d - c))
        return last < STOPS * before or (last < 0.9 * before and before < 0.95 * first and last < 0.8 * first)

    def _speed_at_edge(self) -> float:
        """Speed at the last edge, cm/s, without sign: that of the last cell, or as it clearly changed."""
        last = self._speed()
        if self._run < 2:
            begun = math.sqrt(RAMP_CM_S2 * self._cell)  # from the middle of its cell
            return min(begun, self._cell / self._pause_s) if self._pause_s < CREEP_S else begun
        if self._run < 3 or last == 0.0:
            return last
        (a, b, c), (p, q, _) = self._t[-3:], self._s[-3:]
        before = abs((q - p) / (b - a))
        if abs(last - before) < CLEAR_CHANGE * max(last, before):
            return last
        return min(max(last + (last - before) * (c - b) / (c - a), last / 4), 1.5 * last)

    def _add_edge(self, edge_s: float, count: int, direction: int) -> None:
        if direction == 0 and count == self._count:  # there and back, whichever came last
            border = round(self._s[-1] / self._cell + self._zero)
            direction = 1 if border == count else -1
        direction = direction or (1 if count > self._count else -1)
        border = count if direction > 0 else count + 1
        self._marks.hear(edge_s, border)
        travel = (self._marks.place(border) - self._zero) * self._cell
        self._run = 1 if self._resting or direction != self._sign else self._run + 1
        self._border, self._sign = border, direction
        self._pause_s = math.inf if self._edge_s is None else max(edge_s - self._edge_s, SAME_EDGE_S)
        self._count, self._edge_s = count, edge_s
        self._resting = False
        self.edges += 1
        while len(self._t) > 1 and self._t[-1] >= edge_s:  # a rest that the late edge contradicts
            self._t.pop()
            self._s.pop()
        if edge_s > self._t[-1]:
            self._t.append(edge_s)
            self._s.append(travel)
        else:
            self._s[-1] = travel
        self._run = min(self._run, len(self._t))  # of which the knots are there

    def _speed(self) -> float:
        """Speed over the last full cell, cm/s, without sign."""
        if self._run < 2 or self._s[-1] == self._s[-2]:
            return 0.0
        return abs(self._s[-1] - self._s[-2]) / (self._t[-1] - self._t[-2])

    def _to_next(self) -> float:
        """Counts from the last edge to the next one in the same direction; about 1."""
        return abs(self._marks.place(self._border + self._sign) - self._marks.place(self._border))

    def velocity(self) -> float:
        """Over the last full cell, cm/s."""
        return self._sign * self._speed()

    def restart(self) -> None:
        """The counts go on, but what was learnt of the single edges is no longer true."""
        self._marks.forget()

    def lead_in(self) -> Start:
        """How it started, from the first three edges, while they are remembered and of one direction."""
        t, s = self._t[1:4], self._s[1:4]  # after the rest
        steps = [(b - a) * self._sign for a, b in pairwise(s)]
        if len(steps) < 2 or not all(0.5 < step / self._cell < 1.5 for step in steps):
            return Start(0.0, self._cell * REST_SIGMA_COUNTS, by_motor=False)
        known = motor.lead_in(self._duties, np.array(t), np.array(s), self._cell, self._sign)
        way, sigma = known or lead_in([b - a for a, b in pairwise(t)], self._cell)
        return Start(self._sign * (way - abs(s[0] - self._s[0])), sigma, by_motor=known is not None)

    def shift(self, cm: float) -> None:
        """Correct where in its cell the wheel stood at the start."""
        self._zero -= cm / self._cell
        self._s[1:] = [s + cm for s in self._s[1:]]

    def travel(self, t_s: float) -> float:
        """Travel at a time, cm; beyond the last edge it goes on, short of an edge that did not come."""
        if t_s >= self._t[-1]:
            if self._resting or t_s == self._t[-1]:
                return self._s[-1]
            cell = self._cell * self._to_next()
            known = self._by_motor()
            if known is not None:
                way, _ = known.at(min(t_s, self._heard_s + AHEAD_S))
                return self._s[-1] + self._sign * min(way, cell)
            speed = self._speed_at_edge() / cell  # cells a second
            if self._stopping():
                since_s = min(t_s, self._heard_s + AHEAD_S) - self._t[-1]
                stands = self._roll_out()
                rolled = stands * (1 - math.exp(-since_s * self._speed_at_edge() / max(stands, 1e-9)))
                return self._s[-1] + self._sign * rolled
            u = speed * (min(t_s, self._heard_s) - self._t[-1])
            if u > 1:
                stands = self._roll_out() / self._cell
                speed, u = 0.0, stands + (1 - stands) / u
            u += speed * min(max(0.0, t_s - self._heard_s), AHEAD_S)
            return self._s[-1] + self._sign * cell * u
        k = bisect_right(self._t, t_s)
        if k == 0:
            return self._s[0]
        part = (t_s - self._t[k - 1]) / (self._t[k] - self._t[k - 1])
        return self._s[k - 1] + part * (self._s[k] - self._s[k - 1])

    def sigma(self, t_s: float) -> float:
        """Standard error of the travel within its cell, cm, beside that of where the wheel began."""
        k = bisect_right(self._t, t_s)
        rest = self._rest_sigma_cm
        if k < len(self._t):
            if k < 2 or self._s[k] == self._s[k - 1]:
                return rest
            return self._cell * min(
                REST_SIGMA_COUNTS, EVEN_SIGMA_COUNTS + BENT_SIGMA_COUNTS * self._change(k)
            )
        if self._resting:
            return rest
        u = (t_s - self._t[-1]) * self._speed() / self._cell
        if self._run < 2 or u > 1.5:
            return self._cell * REST_SIGMA_COUNTS
        bent = BENT_SIGMA_COUNTS * self._change(len(self._t) - 1)
        ahead = EVEN_SIGMA_COUNTS + bent + u * u * (AHEAD_SIGMA_COUNTS + AHEAD_BENT * bent)
        sigma = self._cell * min(REST_SIGMA_COUNTS, ahead)
        known = self._by_motor()
        return sigma if known is None else min(sigma, known.at(t_s)[1] + self._cell * EVEN_SIGMA_COUNTS)

    def _change(self, k: int) -> float:
        """By how much the speed before knot ``k`` differs from that before and after, relatively."""
        t, s = self._t, self._s
        speeds = [abs(s[j] - s[j - 1]) / (t[j] - t[j - 1]) for j in range(max(1, k - 1), min(len(t), k + 2))]
        return (max(speeds) - min(speeds)) / max(*speeds, 1e-9) if len(speeds) > 1 else 1.0

    def knots(self, t0: float, t1: float) -> list[float]:
        """Times after ``t0``, up to ``t1``, at which the speed changes."""
        return self._t[bisect_right(self._t, t0) : bisect_right(self._t, t1)]

    def forget(self, t_s: float) -> None:
        """Nobody will ask for times before this one."""
        keep = max(0, bisect_right(self._t, t_s) - 3)
        del self._t[:keep], self._s[:keep]
        self._duties.forget(t_s)
