"""What can go wrong, as a person should read it, with the exit code each kind ends in."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from importlib.util import find_spec
from types import TracebackType

EXIT_DONE = 0
EXIT_USAGE = 2
EXIT_INPUT = 3
EXIT_DEVICE = 4
EXIT_SAFETY = 5
EXIT_DIFFERENT = 6  # a replay came to something else than the drive did
EXIT_INTERRUPTED = 130

ENDINGS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)  # a closed terminal is as Ctrl-C


class RobotError(Exception):
    """One line for a person: what is wrong, where, and how to fix it."""

    exit_code = 1


class UsageError(RobotError):
    """A command line or configuration that cannot be followed."""

    exit_code = EXIT_USAGE


class InputError(RobotError):
    """A file or frame that is unreadable or contradicts another."""

    exit_code = EXIT_INPUT


class DeviceError(RobotError):
    """The camera or the link does not answer."""

    exit_code = EXIT_DEVICE


def tell(text: str) -> None:
    """One line for the person at the terminal: nothing is wrong, or not so wrong as to end the program."""
    print(text, file=sys.stderr, flush=True)


def begin_command() -> None:
    """To be called before a command's slow imports: what goes wrong among them gets one line as well.

    Ends the program where the checkout was not set up, and at Ctrl-C until `run_command` takes over.
    """
    for number in ENDINGS:
        if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:  # nohup asks to go on
            signal.signal(number, _leave_early)
    sys.excepthook = _leave_unimported
    packages = ("numpy", "cv2", "rich", "serial", "tyro", "aiohttp", "mcap")
    modules = ("host.rbdn._core", "host.depth._depth", "host.nav._nav", "host.sim._render", "host.sim._board")
    # Looking for a module of ours imports the package around it, which needs the others.
    missing = [name for name in packages if find_spec(name) is None]
    missing = missing or [name for name in modules if find_spec(name) is None]
    if missing:
        print(
            f"error: {', '.join(missing)} not found: run 'make setup', then use .venv/bin/python",
            file=sys.stderr,
        )
        sys.exit(EXIT_USAGE)


def _leave_early(*_: object) -> None:
    print("interrupted", file=sys.stderr)
    sys.stderr.flush()
    os._exit(EXIT_INTERRUPTED)  # nothing is open yet, and half-done imports do not unwind cleanly


def _leave_unimported(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """What is there and does not load, as a library that lacks another, gets one line as well."""
    if not isinstance(error, ImportError):
        sys.__excepthook__(kind, error, trace)
        return
    print(f"error: {_unimported(error)}", file=sys.stderr)
    sys.stderr.flush()
    os._exit(EXIT_USAGE)  # which this hook cannot tell otherwise


def _unimported(error: ImportError) -> str:
    return f"{_line(error)}: run 'make setup'; 'python -m host.doctor' tells what is missing"


def _line(error: object) -> str:
    """Without what a terminal would obey: a server may have said it, or a file be called so."""
    return "".join(letter if letter.isprintable() else " " for letter in str(error))


def run_command(command: Callable[[], int | None]) -> None:
    """Run a command's body; exit with its code, and turn a RobotError into one line on stderr."""
    for number in ENDINGS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler)
    try:
        sys.exit(command() or EXIT_DONE)
    except RobotError as error:
        print(f"error: {_line(error)}", file=sys.stderr)
        sys.exit(error.exit_code)
    except ImportError as error:
        print(f"error: {_unimported(error)}", file=sys.stderr)
        sys.exit(EXIT_USAGE)
    except BrokenPipeError:  # whoever reads our output, such as head, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(EXIT_DONE)
    except OSError as error:  # that no place foresaw: a name too long, a disk that is full
        where = f"{_line(error.filename)}: " if isinstance(error.filename, str | os.PathLike) else ""
        print(f"error: {where}{error.strerror or error}; choose another place", file=sys.stderr)
        sys.exit(EXIT_INPUT)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(EXIT_INTERRUPTED)
