"""Measure what differs from robot to robot, and write it to the robot.

python -m host.calibrate wheels --robot /dev/ttyACM0     wheel sizes, track, motors; needs a floor and a tape
python -m host.calibrate wheels --robot "sim:?wheels=3&track=4&motors=15"
"""

from __future__ import annotations

from host.errors import UsageError, begin_command, run_command

if __name__ == "__main__":
    begin_command()

import difflib
import sys
from importlib import import_module

from host.config import read_options

COMMANDS = {"wheels": "WheelsOptions"}


def main(arguments: list[str] | None = None) -> None:
    """The command."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if not arguments or arguments[0] in ("-h", "--help"):
        print((__doc__ or "").strip())
        return
    name = arguments[0]
    if name not in COMMANDS:
        near = difflib.get_close_matches(name, COMMANDS, n=1)
        remedy = f"did you mean {near[0]}?" if near else f"the commands are {', '.join(COMMANDS)}"
        raise UsageError(f"nothing called {name!r} can be calibrated; {remedy}")
    module = import_module(f"host.calibrate.{name}")
    module.run(read_options(getattr(module, COMMANDS[name]), arguments[1:], name))


if __name__ == "__main__":
    run_command(main)
