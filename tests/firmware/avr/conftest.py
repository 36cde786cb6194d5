"""Boards here are those with the real processor."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from host.sim.avr.board import AvrBoard


@pytest.fixture(scope="session")
def make_board(make_avr_board: Callable[..., AvrBoard]) -> Callable[..., AvrBoard]:
    """Makes boards; arguments as AvrBoard's."""
    return make_avr_board
