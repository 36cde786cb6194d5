"""Who answers questions while the robot is looked at: a person at a terminal, or nobody."""

from __future__ import annotations

import select
import sys
import termios
from collections.abc import Callable
from typing import Protocol


class Person(Protocol):
    """Somebody who may be there."""

    @property
    def there(self) -> bool:
        """Whether there is anybody to ask."""
        ...

    def ask(self, question: str, meanwhile: Callable[[], object]) -> str:
        """What they answer, in small letters; `meanwhile` is called ten times a second until they do."""
        ...


class AtTerminal:
    """Whoever sits at the terminal that this was started from."""

    @property
    def there(self) -> bool:
        """Whether questions and answers go to and from a terminal."""
        return sys.stdin.isatty() and sys.stderr.isatty()

    def ask(self, question: str, meanwhile: Callable[[], object]) -> str:
        """Show the question and wait for a line; nothing where the input ends."""
        # What was typed before it was asked is no answer: wheels may turn at a yes.
        termios.tcflush(sys.stdin, termios.TCIFLUSH)
        print(f"{question} ", end="", file=sys.stderr, flush=True)
        while not select.select([sys.stdin], [], [], 0.1)[0]:
            meanwhile()
        return sys.stdin.readline().strip().lower()


def says_yes(answer: str) -> bool:
    """Only a plain yes is one."""
    return answer in ("y", "yes")
