"""A scene of flat boards before a far wall, seen by an ideal net: exact outlines plus noise."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from host.camera.lens import Lens
from host.pose import Pose
from host.rbdn.snapshot import OUTSIDE, Contour, Event, Region, Snapshot, Vertices

LENS = Lens(320, 240, 371.0, 371.0, 159.5, 119.5)
WALL = 1  # region id of all that is behind the boards


@dataclass(frozen=True)
class Board:
    """A flat thing with an outline of points in space."""

    id: int
    corners_cm: np.ndarray  # (C, 3) in world axes, clockwise in the image
    rgb: tuple[float, float, float] = (200.0, 40.0, 40.0)


def rectangle(
    id: int,
    centre_cm: tuple[float, float, float],
    size_cm: tuple[float, float],
    turned_rad: float = 0.0,
    **more: tuple[float, float, float],
) -> Board:
    """A board turned about the vertical by `turned_rad`, its right side away from the camera."""
    across = np.array([np.cos(turned_rad), 0.0, np.sin(turned_rad)]) * size_cm[0] / 2
    down = np.array([0.0, size_cm[1] / 2, 0.0])
    c = np.array(centre_cm)
    corners = np.array([c - across - down, c + across - down, c + across + down, c - across + down])
    return Board(id, corners, **more)


def disc(id: int, centre_cm: tuple[float, float, float], radius_cm: float) -> Board:
    """A frontal round board."""
    a = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    ring = np.column_stack([np.cos(a), np.sin(a), np.zeros_like(a)]) * radius_cm
    return Board(id, np.array(centre_cm) + ring)


def straight_path(
    frames: int, step_cm: float, direction: tuple[float, float, float] = (0, 0, 1), **more: float
) -> list[Pose]:
    """A path along one direction, without turning."""
    d = np.array(direction, float)
    d /= np.linalg.norm(d)
    return [Pose(np.eye(3), d * step_cm * k, 0.1 * k, **more) for k in range(frames)]


def turned(pose: Pose, pitch_rad: float = 0.0, yaw_rad: float = 0.0) -> Pose:
    """The same place with the camera turned up by pitch and right by yaw."""
    cp, sp, cy, sy = np.cos(pitch_rad), np.sin(pitch_rad), np.cos(yaw_rad), np.sin(yaw_rad)
    yaw = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    pitch = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
    return Pose(yaw @ pitch @ pose.rotation, pose.position_cm, pose.t_s)


@dataclass
class Camera:
    """Looks at boards and hands out snapshots, numbered from 0."""

    boards: list[Board]
    lens: Lens = LENS
    noise_px: float = 0.0  # of contour samples, independent
    vertex_noise_px: float = 0.0
    seed: int = 0
    hidden_by: dict[int, int] = field(default_factory=dict)  # board id -> id of the region beyond its outline

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng(self.seed)
        self._seq = 0

    def project(self, points_cm: np.ndarray, pose: Pose) -> np.ndarray:
        """World points (N, 3) to pixels (N, 2)."""
        seen = (points_cm - pose.position_cm) @ pose.rotation
        return self.lens.to_pixels(seen[:, :2] / seen[:, 2:])

    def look(self, pose: Pose, events: tuple[Event, ...] = ()) -> Snapshot:
        """The snapshot an ideal net would make from here."""
        samples, regions, ids, xy = [], [], [], []
        edge = np.array([self.lens.width, self.lens.height]) - 0.5
        for board in self.boards:
            corners = self.project(board.corners_cm, pose)
            beyond = self.hidden_by.get(board.id, WALL)
            inside = ((corners > -0.5) & (corners < edge)).all()
            points, normals = self._along(corners)
            points = points + self._rng.normal(0, self.noise_px, (len(points), 1)) * normals
            visible = ((points > 0) & (points < edge - 0.5)).all(axis=1)
            samples.append((points[visible], normals[visible], board.id, beyond))
            names = 100 * board.id + np.arange(len(corners))
            measured = corners + self._rng.normal(0, self.vertex_noise_px, corners.shape)
            ids.append(names)
            xy.append(measured)
            loop = np.clip(corners, -0.5, edge)
            area = _area(loop)
            sigma = 0.5 * self.noise_px * np.sqrt(len(points)) + 0.01
            area += self._rng.normal(0, sigma) if self.noise_px else 0.0
            regions.append(
                Region(
                    board.id,
                    None,
                    0,
                    area,
                    sigma,
                    not inside,
                    board.rgb,
                    (loop,),
                    (names,),
                    (np.full(len(loop), beyond),),
                )
            )
        frame = np.array([[-0.5, -0.5], [edge[0], -0.5], edge, [-0.5, edge[1]]])
        holes = [r.loops[0] for r in regions]
        wall_area = _area(frame) - sum(_area(h) for h in holes)
        regions.append(
            Region(
                WALL,
                None,
                0,
                wall_area,
                1.0,
                True,
                (90.0, 90.0, 90.0),
                (frame, *holes),
                tuple(np.full(len(p), -1) for p in (frame, *holes)),
                (np.full(4, OUTSIDE), *(np.full(len(h), 0) for h in holes)),
            )
        )
        count = [len(p) for p, *_ in samples]
        contour = Contour(
            np.concatenate([p for p, *_ in samples]),
            np.concatenate([n for _, n, *_ in samples]),
            np.repeat([b for *_, b, _ in samples], count),
            np.repeat([b for *_, b in samples], count),
            np.ones(sum(count)),
            np.full(sum(count), max(self.noise_px, 0.01)),
        )
        vertices = Vertices(
            np.concatenate(ids),
            np.concatenate(xy),
            np.full(sum(map(len, ids)), max(self.vertex_noise_px, 0.01)),
        )
        self._seq += 1
        return Snapshot(self._seq - 1, tuple(regions), vertices, contour, events, 0, 0.0, 0.0)

    @staticmethod
    def _along(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        points, normals = [], []
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            length = float(np.linalg.norm(b - a))
            along = (b - a) / length
            at = np.arange(0.5, length, 1.0)
            points.append(a + at[:, None] * along)
            normals.append(np.tile([along[1], -along[0]], (len(at), 1)))
        return np.concatenate(points), np.concatenate(normals)


def _area(loop: np.ndarray) -> float:
    x, y = loop[:, 0], loop[:, 1]
    return float(abs(0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum()))
