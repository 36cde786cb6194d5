"""A hand that holds a calibration board before a simulated webcam: ``sim:target?seed=1``.

The board is seen through a lens with distortion: every pixel is the mean of many rays, each followed through
the lens to the board.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from urllib.parse import parse_qsl

import cv2
import numpy as np

from host.calibrate.board import Board
from host.camera.frame import Frame
from host.camera.lens import Lens
from host.errors import UsageError
from host.sim.render import Webcam, WebcamModel

RAYS = 4  # across and down a pixel
TEXELS_PER_MM = 4  # on which the default board's edges all lie
PAPER_MM = 14.0  # white around the board
INK, WHITE, WALL = 0.03, 0.85, 0.28  # light that comes back
FPS = 15.0
HELD, MOVED = 4, 5  # pictures for which a place is held, and for which the board is on its way
TREMOR_MM, TREMOR_RAD = 0.15, 0.0004


class BoardCamera:
    """Renders a board at any place before a lens."""

    def __init__(self, lens: Lens, board: Board, model: WebcamModel | None = None, seed: int = 0) -> None:
        self.lens = lens
        self._board = board
        self._model = model or WebcamModel()
        self._webcam = Webcam(self._model, lens, seed)
        self._paper = _paper(board)
        self._rays = _rays(lens)

    def take(self, rotation: np.ndarray, place_mm: np.ndarray, seq: int) -> np.ndarray:
        """(H, W, 3) uint8 BGR of the board, whose upper left corner is at `place_mm` before the camera.

        Parameters
        ----------
        rotation
            (3, 3): its columns are the board's directions to the right, down and away, in the camera's axes.
        """
        to_plane = np.linalg.inv(np.column_stack([rotation[:, 0], rotation[:, 1], place_mm]))
        to_texel = np.array([
            [TEXELS_PER_MM, 0, TEXELS_PER_MM * PAPER_MM - 0.5],
            [0, TEXELS_PER_MM, TEXELS_PER_MM * PAPER_MM - 0.5],
            [0, 0, 1],
        ])  # fmt: skip
        view = (to_texel @ to_plane).astype(np.float32)
        light = np.zeros((self.lens.height, self.lens.width), np.float32)
        for x, y in self._rays:
            w = 1 / (view[2, 0] * x + view[2, 1] * y + view[2, 2])
            u = (view[0, 0] * x + view[0, 1] * y + view[0, 2]) * w
            v = (view[1, 0] * x + view[1, 1] * y + view[1, 2]) * w
            light += cv2.remap(
                self._paper, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=WALL
            )
        light /= len(self._rays)
        if self._model.psf_px:
            light = cv2.GaussianBlur(light, (0, 0), self._model.psf_px)
        return self._webcam.take(np.repeat(light[:, :, None], 3, axis=2), seq / FPS, seq)


def _paper(board: Board) -> np.ndarray:
    """Light that comes back from the board and the paper around it."""
    width, height = (round((side + 2 * PAPER_MM) * TEXELS_PER_MM) for side in board.size_mm)
    paper = np.full((height, width), WHITE, np.float32)
    for x, y, w, h in board.black_mm:
        left, top, right, bottom = (round(TEXELS_PER_MM * (PAPER_MM + at)) for at in (x, y, x + w, y + h))
        paper[top:bottom, left:right] = INK
    return paper


def _rays(lens: Lens) -> list[tuple[np.ndarray, np.ndarray]]:
    """For each ray of a pixel the slopes (H, W) right and down, of all pixels."""
    x, y = np.meshgrid(np.arange(-1, lens.width + 1.0), np.arange(-1, lens.height + 1.0))
    slopes = lens.to_rays(np.column_stack([x.ravel(), y.ravel()])).reshape(*x.shape, 2)
    out = []
    for down in ((np.arange(RAYS) + 0.5) / RAYS - 0.5).tolist():
        for across in ((np.arange(RAYS) + 0.5) / RAYS - 0.5).tolist():
            # Quadratic between pixels: what a lens bends within one is smoother than that.
            rows = _between(slopes, down)
            at = _between(rows.transpose(1, 0, 2), across).transpose(1, 0, 2).astype(np.float32)
            out.append((np.ascontiguousarray(at[..., 0]), np.ascontiguousarray(at[..., 1])))
    return out


def _between(a: np.ndarray, by: float) -> np.ndarray:
    """Rows 1 to -1 of an array, read so far below where they are."""
    before, here, after = a[:-2], a[1:-1], a[2:]
    return here + by * (after - before) / 2 + by * by / 2 * (after - 2 * here + before)


def turned(tilt_x_rad: float, tilt_y_rad: float, roll_rad: float) -> np.ndarray:
    """A board's rotation: tipped with its top away, turned with its right side away, rolled clockwise."""
    (cx, cy, cz), (sx, sy, sz) = (
        np.cos((tilt_x_rad, tilt_y_rad, roll_rad)),
        np.sin((tilt_x_rad, tilt_y_rad, roll_rad)),
    )
    tipped = np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    aside = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    rolled = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return aside @ tipped @ rolled


def held_at(
    lens: Lens, board: Board, middle: tuple[float, float], width: float, tilts: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """(rotation, place in mm) of a board whose middle is at a part of the picture, and so wide in it.

    Parameters
    ----------
    middle
        0 to 1 across and down the picture.
    width
        Of the board over the picture's, were it not tilted.
    """
    rotation = turned(*tilts)
    far_mm = lens.fx * board.size_mm[0] / (width * lens.width)
    ray = lens.to_rays(np.array([[middle[0] * lens.width, middle[1] * lens.height]]))[0]
    half = rotation @ (board.size_mm[0] / 2, board.size_mm[1] / 2, 0.0)
    return rotation, far_mm * np.array([*ray, 1.0]) - half


def good_views(count: int, seed: int) -> list[tuple[tuple[float, float], float, tuple[float, float, float]]]:
    """(middle, width, tilts) as a careful person holds a board: everywhere, near and far, tilted each way."""
    rng = np.random.default_rng((0xB0A2D, seed))
    places = [(0.5, 0.5), (0.27, 0.3), (0.73, 0.3), (0.27, 0.7), (0.73, 0.7), (0.5, 0.28), (0.5, 0.72)]
    out = []
    for k in range(count):
        x, y = np.array(places[k % len(places)]) + rng.uniform(-0.05, 0.05, 2)
        width = (0.85, 0.6, 0.45, 0.7)[k % 4] * rng.uniform(0.92, 1.08)
        way = rng.uniform(-0.4, 0.4) + k * math.pi / 2
        lean = 0.0 if k % 7 == 0 else rng.uniform(0.4, 0.65)
        tilts = (lean * math.sin(way), lean * math.cos(way), float(rng.uniform(-0.2, 0.2)))
        out.append(((float(x), float(y)), float(width), tilts))
    return out


def drawn_lens(seed: int, width: int = 640, height: int = 480) -> Lens:
    """A webcam's lens, from its seed."""
    rng = np.random.default_rng((0x1E25, seed))
    fx = width * rng.uniform(0.85, 1.15)
    cx, cy = (width - 1) / 2 + rng.uniform(-8, 8), (height - 1) / 2 + rng.uniform(-8, 8)
    k1, k2 = rng.uniform(-0.3, 0.05), rng.uniform(0.0, 0.1)
    p1, p2 = rng.uniform(-1e-3, 1e-3, 2)
    return Lens(
        width, height, fx, fx * rng.uniform(0.995, 1.005), cx, cy, (k1, k2, float(p1), float(p2), 0.0)
    )


class HeldBoard:
    """A ``host.camera.frame.FrameSource``: a hand moves a board from place to place and holds it there."""

    def __init__(
        self,
        lens: Lens,
        board: Board,
        views: Sequence[tuple[tuple[float, float], float, tuple[float, float, float]]],
        model: WebcamModel | None = None,
        seed: int = 0,
    ) -> None:
        self.lens: Lens | None = None  # nobody knows it yet
        self.true_lens = lens  # for scoring alone
        self._camera = BoardCamera(lens, board, model, seed)
        self._places = [
            (view[2], held_at(lens, board, *view)[1], held_at(lens, board, *view)[0]) for view in views
        ]
        self._rng = np.random.default_rng((0x4A2D, seed))
        self._seq = 0

    def read(self, timeout_s: float) -> Frame | None:
        """The next picture, or None when all places were shown; never waits."""
        k, phase = divmod(self._seq, HELD + MOVED)
        if k >= len(self._places):
            return None
        tilts, place, _ = self._places[k]
        part = max(0, phase - HELD + 1) / (MOVED + 1)
        if part and k + 1 < len(self._places):
            then = self._places[k + 1]
            tilts = tuple(a + part * (b - a) for a, b in zip(tilts, then[0], strict=True))
            place = place + part * (then[1] - place)
        shake = self._rng.normal(0.0, 1.0, 6)
        tilts = tuple(a + TREMOR_RAD * float(b) for a, b in zip(tilts, shake[:3], strict=True))
        image = self._camera.take(turned(*tilts), place + TREMOR_MM * shake[3:], self._seq)
        self._seq += 1
        return Frame(image, (self._seq - 1) / FPS, self._seq - 1)

    def close(self) -> None:
        """No more pictures."""
        self._seq = 10**9


def open_held_board(uri: str, board: Board) -> HeldBoard:
    """The hand and the webcam that a URI names.

    Raises
    ------
    UsageError
        It is not ``sim:target``, or has parameters that this has not.
    """
    name, _, query = uri.partition("?")
    if name != "sim:target":
        raise UsageError(f"camera {uri}: nobody holds a board there; in simulation it is sim:target")
    values = {"seed": 0, "views": 26}
    for key, text in parse_qsl(query, keep_blank_values=True):
        if key not in values:
            raise UsageError(f"camera {uri}: sim:target has no parameter {key!r}; known are seed, views")
        if not (text.isascii() and text.isdigit() and len(text) < 7):
            raise UsageError(f"camera {uri}: {key} must be a whole number below a million, not {text!r}")
        values[key] = int(text)
    return HeldBoard(
        drawn_lens(values["seed"]), board, good_views(values["views"], values["seed"]), seed=values["seed"]
    )
