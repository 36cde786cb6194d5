"""What can go wrong, as a person should read it, with the exit code each kind ends in."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable

EXIT_DONE = 0
EXIT_USAGE = 2
EXIT_INPUT = 3
EXIT_DEVICE = 4
EXIT_SAFETY = 5
EXIT_INTERRUPTED = 130


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


class SafetyStop(RobotError):
    """The robot stopped itself."""

    exit_code = EXIT_SAFETY


def run_command(command: Callable[[], int | None]) -> None:
    """Run a command's body; exit with its code, and turn a RobotError into one line on stderr."""
    try:
        sys.exit(command() or EXIT_DONE)
    except RobotError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
    except BrokenPipeError:  # whoever reads our output, such as head, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(EXIT_DONE)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(EXIT_INTERRUPTED)
