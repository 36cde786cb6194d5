"""One depth from several methods and frames."""

from __future__ import annotations

import numpy as np
import pytest

from host.depth.config import DepthConfig
from host.depth.fuse import Combined, Memory, combine
from host.depth.motion import Station, first_station, most_redundant, next_station
from host.depth.report import Estimate
from host.pose import Pose

AHEAD = np.array([0.0, 0.0, 1.0])


def stations(*z_cm: float) -> list[Station]:
    config, out = DepthConfig(), []
    for k, z in enumerate(z_cm):
        pose = Pose.planar(0.0, z, 0.0, t_s=0.1 * k)
        out.append(first_station(k, pose, config) if not out else next_station(out[-1], k, pose, config))
    return out


def measured(depth_cm: float, sigma_cm: float) -> Combined:
    return Combined(Estimate(depth_cm, sigma_cm), "outline", None)


def test_the_surer_method_weighs_more():
    fused = combine({"area": Estimate(80.0, 4.0), "outline": Estimate(78.0, 1.0)})
    assert fused is not None
    assert fused.method == "outline"
    assert 78.0 < fused.estimate.depth_cm < 78.3


def test_methods_that_share_their_outline_do_not_count_as_independent():
    fused = combine({m: Estimate(80.0, 2.0) for m in ("area", "outline", "vertex")})
    assert fused is not None
    assert 2.0 / np.sqrt(3) < fused.estimate.sigma_cm < 2.0


def test_a_method_that_contradicts_the_surest_is_left_out_and_named():
    fused = combine({"area": Estimate(120.0, 4.0), "outline": Estimate(78.0, 1.0)})
    assert fused is not None
    assert fused.estimate == Estimate(78.0, 1.0)
    assert fused.note == "contradicted by area"


def test_nothing_gives_nothing():
    assert combine({}) is None


def test_an_answer_comes_along_with_the_camera():
    start, later = stations(0.0, 10.0)
    memory = Memory(DepthConfig())
    memory.update(7, measured(85.0, 1.0), AHEAD, start)
    carried = memory.predict(7, later)
    assert carried is not None
    assert carried.depth_cm == pytest.approx(75.0)
    assert carried.sigma_cm > 1.0


def test_at_rest_no_number_of_frames_sharpens_an_answer():
    path = stations(0.0, *[0.1] * 50)
    memory = Memory(DepthConfig())
    said = [memory.update(7, measured(80.0 + 0.1 * (k % 2), 2.0), AHEAD, s) for k, s in enumerate(path)]
    sigma = [answer[0].sigma_cm for answer in said if answer]
    assert len(sigma) == len(path)
    assert min(sigma) >= 2.0


def test_on_the_move_the_sigma_is_never_better_than_the_best_measured():
    path = stations(*np.arange(0.0, 20.0))
    memory = Memory(DepthConfig())
    for k, s in enumerate(path):
        answer = memory.update(7, measured(80.0 - k, 2.0), AHEAD, s)
        assert answer is not None
        assert answer[0].sigma_cm >= 2.0
        assert answer[0].depth_cm == pytest.approx(80.0 - k, abs=0.01)


def test_a_lost_answer_is_carried_on_and_grows_old():
    path = stations(*np.linspace(0.0, 300.0, 31))
    memory = Memory(DepthConfig())
    memory.update(7, measured(1000.0, 20.0), AHEAD, path[0])
    carried = [memory.update(7, None, AHEAD, s) for s in path[1:]]
    assert carried[0] is not None
    assert carried[0][2] == "carried on from an earlier frame"
    ages = [c[0].sigma_cm for c in carried if c]
    assert ages == sorted(ages)
    assert carried[-1] is None


def test_an_answer_that_contradicts_the_memory_begins_anew():
    here, there = stations(0.0, 1.0)
    memory = Memory(DepthConfig())
    memory.update(7, measured(80.0, 1.0), AHEAD, here)
    answer = memory.update(7, measured(40.0, 1.0), AHEAD, there)
    assert answer is not None
    assert answer[0].depth_cm == 40.0
    assert answer[2] is not None


def test_what_is_long_unseen_is_forgotten():
    (here,) = stations(0.0)
    memory = Memory(DepthConfig())
    memory.update(7, measured(80.0, 1.0), AHEAD, here)
    memory.forget_unseen(20)
    assert memory.predict(7, here) is not None
    memory.forget_unseen(100)
    assert memory.predict(7, here) is None


def test_kept_frames_lie_dense_near_the_present_and_sparse_far_back():
    kept: list[float] = []
    for z in np.arange(0.0, 200.0):
        kept.append(z)
        if len(kept) > 6:
            positions = np.column_stack([np.zeros((len(kept), 2)), kept])
            del kept[most_redundant(positions, positions[-1])]
    gaps = np.diff(kept)
    assert kept[0] == 0.0
    assert gaps[0] > 4 * gaps[-1]
