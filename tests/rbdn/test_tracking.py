"""Tracking does not decay: what a net makes of a long sequence is as good as what it made at first.

Every floor lies below what `python -m bench.tracking` measures on more of the same.
"""

from __future__ import annotations

from typing import Any

import pytest
from invariants import assert_sound

from bench.passes import KINDS, PassScene
from bench.sequences import LongRun, corridor, table_top
from bench.tracking import measure_long_run, measure_passes, measure_to_and_fro
from host.rbdn import Net

ONE_OBJECT = 5.0  # per cent of recall: a run shows some 23 of them


@pytest.fixture(scope="module")
def passes() -> dict[str, Any]:
    """Figures of two generated passes of every kind, as a webcam shows them."""
    return measure_passes(2, ["webcam"])


def test_what_enters_is_found_within_two_frames(passes):
    assert passes["found_within_2_frames"] == 100


def test_ids_survive_being_partly_covered(passes):
    assert passes["ids_kept_while_partly_covered"] > 97


def test_things_that_passed_each_other_are_whole_again(passes):
    assert passes["recovered_after_partial_pass"] == 100
    assert passes["recovered_after_full_pass"] > 90


def test_most_of_what_was_wholly_hidden_is_known_again(passes):
    assert passes["same_id_after_full_pass"] > 70


def test_nothing_is_left_of_a_pass(passes):
    assert passes["debris_per_scene"] <= 0.1


def test_every_third_frame_is_enough(passes):
    assert passes["recall"] > 97
    assert passes["recall_every_third_frame"] > passes["recall"] - 3


@pytest.mark.parametrize("kind", KINDS)
def test_the_net_is_sound_in_every_frame_of_a_pass(kind):
    scene = PassScene(kind, "webcam", 2)
    net = Net()
    for k in range(0, scene.frames, 2):
        net.track(scene.draw(k)[0])
        assert_sound(net)


@pytest.mark.parametrize("run", [table_top(1, 120), corridor(4, 120)], ids=lambda run: run.name)
def test_a_net_tracked_for_long_is_as_good_and_as_small_as_a_fresh_one(run: LongRun):
    figures = measure_long_run(run)
    assert figures["recall"] >= figures["recall_fresh"] - ONE_OBJECT
    assert 0.8 <= figures["faces_ratio"] <= 1.2
    assert 0.75 <= figures["vertices_ratio"] <= 1.2
    assert figures["unsound_frames"] == 0


def test_the_ninth_pass_over_a_sequence_is_as_good_and_as_small_as_the_first():
    run = table_top(3, 12)
    figures = measure_to_and_fro(list(run.shots()), run.world.lens)
    assert figures["recall"] >= figures["recall_first_pass"] - 2
    assert figures["faces_ratio"] <= 1.1
    assert figures["edges_ratio"] <= 1.2
    assert figures["unsound_frames"] == 0
