"""What native code does pixel by pixel and cell by cell, against the same said in a few lines of NumPy."""

from __future__ import annotations

import heapq
import itertools
import math

import cv2
import numpy as np
import pytest

from host.nav import _nav
from host.nav.seam import strips_of

SEEDS = range(12)
CELL, HALF = 5.0, 100.0
CENTRES = (np.arange(40) + 0.5) * CELL - HALF
FREE, LOOKED, OCCUPIED = -0.4, -0.1, 0.8


def patches(rng: np.random.Generator, shape: tuple[int, int], kinds: int) -> np.ndarray:
    image = np.zeros(shape, np.uint16)
    for _ in range(12):
        r, c = rng.integers(0, shape[0]), rng.integers(0, shape[1])
        image[r : r + rng.integers(1, 20), c : c + rng.integers(1, 20)] = rng.integers(0, kinds)
    return image


@pytest.mark.parametrize("seed", SEEDS)
def test_a_pixel_belongs_to_the_outline_round_its_centre_and_no_outline_grows_by_its_border(seed: int):
    rng = np.random.default_rng(seed)
    points = np.round(rng.uniform(-5, 70, (14, 2)) * 4) / 4 + 0.1  # no centre on a side
    rows, cols, step = 30, 32, 2
    triangles, hole = points[:12].reshape(4, 3, 2), np.array([[20.1, 20.1], [28.1, 21.1], [24.1, 29.1]])
    loops = [*triangles, np.array([[10.1, 10.1], [40.1, 12.1], [30.1, 50.1]]), hole]
    kinds = np.array([0, 1, 2, 3, 4, 4])
    found = _nav.fill(
        np.concatenate(loops), np.array([len(one) for one in loops]), kinds, rows, cols, step, 9
    )
    for r, c in itertools.product(range(rows), range(cols)):
        centre = step * c + 0.5 * (step - 1), step * r + 0.5 * (step - 1)
        holds = [cv2.pointPolygonTest(one.astype(np.float32), centre, False) > 0 for one in loops]
        inside = [*holds[:4], holds[4] != holds[5]]
        assert found[r, c] == (max(np.flatnonzero(inside)) if any(inside) else 9)


@pytest.mark.parametrize("seed", SEEDS)
def test_stretches_of_one_region_cover_every_column_from_the_lower_border_up(seed: int):
    image = patches(np.random.default_rng(seed), (30, 40), 6)
    labels, starts, ends, owner, lowest, pixels, at_border = _nav.columns(image, 6)
    upwards = image[::-1].T
    assert (labels == upwards).all()
    assert (np.repeat(owner, ends - starts) == upwards.ravel()).all()
    assert starts[0] == 0 and ends[-1] == image.size and (starts[1:] == ends[:-1]).all()
    for kind in range(6):
        mask = upwards == kind
        assert (lowest[kind] == np.where(mask.any(axis=1), mask.argmax(axis=1), -1)).all()
        assert pixels[kind] == mask.sum() and at_border[kind] == mask[:, 0].sum()


@pytest.mark.parametrize("seed", SEEDS)
def test_the_first_thing_above_the_floor_is_found_in_each_column_with_a_known_foot_and_without(seed: int):
    rng = np.random.default_rng(seed)
    labels = patches(rng, (40, 30), 6)
    ground, foot = rng.integers(0, 3, 6).astype(np.uint8), rng.integers(-1, 30, 40)
    slopes, ids = rng.uniform(-0.1, 1.0, (40, 30)), rng.permutation(100)[:6]
    kind, cut, slope, depth, sure, floor, free = _nav.feet(
        labels, slopes, ids, -1, ground, foot, 20.0, 500.0, 0.01
    )
    for c in range(40):
        kinds = ground[labels[c]]
        surely = (kinds == 1) | ((kinds == 2) & (np.arange(30) < foot[c]))
        passable = surely | ((kinds == 2) & (foot[c] < 0))
        row = 29 if passable.all() else passable.argmin()
        sure_row = 29 if surely.all() else surely.argmin()
        assert kind[c] == (-1 if passable.all() else ids[labels[c, row]])
        assert cut[c] == (row == 0 and not passable.all()) and sure[c] == (row == sure_row)
        between = (slopes[c, row] + slopes[c, max(row - 1, 0)]) / 2
        assert depth[c] == pytest.approx(min(20 / max(between, 1e-6), 500)) == 20 / slope[c]
        assert floor[c] == pytest.approx(min(20 / max(slopes[c, max(sure_row - 1, 0)], 1e-6), 500))
        assert free[c] == pytest.approx(floor[c] - 2 * 0.01 * floor[c] ** 2 / 20)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_way_is_open_connected_and_without_haste_the_cheapest(seed: int):
    rng = np.random.default_rng(seed)
    shut, cost = rng.random((15, 18)) < 0.3, rng.uniform(1, 4, (15, 18)).astype(np.float32)
    there = np.zeros_like(shut)
    there[14, 17] = True
    shut[14, 17] = shut[0, 0] = False
    way = _nav.search(shut, cost, np.zeros_like(cost), there, 0, 0)
    best = cheapest(shut, cost)
    if not math.isfinite(best[14, 17]):
        assert len(way) == 0
        return
    rows, cols = np.divmod(way, 18)
    assert (rows[0], cols[0]) == (0, 0) and (rows[-1], cols[-1]) == (14, 17) and not shut[rows, cols].any()
    steps = np.hypot(np.diff(rows), np.diff(cols))
    assert steps.max() < 1.5
    assert (steps * cost[rows[1:], cols[1:]]).sum() == pytest.approx(best[14, 17], rel=1e-9)


def cheapest(shut: np.ndarray, cost: np.ndarray) -> np.ndarray:
    """Cost of the cheapest way from the first cell to each."""
    best = np.full(shut.shape, np.inf)
    best[0, 0], queue = 0.0, [(0.0, 0, 0)]
    while queue:
        so_far, r, c = heapq.heappop(queue)
        for dr, dc in np.ndindex(3, 3):
            y, x = r + dr - 1, c + dc - 1
            if 0 <= y < shut.shape[0] and 0 <= x < shut.shape[1] and not shut[y, x]:
                new = so_far + math.hypot(dr - 1, dc - 1) * float(cost[y, x])
                if new < best[y, x]:
                    best[y, x] = new
                    heapq.heappush(queue, (new, y, x))
    return best


@pytest.mark.parametrize("seed", SEEDS)
def test_a_straight_drive_meets_the_first_filled_the_first_unseen_and_the_first_cell_never_looked_at(seed):
    rng = np.random.default_rng(seed)
    evidence = rng.choice([-2.0, -0.2, 0.0, 2.0], (40, 40), p=[0.95, 0.02, 0.01, 0.02]).astype(np.float32)
    x, z, heading = *rng.uniform(-40, 40, 2), rng.uniform(-3, 3)
    kinds = (OCCUPIED, FREE, LOOKED)
    room, unseen, blind, row, col = _nav.meet(
        evidence, CENTRES, (0, 39, 0, 39), x, z, heading, 12.0, 17.5, kinds, CELL / 2, 150.0
    )
    dx, dz = CENTRES[None, :] - x, CENTRES[:, None] - z
    along = dx * math.sin(heading) + dz * math.cos(heading)
    aside = np.abs(dx * math.cos(heading) - dz * math.sin(heading))
    lateral = np.clip(aside - CELL / 2, 0, 12.0)
    gaps = np.where(
        (evidence > OCCUPIED) & (along > 0) & (aside < 17.5),
        along - CELL / 2 - np.sqrt(144.0 - lateral**2),
        np.inf,
    )
    unknown = (evidence >= FREE) & (evidence <= OCCUPIED) & (along > 0) & (aside < 12.0)
    nearest = along[unknown].min() - CELL / 2 - 12.0 if unknown.any() else 150.0
    assert unseen == pytest.approx(nearest)
    dark = unknown & (evidence >= LOOKED)
    rims = along[dark] - CELL / 2 - np.sqrt(144.0 - aside[dark] ** 2)
    assert blind == pytest.approx(rims.min() if dark.any() else 150.0)
    if np.isfinite(gaps).any():
        assert room == pytest.approx(gaps.min()) and gaps[row, col] == pytest.approx(room)
    else:
        assert (room, row, col) == (150.0, -1, -1)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_least_distance_along_a_line_is_that_of_its_points_every_half_cell(seed: int):
    rng = np.random.default_rng(seed)
    distances = rng.uniform(0, 50, (40, 40)).astype(np.float32)
    start, end = rng.uniform(-120, 120, 2), rng.uniform(-120, 120, 2)
    length = math.dist(start, end)
    parts = np.arange(min(12.0, length), length + 1e-9, CELL / 2) / length
    cells = np.clip(np.floor((start + parts[:, None] * (end - start) + HALF) / CELL).astype(int), 0, 39)
    least = _nav.least_along(distances, HALF, CELL, tuple(start), tuple(end), 12.0)
    assert least == distances[cells[:, 1], cells[:, 0]].min()


@pytest.mark.parametrize("seed", SEEDS)
def test_one_frame_changes_what_it_shows_and_nothing_else(seed: int):
    """Floor empties up to the front, the front's cells fill, what was thought nearer becomes unknown."""
    rng = np.random.default_rng(seed)
    evidence = (rng.uniform(-4, 4, (40, 40)) * rng.choice([0.2, 1.0], (40, 40))).astype(np.float32)
    region, brief = rng.integers(0, 3, (40, 40)).astype(np.int32), rng.random((40, 40)) < 0.3
    before, owner, was_brief = evidence.copy(), region.copy(), brief.copy()
    heading, free = rng.uniform(-3, 3), rng.uniform(40, 80, 32)
    seen = free + rng.uniform(0, 8, 32)
    cut, columns = rng.random(32) < 0.2, np.arange(8, 24)
    fronts = rng.uniform(50, 70, len(columns))
    sine, cosine = math.sin(heading), math.cos(heading)
    bent = 0.0 if seed % 2 else 0.1  # pixel = 32 (ray + bent ray^3) + 31.5
    rays = np.linspace(-2, 2, 4001) if bent else np.empty(0)
    pixels = 32 * (rays + bent * rays**3) + 31.5
    _nav.paint(
        evidence, region, brief, CENTRES,
        _nav.View(3.0, -4.0, sine, cosine, -1.1, 1.1, 90.0, 32.0, 31.5, rays, pixels, 2),
        (0, 39, 0, 39), _nav.Floor(free, seen, cut, 15.0),
        [_nav.Front(1, columns, fronts, 1.5, -3.0, 20.0, 8.0, -math.inf, 1.0, 4.0, False)],
        _nav.Rules(-0.4, -0.2, 1.0, 4.0, CELL),
    )  # fmt: skip
    over = np.where(cut, 0.0, seen)

    def column_of(ray: float) -> int:
        pixel = np.interp(ray, rays, pixels) if bent else 32 * ray + 31.5
        return math.floor((pixel + 0.5) / 2)

    for r, c in np.ndindex(40, 40):
        dx, dz = CENTRES[c] - 3.0, CENTRES[r] + 4.0
        depth, side = dx * sine + dz * cosine, dx * cosine - dz * sine
        column = -1
        if 1.0 < depth < 90.0 and abs(side) < 1.1 * depth:
            column = column_of(side / depth)
        if not 0 <= column < 32:
            assert (evidence[r, c], region[r, c], brief[r, c]) == (before[r, c], owner[r, c], was_brief[r, c])
            continue
        was, passing, mine = float(before[r, c]), was_brief[r, c], owner[r, c]
        if passing and depth < 15.0 and not cut[column]:
            was, passing = min(was, 0.0), False
        off = depth - fronts[column - 8] if 8 <= column < 24 else None
        free_to = free[column] if off is None else min(free[column], fronts[column - 8] - 3.0)
        change = -0.4 if 15.0 < depth < free_to - 2.5 else 0.0
        if off is not None and off < -6.5 and mine == 1 and was > 0:
            change = max(-0.4, -was)
        if off is not None and -3.0 < off < 20.0 and (off < 8.0 or abs(was) < 1.0):
            change, passing, mine = 1.0, False, 1
        ends = [min(max(column_of((side + end) / depth), 0), 31) for end in (-CELL / 3, 0, CELL / 3)]
        if (
            change == 0.0 and depth < over[ends].min() and -0.2 < was < 1.0
        ):  # something farther is seen over it
            change = max(-0.2 - was, -0.4)
        assert evidence[r, c] == pytest.approx(min(max(was + change, -4.0), 4.0), abs=1e-6)
        assert (region[r, c], brief[r, c]) == (mine, passing)


def test_layers_of_another_kind_are_refused_and_not_silently_copied():
    layer = np.zeros((40, 40))
    view = _nav.View(0, 0, 0, 1, -1, 1, 90, 32, 31.5, np.empty(0), np.empty(0), 2)
    floor, rules = (
        _nav.Floor(np.ones(32), np.ones(32), np.zeros(32, bool), 15.0),
        _nav.Rules(-0.4, -0.2, 1.0, 4.0, CELL),
    )
    with pytest.raises(TypeError):
        _nav.paint(layer, layer.astype(np.int32), layer > 0, CENTRES, view, (0, 39, 0, 39), floor, [], rules)


def tiled_means(values: np.ndarray, across: int, down: int) -> np.ndarray:
    rows, columns = (
        np.arange(n + 1) * size // n for n, size in zip((down, across), values.shape, strict=True)
    )
    return np.array([
        [values[r0:r1, c0:c1].mean() for c0, c1 in itertools.pairwise(columns)]
        for r0, r1 in itertools.pairwise(rows)
    ])  # fmt: skip


@pytest.mark.parametrize(("height", "width"), [(240, 320), (97, 131), (33, 40)])
def test_brightness_and_sharp_edges_are_counted_tile_by_tile(height: int, width: int):
    rng = np.random.default_rng(height)
    image = cv2.GaussianBlur(rng.integers(0, 256, (height, width, 3), np.uint8), (0, 0), 1.2) * 3
    assert (_nav.thinned(image, 4) == image[::4, ::4]).all()
    rows = image[::4, :, 1].astype(int)
    assert np.allclose(_nav.tile_means(image, 4, len(rows), 7, 5), tiled_means(rows, 7, 5), rtol=1e-6)

    levels = image[: height - 2 : 4, :, 1].astype(int)
    below = image[2::4, :, 1].astype(int)[: len(levels)]
    x = np.arange(4, width - 6)
    step, wide = abs(levels[:, x] - levels[:, x + 2]), abs(levels[:, x - 4] - levels[:, x + 6])
    down, far = abs(levels - below)[1:-1, x], abs(levels[:-2] - below[2:])[:, x]
    sharp = (step >= np.maximum(wide // 2, 20))[1:-1] | (down >= np.maximum(far // 2, 20))
    assert 0.01 < sharp.mean() < 0.99
    edges, means = _nav.sharp_tiles(image, 4, 2, 4, 20, 7, 5)
    assert np.allclose(edges, tiled_means(sharp, 7, 5), rtol=1e-6)
    assert np.allclose(means, tiled_means(levels, 7, 5), rtol=1e-6)


def test_strips_of_a_picture_are_its_colours_from_below_averaged():
    image = np.random.default_rng(1).integers(0, 256, (48, 64, 3), np.uint8)
    blocks = image.reshape(24, 2, 8, 8, 3).astype(float).mean(axis=(1, 3))
    assert (strips_of(image) == np.rint(blocks)[::-1, :, ::-1].transpose(1, 0, 2)).all()


def test_rows_of_a_picture_are_compared_with_those_of_another():
    image = np.random.default_rng(2).integers(0, 256, (9, 13, 3), np.uint8)
    image[4] = 7
    other = image.copy()
    other[2, 12, 2] ^= 1
    spread, alike = _nav.compare_rows(image, other)
    assert (spread == np.ptp(image[:, :, 1], axis=1)).all()
    assert alike.tolist() == [row != 2 for row in range(9)]


@pytest.mark.parametrize("rows", [0, 61])
def test_more_rows_than_there_are_are_refused(rows: int):
    with pytest.raises(ValueError, match="rows of the picture"):
        _nav.tile_means(np.zeros((240, 320, 3), np.uint8), 4, rows, 1, 1)
