"""The map: regions with depth become obstacles where they stand, floor frees ground, unseen stays unknown."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from planar_world import FLOOR_ID, LENS, WALL_ID, Box, PlanarWorld

from host.depth.report import DepthReport, RegionDepth, VertexDepths
from host.nav.config import BodyConfig, NavConfig
from host.nav.floor import FloorFinder
from host.nav.map import FREE, LOOKED, OCCUPIED, RESTLESS, ObstacleMap
from host.nav.mover import Mover, Sight
from host.nav.picture import Picture, rays_of
from host.nav.stand import AT_BORDER, Feet, stand_of
from host.pose import Pose
from host.rbdn.snapshot import Snapshot

BOX = Box(-10, 90, 14, 110, 30)
NO_VERTICES = VertexDepths(np.empty(0, np.int64), np.empty((0, 3)), np.empty(0))
FRAMES = 4  # pictures until evidence counts


def look(world: PlanarWorld, obstacle_map: ObstacleMap, depths: dict[int, tuple[float, float]] | None = None):
    """A few frames from where the robot stands, with the given (depth, sigma) per region and no others."""
    snapshot, _ = world.see()
    found = {r.id: RegionDepth(None, None, None, "not given") for r in snapshot.regions}
    for region, (z, sigma) in (depths or {}).items():
        found[region] = RegionDepth(z, sigma, "area", None)
    x, z = world.camera_xz()
    for k in range(FRAMES):
        pose = Pose.planar(x, z, world.heading, t_s=world.t_s + k / 10)
        obstacle_map.update(snapshot, DepthReport(found, NO_VERTICES), pose, LENS)
    return obstacle_map


def of_labels(labels: np.ndarray) -> Snapshot:
    """A snapshot with one region for every number of an image."""
    template = PlanarWorld([]).see()[0]
    regions = []
    for n in np.unique(labels):
        outlines, _ = cv2.findContours((labels == n).astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        loops = tuple(outline.reshape(-1, 2).astype(float) for outline in outlines)
        none = tuple(np.zeros(len(loop), np.int64) for loop in loops)
        rgb = (120.0, 100.0, 80.0) if n == FLOOR_ID else (200.0, 20.0 * float(n), 90.0)
        regions.append(
            replace(
                template.regions[0], id=int(n), area_px=float((labels == n).sum()), mean_rgb=rgb, loops=loops,
                loop_vertices=none, loop_neighbours=none,
            )
        )  # fmt: skip
    return replace(template, regions=tuple(regions))


def fresh() -> ObstacleMap:
    return ObstacleMap(BodyConfig(), NavConfig())


def filled_xz(obstacle_map: ObstacleMap, region: int) -> np.ndarray:
    return obstacle_map.points_where(obstacle_map.occupied & (obstacle_map.region == region))


def test_a_box_with_measured_depth_stands_where_it_is_and_is_as_wide_as_it_is():
    box_map = look(PlanarWorld([BOX]), fresh(), {10: (90.0, 0.9)})
    obstacle = box_map.obstacles[10]
    assert obstacle.how == "area"
    assert obstacle.depth_cm == pytest.approx(90, abs=1.5)
    assert obstacle.left_cm == pytest.approx((-10, 90), abs=2)
    assert obstacle.right_cm == pytest.approx((14, 90), abs=2)
    cells = filled_xz(box_map, 10)
    assert cells[:, 0].min() == pytest.approx(-10, abs=5)
    assert cells[:, 0].max() == pytest.approx(14, abs=5)
    assert cells[:, 1].min() == pytest.approx(90, abs=5)


def test_an_obstacle_stays_in_place_when_the_robot_has_moved_and_turned():
    world = PlanarWorld([BOX])
    world.x, world.z, world.heading = 40.0, 20.0, math.radians(-30)
    x, z = world.camera_xz()
    depth = (90 - z) * math.cos(world.heading) + (2 - x) * math.sin(world.heading)
    box_map = look(world, fresh(), {10: (depth, 1.0)})
    left, right = box_map.obstacles[10].left_cm, box_map.obstacles[10].right_cm
    assert left[0] == pytest.approx(-10, abs=4)
    assert right[0] == pytest.approx(14, abs=4)
    assert left[1] == pytest.approx(90, abs=6)


def test_without_depth_the_foot_on_the_floor_tells_where_a_thing_stands():
    obstacle = look(PlanarWorld([BOX]), fresh()).obstacles[10]
    assert obstacle.how == "foot"
    assert obstacle.depth_cm == pytest.approx(90, rel=0.06)
    assert obstacle.sigma_cm > 3.0


def test_depth_and_foot_that_agree_are_better_than_either():
    foot = look(PlanarWorld([BOX]), fresh()).obstacles[10]
    both = look(PlanarWorld([BOX]), fresh(), {10: (88.0, 5.0)}).obstacles[10]
    assert both.sigma_cm < min(foot.sigma_cm, 5.0)
    assert 88 < both.depth_cm < foot.depth_cm


@pytest.mark.parametrize(("turn_rad", "moves"), [(0.0, True), (0.03, False)])
def test_what_only_seems_to_move_while_the_robot_turns_is_not_taken_for_a_mover(turn_rad, moves):
    world, box_map = PlanarWorld([BOX]), fresh()
    for k in range(RESTLESS + 1):
        world.heading = (k - RESTLESS / 2) * turn_rad
        snapshot, _ = world.see()
        found = {r.id: RegionDepth(90.0, 1.0, "area", None, moving=r.id == 10) for r in snapshot.regions}
        pose = Pose.planar(*world.camera_xz(), world.heading, t_s=k / 15)
        box_map.update(snapshot, DepthReport(found, NO_VERTICES), pose, LENS)
    assert box_map.obstacles[10].moving is moves


def test_a_heading_that_jitters_from_picture_to_picture_is_no_turn():
    world, box_map = PlanarWorld([BOX]), fresh()
    snapshot, _ = world.see()
    found = {r.id: RegionDepth(90.0, 1.0, "area", None, moving=r.id == 10) for r in snapshot.regions}
    for k in range(RESTLESS + 1):
        pose = Pose.planar(*world.camera_xz(), math.radians(1.0) * (k % 2), t_s=k / 20)
        box_map.update(snapshot, DepthReport(found, NO_VERTICES), pose, LENS)
    assert box_map.obstacles[10].moving


@pytest.mark.parametrize("depth", [50.0, 160.0])
def test_where_depth_and_foot_contradict_each_other_the_nearer_one_counts(depth):
    obstacle = look(PlanarWorld([BOX]), fresh(), {10: (depth, 1.0)}).obstacles[10]
    assert obstacle.depth_cm == pytest.approx(min(depth, 90), rel=0.06)


def test_where_depth_and_foot_contradict_each_other_nobody_is_sure():
    wrong = look(PlanarWorld([BOX]), fresh(), {10: (50.0, 1.0)}).obstacles[10]
    assert wrong.depth_cm + 2 * wrong.sigma_cm > 70  # as far as both slopes' middle


def test_floor_is_no_obstacle_and_frees_the_ground_up_to_the_first_thing():
    box_map = look(PlanarWorld([BOX]), fresh(), {10: (90.0, 0.9)})
    assert FLOOR_ID not in box_map.obstacles
    assert box_map.floor.is_floor(FLOOR_ID)
    assert box_map.evidence[box_map.cell_of(0, 60)] < FREE
    assert box_map.evidence[box_map.cell_of(0, 92)] > OCCUPIED


def test_unseen_ground_is_not_free():
    box_map = look(PlanarWorld([BOX]), fresh(), {10: (90.0, 0.9)})
    for x, z in [(0, 150), (0, 15), (-150, 20), (0, -60)]:  # behind the box, before the lens, aside, behind
        assert not box_map.evidence[box_map.cell_of(x, z)] < FREE, (x, z)


def test_a_wall_is_mapped_along_its_slant_by_its_feet():
    world = PlanarWorld([])
    world.heading = math.radians(30)
    wall_map = look(world, fresh())
    cells = filled_xz(wall_map, WALL_ID)
    rows = [cells[cells[:, 1] == z, 0].min() for z in np.unique(cells[:, 1]) if z < 180]
    assert len(rows) > 10
    assert np.median(rows) == pytest.approx(150, abs=10)


def test_a_pole_that_the_net_took_for_one_with_the_wall_behind_it_shuts_nothing_beside_it():
    world = PlanarWorld([Box(-4, 45, 4, 53, 80)], room=(-150, -60, 150, 160))
    labels = world._cast()[0]
    labels[labels == 10] = WALL_ID
    snapshot, pole_map = of_labels(labels), fresh()
    for k in range(FRAMES):
        pose = Pose.planar(0, 0, 0, t_s=k / 10)
        pole_map.update(snapshot, DepthReport({}, NO_VERTICES), pose, LENS)
    assert pole_map.occupied[pole_map.cell_of(0, 47)]
    assert pole_map.free[pole_map.cell_of(-16, 47)] and pole_map.free[pole_map.cell_of(16, 47)]
    assert pole_map.occupied[pole_map.cell_of(-40, 162)]


@pytest.mark.parametrize(("wall_cm", "shut"), [(150.0, True), (285.0, False)])
def test_a_wall_so_far_away_that_nobody_knows_where_shuts_no_way(wall_cm, shut):
    far_map = look(PlanarWorld([], room=(-150, -60, 150, wall_cm)), fresh())
    cell = far_map.cell_of(0, wall_cm + 2)
    assert far_map.occupied[cell] == shut and not far_map.free[cell]


def test_a_place_is_known_the_better_the_nearer_it_was_seen_from_and_less_with_the_way_gone_since():
    world = PlanarWorld([])
    world.heading = math.radians(30)
    wall_map = look(world, fresh())
    wall = wall_map.obstacles[WALL_ID]
    near, far = sorted([wall.left_cm, wall.right_cm], key=lambda end: math.dist(end, (0, 0)))
    sigma_cm = wall_map.sigma_at(wall, near)
    assert sigma_cm < 0.7 * wall.sigma_cm < wall.sigma_cm < wall_map.sigma_at(wall, far)
    bare = of_labels(np.full((LENS.height, LENS.width), FLOOR_ID))
    for k in range(11):
        pose = Pose.planar(0, 20.0 * k, world.heading, t_s=1.0 + k)
        wall_map.update(bare, DepthReport({}, NO_VERTICES), pose, LENS)
    assert wall_map.sigma_at(wall, near) == pytest.approx(math.hypot(sigma_cm, 4.0), abs=0.2)


def rug_on(snapshot: Snapshot) -> Snapshot:
    """The same with a red rug ahead, at 80 to 130 cm."""
    floor = next(r for r in snapshot.regions if r.id == FLOOR_ID)
    corners = [(-20, 130), (20, 130), (20, 80), (-20, 80)]
    loop = np.array([[LENS.cx + LENS.fx * x / z, LENS.cy + LENS.fy * 15 / z] for x, z in corners])
    none = (np.zeros(4, np.int64),)
    rug = replace(floor, id=10, touches_border=False, mean_rgb=(250, 0, 0), loops=(loop,),
                  loop_vertices=none, loop_neighbours=none)  # fmt: skip
    return replace(snapshot, regions=(*snapshot.regions, rug))


LYING = DepthReport({10: RegionDepth(100.0, 2.0, "area", None)}, NO_VERTICES)


def test_a_rug_whose_depth_lies_on_the_floor_becomes_floor():
    flat = rug_on(PlanarWorld([]).see()[0])
    rug_map = fresh()
    for k in range(8):
        rug_map.update(flat, LYING, Pose.planar(0, 0, 0, t_s=k / 10), LENS)
    assert rug_map.floor.is_floor(10)
    assert rug_map.evidence[rug_map.cell_of(0, 100)] < FREE


def test_what_lies_far_off_does_not_teach_the_floors_colour_while_a_wall_is_one_region_with_the_floor():
    """It was forgotten so within two pictures, and the floor of a whole corridor was none any more."""
    rug_map = fresh()
    flat = rug_on(PlanarWorld([]).see()[0])
    wall = of_labels(np.full((LENS.height, LENS.width), WALL_ID)).regions[0]
    merged = replace(flat, regions=(replace(wall, mean_rgb=(125.0, 110.0, 90.0)), flat.regions[-1]))
    for k in range(40):
        rug_map.update(flat if k < 8 else merged, LYING, Pose.planar(0, 0, 0, t_s=k / 10), LENS)
        assert k < 8 or rug_map.floor.is_mixed(WALL_ID)


def test_a_wall_that_kept_the_name_of_the_floor_that_was_one_region_with_it_is_no_floor():
    """The robot once approached such a wall until it touched it."""
    together = np.full((LENS.height, LENS.width), FLOOR_ID)
    apart = together.copy()
    apart[190:] = 10  # the floor alone, under a new name
    wall_map = fresh()
    for k in range(8):
        snapshot, pose = of_labels(together if k < 4 else apart), Pose.planar(0, 0, 0, t_s=k / 10)
        wall_map.update(snapshot, DepthReport({}, NO_VERTICES), pose, LENS)
    assert not wall_map.floor.is_floor(FLOOR_ID)
    foot_cm = 15.0 * LENS.fy / (189.5 - LENS.cy)
    assert wall_map.obstacles[FLOOR_ID].depth_cm == pytest.approx(foot_cm, rel=0.1)


def test_contradictory_evidence_wins_within_a_few_frames():
    box_map = look(PlanarWorld([BOX]), fresh(), {10: (90.0, 0.9)})
    cell = box_map.cell_of(0, 92)
    assert box_map.evidence[cell] > OCCUPIED
    for _ in range(5):
        look(PlanarWorld([]), box_map)
    assert box_map.evidence[cell] < FREE


def test_evidence_fades_when_nothing_is_seen():
    box_map = look(PlanarWorld([BOX]), fresh(), {10: (90.0, 0.9)})
    world = PlanarWorld([])
    world.heading, world.t_s = math.pi, 3 * NavConfig().memory_s
    look(world, box_map)
    assert not box_map.evidence[box_map.cell_of(0, 92)] > OCCUPIED
    assert 10 not in box_map.obstacles


def test_evidence_fades_with_travel_and_with_turning_alike():
    def left_of_it(way_cm: float, turns: int) -> float:
        box_map = look(PlanarWorld([BOX]), fresh(), {10: (90.0, 0.9)})
        cell = box_map.cell_of(0, 92)
        away = PlanarWorld([]).see()[0]
        kept = []
        for k in range(21):  # looking the other way
            pose = Pose.planar(
                0, -way_cm * k / 20, math.pi + 0.2 * math.sin(2 * math.pi * turns * k / 20), t_s=0.4
            )
            box_map.update(away, DepthReport({}, NO_VERTICES), pose, LENS)
            kept.append(float(box_map.evidence[cell]))
        return kept[-1] / kept[0]

    assert left_of_it(0.0, 0) > 0.99
    assert left_of_it(300.0, 0) < 0.85
    assert left_of_it(0.0, 5) < 0.95


def test_a_ball_is_filled_from_its_nearest_point_on_though_its_foot_lies_behind():
    z, radius = 120.0, 14.0
    snapshot, _ = PlanarWorld([]).see()
    floor = next(r for r in snapshot.regions if r.id == FLOOR_ID)
    angle = np.linspace(0, 2 * math.pi, 60, endpoint=False)
    outline = np.column_stack(
        [LENS.cx + LENS.fx * radius / z * np.cos(angle),
         LENS.cy + LENS.fy * (15 - radius + radius * np.sin(angle)) / z]
    )  # fmt: skip
    none = (np.zeros(len(outline), np.int64),)
    ball = replace(floor, id=10, touches_border=False, mean_rgb=(250, 0, 0), loops=(outline,),
                   loop_vertices=none, loop_neighbours=none)  # fmt: skip
    with_ball = replace(snapshot, regions=(*snapshot.regions, ball))
    ball_map = fresh()
    for k in range(FRAMES):
        ball_map.update(with_ball, DepthReport({}, NO_VERTICES), Pose.planar(0, 0, 0, t_s=k / 10), LENS)
    cells = filled_xz(ball_map, 10)
    assert cells[:, 1].min() < z - radius + 7
    assert cells[:, 0].min() < -radius + 5
    assert cells[:, 0].max() > radius - 5


def with_thing(outline: np.ndarray) -> Snapshot:
    """A bare room and one thing in it."""
    snapshot, _ = PlanarWorld([]).see()
    floor = next(r for r in snapshot.regions if r.id == FLOOR_ID)
    none = (np.zeros(len(outline), np.int64),)
    thing = replace(floor, id=10, touches_border=False, mean_rgb=(250, 0, 0), loops=(outline,),
                    loop_vertices=none, loop_neighbours=none)  # fmt: skip
    return replace(snapshot, regions=(*snapshot.regions, thing))


def look_at(snapshot: Snapshot) -> ObstacleMap:
    """A few frames of it from the start, without any depths."""
    seen = fresh()
    for k in range(FRAMES):
        seen.update(snapshot, DepthReport({}, NO_VERTICES), Pose.planar(0, 0, 0, t_s=k / 10), LENS)
    return seen


def test_a_box_seen_over_its_corner_is_filled_from_the_corner_on_and_along_its_sides():
    z = 60.0
    feet = [(-20, z + 20), (0, z), (20, z + 20)]
    low = [[LENS.cx + LENS.fx * x / d, LENS.cy + LENS.fy * 15 / d] for x, d in feet]
    high = [[LENS.cx + LENS.fx * x / d, LENS.cy - LENS.fy * 20 / d] for x, d in reversed(feet)]
    box_map = look_at(with_thing(np.array(low + high)))
    cells = filled_xz(box_map, 10)
    assert z - 8 < cells[:, 1].min() < z + 5
    for x in (-15, 15):  # before the ends of its sides, where the floor is seen
        assert not box_map.occupied[box_map.cell_of(x, z + 2)]
        assert box_map.occupied[box_map.cell_of(1.2 * x, z + 20)]


def test_a_narrow_front_seen_at_a_slant_is_filled_along_its_foot():
    world = PlanarWorld([Box(-60, 60, -20, 63, 40)])
    world.heading = math.radians(-35)
    x, z = world.camera_xz()
    world.x, world.z = world.x - x, world.z - z
    cells = filled_xz(look(world, fresh()), 10)
    assert cells[:, 1].min() > 52
    assert cells[:, 0].min() < -55 and cells[:, 0].max() > -25


@pytest.mark.parametrize("seen", ["whole", "half"])
def test_a_far_ball_or_half_of_one_is_filled_from_its_nearest_foot_on_though_that_looks_like_two_edges(seen):
    z, radius = 170.0, 8.0
    middle = 0.0 if seen == "half" else LENS.cx
    angle = np.linspace(0, 2 * math.pi, 60, endpoint=False)
    outline = np.column_stack(
        [middle + LENS.fx * radius / z * np.cos(angle),
         LENS.cy + LENS.fy * (15 - radius + radius * np.sin(angle)) / z]
    )  # fmt: skip
    sight = look_at(with_thing(np.maximum(outline, -0.5))).sight
    assert sight is not None
    (ball,) = (one for one in sight.standing if one.region == 10)
    assert np.ptp(ball.depth_cm) == 0.0 and ball.mean_cm < 1.06 * z


def test_a_box_cut_by_the_lower_border_stays_where_it_was_seen_to_stand():
    front = 100.0
    world, box_map = PlanarWorld([Box(-12, front, 12, front + 40, 60)]), fresh()
    for gap in np.arange(60.0, 14.0, -1.0):  # its foot leaves the picture at some 33 cm
        world.z, world.t_s = front - gap - world.body.camera_ahead_cm, world.t_s + 0.1
        look(world, box_map)
    assert box_map.obstacles[10].left_cm[1] == pytest.approx(front, abs=3)
    assert box_map.evidence[box_map.cell_of(0, front + 2)] > OCCUPIED


def feet_of(labels: np.ndarray) -> tuple[Feet, Picture]:
    """Of regions on every second pixel."""
    snapshot, level = of_labels(np.kron(labels, np.ones((2, 2), np.int32))), Pose.planar(0.0, 0.0, 0.0)
    picture, floor = Picture(snapshot, LENS, rays_of(LENS, level)), FloorFinder(15.0)
    floor.update(snapshot, DepthReport({}, NO_VERTICES), level, picture)
    assert floor.is_floor(FLOOR_ID)
    return Feet(picture, floor, level, 15.0), picture


def test_where_most_of_a_foot_is_below_the_picture_what_is_left_of_it_is_no_place():
    labels = np.full((120, 160), 2, np.int32)
    labels[66:, :] = FLOOR_ID
    labels[40:, 50:110] = 10  # down to the lower border
    labels[115:, 50:60] = FLOOR_ID  # but for a sliver
    feet, picture = feet_of(labels)
    nothing = DepthReport({}, NO_VERTICES)
    found = stand_of(10, nothing, feet, picture)
    assert found is not None and found.how == AT_BORDER
    near = DepthReport({10: RegionDepth(25.0, 1.0, "area", None)}, NO_VERTICES)
    found = stand_of(10, near, feet, picture)
    assert found is not None and found.how == "area" and found.mean_cm == 25.0
    far = DepthReport({10: RegionDepth(60.0, 1.0, "area", None)}, NO_VERTICES)
    found = stand_of(10, far, feet, picture)
    assert found is not None and found.how == AT_BORDER


def test_what_others_hide_all_the_feet_of_stands_nowhere_until_its_depth_is_known_well():
    labels = np.full((120, 160), 2, np.int32)
    labels[66:, :] = FLOOR_ID
    labels[30:80, 60:90] = 10
    labels[50:90, 50:100] = 11  # before it
    feet, picture = feet_of(labels)
    vague = DepthReport({10: RegionDepth(150.0, 12.0, "outline", None)}, NO_VERTICES)
    assert stand_of(10, vague, feet, picture) is None
    known = DepthReport({10: RegionDepth(150.0, 6.0, "outline", None)}, NO_VERTICES)
    found = stand_of(10, known, feet, picture)
    assert found is not None and found.mean_cm == 150.0


def test_the_less_is_seen_of_a_foot_the_less_it_says_of_the_whole():
    labels = np.full((120, 160), 2, np.int32)
    labels[66:, :] = FLOOR_ID
    labels[40:80, 50:110] = 10
    sigmas = []
    for hidden in (0, 20, 40):
        labels[60:90, 50 : 50 + hidden] = 11
        found = stand_of(10, DepthReport({}, NO_VERTICES), *feet_of(labels))
        assert found is not None and found.how == "foot"
        sigmas.append(found.sigma_cm / found.mean_cm)
    assert sigmas[0] < 0.06 and sigmas[1] == pytest.approx(0.07, abs=0.02) and sigmas[2] > 0.1


def test_a_depth_by_motion_moves_a_foot_less_than_its_sigma_says():
    labels = np.full((120, 160), 2, np.int32)
    labels[66:, :] = FLOOR_ID
    labels[40:80, 70:84] = 10
    feet, picture = feet_of(labels)
    foot = stand_of(10, DepthReport({}, NO_VERTICES), feet, picture)
    assert foot is not None
    narrower = 0.05 * feet.width_cm(picture.columns_of(10), foot.mean_cm)  # the front before the mean depth
    off = 1.5 * foot.sigma_cm
    farther = RegionDepth(foot.mean_cm + narrower + off, foot.sigma_cm, "area", None)
    both = stand_of(10, DepthReport({10: farther}, NO_VERTICES), feet, picture)
    assert both is not None and both.how == "area"
    assert 0.2 * off < both.mean_cm - foot.mean_cm < 0.4 * off


def test_floor_stays_floor_before_the_robot_though_its_outline_is_given_a_wrong_depth():
    floor_map = look(PlanarWorld([]), fresh())
    for _ in range(10):
        look(PlanarWorld([]), floor_map, {FLOOR_ID: (12.0, 2.5)})
    assert floor_map.floor.is_floor(FLOOR_ID)
    assert floor_map.evidence[floor_map.cell_of(0, 60)] < FREE


def test_what_appears_with_its_foot_below_the_picture_is_filled_within_two_frames_and_cleared():
    border_map = fresh()
    for _ in range(5):
        look(PlanarWorld([]), border_map)
    cell = border_map.cell_of(0, 30)
    near = PlanarWorld([Box(-8, 20, 8, 40, 60)])
    snapshot, _ = near.see()
    for k in range(2):
        pose = Pose.planar(0, 0, 0, t_s=k / 10)
        border_map.update(snapshot, DepthReport({}, NO_VERTICES), pose, LENS)
    assert border_map.evidence[cell] > OCCUPIED
    look(PlanarWorld([]), border_map)
    assert not border_map.evidence[cell] > OCCUPIED


@pytest.mark.parametrize(("unseen_s", "filled"), [(0.1, False), (4.0, True)])
def test_what_hides_below_the_picture_is_a_mover_only_where_that_surely_is(unseen_s, filled):
    """Taken for one that could be anywhere on a metre it stood nowhere, and the robot drove into it."""
    near_map = look(PlanarWorld([]), fresh())
    sights = tuple(Sight(0.1 * k, 1.5 * k - 15.0, 30.0, (0.0, 1.0), 30.0) for k in range(21))
    mover = Mover(7, 2.0, (0.0, 30.0), (1.0, 0.0), 15.0, 15.0, 8.0, sights, (0.0, -15.0), seen=20)
    snapshot, _ = PlanarWorld([Box(-8 if filled else 8, 20, 8 if filled else 24, 40, 60)]).see()
    for k in range(2):
        near_map.movers = [mover]
        pose = Pose.planar(0, 0, 0, t_s=2.0 + unseen_s + k / 30)
        near_map.update(snapshot, DepthReport({}, NO_VERTICES), pose, LENS)
    assert (near_map.evidence[near_map.cell_of(0 if filled else 16, 30)] > OCCUPIED) == filled


def test_what_stands_below_the_picture_is_filled_also_where_it_comes_into_view_later():
    border_map = look(PlanarWorld([]), fresh())
    for heading in (0.0, 0.3):
        world = PlanarWorld([Box(-60, 20, 60, 40, 60)])
        world.heading = heading
        look(world, border_map)
    assert border_map.evidence[border_map.cell_of(22, 26)] > OCCUPIED


def test_what_moves_is_known_to_move_and_nothing_stays_filled_behind_it_while_the_robot_stands():
    mover_map = fresh()
    for k in range(16):
        left = -40 + 1.5 * k
        snapshot, _ = PlanarWorld([Box(left, 100, left + 14, 114, 60)]).see()
        pose = Pose.planar(0, 0, 0, t_s=k / 10)
        mover_map.update(snapshot, DepthReport({}, NO_VERTICES), pose, LENS)
    obstacle = mover_map.obstacles[10]
    assert obstacle.moving and obstacle.velocity_cm_s is not None
    assert obstacle.velocity_cm_s == pytest.approx((15.0, 0.0), abs=3.0)
    cells = filled_xz(mover_map, 10)
    assert len(cells) > 0
    assert cells[:, 0].min() > left - 8


def test_an_obstacle_no_longer_stands_once_its_cells_are_cleared():
    box_map = look(PlanarWorld([BOX]), fresh(), {10: (90.0, 0.9)})
    box = box_map.obstacles[10]
    assert not box.moving
    assert box_map.standing() and box_map.stands(box)
    for _ in range(5):
        look(PlanarWorld([]), box_map)
    assert 10 in box_map.obstacles
    assert not box_map.stands(box)


def one_region_of_floor_and_wall(foot_px: int, wall: tuple[int, int, int]) -> tuple[Snapshot, np.ndarray]:
    """A picture with a wall's foot in a row, BGR, all of it one region."""
    image = np.full((240, 320, 3), (160, 178, 190), np.uint8)
    image[:foot_px] = wall
    image = np.clip(image + np.random.default_rng(1).normal(0, 4, image.shape), 0, 255).astype(np.uint8)
    return of_labels(np.full((240, 320), FLOOR_ID)), image


def test_a_wall_that_the_net_has_not_told_from_the_floor_stands_where_the_picture_shows_its_foot():
    snapshot, image = one_region_of_floor_and_wall(176, (172, 176, 180))
    seam_map = fresh()
    for k in range(6):
        pose = Pose.planar(0, 0, 0, t_s=k / 10)
        seam_map.update(snapshot, DepthReport({}, NO_VERTICES), pose, LENS, image)
    foot_cm = 15.0 * LENS.fy / (175.5 - LENS.cy)
    assert seam_map.obstacles[FLOOR_ID].depth_cm == pytest.approx(foot_cm, rel=0.05)
    assert seam_map.obstacles[FLOOR_ID].sigma_cm > 0.08 * foot_cm  # it may be the wall's shade
    assert seam_map.evidence[seam_map.cell_of(0, foot_cm + 3)] > OCCUPIED
    assert seam_map.evidence[seam_map.cell_of(0, foot_cm - 15)] < FREE


def test_floor_that_gets_lighter_on_its_way_to_the_horizon_has_no_wall_on_it():
    _, image = one_region_of_floor_and_wall(150, (174, 192, 204))
    labels = np.full((240, 320), WALL_ID)
    labels[120:] = FLOOR_ID
    far_map = fresh()
    for k in range(6):
        pose = Pose.planar(0, 0, 0, t_s=k / 10)
        far_map.update(of_labels(labels), DepthReport({}, NO_VERTICES), pose, LENS, image)
    assert far_map.floor.is_mixed(FLOOR_ID)
    assert not far_map.occupied[far_map.cell_of(0, 15.0 * LENS.fy / (150 - LENS.cy) + 3)]


def test_where_the_picture_shows_no_foot_nothing_is_free_and_a_wall_before_the_lens_is_no_floor():
    snapshot, image = one_region_of_floor_and_wall(176, (172, 176, 180))
    seam_map = fresh()
    look_once = DepthReport({}, NO_VERTICES)
    seam_map.update(snapshot, look_once, Pose.planar(0, 0, 0), LENS, image)
    before = seam_map.evidence.copy()
    _, wall = one_region_of_floor_and_wall(240, (172, 176, 180))
    for k in range(4):
        seam_map.update(snapshot, look_once, Pose.planar(0, 0, 0, t_s=(k + 1) / 10), LENS, wall)
    assert not (seam_map.evidence < before - 0.01).any()
    assert seam_map.evidence[seam_map.cell_of(0, 38)] > OCCUPIED


def test_where_a_wall_cannot_be_told_from_the_floor_not_even_what_is_below_the_picture_was_looked_over():
    """The wall may begin right before the robot; it once crept into one."""
    snapshot, image = one_region_of_floor_and_wall(0, (0, 0, 0))
    alike = fresh()
    for k in range(4):
        alike.update(snapshot, DepthReport({}, NO_VERTICES), Pose.planar(0, 0, 0, t_s=k / 10), LENS, image)
    assert alike.floor.is_mixed(FLOOR_ID)
    assert not (alike.evidence < LOOKED).any()
