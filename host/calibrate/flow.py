"""A camera's height and tilt from how the floor flows by on a straight drive.

Seen from above, the floor is the same from picture to picture, but only if height and tilt are taken as they
are: the way between two pictures is known from the wheels. They are sought for which it is most alike.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from host.calibrate.ride import Ride, sizes_of
from host.camera.lens import Lens
from host.errors import InputError
from host.nav.config import BodyConfig

STEP_CM = 1.0  # of way between two pictures that are used
APART = 14  # of these pictures lie between two that are compared
MOST_PAIRS = 14
END_CM = 1.5  # of the way at both ends
FROM_CM, FARTHEST_CM, WIDE_CM, CM_PER_PX = 20.0, 75.0, 20.0, 0.5  # of the floor seen from above
BLUR_PX = 0.8
LIGHT_CM = 3.0  # what is wider on the floor is light and shade
STRONG = 6.0  # grey levels; stronger contrasts count no more than in proportion to their root
RIM_PX = 3.0
LEAST_SAMPLES = 100
HEIGHT_SHARES = (0.8, 0.9, 1.0, 1.1, 1.2)  # of the height that is set, to begin with
PITCHES_RAD = tuple(np.radians(np.arange(-5.0, 5.1, 1.0)).tolist())
FIRST_STEPS = np.array([1.0, 0.015, 0.015, 0.01])  # cm, and rad
RIDGES_RAD_PER_CM = (0.008, 0.016, 0.03)
LAST_STEP_RAD = 5e-4
LEAST_LIKENESS = 0.5
PARTS = 3  # of the way
HARDLY = 0.05  # of what lacks to the same
MODEL_SIGMA, MODEL_SIGMA_RAD = 0.02, 0.003  # relative, of the height, and of angles, that no part shows
LEVEL_RAD = math.radians(0.5)  # nearer to level than this need not be better
SURE = 2.0  # sigmas of an angle; one that is less may as well be none


@dataclass(frozen=True)
class Mount:
    """Where the camera is and looks; angles in rad."""

    height_cm: float
    pitch: float  # down
    roll: float  # its right side down
    yaw: float  # to the right of where the robot drives to
    sigmas: tuple[float, float, float, float]  # of the same
    likeness: float  # correlation of the floor's pattern from picture to picture

    @property
    def level(self) -> bool:
        """Is it level enough for a program that takes it to be?"""
        _, pitch_sigma, roll_sigma, _ = self.sigmas
        angles = (self.pitch, pitch_sigma), (self.roll, roll_sigma)
        return all(abs(angle) < max(LEVEL_RAD, SURE * sigma) for angle, sigma in angles)


@dataclass(frozen=True)
class Shots:
    """Pictures of the drive and where the camera was, by the wheels."""

    lens: Lens
    grays: list[np.ndarray]
    places: np.ndarray  # (N, 3): right, ahead in cm, heading in rad


def shots(seen: Ride, body: BodyConfig) -> Shots:
    """Pictures a little apart, taken while the wheels turned evenly.

    Raises
    ------
    InputError
        The robot did not get far.
    """
    ahead, right, heading = seen.wheels.places(sizes_of(body))
    t_s = np.array([picture.t_s for picture in seen.pictures])
    a, r, h = (np.interp(t_s, seen.wheels.t_s, one) for one in (ahead / 10, right / 10, heading))
    places = np.column_stack([
        r + body.camera_ahead_cm * np.sin(h), a + body.camera_ahead_cm * (np.cos(h) - 1.0), h
    ])  # fmt: skip
    far = float(places[:, 1].max(initial=0.0))
    chosen, last = [], -math.inf
    for k, (_, z, _) in enumerate(places):
        # Before the first edges and after the last nobody knows where in their cells the wheels stand.
        if z - last >= STEP_CM and END_CM < z < far - END_CM:
            chosen.append(k)
            last = z
    if len(chosen) < APART + 2 * PARTS:
        raise InputError(
            f"the robot came {far:.0f} cm ahead only: do its wheels turn, is its way free, do pictures come?"
        )
    return Shots(seen.lens, [seen.pictures[k].gray for k in chosen], places[chosen])


def _pixels_of(seen: Shots, floor: np.ndarray, at: int, n: int, turn: np.ndarray) -> np.ndarray:
    """(N, 2) where places of the floor, as seen level from one picture, are in another."""
    (x0, z0, h0), (x1, z1, h1) = seen.places[at], seen.places[n]
    c, s = math.cos(h0), math.sin(h0)
    x, z = x0 + c * floor[:, 0] + s * floor[:, 2] - x1, z0 - s * floor[:, 0] + c * floor[:, 2] - z1
    c, s = math.cos(h1), math.sin(h1)
    level = np.column_stack([c * x - s * z, floor[:, 1], s * x + c * z])
    ray = level @ turn
    ray = ray[:, :2] / np.maximum(ray[:, 2:], 1.0)
    return seen.lens.to_pixels(ray)


def solve(seen: Shots, height_cm: float) -> Mount:
    """Height and tilt with which the floor, seen from above, stays what it is.

    Raises
    ------
    InputError
        No floor is to be seen.
    """
    floor = _Floor(seen)
    some = floor.pairs[:: max(len(floor.pairs) // 5, 1)]
    starts = [
        np.array([height_cm * share, pitch, 0.0, 0.0]) for share in HEIGHT_SHARES for pitch in PITCHES_RAD
    ]
    start = max(starts, key=lambda values: floor.likeness(values, some))
    found = _climb(floor, start, floor.pairs, FIRST_STEPS)
    likeness = floor.likeness(found, floor.pairs)
    if likeness < LEAST_LIKENESS:
        raise InputError(
            f"the floor is not the same from picture to picture (correlation {likeness:.2f}, "
            f"{LEAST_LIKENESS:g} is needed): drive over a flat, free floor with some pattern, in good light"
        )
    # Parts of the way, each over floor of its own: how much do they differ?
    parts = np.array_split(np.arange(len(floor.pairs)), PARTS)
    alone = np.array([
        _climb(floor, found, [floor.pairs[k] for k in part], FIRST_STEPS / 4) for part in parts if len(part)
    ])  # fmt: skip
    sigmas = np.sqrt(((alone - found) ** 2).sum(0) / max(len(alone) - 1, 1) / len(alone))
    sigmas = np.hypot(sigmas, _doubt(floor, found, likeness))
    sigmas = np.hypot(sigmas, [MODEL_SIGMA * found[0], *[MODEL_SIGMA_RAD] * 3])
    height, pitch, roll, yaw = map(float, found)
    spread = (float(sigmas[0]), float(sigmas[1]), float(sigmas[2]), float(sigmas[3]))
    return Mount(height, pitch, roll, yaw, spread, likeness)


def _doubt(floor: _Floor, found: np.ndarray, likeness: float) -> np.ndarray:
    """(4,) how far other values are that make the floor hardly less alike; a bare floor leaves much open."""
    steps = np.array([0.04 * found[0], 0.01, 0.01, 0.01])
    bend = np.zeros((4, 4))
    for k in range(4):
        for n in range(k, 4):
            a, b = np.eye(4)[k] * steps, np.eye(4)[n] * steps
            if k == n:
                ends = floor.likeness(found + a, floor.pairs) + floor.likeness(found - a, floor.pairs)
                bend[k, k] = 2 * likeness - ends
                continue
            alike = floor.likeness(found + a + b, floor.pairs) + floor.likeness(found - a - b, floor.pairs)
            other = floor.likeness(found + a - b, floor.pairs) + floor.likeness(found - a + b, floor.pairs)
            bend[k, n] = bend[n, k] = -(alike - other) / 4
    sizes, ways = np.linalg.eigh(bend)
    covariance = (ways / np.maximum(sizes, 1e-4)) @ ways.T
    return steps * np.sqrt(2 * HARDLY * (1 - likeness) * np.diag(covariance))


def _climb(floor: _Floor, values: np.ndarray, pairs: list[tuple[int, int]], steps: np.ndarray) -> np.ndarray:
    """Uphill by ever smaller steps to where the floor is most alike.

    Along each value in turn, and along the ridges where more height makes up for more pitch.
    """
    best, steps = floor.likeness(values, pairs), steps.copy()
    while steps[1] > LAST_STEP_RAD:
        moved = False
        ridges = [steps[0] * np.array([1.0, slope, 0.0, 0.0]) for slope in RIDGES_RAD_PER_CM]
        for d in (*np.diag(steps), *ridges):
            less, more = floor.likeness(values - d, pairs), floor.likeness(values + d, pairs)
            if max(less, more) > best:
                values, best, moved = (values - d if less > more else values + d), max(less, more), True
            elif (bend := less - 2 * best + more) < 0:
                there = values + d * 0.5 * (less - more) / bend
                at = floor.likeness(there, pairs)
                if at > best:
                    values, best = there, at
        if not moved:
            steps = steps / 2
    return values


class _Floor:
    """The floor from above in pairs of pictures."""

    def __init__(self, seen: Shots) -> None:
        self._seen = seen
        self._grays = [cv2.GaussianBlur(gray.astype(np.float32), (0, 0), BLUR_PX) for gray in seen.grays]
        pairs = [(k, k + APART) for k in range(len(seen.grays) - APART)]
        self.pairs = pairs[:: max(1, len(pairs) // MOST_PAIRS)]
        x, z = np.meshgrid(
            np.arange(-WIDE_CM, WIDE_CM, CM_PER_PX), np.arange(FROM_CM, FARTHEST_CM, CM_PER_PX)
        )
        self._shape, self._x, self._z = x.shape, x.ravel(), z.ravel()

    def likeness(self, values: np.ndarray, pairs: list[tuple[int, int]]) -> float:
        """Correlation of the floor's pattern in these pairs, -1 to 1."""
        total = np.array([0.0, 1e-9, 1e-9])
        for pair in pairs:
            one, two, inside = self._views(pair, values)
            if inside.sum() < LEAST_SAMPLES:
                continue
            share = inside.astype(np.float32)
            around = cv2.GaussianBlur(share, (0, 0), LIGHT_CM / CM_PER_PX) + 1e-3
            a, b = (
                (view - cv2.GaussianBlur(view * share, (0, 0), LIGHT_CM / CM_PER_PX) / around)[inside]
                for view in (one, two)
            )
            a, b = (v / (1 + np.abs(v) / STRONG) for v in (a, b))
            total += (float(a @ b), float(a @ a), float(b @ b))
        return float(total[0] / math.sqrt(total[1] * total[2]))

    def _views(self, pair: tuple[int, int], values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(the floor in one picture, and in another; where both show it)."""
        turn = _turned(*values[1:])
        floor = np.column_stack([self._x, np.full(len(self._x), values[0]), self._z])
        views, inside = [], np.ones(self._shape, bool)
        for n in pair:
            pixels = _pixels_of(self._seen, floor, pair[0], n, turn)
            x_px, y_px = pixels.T.reshape(2, *self._shape).astype(np.float32)
            views.append(cv2.remap(self._grays[n], x_px, y_px, cv2.INTER_LINEAR))
            inside &= (x_px > RIM_PX) & (x_px < self._seen.lens.width - 1 - RIM_PX)
            inside &= (y_px > RIM_PX) & (y_px < self._seen.lens.height - 1 - RIM_PX)
        return views[0], views[1], inside


def _turned(pitch: float, roll: float, yaw: float) -> np.ndarray:
    """(3, 3) from the camera's axes to level ones that look where the robot drives to."""
    cp, sp, cr, sr, cy, sy = (f(v) for v in (pitch, roll, yaw) for f in (math.cos, math.sin))
    down = np.array([[1, 0, 0], [0, cp, sp], [0, -sp, cp]])
    aside = np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]])
    right = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    return right @ down @ aside
