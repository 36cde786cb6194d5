"""Round trips of PING and PONG, and the robot's clock against ours. Moves nothing."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from host.errors import UsageError
from host.link.bench.caller import STEP_S, Caller
from host.link.bench.frames import Frame
from host.link.bench.result import Plot, Result, Series
from host.link.bench.target import open_target
from host.link.bench.terminal import progress
from host.link.bench.verdict import judge
from host.link.bench.witness import Witness
from host.link.protocol import Ping, Pong

GIVE_UP_S = 0.25  # a PONG that takes longer is lost
FEWEST_FOR_DRIFT = 50


@dataclass(frozen=True)
class EchoOptions:
    """Measure round trips and the drift of the robot's clock. Moves nothing."""

    robot: str = "sim:"  # auto, a port such as /dev/ttyACM0, or sim: or avr:, as in sim:?seed=3
    count: int = 1000  # of round trips
    period_ms: float = 10.0  # from one to the next
    json: Path | None = None  # write all figures to this file
    html: Path | None = None  # write a page with plots to this file

    def __post_init__(self) -> None:
        if not 1 <= self.count <= 1_000_000:
            raise UsageError(f"--count must be from 1 to 1000000, not {self.count}")
        if not 1.0 <= self.period_ms <= 10_000.0:
            raise UsageError(f"--period-ms must be from 1 to 10000, not {self.period_ms:g}")


class _Echoes:
    """Every PONG with when its PING left."""

    def __init__(self) -> None:
        self.sent_s: dict[int, float] = {}
        self.answers: list[tuple[float, float, int]] = []  # sent, come back, robot's clock

    def see(self, frame: Frame) -> None:
        match frame.message:
            case Ping():
                self.sent_s[frame.message.host_time_us] = frame.t_s
            case Pong():
                sent_s = self.sent_s.pop(frame.message.host_time_us, None)
                if sent_s is not None:
                    self.answers.append((sent_s, frame.t_s, frame.message.mcu_time_us))


def run(options: EchoOptions) -> Result:
    """The measurement."""
    echoes, witness = _Echoes(), Witness()
    with open_target(options.robot) as target, progress("echo", options.count) as advance:
        caller = Caller(target)
        caller.begin()
        target.near.on_frame += [witness.see, echoes.see]
        for token in range(options.count):
            began_s = target.clock.now_s()
            caller.send(Ping(token))
            while token in echoes.sent_s and target.clock.now_s() - began_s < GIVE_UP_S:
                target.wait_s(STEP_S)
                target.near.read()
            while target.clock.now_s() - began_s < 1e-3 * options.period_ms:
                target.wait_s(STEP_S)
                target.near.read()
            advance(1)
    evidence = witness.evidence()
    drift_ppm, drift_sigma = drift(echoes.answers)
    evidence.drift_ppm = drift_ppm
    rtt = np.array([1000 * (back - sent) for sent, back, _ in echoes.answers])
    figures = ("median", 50), ("95 %", 95), ("99 %", 99), ("longest", 100)
    rows = [
        [f"round trip, {name}", float(np.percentile(rtt, q)) if len(rtt) else None, "ms"]
        for name, q in figures
    ]
    rows += [
        ["answered", len(echoes.answers), f"of {options.count}"],
        ["robot's clock, fast", drift_ppm, "ppm" if drift_sigma is None else f"ppm ± {drift_sigma:.1f}"],
        ["telemetry", evidence.telemetry_hz, "Hz"],
    ]
    return Result(
        "echo", options.robot, {"count": options.count, "period_ms": options.period_ms},
        ["figure", "value", "unit"], rows, judge(evidence), _plots(rtt, echoes.answers),
        {"evidence": vars(evidence) | {"rtt_ms": rtt.round(4).tolist()}},
    )  # fmt: skip


def drift(answers: list[tuple[float, float, int]]) -> tuple[float | None, float | None]:
    """By how many ppm the robot's clock runs faster than the host's, and the standard error.

    A line through the faster half of the round trips, whose middle is when the robot's clock was read.
    """
    if len(answers) < FEWEST_FOR_DRIFT:
        return None, None
    sent, back, mcu = (np.array(column, float) for column in zip(*answers, strict=True))
    mcu_s = 1e-6 * np.unwrap(mcu, period=2.0**32)
    quick = back - sent <= np.median(back - sent)
    middle = ((sent + back) / 2)[quick]
    ahead = (mcu_s - mcu_s[0])[quick] - (middle - middle[0])
    x = middle - middle.mean()
    slope = float((x @ ahead) / (x @ x))
    left = ahead - ahead.mean() - slope * x
    sigma = float(np.sqrt((left @ left) / max(len(x) - 2, 1) / (x @ x)))
    return 1e6 * slope, 1e6 * sigma


def _plots(rtt: np.ndarray, answers: list[tuple[float, float, int]]) -> list[Plot]:
    if not len(rtt):
        return []
    top = float(max(np.percentile(rtt, 99.5) * 1.2, 2.0))
    counts, edges = np.histogram(np.minimum(rtt, top), bins=60, range=(0.0, top))
    spread = Series("round trips", edges.round(4).tolist(), counts.astype(float).tolist())
    start_s = answers[0][0]
    over_time = Series(
        "round trip", [round(sent - start_s, 4) for sent, *_ in answers], rtt.round(4).tolist()
    )
    return [
        Plot("Round trips (the last bin holds all longer ones)", "histogram", "ms", "how many", [spread]),
        Plot("Round trips over time", "points", "s", "ms", [over_time]),
    ]
