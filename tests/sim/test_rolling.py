"""The simulated robot without a camera: its URI, and that board and body keep step."""

from __future__ import annotations

import math

import pytest

from host.errors import UsageError
from host.link.robot import Robot
from host.sim.rolling import OPTIONS, is_simulated, open_rolling, parse_uri


def test_a_plain_uri_is_the_ordinary_body() -> None:
    avr, seed, model = parse_uri("sim:")
    assert (avr, seed) == (False, 0)
    assert (model.left_wheel, model.right_wheel, model.true_track, model.mismatch) == (1.0, 1.0, 1.0, 0.03)


def test_every_option_reaches_the_body() -> None:
    body = "motors=-15&wheels=3&size=1&track=4&edges=10"
    uri = f"avr:?seed=7&{body}&speed=60&lag_ms=90&dead_zone=12&battery_mv=6800"
    avr, seed, model = parse_uri(uri)
    assert (avr, seed) == (True, 7)
    assert model.left_wheel / model.right_wheel == pytest.approx(1.015 / 0.985)
    assert (model.left_wheel + model.right_wheel) / 2 == pytest.approx(1.01)
    assert (model.true_track, model.mismatch, model.phase_error) == pytest.approx((1.04, -0.15, 0.10))
    assert (model.full_speed_cm_s, model.lag_s, model.dead_zone) == pytest.approx((60, 0.09, 0.12))
    assert model.battery_mv == 6800
    assert uri.count("=") == len(OPTIONS)


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("simulated", "write sim: or avr:"),
        ("sim:room?seed=1", "write sim: or avr:"),
        ("/dev/ttyACM0", "write sim: or avr:"),
        ("sim:?sead=1", "no option 'sead'; known are seed, motors"),
        ("sim:?seed=1&seed=2", "seed is given twice"),
        ("sim:?seed=1.5", "seed must be a whole number from 0"),
        ("sim:?track=x", "track must be a number from -20 to 20, not 'x'"),
        ("sim:?track=nan", "track must be a number"),
        ("sim:?dead_zone=90", "dead_zone must be a number from 0 to 60"),
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
