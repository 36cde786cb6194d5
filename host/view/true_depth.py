"""True depths of a rendered sequence, for pictures of the error; nothing that estimates may import this."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from host.errors import InputError
from host.record.sequence import Sequence

FILE = Path("truth") / "depth.npz"


def read_true_depths(sequence: Sequence) -> np.ndarray | None:
    """Depths, (F, H, W) by frame number, in cm along the axis, 0 = nothing; None where there is no truth.

    Raises
    ------
    InputError
        where the file is damaged or does not fit the sequence.
    """
    path = sequence.folder / FILE
    if not path.is_file():
        return None
    remedy = "export the sequence anew, or remove its truth folder to do without"
    try:
        with np.load(path) as maps:
            depths = np.asarray(maps["depth"], dtype=np.float32)
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: holds no depths that can be read; {remedy}") from error
    least = (sequence.frames[-1].number + 1, sequence.lens.height, sequence.lens.width)
    if depths.ndim != 3 or depths.shape[1:] != least[1:] or len(depths) < least[0]:
        raise InputError(
            f"{path}: depths of shape {depths.shape}, but the sequence needs at least {least}; {remedy}"
        )
    return depths
