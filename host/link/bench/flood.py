"""As many frames as the line takes, both ways at once: what is lost, and does telemetry keep its pace?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from host.errors import UsageError
from host.link.bench.caller import Caller
from host.link.bench.result import Cell, Plot, Result, Series
from host.link.bench.target import Target, open_target
from host.link.bench.terminal import Advance, progress
from host.link.bench.verdict import judge, quantile
from host.link.bench.witness import Evidence, Witness, without_rtt
from host.link.protocol import (
    BAUD,
    LAYOUTS,
    LINK_STATUS_PERIOD_US,
    OVERHEAD,
    TELEMETRY_PERIOD_US,
    LinkStatus,
    Ping,
    Pong,
    Stop,
    Telemetry,
    encode,
)

LOADS = (25, 50, 75, 100)  # percent of the line to the robot
STEP_S = 0.001
SETTLE_S = 0.5  # before and after, so that all has come and both ends have told their counters
BYTES_S = BAUD / 10


def _reports_bytes_s() -> float:
    """What the robot sends unasked."""
    telemetry, status = (LAYOUTS[kind.ID].size + OVERHEAD + CODING for kind in (Telemetry, LinkStatus))
    return 1e6 / TELEMETRY_PERIOD_US * telemetry + 1e6 / LINK_STATUS_PERIOD_US * status


CODING = 3  # a delimiter before the frame and one behind it, and the first COBS code


ANSWERS_SHARE = 0.95  # of the way back that answers and reports together may fill
PONG_BYTES = 1 + len(encode(Pong(1, 1), 1))


@dataclass(frozen=True)
class FloodOptions:
    """Fill the line both ways and count what is lost. Moves nothing."""

    robot: str = "sim:"  # auto, a port such as /dev/ttyACM0, or sim: or avr:, as in sim:?seed=3
    seconds: float = 5.0  # at each load
    json: Path | None = None  # write all figures to this file
    html: Path | None = None  # write a page with plots to this file

    def __post_init__(self) -> None:
        if not 1.0 <= self.seconds <= 3600.0:
            raise UsageError(f"--seconds must be from 1 to 3600, not {self.seconds:g}")


def run(options: FloodOptions) -> Result:
    """The measurement."""
    rows: list[list[Cell]] = []
    whole = Witness()
    stages: list[Evidence] = []
    with open_target(options.robot) as target:
        total_s = len(LOADS) * (options.seconds + 2 * SETTLE_S)
        with progress("flood", total_s) as advance:
            caller = Caller(target)
            caller.begin()
            target.near.on_frame.append(whole.see)
            for load in LOADS:
                stage = _flood(target, caller, load / 100, options.seconds, advance)
                stages.append(stage)
                rows.append(_row(load, stage, options.seconds))
    evidence = whole.evidence()
    loads = [float(load) for load in LOADS]
    columns = (
        "load to the robot", "frames/s there", "answers/s", "telemetry Hz", "lost there", "lost back",
        "unsent by robot", "round trip p99 ms",
    )  # fmt: skip
    plots = [
        Plot("Round trips under load", "line", "load to the robot, %", "ms", [
            Series("median", loads, [_rtt(stage, 0.5) or 0.0 for stage in stages]),
            Series("99 %", loads, [_rtt(stage, 0.99) or 0.0 for stage in stages]),
        ]),
        Plot("Telemetry under load", "line", "load to the robot, %", "Hz", [
            Series("telemetry", loads, [stage.telemetry_hz or 0.0 for stage in stages]),
        ]),
    ]  # fmt: skip
    evidence.rtt_ms = stages[0].rtt_ms  # a full line is slow without being ill
    verdict = judge(evidence)
    details = {"evidence": without_rtt(evidence), "stages": [without_rtt(stage) for stage in stages]}
    return Result(
        "flood", options.robot, {"seconds": options.seconds}, list(columns), rows, verdict, plots, details
    )


def _flood(target: Target, caller: Caller, load: float, seconds: float, advance: Advance) -> Evidence:
    witness = Witness()
    target.near.on_frame.append(witness.see)
    _listen(target, SETTLE_S)
    answers_s = (ANSWERS_SHARE * BYTES_S - _reports_bytes_s()) / PONG_BYTES
    begin_s = target.clock.now_s()
    sent_bytes, pings = 0, 0
    while (passed_s := target.clock.now_s() - begin_s) < seconds:
        while sent_bytes < load * BYTES_S * passed_s:
            if pings < answers_s * passed_s:
                pings += 1
                sent_bytes += caller.send(Ping(pings))
            else:  # STOP is answered by nothing, and stops what stands
                sent_bytes += caller.send(Stop())
        target.wait_s(STEP_S)
        target.near.read()
        advance(STEP_S)
    _listen(target, SETTLE_S)
    target.near.on_frame.remove(witness.see)
    return witness.evidence()


def _listen(target: Target, seconds: float) -> None:
    """Read on until as much time has passed."""
    begin_s = target.clock.now_s()
    while target.clock.now_s() - begin_s < seconds:
        target.wait_s(STEP_S)
        target.near.read()


def _rtt(stage: Evidence, share: float) -> float | None:
    return quantile(sorted(stage.rtt_ms), share) if stage.rtt_ms else None


def _row(load: int, stage: Evidence, seconds: float) -> list[Cell]:
    there = stage.robot.get("lost", 0)
    return [
        f"{load} %", stage.sent / seconds, stage.answered / seconds, stage.telemetry_hz,
        there, stage.host.get("lost", 0), stage.robot.get("tx_dropped", 0), _rtt(stage, 0.99),
    ]  # fmt: skip
