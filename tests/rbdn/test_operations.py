"""The net's operations in any order, each followed by a look from outside the engine."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from invariants import assert_sound
from scenes import random_scene

from host.rbdn import Net, NetConfig, _core

OPERATIONS = st.tuples(st.sampled_from(list(_core.Step)), st.integers(0, 10_000))


@pytest.mark.parametrize("mode", ["ours", "paper"])
@settings(max_examples=40, deadline=None)
@given(scene=st.integers(0, 10_000), operations=st.lists(OPERATIONS, min_size=1, max_size=15))
def test_any_operations_on_any_image_leave_a_sound_net(mode, scene, operations):
    net = Net(NetConfig(mode=mode, square_px=8, min_area_px=40))
    image = np.ascontiguousarray(random_scene(scene)[::2, ::2])
    for step, seed in operations:
        net._core.step(step, seed, image)
        assert_sound(net)
