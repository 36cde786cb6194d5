"""Recordings as files for the Rerun viewer, read back with Rerun's own reader."""

from __future__ import annotations

import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace

import pytest

from host.errors import UsageError
from host.record.mcap_reader import Recording
from host.record.replayed import replay
from host.view import rerun as rerun_command


def test_without_the_extra_one_line_says_how_to_install_it(recorded_drive, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)  # as where it is not installed
    monkeypatch.setattr("sys.argv", ["rerun", str(recorded_drive)])
    with pytest.raises(UsageError, match=r"rerun-sdk not found.*pip install -e '\.\[viz\]'") as told:
        rerun_command.main()
    assert "\n" not in str(told.value)


@pytest.fixture(scope="module")
def rrd(recorded_drive, tmp_path_factory) -> Path:
    pytest.importorskip("rerun.chunk")
    out = tmp_path_factory.mktemp("rerun") / "new" / "run.rrd"
    tally = rerun_command.write_rerun(Recording(recorded_drive), out)
    assert tally.same and tally.pictures > 25
    return out


def columns(rrd: Path) -> tuple[dict, list[str]]:
    """By entity, by column, the values of all rows; and the texts that lay out the views."""
    from rerun.chunk import RrdReader

    reader = RrdReader(rrd)
    out: dict = defaultdict(lambda: defaultdict(list))
    for chunk in reader.stream().to_chunks():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if ":" in name:
                out[chunk.entity_path][name.split(":")[1]] += batch.column(name).to_pylist()
        if "time" in batch.schema.names:
            out[chunk.entity_path]["time_s"] += [v.value * 1e-9 for v in batch.column("time")]
    words = []
    for chunk in reader.stream(store=reader.blueprints()[0]).to_chunks():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name.endswith("display_name"):
                words += [text for row in batch.column(name).to_pylist() for text in row or []]
    return out, words


def test_the_viewer_is_given_all_that_the_drive_saw_and_did(rrd, recorded_drive):
    recording = Recording(recorded_drive)
    steps = [step for step in replay(recording)]
    views = [step.view for step in steps if step.view is not None]
    found, words = columns(rrd)
    assert {"camera, net and depths", "events", "map from above, cm", "speed, cm/s"} <= set(words)

    pictures = found["/camera/image"]["blob"]
    assert len(pictures) == len(found["/camera/net"]["strips"]) == len(views)
    last = views[-1]
    files = [bytes(part) for row in pictures for part in row]
    loops = [loop for region in last.snapshot.regions for loop in region.loops]
    drawn = [strips for strips in found["/camera/net"]["strips"] if strips is not None]
    assert any(len(strips) == len(loops) for strips in drawn)
    assert len(set(files)) == len(files)
    labels = [text for row in found["/camera/depths"]["labels"] for text in row or []]
    known = [r for view in views for r in view.depths.regions.values() if r.depth_cm is not None]
    assert len(labels) == len(known) > 20 and all("cm" in label for label in labels)


def test_depths_speeds_and_events_are_those_of_the_recording(rrd, recorded_drive):
    recording = Recording(recorded_drive)
    found, _ = columns(rrd)
    depths: dict[int, list[float]] = defaultdict(list)
    asked = []
    for entry in recording.journal():
        if entry["do"] == "made":
            for region, _, depth_cm, _, _ in entry["regions"]:
                if depth_cm is not None:
                    depths[region].append(depth_cm)
        if entry["do"] == "drove":
            asked.append(entry["command"]["v_mm_s"] / 10)
    plotted = [entity for entity in found if entity.startswith("/depth/region_")]
    assert plotted
    for entity in plotted:
        region = int(entity.rsplit("_", 1)[1])
        assert [row[0] for row in found[entity]["scalars"] if row] == depths[region]
    assert [row[0] for row in found["/speed/asked_for"]["scalars"] if row] == asked
    texts = [row[0] for e in ("/events/drive", "/events/link") for row in found[e]["text"]]
    assert sorted(texts) == sorted(event.text for event in recording.events())
    times = found["/camera/image"]["time_s"]
    assert times[0] == 0.0 and times == sorted(times) and times[-1] == pytest.approx(2.5, abs=0.2)


def test_reruns_own_check_finds_nothing_wrong(rrd):
    done = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "verify", str(rrd)],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "1 file verified without error" in done.stdout + done.stderr


def test_the_recording_itself_is_not_written_over(recorded_drive, monkeypatch):
    pytest.importorskip("rerun.chunk")
    monkeypatch.setattr("sys.argv", ["rerun", str(recorded_drive), "--out", str(recorded_drive)])
    before = recorded_drive.read_bytes()
    with pytest.raises(UsageError, match="is given for something else too"):
        rerun_command.main()
    assert recorded_drive.read_bytes() == before


def test_a_disk_without_room_is_told_before_anything_is_written(recorded_drive, tmp_path, monkeypatch):
    pytest.importorskip("rerun.chunk")
    monkeypatch.setattr("sys.argv", ["rerun", str(recorded_drive), "--out", str(tmp_path / "run.rrd")])
    monkeypatch.setattr(rerun_command.shutil, "disk_usage", lambda folder: SimpleNamespace(free=300_000))
    with pytest.raises(UsageError, match=r"run\.rrd: takes up to \d+ MB and 0 are free there"):
        rerun_command.main()
    assert list(tmp_path.iterdir()) == []
