"""The pictures of a measured sequence: each frame's net and depths, and at the end its vertices in space."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from host.depth.report import DepthReport
from host.rbdn.snapshot import Contour, Snapshot
from host.record.atomic import write_whole
from host.record.sequence import Sequence
from host.view.colour_scale import depth_scale
from host.view.depth_picture import draw_depth
from host.view.net_picture import draw_net
from host.view.space_picture import draw_space, space_of
from host.view.true_depth import read_true_depths

SPACE = "vertices.png"


class SequencePictures:
    """Collects frames and draws them when all are there: only then is known how far the depths reach.

    Parameters
    ----------
    sequence
        Whose images are read again for drawing; its truth, where it has one, is read here.
    folder
        For the pictures; made where it is missing.

    Raises
    ------
    InputError
        where there is a truth that cannot be used.
    """

    def __init__(self, sequence: Sequence, folder: Path) -> None:
        self._sequence = sequence
        self._folder = folder
        self._truth = read_true_depths(sequence)
        self._frames: list[tuple[Snapshot, DepthReport]] = []

    def add(self, snapshot: Snapshot, depths: DepthReport) -> None:
        """What was found in the next frame."""
        self._frames.append((replace(snapshot, contour=_NO_CONTOUR), depths))

    def write(self, drawn: Callable[[], None]) -> None:
        """Write ``NNNNNN.png`` (net), ``NNNNNN_depth.png`` and vertices.png once all are drawn.

        Parameters
        ----------
        drawn
            Called after each frame.
        """
        known = [r.depth_cm for _, d in self._frames for r in d.regions.values() if r.depth_cm is not None]
        scale = depth_scale(np.array(known))
        first_s = self._sequence.frames[0].pose.t_s
        with tempfile.TemporaryDirectory(prefix="pictures-") as drafts:

            def save(name: str, picture: np.ndarray) -> None:
                cv2.imwrite(str(Path(drafts) / name), picture)

            caption = ""
            for k, (snapshot, depths) in enumerate(self._frames):
                frame, image = self._sequence.frames[k], self._sequence.image(k)
                caption = f"frame {frame.number}   {frame.pose.t_s - first_s:.2f} s"
                truth = None if self._truth is None else self._truth[frame.number]
                save(f"{frame.number:06d}.png", draw_net(image, snapshot, depths, caption))
                picture = draw_depth(image, snapshot, depths, scale, truth, caption)
                save(f"{frame.number:06d}_depth.png", picture)
                drawn()
            poses = [
                frame.pose if depths.motion is None else depths.motion.camera
                for frame, (_, depths) in zip(self._sequence.frames, self._frames, strict=True)
            ]
            save(SPACE, draw_space(space_of(*self._frames[-1], poses), caption))
            for draft in sorted(Path(drafts).iterdir()):
                write_whole(self._folder / draft.name, draft.read_bytes())


_NO_CONTOUR = Contour(
    np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, int), np.zeros(0, int), np.zeros(0), np.zeros(0)
)  # pictures need none, and it is most of a snapshot
