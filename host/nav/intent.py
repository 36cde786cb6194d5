"""What steering remembers from one decision to the next."""

from __future__ import annotations

import math
from dataclasses import dataclass

from host.nav.crossing import Crossing
from host.nav.plan import Way


@dataclass(frozen=True)
class Wait:
    """For something that moves to be gone, nobody knows where to."""

    since_s: float
    last_s: float  # when it last came too near
    reason: str


@dataclass(frozen=True)
class Cross:
    """A crossing of the line of something that moves, and how far it is."""

    crossing: Crossing
    found_s: float
    there: bool = False  # where it begins, waiting
    under_way: bool = False  # across

    @property
    def aim(self) -> tuple[float, float]:
        """(x, z) to go next."""
        return self.crossing.end if self.there or self.under_way else self.crossing.begin


@dataclass(frozen=True)
class Glance:
    """A look, by turning in place, at floor that the robot is about to go over and never looked at."""

    here: tuple[float, float]
    heading: float  # of the way
    side: float  # where it looks now: 1.0 right of the way, -1.0 left
    viewed_s: float | None = None  # since when what it has not seen there is well in view


@dataclass(frozen=True)
class Stuck:
    """Where all is shut right at the rim: it turns once all round to see that anew, and no more."""

    here: tuple[float, float]
    heading: float  # last
    turned_rad: float = 0.0


@dataclass(frozen=True)
class Plan:
    """What steering remembers from one decision to the next."""

    way: Way | None = None  # None: nothing leads nearer to the goal
    made_s: float = -math.inf
    found_s: float = -math.inf  # when the way was searched for
    wait: Wait | None = None  # for something that moves nobody knows where to
    v_cm_s: float = 0.0  # forward speed last told
    cross: Cross | None = None  # of the line of something that moves
    no_cross_s: float = -math.inf  # until then it does not look for another one: the last was shut
    shut_s: float | None = None  # since when it has stood before one across which nothing leads
    unseen: bool = False  # the piece to the aim leads over floor that nobody has seen
    aim: tuple[float, float] | None = None
    piece_from: tuple[float, float] | None = None  # where the present straight piece began; None: turning
    glance: Glance | None = None  # under way
    hidden: tuple[tuple[float, float], ...] = ()  # (x, z) that did not come to sight from `hidden_from`
    hidden_from: tuple[float, float] | None = None
    stuck: Stuck | None = None
    lost_s: float | None = None  # since when there has been no way
    back_from: tuple[float, float] | None = None  # where it began to step back from what covers the goal
    stepped_back: bool = False  # it has done so, and does it no more
    set_down: bool = True  # by somebody who has looked around it
    begun: bool = False  # the first steps, which nothing but the view ahead guides, are made
    start: tuple[float, float] | None = None  # where the axle's middle stood at the first decision
    looked_rad: float = 0.0  # turned while looking for a way
    last_heading: float = 0.0
