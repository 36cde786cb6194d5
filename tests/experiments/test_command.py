"""The command: what it writes, what it refuses, and that its page can be read."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from host.config import Config
from host.errors import UsageError
from host.experiments import catalogue
from host.experiments.__main__ import ExperimentOptions, run
from host.experiments.targets import Target

pytest.importorskip("matplotlib")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Everything once, with few frames and settings."""
    folder = tmp_path_factory.mktemp("experiments")
    with pytest.MonkeyPatch.context() as patch:
        for name, frames in (
            ("EXPERIMENT_1", 6), ("EXPERIMENT_2", 4), ("EXPERIMENT_3", 3), ("STEADY_1", 6), ("STEADY_2", 4),
            ("AREA", 3), ("NOISE", 3), ("SLANT", 3),
        ):  # fmt: skip
            course = replace(getattr(catalogue, name), frames=frames)
            patch.setattr(catalogue, name, replace(course, look_cm=course.look_cm[-2:]))
        for name in ("SIDES_CM", "NOISES", "SLANTS_DEG"):
            patch.setattr(catalogue, name, getattr(catalogue, name)[:1])
        run(ExperimentOptions(seeds=1, jobs=2, out=folder / "docs", json=folder / "all.json"), Config())
    return folder


def test_the_page_has_the_papers_columns_and_ours(written: Path) -> None:
    page = (written / "docs" / "experiments.md").read_text()
    assert "| red C | 85.0 | 345.20 (306 %) |" in page
    assert "| pepper | 5 | 68.5 | 67.0 (2.10 %) |" in page
    assert "| 526.0 (0.19 %) |" in page
    assert "| experiment 1 | 180 | 130 |" in page
    assert "nan" not in page
    assert "{" not in page


def test_every_picture_the_page_shows_is_there_and_small(written: Path) -> None:
    page = (written / "docs" / "experiments.md").read_text()
    pictures = [part.split(")")[0] for part in page.split("](pictures/")[1:]]
    assert len(pictures) == 4
    for name in pictures:
        assert 5_000 < (written / "docs" / "pictures" / name).stat().st_size < 150_000


def test_the_figures_are_written_with_what_they_came_from(written: Path) -> None:
    figures = json.loads((written / "all.json").read_text())
    assert {row["course"] for row in figures["findings"]} >= {"experiment_1", "experiment_2", "experiment_3"}
    assert all(math.isfinite(row["true_cm"]) for row in figures["findings"])
    assert {"what", "wanted", "found", "unit", "reached"} <= set(figures["targets"][0])


def test_a_figure_counts_as_reached_only_if_it_was_found() -> None:
    assert Target("error", "%", 0.4, 0.5).reached
    assert not Target("error", "%", 0.6, 0.5).reached
    assert not Target("error", "%", math.nan, 0.5).reached
    assert not Target("share", "%", 80.0, 72.0, 64.0).reached
    assert Target("share", "%", 70.0, 72.0, 64.0).wanted == "64 to 72 %"


@pytest.mark.parametrize("seeds", [0, 100_000])
def test_a_number_of_runs_that_makes_no_sense_is_refused(seeds: int) -> None:
    with pytest.raises(UsageError, match="seeds"):
        ExperimentOptions(seeds=seeds)


def test_a_place_that_cannot_be_written_is_found_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "docs").write_text("a file")
    start = time.monotonic()
    with pytest.raises(UsageError, match="docs"):
        run(ExperimentOptions(out=tmp_path / "docs"), Config())
    assert time.monotonic() - start < 5


def test_help_says_how_the_command_is_called() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "host.experiments", "--help"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0
    assert "python -m host.experiments [" in done.stdout
    assert "--seeds" in done.stdout
