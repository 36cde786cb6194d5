"""Runs spread over processes, with a progress bar on a terminal."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context

from host.errors import DeviceError
from host.experiments.findings import RunResult
from host.experiments.run import run_task
from host.experiments.task import Task


def run_all(tasks: Sequence[Task], jobs: int) -> list[RunResult]:
    """The tasks' results in the tasks' order, which does not depend on `jobs`.

    Raises
    ------
    DeviceError
        where the system ended a worker, for want of memory as a rule.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    console = Console(stderr=True)
    columns = ("{task.description}", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with (
        Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar,
        ProcessPoolExecutor(jobs, get_context("spawn"), _begin_worker) as pool,
    ):
        shown = bar.add_task("running", total=len(tasks))
        futures = [pool.submit(run_task, task) for task in tasks]
        try:
            for done in as_completed(futures):
                done.result()
                bar.advance(shown)
        except BrokenProcessPool as error:
            raise DeviceError("a worker process was ended from outside: try again with --jobs 1") from error
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        return [future.result() for future in futures]


def _begin_worker() -> None:
    """Leave Ctrl-C to the parent, and OpenCV's threads to the other workers."""
    import cv2

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    cv2.setNumThreads(1)
