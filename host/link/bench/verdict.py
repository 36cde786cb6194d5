"""The health of a line in plain words: one rule after another, from counters of both ends."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

from host.link.bench.witness import Evidence

SLOW_MS = 20.0  # median round trip; a USB serial adapter answers within 2
UNEVEN_MS = 10.0  # by which the slowest hundredth may exceed the median
TELEMETRY_HZ = 100.0
TELEMETRY_SHORT = 0.95  # of it
DRIFT_PPM = 10_000.0  # a ceramic resonator is within 5000
SILENCE_S = 0.25  # what the host takes for a lost robot
FEW_PINGS = 20  # fewer say nothing about the slowest hundredth
BROKEN = ("crc", "framing", "overlong")  # what bit errors make of a frame
FOREIGN = ("unknown", "length", "value")  # right checksum, and yet not understood


class Grade(IntEnum):
    """How bad a finding is."""

    HEALTHY = 0
    NOTE = 1  # worth knowing, harms nothing yet
    FAULTY = 2  # something is to be repaired
    UNSAFE = 3  # what must never happen has happened


@dataclass(frozen=True)
class Finding:
    """One thing found."""

    grade: Grade
    text: str


@dataclass(frozen=True)
class Verdict:
    """All that was found, worst first."""

    findings: tuple[Finding, ...]

    @property
    def grade(self) -> Grade:
        """Of the worst finding."""
        return max((finding.grade for finding in self.findings), default=Grade.HEALTHY)

    @property
    def text(self) -> str:
        """In one paragraph."""
        return " ".join(f.text for f in self.findings) or "Healthy."


def judge(evidence: Evidence) -> Verdict:
    """What the evidence says about a line on which nobody injected any faults."""
    if evidence.telemetry == 0 and not evidence.host.get("frames", 0):
        return Verdict((*_violations(evidence), _nothing_understood(evidence)))
    rules = (_violations, _restarts, _inside_robot, _bit_errors, _vanished, _twice, _foreign, _timing, _clock,
             _stops)  # fmt: skip
    findings = [finding for rule in rules for finding in rule(evidence)]
    return Verdict(tuple(sorted(findings, key=lambda finding: -finding.grade)))


def bit_error_rate(broken: int, frames: int, bits: int) -> float:
    """Of a line on which `broken` of `frames` frames with `bits` bits in all had at least one bit wrong."""
    if not broken or not frames or not bits:
        return 0.0
    share = min(broken / frames, 1.0 - 0.5 / frames)
    return -math.log1p(-share) * frames / bits


def one_in(rate: float) -> str:
    """A rate as "1 in 9,000", to about two digits."""
    every = 1.0 / rate
    digits = max(0, math.floor(math.log10(every)) - 1) if every >= 1 else 0
    return f"1 in {round(every / 10**digits) * 10**digits:,}"


# --- Rules --------------------------------------------------------------------------------------


def _violations(evidence: Evidence) -> list[Finding]:
    return [Finding(Grade.UNSAFE, f"Unsafe: {text}.") for text in evidence.violations]


def _nothing_understood(evidence: Evidence) -> Finding:
    if evidence.bits_to_host:
        return Finding(
            Grade.FAULTY,
            "Bytes come from the robot, but no frame among them is whole: another baud rate, another "
            "program on the board, or a line full of noise.",
        )
    return Finding(
        Grade.FAULTY,
        "Nothing was heard: the robot has no power, this is not its port, or its firmware is not flashed.",
    )


RESTARTS = {
    "power on": "its power went away: battery, switch or plug",
    "brown out": "its supply dipped: battery or regulator",
    "external": "its reset pin was pulled: another program opened the port, or the reset line catches noise",
    "watchdog": "its program hung and the watchdog ended it: a fault of the firmware",
    "unknown": "why is not known, power as a rule",
}


def _restarts(evidence: Evidence) -> list[Finding]:
    findings = []
    for cause in dict.fromkeys(evidence.restarts):
        times = _times(evidence.restarts.count(cause))
        why = RESTARTS.get(cause, RESTARTS["unknown"])
        findings.append(Finding(Grade.FAULTY, f"The robot restarted {times}: {why}."))
    return findings


def _inside_robot(evidence: Evidence) -> list[Finding]:
    findings = []
    if lost := evidence.robot.get("rx_overrun", 0):
        findings.append(
            Finding(
                Grade.FAULTY,
                f"Bytes are lost inside the robot: {lost:,} came faster than its program fetched them.",
            )
        )
    if dropped := evidence.robot.get("tx_dropped", 0):
        findings.append(
            Finding(
                Grade.NOTE,
                f"The robot left {dropped:,} messages unsent for want of room: it was asked for more than "
                "the line carries.",
            )
        )
    return findings


def _bit_errors(evidence: Evidence) -> list[Finding]:
    rates = {}
    ways = (
        ("towards the robot", evidence.robot, evidence.bits_to_robot),
        ("towards the host", evidence.host, evidence.bits_to_host),
    )
    for way, counters, bits in ways:
        broken = sum(counters.get(name, 0) for name in BROKEN)
        if counters is evidence.robot and counters.get("rx_overrun", 0):
            continue  # lost bytes break frames too
        if rate := bit_error_rate(broken, broken + counters.get("frames", 0), bits):
            rates[way] = rate
    if len(rates) == 2:
        there, back = rates.values()
        told = f"about {one_in(there)} bits towards the robot and {one_in(back)} towards the host"
        return [Finding(Grade.FAULTY, f"Bit errors on the line both ways ({told}): cable or motor noise.")]
    return [
        Finding(
            Grade.FAULTY, f"Bit errors on the line {way} (about {one_in(rate)} bits): cable or motor noise."
        )
        for way, rate in rates.items()
    ]


def _vanished(evidence: Evidence) -> list[Finding]:
    findings = []
    for way, counters, where in (
        ("to the robot", evidence.robot, "the USB adapter, or a program between that drops them"),
        ("to the host", evidence.host, "this computer was too busy to read, or the USB adapter dropped them"),
    ):
        broken = sum(counters.get(name, 0) for name in BROKEN)
        dropped = evidence.robot.get("tx_dropped", 0) if counters is evidence.host else 0
        whole = counters.get("lost", 0) - broken - dropped
        if whole > 0.05 * broken and whole > 0 and not counters.get("rx_overrun", 0):
            findings.append(
                Finding(Grade.FAULTY, f"{_count(whole, 'frame')} vanished whole on the way {way}: {where}.")
            )
    return findings


def _twice(evidence: Evidence) -> list[Finding]:
    stale = evidence.robot.get("stale", 0) + evidence.host.get("stale", 0)
    if not stale:
        return []
    return [
        Finding(
            Grade.FAULTY,
            f"{_count(stale, 'frame')} came twice or out of order: something between the ends repeats them, "
            "or two programs talk at once.",
        )
    ]


def _foreign(evidence: Evidence) -> list[Finding]:
    foreign = sum(evidence.robot.get(name, 0) + evidence.host.get(name, 0) for name in FOREIGN)
    if not foreign and not evidence.refusals.get("schema"):
        return []
    return [
        Finding(
            Grade.FAULTY,
            "Messages arrive whole and are not understood: host and firmware are of different versions; "
            "flash the firmware that belongs to this program.",
        )
    ]


def _timing(evidence: Evidence) -> list[Finding]:
    findings = []
    if len(evidence.rtt_ms) >= FEW_PINGS:
        ordered = sorted(evidence.rtt_ms)
        median, p99 = quantile(ordered, 0.5), quantile(ordered, 0.99)
        slow, uneven = median > SLOW_MS, p99 - median > UNEVEN_MS
        told = f"half within {median:.1f} ms, 99 % within {p99:.1f} ms"
        if slow and uneven:
            text = f"Round trips are slow and uneven ({told}): USB hub or busy host."
        elif uneven:
            text = f"Round trips are uneven ({told}): USB hub or busy host."
        else:
            text = f"Round trips are slow ({told}): the latency timer of a USB adapter, 16 ms in some."
        if slow or uneven:
            findings.append(Finding(Grade.FAULTY, text))
    hz = evidence.telemetry_hz
    missing = evidence.host.get("lost", 0) or evidence.robot.get("tx_dropped", 0)
    if hz is not None and hz < TELEMETRY_SHORT * TELEMETRY_HZ and not missing:
        findings.append(
            Finding(
                Grade.FAULTY,
                f"The robot reports {hz:.0f} times a second instead of 100: its program is overloaded.",
            )
        )
    if evidence.longest_silence_s > SILENCE_S and not evidence.restarts:
        findings.append(
            Finding(
                Grade.FAULTY,
                f"Silence of {evidence.longest_silence_s:.2f} s: a loose plug, or this computer was asleep.",
            )
        )
    return findings


def _clock(evidence: Evidence) -> list[Finding]:
    if evidence.drift_ppm is None or abs(evidence.drift_ppm) <= DRIFT_PPM:
        return []
    return [
        Finding(
            Grade.FAULTY,
            f"The robot's clock is {abs(evidence.drift_ppm) / 1e4:.1f} % off, more than any resonator: "
            "another crystal than the firmware was built for.",
        )
    ]


def _stops(evidence: Evidence) -> list[Finding]:
    return [
        Finding(Grade.NOTE, f"The robot stopped itself {_times(count)}: {name}.")
        for name, count in evidence.faults.items()
    ]


# --- Words --------------------------------------------------------------------------------------


def quantile(ordered: list[float], share: float) -> float:
    """Of sorted numbers, the one that `share` of them do not exceed."""
    return ordered[min(len(ordered) - 1, max(0, math.ceil(share * len(ordered)) - 1))]


def _times(count: int) -> str:
    return {1: "once", 2: "twice"}.get(count, f"{count} times")


def _count(count: int, what: str) -> str:
    return f"1 {what}" if count == 1 else f"{count:,} {what}s"
