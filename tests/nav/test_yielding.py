"""Whatever crosses, however fast and far: the robot gets to its goal and touches nothing that it knew of."""

from __future__ import annotations

import pytest
from crossing_world import CrossingWorld

SEEDS = (200, 408, 411, 448)  # the last three were touched once


@pytest.mark.parametrize("rough", [False, True])
@pytest.mark.parametrize("corridor", [False, True])
def test_nothing_that_goes_to_and_fro_across_the_way_is_touched_and_the_goal_is_reached(corridor, rough):
    outcomes = {seed: CrossingWorld(seed, corridor, rough).drive() for seed in SEEDS}
    touched = [k for k, o in outcomes.items() if o.touched_driving or o.touched_standing]
    late = [k for k, o in outcomes.items() if not o.arrived]
    assert touched == [] and late == []
    assert min(o.least_gap_cm for o in outcomes.values()) > 1.0
