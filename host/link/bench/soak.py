"""Minutes of mixed traffic over a line with random faults, and what must hold all the while.

Held against the robot at every moment: nothing that nobody sent is ever accepted; a wheel is driven only
while a command of the last 0.2 s stands; no wheel runs faster than asked; moves and parameters are done
exactly once. In simulation the truth is looked at every millisecond; on a real robot, what telemetry shows.
"""

from __future__ import annotations

import gc
import math
import random
import tracemalloc
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from pathlib import Path

from host.errors import DeviceError, UsageError
from host.link.bench.capture import CaptureWriter
from host.link.bench.frames import Frame
from host.link.bench.obeyed import Comparison
from host.link.bench.result import Cell, Plot, Result, Series
from host.link.bench.target import Target, check_wheels_up, open_target
from host.link.bench.terminal import Advance, progress
from host.link.bench.verdict import Finding, Grade, Verdict, judge
from host.link.bench.witness import Evidence, Witness, without_rtt
from host.link.explain import FAULTS
from host.link.faults import Faults
from host.link.parameters import Param
from host.link.protocol import (
    DEAD_MAN_US,
    Drive,
    Fault,
    KeepAlive,
    Move,
    Outcome,
    Refusal,
    ResetCause,
    State,
    Telemetry,
    Turn,
)
from host.link.robot import Robot
from host.sim.board import Side
from host.sim.kinds import is_simulated

STEP_S = 0.005
EPISODE_S = 6.0  # the line is as bad as chance makes it for so long, then anew
KINDS = ("drop", "flip", "duplicate", "delay", "truncate", "reorder")
DEAD_MAN_S = 1e-6 * DEAD_MAN_US
LEEWAY_S = 0.002  # the frame's time on the line, and the simulator's millisecond
TELEMETRY_S = 0.015  # by which what telemetry shows is older
FASTEST = 1.35  # times what was asked, with a hand's breadth of overshoot
MOVE_MM, TURN_RAD = 12.0, 0.12  # to which a move's counts tell whether it was done once; twice is far off
MEMORY_GROWS = 100_000  # bytes between the first quarter and the end are no leak
SAVED = (Param.PROPORTIONAL_Q8, 300, 390)  # what is written over and over: harmless values of it
OURS = str(Path(__file__).parents[1] / "*")  # the host's end of the link; the simulator's memory is not its
WEIGHINGS = 20
CALM_S = 0.4


@dataclass(frozen=True)
class SoakOptions:
    """Mixed traffic over a line with random faults; everything that must hold is watched."""

    robot: str = "sim:"  # auto, a port such as /dev/ttyACM0, or sim: or avr:, as in sim:?motors=15
    minutes: float = 1.0  # by the robot's time
    seed: int = 0  # of faults and traffic
    faults: str = ",".join(KINDS)  # kinds of faults to inject; "none" for a good line
    wheels_up: bool = False  # the wheels of a real robot are off the floor and free
    capture: Path | None = None  # keep all bytes with their times in this file
    json: Path | None = None  # write all figures to this file
    html: Path | None = None  # write a page with plots to this file

    def __post_init__(self) -> None:
        if not 0.05 <= self.minutes <= 10_000.0:
            raise UsageError(f"--minutes must be from 0.05 to 10000, not {self.minutes:g}")
        kinds_of(self.faults)


def kinds_of(text: str) -> tuple[str, ...]:
    """UsageError where they are no kinds of faults."""
    kinds = () if text == "none" else tuple(part.strip() for part in text.split(","))
    for kind in kinds:
        if kind not in KINDS:
            raise UsageError(f"--faults {text}: no fault is called {kind!r}; they are {', '.join(KINDS)}")
    return kinds


@dataclass
class Tally:
    """What was done, and what came of it."""

    drives: int = 0
    moves: int = 0
    writes: int = 0
    saves: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)  # of requests
    faults: Counter[str] = field(default_factory=Counter)  # latched
    kept: Counter[str] = field(default_factory=Counter)  # why it was not ready, though cleared and waited for
    reconnections: int = 0
    violations: list[str] = field(default_factory=list)
    memory: list[tuple[float, int]] = field(default_factory=list)  # minutes, bytes

    @property
    def done(self) -> int:
        """Requests that were."""
        return sum(self.outcomes[f"{kind} done"] for kind in ("move", "write", "save"))

    def violate(self, text: str) -> None:
        """Something that must never happen."""
        if len(self.violations) < 20:
            self.violations.append(text)


class _Guard:
    """Watches what the robot does against what reached it."""

    def __init__(self, target: Target, tally: Tally) -> None:
        self._target, self._tally = target, tally
        self._commanded_s = -math.inf  # when a command arrived whole that lets the wheels go on
        self._bad = False

    def arrived(self, frame: Frame) -> None:
        """From the far tap."""
        message = frame.message
        if isinstance(message, Drive | KeepAlive | Move | Turn):
            self._commanded_s = frame.t_s + self._on_the_line_s(frame)
        if isinstance(message, Telemetry) and self._target.rolling is None:
            pushed = bool(message.duty_left_permille or message.duty_right_permille)
            self._check(frame.t_s, pushed, TELEMETRY_S + LEEWAY_S)

    def sample(self) -> None:
        """Every millisecond, in simulation."""
        rolling = self._target.rolling
        assert rolling is not None
        pushed = any(rolling.board.duty(side) != 0.0 for side in Side)
        self._check(self._target.clock.now_s(), pushed, LEEWAY_S)
        if max(map(abs, rolling.body.wheel_speeds_cm_s)) > FASTEST * FASTEST_MM_S / 10:
            self._tally.violate("a wheel ran faster than anything that was asked for")

    def _check(self, now_s: float, pushed: bool, leeway_s: float) -> None:
        late_s = now_s - self._commanded_s - DEAD_MAN_S - leeway_s
        if pushed and late_s > 0.0 and not self._bad:
            self._tally.violate(f"a wheel was driven {late_s + DEAD_MAN_S:.3f} s after the last command")
        self._bad = pushed and late_s > 0.0

    @staticmethod
    def _on_the_line_s(frame: Frame) -> float:
        return 40e-6 * (len(frame.coded) + 2)


FASTEST_MM_S = 350.0  # asked of a wheel below


def run(options: SoakOptions) -> Result:
    """The measurement."""
    check_wheels_up(options.robot, options.wheels_up)
    tally, witness, comparison = Tally(), Witness(), Comparison()
    chance = random.Random(options.seed)
    with ExitStack() as stack:
        target = stack.enter_context(open_target(options.robot, seed=options.seed))
        advance = stack.enter_context(progress("soak", 60 * options.minutes))
        if options.capture is not None:
            writer = CaptureWriter(options.capture)
            stack.callback(writer.close)
            target.near.on_bytes.append(writer.add)
        guard = _Guard(target, tally)
        robot = stack.enter_context(Robot(target.near, target.clock))
        robot.connect()
        target.near.on_frame += [comparison.sent, witness.see]
        target.far.on_frame += [comparison.arrived, guard.arrived]
        if target.rolling is not None:
            target.rolling.watchers.append(guard.sample)
        tracemalloc.start()
        stack.callback(tracemalloc.stop)
        _Traffic(target, robot, chance, kinds_of(options.faults), tally, advance).run(60 * options.minutes)
    for frame in comparison.wrong[:5]:
        tally.violate(f"the robot accepted what nobody had sent: {frame.coded.hex()}")
    return _result(options, tally, witness, comparison)


class _Traffic:
    """Things that hosts do, one after the other."""

    def __init__(
        self,
        target: Target,
        robot: Robot,
        chance: random.Random,
        kinds: tuple[str, ...],
        tally: Tally,
        advance: Advance,
    ) -> None:
        self.target, self.robot, self.chance, self.kinds = target, robot, chance, kinds
        self.tally, self.advance = tally, advance
        self._seen_fault = Fault.NONE
        left, right, track = map(
            robot.read_param, (Param.UM_PER_COUNT_LEFT, Param.UM_PER_COUNT_RIGHT, Param.TRACK_UM)
        )
        self._mm = left / 1000, right / 1000
        self._track_mm = track / 1000

    def run(self, seconds: float) -> None:
        """Until as much time has passed."""
        begin_s = shown_s = self.target.clock.now_s()
        episode_s, weigh = -math.inf, False
        things: list[Callable[[], None]] = [self._drive, self._drive, self._move, self._turn, self._write]
        things += [self._silence, self._estop, self._save, self._unplug]
        if self.target.rolling is not None:
            things.append(self._restart)
        while (now_s := self.target.clock.now_s()) - begin_s < seconds:
            self.advance(now_s - shown_s)
            shown_s = now_s
            if now_s - episode_s > EPISODE_S:
                episode_s = now_s
                self._worsen()
                weigh = weigh or now_s - begin_s >= len(self.tally.memory) * seconds / WEIGHINGS
            try:
                self.chance.choice(things)()
                self._look()
                if weigh:
                    self._weigh((now_s - begin_s) / 60)
                    weigh = False
            except DeviceError as error:
                self._come_back(error)
        self._better()
        self._weigh(seconds / 60)

    # --- The line -------------------------------------------------------------------------------

    def _worsen(self) -> None:
        """Another mixture of faults, both ways."""
        for faults in (self.target.faults.to_robot, self.target.faults.to_host):
            for name, value in asdict(Faults()).items():
                setattr(faults, name, value)
            for kind in self.kinds:
                much = self.chance.choice((0.0, 0.0, 0.3, 1.0))
                match kind:
                    case "flip":
                        faults.bit_error_rate = 5e-4 * much
                    case "delay":
                        faults.delay_s, faults.jitter_s = 0.03 * much, 0.05 * much
                    case _:
                        setattr(faults, kind, 0.1 * much)

    def _better(self) -> None:
        for faults in (self.target.faults.to_robot, self.target.faults.to_host):
            for name, value in asdict(Faults()).items():
                setattr(faults, name, value)

    def _come_back(self, error: DeviceError) -> None:
        self.tally.outcomes[_short(error)] += 1
        for _ in range(20):
            try:
                self.robot.reconnect()
                self.tally.reconnections += 1
                return
            except DeviceError:
                self._better()  # a line on which nobody can connect at all proves nothing
        raise error

    # --- What hosts do --------------------------------------------------------------------------

    def _drive(self) -> None:
        self.tally.drives += 1
        v = self.chance.uniform(-250.0, 250.0)
        omega = self.chance.uniform(-1.0, 1.0)
        for _ in range(self.chance.randrange(5, 60)):
            self.robot.drive(v, omega)
            self._pass(self.chance.uniform(0.01, 0.06))
        if self.chance.random() < 0.8:
            self.robot.stop()

    def _silence(self) -> None:
        """The program stops without a word."""
        self.robot.drive(self.chance.uniform(-250.0, 250.0), 0.0)
        self.target.wait_s(self.chance.uniform(0.0, 0.6))

    def _estop(self) -> None:
        self.robot.drive(200.0, 0.0)
        self._pass(0.2)
        self.robot.estop()
        self._pass(CALM_S)

    def _unplug(self) -> None:
        """Nothing comes through either way, in the midst of driving."""
        self.robot.drive(self.chance.uniform(-250.0, 250.0), 0.0)
        lines = self.target.faults.to_robot, self.target.faults.to_host
        before = [line.drop for line in lines]
        for line in lines:
            line.drop = 1.0
        self.target.wait_s(self.chance.uniform(0.1, 0.8))
        for line, drop in zip(lines, before, strict=True):
            line.drop = drop
        self._pass(0.1)

    def _restart(self) -> None:
        """The robot's supply dips, in the midst of driving."""
        assert self.target.rolling is not None
        self.robot.drive(self.chance.uniform(-250.0, 250.0), 0.0)
        self._pass(self.chance.uniform(0.1, 0.3))
        self.target.rolling.board.reset(ResetCause.BROWN_OUT)
        self._pass(0.3)

    def _move(self) -> None:
        amount = self.chance.uniform(-300.0, 300.0)
        self._request(
            lambda: self.robot.move(amount, 200.0), amount, MOVE_MM, lambda left, right: (left + right) / 2
        )

    def _turn(self) -> None:
        amount = self.chance.uniform(-1.5, 1.5)
        self._request(
            lambda: self.robot.turn(amount, 2.0),
            amount,
            TURN_RAD,
            lambda left, right: (left - right) / self._track_mm,
        )

    def _request(
        self, begin: Callable, amount: float, within: float, way: Callable[[float, float], float]
    ) -> None:
        """A move, and by the counts whether it was done once."""
        if not self._stands():
            return
        self.tally.moves += 1
        before = self.robot.latest
        result = self.robot.wait(begin(), 20.0)
        self.tally.outcomes["move " + result.outcome.name.lower()] += 1
        if not self._stands():
            return
        after = self.robot.latest
        assert before is not None and after is not None
        if before.boot_nonce != after.boot_nonce:
            return
        rolled = way(
            self._mm[0] * (after.count_left - before.count_left),
            self._mm[1] * (after.count_right - before.count_right),
        )
        if result.done and abs(rolled - amount) > within:
            self.tally.violate(f"a move of {amount:.2f} was reported done and went {rolled:.2f}")
        if result.outcome in (Outcome.NONE, Outcome.REFUSED) and abs(rolled) > within:
            self.tally.violate(f"a move that was {result.outcome.name} went {rolled:.2f} all the same")
        if abs(rolled) > abs(amount) + within:
            self.tally.violate(f"a move of {amount:.2f} went {rolled:.2f}")

    def _write(self) -> None:
        if not self._stands():
            return
        param, lowest, highest = SAVED
        value = self.chance.randrange(lowest, highest)
        self.tally.writes += 1
        self.robot.write_param(param, value)
        told = self.robot.read_param(param)
        self.tally.outcomes["write done"] += 1
        if told != value:
            self.tally.violate(f"{param.name} was written as {value} and is {told}")

    def _save(self) -> None:
        if (
            self._stands() and self.tally.saves < 50
        ):  # the EEPROM bears 100,000 writes, and needs no more here
            self.tally.saves += 1
            self.robot.save_params()
            self.tally.outcomes["save done"] += 1

    # --- Between --------------------------------------------------------------------------------

    def _pass(self, seconds: float) -> None:
        until_s = self.target.clock.now_s() + seconds
        while self.target.clock.now_s() < until_s:
            self.target.wait_s(STEP_S)
            self._look()

    def _look(self) -> None:
        self.robot.poll()
        latest = self.robot.latest
        if latest is None:
            return
        if latest.fault != self._seen_fault and latest.fault != Fault.NONE:
            self.tally.faults[latest.fault.name.lower().replace("_", " ")] += 1
        self._seen_fault = latest.fault

    def _stands(self) -> bool:
        """Make it stand ready; whether it does."""
        self.robot.stop()
        give_up_s = self.target.clock.now_s() + 3.0
        ready_s = None
        while self.target.clock.now_s() < give_up_s:
            self._pass(0.03)
            latest = self.robot.latest
            if latest is not None and latest.state == State.FAULT:
                self.robot.clear()
                ready_s = None
            elif latest is not None and latest.state == State.READY:
                ready_s = ready_s or self.target.clock.now_s()
                if self.target.clock.now_s() - ready_s > CALM_S:
                    return True
            else:
                self.robot.stop()
                ready_s = None
        latest = self.robot.latest
        if latest is not None:
            self.tally.kept[(latest.state if latest.fault == Fault.NONE else latest.fault).name] += 1
        return False

    def _weigh(self, minutes: float) -> None:
        gc.collect()  # what the robot's client keeps for `poll` is no leak: it has just been fetched
        taken = tracemalloc.take_snapshot().filter_traces([tracemalloc.Filter(True, OURS)])
        self.tally.memory.append((minutes, sum(trace.size for trace in taken.traces)))


def _short(error: DeviceError) -> str:
    for refusal in Refusal:
        if f"({refusal.name})" in str(error):
            return f"refused, {refusal.name.lower().replace('_', ' ')}"
    for word in ("silent", "restarted", "closed the session", "not begun", "does not tell", "not done"):
        if word in str(error):
            return f"lost, {word}"
    return "lost, other"


def _result(options: SoakOptions, tally: Tally, witness: Witness, comparison: Comparison) -> Result:
    evidence = witness.evidence()
    evidence.violations = tally.violations
    grown = tally.memory[-1][1] - tally.memory[len(tally.memory) // 4][1]
    rows: list[list[Cell]] = [
        ["frames to the robot", evidence.sent],
        ["frames that reached it whole", comparison.arrived_frames],
        ["accepted although nobody sent it", len(comparison.wrong)],
        ["drives", tally.drives],
        ["moves and turns", tally.moves],
        ["parameters written", tally.writes],
        ["parameters saved", tally.saves],
        *([f"  {name}", count] for name, count in sorted(tally.outcomes.items())),
        *([f"stopped itself, {name}", count] for name, count in sorted(tally.faults.items())),
        ["connected again", tally.reconnections],
        ["restarts of the robot", len(evidence.restarts)],
        ["memory gained, kB", grown / 1000],
    ]
    plots = [
        Plot("Memory of this program", "line", "minutes", "kB", [
            Series("memory", [m for m, _ in tally.memory], [b / 1000 for _, b in tally.memory]),
        ]),
    ]  # fmt: skip
    settings = {"minutes": options.minutes, "seed": options.seed, "faults": options.faults}
    told = vars(tally) | {
        "outcomes": dict(tally.outcomes),
        "faults": dict(tally.faults),
        "kept": dict(tally.kept),
    }
    details = {"evidence": without_rtt(evidence), "tally": told}
    return Result(
        "soak", options.robot, settings, ["what", "count"], rows,
        _verdict(options, tally, evidence, grown), plots, details,
    )  # fmt: skip


def _verdict(options: SoakOptions, tally: Tally, evidence: Evidence, grown: int) -> Verdict:
    injected = bool(kinds_of(options.faults))
    if not injected or not is_simulated(options.robot):
        findings = list(judge(evidence).findings)
    else:
        findings = [Finding(Grade.UNSAFE, f"Unsafe: {text}.") for text in tally.violations]
    if grown > MEMORY_GROWS:
        findings.append(Finding(Grade.FAULTY, f"This program's memory grew by {grown / 1000:.0f} kB."))
    findings += _idle(tally)
    if not findings:
        text = (
            f"Healthy. {evidence.sent:,} frames in {options.minutes:g} minutes, {tally.done} requests done "
            "exactly once, never a wheel driven without a command."
        )
        findings.append(Finding(Grade.HEALTHY, text))
    return Verdict(tuple(sorted(findings, key=lambda finding: -finding.grade)))


def _idle(tally: Tally) -> list[Finding]:
    """Of a robot that did little or nothing, which proves little or nothing."""
    findings = []
    for name, count in tally.kept.most_common():
        why = f"{name}: {FAULTS[Fault[name]]}" if name in Fault.__members__ else f"its state stays {name}"
        times = "once" if count == 1 else f"{count} times"
        findings.append(Finding(Grade.FAULTY, f"The robot could not be made ready, {times} ({why})."))
    if not tally.done and not findings:
        asked = tally.moves + tally.writes + tally.saves
        text = (
            f"None of {asked} requests was done." if asked else "No request was made: give it more minutes."
        )
        findings.append(Finding(Grade.FAULTY if asked else Grade.NOTE, text))
    return findings
