"""A recording as a sequence folder: camera.json, poses.csv by the wheels, the pictures as they were recorded.

python -m host.record.export run.mcap FOLDER
"""

from __future__ import annotations

from host.errors import begin_command, run_command

if __name__ == "__main__":
    begin_command()

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from host.config import read_options
from host.progress import progress

if TYPE_CHECKING:  # so that --help need not wait for OpenCV
    from host.pose import Pose


@dataclass(frozen=True)
class Options:
    """Write a recording's pictures, with the poses its wheels tell, as a sequence folder for host.measure."""

    recording: Positional[Annotated[Path, arg(metavar="RECORDING")]]  # made with nav_loop --record
    folder: Positional[Annotated[Path, arg(metavar="FOLDER")]]  # a new one, or one that is empty


def main() -> None:
    """The command."""
    options = read_options(Options)
    from host.record.recorded_sequence import read_recorded_sequence
    from host.record.sequence import write_sequence

    sequence = read_recorded_sequence(options.recording)
    for note in sequence.notes:
        print(f"note: {note}", file=sys.stderr)
    with progress("exporting", len(sequence.frames)) as advance:

        def pictures() -> Iterator[tuple[bytes, Pose]]:
            for index, frame in enumerate(sequence.frames):
                yield sequence.file(index), frame.pose
                advance()

        write_sequence(options.folder, sequence.lens, pictures())
    print(f"{len(sequence.frames)} pictures with poses: {options.folder}; try python -m host.measure on it")


if __name__ == "__main__":
    run_command(main)
