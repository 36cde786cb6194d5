#!/usr/bin/env python3
"""Prints what the firmware takes of the ATmega328P beside what it may take; fails above that.

    make budget    # builds firmware and simulator first

Sizes are read from the ELF; times and stack are measured by running it in the simulator, host/sim/avr.
"""

from __future__ import annotations

import random
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests/firmware")]

import build_firmware  # noqa: E402
import build_rig  # noqa: E402
from board_bench import Bench, Wheel  # noqa: E402

from host.link.parameters import Param  # noqa: E402
from host.link.protocol import (  # noqa: E402
    Clear,
    EStop,
    KeepAlive,
    Message,
    Move,
    ParamRead,
    ParamSave,
    ParamWrite,
    Ping,
    Stop,
    StopHow,
    Telemetry,
    Turn,
)
from host.sim.avr.board import AvrBoard, Stats  # noqa: E402
from host.sim.board import Side  # noqa: E402
from host.sim.eeprom import image  # noqa: E402

# Of the compiler's library: floating point, and 64-bit products and quotients.
SLOW = {f"__{op}{kind}3" for op in ("add", "sub", "mul", "div") for kind in ("sf", "df")}
SLOW |= {"__fixsfsi", "__fixunssfsi", "__floatsisf", "__floatunsisf", "__cmpsf2", "__gesf2", "__ltsf2"}
SLOW |= {"__muldi3", "__divdi3", "__udivdi3", "__moddi3", "__umoddi3", "__udivmod64"}
SLOW |= {"__adddi3", "__subdi3", "__ashldi3", "__ashrdi3", "__lshrdi3"}
HEAP = {"malloc", "calloc", "realloc", "free"}

FAST_MM_S = 1000
FAST_MOTOR_MM_S = 2400  # at full duty: twice as fast as needed, so that the loop controls
FAST = {
    Param.SPEED_MAX_MM_S: 1200,
    Param.ACCELERATION_MM_S2: 4000,
    Param.VELOCITY_Q8_LEFT: 201,
    Param.VELOCITY_Q8_RIGHT: 201,
    Param.PROPORTIONAL_Q8: 100,
    Param.INTEGRAL_Q12: 40,
}


@dataclass(frozen=True)
class Figure:
    """One row of the budget."""

    what: str
    value: float
    most: float
    unit: str

    @property
    def kept(self) -> bool:
        """Within the budget."""
        return self.value <= self.most


# --- From the ELF -------------------------------------------------------------------------------


def sizes(elf: Path) -> tuple[int, int]:
    """Bytes of flash and of static RAM."""
    done = subprocess.run(["avr-size", "-A", "-d", elf], capture_output=True, text=True, check=True)
    section = {row.split()[0]: int(row.split()[1]) for row in done.stdout.splitlines() if row.startswith(".")}
    variables = section.get(".data", 0)
    return section[".text"] + variables, variables + section.get(".bss", 0) + section.get(".noinit", 0)


def slow_symbols(elf: Path) -> set[str]:
    """Library functions in it that take long, or take memory."""
    done = subprocess.run(["avr-nm", elf], capture_output=True, text=True, check=True)
    names = {line.split()[-1] for line in done.stdout.splitlines()}
    if "main" not in names:
        sys.exit(f"error: {elf} has no symbols to look at")
    return names & (SLOW | HEAP)


# --- In the simulator ---------------------------------------------------------------------------


def encoder_interrupts(board: AvrBoard, sides: tuple[Side, ...], edges: int = 4000) -> Stats:
    """Edges at chance moments, forward, backward and impossible ones, on these wheels at once."""
    chance = np.random.default_rng(1)
    board.step(50_000)
    board.clear_stats()
    at_us = board.time_us + np.cumsum(chance.integers(100, 400, edges))
    phase = np.cumsum(chance.choice([1, 1, 1, 3, 2], edges)) % 4
    pins = np.array([0b00, 0b01, 0b11, 0b10])[phase]
    for side in sides:
        board.set_many_encoder_pins(np.full(edges, side), pins, at_us)
    board.step(int(at_us[-1]) - board.time_us + 1000)
    return board.stats()


def driving_fast(board: AvrBoard) -> Stats:
    """Two seconds at 1 m/s, telemetry at 100 Hz, a DRIVE every 50 ms. `board` holds FAST."""
    bench = Bench(board, wheels=(Wheel(FAST_MOTOR_MM_S), Wheel(0.9 * FAST_MOTOR_MM_S)))  # type: ignore[arg-type]
    bench.run_ms(50)
    bench.open_session()
    bench.drive_for_ms(1000, FAST_MM_S)
    bench.hear()
    board.clear_stats()
    bench.drive_for_ms(2000, FAST_MM_S)
    told = [message for message in bench.hear() if isinstance(message, Telemetry)]
    speed = told[-1].speed_left_mm_s
    if not (199 <= len(told) <= 201 and abs(speed - FAST_MM_S) < 0.05 * FAST_MM_S):
        sys.exit(f"error: the measurement is not what it should be: {len(told)} reports, {speed} mm/s")
    return board.stats()


def everything_at_once(board: AvrBoard, milliseconds: int, seed: int = 1) -> Stats:
    """Every kind of message and garbage on a full line, wheels turning, the button, saves to EEPROM."""
    chance = random.Random(seed)
    bench = Bench(board)  # type: ignore[arg-type]
    bench.run_ms(50)
    hello = bench.open_session()
    board.clear_stats()
    said = _babble(bench, hello.boot_nonce, chance)
    for spent_ms in range(milliseconds):
        for _ in range(chance.randint(0, 3)):  # a millisecond carries 25 bytes, a frame has 8 to 22
            board.write(next(said))
        if spent_ms % 700 == 600:
            board.press_estop(True)
        if spent_ms % 700 == 620:
            board.press_estop(False)
        bench.run_ms(1)
        board.read()
    return board.stats()


def edges_and_bytes(board: AvrBoard, milliseconds: int) -> Stats:
    """5,000 counts a second on both wheels, at times on both at once, and a line full both ways."""
    chance = np.random.default_rng(1)
    bench = Bench(board)  # type: ignore[arg-type]
    bench.run_ms(50)
    bench.open_session()
    board.clear_stats()
    counts = 5 * milliseconds
    at_us = board.time_us + 200 * np.arange(1, counts + 1)
    pins = np.array([0b00, 0b01, 0b11, 0b10])[np.arange(1, counts + 1) % 4]
    board.set_many_encoder_pins(np.full(counts, Side.LEFT), pins, at_us)
    late_us = np.repeat(chance.integers(0, 12, -(-counts // 50)), 50)[:counts]  # for ten milliseconds each
    board.set_many_encoder_pins(np.full(counts, Side.RIGHT), pins, at_us + late_us)
    for _ in range(milliseconds // 10):
        board.write(b"".join(bench.frame(Ping(k)) for k in range(21)))  # 250 bytes, and more back
        board.step(10_000)
        board.read()
    return board.stats()


def _babble(bench: Bench, nonce: int, chance: random.Random) -> Iterator[bytes]:
    request = 0
    while True:
        request += chance.random() < 0.3
        soon_us = bench.drive(0).expires_us
        messages: list[Message] = [
            *(Ping(k) for k in range(4)),
            *(bench.drive(chance.randint(-600, 600), chance.randint(-4000, 4000)) for _ in range(6)),
            Move(nonce, request, chance.randint(-300, 300), 300, soon_us),
            Turn(nonce, request, chance.randint(-1000, 1000), 2000, soon_us),
            *(KeepAlive(soon_us) for _ in range(4)),
            *(ParamRead(k) for k in (0, 14, 200)),
            ParamWrite(nonce, request, Param.TRACK_UM, chance.randint(140_000, 160_000)),
            ParamSave(nonce, request),
            Stop(chance.choice(list(StopHow))),
            *(Clear(nonce) for _ in range(3)),
        ]
        if chance.random() < 0.02:
            messages = [EStop()]
        frame = bench.frame(chance.choice(messages))
        yield chance.randbytes(len(frame)) if chance.random() < 0.05 else frame


# --- All of it ----------------------------------------------------------------------------------


def measure(elf: Path, library: Path) -> list[Figure]:
    """Every figure of the budget for one build."""

    def board(eeprom: bytes = b"") -> AvrBoard:
        return AvrBoard(1, eeprom, elf=elf, library=library)

    flash, ram = sizes(elf)
    slow = slow_symbols(elf)
    single = max(encoder_interrupts(board(), (side,)).interrupts["encoder"].worst_cycles for side in Side)
    both = encoder_interrupts(board(), tuple(Side)).interrupts["encoder"].worst_cycles
    load = driving_fast(board(image(FAST))).load
    busy = board()
    everything_at_once(busy, 4000)
    watched = board()
    watched.watch_mask(True)
    masked = [everything_at_once(watched, 1200, seed=2)]
    watched_too = board()
    watched_too.watch_mask(True)
    masked.append(edges_and_bytes(watched_too, 400))
    masked_cycles = max(one.masked_worst_cycles for one in masked)
    wait_cycles = max(one.byte_wait_worst_cycles for one in masked)
    lost_bytes = busy.stats().rx_overruns + sum(one.rx_overruns for one in masked)
    return [
        Figure("flash", flash, 24 * 1024, "B"),
        Figure("static RAM", ram, 1228, "B"),
        Figure("stack, deepest", max(each.stack_bytes for each in (busy, watched, watched_too)), 400, "B"),
        Figure("encoder interrupt, one wheel", single, 90, "cycles"),
        Figure("encoder interrupt, both wheels", both, 140, "cycles"),
        Figure("interrupts off, longest", masked_cycles, 320, "cycles"),
        Figure("received byte until read", wait_cycles, 640, "cycles"),
        Figure("received bytes lost", lost_bytes, 0, ""),
        Figure("processor load at 1 m/s", round(100 * load, 1), 40, "%"),
        Figure("floating point, 64 bits, heap", len(slow), 0, "symbols"),
    ]


def table(figures: list[Figure]) -> str:
    """Figures and limits, one a line."""
    rows = [f"{'':32}{'is':>8}{'may be':>8}"]
    for one in figures:
        line = f"{one.what:32}{one.value:8g}{one.most:8g} {one.unit}"
        rows.append(line.rstrip() + ("" if one.kept else "    TOO MUCH"))
    return "\n".join(rows)


def main() -> None:
    library = build_rig.LIBRARY
    if not library.is_file() or library.stat().st_mtime < build_rig.SOURCE.stat().st_mtime:
        build_rig.build()
    options = build_firmware.environments()
    elf = build_firmware.build("uno", options["uno"])
    figures = measure(elf, library)
    print(table(figures))
    if not all(one.kept for one in figures):
        sys.exit("error: the firmware has outgrown its budget")


if __name__ == "__main__":
    main()
