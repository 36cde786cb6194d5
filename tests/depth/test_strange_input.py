"""Whatever comes in, there is an answer, and none that is wrong."""

from __future__ import annotations

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from board_scene import LENS
from drives import FIRST, Run, ahead, before_the_wall, boards_before_a_wall, drive, table_top, wall
from solid_scene import Eye, board

from host.depth.config import DepthConfig
from host.depth.report import DepthReport
from host.pose import Pose
from host.rbdn.snapshot import Contour, Snapshot, Vertices


def look_at(scene: int = 0) -> Eye:
    return Eye(boards_before_a_wall(scene), noise_px=0.1, vertex_noise_px=0.1, seed=scene)


def sound(report: DepthReport) -> None:
    """Every number of a report is finite and possible, and nothing is without a depth or a reason."""
    for found in report.regions.values():
        assert (found.depth_cm is None) == (found.sigma_cm is None) == (found.method is None)
        if found.depth_cm is None:
            assert found.method_note
        else:
            assert np.isfinite(found.depth_cm) and found.depth_cm > 0
            assert np.isfinite(found.sigma_cm) and found.sigma_cm > 0
        for estimate in found.estimates.values():
            assert np.isfinite(estimate.depth_cm) and estimate.depth_cm > 0
            assert np.isfinite(estimate.sigma_cm) and estimate.sigma_cm > 0
        assert set(found.estimates) | set(found.declined) == {"area", "outline", "vertex"}
        assert not set(found.estimates) & set(found.declined)
    known = np.isfinite(report.vertices.sigma_cm)
    assert (np.isfinite(report.vertices.xyz_cm).all(axis=1) == known).all()
    assert (report.vertices.xyz_cm[known, 2] > 0).all() and (report.vertices.sigma_cm[known] > 0).all()


def all_sound(run: Run) -> Run:
    for report in run.reports:
        sound(report)
    return run


def nothing(seq: int = 0) -> Snapshot:
    ids, two = np.zeros(0, np.int64), np.zeros((0, 2))
    empty = np.zeros(0)
    contour = Contour(two, two, ids, ids, empty, empty)
    return Snapshot(seq, (), Vertices(ids, two, empty), contour, (), 0, 0.0, 0.0)


def test_every_report_of_many_drives_is_sound():
    for seed in range(6):
        all_sound(drive(Eye(table_top(seed), noise_px=0.15, vertex_noise_px=0.2, seed=seed), ahead(8, 8.0)))


def test_empty_frames_give_empty_reports():
    run = all_sound(drive(look_at(), ahead(4, 3.0), change=lambda k, eye, pose: nothing(k)))
    assert all(report.regions == {} and len(report.vertices.ids) == 0 for report in run.reports)


def test_empty_frames_between_others_lose_nothing():
    run = drive(
        look_at(),
        ahead(13, 12.0),
        change=lambda k, eye, pose: nothing(k) if k in (3, 4, 9) else eye.look(pose),
    )
    assert np.nanmedian(np.abs(before_the_wall(all_sound(run)))) < 0.01
    assert np.isfinite(before_the_wall(run)).all()


def test_a_single_region_that_fills_the_picture_has_no_depth():
    run = all_sound(drive(Eye([wall()], noise_px=0.1), ahead(6, 5.0)))
    assert run.region(1).depth_cm is None


def test_a_single_thing_in_the_picture_is_right():
    run = all_sound(drive(Eye([board(10, (5, 3, 80), (18, 14))], noise_px=0.1), ahead(11, 10.0)))
    assert abs(run.errors()[10]) < 0.01


def test_vertices_that_are_nowhere_are_passed_over():
    def look(k: int, eye: Eye, pose: Pose) -> Snapshot:
        seen = eye.look(pose)
        xy = seen.vertices.xy_px.copy()
        sigma = seen.vertices.sigma_px.copy()
        xy[k % len(xy)] = np.nan
        sigma[::3] = np.nan
        return replace(seen, vertices=replace(seen.vertices, xy_px=xy, sigma_px=sigma))

    run = all_sound(drive(look_at(), ahead(11, 10.0), change=look))
    assert np.nanmedian(np.abs(before_the_wall(run))) < 0.01


def test_the_same_frame_twice_changes_nothing_and_is_no_trouble():
    path = [p for p in ahead(11, 10.0) for _ in (0, 1)]
    run = all_sound(drive(look_at(), path))
    assert np.nanmedian(np.abs(before_the_wall(run))) < 0.01


def test_frames_without_a_time_are_no_trouble():
    path = [replace(p, t_s=0.0) for p in ahead(11, 10.0)]
    assert np.nanmedian(np.abs(before_the_wall(all_sound(drive(look_at(), path))))) < 0.01


@pytest.mark.parametrize("far_cm", [1e4, 1e7, 1e9])
def test_a_leap_of_odometry_is_no_trouble(far_cm: float):
    path = ahead(14, 13.0)
    said = [
        replace(p, position_cm=p.position_cm + np.array([0, 0, far_cm * (k >= 7)]))
        for k, p in enumerate(path)
    ]
    run = all_sound(drive(look_at(), path, said))
    for name, error in run.errors().items():
        found = run.region(name)
        assert abs(error) < max(0.1, 3 * found.sigma_cm / found.depth_cm)


@pytest.mark.parametrize("when", [0, 5])
def test_a_place_that_is_not_a_number_is_forgotten(when: int):
    path = ahead(17, 16.0)
    said = [replace(p, position_cm=p.position_cm * (1 if k != when else np.nan)) for k, p in enumerate(path)]
    errors = before_the_wall(all_sound(drive(look_at(), path, said)))
    assert np.isfinite(errors).all() and np.abs(errors).max() < 0.05


@pytest.mark.parametrize(
    ("name", "value"),
    [("keyframes", 2), ("vertex_history", 2), ("area_history", 2), ("min_step_cm", 0.0), ("nearest_cm", 0.0)],
)
def test_settings_the_engine_cannot_work_with_are_refused_by_name(name: str, value: float):
    with pytest.raises(ValueError, match=name):
        replace(DepthConfig(), **{name: value})


@pytest.mark.parametrize("away_cm", [1e5, 1e8])
def test_it_does_not_matter_where_the_world_begins(away_cm: float):
    path = ahead(11, 10.0)
    said = [replace(p, position_cm=p.position_cm + np.array([away_cm, 0.0, -away_cm])) for p in path]
    run = all_sound(drive(look_at(), path, said))
    assert np.nanmedian(np.abs(before_the_wall(run))) < 0.01


def test_it_does_not_matter_how_the_world_is_turned():
    path = ahead(11, 10.0)
    plain = drive(look_at(), path)
    turn = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    said = [replace(p, rotation=turn @ p.rotation, position_cm=turn @ p.position_cm) for p in path]
    other = drive(look_at(), path, said)
    for name, found in plain.last.regions.items():
        if found.depth_cm is not None:
            assert other.region(name).depth_cm == pytest.approx(found.depth_cm, rel=1e-3)


def test_tiny_steps_add_up():
    run = all_sound(drive(look_at(), ahead(60, 9.7)))
    assert np.nanmedian(np.abs(before_the_wall(run))) < 0.01
    assert np.isfinite(before_the_wall(run)).all()


def test_a_lens_that_bends_is_straightened():
    bent = dataclasses.replace(LENS, distortion=(-0.25, 0.08, 0.002, -0.001, 0.0))
    errors = [
        before_the_wall(
            drive(
                Eye(boards_before_a_wall(s), bent, noise_px=0.1, vertex_noise_px=0.1, seed=s), ahead(11, 10.0)
            )
        )
        for s in range(4)
    ]
    assert np.nanmedian(np.abs(np.concatenate(errors))) < 0.006
    assert np.isfinite(np.concatenate(errors)).mean() > 0.95


def test_another_camera_is_as_good():
    wide = dataclasses.replace(LENS, width=640, height=360, fx=520.0, fy=515.0, cx=310.0, cy=188.0)
    run = all_sound(drive(Eye(boards_before_a_wall(1), wide, noise_px=0.1), ahead(11, 10.0)))
    assert np.nanmedian(np.abs(before_the_wall(run))) < 0.006


def test_a_hundred_regions_are_no_trouble():
    things = [
        board(FIRST + 20 * i + j, ((i - 5.5) * 5.6, (j - 4.5) * 5.6, 85 + (7 * i + 3 * j) % 11), (3.6, 3.6))
        for i in range(12)
        for j in range(10)
    ]
    run = all_sound(drive(Eye([*things, wall()], noise_px=0.1), ahead(4, 8.0)))
    assert len(run.last.regions) > 100
    assert np.nanmedian(np.abs(before_the_wall(run))) < 0.02


def test_the_same_drive_gives_the_same_numbers_to_the_bit():
    one, two = (drive(look_at(1), ahead(9, 8.0)) for _ in range(2))
    for a, b in zip(one.reports, two.reports, strict=True):
        assert a.regions == b.regions
        assert np.array_equal(a.vertices.xyz_cm, b.vertices.xyz_cm, equal_nan=True)


def test_two_estimators_do_not_disturb_each_other():
    from host.depth.estimator import Estimator

    path, alone = ahead(9, 8.0), drive(look_at(1), ahead(9, 8.0))
    one, two, eye, other = Estimator(LENS), Estimator(LENS), look_at(1), look_at(2)
    for pose in path:
        mine = one.update(eye.look(pose), pose)
        two.update(other.look(pose), pose)
    assert mine.regions == alone.last.regions
