"""Wheels that slip, told by points of known depth: nothing from one look that takes them for others."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from host.camera.lens import Lens
from host.nav.slip import WheelWatch
from host.pose import Pose

LENS = Lens(320, 240, 280.0, 280.0, 159.5, 119.5)
EVERY_S, EVERY_CM = 0.1, 2.0
POINTS = np.array([[x, y, 100.0] for x in (-40.0, -25.0, 25.0, 40.0) for y in (-25.0, -10.0, 10.0)])


def look(k: int, at_cm: float, aside_cm: float = 0.0, every_cm: float = EVERY_CM) -> SimpleNamespace:
    """The k-th picture, after so many steps by the wheels, as it is seen from `at_cm` further on."""
    seen = POINTS - (aside_cm, 0.0, at_cm)
    pixels = seen[:, :2] / seen[:, 2:] * (LENS.fx, LENS.fy) + (LENS.cx, LENS.cy)
    count = len(POINTS)
    known = POINTS - (0.0, 0.0, every_cm * k)
    return SimpleNamespace(
        frame=SimpleNamespace(image=np.full((240, 320, 3), 90, np.uint8)),
        moving=(),
        snapshot=SimpleNamespace(
            vertices=SimpleNamespace(ids=np.arange(count), xy_px=pixels, sigma_px=np.full(count, 0.1)),
            regions=[],
            contour=SimpleNamespace(xy_px=pixels),
        ),
        depths=SimpleNamespace(
            vertices=SimpleNamespace(xyz_cm=known, sigma_cm=np.full(count, 1.0)), regions={}
        ),
        dead_reckoning=Pose.planar(0.0, every_cm * k, 0.0, t_s=EVERY_S * k),
    )


@pytest.mark.parametrize(("standing", "found"), [(range(7, 8), False), (range(7, 20), True)])
def test_one_look_in_which_points_did_not_move_is_no_slip_and_many_are(standing, found):
    watch = WheelWatch(LENS)
    stood_cm = EVERY_CM * (standing[0] - 3)
    said = [watch.doubt(look(k, stood_cm if k in standing else EVERY_CM * k)) for k in range(12)]
    assert any("wheels slip" in why for why in said if why) == found
    assert all(why is None or k > standing[0] for k, why in enumerate(said))


@pytest.mark.parametrize("pushed_at", range(12, 36))
def test_a_push_is_noticed_in_whichever_picture_it_comes(pushed_at):
    """Also in that from which on the watch looks back at another one."""
    watch = WheelWatch(LENS)
    looks = [look(k, 0.0, aside_cm=15.0 * (k >= pushed_at), every_cm=0.0) for k in range(pushed_at + 1)]
    said = [watch.doubt(one) for one in looks]
    assert said[:-1] == [None] * pushed_at
    assert "otherwise than the wheels" in said[-1]


def test_wheels_that_slip_at_a_creep_are_found_out_though_hardly_a_pixel_of_way_is_due():
    watch, creep_cm = WheelWatch(LENS), 0.4  # every 0.1 s; the points are a metre away
    slips_at = 24
    looks = [look(k, creep_cm * min(k, slips_at), every_cm=creep_cm) for k in range(slips_at + 16)]
    said = [watch.doubt(one) for one in looks]
    assert said[: slips_at + 3] == [None] * (slips_at + 3)
    assert any(why is not None and "wheels slip" in why for why in said)


@pytest.mark.parametrize("depths_off", [0.5, 0.7, 1.5])
def test_depths_that_are_far_off_make_no_slip_of_a_creep(depths_off):
    watch, creep_cm = WheelWatch(LENS), 0.4
    for k in range(40):
        one = look(k, creep_cm * k, every_cm=creep_cm)
        one.depths.vertices.xyz_cm = depths_off * one.depths.vertices.xyz_cm
        assert watch.doubt(one) is None


def test_wheels_three_percent_apart_do_not_slip():
    """The robot goes on a curve that its wheels know nothing of: points on one side stay where they were."""
    watch = WheelWatch(LENS)
    points = np.array([[x, y, 150.0] for x in (24.0, 27.0, 30.0) for y in (-4.0, 0.0, 4.0)])
    for k in range(30):
        one, way_cm = look(k, 0.0), EVERY_CM * k
        heading = 0.03 / 15.0 * way_cm  # the track is 15 cm
        c, s = np.cos(heading), np.sin(heading)
        x, y, z = (points - (0.0, 0.0, way_cm)).T
        ahead = s * x + c * z
        aside_px, down_px = LENS.fx * (c * x - s * z) / ahead, LENS.fy * y / ahead
        one.snapshot.vertices = SimpleNamespace(
            ids=np.arange(len(points)),
            xy_px=np.column_stack([aside_px + LENS.cx, down_px + LENS.cy]),
            sigma_px=np.full(len(points), 0.1),
        )
        known = SimpleNamespace(xyz_cm=np.column_stack([x, y, z]), sigma_cm=np.full(len(points), 1.0))
        one.depths.vertices = known
        assert watch.doubt(one) is None, k


@pytest.mark.parametrize(("bright", "found"), [(90, False), (140, True)], ids=["they flicker", "all is new"])
def test_points_that_are_lost_while_the_picture_changes_tell_another_place(bright, found):
    watch, said = WheelWatch(LENS), []
    for k in range(10):
        one = look(k, EVERY_CM * k)
        lost = k >= 5
        one.snapshot.vertices.ids = np.arange(len(POINTS)) + 100 * k * lost
        if lost and k % 2:
            one.frame.image[:, :80] = bright
        said.append(watch.doubt(one))
    assert any("another place" in why for why in said if why) == found
    assert not any(said[:6])
