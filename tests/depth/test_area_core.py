"""Depth from growing areas, in the depth engine."""

from __future__ import annotations

import dataclasses

import numpy as np
import parts
import pytest
from board_scene import LENS, Board, Camera, disc, rectangle, straight_path, turned
from parts import EXACT, Noise, Run, Said
from solid_things import KINDS, seen, thing

from host.pose import Pose
from host.rbdn.snapshot import Event, Region, Snapshot, Vertices

BOX = rectangle(7, (8.0, 4.0, 85.0), (20.0, 16.0))
EMPTY = dataclasses.replace(
    Camera([BOX]).look(Pose.planar(0, 0, 0)),
    regions=(),
    vertices=Vertices(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros(0)),
)
Frames = list[tuple[Snapshot, Pose]]


def watch(board: Board, path: list[Pose], **camera: float) -> Frames:
    """What a camera sees of one board along a path."""
    eye = Camera([board], **camera)
    return [(eye.look(pose), pose) for pose in path]


def answers(frames: Frames, own_share: float | list[float] = 1.0, noise: Noise = EXACT) -> list[Said]:
    """What the method says of the first region after each frame; the path forgets what is not asked for."""
    run, out = Run(LENS, noise), []
    shares = own_share if isinstance(own_share, list) else [own_share] * len(frames)
    for (snapshot, pose), share in zip(frames, shares, strict=True):
        run.see(snapshot, pose)
        out.append(run.area(0, share))
        run.frames()
    return out


def depth(answer: Said) -> float:
    assert answer.known, answer
    return answer.depth_cm


def with_area(frame: tuple[Snapshot, Pose], scale: float) -> tuple[Snapshot, Pose]:
    snapshot, pose = frame
    box = snapshot.regions[0]
    region = dataclasses.replace(box, area_px=scale * box.area_px)
    return dataclasses.replace(snapshot, regions=(region, *snapshot.regions[1:])), pose


def test_two_frames_give_equation_16():
    (first, _), (second, _) = frames = watch(BOX, straight_path(2, 5.0))
    ratio = np.sqrt(first.regions[0].area_px / second.regions[0].area_px)
    at_the_first_frame = 5.0 / (1 - ratio)
    assert depth(answers(frames)[-1]) == pytest.approx(at_the_first_frame - 5.0, rel=1e-9)


def test_the_sensitivity_is_that_of_equation_18():
    frames = watch(BOX, straight_path(11, 1.0))
    last = answers(frames)[-1]
    growth = frames[10][0].regions[0].area_px - frames[9][0].regions[0].area_px  # over the last cm
    assert last.sensitivity == pytest.approx(growth, rel=0.03)


@pytest.mark.parametrize("board", [BOX, disc(7, (-9, 5, 85), 6.0)], ids=["rectangle", "disc"])
def test_a_frontal_board_is_where_its_growth_says(board: Board):
    assert depth(answers(watch(board, straight_path(11, 1.0)))[-1]) == pytest.approx(75.0, rel=1e-6)


def test_the_soft_area_counts_and_not_the_polygon():
    frames = [with_area(f, 0.97) for f in watch(BOX, straight_path(11, 1.0))]
    assert depth(answers(frames)[-1]) == pytest.approx(75.0, rel=1e-6)


def test_a_camera_that_turns_on_its_way_changes_nothing():
    path = [turned(p, 0.02 * k, -0.03 * k) for k, p in enumerate(straight_path(6, 2.0))]
    last = path[-1]
    true_depth = ((np.array([8.0, 4.0, 85.0]) - last.position_cm) @ last.rotation)[2]
    assert depth(answers(watch(BOX, path))[-1]) == pytest.approx(true_depth, rel=1e-3)


def test_pitch_and_yaw_that_come_and_go_change_nothing():
    path = [turned(p, 0.1 * np.sin(k), 0.1 * np.cos(2 * k)) for k, p in enumerate(straight_path(8, 1.0))]
    last = path[-1]
    true_depth = ((np.array([8.0, 4.0, 85.0]) - last.position_cm) @ last.rotation)[2]
    assert depth(answers(watch(BOX, path))[-1]) == pytest.approx(true_depth, rel=1e-3)


def test_sideways_travel_alone_says_nothing():
    assert "motion" in answers(watch(BOX, straight_path(8, 1.0, (1, 0, 0))))[-1].declined


def test_driving_backwards_shows_depth_as_well():
    assert depth(answers(watch(BOX, straight_path(8, -1.0)))[-1]) == pytest.approx(92.0, rel=1e-6)


def test_what_shrinks_while_it_comes_nearer_declines():
    frames = [with_area(f, 0.96**k) for k, f in enumerate(watch(BOX, straight_path(8, 1.0)))]
    assert "grow" in answers(frames)[-1].declined


def test_a_region_cut_by_the_border_declines():
    half_out = rectangle(7, (36.0, 4.0, 85.0), (20.0, 16.0))
    assert answers(watch(half_out, straight_path(5, 1.0)))[-1].declined == "cut by the image border"


def test_a_region_behind_a_nearer_one_declines_but_is_not_forgotten():
    said = answers(watch(BOX, straight_path(8, 1.0)), [1.0] * 6 + [0.8, 1.0])
    assert "hidden" in said[6].declined
    assert depth(said[7]) == pytest.approx(78.0, rel=1e-6)


def test_a_change_of_shape_is_no_growth():
    wider = []
    for k, (snapshot, pose) in enumerate(watch(BOX, straight_path(6, 1.0))):
        box = snapshot.regions[0]
        stretched = box.loops[0] * (1 + 0.03 * k, 1.0)
        region = dataclasses.replace(box, loops=(stretched,), area_px=box.area_px * (1 + 0.03 * k))
        wider.append((dataclasses.replace(snapshot, regions=(region,)), pose))
    assert "shape" in answers(wider)[-1].declined


def test_after_a_jump_of_the_area_a_new_baseline_begins():
    frames = watch(BOX, straight_path(20, 1.0), noise_px=0.02)
    # from frame 8 on the net takes half as much again for the same thing
    larger = watch(rectangle(7, (8.0, 4.0, 85.0), (24.5, 19.6)), straight_path(20, 1.0), noise_px=0.02)
    said = answers(frames[:8] + larger[8:])
    assert depth(said[7]) == pytest.approx(78.0, rel=0.03)
    assert "jumped" in said[9].declined
    assert depth(said[-1]) == pytest.approx(66.0, rel=0.03)


@pytest.mark.parametrize("bad", [0, 6, 11])
def test_one_bad_frame_is_outvoted(bad: int):
    frames = watch(BOX, straight_path(12, 1.0), noise_px=0.02)
    frames[bad] = with_area(frames[bad], 1.2)
    assert depth(answers(frames)[-1]) == pytest.approx(74.0, rel=0.02)


def test_a_split_ends_the_history_and_is_the_reason():
    camera, path = Camera([BOX]), straight_path(6, 2.0)
    frames = [(camera.look(p, (Event("split", 9, 7),) if k == 4 else ()), p) for k, p in enumerate(path)]
    said = answers(frames)
    assert said[3].known
    assert "split or merged" in said[4].declined
    assert depth(said[5]) == pytest.approx(75.0, rel=1e-6)


def test_a_longer_way_makes_surer():
    said = answers(watch(BOX, straight_path(11, 1.0), noise_px=0.6))
    assert said[10].sigma_cm / said[10].depth_cm < 0.7 * said[4].sigma_cm / said[4].depth_cm


def test_standing_still_makes_no_surer():
    path = straight_path(8, 1.0)
    rest = [dataclasses.replace(path[-1], t_s=0.8 + 0.1 * k) for k in range(30)]
    said = answers(watch(BOX, path + rest, noise_px=0.1))
    arrived, later = said[7].sigma_cm, np.array([s.sigma_cm for s in said[8:]])
    assert (later > 0.8 * arrived).all()


def test_doubt_about_the_travelled_distance_is_doubt_about_the_depth():
    sure = answers(watch(BOX, straight_path(11, 1.0)))[-1]
    unsure = answers(watch(BOX, straight_path(11, 1.0, sigma_z_cm=0.5)))[-1]
    # two readings of 0.5 cm each in 10 cm
    assert unsure.sigma_cm == pytest.approx(75 * np.hypot(sure.sigma_cm / 75, 0.0707), rel=0.05)


def test_doubt_about_the_rotation_is_doubt_about_the_depth():
    off_axis = rectangle(7, (26.0, 4.0, 85.0), (12.0, 16.0))
    sure = answers(watch(off_axis, straight_path(3, 4.0)))[-1]
    unsure = answers(watch(off_axis, straight_path(3, 4.0)), noise=Noise(0.0, 0.005, 0.0, 0.0))[-1]
    assert unsure.sigma_cm > 1.5 * sure.sigma_cm


def test_errors_of_measured_areas_are_those_sigma_promises():
    """Noise of the areas alone: what sigma holds for surfaces that are no frontal planes is taken off."""
    path, misses = straight_path(9, 1.5), []
    calm = answers(watch(BOX, path))[-1]
    for seed in range(80):
        last = answers(watch(BOX, path, noise_px=0.6, seed=seed))[-1]
        noise = np.sqrt((last.sigma_cm / last.depth_cm) ** 2 - (calm.sigma_cm / calm.depth_cm) ** 2)
        misses.append((last.depth_cm / 73.0 - 1) / noise)
    misses = np.abs(np.array(misses))
    assert 0.55 < (misses < 1).mean() < 0.85
    assert (misses < 2).mean() > 0.9


def slanted(slant_deg: float, x_cm: float) -> Board:
    return rectangle(7, (x_cm, 4.0, 85.0), (20.0, 16.0), np.radians(slant_deg))


@pytest.mark.parametrize("slant_deg", [-50, -30, 30, 50])
@pytest.mark.parametrize("x_cm", [0.0, 18.0])
def test_slanted_boards_are_wrong_by_no_more_than_sigma_says(slant_deg: float, x_cm: float):
    """Eq. 16 is: the strain of the shape tells how far."""
    last = answers(watch(slanted(slant_deg, x_cm), straight_path(9, 1.0)))[-1]
    if last.known:
        assert abs(last.depth_cm - 77.0) < 2 * last.sigma_cm
    else:
        assert "shape" in last.declined or "uncertain" in last.declined


def test_a_slant_off_the_axis_costs_more_sureness_than_on_it():
    frontal, oblique = (answers(watch(slanted(s, 18.0), straight_path(9, 1.0)))[-1] for s in (0, 30))
    assert not oblique.known or oblique.sigma_cm > 1.5 * frontal.sigma_cm


def test_no_more_frames_are_asked_for_than_are_kept():
    run, path = Run(LENS, EXACT), straight_path(70, 0.5)
    for snapshot, pose in watch(rectangle(7, (8.0, 4.0, 120.0), (20.0, 16.0)), path):
        run.see(snapshot, pose)
        said = run.area()
        assert len(run.frames()) <= 32 + 12
    assert depth(said) == pytest.approx(120.0 - 34.5, rel=1e-6)


def test_a_region_without_area_declines():
    snapshot, pose = watch(BOX, straight_path(1, 1.0))[0]
    flat = dataclasses.replace(snapshot.regions[0], loops=(np.zeros((4, 2)),), area_px=0.0)
    run = Run(LENS)
    run.see(dataclasses.replace(snapshot, regions=(flat,)), pose)
    assert run.area().declined == "no area"
    assert parts.polygon_area(flat.loops) == 0.0


# --- Things that are no frontal planes -------------------------------------------------------------


def approach(kind: str, seed: int) -> tuple[Said, float] | None:
    """What is said of a random thing after a way of a tenth of its distance, and its mean depth then."""
    solid = thing(kind, np.random.default_rng((KINDS.index(kind), seed)))
    first = seen(solid)
    if first is None:
        return None
    run = Run(LENS, EXACT, exact_outlines=True)
    for k in range(6):
        forward = 0.02 * k * first.surface_cm
        now = seen(solid, forward)
        if now is None:
            return None
        area = parts.polygon_area([now.loop])
        nodes = (np.full(len(now.loop), -1),)
        region = Region(7, None, 0, area, 0.5, False, (0.0, 0.0, 0.0), (now.loop,), nodes, nodes)
        run.see(dataclasses.replace(EMPTY, seq=k, regions=(region,)), Pose.planar(0, forward, 0, t_s=0.1 * k))
        said = run.area()
    return said, now.surface_cm


def test_sigma_covers_what_equation_16_does_not_know_of_solid_things():
    said = [a for kind in (*KINDS, "block") for seed in range(90) if (a := approach(kind, seed))]
    answered = [(a, true) for a, true in said if a.known]
    assert len(answered) > 0.8 * len(said)
    off = np.array([abs(a.depth_cm - true) / a.sigma_cm for a, true in answered])
    assert 0.55 < (off < 1).mean() < 0.85
    assert (off < 2).mean() > 0.88
