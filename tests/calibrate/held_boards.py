"""Pictures of a board through a lens that the tests know."""

from __future__ import annotations

from functools import cache

import numpy as np

from host.calibrate.board import Board, Sighting
from host.camera.lens import Lens
from host.sim.board_views import BoardCamera, drawn_lens, good_views, held_at

LENS = drawn_lens(7)
SMALL = drawn_lens(7, 320, 240)


@cache
def camera(lens: Lens = LENS) -> BoardCamera:
    """The webcam."""
    return BoardCamera(lens, Board(), seed=7)


@cache
def sightings(count: int) -> tuple[Sighting, ...]:
    """What is found in them."""
    found = [Board().find(picture) for picture in pictures(count)]
    return tuple(one for one in found if one is not None)


@cache
def pictures(count: int) -> tuple[np.ndarray, ...]:
    """A careful person's views, rendered once."""
    views = good_views(count, 7)
    return tuple(camera().take(*held_at(LENS, Board(), *view), seq=k) for k, view in enumerate(views))
