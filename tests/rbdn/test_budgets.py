"""Budgets bound what the worst pictures cost, say when they act, and leave a sound net."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from invariants import assert_sound
from scenes import add_noise, random_scene

from host.rbdn import Net, NetConfig

WIDTH, HEIGHT = 640, 480
MOST = 150


def noise(k: int) -> np.ndarray:
    return np.random.default_rng(k).integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.uint8)


def checkerboard(k: int) -> np.ndarray:
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    light = ((x + 3 * k) // 20 + y // 20) % 2 == 0
    return add_noise(np.where(light[..., None], (40, 40, 200), (60, 170, 60)), 3, k)


def foliage(k: int) -> np.ndarray:
    """Some thousand overlapping leaves that drift by four pixels a frame."""
    rng = np.random.default_rng(7)
    image = np.full((HEIGHT, WIDTH, 3), (30, 60, 40), np.uint8)
    for _ in range(6000):
        x, y = (int(v) for v in rng.integers(0, (WIDTH + 80, HEIGHT)))
        axes = int(rng.integers(4, 14)), int(rng.integers(2, 6))
        colour = tuple(int(v) for v in np.clip(rng.normal((50, 130, 70), (25, 45, 35)), 0, 255))
        cv2.ellipse(image, (x - 4 * k, y), axes, rng.uniform(0, 180), 0, 360, colour, -1, cv2.LINE_AA)
    return image


WORST = [noise, checkerboard, foliage]
Scene = Callable[[int], np.ndarray]


@pytest.mark.parametrize("scene", WORST)
def test_no_picture_makes_more_polygons_than_the_budget(scene: Scene):
    net, said = Net(NetConfig(max_polygons=MOST)), []
    for k in range(3):
        snapshot = net.track(scene(k))
        assert len(net.faces()["means"]) <= MOST
        assert_sound(net)
        said += snapshot.limits
    acted = f"polygons merged further, to keep to {MOST}" in said
    assert acted == (len(Net().track(scene(0)).regions) > MOST)


@pytest.mark.parametrize("scene", WORST)
def test_the_time_budget_stops_early_says_so_and_leaves_a_sound_net(scene: Scene):
    net = Net(NetConfig(max_ms=0.01))  # less than any frame takes on any machine
    for k in range(3):
        snapshot = net.track(scene(k))
        assert snapshot.limits == ("fitting stopped after 0.01 ms",)
        assert_sound(net)


def test_a_short_time_budget_leaves_cycles_out():
    bounded, free = Net(NetConfig(max_ms=0.01)), Net()
    assert bounded.track(foliage(0)).cycles < free.track(foliage(0)).cycles


def test_what_time_did_not_allow_is_made_up_for_later():
    still = random_scene(5, (240, 320))
    whole = sorted(region.area_px for region in Net().track(still).regions)
    net = Net(NetConfig(max_ms=3))
    for _ in range(500):  # on a busy machine many a frame gets no more than one cycle
        found = sorted(region.area_px for region in net.track(still).regions)
        if found[-2:] == pytest.approx(whole[-2:], rel=0.05):
            return
    raise AssertionError(f"{found} is still not {whole}")


def test_the_things_that_stand_out_survive_the_polygon_budget():
    image = random_scene(5, (240, 320))
    cv2.rectangle(image, (120, 80), (200, 160), (0, 0, 255), -1)
    snapshot = Net(NetConfig(max_polygons=2)).track(image)
    assert snapshot.limits
    assert min(abs(region.area_px - 81 * 81) for region in snapshot.regions) < 200


def test_ordinary_pictures_do_not_feel_a_budget():
    config = NetConfig(max_polygons=300, max_ms=1e5)
    bound, free = Net(config), Net()
    for k in range(3):
        a, b = bound.track(random_scene(k)), free.track(random_scene(k))
        assert a.limits == b.limits == ()
        assert a.contour.xy_px.tobytes() == b.contour.xy_px.tobytes()
