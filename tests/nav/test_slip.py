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
