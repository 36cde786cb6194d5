"""However a robot loses its host: it brakes by 200 ms after the last command it obeyed, and stands by 400 ms.

How long a robot takes to stand is up to its motors, once they are shorted: here they have a time constant of
up to 70 ms, and no less friction than 6 % of full duty. From 60 cm/s one of 90 ms and 5 % would take 0.27 s.

Fifty seeds of every fault on the board compiled for this machine, two of those fifty on the real processor,
where they take longer; ``LINE_FAULT_SEEDS=50`` in the environment for as many on both.
"""

from __future__ import annotations

import os
import random

import pytest
from board_bench import Bench, MakeBoard, Wheel
from line_faults import BYTE_US, FAULTS, Lost

from host.link.protocol import KeepAlive, Move, State
from host.sim.board import Board

SEEDS, ELF_SEEDS = 50, 2
ASKED = os.environ.get("LINE_FAULT_SEEDS")
BRAKES_BY_US = 200_000
STANDS_BY_US = 400_000
WATCHED_US = 900_000
OFF = (0.0, 0.0)


def test_there_are_at_least_twenty_faults() -> None:
    assert len(FAULTS) >= 20


def drive_about(bench: Bench, rng: random.Random, moving: bool, boot_nonce: int) -> tuple[list[bytes], int]:
    """Some driving, or a move in its middle; the frames sent, and when the last command had arrived."""
    sent = []
    v_mm_s = rng.choice((-1, 1)) * rng.randint(150, 600)
    for count in range(rng.randint(3, 15)):
        if not moving:
            message = bench.drive(v_mm_s, rng.randint(-1000, 1000))
        elif count == 0:
            until_us = bench.drive(0).expires_us
            message = Move(boot_nonce, 1, 5000 if v_mm_s > 0 else -5000, abs(v_mm_s), until_us)
        else:
            message = KeepAlive(bench.drive(0).expires_us)
        sent.append(bench.frame(message))
        bench.board.write(sent[-1])
        arrived_us = bench.board.time_us + BYTE_US * len(sent[-1])
        bench.run_ms(rng.randint(10, 60))
    return sent, arrived_us


def seeds_for(name: str, real: bool) -> list[int]:
    """Which to try; few are other ones for every fault."""
    every = list(range(int(ASKED or SEEDS)))
    return every if ASKED or not real else random.Random(name).sample(every, ELF_SEEDS)


@pytest.mark.parametrize("name", FAULTS)
def test_the_robot_brakes_by_200_ms_and_stands_by_400_ms(make_board: MakeBoard, name: str) -> None:
    worst_brake_us = worst_stand_us = 0
    for seed in seeds_for(name, real=make_board is not Board):
        rng = random.Random(f"{name} {seed}")
        wheels = [
            Wheel(700 * rng.uniform(0.85, 1.15), rng.uniform(0.06, 0.15), rng.uniform(0.03, 0.07))
            for _ in range(2)
        ]
        bench = Bench(make_board(seed), (wheels[0], wheels[1]))
        bench.run_ms(50)
        nonce = bench.open_session().boot_nonce
        sent, arrived_us = drive_about(bench, rng, seed % 2 == 1, nonce)
        assert any(bench.duties)

        lost = Lost(rng, bench.seq, sent, bench.board.time_us, nonce, request=1)
        chunks = FAULTS[name](lost)
        pause_us, data = next(chunks, (WATCHED_US * 2, b""))
        due_us = bench.board.time_us + pause_us
        running_us = moving_us = arrived_us
        while bench.board.time_us < arrived_us + WATCHED_US:
            while due_us <= bench.board.time_us:
                bench.board.write(data)
                pause_us, data = next(chunks, (WATCHED_US * 2, b""))
                due_us += pause_us
            bench.run_ms(1)
            if bench.duties != OFF:
                running_us = bench.board.time_us
            if any(wheel.speed_mm_s for wheel in bench.wheels):
                moving_us = bench.board.time_us
        assert running_us - arrived_us <= BRAKES_BY_US, f"seed {seed}"
        assert moving_us - arrived_us <= STANDS_BY_US, f"seed {seed}"
        assert bench.hear_telemetry().state not in (State.DRIVING, State.MOVING)
        worst_brake_us = max(worst_brake_us, running_us - arrived_us)
        worst_stand_us = max(worst_stand_us, moving_us - arrived_us)
    print(f"{name}: off after {worst_brake_us / 1000:.0f} ms, still after {worst_stand_us / 1000:.0f} ms")
