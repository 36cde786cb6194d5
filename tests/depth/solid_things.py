"""Random things on a table before a level camera, their outlines and visible surfaces in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from solid_scene import Ball, Block, Post, Sheet, Thing

from host.camera.lens import Lens
from host.pose import Pose

LENS = Lens(320, 240, 371.0, 371.0, 159.5, 119.5)
KINDS = ("block", "face", "ball", "post")


def thing(kind: str, rng: np.random.Generator) -> Thing:
    """One of `KINDS`, 46 to 132 cm away and as large as what stands on tables."""
    height, z = rng.uniform(7, 17), rng.uniform(46, 132)  # of the camera above the table
    x = rng.uniform(-0.35, 0.35) * z
    if kind == "ball":
        r = rng.uniform(2.8, 6.5)
        return Ball(7, np.array([x, height - r, z]), r)
    if kind == "post":
        r, tall = rng.uniform(2.8, 5.5), rng.uniform(6, 15)
        return Post(7, np.array([x, height - tall / 2, z]), r, tall)
    w, h, d = rng.uniform(6, 19), rng.uniform(5, 22), rng.uniform(4, 15)
    block = Block(7, np.array([x, height - h / 2, z]), (w, h, d), rng.uniform(-np.pi / 4, np.pi / 4))
    if kind == "block":
        return block
    middle = np.array([face.corners_cm.mean(axis=0) for face in block.faces(7)])
    outward = middle - block.centre_cm
    seen = np.nonzero((middle * outward).sum(axis=1) < 0)[0]
    return Sheet(7, block.faces(7)[rng.choice(seen)].corners_cm)


@dataclass(frozen=True)
class Seen:
    """A thing from one place."""

    loop: np.ndarray  # (N, 2) px, its outline, about a point a pixel
    silhouette_cm: float  # one depth fitted to the outline's motion while the camera drives forward
    surface_cm: float  # mean over the visible surface
    width: float  # sqrt of its area over its depth

    @property
    def relief(self) -> float:
        """How far the surface stands before the outline, in widths."""
        return (1 - self.surface_cm / self.silhouette_cm) / self.width


def seen(thing: Thing, forward_cm: float = 0.0) -> Seen | None:
    """None where it is not wholly in the image, or too small to be measured."""
    pose = Pose(np.eye(3), np.array([0.0, 0.0, forward_cm]))
    rim = thing.rim(pose)
    if rim is None:
        return None
    corners, rho = rim.rays * LENS.fx, 1 / rim.depth_cm  # px from the middle; linear along straight edges
    if np.abs(corners[:, 0]).max() > 156 or np.abs(corners[:, 1]).max() > 116:
        return None
    points, at, pull = [], [], []
    for k in range(len(corners)):
        a, b = corners[k], corners[(k + 1) % len(corners)]
        length = float(np.linalg.norm(b - a))
        steps = max(1, round(length))
        share = (np.arange(steps) / steps)[:, None]
        points.append(a + share * (b - a))
        at.append(rho[k] + (share[:, 0] + 0.5 / steps) * (rho[(k + 1) % len(corners)] - rho[k]))
        along_normal = (a[0] * b[1] - b[0] * a[1]) / max(length, 1e-12)
        pull.append(np.full(steps, along_normal**2 * length / steps))
    loop, weight = np.concatenate(points), np.concatenate(pull)
    x, y = corners.T
    area = abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2
    if area < 250:
        return None
    low, high = corners.min(axis=0), corners.max(axis=0)
    grid = np.stack(np.meshgrid(*(np.linspace(a, b, 42) for a, b in zip(low, high, strict=True))), axis=-1)
    rays = np.column_stack([grid.reshape(-1, 2) / LENS.fx, np.ones(42 * 42)])
    depth = thing.depth(pose.position_cm, rays)
    return Seen(
        loop + np.array([LENS.cx, LENS.cy]),
        float(weight.sum() / (weight @ np.concatenate(at))),
        float(depth[np.isfinite(depth)].mean()),
        float(np.sqrt(area)) / LENS.fx,
    )
