"""Who gives way to what it does not see turns to where that comes by."""

from __future__ import annotations

import math

import numpy as np
import pytest

from host.nav.config import BodyConfig, NavConfig
from host.nav.give_way import Held, cross_over
from host.nav.intent import Plan
from host.nav.map import ObstacleMap
from host.nav.mover import Mover, Sight
from host.nav.yielding import Verdict

HERE = (0.0, 0.0)
LINE_Z = 75.0
ASIDE_RAD = math.radians(50)  # it stands turned so far from what it gives way to


def watched(unseen_s: float) -> float:
    """How fast who stands with nothing leading across turns, in rad/s."""
    obstacle_map = ObstacleMap(BodyConfig(), NavConfig())
    obstacle_map.evidence[:] = -4.0
    obstacle_map.evidence[np.abs(obstacle_map.centres_cm - LINE_Z - 10.0) < 8.0] = 4.0  # a wall behind its line
    sights = tuple(Sight(0.1 * k, 2.0 * k - 20.0, LINE_Z, (0.0, 1.0), LINE_Z) for k in range(21))
    mover = Mover(7, 2.0, (0.0, LINE_Z), (1.0, 0.0), 20.0, 20.0, 8.0, sights, (0.0, -20.0), seen=20)
    obstacle_map.movers = [mover]
    held = Held(None, Verdict(mover, 0.0), back_cm=0.0)
    command, _ = cross_over(Plan(), held, obstacle_map, 2.0 + unseen_s, HERE, -ASIDE_RAD)
    assert command is not None and command.v_mm_s == 0.0
    return command.omega_rad_s


def test_out_of_view_it_is_looked_for_though_nothing_leads_across_its_line():
    """The robot stood turned away until it forgot, drove on, and was run into."""
    assert watched(unseen_s=3.0) > 0.1


def test_as_long_as_it_is_seen_the_robot_stands_still():
    assert watched(unseen_s=0.5) == pytest.approx(0.0)
