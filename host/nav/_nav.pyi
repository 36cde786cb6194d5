# What the map and the planner do cell by cell, documented in core/.
import numpy as np

class Front:
    def __init__(
        self,
        region: int,
        columns: np.ndarray,
        depth_cm: np.ndarray,
        sigma_cm: float,
        from_cm: float,
        to_cm: float,
        sure_cm: float,
        at_least: float,
        change: float,
        most: float,
        brief: bool,
    ) -> None: ...

class View:
    def __init__(
        self,
        x_cm: float,
        z_cm: float,
        sine: float,
        cosine: float,
        left: float,
        right: float,
        range_cm: float,
        fx: float,
        cx: float,
        rays: np.ndarray,
        pixels: np.ndarray,
        step_px: float,
    ) -> None: ...

class Floor:
    def __init__(
        self, free_cm: np.ndarray, floor_cm: np.ndarray, cut: np.ndarray, nearest_cm: float
    ) -> None: ...

class Rules:
    def __init__(
        self, seen_empty: float, looked_over: float, presumed: float, limit: float, cell_cm: float
    ) -> None: ...

def paint(
    evidence: np.ndarray,
    region: np.ndarray,
    brief: np.ndarray,
    centres_cm: np.ndarray,
    view: View,
    window: tuple[int, int, int, int],
    floor: Floor,
    fronts: list[Front],
    rules: Rules,
) -> None: ...
def columns(
    image: np.ndarray, kinds: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]: ...
def fill(
    points: np.ndarray,
    lengths: np.ndarray,
    kinds: np.ndarray,
    rows: int,
    cols: int,
    step: float,
    none: int,
) -> np.ndarray: ...
def feet(
    labels: np.ndarray,
    slopes: np.ndarray,
    ids: np.ndarray,
    nothing: int,
    ground: np.ndarray,
    foot: np.ndarray,
    height_cm: float,
    farthest_cm: float,
    sigma_slope: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]: ...
def stance(
    labels: np.ndarray,
    kind: int,
    slopes: np.ndarray,
    cut: np.ndarray,
    feet: np.ndarray,
    covered: np.ndarray,
    across: np.ndarray,
    height_cm: float,
    rms: float,
) -> tuple[float, float, bool, tuple[float, float] | None, np.ndarray | None, bool, float]: ...
def is_straight_wall(
    labels: np.ndarray,
    kind: int,
    slopes: np.ndarray,
    cut: np.ndarray,
    feet: np.ndarray,
    covered: np.ndarray,
    across: np.ndarray,
    height_cm: float,
) -> bool: ...
def tapers(
    labels: np.ndarray, kind: int, slopes: np.ndarray, cut: np.ndarray, feet: np.ndarray, covered: np.ndarray
) -> bool: ...
def totals(
    running: np.ndarray, starts: np.ndarray, ends: np.ndarray, owner: np.ndarray, kinds: int
) -> np.ndarray: ...
def colour_steps(colours: np.ndarray, window: int, light: float) -> np.ndarray: ...
def agreed(foot: np.ndarray, found: np.ndarray, search: int, agree_px: float) -> np.ndarray: ...
def meet(
    evidence: np.ndarray,
    centres_cm: np.ndarray,
    window: tuple[int, int, int, int],
    x_cm: float,
    z_cm: float,
    heading: float,
    radius_cm: float,
    wide_cm: float,
    kinds: tuple[float, float, float],
    half_cell_cm: float,
    reach_cm: float,
) -> tuple[float, float, float, int, int]: ...
def least_along(
    distances: np.ndarray,
    half_cm: float,
    cell_cm: float,
    start: tuple[float, float],
    end: tuple[float, float],
    from_cm: float,
) -> float: ...
def thinned(image: np.ndarray, step: int) -> np.ndarray: ...
def strips(image: np.ndarray, high: int, wide: int) -> np.ndarray: ...
def tile_means(image: np.ndarray, every: int, rows: int, across: int, down: int) -> np.ndarray: ...
def sharp_tiles(
    image: np.ndarray, every: int, step_px: int, wide_px: int, levels: int, across: int, down: int
) -> tuple[np.ndarray, np.ndarray]: ...
def compare_rows(image: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]: ...
def search(
    shut: np.ndarray, cost: np.ndarray, ahead: np.ndarray, there: np.ndarray, row: int, col: int
) -> np.ndarray: ...

class FootSight:
    t_s: float
    depth_cm: float
    left: tuple[float, float] | None
    right: tuple[float, float] | None
    ray: tuple[float, float]

def sight_of(
    owners: np.ndarray,
    slopes: np.ndarray,
    depth_cm: np.ndarray,
    cut: np.ndarray,
    across: np.ndarray,
    height_cm: float,
    eye: tuple[float, float],
    ahead: tuple[float, float],
    region: int,
    cut_part: float,
    sigma_ray: float,
    t_s: float,
) -> FootSight | None: ...

class Track:
    newest_s: float
    def __init__(self, first: FootSight) -> None: ...
    def see(self, now: FootSight) -> None: ...
    def velocity(self, known: bool) -> tuple[float, float] | None: ...
    def stands(self) -> bool: ...
