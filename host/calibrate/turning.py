"""By how much pictures are stamped later than they were taken, on the wheels' clock, from turns to and fro.

Turning to the right and then back to the left, the robot comes through every heading twice. Two pictures that
look the same way were taken at the same heading; if the wheels then tell of two headings, the pictures' times
are wrong: by a delay the one is read too far ahead, the other too far behind. Beginnings and ends of turns
are left out, so that the encoders' edges alone tell, which come at the same places in both directions. Play
in the gears shows likewise but at every speed alike, so that turning slowly and fast tells it from the delay;
and rows that are exposed one after another lean things one way and then the other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from host.calibrate.ride import Drive, Ride, corners, follow, sizes_of
from host.errors import InputError
from host.nav.config import BodyConfig

RATES_RAD_S = (1.6, 0.8)
SWING_RAD = 1.4  # from end to end
MARGIN_S = 0.25  # at both ends of a turn are left out
STEADY = 0.25  # most that the turning rate may differ from the mean, relative
NEAR_RAD = 0.09  # headings by the wheels so near to each other make a pair
POINTS = 120
LEAST_POINTS, LEAST_PAIRS = 12, 12
HEAVY = 4.0
MOST_LATE_S = 0.3
OUTLIER_RAD = 0.004
WHEELS_SIGMA_S = 0.001  # of what wheels and edges do alike in every turn; the scatter does not show that


@dataclass(frozen=True)
class Delay:
    """What was found."""

    late_s: float  # stamps less the exposure of the middle row
    sigma_s: float
    readout_s: float  # from the first row's exposure to the last's
    play_rad: float  # of the gears, as a heading
    pairs: int


def motions(sweeps: int) -> list[Drive]:
    """Turns from half a swing on one side to half a swing on the other, fast ones and slow ones."""
    out = []
    for rate in RATES_RAD_S:
        for k in range(2 * sweeps):
            way = 1.0 if k % 2 == 0 else -1.0
            out.append(Drive(0.0, way * rate, 3 * SWING_RAD / rate, way * SWING_RAD / 2))
    return out


def solve(seen: Ride, body: BodyConfig) -> Delay:
    """The delay with which headings seen and headings told agree.

    Raises
    ------
    InputError
        Too little was to be seen, or the robot did not turn.
    """
    _, _, heading = seen.wheels.places(sizes_of(body))
    late_s = 0.0
    for _ in range(4):  # what counts as one heading depends on the delay a little
        pairs = _pairs(seen, heading, late_s)
        found = _fit(pairs)
        if abs(found.late_s - late_s) < 2e-4:
            break
        late_s = found.late_s
    if abs(found.late_s) > MOST_LATE_S:
        raise InputError(
            f"the pictures seem {found.late_s:.2f} s late, which no camera is: do the wheels slip?"
        )
    return found


@dataclass(frozen=True)
class _Pair:
    """Two pictures of nearly one heading, turning one way and then the other."""

    off: np.ndarray  # (N,) rad, turned by as the points show, less what the wheels tell
    row: np.ndarray  # (N,) of the points, from the picture's middle, over its height
    rate: float  # rad/s, of the second less the first
    way: float  # 1 where the second turns to the right, else -1
    when: int  # number of the turn


def _pairs(seen: Ride, heading: np.ndarray, late_s: float) -> list[_Pair]:
    times = seen.wheels.t_s

    def told(t_s: np.ndarray | float) -> Any:
        return np.interp(t_s, times, heading)

    parts = sorted({picture.part for picture in seen.pictures})
    steady: dict[int, list[tuple[int, float]]] = {}
    for part in parts:
        inside = [k for k, picture in enumerate(seen.pictures) if picture.part == part]
        rates = []
        for k in inside:
            t_s = seen.pictures[k].t_s - late_s
            rates.append(float(told(t_s + 0.1) - told(t_s - 0.1)) / 0.2)
        usual = math.copysign(float(np.percentile(np.abs(rates), 80)), rates[-1]) if rates else 0.0
        if abs(usual) < 0.2:
            continue
        ends = seen.pictures[inside[0]].t_s + MARGIN_S, seen.pictures[inside[-1]].t_s - MARGIN_S / 4
        steady[part] = [
            (k, rate)
            for k, rate in zip(inside, rates, strict=True)
            if abs(rate - usual) < STEADY * abs(usual) and ends[0] < seen.pictures[k].t_s < ends[1]
        ]
    if sum(map(len, steady.values())) < LEAST_PAIRS:
        raise InputError(
            "the robot hardly turned, or too few pictures came: is there room to turn on the spot, do the "
            "wheels turn?"
        )
    out = []
    for part, then in steady.items():
        now = steady.get(part + 1, [])
        for k, rate in then:
            one = seen.pictures[k]
            mine = float(told(one.t_s - late_s))
            others = [
                (abs(float(told(seen.pictures[n].t_s - late_s)) - mine), n, other)
                for n, other in now
                if rate * other < 0
            ]
            if not others or min(others)[0] > NEAR_RAD:
                continue
            _, n, other = min(others)
            two = seen.pictures[n]
            theirs = float(told(two.t_s - late_s))
            points = corners(one.gray, POINTS)
            guess = points - np.array([(theirs - mine) * seen.lens.fx, 0.0], np.float32)
            there, ok = follow(one.gray, two.gray, points, guess, 21)
            if ok.sum() < LEAST_POINTS:
                continue
            a, b = seen.lens.to_rays(points[ok]), seen.lens.to_rays(there[ok])
            turned = np.arctan(a[:, 0]) - np.arctan(b[:, 0])
            row = (points[ok, 1] + there[ok, 1]) / 2 / seen.lens.height - 0.5
            off = turned - (theirs - mine)
            kept = _on_one_line(row, off)
            if kept.sum() < LEAST_POINTS:
                continue
            # Read late_s earlier, the wheels told this; what is found comes on top of it.
            out.append(
                _Pair(
                    off[kept] - (other - rate) * late_s,
                    row[kept],
                    other - rate,
                    math.copysign(1, other),
                    part,
                )
            )
    if len(out) < LEAST_PAIRS:
        raise InputError(
            f"too little to be seen on the way: {len(out)} pairs of pictures, {LEAST_PAIRS} are needed; let "
            "the camera see things with edges, and give it light"
        )
    return out


def _on_one_line(row: np.ndarray, off: np.ndarray) -> np.ndarray:
    """(N,) which points agree with most others, but for what their rows are late by."""
    design = np.column_stack([np.ones(len(row)), row])
    weight, left = np.ones(len(row)), off
    for _ in range(8):
        line = np.linalg.lstsq(design * weight[:, None], off * weight, rcond=None)[0]
        left = off - design @ line
        weight = 1 / np.sqrt(1 + (left / OUTLIER_RAD) ** 2)
    return np.abs(left) < 3 * OUTLIER_RAD


def _fit(pairs: list[_Pair]) -> Delay:
    """Least squares over all pairs: off = -rate * late + rate * readout * row + play * way."""
    off = np.concatenate([pair.off for pair in pairs])
    row = np.concatenate([pair.row for pair in pairs])
    sizes = [len(pair.off) for pair in pairs]
    rate = np.repeat([pair.rate for pair in pairs], sizes)
    way = np.repeat([pair.way for pair in pairs], sizes)
    design = np.column_stack([-rate, rate * row, way])
    share = np.repeat(1 / np.array(sizes), sizes)  # each pair counts as one
    weight, values = share, np.zeros(3)
    for _ in range(12):
        values = np.linalg.solve(design.T @ (weight[:, None] * design), design.T @ (weight * off))
        left = off - design @ values
        scale = max(1.4826 * float(np.median(np.abs(left))), 1e-6)
        weight = share * (HEAVY + 1) / (HEAVY + (left / scale) ** 2)
    # What the points of one turn share is not noise of single points: how much do turns differ?
    bread = np.linalg.inv(design.T @ (weight[:, None] * design))
    when = np.repeat([pair.when for pair in pairs], sizes)
    meat = np.zeros((3, 3))
    turns = np.unique(when)
    for turn in turns:
        of = when == turn
        score = design[of].T @ (weight[of] * left[of])
        meat += np.outer(score, score)
    covariance = bread @ meat @ bread * len(turns) / max(len(turns) - 3, 1)
    late, readout, play = (float(value) for value in values)
    sigma = math.hypot(math.sqrt(covariance[0, 0]), WHEELS_SIGMA_S)
    return Delay(late, sigma, readout, play, len(pairs))
