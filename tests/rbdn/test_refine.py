"""Areas and corners are as good as the noise allows, and say how good they are."""

from __future__ import annotations

import numpy as np
import pytest

from bench.outlines import HEIGHT, WIDTH, Scene, Shape, coverage, measure, region_at
from host.rbdn import Net, Region, Snapshot

WALL, RED, GREEN, BLUE = (205, 200, 190), (190, 50, 45), (60, 150, 70), (50, 70, 170)
BLUR_PX = 0.7


def box(x0: float, y0: float, x1: float, y1: float, rgb: tuple[int, int, int]) -> Shape:
    centre, half = ((x0 + x1) / 2, (y0 + y1) / 2), ((x1 - x0) / 2, (y1 - y0) / 2)
    return Shape(centre, half, 0.0, False, rgb)


def picture(shapes: list[Shape], noise: float, seed: int) -> np.ndarray:
    """Shapes that may touch but not overlap, mixed in linear light: (H, W, 3) uint8, BGR."""
    light = np.broadcast_to(decoded(WALL), (HEIGHT, WIDTH, 3)).copy()
    for shape in shapes:
        share = coverage(shape, WIDTH, HEIGHT, BLUR_PX)[:, :, None]
        light += share * (decoded(shape.rgb) - decoded(WALL))
    s = np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 0) ** (1 / 2.4) - 0.055)
    noisy = 255 * s + np.random.default_rng(seed).normal(0, noise, light.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)[:, :, ::-1].copy()


def decoded(srgb: tuple[float, ...]) -> np.ndarray:
    s = np.asarray(srgb, float) / 255
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)


def nearest_corner(snapshot: Snapshot, x: float, y: float) -> tuple[float, float]:
    """Distance of the nearest well defined vertex, and its sigma."""
    sharp = np.isfinite(snapshot.vertices.sigma_px)
    distance = np.hypot(*(snapshot.vertices.xy_px[sharp] - (x, y)).T)
    best = int(np.argmin(distance))
    return float(distance[best]), float(snapshot.vertices.sigma_px[sharp][best])


def area_error(snapshot: Snapshot, shape: Shape) -> tuple[float, Region]:
    region = region_at(snapshot, *shape.centre)
    return region.area_px - shape.area_px, region


@pytest.mark.parametrize(("kind", "most"), [("box", 1.5), ("turned box", 2.2), ("ellipse", 2.2)])
@pytest.mark.parametrize("mixing", ["light", "values"])
def test_areas_have_no_bias_and_little_more_spread_than_the_noise_demands(kind, most, mixing):
    figures = measure(kind, mixing, noise=4, scenes=6).figures()
    assert figures["lost"] == 0
    assert abs(figures["bias_px"]) < 0.5 + 2 * figures["bias_error_px"]
    assert figures["spread_over_bound"] < most


def test_two_thirds_of_areas_are_within_their_sigma():
    figures = [measure(kind, "light", noise=6, scenes=8).figures() for kind in ("box", "ellipse")]
    assert 0.4 < np.mean([f["within_1_sigma"] for f in figures]) < 0.95
    assert np.mean([f["within_2_sigma"] for f in figures]) > 0.8


def test_corners_of_boxes_are_exact_to_a_few_hundredths_of_a_pixel():
    shape = box(60.3, 50.7, 150.6, 140.2, RED)
    snapshot = Net().track(picture([shape], noise=3, seed=1))
    for corner in shape.corners():
        distance, sigma = nearest_corner(snapshot, *corner)
        assert distance < 0.12
        assert distance < 4 * sigma
        assert sigma < 0.06


def test_an_ellipse_has_no_corners():
    shape = Shape((120.4, 110.2), (48.3, 37.1), 0.4, True, GREEN)
    snapshot = Net().track(picture([shape], noise=2, seed=2))
    assert not np.isfinite(snapshot.vertices.sigma_px).any()


def test_contour_points_of_an_ellipse_lie_on_it():
    shape = Shape((120.4, 110.2), (48.3, 37.1), 0.0, True, GREEN)
    contour = Net().track(picture([shape], noise=2, seed=3)).contour
    (x, y), (a, b) = ((contour.xy_px - shape.centre).T, shape.half)
    off = ((x / a) ** 2 + (y / b) ** 2 - 1) / (2 * np.hypot(x / a**2, y / b**2))
    assert abs(off.mean()) < 0.02
    assert off.std() < 2 * contour.sigma_px.mean()
    assert abs(contour.length_px.sum() / shape.perimeter_px - 1) < 0.04


def test_regions_with_several_neighbours_have_exact_areas_and_junctions():
    shapes = [
        box(70.4, 60.3, 130.2, 110.6, RED),
        box(130.2, 60.3, 200.7, 110.6, BLUE),
        box(70.4, 110.6, 200.7, 170.1, GREEN),
    ]
    snapshot = Net().track(picture(shapes, noise=3, seed=4))
    for shape in shapes:
        error, region = area_error(snapshot, shape)
        assert len(set(region.loop_neighbours[0].tolist())) == 3
        assert abs(error) < 4 * region.sigma_area_px
        assert region.sigma_area_px < 3
    for junction in ((130.2, 60.3), (130.2, 110.6), (70.4, 110.6), (200.7, 110.6)):
        distance, sigma = nearest_corner(snapshot, *junction)
        assert distance < 0.2
        assert sigma < 0.1


def test_a_region_cut_by_the_border_ends_exactly_there():
    shape = box(-30.0, 70.4, 60.3, 150.7, BLUE)
    snapshot = Net().track(picture([shape], noise=3, seed=5))
    region = region_at(snapshot, 20, 110)
    assert region.touches_border
    assert region.loops[0][:, 0].min() == pytest.approx(-0.5)
    visible = (60.3 + 0.5) * (150.7 - 70.4)
    assert abs(region.area_px - visible) < 4 * region.sigma_area_px + 1


def test_areas_of_all_regions_make_up_the_image():
    shapes = [box(70.4, 60.3, 130.2, 110.6, RED), Shape((220.0, 120.0), (40.3, 30.2), 0.3, True, BLUE)]
    snapshot = Net().track(picture(shapes, noise=4, seed=6))
    assert sum(r.area_px for r in snapshot.regions) == pytest.approx(WIDTH * HEIGHT, abs=1e-6)


def test_an_edge_that_shows_nothing_is_not_called_certain():
    """Two colours that differ by less than the noise leave the area open by more than the noise bound."""
    faint = Scene((box(100.0, 80.0, 160.0, 140.0, (205, 180, 190)),), WALL, "light")
    clear = Scene((box(100.0, 80.0, 160.0, 140.0, RED),), WALL, "light")
    sigmas = [region_at(Net().track(s.draw(3, 7)), 130, 110).sigma_area_px for s in (faint, clear)]
    assert sigmas[0] > 3 * sigmas[1]


def test_a_drawing_is_told_from_a_photograph():
    """The same shape, its edges mixed in light or in numbers, has the same area."""
    shape = box(80.4, 60.3, 170.2, 150.6, BLUE)
    for mixing in ("light", "values"):
        snapshot = Net().track(Scene((shape,), (220, 190, 60), mixing).draw(3, 8))
        error, region = area_error(snapshot, shape)
        assert abs(error) < 4 * region.sigma_area_px, mixing


def test_a_box_without_blur_or_noise_is_measured_to_an_eighth_of_a_pixel():
    image = np.full((120, 160, 3), (200, 195, 190), np.uint8)
    image[30:90, 50:110] = (40, 40, 190)
    snapshot = Net().track(image)
    box = min(snapshot.regions, key=lambda region: region.area_px)
    assert box.area_px == pytest.approx(3600, abs=0.125 * 240)
    assert len(snapshot.contour.xy_px) > 150
