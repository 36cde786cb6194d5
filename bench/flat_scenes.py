"""Random flat scenes whose regions are known exactly: at any size, any moment, clean or spoiled."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from host.rbdn import Snapshot

LEAST_CONTRAST = 45.0  # between any two colours of a scene, RGB Euclidean
SMALLEST_TRUE = 0.004  # share of the image below which a region need not be found: 307 px at 320x240
SMALLEST_EXCESS_PX = 200
ELLIPSE_CORNERS = 256  # sagitta 0.004 px at 50 px radius


@dataclass(frozen=True)
class Disturbance:
    """What the camera and the light do to a scene."""

    noise: float = 4.0
    """Sigma of each channel's Gaussian noise, grey levels."""
    shading: float = 0.0
    """Brightness runs from 1 - shading to 1 + shading across the image, straight, in a random direction."""
    texture: float = 0.0
    """Sigma of a pattern in the brightness, grey levels."""
    grain_px: float = 0.0
    """Sigma of the blur that makes the pattern coarse; 0 leaves every pixel on its own."""
    jpeg_quality: int | None = None
    """Compressed with colours at half resolution (4:2:0), if at all."""


DISTURBANCES = {
    "noise 4": Disturbance(),
    "shading 25 %": Disturbance(shading=0.25),
    "texture 16, fine": Disturbance(texture=16.0),
    "texture 16, coarse": Disturbance(texture=16.0, grain_px=2.0),
    "JPEG quality 50": Disturbance(jpeg_quality=50),
}


@dataclass(frozen=True)
class _Shape:
    """A simple polygon, in units of the image height."""

    outline: np.ndarray  # (N, 2) around its centre
    centre: np.ndarray
    velocity: np.ndarray  # unit vector
    colour: np.ndarray


class FlatScene:
    """2 to 6 overlapping rectangles, ellipses and polygons that move steadily in front of one colour.

    Parameters
    ----------
    seed
        Chooses shapes, colours and motion; they do not depend on the size they are drawn at.
    """

    def __init__(self, seed: int) -> None:
        self._seed = seed
        rng = np.random.default_rng(seed)
        count = int(rng.integers(2, 7))
        colours = _distinct_colours(rng, count + 1)
        self._ground = colours[0]
        self._shapes = []
        for colour in colours[1:]:
            direction = rng.uniform(0, 2 * np.pi)
            self._shapes.append(
                _Shape(
                    outline=_random_outline(rng),
                    centre=rng.uniform((0.15, 0.15), (1.15, 0.85)),
                    velocity=np.array([np.cos(direction), np.sin(direction)]),
                    colour=colour,
                )
            )

    def draw(
        self, width: int, height: int, moved_px: float = 0.0, disturbance: Disturbance | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """The scene after every shape moved by `moved_px`.

        Returns
        -------
        image
            (H, W, 3) uint8, BGR. Pixels on an outline are mixed by their exact coverage, in linear light.
        labels
            (H, W): the regions, from 0, each connected.
        """
        image = np.broadcast_to(_to_linear(self._ground), (height, width, 3)).copy()
        owner = np.zeros((height, width), np.int32)
        for k, shape in enumerate(self._shapes):
            outline = (shape.outline + shape.centre) * height + shape.velocity * moved_px
            share = coverage([outline], width, height)
            image += share[:, :, None] * (_to_linear(shape.colour) - image)
            owner[share >= 0.5] = k + 1
        rng = np.random.default_rng([self._seed, int(100 * moved_px)])
        return _spoil(_to_srgb(image), disturbance or Disturbance(), self._seed, rng), _connected(owner)


def coverage(loops: Iterable[np.ndarray], width: int, height: int) -> np.ndarray:
    """Exact share of every pixel that lies inside a polygon.

    Parameters
    ----------
    loops
        (N, 2) outlines that do not cross, holes turning the other way than what they are in; the corner of
        the image is at 0, 0 and the centre of its first pixel at 0.5, 0.5.

    Returns
    -------
    ndarray
        (H, W), 0 to 1.
    """
    swept = np.zeros((height, width + 2))
    for loop in loops:
        for start, end in zip(loop, np.roll(loop, -1, axis=0), strict=True):
            _sweep(swept, start, end, width, height)
    return np.abs(np.cumsum(swept, axis=1)[:, :width])


def _sweep(swept: np.ndarray, start: np.ndarray, end: np.ndarray, width: int, height: int) -> None:
    """Adds what a side of a polygon covers: all that is right of it, as steps from each pixel to the next."""
    span = end - start
    if span[1] == 0:
        return
    cuts = [np.array([0.0, 1.0])]
    for axis, size in ((0, width), (1, height)):
        if span[axis] != 0:
            low, high = sorted((start[axis], end[axis]))
            lines = np.arange(max(np.ceil(low), 0), min(np.floor(high), size) + 1)
            cuts.append((lines - start[axis]) / span[axis])
    t = np.clip(np.sort(np.concatenate(cuts)), 0, 1)
    y = start[1] + span[1] * t
    x = np.clip(start[0] + span[0] * t, 0, width)
    middle_y, middle_x = 0.5 * (y[1:] + y[:-1]), 0.5 * (x[1:] + x[:-1])
    seen = (middle_y > 0) & (middle_y < height)
    rise, row, column = np.diff(y)[seen], middle_y[seen].astype(int), middle_x[seen].astype(int)
    beyond = middle_x[seen] - column
    np.add.at(swept, (row, column), rise * (1 - beyond))
    np.add.at(swept, (row, column + 1), rise * beyond)


@dataclass(frozen=True)
class Score:
    """How well found regions match the true ones."""

    found: int = 0
    """True regions that a found one overlaps well."""
    true: int = 0
    """True regions large enough to matter."""
    excess: int = 0
    """Found regions of some size that overlap no true one by half."""

    def __add__(self, other: Score) -> Score:
        return Score(self.found + other.found, self.true + other.true, self.excess + other.excess)


def score(truth: np.ndarray, found: np.ndarray, least_iou: float = 0.9) -> Score:
    """Compares two (H, W) label images.

    Above an IoU of one half no two regions can match the same one, so nothing needs to be assigned.
    """
    _, true_index = np.unique(truth, return_inverse=True)
    _, found_index = np.unique(found, return_inverse=True)
    table = np.zeros((true_index.max() + 1, found_index.max() + 1))
    np.add.at(table, (true_index.ravel(), found_index.ravel()), 1)
    area_true, area_found = table.sum(1, keepdims=True), table.sum(0, keepdims=True)
    iou = table / (area_true + area_found - table)
    matters = area_true[:, 0] >= SMALLEST_TRUE * truth.size
    return Score(
        found=int((iou.max(1)[matters] >= least_iou).sum()),
        true=int(matters.sum()),
        excess=int(((iou.max(0) < 0.5) & (area_found[0] >= SMALLEST_EXCESS_PX)).sum()),
    )


def labels_of(snapshot: Snapshot, width: int, height: int) -> np.ndarray:
    """(H, W): the region that covers most of each pixel, counted in the order of the snapshot."""
    shares = [coverage([loop + 0.5 for loop in r.loops], width, height) for r in snapshot.regions]
    return np.argmax(np.stack(shares), axis=0)


def _random_outline(rng: np.random.Generator) -> np.ndarray:
    half = rng.uniform(0.08, 0.22, 2)
    turn = rng.uniform(0, np.pi)
    kind = rng.integers(3)
    if kind == 0:
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], float)
    elif kind == 1:
        angle = np.arange(ELLIPSE_CORNERS) * (2 * np.pi / ELLIPSE_CORNERS)
        corners = np.stack([np.cos(angle), np.sin(angle)], 1)
        corners *= np.sqrt(2 * np.pi / ELLIPSE_CORNERS / np.sin(2 * np.pi / ELLIPSE_CORNERS))  # its true area
    else:
        count = int(rng.integers(3, 8))
        angle = (np.arange(count) + rng.uniform(-0.3, 0.3, count)) * (2 * np.pi / count)
        corners = np.stack([np.cos(angle), np.sin(angle)], 1) * rng.uniform(0.8, 1.3, (count, 1))
    cos, sin = np.cos(turn), np.sin(turn)
    return (corners * half) @ np.array([[cos, sin], [-sin, cos]])


def _distinct_colours(rng: np.random.Generator, count: int) -> list[np.ndarray]:
    colours: list[np.ndarray] = []
    while len(colours) < count:
        colour = rng.integers(20, 236, 3).astype(float)
        if all(np.linalg.norm(colour - other) >= LEAST_CONTRAST for other in colours):
            colours.append(colour)
    return colours


def _spoil(image: np.ndarray, how: Disturbance, seed: int, rng: np.random.Generator) -> np.ndarray:
    height, width = image.shape[:2]
    scene = np.random.default_rng([seed, 1])  # light and pattern stay where they are while shapes move
    direction = scene.uniform(0, 2 * np.pi)
    if how.shading > 0:
        y, x = np.mgrid[0:height, 0:width]
        along = (x - width / 2) * np.cos(direction) + (y - height / 2) * np.sin(direction)
        image = image * (1 + how.shading * along / np.abs(along).max())[:, :, None]
    if how.texture > 0:
        pattern = scene.normal(size=(height, width))
        if how.grain_px > 0:
            pattern = cv2.GaussianBlur(pattern, (0, 0), how.grain_px)
        image = image + (how.texture / pattern.std() * pattern)[:, :, None]
    image = image + rng.normal(0, how.noise, image.shape)
    image = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    if how.jpeg_quality is None:
        return image
    packed = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, how.jpeg_quality])[1]
    decoded = cv2.imdecode(packed, cv2.IMREAD_COLOR)
    assert decoded is not None
    return decoded


def _connected(owner: np.ndarray) -> np.ndarray:
    """One number for each connected part of each owner, from 0."""
    labels = np.zeros(owner.shape, np.int32)
    count = 0
    for k in np.unique(owner):
        parts, part = cv2.connectedComponents((owner == k).astype(np.uint8), connectivity=4)
        labels[part > 0] = part[part > 0] + count - 1
        count += parts - 1
    return labels


def _to_linear(srgb: np.ndarray) -> np.ndarray:
    s = srgb / 255
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)


def _to_srgb(linear: np.ndarray) -> np.ndarray:
    return 255 * np.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055
    )
