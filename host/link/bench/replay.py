"""A capture decoded again, as if it came from the line now."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from host.link.bench.capture import read_capture, read_raw
from host.link.bench.frames import FrameReader
from host.link.bench.monitor import kind_of, line_of, result_of, wanted
from host.link.bench.result import Result
from host.link.bench.witness import Witness


@dataclass(frozen=True)
class ReplayOptions:
    """Decode a capture again: what was said, what was broken, and a verdict."""

    capture: Positional[Annotated[Path, arg(metavar="CAPTURE")]]  # file written by monitor or soak --capture
    show: bool = False  # print every frame
    only: str | None = None  # frames to print, such as nack,hello,broken; * stands for any letters
    hide: str | None = None  # frames not to print, such as telemetry,linkstatus
    raw: Literal["to-host", "to-robot"] | None = None  # the file is bytes of this direction as they were
    json: Path | None = None  # write all figures to this file
    html: Path | None = None  # write a page to this file

    def __post_init__(self) -> None:
        wanted(self.only, self.hide)


def run(options: ReplayOptions) -> Result:
    """The decoding."""
    show = wanted(options.only, options.hide)
    loud = options.show or options.only is not None or options.hide is not None
    if options.raw is not None:
        pieces = read_raw(options.capture, to_host=options.raw == "to-host")
    else:
        pieces = read_capture(options.capture)
    readers = {to_host: FrameReader(to_host=to_host) for to_host in (False, True)}
    witness, tally = Witness(), Counter[str]()
    for piece in pieces:
        for frame in readers[piece.to_host].feed(piece.t_s, piece.data):
            witness.see(frame)
            tally[kind_of(frame)] += 1
            if loud and show(kind_of(frame)):
                print(line_of(frame, 0.0))
    return result_of("replay", str(options.capture), witness, tally)
