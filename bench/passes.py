"""Scenes in which things enter, leave and pass one another, as a webcam shows them and known exactly.

Every scene has a shaded ground, a few resting things and one that moves. Its kind tells what happens:

    enter    it comes in from outside and stops
    leave    it goes out
    part     it covers a part of another, or is covered in part
    across   a small one passes in front of a large one, which has a hole meanwhile
    cover    it covers another wholly, or vanishes wholly behind another, and parts again
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from host.camera.lens import Lens
from host.sim.render import Webcam, WebcamModel, linear_of

KINDS = ("enter", "leave", "part", "across", "cover")
LOOKS = ("flat", "webcam")
SIZE = (320, 240)  # width, height
FLAT_NOISE = 4.0  # grey levels
PSF_PX = 0.65
FRAME_S = 0.1
LEAST_CONTRAST = 20.0  # between any two colours, in CIELAB with lightness counted 0.3 times
MARGIN_PX = 12.0  # between things that are not meant to touch
STILL_FRAMES = 5  # before and after the motion

# On flat pictures nothing but the sensor's noise; on the others what spoils real ones.
SHADING = {"flat": 0.0, "webcam": 0.14}
GRAIN = {"flat": 0.0, "webcam": 0.03}


@dataclass(frozen=True)
class Thing:
    """A rectangle or an ellipse. Lengths in pixels."""

    centre: np.ndarray
    half: np.ndarray
    turn_rad: float
    round: bool
    light: np.ndarray  # linear BGR
    shade_rad: float  # direction in which it is lit

    @property
    def reach_px(self) -> float:
        """Radius of a circle round it."""
        return float(self.half.max() if self.round else np.hypot(*self.half))

    @property
    def core_px(self) -> float:
        """Radius of the circle inside it."""
        return float(self.half.min())

    def distance(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Signed distance to the outline of places relative to the centre, negative inside; exact near by."""
        cos, sin = np.cos(self.turn_rad), np.sin(self.turn_rad)
        u, v = (x * cos + y * sin) / self.half[0], (y * cos - x * sin) / self.half[1]
        if not self.round:
            return np.maximum((np.abs(u) - 1) * self.half[0], (np.abs(v) - 1) * self.half[1])
        level = np.hypot(u, v)
        slope = np.hypot(u / self.half[0], v / self.half[1]) / np.maximum(level, 1e-9)
        return (level - 1) / np.maximum(slope, 1e-9)


class PassScene:
    """One such scene; frame k is drawn by ``draw(k)``.

    Parameters
    ----------
    kind
        One of KINDS.
    look
        One of LOOKS.
    seed
        Chooses things, colours and motion.

    Attributes
    ----------
    frames
        How many there are.
    mover
        True label of what moves; the ground is 0.
    partner
        True label of what it meets on purpose, None where it meets nothing.
    labels
        How many true labels there are.
    enters
        Does the mover come in from outside?
    """

    def __init__(self, kind: str, look: str, seed: int) -> None:
        self._rng = np.random.default_rng((KINDS.index(kind), seed))
        self._look, self._seed = look, seed
        colours = _distinct_colours(self._rng, 5)
        self._ground, self._colours = colours[0], colours[1:]
        self._ground_shade = self._rng.uniform(0, 2 * np.pi)
        self._grain = [_grain(self._rng) for _ in range(6)]
        self._things, self._path, self.mover, self.partner = self._stage(kind)
        self.frames = len(self._path)
        self.labels = len(self._things) + 1
        self.enters = kind == "enter"
        # No drift: a camera that follows its exposure is the long runs' business.
        model = WebcamModel(exposure_drift=0.0)
        self._webcam = Webcam(model, Lens(*SIZE, 300.0, 300.0, SIZE[0] / 2, SIZE[1] / 2), seed)

    def draw(self, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """The picture (H, W, 3) uint8 BGR, and the true label of every pixel's centre (H, W)."""
        width, height = SIZE
        x, y = np.arange(width)[None, :], np.arange(height)[:, None]
        shade, grain = SHADING[self._look], GRAIN[self._look]
        lit = _slope(x - width / 2, y - height / 2, self._ground_shade) / (0.6 * width)
        light = self._ground * (1 + shade * lit + grain * self._grain[0])[..., None]
        labels = np.zeros((height, width), int)
        for k, thing in enumerate(self._at(frame)):
            low = np.floor(thing.centre - thing.reach_px).astype(int) - 2
            high = np.ceil(thing.centre + thing.reach_px).astype(int) + 3
            near = tuple(slice(max(0, a), max(0, b)) for a, b in zip(low[::-1], high[::-1], strict=True))
            dx, dy = x[:, near[1]] - thing.centre[0], y[near[0]] - thing.centre[1]
            distance = thing.distance(dx, dy)
            lit = np.clip(_slope(dx, dy, thing.shade_rad) / thing.reach_px, -1, 1)
            skip_x, skip_y = np.maximum(0, -low)  # what lies outside on the left and above
            own_grain = self._grain[k + 1][skip_y:, skip_x:][: distance.shape[0], : distance.shape[1]]
            colour = thing.light * (1 + shade * lit + grain * own_grain)[..., None]
            light[near] += np.clip(0.5 - distance, 0, 1)[..., None] * (colour - light[near])
            labels[near][distance < 0] = k + 1
        light = cv2.GaussianBlur(light.astype(np.float32), (0, 0), PSF_PX)
        return self._photograph(light, frame), labels

    def _photograph(self, light: np.ndarray, frame: int) -> np.ndarray:
        if self._look == "webcam":
            return self._webcam.take(light, frame * FRAME_S, frame)
        srgb = np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 0) ** (1 / 2.4) - 0.055)
        noise = np.random.default_rng((self._seed, frame)).normal(0, FLAT_NOISE, light.shape)
        return np.clip(np.rint(255 * srgb + noise), 0, 255).astype(np.uint8)

    def _at(self, frame: int) -> list[Thing]:
        things = list(self._things)
        things[self.mover - 1] = replace(things[self.mover - 1], centre=self._path[frame])
        return things

    def _stage(self, kind: str) -> tuple[list[Thing], np.ndarray, int, int | None]:
        """Things from back to front, the mover's way, its label and its partner's."""
        rng = self._rng
        speed = rng.uniform(2.5, 5.0)
        if kind in ("enter", "leave"):
            mover = self._thing(0, rng.uniform(16, 40, 2))
            rest = self._resting([], 3, first=1)
            inside = rng.uniform((80, 70), (240, 170))
            away = rng.uniform(0, 2 * np.pi)
            direction = np.array([np.cos(away), np.sin(away)])
            reach = mover.reach_px + 2
            out = inside + direction * _distance_out(inside, direction, reach)
            path = _straight(out, inside, speed)
            return [*rest, mover], path if kind == "enter" else path[::-1], len(rest) + 1, None

        small, large = rng.uniform(16, 24, 2), rng.uniform(26, 36, 2)
        if kind == "part":
            mover, partner = self._thing(0, large), self._thing(1, rng.uniform(20, 32, 2))
            aside = rng.uniform(0.6, 1.0) * (mover.core_px + partner.core_px) * 0.8
        elif kind == "across":
            partner = self._thing(1, rng.uniform(50, 60, 2))
            mover, aside = self._thing(0, np.minimum(small, partner.core_px * 0.45)), rng.uniform(-8, 8)
        else:
            mover = self._thing(0, large)
            hidden = 0.75 * mover.core_px
            partner = self._thing(1, rng.uniform(0.6, 0.7, 2) * hidden)
            aside = rng.uniform(-0.1, 0.1) * mover.core_px
        in_front = kind == "across" or bool(rng.integers(2))
        if kind == "cover" and not in_front:
            mover, partner = partner, mover
        partner = replace(partner, centre=rng.uniform((145, 105), (175, 135)))
        tilt = rng.uniform(-0.4, 0.4) + np.pi * rng.integers(2)
        along = np.array([np.cos(tilt), np.sin(tilt)])
        middle = partner.centre + aside * np.array([-along[1], along[0]])
        run = mover.reach_px + partner.reach_px + MARGIN_PX
        path = _straight(middle - run * along, middle + run * along, speed)
        rest = self._resting([partner, *(replace(mover, centre=p) for p in path)], 2, first=2)
        pair = [partner, mover] if in_front else [mover, partner]
        first = len(rest) + 1
        return [*rest, *pair], path, first + in_front, first + (not in_front)

    def _thing(self, number: int, half: np.ndarray) -> Thing:
        rng = self._rng
        centre, turn, shade = np.zeros(2), rng.uniform(0, np.pi), rng.uniform(0, 2 * np.pi)
        return Thing(centre, half, turn, bool(rng.integers(2)), self._colours[number], shade)

    def _resting(self, avoid: list[Thing], count: int, first: int) -> list[Thing]:
        """Things clear of each other and of those to avoid; fewer where there is no room."""
        placed: list[Thing] = []
        for k in range(count):
            thing = self._thing(first + k, self._rng.uniform(10, 24, 2))
            for _ in range(60):
                centre = self._rng.uniform((30, 30), (SIZE[0] - 30, SIZE[1] - 30))
                if all(
                    np.hypot(*(centre - o.centre)) > thing.reach_px + o.reach_px + MARGIN_PX
                    for o in (*avoid, *placed)
                ):
                    placed.append(replace(thing, centre=centre))
                    break
        return placed


def _straight(start: np.ndarray, end: np.ndarray, speed_px: float) -> np.ndarray:
    steps = max(2, int(np.ceil(np.hypot(*(end - start)) / speed_px)))
    moving = start + np.linspace(0, 1, steps + 1)[:, None] * (end - start)
    still = (np.repeat(start[None], STILL_FRAMES, 0), np.repeat(end[None], STILL_FRAMES, 0))
    return np.vstack([still[0], moving, still[1]])


def _distance_out(start: np.ndarray, direction: np.ndarray, reach_px: float) -> float:
    """How far to go from `start` until nothing within `reach_px` is left in the picture."""
    ways = []
    for axis, size in enumerate(SIZE):
        if abs(direction[axis]) > 1e-9:
            limit = size + reach_px if direction[axis] > 0 else -reach_px
            ways.append((limit - start[axis]) / direction[axis])
    return min(ways)


def _slope(x: np.ndarray, y: np.ndarray, turn_rad: float) -> np.ndarray:
    return x * np.cos(turn_rad) + y * np.sin(turn_rad)


def _grain(rng: np.random.Generator) -> np.ndarray:
    """Mild texture of unit variance, with a grain of some 4 px."""
    noise = cv2.GaussianBlur(rng.standard_normal((SIZE[1], SIZE[0])).astype(np.float32), (0, 0), 2.0)
    return noise / noise.std()


def _distinct_colours(rng: np.random.Generator, count: int) -> list[np.ndarray]:
    """Linear BGR colours that differ in more than lightness."""
    chosen: list[np.ndarray] = []
    seen: list[np.ndarray] = []
    while len(chosen) < count:
        bgr = rng.integers(30, 226, 3)
        lab = cv2.cvtColor((bgr[None, None] / 255).astype(np.float32), cv2.COLOR_BGR2LAB)[0, 0]
        lab = lab * np.array([0.3, 1, 1])
        if all(np.linalg.norm(lab - other) >= LEAST_CONTRAST for other in seen):
            seen.append(lab)
            chosen.append(linear_of(bgr / 255))
    return chosen
