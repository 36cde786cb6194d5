"""Pictures of the board, from any camera, into views; with live words for whoever holds the board."""

from __future__ import annotations

import os
import select
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from host.calibrate.board import Board
from host.calibrate.views import LEAST_SQUARE_PX, Coverage
from host.camera.config import WebcamConfig
from host.camera.frame import FrameSource
from host.camera.source import camera_name, is_live, open_camera
from host.errors import InputError
from host.progress import LiveText

FRAME_S = 5.0  # a picture takes at most so long to come
ASKED = 6  # pictures without the board that are searched for another one
SHOW_S = 0.15
PATIENCE_S = 120.0  # without any new view a live camera is given up


@dataclass
class Watched:
    """What came of looking."""

    coverage: Coverage
    camera_name: str | None  # what the camera calls itself, where it does
    another: str | None = None  # what else was seen instead of the board


def open_for_board(uri: str, board: Board, webcam: WebcamConfig | None) -> FrameSource:
    """The camera a URI names; ``sim:target`` is a simulated hand with a board before a webcam."""
    if uri.startswith("sim:"):
        from host.sim.board_views import open_held_board

        return open_held_board(uri, board)
    return open_camera(uri, None, webcam)


def watch(uri: str, board: Board, webcam: WebcamConfig | None, enough: Callable[[Coverage], bool]) -> Watched:
    """Take views until there are enough, the pictures end, or a person presses Enter.

    Raises
    ------
    InputError
        No view could be taken of any picture: why, and what to do.
    DeviceError
        The camera does not deliver.
    """
    camera = open_for_board(uri, board, webcam)
    live = is_live(uri)
    photographs = os.path.isdir(uri) and not (Path(uri) / "poses.csv").exists()
    screen = Screen(live)
    watched: Watched | None = None
    asked, new_s = 0, time.monotonic()
    try:
        with screen.text:
            while (frame := camera.read(FRAME_S)) is not None:
                height, width = frame.image.shape[:2]
                if watched is None:
                    name = camera_name(uri)
                    watched = Watched(Coverage(board, width, height, not photographs), name)
                cover = watched.coverage
                if (cover.width, cover.height) != (width, height):
                    raise InputError(
                        f"camera {uri}: pictures of {width}x{height} px after some of {cover.width}x"
                        f"{cover.height}; keep to one size"
                    )
                sighting = board.find(frame.image)
                verdict = cover.add(sighting, frame.t_s)
                if sighting is None and not cover.views and asked < ASKED and cover.seen["none"] % 5 == 1:
                    asked, watched.another = asked + 1, board.why_not(frame.image) or watched.another
                if verdict == "taken":
                    new_s = time.monotonic()
                screen.show(cover, verdict)
                if enough(cover) or (
                    live and (screen.asked_to_end() or time.monotonic() - new_s > PATIENCE_S)
                ):
                    break
    finally:
        camera.close()
    if watched is None or not watched.coverage.views:
        raise InputError(_why_nothing(uri, board, watched))
    return watched


def _why_nothing(uri: str, board: Board, watched: Watched | None) -> str:
    """Why not a single view was taken."""
    if watched is None:
        return f"camera {uri}: no pictures"
    cover = watched.coverage
    seen = cover.seen
    total = sum(seen.values())
    if total == seen["none"]:
        if watched.another:
            return f"camera {uri}: wrong board ({watched.another}); expected {board.words}: see --board"
        return (
            f"camera {uri}: no board seen in {total} pictures; expected {board.words}: show all of it, well "
            "lit, nearly filling the picture"
        )
    reasons = {
        "blurred": f"too blurred: edges are {cover.blur_px:.1f} px wide at best and may be "
        f"{cover.most_blur_px:.1f}; focus the camera, give more light",
        "moving": "moving too fast: hold board and camera still for half a second at a time",
        "far": f"too far away: its squares must be at least {LEAST_SQUARE_PX:g} px wide; come nearer",
    }
    worst = max(reasons, key=lambda reason: seen[reason])
    return f"camera {uri}: the board was seen in {total - seen['none']} pictures, always {reasons[worst]}"


WORDS = {
    "none": "no board in sight",
    "far": "too far away",
    "moving": "hold it still",
    "blurred": "blurred: hold it still, focus, more light",
    "same": "seen already",
    "taken": "taken",
}


class Screen:
    """Coverage on stderr: redrawn in place on a terminal, else a line for each view."""

    def __init__(self, live: bool) -> None:
        self.text = LiveText(SHOW_S, transient=False)
        self._may_end = live and sys.stdin is not None and sys.stdin.isatty()

    def show(self, cover: Coverage, verdict: str) -> None:
        """What became of a picture, and what is still missing."""
        if not self.text.shown:
            if verdict == "taken":
                missing = cover.missing()
                wish = f"; next: {missing[0]}" if missing else ""
                print(
                    f"view {len(cover.views)}: {100 * cover.covered:.0f} % of the picture covered{wish}",
                    file=sys.stderr,
                )
            return
        ends = "; Enter ends it" if self._may_end else ""
        self.text.show(
            lambda: "\n".join([*cover.lines(), f"now: {WORDS[verdict]}{ends}"]), at_once=verdict == "taken"
        )

    def asked_to_end(self) -> bool:
        """Has Enter been pressed?"""
        if not self._may_end or not select.select([sys.stdin], [], [], 0)[0]:
            return False
        sys.stdin.readline()
        return True
