"""Did the picture lose its focus? All its edges went at once, while light and dark stay where they were.

Edges that leave the picture, or go behind something, take their light and dark with them, and others stay; so
the picture is compared tile by tile with one of a moment ago. Where there are few edges nothing is said.
"""

from __future__ import annotations

import cv2
import numpy as np

from host.nav import _nav

EVERY_ROW = 4
TILES = (10, 6)  # across and down
STEP_PX = 2
STEP_LEVELS = 20  # in brightness, over so few pixels: more than noise makes
WIDE_PX = 4  # to either side of it; an edge in focus has most of its step in the middle, any other a fifth
CLEAR_SHARE = 0.04  # of a tile's pixels lie at edges
LEAST_TILES = 6  # with clear edges; fewer may have gone for other reasons
GONE_SHARE = 0.25  # of a tile's edges are left, in it and all around it
ALL_SHARE = 0.8  # of the clear tiles have lost theirs
SAME_LEVELS = 25.0  # the mean of a tile that shows what it did, or that mixed with all around, is as near
BACK_SHARE = 0.5  # of the edges are back
NEAR_CM = 0.75  # path of a wheel: a turn by less leaves things in their tiles, or in the next ones
SAME_VIEW_CM = 3.0  # and after more it is another view
WAIT_S = 4.0  # a scene that stays as it is for so long may be soft itself
SOFT_CM = 100.0  # and after so much travel another one is to be seen


class FocusWatch:
    """Compares every picture with one in which there were edges."""

    def __init__(self) -> None:
        self._edges: np.ndarray | None = None  # by tile, of the picture to compare with
        self._means = np.zeros(0)
        self._at_cm = 0.0
        self._lost_s: float | None = None  # since when they are gone
        self._soft: tuple[float, float] | None = None  # edges wanted, and path when they were given up

    @property
    def soft(self) -> bool:
        """Edges went and did not come back: see carefully."""
        return self._soft is not None

    def blurred(self, image: np.ndarray, t_s: float, travelled_cm: float) -> bool:
        """Whether the picture is to be waited out.

        Parameters
        ----------
        image : (H, W, 3) uint8
        t_s : when it was taken.
        travelled_cm : path of a wheel so far.
        """
        edges, means = tiles_of(image)
        total = float(edges.sum())
        if self._soft is not None and (
            total > BACK_SHARE * self._soft[0] or travelled_cm - self._soft[1] > SOFT_CM
        ):
            self._soft = None
        before = self._edges
        if self._lost_s is None and travelled_cm - self._at_cm > SAME_VIEW_CM:
            before = None
        if before is not None and self._went(before, edges, means):
            self._lost_s = t_s if self._lost_s is None else self._lost_s
            if t_s - self._lost_s < WAIT_S:
                return True
            self._soft = float(before.sum()), travelled_cm
        elif (
            before is not None
            and self._lost_s is None
            and total < before.sum()
            and travelled_cm - self._at_cm < NEAR_CM
        ):
            return False  # the sharper one is the one to compare with
        self._lost_s = None
        self._edges, self._means, self._at_cm = edges, means, travelled_cm
        return False

    def _went(self, before: np.ndarray, edges: np.ndarray, means: np.ndarray) -> bool:
        inner = before[1:-1, 1:-1]  # from the outer tiles things leave the picture
        clear = inner > CLEAR_SHARE
        count = int(np.count_nonzero(clear))
        if count < LEAST_TILES:
            return False
        if int(np.count_nonzero(clear & (edges[1:-1, 1:-1] < GONE_SHARE * inner))) < ALL_SHARE * count:
            return False  # so it is mostly, and the rest need not be worked out
        around = cv2.dilate(edges, np.ones((3, 3), np.uint8))[1:-1, 1:-1]
        mixed = cv2.blur(self._means, (3, 3))
        off = np.minimum(np.abs(means - self._means), np.abs(means - mixed))
        same = off[1:-1, 1:-1] < SAME_LEVELS
        return int(np.count_nonzero(clear & same & (around < GONE_SHARE * inner))) >= ALL_SHARE * count


def tiles_of(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(share of pixels at sharp edges, mean brightness), each by tile, float32."""
    image = np.ascontiguousarray(image)
    across, down = TILES
    return _nav.sharp_tiles(image, EVERY_ROW, STEP_PX, WIDE_PX, STEP_LEVELS, across, down)
