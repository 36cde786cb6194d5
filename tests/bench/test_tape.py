"""Taped drives come out as they did in the simulator."""

from __future__ import annotations

from bench.tape import play, record
from host.nav.result import without_times


def test_a_tape_played_without_the_simulator_gives_the_drive_again_and_the_time_of_every_picture():
    tape, driven = record("sim:room?seed=2&rough=1", "sim:?rough=1&seed=2", 1.5)
    rows, played = play(tape, 1.5)
    assert without_times(played.as_dict()) == without_times(driven.as_dict())
    assert driven.frames - driven.refused_frames == len(rows) > 5
    for row in rows:
        stages = sum(ms for stage, ms in row.items() if stage not in ("command", "all"))
        assert 0 < stages <= row["all"]
        assert row["net"] + row["depth"] < row["command"] < row["all"]
