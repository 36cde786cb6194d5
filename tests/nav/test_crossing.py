"""Where a line is crossed: where there is room behind it."""

from __future__ import annotations

import numpy as np
import pytest

from host.nav.config import BodyConfig, NavConfig
from host.nav.crossing import Place, best_crossing
from host.nav.mover import Mover, Sight
from host.nav.yielding import Course, judge, leads_into_a_line

LINE_Z = 100.0
SIGHTS = tuple(Sight(0.1 * k, 2.0 * k - 60.0, LINE_Z, (0.0, 1.0), LINE_Z) for k in range(61))
MOVER = Mover(
    7, 6.0, (0.0, LINE_Z), (1.0, 0.0), 0.0, 15.0, 8.0, SIGHTS, (0.0, -60.0),
    seen=60, low_cm=-60.0, high_cm=60.0,
)  # fmt: skip


def crossed_at(wall_z: float, gap: tuple[float, float]) -> float | None:
    """x of the crossing, with a wall behind the line that leaves the robot's middle a gap."""

    def is_open(start: Place, end: Place) -> bool:
        return end[1] < wall_z or gap[0] < end[0] < gap[1]

    found = best_crossing(MOVER, (0.0, 30.0), BodyConfig(), NavConfig(), is_open)
    return None if found is None else found.end[0]


def test_it_is_crossed_where_there_is_room_to_spare_behind_it():
    """What stands there was nearer than it seemed: the robot stood in the line with room neither way."""
    end_z = LINE_Z + 8.0 + 12.0 + 4.0 + 10.0
    x = crossed_at(end_z + 5.0, (-120.0, -60.0))
    assert x is not None and -120.0 < x < -60.0


def test_where_there_is_little_room_everywhere_it_is_crossed_with_little():
    end_z = LINE_Z + 8.0 + 12.0 + 4.0 + 10.0
    assert crossed_at(end_z + 5.0, (0.0, 0.0)) is not None
    assert crossed_at(end_z - 5.0, (0.0, 0.0)) is None


@pytest.mark.parametrize(("room_cm", "goes"), [(70.0, True), (40.0, False)])
def test_who_would_be_held_up_in_its_line_does_not_set_out(room_cm, goes):
    """Though nothing comes by for as long as anybody looks ahead."""
    away = Mover(
        7, 6.0, (400.0, LINE_Z), (1.0, 0.0), 0.0, 15.0, 8.0,
        tuple(Sight(one.t_s, one.x_cm + 400.0, one.z_cm, one.ray, one.away_cm) for one in SIGHTS),
        (0.0, 340.0), seen=60, low_cm=-460.0, high_cm=60.0,
    )  # fmt: skip
    course = Course((0.0, 60.0), 0.0, 0.0, ((0.0, 200.0),), room_cm, room_cm, 20.0)
    verdict = judge([away], course, BodyConfig(), NavConfig(), 6.0)
    assert (verdict is None) == goes
    if verdict is not None:
        assert verdict.leave == 0 and verdict.room_cm < 20.0


@pytest.mark.parametrize(("heading_deg", "shut"), [(0.0, True), (180.0, False)])
def test_who_looks_anew_after_slipping_does_not_step_back_into_a_line(heading_deg, shut):
    """It had just crossed it, and went back into what came."""
    here = (0.0, LINE_Z + 8.0 + 12.0 + 5.0)
    assert leads_into_a_line([MOVER], here, np.radians(heading_deg), 20.0, 12.0) == shut
    assert not leads_into_a_line([], here, np.radians(heading_deg), 20.0, 12.0)
