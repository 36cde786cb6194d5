"""A recorded drive done again, to the bit: net, depth, place and commands, and where they first differ.

    python -m host.replay run.mcap [--json FILE] [--config FILE]

Neither robot, camera nor simulator is needed, and no truth is read. Exit code 6 where something differs.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in the drive: threads add in another order

from host.errors import EXIT_DIFFERENT, EXIT_DONE, begin_command, run_command

if __name__ == "__main__":
    begin_command()

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from host.config import Config, read_config, read_options
from host.progress import progress

if TYPE_CHECKING:  # so that --help need not wait for OpenCV
    from host.record.mcap_reader import Recording
    from host.record.replayed import Tally


@dataclass(frozen=True)
class Options:
    """Do a recorded drive again and say where it comes to something else than live."""

    recording: Positional[Annotated[Path, arg(metavar="RECORDING")]]  # made with nav_loop --record
    json: Path | None = None  # write the outcome to this file
    config: Path | None = None  # settings to use instead of the recorded ones


def main() -> int:
    """The command: 0 where all is the same, 6 where it is not."""
    options = read_options(Options)
    from host.record.atomic import check_writable, write_whole
    from host.record.mcap_reader import Recording
    from host.record.replayed import Tally

    if options.json is not None:
        check_writable(options.json, folder=False, beside=(options.recording, options.config))
    config = None if options.config is None else read_config(options.config)
    recording = Recording(options.recording)
    tally = Tally()
    if recording.note is not None:
        tally.notes.append(recording.note)
    _replay_all(recording, config, tally)
    changed = _changed(recording, config is not None)
    if options.json is not None:
        result = {"recording": str(options.recording), **tally.as_dict(), "changed": changed}
        write_whole(options.json, (json.dumps(result, indent=1) + "\n").encode())
    _print(tally, changed)
    return EXIT_DONE if tally.same else EXIT_DIFFERENT


def _replay_all(recording: Recording, config: Config | None, tally: Tally) -> None:
    from host.record.replayed import replay

    with progress("replaying", recording.frame_count) as advance:
        for step in replay(recording, config, tally):
            tally.count(step)
            if step.view is not None:
                advance()


def _changed(recording: Recording, other_settings: bool) -> list[str]:
    """What is another than when it was recorded, and may be the reason."""
    from host.record.versions import differences, versions

    changed = differences(recording.begin.get("versions", {}), versions())
    if changed and recording.begin.get("commit"):
        changed.append(f"it was recorded at commit {recording.begin['commit'][:10]}")
    if other_settings:
        changed.append("other settings were asked for")
    if recording.config.net.max_ms > 0:
        changed.append("net.max_ms stops the net by the clock, so that results vary from run to run")
    return changed


def _print(tally: Tally, changed: list[str]) -> None:
    for note in tally.notes:
        print(f"note: {note}")
    done = f"{tally.pictures} pictures and {tally.commands} commands between them"
    if tally.same:
        print(f"the same to the bit: {done}")
        return
    print(f"differs first in {tally.first}")
    print(
        f"{tally.pictures_different} of {tally.pictures} pictures come out otherwise, "
        f"{tally.commands_different} of {tally.pictures + tally.commands} commands do"
    )
    print("since it was recorded: " + ("; ".join(changed) or "no version, code or setting changed"))


if __name__ == "__main__":
    run_command(main)
