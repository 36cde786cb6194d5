"""What must hold of any net, checked from its arrays alone and by other means than the engine's own."""

from __future__ import annotations

import numpy as np
from oracle import areas_of_faces, owners_of_pixels

from host.rbdn import Net

OUTSIDE = -1


def assert_sound(net: Net) -> None:
    """Planar, a partition of the image, every face in one piece, border vertices on their side."""
    faces = net.faces()
    xy = faces["vertices_px"] + 0.5  # the image is [0, W] x [0, H] here
    edges = faces["edges"]
    height, width = faces["labels"].shape
    count = len(faces["means"])
    assert net.faults() == []
    _assert_incidence(edges, len(xy), count)
    _assert_no_crossing(xy, edges)
    _assert_wedges(xy, edges)
    _assert_border(xy, edges, width, height)
    areas = areas_of_faces(xy, edges, count)
    assert abs(areas.sum() - width * height) < 1e-6
    assert (areas > 0).all()
    _assert_euler(edges, len(xy), count)
    _assert_labels(xy, edges, faces["labels"])


def _assert_incidence(edges: np.ndarray, vertices: int, faces: int) -> None:
    a, b, left, right = edges.T
    assert (a != b).all() and (left != right).all()
    assert set(np.r_[a, b].tolist()) == set(range(vertices))
    assert set(np.r_[left, right].tolist()) - {OUTSIDE} == set(range(faces))
    ends = {tuple(sorted(pair)) for pair in edges[:, :2].tolist()}
    assert len(ends) == len(edges), "two edges between the same vertices"


def _assert_no_crossing(xy: np.ndarray, edges: np.ndarray) -> None:
    a, b = xy[edges[:, 0]], xy[edges[:, 1]]

    def side(p, q, r):
        return (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (
            r[..., 0] - p[..., 0]
        )

    p, q, r, s = a[:, None], b[:, None], a[None], b[None]
    tiny = 1e-9
    crossing = (side(p, q, r) * side(p, q, s) < -tiny) & (side(r, s, p) * side(r, s, q) < -tiny)
    i, j = np.nonzero(crossing)
    for m, n in zip(i, j, strict=True):
        assert set(edges[m, :2]) & set(edges[n, :2]), f"edges {m} and {n} cross"


def _assert_wedges(xy: np.ndarray, edges: np.ndarray) -> None:
    """Round every vertex, neighbouring edges name the same face between them."""
    a, b, left, right = edges.T
    along = xy[b] - xy[a]
    # With y downwards angles grow clockwise: the face after an edge lies to the right of its direction.
    vertex, before, after = np.r_[a, b], np.r_[left, right], np.r_[right, left]
    angle = np.r_[np.arctan2(along[:, 1], along[:, 0]), np.arctan2(-along[:, 1], -along[:, 0])]
    order = np.lexsort((angle, vertex))
    for around in np.split(order, np.flatnonzero(np.diff(vertex[order])) + 1):
        assert (after[around] == before[np.roll(around, -1)]).all(), f"torn at vertex {vertex[around[0]]}"


def _assert_border(xy: np.ndarray, edges: np.ndarray, width: int, height: int) -> None:
    p, q = xy[edges[:, 0]], xy[edges[:, 1]]
    on_side = np.zeros(len(edges), bool)
    for axis, limit in ((0, 0.0), (0, width), (1, 0.0), (1, height)):
        on_side |= (p[:, axis] == limit) & (q[:, axis] == limit)
    outer = (edges[:, 2:] == OUTSIDE).any(1)
    assert (on_side == outer).all()
    assert np.isclose(np.linalg.norm(q - p, axis=1)[outer].sum(), 2 * (width + height))
    corners = {(0.0, 0.0), (float(width), 0.0), (0.0, float(height)), (float(width), float(height))}
    assert corners <= {tuple(v) for v in xy.tolist()}
    assert (xy >= 0).all() and (xy <= (width, height)).all()


def _assert_euler(edges: np.ndarray, vertices: int, faces: int) -> None:
    """V - E + F = 1 + C with the outside counted; a face in two pieces would break it."""
    root = list(range(vertices))

    def find(k: int) -> int:
        while root[k] != k:
            root[k] = root[root[k]]
            k = root[k]
        return k

    for a, b in edges[:, :2].tolist():
        root[find(a)] = find(b)
    components = len({find(k) for k in range(vertices)})
    assert vertices - len(edges) + faces + 1 == 1 + components


def _assert_labels(xy: np.ndarray, edges: np.ndarray, labels: np.ndarray) -> None:
    """Every pixel's centre lies in exactly one face, the one that its label names."""
    owners, doubtful = owners_of_pixels(xy, edges, *labels.shape)
    assert ((owners == labels) | doubtful).all()
