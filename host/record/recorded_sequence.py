"""A recording as a sequence: its pictures, with the poses that its wheels tell of the camera."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from host.errors import InputError
from host.nav.odometry import Odometry
from host.record.journal import Entry, reading_of
from host.record.mcap_reader import NOT_READABLE, Recording
from host.record.sequence import Sequence, SequenceFrame

LATER_S = 0.5  # readings up to so long after a picture tell where the wheels were; odometry remembers 1 s


@dataclass(frozen=True)
class RecordedSequence(Sequence):
    """The pictures of a recording, decoded when asked for.

    Attributes
    ----------
    notes
        What to tell a person before anything is made of it.
    """

    recording: Recording
    entries: tuple[Entry, ...] = field(repr=False)  # of the pictures, as the journal has them
    notes: tuple[str, ...] = ()

    def image(self, index: int) -> np.ndarray:
        """The picture of ``frames[index]``, (H, W, 3) uint8, BGR.

        Raises
        ------
        InputError
            It cannot be decoded.
        """
        recorded = self.recording.frame(self.entries[index])
        assert recorded is not None, "pictures that are not there are no frames"
        image = recorded.frame().image
        if image.shape[:2] != (self.lens.height, self.lens.width):
            raise InputError(
                f"{self.frames[index].path}: image of {image.shape[1]}x{image.shape[0]} px under a lens of "
                f"{self.lens.width}x{self.lens.height}; record again with the lens of this camera"
            )
        return image

    def file(self, index: int) -> bytes:
        """The same as PNG or JPEG, as it was recorded."""
        recorded = self.recording.frame(self.entries[index])
        assert recorded is not None
        return recorded.file


def read_recorded_sequence(path: Path) -> RecordedSequence:
    """All pictures of a recording that were taken one after the other, also those that were not driven on.

    Their poses are the wheels' alone, with what was heard shortly after a picture too, and the sigmas of
    where in their cells the wheels stood.

    Raises
    ------
    InputError
        The file is damaged, no recording, or without pictures or wheels.
    """
    recording = Recording(path)
    notes = [] if recording.note is None else [recording.note]
    try:
        entries, frames, times_carried_s = _posed(recording)
    except NOT_READABLE as error:
        raise InputError(f"{path}: an entry of its journal cannot be followed ({error!r})") from None
    if not frames:
        raise InputError(f"{path}: has no pictures; record a drive with a camera")
    notes += [
        f"{path}: at {t_s:.1f} s the robot slipped or was carried, which its wheels do not tell: depths of "
        "things seen before and after are wrong for a while"
        for t_s in times_carried_s
    ]
    return RecordedSequence(path, recording.lens, tuple(frames), recording, tuple(entries), tuple(notes))


def _posed(recording: Recording) -> tuple[list[Entry], list[SequenceFrame], list[float]]:
    odometry = Odometry(recording.config.body)
    entries: list[Entry] = []
    frames: list[SequenceFrame] = []
    waiting: list[Entry] = []
    carried_s: list[float] = []
    first_s = newest_s = -math.inf

    def place(until_s: float) -> None:
        while waiting and waiting[0]["t_s"] <= until_s:
            entry = waiting.pop(0)
            name = recording.path / f"picture-{entry['frame']:06d}"
            entries.append(entry)
            frames.append(SequenceFrame(entry["frame"], name, odometry.pose_at(entry["t_s"])))

    for entry in recording.journal():
        match entry["do"]:
            case "frame":
                # one that is not later than the last is the same again, and no frame of a sequence
                if entry["t_s"] > newest_s and recording.frame(entry) is not None:
                    first_s = entry["t_s"] if math.isinf(first_s) else first_s
                    newest_s = entry["t_s"]
                    waiting.append(entry)
            case "hear":
                odometry.add(reading_of(entry))
                place(odometry.newest_s - LATER_S)
            case "restarted":
                place(math.inf)
                odometry.restart()
            case "forget" if not carried_s or newest_s - first_s - carried_s[-1] > 5.0:
                carried_s.append(newest_s - first_s)
    place(math.inf)
    return entries, frames, carried_s
