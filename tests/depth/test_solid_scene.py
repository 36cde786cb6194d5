"""The judge judged: solid scenes are seen as they are."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from board_scene import LENS
from drives import boards_before_a_wall, table_top
from solid_scene import Ball, Block, Eye, Post, board, room

from host.pose import Pose

HERE = Pose.planar(0.0, 0.0, 0.0)


def test_the_regions_of_a_room_fill_the_picture():
    for seed in range(12):
        snapshot = Eye(table_top(seed)).look(HERE)
        assert sum(r.area_px for r in snapshot.regions) == pytest.approx(320 * 240, abs=60)


def test_a_board_is_as_large_as_it_projects():
    snapshot = Eye([board(7, (3.0, 2.0, 85.0), (20.0, 16.0)), board(1, (0, 0, 300), (3000, 3000))]).look(HERE)
    area = {r.id: r.area_px for r in snapshot.regions}
    assert area[7] == pytest.approx(20 * 16 * (LENS.fx / 85) ** 2, rel=1e-3)


def test_a_ball_shows_its_disc_and_the_mean_depth_of_its_cap():
    eye = Eye([Ball(7, np.array([0.0, 0.0, 80.0]), 8.0), board(1, (0, 0, 300), (3000, 3000))])
    area = {r.id: r.area_px for r in eye.look(HERE).regions}[7]
    assert area == pytest.approx(np.pi * 64 / (80**2 - 64) * LENS.fx**2, rel=2e-3)
    assert eye.truth(HERE)[7] == pytest.approx(80 - 8 * 2 / 3, rel=0.01)


def test_a_thing_behind_another_has_no_outline_where_it_is_hidden():
    near, far = board(7, (0, 0, 60), (12, 30)), board(8, (8, 0, 100), (40, 16))
    contour = Eye([near, far, board(1, (0, 0, 300), (3000, 3000))]).look(HERE).contour
    edge = LENS.cx + LENS.fx * 6 / 60
    hidden = np.abs(contour.xy_px[:, 0] - LENS.cx) < LENS.fx * 6 / 60 - 1
    assert not ((contour.left == 8) & hidden).any()
    shared = (contour.left == 7) & (contour.right == 8)
    assert shared.sum() > 50
    assert np.abs(np.abs(contour.xy_px[shared, 0] - LENS.cx) - (edge - LENS.cx)).max() < 0.01


def test_faces_of_a_box_share_each_edge_once():
    box = Block(9, np.array([10.0, 8.0, 90.0]), (20.0, 12.0, 15.0), 0.5)
    snapshot = Eye([*box.faces(20), *room(1)]).look(HERE)
    contour = snapshot.contour
    for a, b in {tuple(sorted(p)) for p in zip(contour.left.tolist(), contour.right.tolist(), strict=True)}:
        mine = (np.minimum(contour.left, contour.right) == a) & (np.maximum(contour.left, contour.right) == b)
        gap = np.linalg.norm(contour.xy_px[mine, None] - contour.xy_px[None, mine], axis=2)
        assert np.median(np.sort(gap, axis=1)[:, 1]) > 0.8


def test_outlines_err_as_much_as_asked_and_alike_over_four_pixels():
    eye = Eye(boards_before_a_wall(0), noise_px=0.2)
    exact = dataclasses.replace(eye, noise_px=0.0).look(HERE).contour
    off = np.concatenate(
        [
            ((eye.again(seed).look(HERE).contour.xy_px - exact.xy_px) * exact.normal).sum(axis=1)
            for seed in range(8)
        ]
    )
    assert off.std() == pytest.approx(0.2, rel=0.1)
    assert np.mean(off[:-4] * off[4:]) / off.var() == pytest.approx(np.exp(-1), abs=0.12)


def test_areas_err_as_much_as_they_say():
    eye = Eye([board(7, (0, 0, 80), (20, 16)), board(1, (0, 0, 300), (3000, 3000))], noise_px=0.2)
    seen = [next(r for r in eye.again(s).look(HERE).regions if r.id == 7) for s in range(200)]
    assert np.std([r.area_px for r in seen]) == pytest.approx(seen[0].sigma_area_px - 0.5, rel=0.2)


def test_vertices_keep_their_names_and_places_on_the_things():
    eye = Eye([board(7, (0, 0, 80), (20, 16)), Post(8, np.array([20.0, 0, 90]), 4.0, 15.0), *room(1)])
    first, later = eye.look(HERE), eye.look(Pose.planar(0.0, 10.0, 0.0))
    corners = eye.corner_truth(HERE)
    kept = [i for i in first.vertices.ids if i in later.vertices.ids and i in corners]
    assert len(kept) >= 4
    for vertex in kept:
        x0, x1 = (s.vertices.xy_px[list(s.vertices.ids).index(vertex)] - 119.5 for s in (first, later))
        z = corners[vertex]
        grown = (x1[1] - 0.0) / (x0[1] - 0.0)
        assert grown == pytest.approx(z / (z - 10.0), rel=1e-3)


def test_a_lens_bends_outlines_but_not_what_is_seen():
    bent = dataclasses.replace(LENS, distortion=(-0.2, 0.05, 0.001, -0.001, 0.0))
    straight, curved = (Eye(table_top(3), lens=lens).look(HERE) for lens in (LENS, bent))
    assert {r.id for r in straight.regions} == {r.id for r in curved.regions}
    assert sum(r.area_px for r in curved.regions) == pytest.approx(320 * 240, abs=60)
