"""Commands that have commands of their own, ``python -m PACKAGE NAME``, each in a module of the package."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Collection, Mapping
from importlib import import_module
from types import ModuleType
from typing import Any

from host.config import read_command_line, read_options
from host.errors import UsageError


def read_subcommand(
    package: str,
    commands: Mapping[str, str],
    about: str,
    unknown: str,
    arguments: list[str] | None,
    with_settings: Collection[str] = (),
) -> tuple[ModuleType, Any] | None:
    """The module of the command that is asked for and its options; None after showing what there is.

    Of a command with settings the options come as a pair, with the configuration.

    Parameters
    ----------
    package
        That holds the modules, named as their commands.
    commands
        Command name -> name of its dataclass of options.
    about
        What to show where no command is given.
    unknown
        What to say of a command that there is not, with ``{name!r}`` in it.
    arguments
        Instead of the process's own.
    with_settings
        Commands that take settings as well, such as ``--body.track-cm 16``.

    Raises
    ------
    UsageError
        No such command, or options that it does not take.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    if not arguments or arguments[0] in ("-h", "--help"):
        print(about.strip())
        return None
    name = arguments[0]
    if name not in commands:
        near = difflib.get_close_matches(name, commands, n=1)
        remedy = f"did you mean {near[0]}?" if near else f"the commands are {', '.join(commands)}"
        raise UsageError(f"{unknown.format(name=name)}; {remedy}")
    module = import_module(f"{package}.{name}")
    kind = getattr(module, commands[name])
    if name in with_settings:
        return module, read_command_line(kind, arguments[1:], name)
    return module, read_options(kind, arguments[1:], name)
