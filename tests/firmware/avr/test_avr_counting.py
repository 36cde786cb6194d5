"""Edges as fast as they may come, a million if asked for, on a processor that has no time to spare."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from board_bench import Bench

from host.link.protocol import BAUD, Ping, Telemetry
from host.sim.avr.board import AvrBoard, Stats
from host.sim.board import Side

EDGES = int(os.environ.get("EDGES", "100000"))  # `make budget` takes a million, which take a minute
EDGE_US = 200  # 5,000 counts a second
JITTER_US = 80
FORWARD_PINS = np.array([0b00, 0b01, 0b11, 0b10])  # (b << 1) | a
RUN = 40  # counts between reversals, on average; every fortieth run is thus a single count to and fro
IMPOSSIBLE = 0.001  # share of edges that change both pins at once
PINGS = 104  # in 50 ms: 1248 bytes, of the 1250 that the line carries


@dataclass(frozen=True)
class Outcome:
    """What came of one board's edges: counts and impossible transitions of both wheels."""

    edges: int
    sent: list[tuple[int, int]]
    told: list[tuple[int, int]]
    heard_bytes_s: float
    stats: Stats


def roll(board: AvrBoard, edges: int, seed: int) -> Outcome:
    """Turn both wheels by so many edges each while the line is full both ways."""
    chance = np.random.default_rng(seed)
    bench = Bench(board)  # type: ignore[arg-type]
    bench.run_ms(50)
    bench.open_session()
    start_us = board.time_us
    sent = []
    for side in Side:
        lengths = chance.geometric(1 / RUN, edges)
        ways = np.repeat(np.where(np.arange(edges) % 2, -1, 1), lengths)[:edges]
        steps = np.where(chance.random(edges) < IMPOSSIBLE, 2, ways)
        at_us = start_us + EDGE_US * np.arange(edges) + chance.integers(1, JITTER_US, edges)
        board.set_many_encoder_pins(np.full(edges, side), FORWARD_PINS[np.cumsum(steps) % 4], at_us)
        sent.append((int(steps[steps != 2].sum()), int((steps == 2).sum())))
    heard_bytes = 0
    while board.time_us < start_us + EDGE_US * edges:
        board.write(b"".join(bench.frame(Ping(k)) for k in range(PINGS)))
        board.step(50_000)
        heard_bytes += len(board.read())
    stats = board.stats()
    heard_bytes_s = heard_bytes / (board.time_us - start_us) * 1e6
    board.step(300_000)
    told = [one.message for one in bench.decoder.feed(board.read()) if isinstance(one.message, Telemetry)][-1]
    counts = [(told.count_left, told.illegal_left), (told.count_right, told.illegal_right)]
    return Outcome(2 * edges, sent, counts, heard_bytes_s, stats)


def test_of_all_edges_at_5000_a_second_and_a_full_line_none_is_lost_and_each_fault_is_told(
    make_board: Callable[..., AvrBoard],
) -> None:
    with ThreadPoolExecutor(2) as pool:  # the simulator leaves Python alone while it runs
        outcomes = list(pool.map(lambda seed: roll(make_board(seed), EDGES // 4, seed), (1, 2)))
    assert sum(outcome.edges for outcome in outcomes) == EDGES
    for outcome in outcomes:
        assert outcome.told == outcome.sent
        assert all(illegal > IMPOSSIBLE * EDGES // 8 for _, illegal in outcome.sent)
        assert outcome.heard_bytes_s > 0.85 * BAUD / 10  # simulated, nine tenths of the line is all it gives
        assert outcome.stats.load > 0.8
        assert outcome.stats.rx_overruns == outcome.stats.resets == 0
