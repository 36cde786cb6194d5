"""A displacement told in advance carries regions across jumps that the forces could not follow."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from invariants import assert_sound
from scenes import add_noise, compose, random_scene, rectangle_coverage

from host.camera.lens import Lens
from host.errors import InputError
from host.rbdn import Net, Region, Snapshot

SHAPE = (120, 320)
WALL, RED, GREEN = (200, 205, 210), (40, 40, 190), (60, 150, 60)
JUMP_PX = 30.0


def scene(*things: tuple[float, float, tuple[int, int, int]], seed: int = 0) -> np.ndarray:
    """Boxes of 24 x 50 px, by their upper left corners and colours, on a wall."""
    drawn = [(rectangle_coverage(SHAPE, (x, y, x + 24, y + 50), 0.7), colour) for x, y, colour in things]
    return add_noise(compose(SHAPE, WALL, drawn), 3, seed)


def thing(snapshot: Snapshot, bgr: tuple[int, int, int]) -> Region:
    rgb = np.array(bgr[::-1])
    return min(snapshot.regions, key=lambda region: float(np.linalg.norm(region.mean_rgb - rgb)))


@pytest.mark.parametrize("told", [False, True])
def test_a_thing_that_moves_thirty_pixels_a_frame_is_lost_without_and_followed_with_it(told):
    net = Net()
    ids, vertices = [], []
    for k in range(9):
        known = {ids[-1]: (JUMP_PX + 2 * (-1) ** k, 1.0)} if told and ids else None
        snapshot = net.track(scene((5 + JUMP_PX * k, 30, RED), seed=k), displacement=known)
        red = thing(snapshot, RED)
        assert red.area_px == pytest.approx(1200, abs=30)
        ids.append(red.id)
        vertices.append(set(red.loop_vertices[0].tolist()))
        assert_sound(net)
    if told:
        assert set(ids) == {ids[0]}
        assert len(set.intersection(*vertices)) >= 3, "most corners keep their ids as well"
    else:
        assert len(set(ids)) > 5


def test_it_is_used_on_top_of_a_rotation():
    lens = Lens(320, 120, 360.0, 360.0, 159.5, 59.5)
    net = Net(lens=lens)
    before = thing(net.track(scene((60, 30, RED), (200, 30, GREEN))), RED)
    angle = np.arctan(40 / 360)
    turn = np.array([[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]])
    snapshot = net.track(scene((130, 30, RED), (240, 30, GREEN), seed=1), turn, {before.id: (JUMP_PX, 0)})
    assert thing(snapshot, RED).id == before.id
    assert snapshot.events == ()
    assert_sound(net)


def test_a_thing_put_into_another_goes_only_as_far_as_it_can():
    net = Net()
    first = net.track(scene((40, 30, RED), (120, 30, GREEN)))
    red, green = thing(first, RED), thing(first, GREEN)
    second = net.track(scene((70, 30, RED), (120, 30, GREEN), seed=1), displacement={red.id: (70.0, 0.0)})
    assert (thing(second, RED).id, thing(second, GREEN).id) == (red.id, green.id)
    assert_sound(net)


def test_an_outline_goes_with_the_region_that_moves_more():
    net = Net()
    first = net.track(scene((100, 30, RED)))
    red, wall = thing(first, RED).id, thing(first, WALL).id
    moves = {wall: (4.0, 0.0), red: (JUMP_PX, 0.0)}
    second = net.track(scene((100 + JUMP_PX, 30, RED), seed=1), displacement=moves)
    assert thing(second, RED).id == red and second.events == ()


def test_a_region_that_is_no_more_may_be_named():
    net = Net()
    net.track(scene((100, 30, RED)))
    assert len(net.track(scene((100, 30, RED), seed=1), displacement={77: (5.0, 0.0)}).regions) == 2


def test_before_the_first_image_there_is_nothing_to_displace():
    assert len(Net().track(scene((100, 30, RED)), displacement={0: (5.0, 0.0)}).regions) == 2


def test_a_displacement_that_is_no_number_is_refused_by_region():
    net = Net()
    red = thing(net.track(scene((100, 30, RED))), RED).id
    with pytest.raises(InputError, match=f"displacement of region {red}"):
        net.track(scene((100, 30, RED)), displacement={red: (float("nan"), 0.0)})


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 50),
    moves=st.lists(st.tuples(st.floats(-500, 500), st.floats(-500, 500)), min_size=1, max_size=8),
)
def test_no_displacement_tears_the_net(seed, moves):
    net = Net()
    first = net.track(random_scene(seed))
    told = dict(zip((region.id for region in first.regions), moves, strict=False))
    net.track(random_scene(seed + 1), displacement=told)
    assert_sound(net)
    net.track(random_scene(seed), displacement=dict.fromkeys(range(30), moves[0]))
    assert_sound(net)
