"""Every frame on a line as it comes, in words, broken ones with the reason. Only listens."""

from __future__ import annotations

import fnmatch
import math
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, fields
from enum import IntEnum
from pathlib import Path

from host.errors import UsageError
from host.link.bench.capture import CaptureWriter
from host.link.bench.frames import BROKEN, Frame
from host.link.bench.result import Cell, Result
from host.link.bench.target import open_target
from host.link.bench.verdict import judge
from host.link.bench.witness import Witness, without_rtt
from host.link.protocol import MESSAGES

STEP_S = 0.002
NAMES = sorted({kind.__name__.lower() for kind in MESSAGES} | set(BROKEN) | {"broken"})


@dataclass(frozen=True)
class MonitorOptions:
    """Show what the robot says, until Ctrl-C. Only listens, and moves nothing."""

    robot: str = "sim:"  # auto, a port such as /dev/ttyACM0, or sim: or avr:, as in sim:?seed=3
    only: str | None = None  # messages to show, such as nack,hello,broken; * stands for any letters
    hide: str | None = None  # messages not to show, such as telemetry,linkstatus
    seconds: float | None = None  # listen no longer than this
    capture: Path | None = None  # keep all bytes with their times in this file
    json: Path | None = None  # write all figures to this file
    html: Path | None = None  # write a page to this file

    def __post_init__(self) -> None:
        wanted(self.only, self.hide)
        if self.seconds is not None and not 0.0 < self.seconds < 1e9:
            raise UsageError(f"--seconds must be above 0, not {self.seconds:g}")


def run(options: MonitorOptions) -> Result | None:
    """Listen; what was heard, with a verdict, unless it ends by Ctrl-C."""
    show = wanted(options.only, options.hide)
    witness, tally = Witness(), Counter[str]()
    with ExitStack() as stack:
        target = stack.enter_context(open_target(options.robot))
        begin_s = target.clock.now_s()
        if options.capture is not None:
            writer = CaptureWriter(options.capture)
            stack.callback(writer.close)
            writer.add(begin_s, True, b"")
            target.near.on_bytes.append(writer.add)

        def see(frame: Frame) -> None:
            witness.see(frame)
            tally[kind_of(frame)] += 1
            if show(kind_of(frame)):
                print(line_of(frame, begin_s), flush=True)

        target.near.on_frame.append(see)
        until_s = math.inf if options.seconds is None else begin_s + options.seconds
        while target.clock.now_s() < until_s:
            target.near.read()
            target.wait_s(STEP_S)
    return result_of("monitor", options.robot, witness, tally)


def result_of(command: str, robot: str, witness: Witness, tally: Counter[str]) -> Result:
    """A table of what was heard, and the verdict."""
    evidence = witness.evidence()
    seconds = evidence.seconds
    rows: list[list[Cell]] = [
        [name, count, count / seconds if seconds else None] for name, count in sorted(tally.items())
    ]
    rows.append(["lost, by their numbers", evidence.host.get("lost", 0), None])
    return Result(
        command, robot, {"seconds": round(seconds, 3)}, ["frames", "count", "a second"], rows,
        judge(evidence), details={"evidence": without_rtt(evidence)},
    )  # fmt: skip


def wanted(only: str | None, hide: str | None) -> Callable[[str], bool]:
    """Which kinds to show; UsageError where a name can be none of them."""

    def patterns(option: str, text: str | None) -> list[str]:
        listed = [part.strip().lower().replace("_", "") for part in text.split(",")] if text else []
        for part in listed:
            if not any(fnmatch.fnmatchcase(name, part) for name in NAMES):
                raise UsageError(f"{option} {part}: no such message; they are {', '.join(NAMES)}")
        return listed

    shown, hidden = patterns("--only", only), patterns("--hide", hide)

    def matches(kind: str, listed: list[str]) -> bool:
        names = (kind, "broken") if kind in BROKEN else (kind,)
        return any(fnmatch.fnmatchcase(name, part) for name in names for part in listed)

    return lambda kind: (not shown or matches(kind, shown)) and not matches(kind, hidden)


def kind_of(frame: Frame) -> str:
    """Its message's name, or what is wrong with it."""
    if frame.message is not None:
        return type(frame.message).__name__.lower()
    return frame.error or "broken"


def line_of(frame: Frame, begin_s: float) -> str:
    """A frame in one line: time, direction, number, message and what it says."""
    arrow = "<" if frame.to_host else ">"
    start = f"{frame.t_s - begin_s:10.4f} {arrow}"
    lost = f"  ({frame.lost} lost before it)" if frame.lost else ""
    if frame.message is None:
        shown = frame.coded[:40].hex(" ") + (" ..." if len(frame.coded) > 40 else "")
        return f"{start}     BROKEN ({frame.error}) {shown}{lost}"
    said = " ".join(
        f"{field.name}={_value(getattr(frame.message, field.name), field.name)}"
        for field in fields(frame.message)
    )
    name = type(frame.message).__name__
    return f"{start} {frame.seq:3} {name:12} {said}{lost}".rstrip()


def _value(value: int, name: str) -> str:
    if isinstance(value, IntEnum):
        return value.name
    return f"{value:08x}" if name in ("boot_nonce", "schema_hash", "build_id") else str(value)
