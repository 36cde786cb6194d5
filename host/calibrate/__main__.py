"""Measure what differs from robot to robot.

python -m host.calibrate target --paper a4               the board to print, as PDF in true size
python -m host.calibrate camera --camera 0               the lens, with that board held before the camera
python -m host.calibrate wheels --robot /dev/ttyACM0     wheel sizes, track, motors; needs a floor and a tape
python -m host.calibrate wheels --robot "sim:?wheels=3&track=4&motors=15"
"""

from __future__ import annotations

from host.errors import begin_command, run_command

if __name__ == "__main__":
    begin_command()

from host.subcommands import read_subcommand

COMMANDS = {"target": "TargetOptions", "camera": "CameraOptions", "wheels": "WheelsOptions"}


def main(arguments: list[str] | None = None) -> int | None:
    """The command."""
    unknown = "nothing called {name!r} can be calibrated"
    asked = read_subcommand("host.calibrate", COMMANDS, __doc__ or "", unknown, arguments)
    if asked is not None:
        module, options = asked
        return module.run(options)
    return None


if __name__ == "__main__":
    run_command(main)
