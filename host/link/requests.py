"""One request to the robot, done exactly once or not at all: when to send it, and what became of it. No I/O.

A request keeps its number for life and is repeated until telemetry shows that number; the robot takes each
number once. A request that nobody wants any more is not repeated, and what became of it is told all the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from host.errors import DeviceError
from host.link.explain import FAULTS, REFUSALS
from host.link.protocol import Fault, Outcome, Refusal, Request, Telemetry

REPEAT_S = 0.03
KEEP_ALIVE_S = 0.02  # nobody confirms it: nine lost in a row, and the robot brakes
TAKE_S = 1.0  # a request that telemetry does not show after this is not sent any more
SETTLE_S = 0.3  # after the last time it was sent, until which a copy may still be under way


@dataclass(frozen=True)
class Result:
    """What became of a request."""

    outcome: Outcome  # NONE: the robot never took it, and will not
    reason: Refusal = Refusal.NONE
    fault: Fault = Fault.NONE  # which one, with reason BY_FAULT

    @property
    def done(self) -> bool:
        """To its end."""
        return self.outcome == Outcome.DONE

    def __str__(self) -> str:
        if self.outcome == Outcome.DONE:
            return "done"
        if self.outcome == Outcome.NONE:
            return "not begun: the request did not reach the robot; check the cable, then try again"
        begun = "ended early" if self.outcome == Outcome.ABORTED else "refused"
        why = FAULTS[self.fault] if self.reason == Refusal.BY_FAULT else REFUSALS[self.reason]
        return f"{begun} ({self.reason.name}): {why}"

    def require_done(self, what: str) -> None:
        """DeviceError, naming `what` was asked for, unless it was done."""
        if not self.done:
            raise DeviceError(f"{what}: {self}")


class Errand:
    """One request on its way.

    Attributes
    ----------
    number : int
        The request's number.
    is_move : bool
        Whether KEEP_ALIVE is to follow.
    taken : bool
        Whether the robot has said that it has it.
    result : Result or None
        What became of it; None as long as it is not over.
    """

    def __init__(
        self, make: Callable[[int, int], Request], number: int, *, is_move: bool, begun_s: float
    ) -> None:
        self.number = number
        self.is_move = is_move
        self.taken = False
        self.result: Result | None = None
        self._make = make  # of its number and, for a move, its deadline
        self._begun_s = begun_s
        self._sent_s = -math.inf
        self._kept_alive_s = -math.inf
        self._wanted = True

    def withdraw(self) -> None:
        """Send it no more, and keep it alive no more."""
        self._wanted = False

    def to_send(self, now_s: float, expires_us: int) -> Request | None:
        """The request, when it is time to send it (again)."""
        if self.result or self.taken or not self._wanted or now_s - self._sent_s < REPEAT_S:
            return None
        if now_s - self._begun_s > TAKE_S:
            self._wanted = False
            return None
        self._sent_s = now_s
        return self._make(self.number, expires_us)

    def keep_alive(self, now_s: float) -> bool:
        """Whether it is time for a KEEP_ALIVE."""
        running = self.is_move and self.taken and self._wanted and not self.result
        if not running or now_s - self._kept_alive_s < KEEP_ALIVE_S:
            return False
        self._kept_alive_s = now_s
        return True

    def hear(self, report: Telemetry, now_s: float) -> None:
        """Learn from telemetry of the start of the robot that the request was meant for."""
        if self.result:
            return
        ahead = (report.request - self.number) & 0xFFFF
        if ahead == 0:
            self.taken = True
            if report.outcome != Outcome.RUNNING:
                fault = report.fault if report.reason == Refusal.BY_FAULT else Fault.NONE
                self.result = Result(report.outcome, report.reason, fault)
        elif ahead < 1 << 15:  # a later one, which is not ours
            self.result = Result(Outcome.REFUSED, Refusal.OLD_REQUEST)
        elif not self._wanted and now_s - self._sent_s > SETTLE_S:
            self.result = Result(Outcome.NONE)

    def lose(self) -> None:
        """The robot it was meant for has restarted: it will not be done any more."""
        if self.result is None:
            self.result = Result(Outcome.ABORTED, Refusal.BAD_NONCE) if self.taken else Result(Outcome.NONE)
