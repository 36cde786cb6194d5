"""The engine agrees with a plain NumPy account of the method, on random nets: areas, means, force counts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracle import areas_of_faces, means_of_faces, our_counts, owners_of_pixels, paper_counts
from scenes import random_scene

from host.rbdn import Net, NetConfig, _core
from host.rbdn.net import _core_config

Step = _core.Step
NETS = st.lists(
    st.tuples(st.sampled_from([Step.fragment, Step.merge, Step.deform, Step.turn]), st.integers(0, 10_000)),
    max_size=4,
)


def random_net(mode, scene: int, steps: list) -> tuple[Net, NetConfig, np.ndarray]:
    """A net in general position: at the end its vertices are moved off the lattice of the pixels."""
    config = NetConfig(mode=mode, square_px=8, min_area_px=30)
    net = Net(config)
    # Noise, since in one flat colour every pixel is as near to one mean as to the other.
    jitter = np.random.default_rng(scene).integers(-4, 5, (48, 64, 3))
    image = np.clip(random_scene(scene)[20:68, 30:94] + jitter, 0, 255).astype(np.uint8)
    for step, seed in [*steps, *((Step.move, scene + k) for k in range(6))]:
        net._core.step(step, seed, image)
    return net, config, image


def counted_and_expected(mode, scene: int, steps: list, reach_px: int):
    """What the engine counted at every edge of a random net, the oracle's range for it, and the edges."""
    net, config, image = random_net(mode, scene, steps)
    counted = net._core.disparity(image, reach_px)
    faces = net.faces()
    colours = _core.working_colours(_core_config(config), image).astype(float)
    means = means_of_faces(faces["labels"], colours, len(faces["means"]))
    means = np.where(np.isnan(means), faces["means"], means)  # a face between all pixels keeps its last mean
    count, eta = {
        "ours": (our_counts, config.merge_distance),
        "paper": (paper_counts, config.rgb_distance),
    }[mode]
    xy, edges = faces["vertices_px"] + 0.5, faces["edges"]
    return counted, count(xy, edges, colours, means, eta, reach_px), edges


@pytest.mark.parametrize("mode", ["ours", "paper"])
@settings(max_examples=60, deadline=None)
@given(scene=st.integers(0, 10_000), steps=NETS, reach_px=st.integers(2, 16))
def test_pixels_claimed_across_every_edge_are_counted_as_the_rule_says(mode, scene, steps, reach_px):
    counted, expected, edges = counted_and_expected(mode, scene, steps, reach_px)
    wrong = np.flatnonzero(~expected.allow(counted))
    assert len(wrong) == 0, (edges[wrong], expected.least[wrong], counted[wrong], expected.most[wrong])


@pytest.mark.parametrize("mode", ["ours", "paper"])
def test_the_pixels_compared_are_many_and_hardly_any_hang_on_rounding(mode):
    pixels = doubtful = 0
    for scene in range(12):
        counted, expected, _ = counted_and_expected(
            mode, scene, [(Step.fragment, scene), (Step.deform, scene)], 8
        )
        pixels += counted.sum()
        doubtful += (expected.most - expected.least).sum()
    assert pixels > 2000
    assert doubtful < 0.01 * pixels


@settings(max_examples=60, deadline=None)
@given(scene=st.integers(0, 10_000), steps=NETS)
def test_areas_and_means_of_faces_are_those_of_their_polygons_and_pixels(scene, steps):
    net, config, image = random_net("ours", scene, steps)
    faces = net.faces()
    xy, edges, count = faces["vertices_px"] + 0.5, faces["edges"], len(faces["means"])
    assert np.abs(areas_of_faces(xy, edges, count) - faces["areas_px"]).max() < 1e-9
    owners, doubtful = owners_of_pixels(xy, edges, *faces["labels"].shape)
    assert doubtful.sum() <= 20
    colours = _core.working_colours(_core_config(config), image).astype(float)
    means = means_of_faces(np.where(doubtful, faces["labels"], owners), colours, count)
    known = ~np.isnan(means[:, 0])
    assert np.abs(means - faces["means"])[known].max() < 1e-4
    pixels = np.bincount(owners[owners >= 0], minlength=count)
    length = np.zeros(count)
    for a, b, left, right in edges.tolist():
        for face in {left, right} - {-1}:
            length[face] += np.linalg.norm(xy[b] - xy[a])
    assert (np.abs(pixels - faces["areas_px"]) <= length).all(), (
        "pixels and polygon differ by more than the rim"
    )


def test_rgb_levels_are_compared_as_they_are_in_the_papers_mode():
    image = random_scene(3)
    colours = _core.working_colours(_core_config(NetConfig(mode="paper")), image)
    assert np.array_equal(colours, image.astype(np.float32))
