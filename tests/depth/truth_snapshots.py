"""Snapshots from the true masks of a rendered sequence, outlines re-measured on the webcam's images.

What a good net would see: the ids are the truth's, the outline is measured on the image like the net
does it. For measuring the depth room alone; never part of the product's estimate.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path

import cv2
import numpy as np

from host.camera.lens import Lens
from host.pose import Pose
from host.rbdn.snapshot import OUTSIDE, Contour, Region, Snapshot, Vertices

PROFILE_PX = np.arange(-6.0, 6.25, 0.5)  # samples along the normal, inside negative
BAND_PX = 2.5  # half width of the band whose mixing ratios are summed
SMOOTH_PX = 2.0  # of the crack contour, along the outline


def load_lens(folder: Path) -> Lens:
    c = json.loads((folder / "camera.json").read_text())
    return Lens(c["width"], c["height"], c["fx"], c["fy"], c["cx"], c["cy"], tuple(c["distortion"]))


def load_poses(file: Path) -> tuple[list[str], list[Pose]]:
    files, poses = [], []
    for row in csv.DictReader(file.open()):
        w, x, y, z = (float(row[k]) for k in ("qw", "qx", "qy", "qz"))
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        position = np.array([float(row[k]) for k in ("x_cm", "y_cm", "z_cm")])
        files.append(row["file"])
        poses.append(Pose(rotation, position, float(row["t_s"])))
    return files, poses


def crack_loops(labels: np.ndarray, label: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Loops of one region along the cracks between pixels.

    Returns
    -------
    list of (points (N, 2) crack corners in pixel coordinates, neighbours (N,) id beyond point k to k+1),
    the region to the right of the way (x right, y down), the longest loop first.
    """
    h, w = labels.shape
    inside = np.zeros((h + 2, w + 2), bool)
    inside[1:-1, 1:-1] = labels == label
    padded = np.full((h + 2, w + 2), OUTSIDE, np.int64)
    padded[1:-1, 1:-1] = labels
    follow: dict[tuple[int, int], list[tuple[tuple[int, int], int]]] = {}

    def add(start: tuple[int, int], end: tuple[int, int], other: int) -> None:
        follow.setdefault(start, []).append((end, other))

    for dy, dx, a, b in (
        (-1, 0, (0, 0), (1, 0)),
        (0, 1, (1, 0), (1, 1)),
        (1, 0, (1, 1), (0, 1)),
        (0, -1, (0, 1), (0, 0)),
    ):
        ys, xs = np.nonzero(inside & ~np.roll(inside, (-dy, -dx), (0, 1)))
        for y, x in zip(ys.tolist(), xs.tolist(), strict=True):
            add((x + a[0], y + a[1]), (x + b[0], y + b[1]), int(padded[y + dy, x + dx]))
    loops = []
    while follow:
        start = next(iter(follow))
        here, came, points, others = start, None, [], []
        while True:
            ways = follow[here]
            pick = 0
            if len(ways) > 1 and came is not None:
                # at a diagonal touch turn towards the region, so that loops do not cross
                right = (-came[1], came[0])
                pick = next(
                    (k for k, (e, _) in enumerate(ways) if (e[0] - here[0], e[1] - here[1]) == right), 0
                )
            end, other = ways.pop(pick)
            if not ways:
                del follow[here]
            points.append(here)
            others.append(other)
            came, here = (end[0] - here[0], end[1] - here[1]), end
            if here == start:
                break
        # the padded corner (1, 1) is the outer corner of pixel (0, 0)
        loops.append((np.array(points, float) - 1.5, np.array(others, np.int64)))
    loops.sort(key=lambda loop: -_shoelace(loop[0]))
    return loops


def _shoelace(p: np.ndarray) -> float:
    x, y = p[:, 0], p[:, 1]
    return float(0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def _smooth_runs(points: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Smooth a crack loop between changes of neighbour; returns points and outward normals."""
    n = len(points)
    middles = 0.5 * (points + np.roll(points, -1, 0))
    cuts = np.nonzero(others != np.roll(others, 1))[0]
    out, tangent = middles.copy(), np.zeros_like(middles)
    reach = int(3 * SMOOTH_PX)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / SMOOTH_PX) ** 2)
    runs = (
        [(np.arange(n), True)]
        if len(cuts) == 0
        else [
            ((np.arange(a, b if b > a else b + n)) % n, False)
            for a, b in zip(cuts, np.roll(cuts, -1), strict=True)
        ]
    )
    for index, closed in runs:
        m = len(index)
        p = middles[index]
        k = np.arange(-reach, reach + 1)[None, :] + np.arange(m)[:, None]
        if closed:
            out[index] = (kernel[None, :, None] * p[k % m]).sum(1) / kernel.sum()
            d = out[index[(np.arange(m) + 1) % m]] - out[index[(np.arange(m) - 1) % m]]
        else:
            # reflect about the ends so that a straight run stays straight
            low, high = k < 0, k >= m
            k2 = np.clip(np.where(low, -k, np.where(high, 2 * (m - 1) - k, k)), 0, m - 1)
            q = p[k2]
            q = np.where(low[..., None], 2 * p[0] - q, np.where(high[..., None], 2 * p[-1] - q, q))
            out[index] = (kernel[None, :, None] * q).sum(1) / kernel.sum()
            d = np.gradient(out[index], axis=0) if m > 1 else points[(index + 1) % n] - points[index]
        tangent[index] = d
    length = np.linalg.norm(tangent, axis=1, keepdims=True)
    tangent = tangent / np.maximum(length, 1e-9)
    return out, np.column_stack([tangent[:, 1], -tangent[:, 0]])


def _refine(image: np.ndarray, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shift along the normal (N,) and its standard error, from unclamped mixing ratios across the outline."""
    at = points[:, None, :] + PROFILE_PX[None, :, None] * normals[:, None, :]
    colour = cv2.remap(
        image,
        at[..., 0].astype(np.float32),
        at[..., 1].astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    ).astype(float)
    inside, outside = colour[:, PROFILE_PX < -BAND_PX].mean(1), colour[:, PROFILE_PX > BAND_PX].mean(1)
    step = inside - outside
    contrast = np.linalg.norm(step, axis=1)
    band = np.abs(PROFILE_PX) <= BAND_PX
    alpha = ((colour[:, band] - outside[:, None]) * step[:, None]).sum(2) / np.maximum(
        contrast[:, None] ** 2, 1e-9
    )
    weight = np.ones(band.sum())
    weight[[0, -1]] = 0.5
    shift = (alpha * weight).sum(1) * 0.5 - BAND_PX
    sigma = np.clip(6.0 / np.maximum(contrast, 1.0), 0.05, 1.0)
    bad = (contrast < 12) | (np.abs(shift) > 1.5)
    return np.where(bad, 0.0, shift), np.where(bad, 0.5, sigma)


def _connected(labels: np.ndarray, min_area_px: int) -> np.ndarray:
    """Every id connected: the largest piece keeps it, further ones get 1000 more each, specks become 0."""
    out = np.zeros_like(labels)
    for label in np.unique(labels[labels > 0]):
        count, pieces, stats, _ = cv2.connectedComponentsWithStats(
            (labels == label).astype(np.uint8), connectivity=4
        )
        largest = 1 + np.argsort(-stats[1:, cv2.CC_STAT_AREA], kind="stable")
        for rank, piece in enumerate(largest[: count - 1]):
            if stats[piece, cv2.CC_STAT_AREA] >= min_area_px:
                out[pieces == piece] = label + 1000 * rank
    return out


def snapshot_from_labels(
    labels: np.ndarray,
    image: np.ndarray | None,
    seq: int,
    vertices: Vertices | None = None,
    min_area_px: int = 60,
) -> Snapshot:
    """A snapshot whose regions are the labels of an id image.

    Parameters
    ----------
    labels : (H, W) integer, the region ids
    image : (H, W, 3) uint8 to measure the outlines on; None leaves the smoothed cracks
    seq : frame number
    """
    labels = _connected(labels, min_area_px)
    regions, parts = [], []
    blurred = None if image is None else cv2.GaussianBlur(image, (3, 3), 0)
    for label in np.unique(labels):
        count = int((labels == label).sum())
        if label <= 0 or count < min_area_px:
            continue
        loops, nodes, beyond = [], [], []
        for points, others in crack_loops(labels, int(label)):
            if len(points) < 12:
                continue
            smooth, normal = _smooth_runs(points, others)
            shift, sigma = np.zeros(len(smooth)), np.full(len(smooth), 0.1)
            if blurred is not None:
                shift, sigma = _refine(blurred, smooth, normal)
                window = np.ones(5) / 5
                padded = np.concatenate([shift[-2:], shift, shift[:2]])
                shift = np.convolve(padded, window, "valid")
            edge = others == OUTSIDE
            moved = np.where(
                edge[:, None], 0.5 * (points + np.roll(points, -1, 0)), smooth + shift[:, None] * normal
            )
            loops.append(moved)
            nodes.append(np.full(len(moved), -1, np.int64))
            beyond.append(others)
            mine = (~edge) & ((others > label) | ~np.isin(others, np.unique(labels[labels > 0])))
            length = np.linalg.norm(np.roll(smooth, -1, 0) - smooth, axis=1)
            parts.append(
                (
                    moved[mine],
                    normal[mine],
                    np.full(mine.sum(), label),
                    others[mine],
                    length[mine],
                    sigma[mine],
                )
            )
        if not loops:
            continue
        area = _shoelace(loops[0]) - sum(abs(_shoelace(p)) for p in loops[1:])
        mask = labels == label
        rgb = (0.0, 0.0, 0.0) if image is None else tuple(float(v) for v in image[mask].mean(0)[::-1])
        touches = bool(mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any())
        sigma_area = 0.1 * np.sqrt(3 * len(loops[0]))
        regions.append(
            Region(
                int(label),
                None,
                0,
                float(area),
                float(sigma_area),
                touches,
                rgb,
                tuple(loops),
                tuple(nodes),
                tuple(beyond),
            )
        )
    stack = [np.concatenate([p[k] for p in parts]) for k in range(6)] if parts else [np.zeros((0, 2))] * 6
    contour = Contour(*stack)
    none = Vertices(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros(0))
    return Snapshot(seq, tuple(regions), vertices or none, contour, (), 0, 0.0, 0.0)


def with_vertices(
    snapshot: Snapshot, owners: dict[int, list[tuple[int, float, float]]], sigma_px: float
) -> Snapshot:
    """Name vertices on the outer loops: region id -> (vertex id, x, y)."""
    ids, xy = [], []
    regions = []
    for region in snapshot.regions:
        mine = owners.get(region.id, [])
        nodes = region.loop_vertices[0].copy()
        for vid, x, y in mine:
            nodes[int(np.argmin(np.linalg.norm(region.loops[0] - (x, y), axis=1)))] = vid
            if vid not in ids:
                ids.append(vid)
                xy.append((x, y))
        regions.append(Region(**{**region.__dict__, "loop_vertices": (nodes, *region.loop_vertices[1:])}))
    vertices = Vertices(
        np.array(ids, np.int64), np.array(xy, float).reshape(-1, 2), np.full(len(ids), sigma_px)
    )
    return Snapshot(**{**snapshot.__dict__, "regions": tuple(regions), "vertices": vertices})


def truth_sequence(
    folder: Path, level: str = "object_id", poses: str = "poses.csv", vertex_noise_px: float = 0.1
):
    """Yield (snapshot, pose) of a rendered sequence; `level` is "object_id" or "part_id"."""
    files, path = load_poses(folder / poses)
    maps = np.load(folder / "truth" / "ids.npz")[level]
    truth = json.loads((folder / "truth" / "truth.json").read_text())
    owner = {p["id"]: p["object"] for p in truth["parts"]}
    background = {o["id"] for o in truth["objects"] if o["background"]}
    rng = np.random.default_rng(1)
    for seq, (name, pose) in enumerate(zip(files, path, strict=True)):
        image = cv2.imread(str(folder / name))
        snapshot = snapshot_from_labels(maps[seq].astype(np.int64), image, seq)
        corners: dict[int, list[tuple[int, float, float]]] = {}
        for key, part in truth["frames"][seq]["parts"].items():
            p = int(key)
            if owner[p] in background or not part.get("corners_px"):
                continue
            region = p if level == "part_id" else owner[p]
            for k, (x, y) in enumerate(part["corners_px"]):
                dx, dy = rng.normal(0, vertex_noise_px, 2)
                corners.setdefault(region, []).append((100 * p + k, x + dx, y + dy))
        yield with_vertices(snapshot, corners, vertex_noise_px), pose
