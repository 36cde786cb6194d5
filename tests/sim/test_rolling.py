"""The simulated robot without a camera: its URI, and that board and body keep step."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from host.errors import UsageError
from host.link.robot import Robot
from host.sim.kinds import is_simulated
from host.sim.rolling import OPTIONS, open_rolling, parse_uri


def test_a_plain_uri_is_the_ordinary_body() -> None:
    avr, seed, model = parse_uri("sim:")
    assert (avr, seed) == (False, 0)
    assert (model.left_wheel, model.right_wheel, model.true_track, model.mismatch) == (1.0, 1.0, 1.0, 0.03)


def test_every_option_reaches_the_body() -> None:
    body = "rough=0&motors=-15&wheels=3&size=1&track=4&edges=10&slip=0"
    camera = "nod=3&tip=-2&aside=1&raised=4"
    uri = f"avr:?seed=7&{body}&speed=60&lag_ms=90&dead_zone=12&battery_mv=6800&{camera}"
    avr, seed, model = parse_uri(uri)
    assert (avr, seed) == (True, 7)
    assert model.left_wheel / model.right_wheel == pytest.approx(1.015 / 0.985)
    assert (model.left_wheel + model.right_wheel) / 2 == pytest.approx(1.01)
    assert (model.true_track, model.mismatch, model.phase_error) == pytest.approx((1.04, -0.15, 0.10))
    assert (model.full_speed_cm_s, model.lag_s, model.dead_zone) == pytest.approx((60, 0.09, 0.12))
    assert model.battery_mv == 6800
    tilts = [math.degrees(rad) for rad in (model.nod_rad, model.tip_rad, model.aside_rad)]
    assert [*tilts, model.raised_cm] == pytest.approx([3, -2, 1, 4])
    assert uri.count("=") == len(OPTIONS)


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("simulated", "write sim: or avr:"),
        ("sim:room?seed=1", "write sim: or avr:"),
        ("/dev/ttyACM0", "write sim: or avr:"),
        ("sim:?sead=1", "no option 'sead'; known are seed, rough, motors"),
        ("sim:?seed=1&seed=2", "seed is given twice"),
        ("sim:?seed=1.5", "seed must be a whole number from 0"),
        ("sim:?track=x", "track must be a number from -20 to 20, not 'x'"),
        ("sim:?track=nan", "track must be a number"),
        ("sim:?dead_zone=90", "dead_zone must be a number from 0 to 60"),
        ("sim:?rough=0.5", "rough must be a whole number from 0 to 1"),
        ("avr:?slip=-1", "slip must be a number from 0 to 20"),
    ],
)
def test_a_uri_that_names_nothing_is_refused_in_one_line(uri: str, complaint: str) -> None:
    with pytest.raises(UsageError, match=complaint) as told:
        parse_uri(uri)
    assert "\n" not in str(told.value)


def test_ports_are_no_simulated_robots() -> None:
    assert is_simulated("sim:") and is_simulated("avr:?seed=1")
    assert not is_simulated("/dev/ttyACM0") and not is_simulated("sim")


def test_a_robot_drives_on_the_endless_floor() -> None:
    rolling = open_rolling("sim:?seed=2")
    milliseconds = []
    rolling.watchers.append(lambda: milliseconds.append(rolling.board.time_us))
    with Robot(rolling.line(), rolling.clock) as robot:
        robot.connect()
        begin_s = rolling.clock.now_s()
        x, z, _ = rolling.body.axle
        for _ in range(100):
            robot.drive(300.0, 0.0)
            rolling.clock.sleep_s(0.05)
            robot.poll()
    way_cm = math.dist((x, z), rolling.body.axle[:2])
    assert way_cm == pytest.approx(30 * (rolling.clock.now_s() - begin_s), rel=0.1)
    assert milliseconds == list(range(1000, milliseconds[-1] + 1, 1000))


def test_equal_uris_give_equal_runs() -> None:
    ends = []
    for _ in range(2):
        rolling = open_rolling("sim:?seed=5&wheels=2&edges=10")
        with Robot(rolling.line(), rolling.clock) as robot:
            robot.connect()
            for _ in range(20):
                robot.drive(200.0, 1.0)
                rolling.clock.sleep_s(0.05)
                robot.poll()
        ends.append(rolling.body.axle)
    assert ends[0] == ends[1]


# --- Poor bodies -----------------------------------------------------------------------------------


def test_a_rough_body_is_within_its_bounds_and_another_for_every_seed() -> None:
    models = [parse_uri(f"sim:?rough=1&seed={seed}")[2] for seed in range(200)]
    assert len({model.mismatch for model in models}) == 200
    for m in models:
        assert abs(m.mismatch) <= 0.15 and 0.03 <= m.lag_s <= 0.09 and 0.05 <= m.dead_zone <= 0.15
        assert 6600 <= m.battery_mv <= 8400 and 0 <= m.phase_error <= 0.1 and 0.005 <= m.slip <= 0.01
        assert abs(m.left_wheel / m.right_wheel - 1) <= 0.00501 and abs(m.true_track - 1) <= 0.005
        on_the_floor = (m.left_wheel + m.right_wheel) / 2 * (1 - m.slip)
        assert abs(on_the_floor - 1) <= 0.003
        assert m.full_speed_cm_s / m.battery_mv == pytest.approx(70 / 7400)
    assert np.ptp([m.mismatch for m in models]) > 0.28 and np.ptp([m.lag_s for m in models]) > 0.056


def test_what_a_uri_says_stands_above_what_rough_draws_and_changes_nothing_else() -> None:
    drawn = parse_uri("sim:?rough=1&seed=5")[2]
    said = parse_uri("sim:?rough=1&seed=5&lag_ms=70&motors=0")[2]
    assert (said.lag_s, said.mismatch) == pytest.approx((0.07, 0.0))
    assert replace(said, lag_s=drawn.lag_s, mismatch=drawn.mismatch) == drawn


def test_a_uri_without_a_seed_takes_the_one_it_is_given() -> None:
    assert parse_uri("sim:?rough=1", 9) == parse_uri("sim:?rough=1&seed=9")
    assert parse_uri("sim:?seed=4", 9)[1] == 4


def test_a_rough_body_drives_as_told_all_the_same_and_alike_each_time() -> None:
    ends = []
    for _ in range(2):
        rolling = open_rolling("sim:?rough=1&seed=3")
        with Robot(rolling.line(), rolling.clock) as robot:
            robot.connect()
            begin_s, z = rolling.clock.now_s(), rolling.body.axle[1]
            for _ in range(60):
                robot.drive(200.0, 0.0)
                rolling.clock.sleep_s(0.05)
                robot.poll()
        x, end_z, heading = rolling.body.axle
        assert end_z - z == pytest.approx(20 * (rolling.clock.now_s() - begin_s), rel=0.12)
        ends.append((x, end_z, heading))
    assert ends[0] == ends[1]
