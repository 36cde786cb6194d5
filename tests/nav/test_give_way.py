"""Who gives way to what it does not see turns to where that comes by."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from host.nav.config import BodyConfig, NavConfig
from host.nav.crossing import Crossing
from host.nav.give_way import Held, cross_over
from host.nav.intent import Cross, Plan
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


def crossing(z_cm: float, wall_z: float, gone_cm: float = 40.0, plan: Plan | None = None) -> Cross | None:
    """What becomes of the crossing of a line by who stands so far on, with a wall behind that."""
    obstacle_map = ObstacleMap(BodyConfig(), NavConfig())
    obstacle_map.evidence[:] = -4.0
    obstacle_map.evidence[np.abs(obstacle_map.centres_cm - wall_z) < 8.0] = 4.0
    part = gone_cm / 20
    sights = tuple(Sight(0.1 * k, part * (k - 20), LINE_Z, (0.0, 1.0), LINE_Z) for k in range(21))
    mover = Mover(7, 2.0, (0.0, LINE_Z), (1.0, 0.0), 0.0, 20.0, 8.0, sights, (0.0, -gone_cm), seen=20)
    obstacle_map.movers = [mover]
    held = Held(None, Verdict(mover, 0.0) if plan is None else None)
    _, plan = cross_over(plan or Plan(), held, obstacle_map, 2.5, (0.0, z_cm), 0.0)
    return plan.cross


ACROSS = Cross(Crossing((0.0, 6.0), (0.0, LINE_Z + 34.0), 0.0), 2.0, there=True, under_way=True)
UNDER_WAY, AT_ITS_BEGIN = Plan(cross=ACROSS), Plan(cross=replace(ACROSS, under_way=False))


@pytest.mark.parametrize(("wall_z", "goes"), [(400.0, True), (LINE_Z + 50.0, False)])
def test_nobody_sets_out_across_to_where_something_stands_by_now(wall_z, goes):
    cross = crossing(6.0, wall_z, plan=AT_ITS_BEGIN)
    assert (cross is not None and cross.under_way) == goes


@pytest.mark.parametrize(
    ("wall_z", "z_cm", "goes"), [(400.0, 40.0, True), (125.0, 40.0, False), (125.0, 60.0, True)]
)
def test_who_is_not_in_the_line_yet_gives_up_a_crossing_that_is_shut(wall_z, z_cm, goes):
    assert (crossing(z_cm, wall_z, plan=UNDER_WAY) is not None) == goes


def test_a_crossing_that_no_longer_leads_out_of_the_line_is_given_up():
    """The line was first seen for a moment, and askew: the robot went along it, and into what came."""
    short = replace(ACROSS, crossing=Crossing((0.0, 6.0), (0.0, LINE_Z), 0.0))
    assert crossing(30.0, 400.0, plan=Plan(cross=short)) is None


@pytest.mark.parametrize(("gone_cm", "crosses"), [(40.0, True), (10.0, False)])
def test_before_it_is_known_which_way_it_goes_nobody_crosses_its_line(gone_cm, crosses):
    assert (crossing(0.0, 400.0, gone_cm) is not None) == crosses
