"""Files appear whole or not at all, and nothing but a file is ever replaced."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from host.errors import UsageError
from host.record.atomic import check_writable, write_whole


def test_a_file_is_replaced_and_no_draft_is_left(tmp_path: Path):
    target = tmp_path / "new" / "out.json"
    for content in (b"first", b"second"):
        check_writable(target, folder=False)
        write_whole(target, content)
    assert target.read_bytes() == b"second"
    assert [p.name for p in target.parent.iterdir()] == ["out.json"]


def test_whatever_is_no_ordinary_file_is_refused_and_kept(tmp_path: Path):
    pipe = tmp_path / "pipe"  # stands for /dev/null and its like, which must not be put at risk here
    os.mkfifo(pipe)
    with pytest.raises(UsageError, match="pipe: is no ordinary file"):
        check_writable(pipe, folder=False)
    with pytest.raises(UsageError, match="pipe: is no ordinary file"):
        write_whole(pipe, b"lost")
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert [p.name for p in tmp_path.iterdir()] == ["pipe"]


def test_what_the_command_line_names_twice_is_refused(tmp_path: Path):
    run, other = tmp_path / "run.mcap", tmp_path / "other.mcap"
    other.symlink_to(run)
    for target, beside in ((run, [None, run]), (other, [run]), (tmp_path / "x" / ".." / "run.mcap", [run])):
        with pytest.raises(UsageError, match="is given for something else too, and would be lost"):
            check_writable(target, folder=False, beside=beside)
    check_writable(tmp_path / "out.json", folder=False, beside=[None, run])


@pytest.mark.parametrize("folder", [False, True])
def test_a_name_the_disk_cannot_hold_is_refused_in_one_line(tmp_path: Path, folder: bool):
    with pytest.raises(UsageError, match="too long"):
        check_writable(tmp_path / ("x" * 300), folder=folder)


@pytest.mark.parametrize("folder", [False, True])
def test_where_nothing_can_be_written_is_known_before_any_work_also_to_root(folder: bool):
    with pytest.raises(UsageError, match="/proc/no/where"):
        check_writable(Path("/proc/no/where"), folder=folder)
