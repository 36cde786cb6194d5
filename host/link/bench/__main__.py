"""The serial protocol test bench: how good is the line to this robot, and does the robot keep its promises?

    python -m host.link.bench echo    --robot /dev/ttyACM0     round trips, clock drift; moves nothing
    python -m host.link.bench flood   --robot sim:             as many frames as the line takes; moves nothing
    python -m host.link.bench ber     --robot sim:             bit errors, injected or the line's own
    python -m host.link.bench cut     --robot avr:             the line dies in many ways: time to standing
    python -m host.link.bench soak    --robot sim:             minutes of mixed traffic with random faults
    python -m host.link.bench monitor --robot /tmp/robot       every frame as it comes; moves nothing
    python -m host.link.bench replay  capture.txt              a capture decoded again
    python -m host.link.bench report  *.json --html page.html  earlier results on one page

A robot is auto, a port's path, or sim: or avr: for a simulated one in virtual time;
`python -m host.sim.serve` puts a simulated one on a port. Each command has --help, and can write --json and
--html. Exit codes: 0 done and healthy, 4 the line is faulty or does not answer, 5 the robot did what it must
never do.
"""

from __future__ import annotations

from host.errors import EXIT_DEVICE, EXIT_DONE, EXIT_SAFETY, UsageError, begin_command, run_command

if __name__ == "__main__":
    begin_command()

from collections.abc import Callable
from typing import Any

from host.subcommands import read_subcommand

COMMANDS = {
    "echo": "EchoOptions",
    "flood": "FloodOptions",
    "ber": "BerOptions",
    "cut": "CutOptions",
    "soak": "SoakOptions",
    "monitor": "MonitorOptions",
    "replay": "ReplayOptions",
    "report": "ReportOptions",
}


def main(arguments: list[str] | None = None) -> int:
    """The command."""
    asked = read_subcommand("host.link.bench", COMMANDS, __doc__ or "", "no command {name!r}", arguments)
    if asked is None:
        return EXIT_DONE
    module, options = asked
    return run(module.run, options)


def run(measure: Callable[[Any], Any], options: Any) -> int:
    """Measure, show, write; the places for the results are looked at first."""
    from host.link.bench.page import page
    from host.link.bench.result import write_result
    from host.link.bench.terminal import show
    from host.link.bench.verdict import Grade
    from host.record.atomic import check_writable, write_whole

    if None not in (options.json, options.html) and options.json.resolve() == options.html.resolve():
        raise UsageError(f"--json and --html are both {options.json}: name two files")
    for path in (options.json, options.html):
        if path is not None:
            check_writable(path, folder=False)
    result = measure(options)
    if result is None:
        return EXIT_DONE
    show(result)
    if options.json is not None:
        write_result(result, options.json)
    if options.html is not None and result.command != "report":  # which has its own page
        write_whole(options.html, page([result]))
    return {Grade.UNSAFE: EXIT_SAFETY, Grade.FAULTY: EXIT_DEVICE}.get(result.verdict.grade, EXIT_DONE)


if __name__ == "__main__":
    run_command(main)
