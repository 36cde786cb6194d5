"""The foot of a wall in a region that is floor and wall in one, found in the picture itself.

The net makes one region of floor and wall where they are alike. In narrow strips upright through the picture
the colour still changes at the wall's foot, if only a little; strips beside each other must agree on where.
"""

from __future__ import annotations

import numpy as np

from host.nav import _nav
from host.nav.picture import STEP_PX

STRIP = 4  # columns that are looked at together
WINDOW = 6  # pixels below and above a foot whose colours are compared
LIGHT = 0.35  # what brightness counts beside hue: shadows and joints between tiles are only darker
LEAST_STEP = 5.0  # change of mean colour, in levels; noise makes about 1
AGREE_PX = 3  # strips beside each other agree to this
WIDEST_SHADOW = 5  # strips; what stands on the floor darkens it beside its foot, a wall's foot is wider
SEARCH = 3  # strips on either side that are asked


def strips_of(image: np.ndarray) -> np.ndarray:
    """(W / 2 / STRIP, H / 2, 3) colours of a BGR image's strips as RGB, lowest pixel first."""
    return _nav.strips(np.ascontiguousarray(image), STEP_PX, STRIP * STEP_PX)


def find_foot(strips: np.ndarray, mine: np.ndarray, highest: np.ndarray) -> np.ndarray:
    """Pixels above the lower border at which a wall begins, (W / 2,); -1 where no foot is seen.

    Parameters
    ----------
    strips : of the picture.
    mine : (W / 2, H / 2) bool, pixels of the region.
    highest : (W / 2,) pixels above the lower border up to which there may be a foot.
    """
    step = _nav.colour_steps(strips, WINDOW, LIGHT)  # at pixel index + WINDOW
    whole = mine[: len(strips) * STRIP].reshape(len(strips), STRIP, -1).all(axis=1)
    inside = np.cumsum(~whole, axis=1) == 0  # from the lower border up without a gap
    rows = np.arange(step.shape[1]) + WINDOW
    allowed = inside[:, 2 * WINDOW - 1 :] & (rows < highest[STRIP // 2 :: STRIP][: len(strips), None])
    step = np.where(allowed, step, 0.0)
    best = step.argmax(axis=1)
    found = step[np.arange(len(step)), best] > LEAST_STEP
    foot = np.where(found, best + WINDOW, -1)
    foot = np.where(_wide(foot, _nav.agreed(foot, found, SEARCH, AGREE_PX)), foot, -1)
    strip = np.minimum(np.arange(len(mine)) // STRIP, len(strips) - 1)
    return foot[strip]


def _wide(foot: np.ndarray, found: np.ndarray) -> np.ndarray:
    """Those found that make one line with more others than a shadow has."""
    joined = found[1:] & found[:-1] & (np.abs(np.diff(foot)) <= 2 * AGREE_PX)
    group = np.concatenate([[0], np.cumsum(~joined)])
    return found & (np.bincount(group)[group] > WIDEST_SHADOW)
