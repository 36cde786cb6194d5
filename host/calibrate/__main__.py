"""Measure what differs from robot to robot, and from camera to camera.

python -m host.calibrate target --paper a4               the board to print, as PDF in true size
python -m host.calibrate camera --camera 0               the lens, with that board held before the camera
python -m host.calibrate wheels --robot /dev/ttyACM0     wheel sizes, track, motors; needs a floor and a tape
python -m host.calibrate mount --camera 0 --robot auto --lens camera.json   height and tilt of the camera
python -m host.calibrate delay --camera 0 --robot auto --lens camera.json   how late its pictures are stamped
python -m host.calibrate check --camera 0 --lens camera.json                does the lens still hold?

Each has --help, and each can be tried in simulation:
python -m host.calibrate camera --camera "sim:target?seed=1"
python -m host.calibrate wheels --robot "sim:?wheels=3&track=4&motors=15"
python -m host.calibrate mount --camera "sim:room?seed=1" --robot sim:

Exit codes: 0 done, 2 usage, 3 the views or the ride tell too little, or what was checked holds no more,
4 camera or robot, 130 interrupted.
"""

from __future__ import annotations

import sys

from host.errors import UsageError, begin_command, run_command

if __name__ == "__main__":
    begin_command()

from host.subcommands import read_subcommand

COMMANDS = {
    "target": "TargetOptions",
    "camera": "CameraOptions",
    "wheels": "WheelsOptions",
    "mount": "MountOptions",
    "delay": "DelayOptions",
    "check": "CheckOptions",
}
WITH_SETTINGS = ("camera", "mount", "delay", "check")


def main(arguments: list[str] | None = None) -> int | None:
    """The command."""
    unknown = "nothing called {name!r} can be calibrated"
    arguments = sys.argv[1:] if arguments is None else arguments
    asked = read_subcommand("host.calibrate", COMMANDS, __doc__ or "", unknown, arguments, WITH_SETTINGS)
    if asked is None:
        return None
    module, given = asked
    if not isinstance(given, tuple):
        return module.run(given)
    elsewhere = any(word.partition("=")[0] == "--config" for word in arguments)
    if elsewhere and getattr(given[0], "save", False):
        raise UsageError("--save writes into robot.toml, not into the file of --config: give only one")
    return module.run(*given)


if __name__ == "__main__":
    run_command(main)
