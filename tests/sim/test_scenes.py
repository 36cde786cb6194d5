"""The scenes for depth: the paper's geometry, and table-tops that are fair to an estimator."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from host.nav.config import NavConfig
from host.pose import Pose
from host.sim.drive_scenes import free_loop
from host.sim.experiment_scenes import experiment_1, experiment_2, experiment_3, slants
from host.sim.render import Renderer, TrueFrame, Webcam, WebcamModel
from host.sim.scenes import world_from_uri
from host.sim.tabletop_scenes import tabletop
from host.sim.things import Board, Cone, Cylinder, Group
from host.sim.world import World

SEEDS = range(6)
TRAVELS = {experiment_1: (0.0, 10.0), experiment_2: (0.0, 5.0), experiment_3: (0.0, 100.0, 200.0)}


def seen(world: World, *travels_cm: float) -> tuple[Renderer, list[TrueFrame]]:
    renderer = Renderer(world)
    return renderer, [renderer.truth(Pose.planar(0.0, z, 0.0)) for z in travels_cm]


def depths(world: World, travel_cm: float = 0.0) -> dict[str, float]:
    renderer, (truth,) = seen(world, travel_cm)
    return {name: float(truth.object_mean_z_cm[k]) for k, name in renderer.object_names.items()}


# --- The paper's experiments -----------------------------------------------------------------------


def test_the_first_seed_of_experiment_1_has_the_corners_of_table_1():
    renderer = Renderer(experiment_1(0))
    corners = {p.name: p.corners_cm for p in renderer.parts if p.name.endswith("_box/front")}
    for name, left, right, top in (("red_box", -26.0, -5.5, 16.25), ("green_box", 8.5, 23.5, 15.2)):
        exact = {(x, -y, 85.0) for x in (left, right) for y in (top, -8.7)}
        assert {tuple(np.round(c, 9)) for c in corners[f"{name}/front"]} == exact


@pytest.mark.parametrize("seed", SEEDS)
def test_front_faces_of_experiment_1_stay_at_85_cm(seed):
    renderer, (truth,) = seen(experiment_1(seed), 0.0)
    for part in renderer.parts:
        if part.name.endswith("_box/front"):
            assert truth.part_mean_z_cm[part.id] == pytest.approx(85.0, abs=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_things_of_experiments_2_and_3_are_at_the_papers_average_visible_depths(seed):
    second, third = depths(experiment_2(seed)), depths(experiment_3(seed))
    assert second["box"] == pytest.approx(92.33, abs=0.005)
    assert second["tomato"] == pytest.approx(47.0, abs=0.005)
    assert second["pepper"] == pytest.approx(68.5, abs=0.005)
    assert third["pot"] == pytest.approx(712.5, abs=0.05)
    assert third["tree"] == pytest.approx(725.0, abs=0.05)


@pytest.mark.parametrize("scene", TRAVELS)
@pytest.mark.parametrize("seed", SEEDS)
def test_things_of_the_experiments_are_wholly_in_view_in_all_frames(scene, seed):
    world = scene(seed)
    renderer, truths = seen(world, *TRAVELS[scene])
    for thing, (k, _) in zip(world.things, list(renderer.object_names.items())[6:], strict=True):
        alone = World(world.name, world.room, (thing,), world.camera_height_cm, world.lens, (0.0, 0.0), 0)
        for travel, truth in zip(TRAVELS[scene], truths, strict=True):
            rows, columns = np.nonzero(truth.object_id == k)
            assert rows.min() > 2 and rows.max() < 237 and columns.min() > 2 and columns.max() < 317
            _, (single,) = seen(alone, travel)
            assert truth.object_area_px[k] == pytest.approx(single.object_area_px[7], abs=0.3)


def area_formula(world: World, baseline_cm: float) -> dict[str, float]:
    """Relative error of the paper's Eq. 16 on exact areas, at the first frame."""
    renderer, (first, last) = seen(world, 0.0, baseline_cm)
    errors = {}
    for k, name in renderer.object_names.items():
        if k not in renderer.background_ids:
            a, b = math.sqrt(first.object_area_px[k]), math.sqrt(last.object_area_px[k])
            errors[name] = baseline_cm * b / (b - a) / first.object_mean_z_cm[k] - 1
    return errors


def test_the_area_formula_is_exact_on_what_is_flat_and_off_by_a_little_on_what_is_not():
    for seed in range(3):
        third = area_formula(experiment_3(seed), 100.0)
        for flat in ("blue_board", "yellow_board", "window"):
            assert abs(third[flat]) < 5e-4
        assert 0.003 < third["pot"] < 0.012
        second = area_formula(experiment_2(seed), 5.0)  # the issue names 1.7, 0.9 and 1.8 %
        assert 0.012 < second["box"] < 0.025
        assert 0.000 < second["tomato"] < 0.015
        assert 0.010 < second["pepper"] < 0.028


def test_the_tree_is_ragged_and_deep():
    renderer, (truth,) = seen(experiment_3(0), 0.0)
    k = next(k for k, name in renderer.object_names.items() if name == "tree")
    mask = truth.object_id == k
    outline = (mask[1:] != mask[:-1]).sum() + (mask[:, 1:] != mask[:, :-1]).sum()
    assert outline > 1.4 * math.pi * math.sqrt(4 * mask.sum() / math.pi)
    assert truth.depth_cm[mask].std() > 8.0


@pytest.mark.parametrize("angle_deg", [0, 30, 60])
def test_boards_are_slanted_by_the_angle_asked_for(angle_deg):
    renderer, (truth,) = seen(slants(3, angle_deg), 0.0)
    normals = {}
    for part in renderer.parts:
        if part.name.endswith("/front") and truth.part_area_px[part.id] > 300:
            a, b, _, d = part.corners_cm
            normal = np.cross(d - a, b - a)
            normals[part.name.split("/")[0]] = normal / np.linalg.norm(normal)
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    assert np.allclose(np.abs(normals["turned_left"]), (s, 0, c))
    assert np.allclose(np.abs(normals["turned_right"]), (s, 0, c))
    assert np.allclose(np.abs(normals["leaning"]), (0, s, c))
    assert np.allclose(np.abs(normals["mat"]), (0, 1, 0))
    assert np.allclose(np.abs(normals["poster_left"]), (1, 0, 0))


@pytest.mark.parametrize("scene", [*TRAVELS, slants, tabletop])
def test_the_same_seed_is_the_same_world_and_another_is_not(scene):
    assert scene(5) == scene(5)
    assert scene(5).things != scene(6).things


@pytest.mark.parametrize("scene", [*TRAVELS, slants, tabletop])
def test_scenes_are_neither_dark_nor_burnt_out(scene):
    for seed in range(3):
        world = scene(seed)
        light = Renderer(world).light(Pose.planar(0.0, 0.0, 0.0), 0.65)
        image = Webcam(WebcamModel(), world.lens, seed).take(light, 0.0, 0)
        assert 70 < image.mean() < 220
        assert (image == 255).mean() < 0.03


# --- Table-tops ------------------------------------------------------------------------------------


def test_table_tops_hold_three_to_seven_things_of_all_kinds_clear_of_each_other():
    kinds, counts = set(), set()
    for seed in range(40):
        things = tabletop(seed).things
        counts.add(len(things))
        kinds |= {type(thing) for thing in things}
        for k, thing in enumerate(things):
            for other in things[:k]:
                gap = math.hypot(thing.x_cm - other.x_cm, thing.z_cm - other.z_cm)
                assert gap > thing.reach_cm + other.reach_cm
    assert counts == {3, 4, 5, 6, 7}
    assert len(kinds) == 6 and Board not in kinds


def test_some_things_on_table_tops_are_hidden_in_part_or_cut_by_the_border_but_most_are_whole():
    whole = hidden = cut = 0
    for seed in range(24):
        world = tabletop(seed)
        _, (truth,) = seen(world, 0.0)
        for thing, k in zip(world.things, range(7, 99), strict=False):
            alone = World("alone", world.room, (thing,), world.camera_height_cm, world.lens, (0.0, 0.0), 0)
            _, (single,) = seen(alone, 0.0)
            mask = single.object_id == 7
            border = mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any()
            share = truth.object_area_px[k] / single.object_area_px[7]
            assert share > 0.2
            cut += border
            hidden += not border and share < 0.993
            whole += not border and share >= 0.993
    total = whole + hidden + cut
    assert whole > 0.5 * total
    assert hidden > 0.08 * total
    assert cut > 0.03 * total


def test_every_scene_is_named_by_a_uri():
    assert world_from_uri("sim:tabletop?seed=7") == tabletop(7)
    assert world_from_uri("sim:experiment_1?seed=2") == experiment_1(2)
    assert world_from_uri("sim:slants?seed=2&angle_deg=45") == slants(2, 45)


def test_a_bottle_is_one_thing_without_gaps():
    bottles = [t for seed in range(30) for t in tabletop(seed).things if isinstance(t, Group)]
    assert bottles
    for bottle in bottles:
        for lower, upper in pairwise(bottle.pieces):
            assert isinstance(lower, Cylinder | Cone)
            assert upper.base_cm == pytest.approx(lower.base_cm + lower.height_cm)


# --- Rooms as they are lived in --------------------------------------------------------------------


def test_rooms_have_a_door_or_two_at_their_walls_and_half_of_them_something_of_low_contrast() -> None:
    walls, faint = set(), 0
    for seed in range(40):
        world = world_from_uri(f"sim:room?seed={seed}")
        doors = [thing for thing in world.things if isinstance(thing, Board)]
        assert 1 <= len(doors) <= 2 and world.has_path(40.0)
        walls |= {door.name for door in doors}
        wall = np.array(world.room.front_wall.rgb)
        rest = [thing for thing in world.things if not isinstance(thing, Board)]
        likeness = [np.abs(np.array(thing.material.rgb) / wall - 0.79).max() for thing in rest]  # type: ignore[union-attr]
        faint += min(likeness) < 0.13
    assert walls == {"door_left", "door_right", "door_front"}
    assert 10 <= faint <= 30


# --- Round ways ------------------------------------------------------------------------------------


@pytest.mark.parametrize("scene", ["room", "corridor", "clutter"])
def test_a_round_way_is_free_long_enough_and_returns_to_the_start(scene: str) -> None:
    found = 0
    for seed in range(12):
        world = world_from_uri(f"sim:{scene}?seed={seed}")
        try:
            goals = free_loop(world, 2000.0)
        except ValueError:
            continue
        found += 1
        assert goals == free_loop(world, 2000.0) and goals[-1] == (0.0, 0.0)
        assert max(abs(v) for goal in goals for v in goal) < NavConfig().map_half_cm
        way = [(0.0, 0.0), *goals]
        assert sum(math.dist(a, b) for a, b in pairwise(way)) >= 2000.0
        for a, b in pairwise(way):
            assert math.dist(a, b) >= 30.0
            between = np.array(a) + np.linspace(0, 1, 200)[:, None] * (np.array(b) - np.array(a))
            assert world.distance_cm(between).min() > 25.0
    assert found >= 10
