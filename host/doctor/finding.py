"""What one check found: well, doubtful, wrong, or not tried, and what to do about it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from host.errors import EXIT_DEVICE, EXIT_DONE, EXIT_INPUT, EXIT_SAFETY, EXIT_USAGE, RobotError


class Outcome(StrEnum):
    """How it went."""

    OK = "ok"
    WARN = "warn"
    FAIL = "FAIL"
    UNTRIED = "not tried"


# Parts in the order in which to mend them, with the exit code of a failure.
EXIT_CODES = {
    "installation": EXIT_USAGE,
    "camera": EXIT_DEVICE,
    "robot": EXIT_DEVICE,
    "wheels": EXIT_SAFETY,
    "calibration": EXIT_INPUT,
    "timing": EXIT_DEVICE,
}


@dataclass(frozen=True)
class Finding:
    """One line of the table."""

    part: str  # of EXIT_CODES
    name: str  # what was looked at
    outcome: Outcome
    told: str  # what was seen, or why it was not tried
    fix: str = ""  # what to do, in one line; empty where all is well

    def __post_init__(self) -> None:
        if self.outcome in (Outcome.WARN, Outcome.FAIL) and not self.fix:
            raise ValueError(f"{self.part}, {self.name}: what is wrong needs a way to mend it")


class Part:
    """Makes the findings of one part."""

    def __init__(self, part: str) -> None:
        if part not in EXIT_CODES:
            raise ValueError(f"no part is called {part!r}")
        self._part = part

    def ok(self, name: str, told: str) -> Finding:
        """All is well."""
        return Finding(self._part, name, Outcome.OK, told)

    def warn(self, name: str, told: str, fix: str) -> Finding:
        """It will work, but not as well as it could, or not for long."""
        return Finding(self._part, name, Outcome.WARN, told, fix)

    def fail(self, name: str, told: str, fix: str) -> Finding:
        """It does not work."""
        return Finding(self._part, name, Outcome.FAIL, told, fix)

    def untried(self, name: str, why: str, fix: str = "") -> Finding:
        """It was not looked at."""
        return Finding(self._part, name, Outcome.UNTRIED, why, fix)

    def error(self, name: str, error: RobotError) -> Finding:
        """It does not work, as an error says that names its own remedy."""
        return self.fail(name, *split_error(error))


def split_error(error: RobotError | str) -> tuple[str, str]:
    """What is wrong, and the remedy, which our messages put last."""
    text = str(error)
    parted = re.match("(.*); (.*)", text) or re.match("(.*)(?<!sim)(?<!avr): (.*)", text)  # these are URIs
    return (parted[1], parted[2]) if parted else (text, "see docs/hardware.md")


def exit_code(findings: Iterable[Finding]) -> int:
    """Of all that failed the gravest, which is the highest: wheels, then camera and robot, then files."""
    failed = (EXIT_CODES[one.part] for one in findings if one.outcome == Outcome.FAIL)
    return max(failed, default=EXIT_DONE)
