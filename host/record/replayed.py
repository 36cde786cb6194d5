"""A recorded drive done again: the same calls on a fresh pilot, and where it first comes out otherwise."""

from __future__ import annotations

import json
import traceback
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from host.camera.frame import Frame
from host.config import Config
from host.errors import InputError
from host.nav.map import ObstacleMap
from host.nav.pilot import Pilot, View
from host.record.journal import Entry, command_as_dict, made_as_dict, reading_of, task_of
from host.record.mcap_reader import NOT_READABLE, Recording

PARTS = (
    "picture",
    "regions",
    "depth",
    "pose",
    "command",
)  # each follows from those before


@dataclass(frozen=True)
class Difference:
    """The first thing of a picture, or of a command between pictures, that came out otherwise."""

    part: str  # one of PARTS
    frame: int  # the recording's number of the picture, or of the one before
    seq: int  # the camera's
    t_s: float  # since the recording's first picture
    was: str
    now: str

    def __str__(self) -> str:
        return (
            f"picture {self.frame} (the camera's {self.seq}), at {self.t_s:.3f} s: "
            f"{self.part}: was {self.was}, now {self.now}"
        )


@dataclass(frozen=True)
class Step:
    """One picture done again, or one command between pictures."""

    frame: int
    t_s: float  # since the recording's first picture
    view: View | None  # None for a command between pictures
    map: ObstacleMap  # as it stands then; the next step changes it
    made: Entry  # as the recording has it
    differences: tuple[Difference, ...]  # one at most for each part


@dataclass
class Tally:
    """What became of a replay as a whole."""

    pictures: int = 0
    commands: int = 0  # between pictures
    pictures_different: int = 0
    commands_different: int = 0  # of both kinds
    first: Difference | None = None
    notes: list[str] = field(default_factory=list)

    @property
    def same(self) -> bool:
        return self.first is None

    def count(self, step: Step) -> None:
        """Take one step into account."""
        parts = [difference.part for difference in step.differences]
        self.pictures += step.view is not None
        self.commands += step.view is None
        self.pictures_different += step.view is not None and parts != []
        self.commands_different += "command" in parts
        if self.first is None and step.differences:
            self.first = step.differences[0]

    def as_dict(self) -> dict[str, Any]:
        """For ``--json``."""
        first = self.first
        return {
            "same": self.same,
            "pictures": self.pictures,
            "pictures_different": self.pictures_different,
            "commands_between_pictures": self.commands,
            "commands_different": self.commands_different,
            "first_difference": None if first is None else vars(first),
            "notes": self.notes,
        }


def replay(recording: Recording, config: Config | None = None, tally: Tally | None = None) -> Iterator[Step]:
    """Do a recorded drive again, a step at a time.

    Parameters
    ----------
    config
        Instead of the recorded settings.
    tally
        Is kept; what cannot be said of one step is noted there.

    Raises
    ------
    InputError
        The recording cannot be understood.
    """
    try:
        yield from _Replay(recording, config or recording.config, tally or Tally()).steps()
    except NOT_READABLE as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        raise InputError(
            f"{recording.path}: an entry of its journal cannot be followed ({error!r}, {where.name}); "
            "replay it with the program that recorded it"
        ) from None


class _Failed(Exception):
    """The pilot failed, in words."""


class _Replay:
    def __init__(self, recording: Recording, config: Config, tally: Tally) -> None:
        self._recording, self._tally = recording, tally
        self._pilot = Pilot(
            recording.lens,
            task_of(recording.begin["task"]),
            net=config.net,
            depth=config.depth,
            body=config.body,
            nav=config.nav,
        )
        self._frame: Entry = {"frame": -1, "seq": -1, "t_s": 0.0}  # the newest picture
        self._first_s: float | None = None
        self._view: View | None = None
        self._picture: Difference | None = None
        self._command: Entry | None = None

    def steps(self) -> Iterator[Step]:
        open_call: str | None = None
        journal = self._recording.journal()
        for entry in journal:
            if entry["do"] in ("take", "decide"):
                open_call = entry["do"]
            try:
                if not self._follow(entry):
                    return
            except _Failed as failure:
                if any(later["do"] in ("made", "decided") for later in journal):
                    yield self._failed(str(failure))
                else:
                    self._tally.notes.append(f"the program fails here, where it ended live too: {failure}")
                return
            if entry["do"] == "made" and self._view is not None:
                yield self._made(entry, self._view)
                open_call = None
            elif entry["do"] == "decided" and self._command is not None:
                yield self._decided(entry, self._command)
                open_call = None
        if open_call is not None:
            what = f"picture {self._frame['frame']}" if open_call == "take" else "a command between pictures"
            self._tally.notes.append(f"the recording ends while {what} was being worked on")

    def _follow(self, entry: Entry) -> bool:
        """Tell the pilot what it was told; False where the recording lacks what that takes."""
        pilot = self._pilot
        match entry["do"]:
            case "frame":
                self._frame = entry
                self._first_s = entry["t_s"] if self._first_s is None else self._first_s
            case "hear":
                _guarded(pilot.hear, reading_of(entry))
            case "restarted":
                _guarded(pilot.restarted)
            case "react":
                _guarded(pilot.react_within, entry["reaction_s"])
            case "forget":
                _guarded(pilot.forget)
            case "take":
                return self._take(entry)
            case "decide":
                self._command = command_as_dict(_guarded(pilot.decide, entry["now_s"]))
        return True

    def _take(self, entry: Entry) -> bool:
        recorded = self._recording.frame(self._frame) if entry["frame"] == self._frame["frame"] else None
        if recorded is None:
            self._tally.notes.append(
                f"picture {entry['frame']} did not get into the recording: the replay ends before it"
            )
            return False
        frame: Frame = recorded.frame()
        as_live = recorded.is_as_live(frame.image)
        self._picture = (
            None if as_live else self._difference("picture", "as the camera gave it", "decoded otherwise")
        )
        self._view = _guarded(self._pilot.take, frame, entry["now_s"])
        return True

    def _made(self, was: Entry, view: View) -> Step:
        now = json.loads(json.dumps(made_as_dict(was["frame"], view)))
        found = [self._picture] if self._picture is not None else []
        for part, words in (
            ("regions", _regions_words(was, now)),
            ("depth", _depth_words(was, now)),
            ("pose", _pose_words(was, now)),
            ("command", _command_words(was["command"], now["command"])),
        ):
            if words is not None:
                found.append(self._difference(part, *words))
        self._view = None
        return Step(was["frame"], self._time_s(), view, self._pilot.map, was, tuple(found))

    def _decided(self, was: Entry, now: Entry) -> Step:
        words = _command_words(was["command"], json.loads(json.dumps(now)))
        self._command = None
        found = () if words is None else (self._difference("command", *words),)
        return Step(self._frame["frame"], self._time_s(), None, self._pilot.map, was, found)

    def _failed(self, why: str) -> Step:
        """The replay is over: the program fails where it did not."""
        found = (self._difference("command", "a command", why),)
        self._tally.notes.append("the replay ends where the program failed")
        return Step(self._frame["frame"], self._time_s(), None, self._pilot.map, {}, found)

    def _difference(self, part: str, was: str, now: str) -> Difference:
        frame = self._frame
        return Difference(part, frame["frame"], frame["seq"], self._time_s(), was, now)

    def _time_s(self) -> float:
        return self._frame["t_s"] - (self._first_s or 0.0)


def _guarded(call: Any, *arguments: Any) -> Any:
    """What a call of the pilot gives; its failure in one line."""
    try:
        return call(*arguments)
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        raise _Failed(f"{type(error).__name__}: {error} ({where.filename}, line {where.lineno})") from None


def _same(was: Any, now: Any) -> bool:
    """To the bit, nan as well."""
    return json.dumps(was) == json.dumps(now)


def _regions_words(was: Entry, now: Entry) -> tuple[str, str] | None:
    then, here = ({region[0]: region for region in made["regions"]} for made in (was, now))
    if list(then) != list(here):
        gone, new = sorted(set(then) - set(here)), sorted(set(here) - set(then))
        only = [f"{len(ids)} regions" + (f" (with {_listed(ids)})" if ids else "") for ids in (gone, new)]
        return only[0].replace(f"{len(gone)} r", f"{len(then)} r", 1), only[1].replace(
            f"{len(new)} r", f"{len(here)} r", 1
        )
    for name in then:
        if not _same(then[name][1], here[name][1]):
            a, b = _apart(then[name][1], here[name][1], 1)
            return f"region {name} with {a} px", f"{b} px"
    if was["net"] != now["net"]:
        return "other outlines, corners or colours in the same regions", "these"
    return None


def _depth_words(was: Entry, now: Entry) -> tuple[str, str] | None:
    then, here = ({region[0]: region[2:] for region in made["regions"]} for made in (was, now))
    for name in then:
        if name in here and not _same(then[name], here[name]):
            return f"region {name} at {_depth(then[name], here[name])}", _depth(here[name], then[name])
    if was["depth"] != now["depth"]:
        return "other corners, slopes or camera motion at the same depths of regions", "these"
    return None


def _depth(depth: list[Any], other: list[Any]) -> str:
    depth_cm, sigma_cm, method = depth
    if depth_cm is None or sigma_cm is None:
        return "no depth"
    a = _apart(depth_cm, other[0], 2)[0]
    b = _apart(sigma_cm, other[1], 2)[0]
    return f"{a} ±{b} cm ({method})"


def _pose_words(was: Entry, now: Entry) -> tuple[str, str] | None:
    for name, a, b in zip(("x", "z", "heading"), was["pose"], now["pose"], strict=True):
        if not _same(a, b):
            unit = "rad" if name == "heading" else "cm"
            then, here = _apart(a, b, 3)
            return f"{name} {then} {unit}", f"{here} {unit}"
    if was["poses"] != now["poses"]:
        return "another pose of the wheels at the same place on the map", "this"
    return None


def _command_words(was: Entry, now: Entry) -> tuple[str, str] | None:
    if _same(was, now):
        return None
    speeds = [_apart(was[name], now[name], 1) for name in ("v_mm_s", "omega_rad_s")]
    words = [
        f"{speeds[0][k]} mm/s, {speeds[1][k]} rad/s, {command['outcome'] or 'going on'} ({command['reason']})"
        for k, command in enumerate((was, now))
    ]
    return words[0], words[1]


def _apart(a: float | None, b: float | None, digits: int) -> tuple[str, str]:
    """Both numbers, with as many digits as it takes to tell them apart."""
    if a is None or b is None or a == b:
        return tuple("none" if v is None else f"{v:.{digits}f}" for v in (a, b))  # type: ignore[return-value]
    short = f"{a:.{digits}f}", f"{b:.{digits}f}"
    return short if short[0] != short[1] else (repr(a), repr(b))


def _listed(ids: list[int]) -> str:
    return ", ".join(map(str, ids[:5])) + (" and more" if len(ids) > 5 else "")
