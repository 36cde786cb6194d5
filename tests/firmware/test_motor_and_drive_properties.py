"""Properties of motor.c and drive.c: limits and anti-windup, whatever is asked of them."""

from __future__ import annotations

from firmware_in_c import FirmwareInC
from hypothesis import assume, given, settings
from hypothesis import strategies as st

LEFT, RIGHT = 0, 1

int16 = st.integers(-(2**15), 2**15 - 1)
gain = st.integers(0, 2**15 - 1)
gains = st.tuples(gain, gain, gain, gain, gain, gain)  # the last one limits the duty


@settings(max_examples=150, deadline=None)
@given(gains=gains, ticks=st.lists(st.tuples(int16 | st.just(0), int16), max_size=200))
def test_duty_stays_within_its_limit_and_is_zero_for_a_setpoint_of_zero(
    firmware: FirmwareInC, gains: tuple[int, ...], ticks: list[tuple[int, int]]
) -> None:
    motor = firmware.new("motor", *gains)
    for setpoint_q4, speed_q4 in ticks:
        duty = firmware.c.motor_update(motor, setpoint_q4, speed_q4, 0)
        assert abs(duty) <= gains[-1]
        assert duty == 0 or setpoint_q4 != 0
        assert abs(firmware.c.shim_motor_integral_q12(motor)) <= gains[4] * 4096


@settings(max_examples=150, deadline=None)
@given(
    gains=gains,
    setpoint_q4=st.integers(1, 16000) | st.integers(-16000, -1),
    longer=st.integers(1, 2000),
    after=st.lists(st.integers(-16000, 16000), min_size=1, max_size=20),
)
def test_how_long_a_wheel_was_stuck_at_the_limit_makes_no_difference_afterwards(
    firmware: FirmwareInC, gains: tuple[int, ...], setpoint_q4: int, longer: int, after: list[int]
) -> None:
    limit = gains[-1] if setpoint_q4 > 0 else -gains[-1]
    short, long = firmware.new("motor", *gains), firmware.new("motor", *gains)
    for _ in range(400):
        duty = firmware.c.motor_update(short, setpoint_q4, 0, 0)
        firmware.c.motor_update(long, setpoint_q4, 0, 0)
        if duty == limit:
            break
    assume(duty == limit)
    for _ in range(longer):
        assert firmware.c.motor_update(long, setpoint_q4, 0, 0) == limit
    for speed_q4 in after:
        duties = [firmware.c.motor_update(motor, setpoint_q4, speed_q4, 0) for motor in (short, long)]
        assert abs(duties[0] - duties[1]) <= 1  # what the integral may still grow without showing


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
