"""Pictures of a simulated world as a webcam takes them, and the truth beside them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TypedDict

import cv2
import numpy as np
from numpy.typing import ArrayLike

from host.camera.lens import Lens
from host.pose import Pose
from host.sim import _render
from host.sim.things import Ball, Board, Box, Cone, Cylinder, Ellipsoid, Material, Shape, Thing, pieces_of
from host.sim.world import World


@dataclass(frozen=True)
class WebcamModel:
    """What a webcam does to light, in this order. The defaults are an ordinary one indoors."""

    psf_px: float = 0.65  # standard deviation of the lens blur
    vignetting: float = 0.15  # light lost in the corners, relative
    exposure_drift: float = 0.02  # slow change of the gain, relative
    full_well: float = 4000.0  # electrons at white: shot noise
    read_noise: float = 0.0025  # standard deviation, relative to white
    jpeg_quality: int = 85  # with 4:2:0 chroma; 0 for no JPEG
    readout_s: float = 0.0  # between the first row's exposure and the last's
    latency_s: float = 0.0  # from the last row's exposure until the program can have the picture
    jitter_s: float = 0.0  # and up to this much more, at random
    stamp_late_s: float = 0.0  # by how much a picture's time is later than its middle row's exposure


IDEAL = WebcamModel(
    0.0, vignetting=0.0, exposure_drift=0.0, full_well=math.inf, read_noise=0.0, jpeg_quality=0
)


@dataclass(frozen=True)
class Part:
    """One face of a box, or one smooth surface; or all surfaces of a group that bear one name."""

    id: int
    object_id: int
    name: str
    planar: bool
    corners_cm: np.ndarray  # (4, 3) in the world for a rectangle, else (0, 3)


@dataclass(frozen=True)
class TrueFrame:
    """What is true of one picture, for scoring alone."""

    depth_cm: np.ndarray  # (H, W) float32 along the axis at pixel centres, 0 = nothing
    part_id: np.ndarray  # (H, W) uint16, 0 = nothing
    object_id: np.ndarray  # (H, W) uint16, 0 = nothing
    # The rest is empty where it was not asked for.
    part_area_px: np.ndarray  # (parts + 1,) visible area with fractions, by part id
    part_mean_z_cm: np.ndarray  # (parts + 1,) depth averaged over it
    object_area_px: np.ndarray  # (objects + 1,) the same of whole objects, by object id
    object_mean_z_cm: np.ndarray  # (objects + 1,)


class _Ids(TypedDict):
    object: int
    part: int


def linear_of(srgb: np.ndarray) -> np.ndarray:
    """Screen values 0..1 to light 0..1."""
    srgb = np.asarray(srgb, float)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _screen_table() -> np.ndarray:
    light = np.arange(65536) / 65535.0
    srgb = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.round(255 * srgb).astype(np.uint8)


SCREEN = _screen_table()  # light in 65536 steps to screen values


class Renderer:
    """Draws a world from any camera pose.

    Attributes
    ----------
    object_names : dict[int, str]
        By object id; the room's own surfaces first.
    background_ids : frozenset[int]
        Objects that belong to the room.
    parts : tuple[Part, ...]
        Part k has id k + 1.
    """

    def __init__(self, world: World) -> None:
        self.lens = world.lens
        self.object_names: dict[int, str] = {}
        self._parts: list[Part] = []
        self._floor_y = world.camera_height_cm
        self._scene = _render.Scene(floor_y=self._floor_y)
        self._add_room(world)
        self.background_ids = frozenset(self.object_names)
        for thing in world.things:
            self._add_thing(thing)
        self.parts = tuple(self._parts)

    # --- The scene --------------------------------------------------------------------------------

    def _part(self, name: str, planar: bool, corners_cm: np.ndarray | None = None) -> _Ids:
        object_id = len(self.object_names)
        full_name = f"{self.object_names[object_id]}/{name}"
        for part in self._parts:
            if (part.object_id, part.name) == (object_id, full_name):
                return {"object": object_id, "part": part.id}
        part_id = len(self._parts) + 1
        corners = np.zeros((0, 3)) if corners_cm is None else corners_cm
        self._parts.append(Part(part_id, object_id, full_name, planar, corners))
        return {"object": object_id, "part": part_id}

    def _object(self, name: str) -> None:
        self.object_names[len(self.object_names) + 1] = name

    def _quad(
        self,
        name: str,
        corner: ArrayLike,
        u: ArrayLike,
        v: ArrayLike,
        normal: ArrayLike,
        material: Material,
        shadowed: bool = False,
    ) -> None:
        corner, u, v = (np.asarray(a, float) for a in (corner, u, v))
        ids = self._part(name, True, np.array([corner, corner + u, corner + u + v, corner + v]))
        self._scene.quad(
            _triple(corner), _triple(u), _triple(v), _triple(normal),
            **ids, material=_material(material), shadowed=shadowed,
        )  # fmt: skip

    def _add_room(self, world: World) -> None:
        room, floor = world.room, self._floor_y
        x0, x1, z0, z1, top = room.left_cm, room.right_cm, room.back_cm, room.front_cm, floor - room.height_cm
        across, along, up = (x1 - x0, 0, 0), (0, 0, z1 - z0), (0, -room.height_cm, 0)
        lamp_x, height, lamp_z = room.lamp_cm
        lamp = (lamp_x, floor - height, lamp_z)
        self._scene.light(lamp, ambient=0.4, sky=0.4, direct=0.6, reference_cm=height)
        for name, corner, u, v, normal, material in (
            ("floor", (x0, floor, z0), across, along, (0, -1, 0), room.floor),
            ("wall_front", (x0, floor, z1), across, up, (0, 0, -1), room.front_wall),
            ("wall_left", (x0, floor, z0), along, up, (1, 0, 0), room.left_wall),
            ("wall_right", (x1, floor, z0), along, up, (-1, 0, 0), room.right_wall),
            ("ceiling", (x0, top, z0), across, along, (0, 1, 0), room.ceiling),
            ("wall_back", (x0, floor, z0), across, up, (0, 0, 1), room.back_wall),
        ):
            self._object(name)
            self._quad("face", corner, u, v, normal, material, shadowed=name == "floor")

    def _add_thing(self, thing: Thing) -> None:
        self._object(thing.name)
        for piece in pieces_of(thing):
            prefix = "" if piece is thing else f"{piece.name}/"
            if isinstance(piece, Box):
                self._add_box(piece, prefix)
            elif isinstance(piece, Board):
                self._add_board(piece, prefix)
            elif isinstance(piece, Ball | Ellipsoid):
                self._add_ball(piece, prefix)
            else:
                self._add_cone(piece, prefix)

    def _foot(self, shape: Shape) -> np.ndarray:
        """(3,): the shape's place at the height of its lower end, in world axes."""
        return np.array([shape.x_cm, self._floor_y - shape.base_cm, shape.z_cm])

    def _seen_from_below(self, shape: Shape, prefix: str) -> bool:
        hangs = not prefix  # while pieces of a group stand on one another
        return hangs and shape.base_cm > self._floor_y  # where the camera is, unless it climbs

    def _add_cone(self, cone: Cone | Cylinder, prefix: str) -> None:
        material, foot, h = _material(cone.material), self._foot(cone), cone.height_cm
        r = cone.radius_cm
        top_r = r if isinstance(cone, Cylinder) else cone.top_radius_cm
        side = self._part(f"{prefix}side", False)
        self._scene.cone(_triple(foot), r, top_r, h, **side, material=material)
        if top_r > 0.0:
            top = self._part(f"{prefix}top", True)
            self._scene.disc(_triple(foot - (0.0, h, 0.0)), top_r, **top, material=material)
        if r > 0.0 and self._seen_from_below(cone, prefix):
            bottom = self._part(f"{prefix}bottom", True)
            self._scene.disc(_triple(foot), r, **bottom, material=material, faces_down=True)
        self._scene.round_occluder(
            cone.x_cm, cone.z_cm, (r + top_r) / 2, height=cone.base_cm + h, base=cone.base_cm
        )

    def _add_ball(self, ball: Ball | Ellipsoid, prefix: str) -> None:
        axes = ball.radius_cm * np.eye(3) if isinstance(ball, Ball) else ball.half_axes_cm
        half_height = float(np.linalg.norm(axes[:, 1]))
        wide = float(np.linalg.norm(axes[[0, 2]], axis=1).mean())
        u, v, w = (_triple(axis) for axis in axes)
        centre = _triple(self._foot(ball) - (0.0, half_height, 0.0))
        surface = self._part(f"{prefix}surface", False)
        self._scene.ellipsoid(centre, u, v, w, **surface, material=_material(ball.material))
        # it touches the floor in a point only
        self._scene.round_occluder(
            ball.x_cm, ball.z_cm, 0.6 * wide, height=ball.base_cm + 1.6 * half_height, base=ball.base_cm
        )

    def _add_board(self, board: Board, prefix: str) -> None:
        c, s = math.cos(board.yaw_rad), math.sin(board.yaw_rad)
        right, ahead, up = np.array([c, 0, -s]), np.array([s, 0, c]), np.array([0, -1.0, 0])
        c, s = math.cos(board.lean_rad), math.sin(board.lean_rad)
        w, h, normal = board.width_cm * right, board.height_cm * (c * up + s * ahead), s * up - c * ahead
        corner = self._foot(board) - w / 2
        self._quad(f"{prefix}front", corner, w, h, normal, board.material)
        self._quad(f"{prefix}back", corner, w, h, -normal, board.material)
        middle, depth = board.height_cm * s / 2 * ahead, board.height_cm * abs(s)
        if c > 0.2:  # what lies flat throws no shadow
            self._scene.box_occluder(
                board.x_cm + middle[0], board.z_cm + middle[2],
                board.width_cm / 2, max(depth / 2, 0.2), board.yaw_rad,
                height=board.base_cm + board.height_cm * c, base=board.base_cm,
            )  # fmt: skip

    def _add_box(self, box: Box, prefix: str) -> None:
        c, s = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
        right, ahead, up = np.array([c, 0, -s]), np.array([s, 0, c]), np.array([0, -1.0, 0])
        w, d, h = box.width_cm * right, box.depth_cm * ahead, box.height_cm * up
        near_left = self._foot(box) - w / 2 - d / 2
        faces = [
            ("front", near_left, w, h, -ahead),
            ("back", near_left + d, w, h, ahead),
            ("left", near_left, d, h, -right),
            ("right", near_left + w, d, h, right),
            ("top", near_left + h, w, d, up),
        ]
        if self._seen_from_below(box, prefix):
            faces.append(("bottom", near_left, w, d, -up))
        for name, corner, u, v, normal in faces:
            self._quad(f"{prefix}{name}", corner, u, v, normal, box.material)
        self._scene.box_occluder(
            box.x_cm, box.z_cm, box.width_cm / 2, box.depth_cm / 2, box.yaw_rad,
            height=box.base_cm + box.height_cm, base=box.base_cm,
        )  # fmt: skip

    # --- Pictures ---------------------------------------------------------------------------------

    def light(self, pose: Pose, psf_px: float = 0.0) -> np.ndarray:
        """Light at the sensor, (H, W, 3) float32, linear BGR, 1 = white paper well lit.

        Parameters
        ----------
        pose
            Of the camera.
        psf_px
            Standard deviation of the lens blur; the pixels' own integration comes on top.
        """
        return self.rolling_light([pose], psf_px)

    def rolling_light(self, poses: Sequence[Pose], psf_px: float = 0.0) -> np.ndarray:
        """The same where rows are exposed in turn: even bands of them, from the top, a pose each."""
        rotations = np.array([pose.rotation for pose in poses], float)
        positions = np.array([pose.position_cm for pose in poses], float)
        return self._scene.render(_camera(self.lens), rotations, positions, psf_px)

    def truth(self, pose: Pose, areas: bool = True) -> TrueFrame:
        """What is to be seen from a pose; areas and mean depths, which take longest, only when asked for."""
        rotation, position = (np.ascontiguousarray(a, float) for a in (pose.rotation, pose.position_cm))
        depth, part, thing, area, mean_z = self._scene.truth(_camera(self.lens), rotation, position, areas)
        if not areas:
            return TrueFrame(depth, part, thing, area, mean_z, np.zeros(0), np.zeros(0))
        owner = np.array([0, *(p.object_id for p in self.parts)])
        count = len(self.object_names) + 1
        object_area = np.bincount(owner, area, count)
        object_mean_z = np.bincount(owner, area * mean_z, count) / np.maximum(object_area, 1e-9)
        return TrueFrame(depth, part, thing, area, mean_z, object_area, object_mean_z)


class Webcam:
    """Turns light into the pictures a webcam delivers; the same seed gives the same pictures."""

    def __init__(self, model: WebcamModel, lens: Lens, seed: int) -> None:
        self.model = model
        self._seed = seed
        x = (np.arange(lens.width) - lens.cx) / (lens.width / 2)
        y = (np.arange(lens.height) - lens.cy) / (lens.height / 2)
        fall = 1.0 - model.vignetting * (x[None, :] ** 2 + y[:, None] ** 2) / 2
        self._fall = fall[:, :, None].astype(np.float32)
        self._phases = np.random.default_rng((seed, 1)).uniform(0, 2 * math.pi, 2)

    def take(self, light: np.ndarray, t_s: float, seq: int) -> np.ndarray:
        """Picture (H, W, 3) uint8 BGR of the light at the sensor at one time."""
        return self.deliver(light, t_s, seq)[0]

    def deliver(self, light: np.ndarray, t_s: float, seq: int) -> tuple[np.ndarray, bytes | None]:
        """The same, and the JPEG it was decoded from, as it came over the cable; None where none did."""
        model = self.model
        swing = np.sin(2 * math.pi * t_s / np.array([11.0, 2.7]) + self._phases)
        gain = 1.0 + model.exposure_drift * float(0.75 * swing[0] + 0.25 * swing[1])
        signal = light * (np.float32(gain) * self._fall)
        variance = signal / np.float32(model.full_well) + np.float32(model.read_noise**2)
        if model.read_noise > 0 or math.isfinite(model.full_well):
            rng = np.random.default_rng((self._seed, 2, seq))
            signal = signal + np.sqrt(variance) * rng.standard_normal(signal.shape, dtype=np.float32)
        image = SCREEN[(np.clip(signal, 0.0, 1.0) * np.float32(65535) + np.float32(0.5)).astype(np.uint16)]
        if not model.jpeg_quality:
            return image, None
        _, data = cv2.imencode(".jpg", image, jpeg_options(model.jpeg_quality))
        return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR)), data.tobytes()


def jpeg_options(quality: int) -> list[int]:
    """OpenCV's parameters for a JPEG as webcams make it."""
    return [
        cv2.IMWRITE_JPEG_QUALITY, quality,
        cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420,
    ]  # fmt: skip


def _triple(a: ArrayLike) -> tuple[float, float, float]:
    x, y, z = np.asarray(a, float)
    return float(x), float(y), float(z)


@lru_cache(maxsize=8)
def _camera(lens: Lens) -> _render.Camera:
    """Where the pixels of a distorted lens lie takes as long as a picture to find out."""
    return _render.Camera(
        lens.fx, lens.fy, lens.cx, lens.cy, lens.width, lens.height, tuple(map(float, lens.distortion))
    )


def _material(material: Material) -> _render.Material:
    bgr = _triple(linear_of(np.array(material.rgb[::-1]) / 255.0))
    pattern = getattr(_render.Pattern, material.pattern)
    return _render.Material(pattern, bgr, material.contrast, material.scale_cm, material.seed, material.gloss)
