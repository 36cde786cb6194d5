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


def watched(unseen_s: float, stood_s: float = 3.0) -> float:
    """How fast who has stood for so long with nothing leading across turns, in rad/s."""
    obstacle_map = ObstacleMap(BodyConfig(), NavConfig())
    obstacle_map.evidence[:] = -4.0
    obstacle_map.evidence[np.abs(obstacle_map.centres_cm - LINE_Z - 10.0) < 8.0] = 4.0  # a wall behind its line
    sights = tuple(Sight(0.1 * k, 2.0 * k - 20.0, LINE_Z, (0.0, 1.0), LINE_Z) for k in range(21))
    mover = Mover(7, 2.0, (0.0, LINE_Z), (1.0, 0.0), 20.0, 20.0, 8.0, sights, (0.0, -20.0), seen=20)
    obstacle_map.movers = [mover]
    held = Held(None, Verdict(mover, 0.0), back_cm=0.0)
    t_s = 2.0 + unseen_s
    _, plan = cross_over(Plan(), held, obstacle_map, t_s - stood_s, HERE, -ASIDE_RAD)
    command, _ = cross_over(plan, held, obstacle_map, t_s, HERE, -ASIDE_RAD)
    assert command is not None and command.v_mm_s == 0.0
    return command.omega_rad_s


def test_out_of_view_it_is_looked_for_though_nothing_leads_across_its_line():
    """The robot stood turned away until it forgot, drove on, and was run into."""
    assert watched(unseen_s=3.0) > 0.1


def test_as_long_as_it_is_seen_the_robot_stands_still():
    assert watched(unseen_s=0.5) == pytest.approx(0.0)


def test_where_its_way_opened_a_moment_ago_the_robot_does_not_turn_away_from_it():
    """It turned to and fro between its way and the line for 15 s, and saw in no picture what came by."""
    assert watched(unseen_s=10.0, stood_s=0.5) == pytest.approx(0.0)


def test_who_may_go_on_has_not_stood():
    obstacle_map = ObstacleMap(BodyConfig(), NavConfig())
    _, plan = cross_over(Plan(shut_s=1.0), Held(None), obstacle_map, 9.0, HERE, 0.0)
    assert plan.shut_s is None
