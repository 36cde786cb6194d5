"""The verdict: each rule alone, and that a healthy line gets none of them."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from host.link.bench.verdict import Grade, bit_error_rate, judge, one_in, quantile
from host.link.bench.witness import Evidence

HEALTHY = Evidence(
    seconds=60.0, sent=3000, bits_to_robot=400_000, bits_to_host=2_700_000,
    host={"frames": 6300}, robot={"frames": 3000}, telemetry=6000, telemetry_hz=100.0,
    rtt_ms=[1.2] * 600, pings=600, drift_ppm=2000.0, battery_mv_min=7300,
)  # fmt: skip


def test_a_healthy_line_is_healthy() -> None:
    verdict = judge(HEALTHY)
    assert verdict.text == "Healthy." and verdict.grade == Grade.HEALTHY and not verdict.findings


@pytest.mark.parametrize(
    ("evidence", "told"),
    [
        (
            replace(HEALTHY, robot={"frames": 2956, "crc": 44, "lost": 44}),
            "Bit errors on the line towards the robot (about 1 in 9,000 bits): cable or motor noise.",
        ),
        (
            replace(HEALTHY, host={"frames": 6200, "crc": 90, "framing": 10, "lost": 100}),
            "Bit errors on the line towards the host (about 1 in 27,000 bits): cable or motor noise.",
        ),
        (
            replace(
                HEALTHY,
                robot={"frames": 2956, "crc": 44, "lost": 44},
                host={"frames": 6200, "crc": 100, "lost": 100},
            ),
            "Bit errors on the line both ways (about 1 in 9,000 bits towards the robot and 1 in "
            "27,000 towards "
            "the host): cable or motor noise.",
        ),
        (
            replace(HEALTHY, robot={"frames": 2990, "crc": 10, "rx_overrun": 14, "lost": 10}),
            "Bytes are lost inside the robot: 14 came faster than its program fetched them.",
        ),
        (
            replace(HEALTHY, robot={"frames": 3000, "tx_dropped": 1200}, host={"frames": 5100, "lost": 1200}),
            "The robot left 1,200 messages unsent for want of room: it was asked for more than "
            "the line carries.",
        ),
        (
            replace(HEALTHY, host={"frames": 6200, "lost": 100}),
            "100 frames vanished whole on the way to the host: this computer was too busy to "
            "read, or the USB "
            "adapter dropped them.",
        ),
        (
            replace(HEALTHY, robot={"frames": 2999, "lost": 1}),
            "1 frame vanished whole on the way to the robot: the USB adapter, or a program "
            "between that drops "
            "them.",
        ),
        (
            replace(HEALTHY, robot={"frames": 3000, "stale": 7}),
            "7 frames came twice or out of order: something between the ends repeats them, or two "
            "programs talk "
            "at once.",
        ),
        (
            replace(HEALTHY, host={"frames": 6300, "length": 30}),
            "Messages arrive whole and are not understood: host and firmware are of different "
            "versions; flash "
            "the firmware that belongs to this program.",
        ),
        (
            replace(HEALTHY, refusals={"schema": 1}),
            "Messages arrive whole and are not understood: host and firmware are of different "
            "versions; flash "
            "the firmware that belongs to this program.",
        ),
        (
            replace(HEALTHY, rtt_ms=[2.0] * 500 + [40.0] * 100),
            "Round trips are uneven (half within 2.0 ms, 99 % within 40.0 ms): USB hub or busy host.",
        ),
        (
            replace(HEALTHY, rtt_ms=[30.0] * 300 + [80.0] * 300),
            "Round trips are slow and uneven (half within 30.0 ms, 99 % within 80.0 ms): USB hub "
            "or busy host.",
        ),
        (
            replace(HEALTHY, rtt_ms=[32.0] * 600),
            "Round trips are slow (half within 32.0 ms, 99 % within 32.0 ms): the latency timer "
            "of a USB adapter, "
            "16 ms in some.",
        ),
        (
            replace(HEALTHY, telemetry_hz=80.0),
            "The robot reports 80 times a second instead of 100: its program is overloaded.",
        ),
        (
            replace(HEALTHY, longest_silence_s=1.5),
            "Silence of 1.50 s: a loose plug, or this computer was asleep.",
        ),
        (
            replace(HEALTHY, drift_ppm=-25_000.0),
            "The robot's clock is 2.5 % off, more than any resonator: another crystal than the "
            "firmware was built "
            "for.",
        ),
        (
            replace(HEALTHY, restarts=["brown out", "brown out"]),
            "The robot restarted twice: its supply dipped: battery or regulator.",
        ),
        (
            replace(HEALTHY, restarts=["watchdog"]),
            "The robot restarted once: its program hung and the watchdog ended it: a fault of the firmware.",
        ),
        (replace(HEALTHY, faults={"link lost": 3}), "The robot stopped itself 3 times: link lost."),
        (
            replace(HEALTHY, violations=["a wheel was driven 0.400 s after the last command"]),
            "Unsafe: a wheel was driven 0.400 s after the last command.",
        ),
        (
            Evidence(seconds=3.0, sent=60, bits_to_robot=5000),
            "Nothing was heard: the robot has no power, this is not its port, or its firmware is "
            "not flashed.",
        ),
        (
            Evidence(seconds=3.0, sent=60, bits_to_robot=5000, bits_to_host=9000, host={"framing": 80}),
            "Bytes come from the robot, but no frame among them is whole: another baud rate, "
            "another program on "
            "the board, or a line full of noise.",
        ),
    ],
)
def test_each_illness_is_named_and_nothing_else(evidence: Evidence, told: str) -> None:
    assert judge(evidence).text == told


def test_the_worst_comes_first() -> None:
    ill = replace(HEALTHY, faults={"stall": 1}, restarts=["power on"], violations=["it ran away"])
    grades = [finding.grade for finding in judge(ill).findings]
    assert grades == [Grade.UNSAFE, Grade.FAULTY, Grade.NOTE]


@given(rate=st.floats(1e-7, 1e-3), bits=st.integers(60, 450))
def test_the_bit_error_rate_is_found_again_from_broken_frames(rate: float, bits: int) -> None:
    frames = 10_000_000
    broken = round(frames * (1 - (1 - rate) ** bits))
    if broken >= 1000:
        assert bit_error_rate(broken, frames, frames * bits) == pytest.approx(rate, rel=0.01)


def test_a_line_on_which_all_is_broken_has_a_finite_rate() -> None:
    assert 0 < bit_error_rate(50, 50, 50 * 100) < 1
    assert bit_error_rate(0, 50, 5000) == bit_error_rate(0, 0, 0) == 0.0


@pytest.mark.parametrize(
    ("rate", "told"),
    [(1 / 9123, "1 in 9,100"), (1e-6, "1 in 1,000,000"), (0.5, "1 in 2"), (1 / 37.6, "1 in 38")],
)
def test_rates_are_told_to_two_digits(rate: float, told: str) -> None:
    assert one_in(rate) == told


def test_quantiles_are_numbers_of_the_list() -> None:
    assert [quantile([1.0, 2.0, 3.0, 4.0], share) for share in (0.0, 0.25, 0.5, 0.99, 1.0)] == [1, 1, 2, 4, 4]
