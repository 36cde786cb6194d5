"""Measure what differs from robot to robot, and write it to the robot.

python -m host.calibrate wheels --robot /dev/ttyACM0     wheel sizes, track, motors; needs a floor and a tape
python -m host.calibrate wheels --robot "sim:?wheels=3&track=4&motors=15"
"""

from __future__ import annotations

from host.errors import begin_command, run_command

if __name__ == "__main__":
    begin_command()

from host.subcommands import read_subcommand

COMMANDS = {"wheels": "WheelsOptions"}


def main(arguments: list[str] | None = None) -> None:
    """The command."""
    unknown = "nothing called {name!r} can be calibrated"
    asked = read_subcommand("host.calibrate", COMMANDS, __doc__ or "", unknown, arguments)
    if asked is not None:
        module, options = asked
        module.run(options)


if __name__ == "__main__":
    run_command(main)
