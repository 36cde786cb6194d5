"""The renderer against closed formulas: edges, areas, depths; and the webcam against its own model."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from host.camera.lens import Lens
from host.pose import Pose
from host.sim import _render
from host.sim.drive_scenes import boxes, room
from host.sim.render import IDEAL, SCREEN, Renderer, Webcam, WebcamModel, linear_of
from host.sim.scenes import world_from_uri
from host.sim.things import Ball, Board, Box, Cone, Cylinder, Ellipsoid, Group, Material
from host.sim.world import World

SIZE = 64
FOCAL = 100.0
HERE = Pose.planar(0.0, 0.0, 0.0)
WHITE = _render.Material(_render.Pattern.plain, (1.0, 1.0, 1.0), 0.0, 1.0, 0, 0.0)


def picture_of(scene: _render.Scene, psf_px: float = 0.0) -> np.ndarray:
    """One channel of what a camera at the origin sees, its principal point at pixel (31, 31)."""
    return render_centred(scene, 31.0, SIZE, psf_px)[:, :, 0].astype(float)


def render_centred(scene: _render.Scene, middle_px: float, size_px: int, psf_px: float) -> np.ndarray:
    camera = _render.Camera(FOCAL, FOCAL, middle_px, middle_px, size_px, size_px)
    return scene.render(camera, np.eye(3)[None], np.zeros((1, 3)), psf_px)


def lit_scene() -> _render.Scene:
    scene = _render.Scene(floor_y=1000.0)
    scene.light((0.0, -500.0, 0.0), ambient=1.0, sky=0.0, direct=0.0, reference_cm=250.0)
    return scene


def scene_with_rectangle(corner_px, side_u_px, side_v_px, depth_cm: float = 100.0) -> _render.Scene:
    """A white parallelogram at one depth before black, given in pixels from the principal point."""
    scale = depth_cm / FOCAL
    u, v = (scale * np.array([*side, 0.0]) for side in (side_u_px, side_v_px))
    corner = np.array([corner_px[0] * scale, corner_px[1] * scale, depth_cm])
    scene = lit_scene()
    scene.quad(
        tuple(corner), tuple(u), tuple(v), (0.0, 0.0, -1.0), object=1, part=1, material=WHITE, shadowed=False
    )
    return scene


# --- Edges and areas -------------------------------------------------------------------------------

offsets = st.floats(-1.0, 1.0)


@settings(max_examples=60, deadline=None)
@given(offsets, offsets, st.floats(5.0, 20.0), st.floats(5.0, 20.0))
def test_each_row_of_an_upright_rectangle_holds_its_exact_width(x, y, width, height):
    image = picture_of(scene_with_rectangle((x, y), (width, 0.0), (0.0, height)))
    inside = range(31 + math.ceil(y + 0.5), 31 + math.floor(y + height - 0.5))
    widths = image[inside].sum(axis=1)
    assert np.abs(widths.mean() - width) < 1.5 / 256
    assert np.abs(widths - width).max() < 2.5 / 256
    assert image.sum() == pytest.approx(width * height, abs=0.003 * 2 * (width + height))


def area_within_pixel(corners: list[tuple[float, float]], column: int, row: int) -> float:
    """Area of a convex polygon within one pixel, by clipping at its four sides."""
    polygon = corners
    for axis, side, sign in (
        (0, column - 0.5, 1),
        (0, column + 0.5, -1),
        (1, row - 0.5, 1),
        (1, row + 0.5, -1),
    ):
        clipped = []
        for p, q in zip(polygon, polygon[1:] + polygon[:1], strict=True):
            inside_p, inside_q = (sign * (c[axis] - side) for c in (p, q))
            if inside_p >= 0:
                clipped.append(p)
            if inside_p * inside_q < 0:
                t = inside_p / (inside_p - inside_q)
                clipped.append((p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])))
        polygon = clipped
    return 0.5 * sum(
        p[0] * q[1] - p[1] * q[0] for p, q in zip(polygon, polygon[1:] + polygon[:1], strict=True)
    )


@settings(max_examples=30, deadline=None)
@given(offsets, offsets, st.floats(0.0, math.pi / 2), st.floats(6.0, 14.0), st.floats(6.0, 14.0))
def test_pixels_hold_the_share_of_them_that_a_turned_rectangle_covers(x, y, angle, a, b):
    u = (a * math.cos(angle), a * math.sin(angle))
    v = (-b * math.sin(angle), b * math.cos(angle))
    image = picture_of(scene_with_rectangle((x, y), u, v))
    steps = ((0, 0), (1, 0), (1, 1), (0, 1))
    corners = [(31 + x + i * u[0] + j * v[0], 31 + y + i * u[1] + j * v[1]) for i, j in steps]
    exact = np.array([[area_within_pixel(corners, c, r) for c in range(14, 54)] for r in range(28, 54)])
    error = image[28:54, 14:54] - exact
    mixed = (exact > 1e-9) & (exact < 1 - 1e-9)
    assert np.abs(error).max() < 0.04
    assert np.sqrt((error[mixed] ** 2).mean()) < 0.01
    assert np.abs(error[~mixed]).max() < 1e-6
    assert abs(error[mixed].sum()) < 0.003 * 2 * (a + b)  # so edges are on average within 0.003 px
    assert image.sum() == pytest.approx(exact.sum(), abs=0.003 * 2 * (a + b))


def smoothed_step(t: float, sigma: float) -> float:
    """Integral of the Gaussian's distribution function up to t."""
    normal = math.exp(-0.5 * (t / sigma) ** 2) / math.sqrt(2 * math.pi)
    return t * 0.5 * (1 + math.erf(t / sigma / math.sqrt(2))) + sigma * normal


@pytest.mark.parametrize("sigma", [0.6, 0.65, 0.8])
def test_a_blurred_edge_has_the_same_profile_wherever_it_runs_between_pixels(sigma):
    for offset in np.linspace(0.0, 1.0, 17):
        scene = scene_with_rectangle((offset, -50.0), (60.0, 0.0), (0.0, 100.0))
        row = picture_of(scene, sigma)[20:40, 20:44].mean(axis=0)
        exact = [
            smoothed_step(column - 31 - offset + 0.5, sigma)
            - smoothed_step(column - 31 - offset - 0.5, sigma)
            for column in range(20, 44)
        ]
        assert np.abs(row - exact).max() < 0.006
        assert abs(row.sum() - sum(exact)) < 0.002  # so the edge lies where it should


def test_blur_neither_makes_nor_loses_light():
    scene = scene_with_rectangle((-9.3, -7.8), (17.1, 2.2), (-1.3, 15.4))
    assert picture_of(scene, 0.65).sum() == pytest.approx(picture_of(scene).sum(), rel=1e-5)


def test_a_picture_is_as_wide_at_its_border_as_beyond_it():
    """An edge that leaves the image, or runs just outside it, looks as in a larger image."""
    scene = scene_with_rectangle((-40.0, -31.8), (50.0, 3.0), (2.0, 70.0))
    small = render_centred(scene, 31.0, SIZE, 0.65)
    large = render_centred(scene, 41.0, SIZE + 20, 0.65)
    # the same edges are sampled by other nets
    assert np.abs(small - large[10:-10, 10:-10]).max() < 0.02


def test_circles_of_balls_have_the_area_of_their_ellipses():
    scene = lit_scene()
    x, z, r = 12.0, 90.0, 9.0
    scene.ellipsoid(
        (x, 0.0, z), (r, 0.0, 0.0), (0.0, r, 0.0), (0.0, 0.0, r), object=1, part=1, material=WHITE
    )
    # outline of a sphere: the cone (p . c)^2 = |p|^2 (|c|^2 - r^2), cut at depth 1
    tangent2 = x * x + z * z - r * r
    half_x = math.sqrt(tangent2) * r / (z * z - r * r)
    half_y = r / math.sqrt(z * z - r * r)
    assert picture_of(scene).sum() == pytest.approx(math.pi * half_x * half_y * FOCAL**2, abs=0.15)


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    q, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return q


@pytest.mark.parametrize("seed", range(8))
def test_ellipsoids_however_turned_have_the_area_of_their_outline(seed):
    rng = np.random.default_rng(seed)
    centre = np.array([*rng.uniform(-8, 8, 2), rng.uniform(70, 110)])
    axes = rng.uniform(4.0, 11.0, 3)[:, None] * random_rotation(rng)
    scene = lit_scene()
    u, v, w = (tuple(axis) for axis in axes)
    scene.ellipsoid(tuple(centre), u, v, w, object=1, part=1, material=WHITE)
    # the outline's dual conic is that of the quadric, seen from the origin
    conic = np.linalg.inv(axes.T @ axes - np.outer(centre, centre))
    exact = math.pi * abs(np.linalg.det(conic)) / np.linalg.det(conic[:2, :2]) ** 1.5 * FOCAL**2
    assert picture_of(scene).sum() == pytest.approx(exact, abs=0.15)


def hull_area(points: np.ndarray) -> float:
    return cv2.contourArea(cv2.convexHull(points.astype(np.float32)))


@pytest.mark.parametrize(
    ("radius", "top_radius"), [(6.0, 9.0), (9.0, 4.0), (8.0, 0.0), (3.0, 12.0), (5.0, 5.0)]
)
def test_cones_with_their_lids_have_the_area_of_the_hull_of_their_rims(radius, top_radius):
    around = np.linspace(0, 2 * math.pi, 40_000)
    for base_y in (9.0, 22.0):  # seen from the side and from above
        scene = lit_scene()
        base, height = (3.0, base_y, 90.0), 14.0
        scene.cone(base, radius, top_radius, height, object=1, part=1, material=WHITE)
        rims = []
        for r, y in ((radius, base_y), (top_radius, base_y - height)):
            rims.append([3.0 + r * np.cos(around), np.full(len(around), y), 90.0 + r * np.sin(around)])
        if top_radius > 0:
            scene.disc((3.0, base_y - height, 90.0), top_radius, object=1, part=2, material=WHITE)
        x, y, z = np.concatenate(rims, axis=1)
        exact = hull_area(FOCAL * np.column_stack([x / z, y / z]))
        assert picture_of(scene).sum() == pytest.approx(exact, abs=0.2)


def test_the_mean_depth_of_round_things_is_that_of_their_visible_surface():
    """Against 2500 rays a pixel, each met with the surface by its equation."""
    world = replace(
        boxes(),
        things=(
            Ball("ball", -12.0, 70.0, 5.0, Material((200, 40, 40))),
            Cone("pot", 12.0, 80.0, 3.0, 5.5, 9.0, Material((200, 40, 40))),
        ),
    )
    renderer, floor, f = Renderer(world), world.camera_height_cm, world.lens.fx
    truth = renderer.truth(HERE)

    def rays(left: float, right: float, top: float, bottom: float) -> list[np.ndarray]:
        """Through all of a part of the picture, which holds one thing; in pixels from the axis."""
        return np.meshgrid(np.arange(left, right, 0.02) / f, np.arange(top, bottom, 0.02) / f)

    x, y = rays(-95.0, -33.0, -11.0, 51.0)
    centre = np.array([-12.0, floor - 5.0, 70.0])
    a, b, c = x * x + y * y + 1, centre[0] * x + centre[1] * y + centre[2], centre @ centre - 25.0
    hit = b * b > a * c
    ball_z = (b - np.sqrt(np.where(hit, b * b - a * c, 0.0)))[hit] / a[hit]

    x, y = rays(26.0, 86.0, -6.0, 46.0)
    slope = 2.5 / 9.0  # of the radius by the height: r = 3 + slope * (floor - y)
    widest = 3.0 + slope * floor
    a, b = x * x + 1 - (slope * y) ** 2, -12.0 * x - 80.0 + slope * y * widest
    c = 12.0**2 + 80.0**2 - widest**2
    z = (-b - np.sqrt(np.maximum(b * b - a * c, 0.0))) / a
    up = floor - z * y
    pot_z = z[(b * b > a * c) & (up > 0) & (up < 9.0)]  # the camera is below its rim, which hides the lid

    for part, depths in (("ball/surface", ball_z), ("pot/side", pot_z)):
        number = next(p.id for p in renderer.parts if p.name == part)
        assert truth.part_area_px[number] == pytest.approx(len(depths) * 0.02**2, abs=0.15)
        assert truth.part_mean_z_cm[number] == pytest.approx(depths.mean(), rel=3e-5)


def test_an_objects_truth_is_that_of_its_parts_together():
    renderer = Renderer(room(4))
    truth = renderer.truth(HERE)
    for object_id in renderer.object_names:
        ids = [part.id for part in renderer.parts if part.object_id == object_id]
        area = truth.part_area_px[ids].sum()
        assert truth.object_area_px[object_id] == pytest.approx(area)
        if area > 0:
            mean = truth.part_area_px[ids] @ truth.part_mean_z_cm[ids] / area
            assert truth.object_mean_z_cm[object_id] == pytest.approx(mean)


def test_front_faces_of_the_papers_boxes_have_the_area_of_table_1():
    renderer = Renderer(boxes())
    for dz in (0.0, 3.7, 10.0):
        truth = renderer.truth(Pose.planar(0.0, dz, 0.0))
        for name, width, height in (("red_box/front", 20.5, 24.95), ("green_box/front", 15.0, 23.9)):
            part = next(p for p in renderer.parts if p.name == name)
            exact = width * height * (371.0 / (85.0 - dz)) ** 2
            assert truth.part_area_px[part.id] == pytest.approx(exact, abs=0.5)
            assert truth.part_mean_z_cm[part.id] == pytest.approx(85.0 - dz, abs=1e-9)


def test_what_stands_behind_something_does_not_show_whatever_the_order_of_drawing():
    world = room(seed=3, objects=14)
    backwards = replace(world, things=world.things[::-1])
    for pose in (HERE, Pose.planar(20.0, 60.0, 0.7), Pose.planar(-10.0, 90.0, -2.5)):
        first, second = (Renderer(w).light(pose, 0.65) for w in (world, backwards))
        # only which of the two surfaces owns a common edge may differ
        assert np.abs(first - second).max() < 0.02


def test_the_parts_of_a_picture_add_up_to_it():
    for seed in range(5):
        world = room(seed)
        truth = Renderer(world).truth(Pose.planar(5.0, 30.0, 0.3))
        assert truth.part_area_px[0] == pytest.approx(0.0, abs=0.1)
        assert truth.part_area_px.sum() == pytest.approx(320 * 240)
        counted = np.bincount(truth.part_id.ravel(), minlength=len(truth.part_area_px))
        outline = 40 + 8 * np.sqrt(counted)
        assert (np.abs(counted - truth.part_area_px) < outline).all()


# --- Depth and ids ---------------------------------------------------------------------------------


def off_egg(right: np.ndarray, up: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """Distance in cm, nearly, from the ellipsoid below, turned by 0.7 and then rolled by 0.4."""
    c, s = math.cos(0.7), math.sin(0.7)
    right, ahead = c * right - s * ahead, s * right + c * ahead
    c, s = math.cos(0.4), math.sin(0.4)
    up = up - math.hypot(8.0 * s, 5.0 * c)
    right, up = c * right + s * up, c * up - s * right
    return 6.0 * np.abs(np.sqrt((right / 8.0) ** 2 + (up / 5.0) ** 2 + (ahead / 6.0) ** 2) - 1.0)


def off_board(right: np.ndarray, up: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """Distance in cm from the board below, or 99 beyond its edges."""
    c, s = math.cos(0.4), math.sin(0.4)
    across, ahead = c * right - s * ahead, s * right + c * ahead
    along, off = math.cos(0.6) * up + math.sin(0.6) * ahead, math.cos(0.6) * ahead - math.sin(0.6) * up
    inside = (np.abs(across) < 11.001) & (along > -0.001) & (along < 26.001)
    return np.where(inside, np.abs(off), 99.0)


def test_depth_is_exact_on_every_shape_from_any_pose():
    material = Material((200, 40, 40))
    things = (
        Box("box", -20.0, 80.0, 18.0, 14.0, 20.0, 0.5, material),
        Cylinder("cylinder", 14.0, 90.0, 8.0, 24.0, material),
        Ball("ball", 0.0, 60.0, 7.0, material),
        Ellipsoid("egg", 32.0, 75.0, (8.0, 5.0, 6.0), 0.7, material, base_cm=3.0, roll_rad=0.4),
        Cone("pot", -34.0, 105.0, 5.0, 9.0, 12.0, material, base_cm=14.0),
        Board("board", 2.0, 120.0, 22.0, 26.0, 0.4, material, base_cm=2.0, lean_rad=0.6),
    )
    world = replace(room(0, objects=0), things=things)
    renderer = Renderer(world)
    lens = world.lens
    columns, rows = np.meshgrid(np.arange(lens.width), np.arange(lens.height))
    rays = np.dstack([(columns - lens.cx) / lens.fx, (rows - lens.cy) / lens.fy, np.ones(columns.shape)])
    floor_y = world.camera_height_cm
    counted: dict[str, int] = {}
    for pose in (HERE, Pose.planar(6.0, 12.0, 0.15), Pose.planar(-15.0, -8.0, -0.2)):
        truth = renderer.truth(pose)
        points = (rays * truth.depth_cm[:, :, None]) @ pose.rotation.T + pose.position_cm
        x, y, z = points[..., 0], points[..., 1], points[..., 2]
        c, s = math.cos(0.5), math.sin(0.5)
        a, b = c * (x + 20) - s * (z - 80), s * (x + 20) + c * (z - 80)
        off_surface = {
            "floor": np.abs(y - floor_y),
            "box": np.minimum.reduce(
                [np.abs(np.abs(a) - 9), np.abs(np.abs(b) - 7), np.abs(y - floor_y + 20)]
            ),
            "cylinder": np.minimum(np.abs(np.hypot(x - 14, z - 90) - 8), np.abs(y - floor_y + 24)),
            "ball": np.abs(np.sqrt(x**2 + (y - floor_y + 7) ** 2 + (z - 60) ** 2) - 7),
            "egg": off_egg(x - 32, floor_y - y - 3, z - 75),
            "pot": np.minimum(
                np.abs(np.hypot(x + 34, z - 105) - (5 + 4 / 12 * (floor_y - y - 14))),
                np.abs(floor_y - y - 26),
            ),
            "board": off_board(x - 2, floor_y - y - 2, z - 120),
        }
        for object_id, name in renderer.object_names.items():
            seen = truth.object_id == object_id
            if name in off_surface:
                counted[name] = counted.get(name, 0) + int(seen.sum())
                assert (off_surface[name][seen] < 1e-4).all()  # depth is kept as float32
    assert len(counted) == 7 and min(counted.values()) > 400


def test_every_part_belongs_to_the_object_seen_at_its_pixels():
    renderer = Renderer(room(4))
    truth = renderer.truth(HERE)
    owner = np.array([0, *(part.object_id for part in renderer.parts)])
    assert (owner[truth.part_id] == truth.object_id).all()
    assert renderer.background_ids == {1, 2, 3, 4, 5, 6}


def test_things_that_hang_above_the_camera_are_closed_below():
    paint = Material((200, 40, 40))
    things = (
        Box("box", -20.0, 80.0, 14.0, 14.0, 8.0, 0.3, paint, base_cm=35.0),
        Cylinder("cylinder", 0.0, 80.0, 6.0, 8.0, paint, base_cm=35.0),
        Cone("cone", 20.0, 80.0, 6.0, 3.0, 8.0, paint, base_cm=35.0),
    )
    world = replace(room(0, objects=0), things=things)
    renderer = Renderer(world)
    truth = renderer.truth(HERE)
    f, up = world.lens.fx, 35.0 - world.camera_height_cm
    for name, area_cm2 in (("box", 14.0**2), ("cylinder", 36 * math.pi), ("cone", 36 * math.pi)):
        part = next(p for p in renderer.parts if p.name == f"{name}/bottom")
        # a level figure is seen as f^2 up / z^3 of its area, on the mean over its depths
        assert truth.part_area_px[part.id] == pytest.approx(area_cm2 * f * f * up / 80.0**3, rel=0.05)
        assert truth.part_mean_z_cm[part.id] == pytest.approx(80.0, abs=1.0)


def test_shapes_of_one_name_in_a_group_are_one_part():
    paint = Material((200, 40, 40))
    pieces = (
        Cylinder("body", 0.0, 80.0, 4.0, 10.0, paint),
        Cone("body", 0.0, 80.0, 4.0, 1.5, 4.0, paint, 10.0),
        Ball("stopper", 0.0, 80.0, 2.0, paint, 14.0),
    )
    renderer = Renderer(replace(room(0, objects=0), things=(Group("bottle", pieces),)))
    names = [part.name for part in renderer.parts if part.object_id == 7]
    assert names == ["bottle/body/side", "bottle/body/top", "bottle/stopper/surface"]
    truth = renderer.truth(HERE)
    assert truth.object_area_px[7] == pytest.approx(truth.part_area_px[7:].sum())
    assert (truth.part_area_px[[7, 9]] > 100).all()


# --- Distorted lenses ------------------------------------------------------------------------------


BENT = Lens(320, 240, 280.0, 285.0, 162.0, 117.0, (-0.28, 0.09, 0.002, -0.0015, -0.01))


def test_through_a_distorted_lens_every_pixel_shows_what_lies_on_its_ray():
    world = replace(room(3, objects=10), lens=BENT)
    pose = Pose.planar(4.0, 10.0, 0.1)
    truth = Renderer(world).truth(pose)
    columns, rows = np.meshgrid(np.arange(320.0), np.arange(240.0))
    pixels = np.column_stack([columns.ravel(), rows.ravel()])
    rays = (pixels - (BENT.cx, BENT.cy)) / (BENT.fx, BENT.fy)
    for _ in range(40):  # OpenCV's own inverse stops at 0.05 px
        rays += (pixels - BENT.to_pixels(rays)) / (BENT.fx, BENT.fy)
    points = np.column_stack([rays, np.ones(len(rays))]) * truth.depth_cm.reshape(-1, 1)
    points = points @ pose.rotation.T + pose.position_cm
    off_floor = points[:, 1] - world.camera_height_cm
    off_wall = points[:, 2] - world.room.front_cm
    owner = truth.object_id.ravel()
    assert (owner == 1).sum() > 5000 and np.abs(off_floor[owner == 1]).max() < 1e-4
    assert (owner == 2).sum() > 1000 and np.abs(off_wall[owner == 2]).max() < 1e-4
    assert truth.part_area_px[1:].sum() == pytest.approx(320 * 240, abs=0.2)


def test_faces_through_a_distorted_lens_have_the_area_of_their_bent_outline():
    world = replace(boxes(), lens=replace(BENT, fx=371.0, fy=371.0))
    renderer = Renderer(world)
    truth = renderer.truth(HERE)
    for part in renderer.parts:
        if not part.name.endswith("_box/front"):
            continue
        edge = np.concatenate([
            np.linspace(a, b, 500, endpoint=False)
            for a, b in zip(part.corners_cm, np.roll(part.corners_cm, -1, axis=0), strict=True)
        ])  # fmt: skip
        x, y = world.lens.to_pixels(edge[:, :2] / edge[:, 2:]).T
        exact = 0.5 * abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
        assert truth.part_area_px[part.id] == pytest.approx(exact, abs=0.5)


def test_a_lens_that_hardly_distorts_shows_what_one_that_does_not_shows():
    world = room(2, objects=10)
    plain = Renderer(world).light(HERE, 0.65)
    hardly = replace(world, lens=replace(world.lens, distortion=(1e-9, 0.0, 0.0, 0.0, 0.0)))
    assert np.abs(Renderer(hardly).light(HERE, 0.65) - plain).max() < 0.02


# --- Textures --------------------------------------------------------------------------------------


@pytest.mark.parametrize("pattern", ["wood", "tiles", "plain"])
def test_texture_too_fine_for_the_pixels_fades_out_instead_of_flickering(pattern):
    """Against one four times finer, a picture is as bright at every distance and never of more contrast."""
    floor = Material((190, 180, 160), pattern, 0.15, 12.0, seed=5)
    base = room(1, objects=0)
    world = replace(base, room=replace(base.room, floor=floor))
    finer = replace(world, lens=Lens(1280, 960, 4 * 280.0, 4 * 280.0, 639.5, 479.5))
    coarse = Renderer(world).light(HERE)[:, :, 1]
    fine = cv2.resize(Renderer(finer).light(HERE), (320, 240), interpolation=cv2.INTER_AREA)[:, :, 1]
    for top in range(136, 232, 8):
        ours, exact = (picture[top : top + 8] for picture in (coarse, fine))
        assert ours.mean() == pytest.approx(exact.mean(), rel=0.01)
        assert ours.std() < 1.05 * exact.std() + 0.001
    near = slice(220, 240)
    assert np.abs(coarse[near] / fine[near] - 1).mean() < 0.01


# --- Webcam ----------------------------------------------------------------------------------------


def flat(value: float) -> np.ndarray:
    return np.full((240, 320, 3), value, np.float32)


LENS = Lens(320, 240, 280.0, 280.0, 159.5, 119.5)


def test_an_ideal_webcam_only_encodes_light_for_the_screen():
    screen = np.arange(256, dtype=np.uint8)
    light = np.broadcast_to(linear_of(screen / 255.0)[:, None, None], (256, 4, 3)).astype(np.float32)
    lens = Lens(4, 256, 280.0, 280.0, 1.5, 127.5)
    assert (Webcam(IDEAL, lens, seed=1).take(light, 0.0, 0)[:, 0, 0] == screen).all()


def test_noise_is_that_of_counted_electrons_and_of_reading():
    model = replace(IDEAL, full_well=4000.0, read_noise=0.004)
    for light in (0.05, 0.2, 0.6):
        image = Webcam(model, LENS, seed=1).take(flat(light), 0.0, 0)
        measured = linear_of(image / 255.0).std()
        one_level = np.diff(linear_of(np.arange(256) / 255.0))[SCREEN[int(light * 65535)]]
        expected = math.sqrt(light / 4000.0 + 0.004**2 + one_level**2 / 12)
        assert measured == pytest.approx(expected, rel=0.03)


def test_corners_are_darker_by_the_vignetting_and_the_exposure_drifts_within_bounds():
    webcam = Webcam(replace(IDEAL, vignetting=0.2), LENS, seed=1)
    image = linear_of(webcam.take(flat(0.5), 0.0, 0)[:, :, 1] / 255.0)
    assert image[120, 160] == pytest.approx(0.5, rel=0.01)
    assert image[0, 0] == pytest.approx(0.4, rel=0.02)
    drifting = Webcam(replace(IDEAL, exposure_drift=0.05), LENS, seed=1)
    levels = [linear_of(drifting.take(flat(0.5), t, 0)[0, 0, 0] / 255.0) for t in np.arange(0.0, 20.0, 0.25)]
    assert 0.473 < min(levels) < 0.49 and 0.51 < max(levels) < 0.528
    assert np.abs(np.diff(levels)).max() < 0.02


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others():
    def shot(uri: str, seq: int) -> np.ndarray:
        world: World = world_from_uri(uri)
        model = WebcamModel()
        return Webcam(model, world.lens, world.seed).take(Renderer(world).light(HERE, model.psf_px), 0.2, seq)

    assert (shot("sim:room?seed=5", 3) == shot("sim:room?seed=5", 3)).all()
    assert (shot("sim:room?seed=5", 3) != shot("sim:room?seed=5", 4)).any()
    assert (shot("sim:boxes?seed=1", 3) != shot("sim:boxes?seed=2", 3)).any()


def test_pictures_are_neither_dark_nor_burnt_out():
    for seed in range(12):
        world = room(seed)
        image = Webcam(WebcamModel(), world.lens, seed).take(Renderer(world).light(HERE, 0.65), 0.0, 0)
        assert 90 < image.mean() < 220
        assert (image == 255).mean() < 0.01
