"""The lens of a camera from views of the printed board, held before it everywhere, near and far, tilted."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from host.config import Config
from host.errors import EXIT_DONE, EXIT_INPUT, InputError


@dataclass(frozen=True)
class CameraOptions:
    """Measure a camera's lens with the printed board of `target`, and write its camera.json."""

    camera: str = "0"
    """a webcam's number or device, an MJPEG stream, a video, a folder, a recording, or sim:target?seed=1"""
    out: Path = Path("camera.json")  # write the lens here; a picture of the coverage beside it
    board: Path | None = (
        None  # what `target` wrote beside the PDF; target.json here, or else its default board
    )


def run(options: CameraOptions, config: Config) -> int:
    """The command's body; 3 where the lens is not good enough and nothing was written."""
    # Here, so that --help need not wait for it.
    from host.calibrate.verdict import about, calibrate, chosen_board, show, write_picture
    from host.calibrate.views import draw
    from host.calibrate.watch import watch
    from host.camera.lens_file import write_lens
    from host.record.atomic import check_writable

    board = chosen_board(options.board)
    picture = options.out.with_suffix(".png")
    for path in (options.out, picture):
        check_writable(path, folder=False)
    watched = watch(options.camera, board, config.webcam, lambda coverage: coverage.done)
    try:
        found = calibrate(watched)
    except InputError:
        write_picture(draw(watched.coverage), picture)
        raise
    write_picture(draw(found.coverage, found.solution.residuals), picture)
    if not found.faults:
        write_lens(options.out, found.solution.lens, about(found, options.camera))
    show(found, options.camera, options.out, picture)
    return EXIT_INPUT if found.faults else EXIT_DONE
