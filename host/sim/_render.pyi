# The native renderer, documented in render_core; host/sim/render.py is its face.
from collections.abc import Sequence
from enum import Enum

import numpy as np

Triple = tuple[float, float, float]

class Pattern(Enum):
    plain = 0
    wood = 1
    tiles = 2

class Material:
    def __init__(
        self, pattern: Pattern, bgr: Triple, contrast: float, scale_cm: float, seed: int, gloss: float
    ) -> None: ...

class Camera:
    def __init__(
        self,
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        width: int,
        height: int,
        distortion: Sequence[float] = ...,
    ) -> None: ...

class Scene:
    def __init__(self, floor_y: float) -> None: ...
    def light(self, lamp: Triple, ambient: float, sky: float, direct: float, reference_cm: float) -> None: ...
    def quad(
        self,
        corner: Triple,
        u: Triple,
        v: Triple,
        normal: Triple,
        object: int,
        part: int,
        material: Material,
        shadowed: bool,
    ) -> None: ...
    def disc(
        self,
        centre: Triple,
        radius: float,
        object: int,
        part: int,
        material: Material,
        faces_down: bool = False,
    ) -> None: ...
    def ellipsoid(
        self, centre: Triple, u: Triple, v: Triple, w: Triple, object: int, part: int, material: Material
    ) -> None: ...
    def cone(
        self,
        base: Triple,
        radius: float,
        top_radius: float,
        height: float,
        object: int,
        part: int,
        material: Material,
    ) -> None: ...
    def round_occluder(self, x: float, z: float, radius: float, height: float, base: float) -> None: ...
    def box_occluder(
        self,
        x: float,
        z: float,
        half_u: float,
        half_v: float,
        yaw: float,
        height: float,
        base: float,
    ) -> None: ...
    def render(
        self, camera: Camera, rotations: np.ndarray, positions: np.ndarray, psf_px: float
    ) -> np.ndarray: ...
    def truth(
        self, camera: Camera, rotation: np.ndarray, position: np.ndarray, areas: bool = True
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]: ...
