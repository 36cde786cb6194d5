"""MOVE and TURN over the line, on both simulated boards, motors 15 % apart: where they truly end."""

from __future__ import annotations

import math
import random

import pytest
from board_bench import Bench, MakeBoard, Wheel

from host.link.protocol import (
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    Hello,
    HelloRequest,
    KeepAlive,
    Move,
    Outcome,
    Telemetry,
    Turn,
)

TRACK_MM = 150


def unequal_wheels(chance: random.Random) -> tuple[Wheel, Wheel]:
    """One 7.5 % better and one 7.5 % worse than the firmware believes, each somewhere in its first count."""
    better = chance.choice([-1, 1])

    def wheel(sign: int) -> Wheel:
        return Wheel(
            700 * (1 + 0.075 * sign), lag_s=chance.uniform(0.03, 0.09), position_mm=chance.uniform(0, 5)
        )

    return wheel(better), wheel(-better)


def ends(bench: Bench, turns: bool, amount: int, fastest: int) -> tuple[float, float]:
    """Way in mm and heading in degrees, true, after a request that was kept alive until it was done."""
    bench.run_ms(60)
    bench.tell(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH))
    bench.run_ms(30)
    nonce = [message for message in bench.hear() if isinstance(message, Hello)][-1].boot_nonce
    before = [wheel.position_mm for wheel in bench.wheels]
    expires_us = bench.drive(0, hold_ms=150).expires_us
    bench.tell((Turn if turns else Move)(nonce, 1, amount, fastest, expires_us))
    outcome = Outcome.NONE
    for _ in range(500):
        bench.run_ms(20)
        bench.tell(KeepAlive(bench.drive(0, hold_ms=150).expires_us))
        told = [message for message in bench.hear() if isinstance(message, Telemetry)]
        outcome = told[-1].outcome if told else outcome
        if outcome not in (Outcome.NONE, Outcome.RUNNING):
            break
    assert outcome == Outcome.DONE
    bench.run_ms(300)  # nothing turns any more
    left, right = (wheel.position_mm - mm for wheel, mm in zip(bench.wheels, before, strict=True))
    return (left + right) / 2, math.degrees((left - right) / TRACK_MM)


@pytest.mark.parametrize("distance_mm", [1000, -1000])
def test_a_metre_ends_within_5_mm_and_1_degree(make_board: MakeBoard, distance_mm: int) -> None:
    chance = random.Random(7)
    for _ in range(6):
        way_mm, heading_deg = ends(Bench(make_board(0), unequal_wheels(chance)), False, distance_mm, 300)
        print(f"MOVE {distance_mm}: {way_mm - distance_mm:+.1f} mm, {heading_deg:+.2f} degrees")
        assert abs(way_mm - distance_mm) <= 5
        assert abs(heading_deg) <= 1


@pytest.mark.parametrize("angle_mrad", [1571, -1571])
def test_a_quarter_turn_ends_within_5_mm_and_1_degree(make_board: MakeBoard, angle_mrad: int) -> None:
    chance = random.Random(8)
    for _ in range(6):
        way_mm, heading_deg = ends(Bench(make_board(0), unequal_wheels(chance)), True, angle_mrad, 2000)
        off_deg = heading_deg - math.degrees(angle_mrad / 1000)
        print(f"TURN {angle_mrad}: {way_mm:+.1f} mm, {off_deg:+.2f} degrees")
        assert abs(way_mm) <= 5
        assert abs(off_deg) <= 1
