"""Bit errors: what they cost at rates from none to 1 in 1000, and that no wrong command comes of them."""

from __future__ import annotations

import random
from dataclasses import dataclass
from pathlib import Path

from host.errors import UsageError
from host.link.bench.obeyed import Comparison, SetpointAges
from host.link.bench.result import Cell, Plot, Result, Series
from host.link.bench.target import Target, check_wheels_up, open_target
from host.link.bench.terminal import Advance, progress
from host.link.bench.verdict import Finding, Grade, Verdict, judge, one_in, quantile
from host.link.bench.witness import Evidence, Witness, without_rtt
from host.link.protocol import State
from host.link.robot import Robot
from host.sim.kinds import is_simulated

INJECTED = (0.0, 1e-6, 1e-5, 1e-4, 1e-3)
STEP_S = 0.005
SETTLE_S = 0.45  # until both ends have told their counters twice
AGE_LIMIT_MS = 60.0  # 99 % of the setpoints, at
AGE_LIMIT_RATE = 1e-4  # bit errors and below


@dataclass(frozen=True)
class BerOptions:
    """Drive over a line with bit errors: injected ones on a simulated robot, else those that the line has."""

    robot: str = "sim:"  # auto, a port such as /dev/ttyACM0, or sim: or avr:, as in sim:?seed=3
    rates: str | None = None  # bit error rates to inject, such as 0,1e-5; 0 measures the line's own
    seconds: float = 20.0  # at each rate
    period_ms: float = 20.0  # from one DRIVE to the next
    speed_mm_s: float = 200.0  # of the wheels; 0 leaves them standing
    wheels_up: bool = False  # the wheels of a real robot are off the floor and free
    seed: int = 0  # of the bit errors
    json: Path | None = None  # write all figures to this file
    html: Path | None = None  # write a page with plots to this file

    def __post_init__(self) -> None:
        parse_rates(self.rates or "0")
        if not 1.0 <= self.seconds <= 3600.0:
            raise UsageError(f"--seconds must be from 1 to 3600, not {self.seconds:g}")
        if not 5.0 <= self.period_ms <= 100.0:
            raise UsageError(f"--period-ms must be from 5 to 100, not {self.period_ms:g}")
        if not 0.0 <= abs(self.speed_mm_s) <= 2000.0:
            raise UsageError(f"--speed-mm-s must be within 2000 either way, not {self.speed_mm_s:g}")


def parse_rates(text: str) -> tuple[float, ...]:
    """UsageError where they are no rates."""
    try:
        rates = tuple(float(part) for part in text.split(","))
        if not all(0.0 <= rate <= 0.01 for rate in rates):
            raise ValueError
    except ValueError:
        raise UsageError(f"--rates {text}: write rates from 0 to 0.01, such as 0,1e-5,1e-4") from None
    return rates


@dataclass
class Stage:
    """All about one rate."""

    rate: float
    evidence: Evidence
    comparison: Comparison
    ages_ms: list[float]
    damaged_there: int
    damaged_back: int
    stops: int  # the robot stopped itself


def run(options: BerOptions) -> Result:
    """The measurement."""
    if options.speed_mm_s:
        check_wheels_up(options.robot, options.wheels_up)
    rates = INJECTED if is_simulated(options.robot) else (0.0,)
    if options.rates is not None:
        rates = parse_rates(options.rates)
    stages = []
    with (
        open_target(options.robot, seed=options.seed) as target,
        progress("ber", len(rates) * options.seconds) as advance,
        Robot(target.near, target.clock) as robot,
    ):
        robot.connect()
        for rate in rates:
            stages.append(_stage(target, robot, rate, options, advance))
    rows = [_row(stage) for stage in stages]
    columns = [
        "bit errors", "sent", "damaged", "lost", "lost each", "in a row",
        "lost back", "age p50 ms", "p99 ms", "oldest ms", "stops", "wrong",
    ]  # fmt: skip
    settings = {name: getattr(options, name) for name in ("seconds", "period_ms", "speed_mm_s", "seed")}
    details = {"stages": [_details(stage) for stage in stages]}
    return Result("ber", options.robot, settings, columns, rows, verdict(stages), _plots(stages), details)


def _stage(target: Target, robot: Robot, rate: float, options: BerOptions, advance: Advance) -> Stage:
    witness, ages, comparison = Witness(), SetpointAges(), Comparison()
    _listen(target, robot, SETTLE_S)
    before = target.faults.injected_to_robot.damaged, target.faults.injected_to_host.damaged
    listeners = ((target.near, witness.see), (target.near, ages.see), (target.far, comparison.arrived))
    for tap, see in listeners:
        tap.on_frame.append(see)
    target.near.on_frame.insert(0, comparison.sent)
    _listen(target, robot, SETTLE_S)
    target.faults.to_robot.bit_error_rate = target.faults.to_host.bit_error_rate = rate
    stops, chance = 0, random.Random(options.seed)
    begin_s = sent_s = target.clock.now_s()
    robot.drive(options.speed_mm_s, 0.0)
    while (now_s := target.clock.now_s()) - begin_s < options.seconds:
        if now_s - sent_s >= 1e-3 * options.period_ms - STEP_S / 2:
            robot.drive(options.speed_mm_s, 0.0)
            sent_s = now_s
        target.wait_s(STEP_S * chance.uniform(0.5, 1.5))  # as on a computer with other things to do
        robot.poll()
        if robot.latest is not None and robot.latest.state == State.FAULT:
            stops += 1
            robot.clear()
        advance(STEP_S)
    target.faults.to_robot.bit_error_rate = target.faults.to_host.bit_error_rate = 0.0
    robot.stop()
    _listen(target, robot, SETTLE_S)
    after = target.faults.injected_to_robot.damaged, target.faults.injected_to_host.damaged
    for tap, see in (*listeners, (target.near, comparison.sent)):
        tap.on_frame.remove(see)
    there, back = (b - a for a, b in zip(before, after, strict=True))
    return Stage(rate, witness.evidence(), comparison, ages.ages_ms, there, back, stops)


def _listen(target: Target, robot: Robot, seconds: float) -> None:
    begin_s = target.clock.now_s()
    while target.clock.now_s() - begin_s < seconds:
        target.wait_s(STEP_S)
        robot.poll()


def _row(stage: Stage) -> list[Cell]:
    ages = sorted(stage.ages_ms)
    lost = stage.evidence.robot.get("lost", 0)
    return [
        f"{stage.rate:.0e}" if stage.rate else "none",
        stage.evidence.sent, stage.damaged_there, lost,
        lost / stage.damaged_there if stage.damaged_there else None,
        stage.comparison.in_a_row, stage.evidence.host.get("lost", 0),
        *(quantile(ages, share) if ages else None for share in (0.5, 0.99, 1.0)),
        stage.stops, len(stage.comparison.wrong),
    ]  # fmt: skip


def _details(stage: Stage) -> dict[str, object]:
    return {
        "rate": stage.rate,
        "evidence": without_rtt(stage.evidence),
        "wrong": [frame.coded.hex() for frame in stage.comparison.wrong],
        "damaged_to_robot": stage.damaged_there,
        "damaged_to_host": stage.damaged_back,
    }


def verdict(stages: list[Stage]) -> Verdict:
    """The line's own health where nothing was injected, and what injected errors did."""
    findings: list[Finding] = []
    for stage in stages:
        at = f"at bit errors of {one_in(stage.rate)}" if stage.rate else "with no errors injected"
        if stage.comparison.wrong:
            count = len(stage.comparison.wrong)
            findings.append(
                Finding(Grade.UNSAFE, f"Unsafe: {count} commands nobody had sent were accepted {at}.")
            )
        if not stage.rate:
            findings += judge(stage.evidence).findings
            continue
        ages = sorted(stage.ages_ms)
        age_ms = quantile(ages, 0.99) if ages else float("inf")
        if stage.rate <= AGE_LIMIT_RATE and age_ms > AGE_LIMIT_MS:
            findings.append(Finding(Grade.FAULTY, f"Setpoints are too old {at}: p99 {age_ms:.0f} ms."))
        if stage.rate <= AGE_LIMIT_RATE and stage.stops:
            findings.append(Finding(Grade.FAULTY, f"The robot stopped itself {stage.stops} times {at}."))
    injected = [stage for stage in stages if stage.rate]
    if not findings and injected:
        damaged = sum(stage.damaged_there for stage in injected)
        text = f"Healthy. Of {damaged:,} commands damaged on purpose none was obeyed wrongly."
        findings.append(Finding(Grade.HEALTHY, text))
    return Verdict(tuple(sorted(findings, key=lambda finding: -finding.grade)))


def _plots(stages: list[Stage]) -> list[Plot]:
    injected = [stage for stage in stages if stage.rate and stage.ages_ms]
    if len(injected) < 2:
        return []
    rates = [stage.rate for stage in injected]
    ages = [
        Series(name, rates, [quantile(sorted(stage.ages_ms), share) for stage in injected])
        for name, share in (("median", 0.5), ("99 %", 0.99), ("oldest", 1.0))
    ]
    lost = [
        Series(
            "to the robot", rates, [_share(stage.evidence.robot, stage.evidence.sent) for stage in injected]
        ),
        Series("to the host", rates, [_share(stage.evidence.host, _sent_back(stage)) for stage in injected]),
    ]
    return [
        Plot(
            "Age of the setpoint obeyed", "line", "bit error rate", "ms", ages, log_x=True, limit=AGE_LIMIT_MS
        ),
        Plot("Frames lost", "line", "bit error rate", "%", lost, log_x=True),
    ]


def _share(counters: dict[str, int], sent: int) -> float:
    return 100.0 * counters.get("lost", 0) / max(sent, 1)


def _sent_back(stage: Stage) -> int:
    return stage.evidence.host.get("frames", 0) + stage.evidence.host.get("lost", 0)
