"""The line dies under a driving robot, in many ways: how long until it brakes, and until it stands?"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from host.errors import DeviceError, UsageError
from host.link.bench.frames import Frame
from host.link.bench.result import Cell, Plot, Result, Series
from host.link.bench.silences import EVERY_S, Dying, Recorder, Way, ways
from host.link.bench.target import Target, check_wheels_up, open_target
from host.link.bench.terminal import progress
from host.link.bench.verdict import Finding, Grade, Verdict
from host.link.protocol import Fault, State, Telemetry
from host.link.robot import Robot
from host.sim.board import Side
from host.sim.kinds import is_simulated

BRAKING_MS = 200.0  # the promise, from the last command obeyed
STANDING_MS = 400.0
WATCH_S = 0.9  # after the line's death
STEP_S = 0.001
DRIVING_STEP_S = 0.003
SAMPLE_MS = 1.0  # in simulation, the end of the millisecond in which it happened is told
TELEMETRY_MS = 10.0  # on a real robot, what telemetry shows may be older by so much
STILL_CM_S = 1.0  # slower is standing: two counts a second
CREEP_S = 0.1  # where only counts are seen: one that comes so long after the last is rolled out, not driven


@dataclass(frozen=True)
class CutOptions:
    """Let the line die under the driving robot, in many ways, and see when it brakes and stands."""

    robot: str = "sim:"  # auto, a port such as /dev/ttyACM0, or sim: or avr:, as in sim:?motors=15
    seeds: int = 5  # times each way is tried
    speed_mm_s: float = 300.0  # of the wheels
    only: str | None = None  # ways whose name holds this text
    wheels_up: bool = False  # the wheels of a real robot are off the floor and free
    json: Path | None = None  # write all figures to this file
    html: Path | None = None  # write a page with plots to this file

    def __post_init__(self) -> None:
        if not 1 <= self.seeds <= 1000:
            raise UsageError(f"--seeds must be from 1 to 1000, not {self.seeds}")
        if not 50.0 <= self.speed_mm_s <= 1000.0:
            raise UsageError(f"--speed-mm-s must be from 50 to 1000, not {self.speed_mm_s:g}")


@dataclass
class Tries:
    """What came of one way to die; times from the last command obeyed."""

    name: str
    braking_ms: list[float] = field(default_factory=list)
    standing_ms: list[float] = field(default_factory=list)
    ends: set[str] = field(default_factory=set)  # state and fault shown afterwards


def run(options: CutOptions) -> Result:
    """The measurement."""
    check_wheels_up(options.robot, options.wheels_up)
    simulated = is_simulated(options.robot)
    chosen = [way for way in ways() if (simulated or not way.simulated) and (options.only or "") in way.name]
    if not chosen:
        known = "; ".join(way.name for way in ways())
        raise UsageError(f"--only {options.only}: no way to die is called so; they are: {known}")
    tries = []
    with progress("cut", len(chosen) * options.seeds) as advance:
        for way in chosen:
            of_way = Tries(way.name)
            for seed in range(options.seeds):
                _try(options, way, seed, of_way)
                advance(1)
            tries.append(of_way)
    late_ms = SAMPLE_MS if simulated else TELEMETRY_MS
    limits = (BRAKING_MS + late_ms, STANDING_MS + late_ms)
    rows: list[list[Cell]] = [
        [
            t.name,
            _median(t.braking_ms),
            max(t.braking_ms),
            _median(t.standing_ms),
            max(t.standing_ms),
            *_end(t),
        ]
        for t in tries
    ]
    columns = ["the line", "brakes after ms", "worst", "stands after ms", "worst", "then"]
    settings = {"seeds": options.seeds, "speed_mm_s": options.speed_mm_s}
    names = [t.name for t in tries]
    at = [float(k) for k in range(len(tries))]
    plot = Plot("Worst time until the robot brakes and stands", "bars", "", "ms", [
        Series("brakes", at, [max(t.braking_ms) for t in tries]),
        Series("stands", at, [max(t.standing_ms) for t in tries]),
    ], limit=STANDING_MS, ticks=names)  # fmt: skip
    details = {"tries": [vars(t) | {"ends": sorted(t.ends)} for t in tries]}
    return Result("cut", options.robot, settings, columns, rows, verdict(tries, *limits), [plot], details)


def verdict(tries: list[Tries], braking_ms: float, standing_ms: float) -> Verdict:
    """Were the promises kept?"""
    findings = []
    for of_way in tries:
        if (worst := max(of_way.braking_ms)) > braking_ms:
            told = "did not brake" if math.isinf(worst) else f"braked only after {worst:.0f} ms"
            text = f"Unsafe: the robot {told} ({of_way.name})."
            findings.append(Finding(Grade.UNSAFE, text))
        elif (worst := max(of_way.standing_ms)) > standing_ms:
            told = "did not stand" if math.isinf(worst) else f"stood only after {worst:.0f} ms"
            findings.append(Finding(Grade.FAULTY, f"The robot {told} ({of_way.name})."))
    if not findings:
        count = sum(len(t.braking_ms) for t in tries)
        brakes, stands = max(max(t.braking_ms) for t in tries), max(max(t.standing_ms) for t in tries)
        findings.append(
            Finding(
                Grade.HEALTHY,
                f"Healthy. The line died {count} times in {len(tries)} ways; the robot braked within "
                f"{brakes:.0f} ms and stood within {stands:.0f} ms of the last command.",
            )
        )
    return Verdict(tuple(sorted(findings, key=lambda finding: -finding.grade)))


# --- One try ------------------------------------------------------------------------------------


class _Moment(NamedTuple):
    """What the robot did at one time."""

    t_s: float
    push: float  # largest duty of a wheel in the direction it was driven
    moves: bool


class _Truth:
    """Duties and speeds, every millisecond from the simulator, else from telemetry."""

    def __init__(self, target: Target, robot: Robot, signs: tuple[int, int]) -> None:
        self.moments: list[_Moment] = []
        self.latest: Telemetry | None = None
        self._target, self._robot, self._signs = target, robot, signs
        self._counts: tuple[int, int] | None = None
        self._changed_s = -math.inf

    def sample(self) -> None:
        """From the simulator, every millisecond."""
        rolling = self._target.rolling
        assert rolling is not None
        push = self._push((rolling.board.duty(Side.LEFT), rolling.board.duty(Side.RIGHT)))
        speed = max(map(abs, rolling.body.wheel_speeds_cm_s))
        self.moments.append(_Moment(self._target.clock.now_s(), push, speed >= STILL_CM_S))

    def hear(self, report: Telemetry) -> None:
        """From telemetry."""
        self.latest = report
        if self._target.rolling is not None:
            return
        counts = (report.count_left, report.count_right)
        t_s = self._robot.host_time_s(report.mcu_time_us)
        changed = self._counts is not None and counts != self._counts
        moves = changed and t_s - self._changed_s < CREEP_S
        self._changed_s = t_s if changed or self._counts is None else self._changed_s
        self._counts = counts
        push = self._push((report.duty_left_permille, report.duty_right_permille))
        self.moments.append(_Moment(t_s, push, moves))

    def times_ms(self, since_s: float) -> tuple[float, float]:
        """Until it brakes and until it stands, for good; infinite if it does not."""
        return (
            self._ended_ms(since_s, lambda moment: moment.push > 0.0),
            self._ended_ms(since_s, lambda moment: moment.moves),
        )

    def _push(self, duties: tuple[float, float]) -> float:
        return max(duty * sign for duty, sign in zip(duties, self._signs, strict=True))

    def _ended_ms(self, since_s: float, goes_on: Callable[[_Moment], bool]) -> float:
        last = max((k for k, moment in enumerate(self.moments) if goes_on(moment)), default=-1)
        if last + 1 == len(self.moments):
            return math.inf
        return max(0.0, 1000 * (self.moments[last + 1].t_s - since_s))


def _try(options: CutOptions, way: Way, seed: int, tries: Tries) -> None:
    chance = random.Random(f"{way.name} {seed}")
    uri = options.robot
    if is_simulated(uri) and "seed=" not in uri:
        uri += f"{'&' if '?' in uri else '?'}seed={seed}"
    with open_target(uri, seed=seed) as target:
        recorder = Recorder()
        robot = Robot(target.near, target.clock)
        robot.connect()
        _await_ready(target, robot)
        target.near.on_frame.append(recorder.see)
        v = options.speed_mm_s * chance.choice((1, -1))
        turning = chance.random() < 0.3
        v, omega = (0.0, v / 75.0) if turning else (v, 0.0)
        signs = (1 if v + 75 * omega > 0 else -1, 1 if v - 75 * omega > 0 else -1)
        target.wait_s(chance.uniform(0.0, 0.02))  # so that commands fall anywhere between two ticks
        # Driven until it is at speed, and until any moment between two commands and two telemetry.
        until_s = target.clock.now_s() + 1.0 + chance.uniform(0.0, 0.05)
        while target.clock.now_s() < until_s:
            robot.drive(v, omega)
            begin_s = target.clock.now_s()
            while target.clock.now_s() < min(until_s, begin_s + EVERY_S):
                target.wait_s(DRIVING_STEP_S)
                robot.poll()
        latest = robot.latest
        assert latest is not None and recorder.drive is not None
        if latest.state != State.DRIVING:
            raise DeviceError(f"the robot does not drive: {latest.state.name}, {latest.fault.name}")
        truth = _Truth(target, robot, signs)
        dying = Dying(
            target,
            chance,
            recorder.drive,
            recorder.drive_seq,
            latest.boot_nonce,
            recorder.recent,
            recorder.heard,
        )
        obeyed_s = _die(target, way, dying, truth, recorder, latest)
        braking_ms, standing_ms = truth.times_ms(obeyed_s)
        tries.braking_ms.append(braking_ms)
        tries.standing_ms.append(standing_ms)
        if truth.latest is not None:
            fault = truth.latest.fault
            tries.ends.add(fault.name if fault != Fault.NONE else truth.latest.state.name)
        target.faults.to_robot.drop = target.faults.to_host.drop = 0.0
        _put_right(target, robot)


def _die(
    target: Target, way: Way, dying: Dying, truth: _Truth, recorder: Recorder, latest: Telemetry
) -> float:
    """Let it happen; when the last command that the robot obeyed had arrived."""
    obeyed_seq, restarts = latest.drive_seq, False

    def hear(frame: Frame) -> None:
        nonlocal obeyed_seq, restarts
        if isinstance(frame.message, Telemetry):
            truth.hear(frame.message)
            if frame.message.boot_nonce == latest.boot_nonce:
                obeyed_seq = frame.message.drive_seq
            else:
                restarts = True

    target.far.on_frame.append(hear)  # beyond the cut, where there is a beyond
    if target.rolling is not None:
        target.rolling.watchers.append(truth.sample)
    begin_s = stepped_s = target.clock.now_s()
    if way.at_once is not None:
        way.at_once(dying)
    while (dead_s := target.clock.now_s() - begin_s) < WATCH_S:
        if target.clock.now_s() >= stepped_s:
            stepped_s = target.clock.now_s() + EVERY_S
            way.step(dying, dead_s)
        target.wait_s(STEP_S)
        target.near.read()
    target.far.on_frame.remove(hear)
    if target.rolling is not None:
        target.rolling.watchers.remove(truth.sample)
    return begin_s if restarts else recorder.obeyed_s[obeyed_seq]


def _await_ready(target: Target, robot: Robot) -> None:
    give_up_s = target.clock.now_s() + 2.0
    while robot.latest is None or robot.latest.state != State.READY:
        if target.clock.now_s() > give_up_s:
            told = "" if robot.latest is None else f": {robot.latest.state.name}, {robot.latest.fault.name}"
            raise DeviceError(f"the robot does not become ready{told}")
        if robot.latest is not None and robot.latest.state == State.FAULT:
            robot.clear()
        target.wait_s(0.02)
        robot.poll()


def _put_right(target: Target, robot: Robot) -> None:
    """Leave a robot that others can use."""
    target.near.write(b"\0\0")
    try:
        robot.connect()
        robot.clear()
    except DeviceError:
        if target.rolling is None:
            raise


def _median(values: list[float]) -> float:
    return sorted(values)[len(values) // 2]


def _end(tries: Tries) -> list[Cell]:
    return [", ".join(sorted(tries.ends)) or "not seen"]
