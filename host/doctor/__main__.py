"""What is wrong with this robot, its camera or this computer, and how to mend it.

    python -m host.doctor                                        installation, and the camera if one is here
    python -m host.doctor --camera 0 --lens camera.json --robot auto
    python -m host.doctor --robot /dev/ttyACM0 --wheels-up       turns the wheels: robot on blocks
    python -m host.doctor --camera sim:room --robot sim:         how it looks when all is well

Exit codes: 0 nothing failed, 2 the installation, 3 the calibration, 4 camera, robot or timing, 5 the wheels;
of several the highest.
"""

from __future__ import annotations

import sys
from pathlib import Path

from host.doctor.installation import check_installation
from host.doctor.show import exit_code, show, write_json
from host.errors import run_command
from host.record.atomic import check_writable


def main(arguments: list[str] | None = None) -> int:
    """The command."""
    try:
        from host.config import read_command_line
        from host.doctor.visit import DoctorOptions, visit

        options, config = read_command_line(DoctorOptions, arguments)
    except ImportError:  # then nobody can read the command line, and the installation is what is wrong
        return see_installation(sys.argv[1:] if arguments is None else arguments)
    if options.json is not None:
        check_writable(options.json, folder=False, beside=(options.lens,))
    findings = visit(options, config)
    show(findings)
    if options.json is not None:
        write_json(findings, options.json)
    return exit_code(findings)


def see_installation(arguments: list[str]) -> int:
    """What can be done where libraries or native modules are missing."""
    if {"-h", "--help"} & set(arguments):
        print((__doc__ or "").strip())
        return 0
    findings = list(check_installation(Path("runs")))
    show(findings)
    return exit_code(findings)


if __name__ == "__main__":
    run_command(main)
