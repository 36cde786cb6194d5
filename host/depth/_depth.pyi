# The native depth engine, documented in core/; host/depth/estimator.py is its face.
from typing import Any

import numpy as np

class Estimator:
    def __init__(
        self,
        width: int,
        height: int,
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        distortion: tuple[float, ...],
        config: dict[str, Any],
    ) -> None: ...
    def update(
        self,
        ids: np.ndarray,
        area_px: np.ndarray,
        sigma_area_px: np.ndarray,
        touches_border: np.ndarray,
        rgb: np.ndarray,
        loops: np.ndarray,
        corners: np.ndarray,
        loop_size: np.ndarray,
        loop_region: np.ndarray,
        vertex_ids: np.ndarray,
        vertices: np.ndarray,
        vertex_sigma_px: np.ndarray,
        outline: np.ndarray,
        normals: np.ndarray,
        left: np.ndarray,
        right: np.ndarray,
        length_px: np.ndarray,
        changed: np.ndarray,
        rotation: np.ndarray,
        place: np.ndarray,
    ) -> dict[str, Any]: ...
