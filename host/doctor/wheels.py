"""Do motors and encoders belong together: left is left, forward is forward, and a stop is a stop?

Each wheel alone and both together are turned for half a second each way, by ordinary DRIVE messages; the
robot's own watch on its wheels stays awake all the time. Or a person turns them and nothing is driven.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from host.doctor.finding import Finding, Part, split_error
from host.doctor.person import Person, says_yes
from host.errors import DeviceError
from host.link.clock import Clock
from host.link.explain import FAULTS
from host.link.parameters import Param
from host.link.protocol import Fault, State, Telemetry
from host.link.robot import Robot

PULSE_S = 0.6
SPEED_MM_S = 150.0
LOOK_S = 0.01
READY_S = 2.0  # for a fault to be cleared and wheels to rest
STOP_S = 0.4  # as promised, from the last command
WATCHED_S = 0.8  # after a stop
MOVED = 2  # counts; fewer may be a wheel's play
SLOW_SHARE = 0.7  # of the speed that was asked for, at the end of a pulse
SAG_MV = 1000  # of the battery
UNLIKE = 1.5  # duty of one motor over that of the other
HAND_COUNTS = 8  # a fifth of a turn by hand
SIDES = ("left", "right")
PART = Part("wheels")
AS_WIRED = "docs/hardware.md shows the wiring"


@dataclass
class Pulse:
    """What came of driving for a moment; pairs are left and right."""

    told: tuple[int, int]  # 1 forward, -1 backward, 0 to stand
    reports: list[Telemetry] = field(default_factory=list)  # while driven
    after: list[Telemetry] = field(default_factory=list)
    stopped_us: int = 0  # by the robot's clock

    @property
    def counts(self) -> tuple[int, int]:
        """Turned by each wheel, forward positive."""
        every = self.reports + self.after
        return (
            every[-1].count_left - every[0].count_left,
            every[-1].count_right - every[0].count_right,
        )

    @property
    def first(self) -> tuple[int, int] | None:
        """(side, direction) of the wheel that was the first to turn; None where none did.

        Later the controllers answer to what they should not have seen.
        """
        every = self.reports + self.after
        for report in every:
            moved = (report.count_left - every[0].count_left, report.count_right - every[0].count_right)
            side = int(abs(moved[1]) > abs(moved[0]))
            if abs(moved[side]) >= MOVED:
                return side, 1 if moved[side] > 0 else -1
        return None

    @property
    def fault(self) -> Fault:
        """That the robot latched, if it did."""
        return next((r.fault for r in self.reports + self.after if r.fault != Fault.NONE), Fault.NONE)

    def duty(self, side: int) -> float:
        """Put on a motor in the second half, 0 to 1."""
        half = self.reports[len(self.reports) // 2 :]
        return float(np.mean([abs((r.duty_left_permille, r.duty_right_permille)[side]) for r in half])) / 1000

    def speed_mm_s(self, side: int) -> float:
        """Of a wheel at the end, in the direction it was told, by its counts."""
        return self.told[side] * float(
            (self.reports[-1].speed_left_mm_s, self.reports[-1].speed_right_mm_s)[side]
        )


def pulse(robot: Robot, clock: Clock, left: int, right: int, track_mm: float) -> Pulse:
    """Drive for a moment, stop, and watch the wheels come to rest.

    Parameters
    ----------
    left, right
        1 forward, -1 backward, 0 to stand.

    Raises
    ------
    DeviceError
        The robot is lost; its dead-man stops it.
    """
    _await_ready(robot, clock)
    found = Pulse((left, right), robot.poll()[-1:] or ([robot.latest] if robot.latest else []))
    v_mm_s = SPEED_MM_S * (left + right) / 2
    omega_rad_s = SPEED_MM_S * (left - right) / track_mm
    until_s = clock.now_s() + PULSE_S
    try:
        while clock.now_s() < until_s:
            robot.drive(v_mm_s, omega_rad_s)
            clock.sleep_s(LOOK_S)
            found.reports += robot.poll()
            if found.fault != Fault.NONE:
                break
    finally:
        robot.stop()
    found.stopped_us = found.reports[-1].mcu_time_us
    until_s = clock.now_s() + WATCHED_S
    while clock.now_s() < until_s:
        clock.sleep_s(LOOK_S)
        found.after += robot.poll()
    return found


def check_ready(robot: Robot, clock: Clock) -> Finding | None:
    """Why it cannot be driven now; None where it can."""
    try:
        _await_ready(robot, clock)
    except DeviceError as error:
        return PART.untried("motors", *split_error(error))
    return None


def check_driven(
    robot: Robot, clock: Clock, values: Mapping[Param, int]
) -> tuple[list[Finding], list[Pulse]]:
    """Turn the wheels by their motors. They must be off the floor."""
    track_mm = values[Param.TRACK_UM] / 1000
    findings: list[Finding] = []
    pulses: list[Pulse] = []
    for side in range(2):
        both_ways = []
        for sign in (1, -1):
            told = (sign, 0) if side == 0 else (0, sign)
            both_ways.append(pulse(robot, clock, *told, track_mm))
            if _wrong(side, both_ways[-1]):
                break
        pulses += both_ways
        findings.append(check_wheel(side, both_ways))
    if any(one.outcome != "ok" for one in findings):
        findings.append(PART.untried("both motors", "what is said above comes first"))
    else:
        straight = [pulse(robot, clock, sign, sign, track_mm) for sign in (1, -1)]
        pulses += straight
        findings.append(check_motors(straight))
    findings.append(check_noise(pulses))
    findings.append(check_stop(pulses))
    _await_ready(robot, clock)
    return findings, pulses


def check_wheel(side: int, pulses: Sequence[Pulse]) -> Finding:
    """Does the wheel that was driven turn, it alone, and the right way?"""
    name = f"{SIDES[side]} wheel"
    for one in pulses:
        if wrong := _wrong(side, one):
            return PART.fail(name, *wrong)
    forward, backward = (one.counts[side] for one in pulses)
    return PART.ok(
        name, f"{forward:+d} counts when told forward, {backward:+d} backward; the other one stands"
    )


def _wrong(side: int, one: Pulse) -> tuple[str, str] | None:
    """What is wrong with a wheel, and the remedy."""
    own, other = SIDES[side], SIDES[1 - side]
    sign = one.told[side]
    way = "forward" if sign > 0 else "backward"
    if one.first is None:
        if one.fault in (Fault.NONE, Fault.ENCODER_DEAD, Fault.STALL):
            return (
                f"told {way}, it does not count" + (f" ({one.fault.name})" if one.fault else ""),
                f"if it turned: check the {own} encoder's plug and 5 V; if not: motor, cells, gear",
            )
        return f"told {way}, the robot stopped itself: {one.fault.name}", FAULTS[one.fault].partition(": ")[2]
    first, direction = one.first
    if first != side:
        return (
            f"told {way}, the {other} wheel counts",
            f"swap the two encoders' plugs if the {own} wheel turned, the two motors' if the {other} one did",
        )
    if direction != sign:
        return (
            f"told {way}, it counts {'backward' if sign > 0 else 'forward'}",
            f"swap A and B of the {own} encoder if it turned {way}, its motor's two wires if it did not",
        )
    if one.fault != Fault.NONE:
        return f"told {way}, the robot stopped itself: {one.fault.name}", FAULTS[one.fault].partition(": ")[2]
    if abs(one.counts[1 - side]) > MOVED:
        return (
            f"told {way}, the {other} wheel counts as well ({one.counts[1 - side]:+d})",
            f"turn the wheels by hand with --by-hand, and see which encoder picks up the other; {AS_WIRED}",
        )
    return None


def check_motors(straight: Sequence[Pulse]) -> Finding:
    """Are both motors strong enough, and alike?"""
    for one in straight:
        if one.fault != Fault.NONE:
            what, _, fix = FAULTS[one.fault].partition(": ")
            return PART.fail("both motors", f"{one.fault.name}: {what}", fix)
    slowest = min(one.speed_mm_s(side) for one in straight for side in range(2))
    duties = [100 * float(np.mean([one.duty(side) for one in straight])) for side in range(2)]
    told = f"{slowest:.0f} of {SPEED_MM_S:.0f} mm/s, at duties of {duties[0]:.0f} and {duties[1]:.0f} %"
    if slowest < SLOW_SHARE * SPEED_MM_S:
        return PART.warn(
            "both motors",
            told,
            "charge the battery, free wheels and gears, then 'python -m host.calibrate wheels'",
        )
    if max(duties) > UNLIKE * min(duties):
        stiff = SIDES[int(duties[1] > duties[0])]
        return PART.warn(
            "both motors", told, f"see what holds the {stiff} wheel: its gear, its bearing, a wire"
        )
    return PART.ok("both motors", told)


def check_noise(pulses: Sequence[Pulse]) -> Finding:
    """Do the encoders' two channels follow each other as they must?"""
    every = [report for one in pulses for report in one.reports + one.after]
    lost = [
        (every[-1].illegal_left - every[0].illegal_left) & 0xFFFF,
        (every[-1].illegal_right - every[0].illegal_right) & 0xFFFF,
    ]
    told = f"{lost[0]} impossible steps left, {lost[1]} right"
    if any(lost):
        side = SIDES[int(lost[1] > lost[0])]
        return PART.warn(
            "encoder signals", told, f"check the {side} encoder's distance to its disc, and its wires"
        )
    return PART.ok("encoder signals", told)


def check_stop(pulses: Sequence[Pulse]) -> Finding:
    """Do the wheels stand when they were told to stop?"""
    worst_ms = 0.0
    for one in pulses:
        moves = [
            (after.mcu_time_us - one.stopped_us) & 0xFFFF_FFFF
            for before, after in zip(one.after, one.after[1:], strict=False)
            if (before.count_left, before.count_right) != (after.count_left, after.count_right)
        ]
        worst_ms = max([worst_ms, *(0.001 * us for us in moves)])
    told = f"wheels stand within {worst_ms:.0f} ms"
    if worst_ms > 1000 * STOP_S:
        return PART.fail(
            "stop", told, f"pull the USB plug if they still turn; check the motor driver; {AS_WIRED}"
        )
    return PART.ok("stop", told)


def check_sag(pushed: list[Telemetry]) -> Finding:
    """Does the battery hold its voltage while the motors pull?"""
    volts = [one.battery_mv for one in pushed if one.battery_mv]
    if not volts:
        return PART.untried("battery under load", "it is not measured")
    sag_mv = max(volts) - min(volts)
    told = f"it falls by {sag_mv / 1000:.2f} V"
    if sag_mv > SAG_MV:
        return PART.warn("battery under load", told, "use stronger cells, check their plugs and wires")
    return PART.ok("battery under load", told)


def check_sides_seen(person: Person, robot: Robot, clock: Clock, values: Mapping[Param, int]) -> Finding:
    """Is what the robot calls left on the left? Only who sees it can tell: plugs may be swapped in pairs."""
    name = "left is left"
    if not person.there:
        return PART.untried(name, "nobody at a terminal to say which wheel turned")
    pulse(robot, clock, 1, 0, values[Param.TRACK_UM] / 1000)
    question = "Did the LEFT wheel, as seen from above with the camera in front, turn FORWARD? [yes/no]"
    if says_yes(person.ask(question, robot.poll)):
        return PART.ok(name, "seen by you")
    return PART.fail(
        name,
        "another wheel turned, or another way",
        f"swap motor and encoder plugs as a pair, or all wires of one; {AS_WIRED}",
    )


# --- By hand ------------------------------------------------------------------------------------


def check_by_hand(person: Person, robot: Robot) -> Iterator[Finding]:
    """Let a person turn each wheel; no motor is driven."""
    for side, name in enumerate(SIDES):
        robot.poll()
        before = robot.latest
        person.ask(f"Turn the {name.upper()} wheel FORWARD by about one turn, then press Enter.", robot.poll)
        robot.poll()
        after = robot.latest
        if before is None or after is None:
            raise DeviceError("the robot reports nothing: check its cable")
        yield check_turned(side, before, after)


def check_turned(side: int, before: Telemetry, after: Telemetry) -> Finding:
    """Did the encoder count what the hand turned?"""
    counts = (after.count_left - before.count_left, after.count_right - before.count_right)
    illegal = (
        (after.illegal_left - before.illegal_left) & 0xFFFF,
        (after.illegal_right - before.illegal_right) & 0xFFFF,
    )
    name, own, other = f"{SIDES[side]} encoder", counts[side], counts[1 - side]
    told = f"{own:+d} counts, the other one {other:+d}"
    if abs(other) > MOVED and abs(other) > abs(own):
        return PART.fail(name, told, "swap the two encoders' plugs")
    if abs(own) < HAND_COUNTS:
        lone = illegal[side] > 0 or abs(own) > 0
        fix = "one of its two channels is dead: check A and B" if lone else "check its plug and its 5 V"
        return PART.fail(name, told, fix)
    if own < 0:
        return PART.fail(name, told, "swap A and B of this encoder")
    if illegal[side]:
        return PART.warn(
            name, f"{told}, {illegal[side]} impossible steps", "check its distance to its disc, and its wires"
        )
    return PART.ok(name, told)


def _await_ready(robot: Robot, clock: Clock) -> None:
    clock.sleep_s(2 * LOOK_S)
    robot.poll()
    give_up_s = clock.now_s() + READY_S
    while robot.latest is None or robot.latest.state != State.READY:
        latest = robot.latest
        if clock.now_s() > give_up_s:
            why = (
                "it does not come to rest"
                if latest is None or latest.fault == Fault.NONE
                else FAULTS[latest.fault]
            )
            raise DeviceError(f"the wheels cannot be tried; {why}")
        if latest is not None and latest.state == State.FAULT:
            robot.clear()
        clock.sleep_s(2 * LOOK_S)
        robot.poll()
