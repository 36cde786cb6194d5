"""What commands that take their time show on the terminal; nothing where nobody looks."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Self


@contextlib.contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[], None]]:
    """A bar on stderr where that is a terminal; calls of what it gives bring it on by one of `total`."""
    from rich.console import Console  # not needed for --help
    from rich.progress import Progress

    console = Console(stderr=True)
    with Progress(console=console, disable=not console.is_terminal, transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda: bar.advance(task)


class LiveText:
    """Text on stderr that is written over in place; `shown` is false where that is no terminal.

    Parameters
    ----------
    every_s
        It is written over no more often than this.
    transient
        It goes at the end.
    """

    def __init__(self, every_s: float, *, transient: bool) -> None:
        from rich.console import Console  # not needed for --help
        from rich.live import Live

        console = Console(stderr=True)
        self.shown = console.is_terminal
        self._every_s = every_s
        self._live = Live(console=console, transient=transient, auto_refresh=False)
        self._written_s = -math.inf

    def __enter__(self) -> Self:
        if self.shown:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.shown:
            self._live.stop()

    def show(self, text: Callable[[], str], *, at_once: bool = False, cut: bool = False) -> None:
        """Write what `text` gives, unless it is too soon and not wanted at once; `cut` keeps lines short."""
        now_s = time.monotonic()
        if not self.shown or (now_s - self._written_s < self._every_s and not at_once):
            return
        from rich.text import Text

        self._written_s = now_s
        line = Text(text(), overflow="ellipsis", no_wrap=True) if cut else Text(text())
        self._live.update(line, refresh=True)
