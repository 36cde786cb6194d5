"""The paper's rules to the letter: they segment, they follow, and they differ from ours where they should."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from invariants import assert_sound
from scenes import add_noise, compose, random_scene, rectangle_coverage

from host.rbdn import Net, NetConfig

SHAPE = (120, 160)
WALL, RED, GREEN = (200, 205, 210), (40, 40, 190), (60, 150, 60)
PAPER = NetConfig(mode="paper")


def draw(boxes: list[tuple[tuple[float, ...], tuple[int, ...]]], noise: float = 4.0, seed: int = 0):
    layers = [(rectangle_coverage(SHAPE, box, 0.7), colour) for box, colour in boxes]
    return add_noise(compose(SHAPE, WALL, layers), noise, seed)


def face_with_best_overlap(net: Net, box: tuple[float, ...]) -> tuple[int, float]:
    """The face that overlaps most with a box, and their intersection over union."""
    labels = net.faces()["labels"]
    truth = rectangle_coverage(SHAPE, box, 0.1) > 0.5
    ious = [((labels == k) & truth).sum() / ((labels == k) | truth).sum() for k in range(labels.max() + 1)]
    return int(np.argmax(ious)), max(ious)


def test_two_boxes_are_found_and_keep_their_ids_while_they_move():
    net = Net(PAPER)
    ids = set()
    for k in range(8):
        boxes = [(20.3 + 2 * k, 30.6, 60.2 + 2 * k, 90.4), (90.7, 40.1 + k, 130.5, 95.2 + k)]
        snapshot = net.track(draw([(boxes[0], RED), (boxes[1], GREEN)], seed=k))
        assert_sound(net)
        found = [face_with_best_overlap(net, box) for box in boxes]
        assert min(iou for _, iou in found) > 0.85
        ids.add(tuple(snapshot.regions[face].id for face, _ in found))
    assert len(ids) == 1


def test_every_polygon_is_a_region_of_its_own():
    # A wall shaded from left to right, which our mode holds together.
    ramp = np.linspace(-60, 60, SHAPE[1])[None, :, None]
    shaded = np.clip(np.full((*SHAPE, 3), 128.0) + ramp, 0, 255).astype(np.uint8)
    nets = Net(PAPER), Net()
    literal, ours = (net.track(shaded) for net in nets)
    assert len(literal.regions) == len(nets[0].faces()["means"]) >= 2
    assert len(ours.regions) == 1


def test_the_two_thresholds_leave_a_dead_zone_that_the_nearer_mean_does_not():
    # Pixels of the blurred step near neither mean, or near both, are claimed by nobody: a box that grew
    # is seen smaller than one that shrank to the same outline.
    final = (40.0, 30.0, 110.0, 90.0)

    def area_after(net: Net, steps: list[float]) -> int:
        for k, by in enumerate(steps):
            box = (final[0] + by, final[1] + by, final[2] - by, final[3] - by)
            image = cv2.GaussianBlur(draw([(box, RED)], noise=0.0, seed=k), (0, 0), 1.2)
            net.track(image)
        labels = net.faces()["labels"]
        return int((labels == labels[60, 75]).sum())

    hysteresis = {
        mode: area_after(Net(NetConfig(mode=mode)), [-4.0, -2.0, 0.0])
        - area_after(Net(NetConfig(mode=mode)), [4.0, 2.0, 0.0])
        for mode in ("paper", "ours")
    }
    assert hysteresis["paper"] > 100 > abs(hysteresis["ours"])


def test_an_ill_filled_region_is_fragmented_and_what_entered_becomes_a_region():
    net = Net(PAPER)
    wall = net.track(draw([])).regions[0].id
    snapshot = net.track(draw([((60, 40, 100, 80), RED)], seed=1))
    face, iou = face_with_best_overlap(net, (60, 40, 100, 80))
    assert iou > 0.85
    assert snapshot.regions[face].parent == wall
    assert wall in {region.id for region in snapshot.regions}
    assert_sound(net)


@settings(max_examples=15, deadline=None)
@given(st.lists(st.integers(0, 10_000), min_size=1, max_size=3))
def test_any_sequence_of_scenes_leaves_a_sound_net(seeds):
    net = Net(PAPER)
    for seed in seeds:
        net.track(random_scene(seed))
        assert_sound(net)


def test_an_image_of_pure_noise_neither_crashes_nor_tears_the_net():
    rng = np.random.default_rng(0)
    net = Net(PAPER)
    for _ in range(3):
        net.track(rng.integers(0, 256, (60, 80, 3), dtype=np.uint8))
        assert_sound(net)


def test_another_mode_is_refused_by_name():
    with pytest.raises(ValueError, match=r"^mode = 'papre' is not one of 'ours', 'paper'$"):
        NetConfig(mode="papre")  # pyright: ignore[reportArgumentType]
