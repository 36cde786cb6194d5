"""Properties of motor.c and drive.c: limits and anti-windup, whatever is asked of them."""

from __future__ import annotations

from firmware_in_c import FirmwareInC
from hypothesis import given, settings
from hypothesis import strategies as st

LEFT, RIGHT = 0, 1
TICK_US = 5000
FORWARD_PINS = (0b00, 0b01, 0b11, 0b10)  # B, A

int16 = st.integers(-(2**15), 2**15 - 1)
gain = st.integers(0, 2**15 - 1)
gains = st.tuples(gain, gain, gain, gain, gain, gain)  # the last one limits the duty


@settings(max_examples=150, deadline=None)
@given(
    gains=gains,
    ticks=st.lists(st.tuples(int16 | st.just(0), int16, st.integers(-3, 3), int16), max_size=200),
)
def test_duty_stays_within_its_limit_never_opposes_its_setpoint_and_is_zero_for_none(
    firmware: FirmwareInC, gains: tuple[int, ...], ticks: list[tuple[int, int, int, int]]
) -> None:
    motor, encoder = firmware.new("motor", *gains), firmware.new("encoder", 0, 5000)
    c, now_us, phase = firmware.c, 0, 0
    for setpoint_q4, speed_q4, counts, battery_mv in ticks:
        now_us += TICK_US
        for i in range(abs(counts)):
            phase += 1 if counts > 0 else -1
            c.shim_encoder_edge(encoder, FORWARD_PINS[phase % 4], now_us - 100 * (4 - i))
        c.shim_encoder_update(encoder, now_us)
        c.shim_motor_set_speed_q4(motor, max(-32000, min(32000, speed_q4)))
        c.shim_motor_sense(motor, encoder)
        duty = c.motor_update(motor, setpoint_q4, abs(battery_mv))
        assert abs(duty) <= gains[-1]
        assert duty * setpoint_q4 >= 0
        assert duty == 0 or setpoint_q4 != 0
        assert abs(c.shim_motor_drift_q12(motor)) * gains[1] <= gains[4] * 2**16 or gains[1] == 0


@settings(max_examples=100, deadline=None)
@given(
    gains=gains,
    setpoint_q4=st.integers(1600, 16000) | st.integers(-16000, -1600),
    held=st.integers(100, 400),
    longer=st.integers(1, 2000),
)
def test_how_long_a_wheel_was_held_makes_no_difference_beyond_what_breaks_it_loose(
    firmware: FirmwareInC, gains: tuple[int, ...], setpoint_q4: int, held: int, longer: int
) -> None:
    motor, encoder = firmware.new("motor", *gains), firmware.new("encoder", 0, 5000)
    static, velocity, _, _, limit, _ = gains
    duties = []
    for _ in range(held + longer):
        firmware.c.shim_motor_sense(motor, encoder)
        duties.append(abs(firmware.c.motor_update(motor, setpoint_q4, 0)))
    one_lesson = velocity + 16  # 256 sixteenths of mm/s, and what rounding adds
    assert duties[-1] <= max(duties[held - 1], static + limit * 3 // 4 + one_lesson)


@settings(max_examples=200, deadline=None)
@given(v_mm_s=int16, omega_mrad_s=int16, track_mm=st.integers(1, 1000), limit_q4=st.integers(160, 32000))
def test_a_command_is_followed_exactly_or_slower_on_the_same_curve(
    firmware: FirmwareInC, v_mm_s: int, omega_mrad_s: int, track_mm: int, limit_q4: int
) -> None:
    drive = firmware.new("drive", track_mm * 1000, limit_q4, 80)
    firmware.c.drive_command(drive, v_mm_s, omega_mrad_s)
    got = [firmware.c.shim_drive_target_q4(drive, side) for side in (LEFT, RIGHT)]
    turn_mm_s = omega_mrad_s * track_mm / 2000
    wanted = [(v_mm_s + turn_mm_s) * 16, (v_mm_s - turn_mm_s) * 16]
    slower = min(1.0, limit_q4 / max(1.0, *map(abs, wanted)))
    for side in (LEFT, RIGHT):
        assert abs(got[side]) <= limit_q4
        assert abs(got[side] - wanted[side] * slower) <= 2 + 1e-3 * limit_q4


@settings(max_examples=100, deadline=None)
@given(
    step_q4=st.integers(1, 2000),
    commands=st.lists(st.tuples(int16, int16, st.integers(0, 300)), min_size=1, max_size=6),
)
def test_no_setpoint_changes_faster_than_the_ramp_and_every_target_is_reached(
    firmware: FirmwareInC, step_q4: int, commands: list[tuple[int, int, int]]
) -> None:
    drive = firmware.new("drive", 150_000, 8000, step_q4)

    def tick() -> int:
        before = [firmware.c.shim_drive_setpoint_q4(drive, side) for side in (LEFT, RIGHT)]
        firmware.c.drive_update(drive)
        after = [firmware.c.shim_drive_setpoint_q4(drive, side) for side in (LEFT, RIGHT)]
        return max(abs(b - a) for a, b in zip(before, after, strict=True))

    for v_mm_s, omega_mrad_s, ticks in commands:
        firmware.c.drive_command(drive, v_mm_s, omega_mrad_s)
        for _ in range(ticks):
            assert tick() <= step_q4
    for _ in range(16000 // step_q4 + 1):
        tick()
    for side in (LEFT, RIGHT):
        target_q4 = firmware.c.shim_drive_target_q4(drive, side)
        assert firmware.c.shim_drive_setpoint_q4(drive, side) == target_q4
