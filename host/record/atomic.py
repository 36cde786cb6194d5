"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Iterable
from pathlib import Path

from host.errors import UsageError


def check_writable(path: Path, *, folder: bool, beside: Iterable[Path | None] = ()) -> None:
    """See before any work is done that a result can go to `path`.

    Parameters
    ----------
    path
        The file, or with `folder` the folder, that will be written. It and its parents need not exist yet.
    beside
        What else the command line names, to be read or written; it must not be the same.

    Raises
    ------
    UsageError
        where something else is in the way or the place is not writable.
    """
    try:
        if os.path.realpath(path) in {os.path.realpath(other) for other in beside if other is not None}:
            raise UsageError(f"{path}: is given for something else too, and would be lost; name another")
        _check_place(path, folder)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written ({error.strerror}); choose another place") from error


def write_whole(path: Path, content: bytes) -> None:
    """Replace `path` by `content` in one step, so that no reader ever sees half a file; it keeps its mode.

    Raises
    ------
    UsageError
        where it cannot be written, or something other than a file is there; what was at `path` before is
        then untouched.
    """
    _refuse_device(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise UsageError(f"{path}: cannot be written ({error.strerror}); choose another place") from error
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        # mkstemp makes files that only their owner can read
        os.chmod(name, stat.S_IMODE(path.stat().st_mode) if path.exists() else 0o666 & ~_umask())
        os.replace(name, path)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written ({error.strerror}); choose another place") from error
    finally:
        Path(name).unlink(missing_ok=True)


def _check_place(path: Path, folder: bool) -> None:
    if folder and path.exists() and not path.is_dir():
        raise UsageError(f"{path}: is a file, but a folder is needed for the pictures; name another")
    if not folder and path.is_dir():
        raise UsageError(f"{path}: is a folder; name a file in it")
    if not folder:
        _refuse_device(path)
    nearest = path
    while not nearest.exists() and nearest != nearest.parent:
        nearest = nearest.parent
    if nearest.is_file() and nearest != path:
        raise UsageError(f"{path}: cannot be created because {nearest} is a file; choose another place")
    if not os.access(nearest, os.W_OK):
        raise UsageError(f"{path}: no permission to write to {nearest}; choose another place")
    # Root is permitted everything, also where nothing can be written.
    with tempfile.TemporaryFile(dir=nearest if nearest.is_dir() else nearest.parent):
        pass


def _refuse_device(path: Path) -> None:
    """Replacing /dev/null by a file would harm every program of the machine, and root is able to."""
    if path.exists() and not path.is_file():
        raise UsageError(f"{path}: is no ordinary file and would be lost; name another")


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
