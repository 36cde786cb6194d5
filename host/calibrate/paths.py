"""Ways as encoders told them, reckoned with any sizes of wheels and track; and the sizes that fit a tape."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from host.calibrate.umbmark import Sizes
from host.link.protocol import NO_EDGE_US, Telemetry


class WheelTrace:
    """One wheel's turning in counts: straight lines through its edges, and rest in the middle of a cell."""

    def __init__(self, t_s: float, count: int) -> None:
        self.t_s, self.counts = [t_s], [count + 0.5]
        self._count = count

    def add(self, t_s: float, count: int, edge_s: float | None) -> None:
        """What a report says; `edge_s` is when the last edge came."""
        if count == self._count or edge_s is None:
            return
        border = count if count > self._count else count + 1
        self._count = count
        if edge_s > self.t_s[-1]:
            self.t_s.append(edge_s)
            self.counts.append(float(border))
        else:
            self.counts[-1] = float(border)

    def rest(self, t_s: float) -> None:
        """It stands: anywhere in its cell, so in the middle."""
        if t_s > self.t_s[-1]:
            self.t_s.append(t_s)
            self.counts.append(self._count + 0.5)


@dataclass(frozen=True)
class Path:
    """Counts of both wheels at the same times."""

    t_s: np.ndarray
    left: np.ndarray
    right: np.ndarray

    def end(self, sizes: Sizes) -> tuple[float, float, float]:
        """Ahead and to the right of the start in mm, and the heading in rad to the right."""
        ahead, right, heading = self.places(sizes)
        return float(ahead[-1]), float(right[-1]), float(heading[-1])

    def places(self, sizes: Sizes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The whole way: every piece of it is an arc."""
        d_left, d_right = np.diff(self.left) * sizes.um_left, np.diff(self.right) * sizes.um_right
        turn = (d_left - d_right) / sizes.track_um
        heading = np.concatenate([[0.0], np.cumsum(turn)])
        chord = (d_left + d_right) / 2 * np.sinc(turn / 2 / math.pi) * 1e-3
        middle = heading[:-1] + turn / 2
        ahead = np.concatenate([[0.0], np.cumsum(chord * np.cos(middle))])
        right = np.concatenate([[0.0], np.cumsum(chord * np.sin(middle))])
        return ahead, right, heading


class PathRecorder:
    """Reports of a robot that starts and ends standing; `path` is the way between."""

    def __init__(self) -> None:
        self.reports: list[Telemetry] = []

    def add(self, reports: Sequence[Telemetry]) -> None:
        """Take note of some more."""
        self.reports.extend(reports)

    def path(self) -> Path:
        """The way of the axle's middle.

        Raises
        ------
        ValueError
            Nothing was reported.
        """
        if not self.reports:
            raise ValueError("no reports, no path")
        mcu = np.unwrap([float(r.mcu_time_us) for r in self.reports], period=2.0**32) * 1e-6
        traces = [
            WheelTrace(mcu[0], self.reports[0].count_left),
            WheelTrace(mcu[0], self.reports[0].count_right),
        ]
        for t_s, report in zip(mcu, self.reports, strict=True):
            for trace, count, age in zip(
                traces,
                (report.count_left, report.count_right),
                (report.edge_age_left_us, report.edge_age_right_us),
                strict=True,
            ):
                trace.add(t_s, count, None if age == NO_EDGE_US else t_s - 1e-6 * age)
        for trace in traces:
            trace.rest(mcu[-1])
        times = np.unique(np.concatenate([trace.t_s for trace in traces]))
        left, right = (np.interp(times, trace.t_s, trace.counts) for trace in traces)
        return Path(times, left, right)


@dataclass(frozen=True)
class Taped:
    """A path, and where a tape says that it ended."""

    path: Path
    ahead_mm: float
    right_mm: float


TAPE_MM = 2.0  # standard error of one reading, as a person takes it
AIM_RAD = 0.01  # standard error of how straight the robot was put on its mark


def fit(taped: Sequence[Taped], start: Sizes, rounds: int = 30) -> tuple[Sizes, Sizes]:
    """The sizes with which all paths end where the tape says, by least squares, and their standard errors.

    Unlike UMBmark's equations it holds for large errors as well, and it knows how each path truly went, so
    that neither sloppy turns nor a square that does not close matter. It needs a straight path for the scale
    and turns for the track.

    Raises
    ------
    ValueError
        The paths do not determine the sizes.
    """
    sigmas = []
    for one in taped:
        # A robot aimed wrongly swings its end round the start: an error across the line to it.
        far = math.hypot(one.ahead_mm, one.right_mm)
        unit = (one.ahead_mm / far, one.right_mm / far) if far else (1.0, 0.0)
        sigmas.append((unit, TAPE_MM, math.hypot(TAPE_MM, AIM_RAD * far)))

    def misses(values: np.ndarray) -> np.ndarray:
        sizes = Sizes(*(np.exp(values) * (start.um_left, start.um_right, start.track_um)))
        out = []
        for one, ((along, across), near, wide) in zip(taped, sigmas, strict=True):
            ahead, right, _ = one.path.end(sizes)
            x, y = ahead - one.ahead_mm, right - one.right_mm
            out += [(x * along + y * across) / near, (y * along - x * across) / wide]
        return np.array(out)

    values, covariance = _least_squares(misses, np.zeros(3), rounds)
    found = np.exp(values) * (start.um_left, start.um_right, start.track_um)
    return Sizes(*map(float, found)), Sizes(*(float(s) for s in found * np.sqrt(np.diag(covariance))))


def _least_squares(
    misses: Callable[[np.ndarray], np.ndarray], values: np.ndarray, rounds: int
) -> tuple[np.ndarray, np.ndarray]:
    """Levenberg and Marquardt's way downhill."""
    damping, step = 1e-3, 1e-6
    left = misses(values)
    for _ in range(rounds):
        slopes = np.stack([(misses(values + d) - left) / step for d in step * np.eye(len(values))], axis=1)
        square = slopes.T @ slopes
        while True:
            try:
                move = -np.linalg.solve(square + damping * np.diag(np.diag(square)), slopes.T @ left)
            except np.linalg.LinAlgError:
                raise ValueError("these paths do not determine the sizes") from None
            trial = misses(values + move)
            if trial @ trial <= left @ left or damping > 1e9:
                break
            damping *= 10
        values, left, damping = values + move, trial, damping / 10
        if np.abs(move).max() < 1e-9:
            break
    if np.linalg.cond(square) > 1e12:
        raise ValueError("these paths do not determine the sizes")
    return values, np.linalg.inv(square)
