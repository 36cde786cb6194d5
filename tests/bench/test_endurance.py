"""The hour's drive: where it goes to and fro."""

from __future__ import annotations

import math

import pytest

from bench.endurance import to_and_fro
from host.nav.result import DriveLog
from host.pose import Pose


def went(*places: tuple[float, float, float]) -> DriveLog:
    """A drive past places (x, z, heading), the last of which is where it ended."""
    log = DriveLog()
    for k, (x, z, heading) in enumerate(places):
        pose = Pose.planar(x, z, heading, t_s=float(k))
        log.be_at(pose, pose)
    return log


def test_goals_are_told_as_the_next_drive_sees_them():
    goals = to_and_fro(went((0, 0, 0), (100, 50, 0), (100, 0, math.pi / 2)), 400.0)
    assert len(goals) == 20 and goals[1] == (0.0, 0.0)
    assert goals[0] == pytest.approx((0.0, -100.0))


def test_no_goal_lies_off_the_next_drives_map():
    """It reaches as far to all sides of where that begins, which may be the far end of the last one."""
    goals = to_and_fro(went((0, -150, 0), (0, 0, 0), (0, 340, 0)), 400.0)
    assert goals[0] == pytest.approx((0.0, -340.0))
