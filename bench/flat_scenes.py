"""Random flat scenes whose regions are known exactly, at any size and any moment of their motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SUBSAMPLES = 4  # a side of each pixel, for the coverage of its edges
LEAST_CONTRAST = 45.0  # between any two colours of a scene, RGB Euclidean
SMALLEST_VISIBLE = 0.004  # share of the image below which a region need not be found


@dataclass(frozen=True)
class _Shape:
    """A rectangle or ellipse, in units of the image height."""

    centre: np.ndarray
    half: np.ndarray
    turn_rad: float
    velocity: np.ndarray  # unit vector
    round: bool
    colour: np.ndarray


class FlatScene:
    """2 to 6 overlapping rectangles and ellipses that move at constant speed in front of one colour.

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
                    centre=rng.uniform((0.15, 0.15), (1.15, 0.85)),
                    half=rng.uniform(0.08, 0.22, 2),
                    turn_rad=rng.uniform(0, np.pi),
                    velocity=np.array([np.cos(direction), np.sin(direction)]),
                    round=bool(rng.integers(2)),
                    colour=colour,
                )
            )

    def draw(
        self, width: int, height: int, moved_px: float = 0.0, noise: float = 4.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """The scene after every shape moved by `moved_px`.

        Returns
        -------
        image
            (H, W, 3) uint8, BGR: edges covered exactly to 1/16 of a pixel, Gaussian noise.
        labels
            (H, W): 0 for the ground, k for the k-th shape, by the pixels' centres.
        """
        offsets = (np.arange(SUBSAMPLES) + 0.5) / SUBSAMPLES
        image = np.broadcast_to(self._ground, (height, width, 3)).astype(float)
        labels = np.zeros((height, width), int)
        y, x = np.arange(height), np.arange(width)
        for k, shape in enumerate(self._shapes):
            coverage = np.zeros((height, width))
            for dy in offsets:
                for dx in offsets:
                    coverage += _inside(shape, x[None, :] + dx, y[:, None] + dy, height, moved_px)
            coverage /= SUBSAMPLES**2
            image += coverage[:, :, None] * (shape.colour - image)
            labels[_inside(shape, x[None, :] + 0.5, y[:, None] + 0.5, height, moved_px)] = k + 1
        rng = np.random.default_rng([self._seed, int(100 * moved_px)])
        image += rng.normal(0, noise, image.shape)
        return np.clip(np.rint(image), 0, 255).astype(np.uint8), labels


def recall(truth: np.ndarray, found: np.ndarray, least_iou: float = 0.9) -> tuple[int, int]:
    """How many true regions have a found one of at least this overlap, and how many there are.

    Parameters
    ----------
    truth, found
        (H, W) label images. True regions too small to matter are passed over.
    """
    found_ids, found_index = np.unique(found, return_inverse=True)
    table = np.zeros((truth.max() + 1, len(found_ids)))
    np.add.at(table, (truth.ravel(), found_index.ravel()), 1)
    area_true, area_found = table.sum(1, keepdims=True), table.sum(0, keepdims=True)
    best = (table / (area_true + area_found - table)).max(1)
    matters = area_true[:, 0] >= SMALLEST_VISIBLE * truth.size
    return int((best[matters] >= least_iou).sum()), int(matters.sum())


def _inside(shape: _Shape, x: np.ndarray, y: np.ndarray, height: int, moved_px: float) -> np.ndarray:
    cx, cy = shape.centre * height + shape.velocity * moved_px
    cos, sin = np.cos(shape.turn_rad), np.sin(shape.turn_rad)
    u = ((x - cx) * cos + (y - cy) * sin) / (shape.half[0] * height)
    v = ((y - cy) * cos - (x - cx) * sin) / (shape.half[1] * height)
    return u * u + v * v <= 1 if shape.round else np.maximum(np.abs(u), np.abs(v)) <= 1


def _distinct_colours(rng: np.random.Generator, count: int) -> list[np.ndarray]:
    colours: list[np.ndarray] = []
    while len(colours) < count:
        colour = rng.integers(20, 236, 3).astype(float)
        if all(np.linalg.norm(colour - other) >= LEAST_CONTRAST for other in colours):
            colours.append(colour)
    return colours
