"""Properties of encoder.c: what holds for any edges at any times."""

from __future__ import annotations

from firmware_in_c import FirmwareInC
from hypothesis import given, settings
from hypothesis import strategies as st

TICK_US = 5000
UM_PER_COUNT = 5000
FORWARD_PINS = (0b00, 0b01, 0b11, 0b10)  # B, A
JUMP, STAY = 2, 0

steps = st.lists(st.tuples(st.sampled_from([1, 1, 1, -1, STAY, JUMP]), st.integers(1, 3000)), max_size=400)


@settings(max_examples=150, deadline=None)
@given(start=st.integers(0, 3), steps=steps)
def test_counts_and_faults_are_those_of_an_ideal_decoder(
    firmware: FirmwareInC, start: int, steps: list[tuple[int, int]]
) -> None:
    encoder = firmware.new("encoder", FORWARD_PINS[start], UM_PER_COUNT)
    phase, count, illegal, now_us, tick_us = start, 0, 0, 0, TICK_US
    for step, wait_us in steps:
        now_us += wait_us
        while tick_us <= now_us:
            firmware.c.shim_encoder_update(encoder, tick_us)
            tick_us += TICK_US
        phase = (phase + step) % 4
        if step == JUMP:
            illegal += 1
        else:
            count += step
        firmware.c.shim_encoder_edge(encoder, FORWARD_PINS[phase], now_us)
    firmware.c.shim_encoder_update(encoder, tick_us)
    assert firmware.c.shim_encoder_count(encoder) == count
    assert firmware.c.shim_encoder_illegal(encoder) == illegal


@settings(max_examples=150, deadline=None)
@given(
    speed_mm_s=st.floats(20, 600),  # the fastest a wheel may be asked to go; no two edges within a tick
    widths=st.lists(st.floats(0.75, 1.25), min_size=4, max_size=4),
    direction=st.sampled_from([-1, 1]),
    tick_phase_us=st.integers(0, TICK_US - 1),
    start_us=st.integers(0, 2**32 - 1),
)
def test_steady_speed_is_right_however_uneven_the_phases(
    firmware: FirmwareInC,
    speed_mm_s: float,
    widths: list[float],
    direction: int,
    tick_phase_us: int,
    start_us: int,
) -> None:
    encoder = firmware.new("encoder", FORWARD_PINS[0], UM_PER_COUNT)
    us_per_count = UM_PER_COUNT / speed_mm_s * 1000
    mean_width = sum(widths) / 4
    edge_us, edges = 0.0, 0
    for tick_us in range(tick_phase_us, round(24 * us_per_count), TICK_US):
        while edge_us <= tick_us:
            edges += 1
            at_us = (start_us + round(edge_us)) % 2**32
            firmware.c.shim_encoder_edge(encoder, FORWARD_PINS[direction * edges % 4], at_us)
            edge_us += us_per_count * widths[edges % 4] / mean_width
        firmware.c.shim_encoder_update(encoder, (start_us + tick_us) % 2**32)
        if edges >= 8:
            estimate_mm_s = firmware.c.shim_encoder_speed_q4(encoder) / 16
            assert abs(estimate_mm_s - direction * speed_mm_s) <= 0.001 * speed_mm_s + 1 / 16


@settings(max_examples=150, deadline=None)
@given(steps=steps, waits=st.lists(st.integers(0, 400_000), max_size=3))
def test_speed_never_exceeds_what_an_edge_would_have_shown_and_ends_at_zero(
    firmware: FirmwareInC, steps: list[tuple[int, int]], waits: list[int]
) -> None:
    encoder = firmware.new("encoder", FORWARD_PINS[0], UM_PER_COUNT)
    c = firmware.c
    phase, now_us, tick_us = 0, 0, TICK_US

    def tick() -> None:
        c.shim_encoder_update(encoder, tick_us)
        speed_mm_s = abs(c.shim_encoder_speed_q4(encoder)) / 16
        assert speed_mm_s <= 2000
        assert speed_mm_s * c.shim_encoder_edge_age_us(encoder) <= 1.5 * UM_PER_COUNT * 1000 * 1.000001

    for step, wait_us in [*steps, *((STAY, wait_us) for wait_us in waits)]:
        now_us += wait_us
        while tick_us <= now_us:
            tick()
            tick_us += TICK_US
        phase = (phase + step) % 4
        c.shim_encoder_edge(encoder, FORWARD_PINS[phase], now_us)
    for _ in range(110):
        tick()
        tick_us += TICK_US
    assert c.shim_encoder_speed_q4(encoder) == 0
