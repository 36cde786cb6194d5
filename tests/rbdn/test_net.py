"""The net finds regions, follows them, and stays a net."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from invariants import assert_sound
from scenes import add_noise, compose, ellipse_coverage, random_scene, rectangle_coverage

from bench.outlines import region_at
from host.camera.lens import Lens
from host.errors import InputError
from host.rbdn import Net, NetConfig

SHAPE = (120, 160)
WALL, RED, GREEN = (200, 205, 210), (40, 40, 190), (60, 150, 60)


def two_boxes(red_box, green_box, noise: float = 4.0, seed: int = 0) -> np.ndarray:
    layers = [
        (rectangle_coverage(SHAPE, red_box, 0.7), RED),
        (rectangle_coverage(SHAPE, green_box, 0.7), GREEN),
    ]
    return add_noise(compose(SHAPE, WALL, layers), noise, seed)


def test_two_boxes_on_a_wall_are_three_regions():
    snapshot = Net().track(two_boxes((20.3, 30.6, 60.2, 90.4), (90.7, 40.1, 130.5, 95.2)))
    assert len(snapshot.regions) == 3
    red, green = region_at(snapshot, 40, 60), region_at(snapshot, 110, 60)
    assert red.mean_rgb[0] > 150 > red.mean_rgb[1]
    assert green.mean_rgb[1] > 120 > green.mean_rgb[0]
    assert not red.touches_border and not green.touches_border
    wall = region_at(snapshot, 5, 5)
    assert wall.touches_border and len(wall.loops) == 3, "the wall has an outer loop and two holes"


@pytest.mark.parametrize("seed", range(5))
def test_area_of_a_box_is_exact_to_a_few_pixels(seed):
    rng = np.random.default_rng(seed)
    x0, y0 = rng.uniform(15, 25, 2)
    x1, y1 = x0 + rng.uniform(38, 52), y0 + rng.uniform(50, 68)
    region = region_at(
        Net().track(two_boxes((x0, y0, x1, y1), (100.2, 30.3, 140.4, 80.1), seed=seed)), x0 + 15, y0 + 15
    )
    assert abs(region.area_px - (x1 - x0) * (y1 - y0)) < 6 * region.sigma_area_px
    assert region.sigma_area_px < 6.0


def test_area_of_an_ellipse_has_no_bias_from_its_polygon():
    errors = []
    for k in range(6):
        centre, axes = (78.3 + 0.37 * k, 61.7 + 0.21 * k), (38.2 + 0.5 * k, 29.4)
        coverage = cv2.GaussianBlur(ellipse_coverage(SHAPE, centre, axes), (0, 0), 0.7)
        image = add_noise(compose(SHAPE, WALL, [(coverage, GREEN)]), 3, k)
        region = region_at(Net().track(image), *centre)
        errors.append(region.area_px / (np.pi * axes[0] * axes[1]) - 1)
    assert abs(np.mean(errors)) < 0.003


def test_boxes_keep_their_ids_while_they_grow_and_move():
    net = Net()
    ids = []
    for k in range(12):
        g = 1 + 0.012 * k
        snapshot = net.track(
            two_boxes(
                (20 - k, 30 - k, 20 - k + 40 * g, 30 - k + 60 * g),
                (90 + k, 40, 90 + k + 40 * g, 40 + 55 * g),
                seed=k,
            )
        )
        ids.append((region_at(snapshot, 40 - k, 60).id, region_at(snapshot, 110 + k, 70).id))
        assert_sound(net)
    assert set(ids) == {ids[0]}


def test_corners_keep_their_vertex_ids():
    net = Net()
    seen = []
    for k in range(10):
        box = (20.0 + k, 30.0, 60.0 + k, 90.0)
        snapshot = net.track(two_boxes(box, (100, 40, 140, 95), seed=k))
        corners = [(box[0], box[1]), (box[2], box[1]), (box[2], box[3]), (box[0], box[3])]
        xy = snapshot.vertices.xy_px
        nearest = [int(np.argmin(np.linalg.norm(xy - c, axis=1))) for c in corners]
        assert max(np.linalg.norm(xy[n] - c) for n, c in zip(nearest, corners, strict=True)) < 0.5
        seen.append(tuple(int(i) for i in snapshot.vertices.ids[nearest]))
    assert set(seen) == {seen[0]}


def test_an_object_entering_the_view_becomes_a_region_with_a_birth_or_split_event():
    net = Net()
    appeared = None
    for k in range(12):
        x = -50.0 + 8 * k
        snapshot = net.track(two_boxes((x, 30, x + 40, 90), (100, 40, 140, 95), seed=k))
        if x + 40 > 15 and region_at(snapshot, max(x, 0) + 5, 60).mean_rgb[0] > 150:
            appeared = appeared or (k, region_at(snapshot, max(x, 0) + 5, 60).id)
            assert region_at(snapshot, max(x, 0) + 5, 60).id == appeared[1]
        assert_sound(net)
    assert appeared is not None and appeared[0] <= 8


def test_regions_cut_by_the_border_say_so_in_the_same_frame():
    net = Net()
    for k in range(8):
        x = 12.0 - 4 * k
        snapshot = net.track(two_boxes((x, 30, x + 50, 90), (100, 40, 140, 95), seed=k))
        red = region_at(snapshot, x + 45, 60)
        assert red.touches_border == (x < 0), k


def test_loops_cover_every_pixel_once():
    snapshot = Net().track(random_scene(3))
    count = np.zeros((4 * 120, 4 * 160), int)
    for region in snapshot.regions:
        mask = np.zeros(count.shape, np.uint8)
        cv2.fillPoly(
            mask, [np.round((loop + 0.5) * 4 * 16 - 8).astype(np.int32) for loop in region.loops], 1, shift=4
        )
        count += mask
    assert (count == 1).mean() > 0.97  # fillPoly paints outlines on both sides


def test_contour_points_lie_between_the_regions_they_name():
    snapshot = Net().track(two_boxes((20.3, 30.6, 60.2, 90.4), (90.7, 40.1, 130.5, 95.2)))
    contour = snapshot.contour
    red, wall = region_at(snapshot, 40, 60).id, region_at(snapshot, 5, 5).id
    on_red = (contour.left == red) | (contour.right == red)
    assert on_red.sum() > 150
    assert set(contour.left[on_red].tolist() + contour.right[on_red].tolist()) == {red, wall}
    top = on_red & (np.abs(contour.normal[:, 1]) > 0.99) & (contour.xy_px[:, 1] < 60)
    assert np.abs(contour.xy_px[top, 1] - 30.6).mean() < 0.15
    outward = np.where(contour.left == red, 1, -1) * contour.normal[:, 1]
    assert (outward[top] < 0).all(), "normals point from left to right region"


def test_the_same_frames_give_the_same_bytes():
    def run():
        net = Net()
        return [net.track(random_scene(k // 3)) for k in range(6)]

    for a, b in zip(run(), run(), strict=True):
        assert [r.id for r in a.regions] == [r.id for r in b.regions]
        assert a.contour.xy_px.tobytes() == b.contour.xy_px.tobytes()
        assert a.vertices.xy_px.tobytes() == b.vertices.xy_px.tobytes()


def test_a_snapshot_does_not_change_when_the_net_moves_on():
    net = Net()
    first = net.track(random_scene(1))
    kept = first.contour.xy_px.copy(), first.vertices.xy_px.copy()
    net.track(random_scene(2))
    assert np.array_equal(first.contour.xy_px, kept[0]) and np.array_equal(first.vertices.xy_px, kept[1])


def test_a_known_turn_carries_ids_across_a_jump_the_forces_could_not_follow():
    lens = Lens(160, 120, 180.0, 180.0, 79.5, 59.5)
    net = Net(lens=lens)
    angle = np.radians(12)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    first = two_boxes((95, 30, 125, 60), (95, 75, 125, 105))
    before = net.track(first)
    y, x = np.mgrid[0:120, 0:160].astype(np.float32)
    rays = np.dstack([(x - 79.5) / 180, (y - 59.5) / 180, np.ones_like(x)]) @ turn.T.astype(np.float32)
    at_x, at_y = rays[..., 0] / rays[..., 2] * 180 + 79.5, rays[..., 1] / rays[..., 2] * 180 + 59.5
    turned = cv2.remap(first, at_x, at_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    after = net.track(turned, rotation=turn)
    moved = 180 * np.tan(np.arctan((110 - 79.5) / 180) - angle) + 79.5
    assert abs(moved - 110) > 30
    assert region_at(after, moved, 45).id == region_at(before, 110, 45).id
    assert region_at(after, moved, 90).id == region_at(before, 110, 90).id
    assert_sound(net)


def test_what_flickers_but_was_tried_as_a_region_of_its_own_is_not_tried_at_every_flash():
    net = Net()
    cycles = []
    for k in range(12):
        speck = [(rectangle_coverage(SHAPE, (60.0, 50.0, 71.0, 61.0), 0.7), RED)] if k % 2 else []
        cycles.append(net.track(add_noise(compose(SHAPE, WALL, speck), 2, k)).cycles)
    assert cycles[1] > cycles[2], "cutting it out takes cycles"
    assert max(cycles[2:]) == cycles[2]


@pytest.mark.parametrize("value", [0, 255])
def test_a_blank_frame_is_one_region(value):
    net = Net()
    snapshot = net.track(np.full((60, 80, 3), value, np.uint8))
    assert len(snapshot.regions) == 1
    assert snapshot.regions[0].area_px == pytest.approx(60 * 80)
    assert_sound(net)


def test_an_image_of_pure_noise_neither_crashes_nor_tears_the_net():
    rng = np.random.default_rng(0)
    net = Net()
    for _ in range(3):
        net.track(rng.integers(0, 256, (60, 80, 3), dtype=np.uint8))
        assert_sound(net)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, 10_000), min_size=1, max_size=4))
def test_any_sequence_of_scenes_leaves_a_sound_net(seeds):
    net = Net()
    for seed in seeds:
        for _ in range(2):
            net.track(random_scene(seed))
            assert_sound(net)


@pytest.mark.parametrize("shape", [(33, 32), (32, 97), (47, 200)])
def test_odd_image_sizes_are_covered_whole(shape):
    net = Net()
    net.track(cv2.resize(random_scene(5), shape[::-1]))
    assert_sound(net)


@pytest.mark.parametrize(
    ("image", "says"),
    [
        (np.zeros((60, 80), np.uint8), "uint8"),
        (np.zeros((60, 80, 3), np.float32), "uint8"),
        (np.zeros((8, 8, 3), np.uint8), "too small"),
    ],
)
def test_images_of_the_wrong_kind_are_refused(image, says):
    with pytest.raises(InputError, match=says):
        Net().track(image)


def test_a_frame_of_another_size_is_refused():
    net = Net()
    net.track(np.zeros((60, 80, 3), np.uint8))
    with pytest.raises(InputError, match="one size"):
        net.track(np.zeros((80, 60, 3), np.uint8))


@pytest.mark.parametrize(
    ("name", "value"), [("square_px", 2), ("merge_distance", 0.0), ("track_reach_px", 99)]
)
def test_settings_out_of_range_are_refused_by_name(name, value):
    with pytest.raises(ValueError, match=name):
        NetConfig(**{name: value})


LENS = Lens(320, 240, 350.0, 350.0, 159.5, 119.5)


@pytest.mark.parametrize(
    ("lens", "rotation", "says"),
    [
        (None, np.eye(3), "without a lens"),
        (Lens(160, 120, 175.0, 175.0, 79.5, 59.5), np.eye(3), "the lens is for 160x120 px"),
        (LENS, np.eye(2), "(3, 3)"),
        (LENS, np.full((3, 3), np.nan), "is no rotation"),
        (LENS, np.diag([1.0, -1.0, 1.0]), "is no rotation"),
        (LENS, "left", "(3, 3)"),
    ],
)
def test_a_rotation_that_cannot_be_is_refused_in_one_line(lens, rotation, says):
    net = Net(lens=lens)
    image = random_scene(1, (240, 320))
    before = net.track(image)
    with pytest.raises(InputError) as refused:
        net.track(image, rotation)
    assert says in str(refused.value) and "\n" not in str(refused.value)
    assert {r.id for r in net.track(image).regions} == {r.id for r in before.regions}


@pytest.mark.parametrize(("name", "value"), [("square_px", 16.5), ("max_ms", "5"), ("max_polygons", True)])
def test_a_setting_of_the_wrong_kind_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=name):
        NetConfig(**{name: value})


def test_no_vertex_is_placed_outside_the_image():
    net = Net(NetConfig(mode="paper"))
    for k in range(12):
        snapshot = net.track(random_scene(k, (120, 160)))
        xy = snapshot.vertices.xy_px
        assert (xy >= -0.5).all() and (xy <= [159.5, 119.5]).all()
