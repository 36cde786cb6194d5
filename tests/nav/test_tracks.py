"""What moves is followed by its foot, whatever depth from the robot's own motion says of it."""

from __future__ import annotations

import pytest
from planar_world import LENS, Box, PlanarWorld

from host.depth.report import DepthReport, RegionDepth
from host.nav.config import BodyConfig, NavConfig
from host.nav.map import BRIEF, ObstacleMap
from host.nav.tracks import LONG_HELD_S
from host.pose import Pose

MOVER = 10


def watch(lefts_cm: list[float], depth: RegionDepth | None = None) -> ObstacleMap:
    """A standing robot sees a box 14 cm wide at these places, 15 times a second."""
    obstacle_map = ObstacleMap(BodyConfig(), NavConfig())
    for k, left in enumerate(lefts_cm):
        world = PlanarWorld([Box(left, 90, left + 14, 104, 30)])
        snapshot, report = world.see()
        found = report.regions if depth is None else {MOVER: depth}
        pose = Pose.planar(0, 0, 0, t_s=k / 15)
        obstacle_map.update(snapshot, DepthReport(found, report.vertices), pose, LENS)
    return obstacle_map


def test_what_moves_stands_at_its_foot_even_where_parallax_calls_it_near():
    false = RegionDepth(23.0, 1.1, "outline", None)
    mover = watch([-40 + k for k in range(20)], false).obstacles[MOVER]
    assert mover.moving
    assert mover.velocity_cm_s == pytest.approx((15.0, 0.0), abs=3.0)
    assert mover.depth_cm == pytest.approx(90.0, abs=5.0)


def test_what_stands_moves_not():
    obstacle_map = watch([-20.0] * 20)
    assert not obstacle_map.obstacles[MOVER].moving
    assert obstacle_map.movers == []


def test_where_a_mover_turned_round_is_known():
    there = [-30 + k for k in range(40)]
    (mover,) = watch([*there, *reversed(there)]).movers
    assert mover.speed_cm_s == pytest.approx(-15.0, abs=3.0)
    assert mover.high_cm is not None and mover.low_cm is None
    end = mover.origin_cm[0] + mover.high_cm * mover.ahead[0]
    assert end == pytest.approx(there[-1] + 7, abs=6.0)


@pytest.mark.parametrize(("after_s", "remains"), [(1.0, False), (LONG_HELD_S + 1.0, True)])
def test_what_got_the_name_of_a_mover_that_is_long_gone_is_not_taken_back(after_s, remains):
    """A wall below the picture had such a name: its cells went, and the robot drove into it."""
    obstacle_map = watch([-40 + k for k in range(40)])
    assert obstacle_map.movers[0].certain
    behind = obstacle_map.cell_of(0.0, -40.0)
    obstacle_map.evidence[behind], obstacle_map.region[behind] = BRIEF, MOVER
    obstacle_map.brief[behind] = True
    snapshot, report = PlanarWorld([]).see()
    obstacle_map.update(snapshot, report, Pose.planar(0, 0, 0, t_s=39 / 15 + after_s), LENS)
    assert (obstacle_map.evidence[behind] > 0.0) == remains
