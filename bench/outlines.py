"""How well areas and corners are measured, beside what the noise allows.

    python -m bench.outlines [--json FILE] [--scenes N]

Boxes, turned boxes and ellipses on one colour, blurred by the lens, with edges of exact coverage. The
Cramer-Rao bound is that of an outline known but for its offset. `light` scenes mix colours on edges in linear
light, as cameras do; `values` scenes mix the encoded numbers, as drawing programs do. Nothing passes or fails
here.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from math import erf, hypot, pi, sqrt
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from bench.figures_file import check_json, write_json
from bench.options import at_least
from host.config import read_options
from host.errors import run_command
from host.rbdn import Net, Region, Snapshot

WIDTH, HEIGHT = 320, 240
BLUR_PX = 0.7
NOISES = (2.0, 4.0, 8.0)
KINDS = ("box", "turned box", "ellipse")
MIXINGS = ("light", "values")
LEAST_CONTRAST = 90.0  # RGB Euclidean, between a shape and the ground
LEAST_HUE_CONTRAST = 60.0  # the part of it that is not a change of lightness, which the net discounts
CELLS_PER_PX = 24  # of the integral over a shape's height
LOST_SHARE = 0.1  # a region whose area is farther off than this is another region
CORNER_REACH_PX = 3.0


@dataclass(frozen=True)
class Options:
    """Measure random shapes and print bias, spread and honesty of the figures."""

    json: Path | None = None
    """Also write the figures to this file."""
    scenes: int = 40
    """Scenes of two shapes for every kind of shape, noise and mixing."""


@dataclass(frozen=True)
class Shape:
    """A box or an ellipse. Pixels, integer = pixel centre."""

    centre: tuple[float, float]
    half: tuple[float, float]
    turn_rad: float
    round: bool
    rgb: tuple[float, float, float]

    @property
    def area_px(self) -> float:
        """Exact area."""
        return (pi if self.round else 4.0) * self.half[0] * self.half[1]

    @property
    def perimeter_px(self) -> float:
        """Length of the outline."""
        a, b = self.half
        if not self.round:
            return 4 * (a + b)
        h = ((a - b) / (a + b)) ** 2
        return pi * (a + b) * (1 + 3 * h / (10 + sqrt(4 - 3 * h)))  # Ramanujan

    def corners(self) -> np.ndarray:
        """(4, 2) corners of a box; (0, 2) for an ellipse."""
        if self.round:
            return np.zeros((0, 2))
        signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        c, s = np.cos(self.turn_rad), np.sin(self.turn_rad)
        return np.array(self.centre) + (signs * self.half) @ np.array([[c, s], [-s, c]])

    def chords(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The shape as thin slices.

        Returns
        -------
        edges
            (N+1,) y of the borders between slices.
        left, right
            (N,) x where the middle of every slice begins and ends.
        """
        c, s = np.cos(self.turn_rad), np.sin(self.turn_rad)
        (a, b), (cx, cy) = self.half, self.centre
        if self.round:
            tall = hypot(a * s, b * c)
            count = int(2 * tall * CELLS_PER_PX)
            edges = -tall * np.cos(np.linspace(0, pi, count + 1))  # finer where the chord changes fast
            y = (edges[1:] + edges[:-1]) / 2
            middle = y * (a * a - b * b) * c * s / tall**2
            reach = a * b / tall**2 * np.sqrt(tall**2 - y * y)
            return cy + edges, cx + middle - reach, cx + middle + reach
        corners = self.corners()
        stops = np.unique(corners[:, 1].round(9))
        edges = np.concatenate(
            [
                np.linspace(lo, hi, max(1, int((hi - lo) * CELLS_PER_PX)), endpoint=False)
                for lo, hi in pairwise(stops)
            ]
            + [stops[-1:]]
        )
        y = (edges[1:] + edges[:-1]) / 2
        at = np.empty((4, len(y)))
        for k, (p, q) in enumerate(zip(corners, np.roll(corners, -1, 0), strict=True)):
            spans = (p[1] > y) != (q[1] > y)
            at[k] = np.where(spans, p[0] + (y - p[1]) / (q[1] - p[1] + 1e-300) * (q[0] - p[0]), np.nan)
        return edges, np.nanmin(at, 0), np.nanmax(at, 0)


def coverage(shape: Shape, width: int, height: int, blur_px: float) -> np.ndarray:
    """(H, W) share of every pixel that the shape covers, seen through a Gaussian blur."""
    edges, left, right = shape.chords()
    across = _ramp(np.arange(width)[None, :] - left[:, None], blur_px)
    across -= _ramp(np.arange(width)[None, :] - right[:, None], blur_px)
    step = _ramp(np.arange(height)[:, None] - edges[None, :], blur_px)
    return (step[:, :-1] - step[:, 1:]) @ across


@dataclass(frozen=True)
class Scene:
    """Shapes that do not touch, on a ground of one colour."""

    shapes: tuple[Shape, ...]
    ground_rgb: tuple[float, float, float]
    mixing: str  # one of MIXINGS
    blur_px: float = BLUR_PX

    def draw(self, noise: float, seed: int) -> np.ndarray:
        """(H, W, 3) uint8, BGR, with Gaussian noise."""
        decode, encode = (_decoded, _encoded) if self.mixing == "light" else (np.asarray, np.asarray)
        image = np.broadcast_to(decode(self.ground_rgb), (HEIGHT, WIDTH, 3)).astype(float)
        for shape in self.shapes:
            share = coverage(shape, WIDTH, HEIGHT, self.blur_px)[:, :, None]
            image += share * (decode(shape.rgb) - image)
        noisy = encode(image) + np.random.default_rng(seed).normal(0, noise, image.shape)
        return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)[:, :, ::-1].copy()

    def bound_px(self, shape: Shape, noise: float) -> float:
        """Cramer-Rao bound of the shape's area.

        Where numbers are mixed it is that of notes, (sigma^2 + 1/12) / |d|^2 * 2 sqrt(pi) b * perimeter with
        b^2 = blur^2 + 1/12; mixing light changes the steepness of the step.
        """
        b = sqrt(self.blur_px**2 + 1 / 12)
        s = np.linspace(-6 * b, 6 * b, 2001)
        mix = _gauss_integral(s / b)[:, None]
        inside, outside = np.asarray(shape.rgb, float), np.asarray(self.ground_rgb, float)
        if self.mixing == "light":
            profile = _encoded(_decoded(outside) + mix * (_decoded(inside) - _decoded(outside)))
        else:
            profile = outside + mix * (inside - outside)
        steepness = (np.gradient(profile, s, axis=0) ** 2).sum() * (s[1] - s[0])
        return sqrt((noise**2 + 1 / 12) * shape.perimeter_px / steepness)


def random_scene(kind: str, mixing: str, seed: int) -> Scene:
    """Two shapes of one kind, side by side, in colours that differ in hue from the ground."""
    rng = np.random.default_rng(seed)
    ground = rng.uniform(30, 225, 3)
    shapes = []
    for cx in (WIDTH / 4, 3 * WIDTH / 4):
        round_, turned = kind == "ellipse", kind != "box"
        half = rng.uniform(20, 46, 2)
        centre = (cx + rng.uniform(-10, 10), HEIGHT / 2 + rng.uniform(-25, 25))
        colour = _other_colour(rng, ground)
        shapes.append(
            Shape(centre, tuple(half), rng.uniform(0.05, 1.5) if turned else 0.0, round_, tuple(colour))
        )
    return Scene(tuple(shapes), tuple(ground), mixing)


@dataclass
class Tally:
    """Errors of one kind of shape at one noise."""

    area_errors_px: list[float] = field(default_factory=list)
    bounds_px: list[float] = field(default_factory=list)
    area_sigmas_px: list[float] = field(default_factory=list)
    corner_errors_px: list[float] = field(default_factory=list)
    corner_sigmas_px: list[float] = field(default_factory=list)
    lost: int = 0
    corners_lost: int = 0

    def add(self, scene: Scene, snapshot: Snapshot, noise: float) -> None:
        """Compare what was found with what was drawn."""
        for shape in scene.shapes:
            region = region_at(snapshot, *shape.centre)
            if abs(region.area_px / shape.area_px - 1) > LOST_SHARE:
                self.lost += 1
                continue
            self.area_errors_px.append(region.area_px - shape.area_px)
            self.area_sigmas_px.append(region.sigma_area_px)
            self.bounds_px.append(scene.bound_px(shape, noise))
            for corner in shape.corners():
                self._add_corner(corner, snapshot)

    def _add_corner(self, corner: np.ndarray, snapshot: Snapshot) -> None:
        sharp = np.isfinite(snapshot.vertices.sigma_px)
        offset = snapshot.vertices.xy_px[sharp] - corner
        nearest = int(np.argmin(np.hypot(*offset.T))) if len(offset) else -1
        if nearest < 0 or np.hypot(*offset[nearest]) > CORNER_REACH_PX:
            self.corners_lost += 1
            return
        self.corner_errors_px.append(float(np.hypot(*offset[nearest])))
        self.corner_sigmas_px.append(float(snapshot.vertices.sigma_px[sharp][nearest]))

    def figures(self) -> dict[str, float | int | None]:
        """Bias, spread and honesty, ready for printing or JSON; None where nothing was measured."""
        error, bound, sigma = map(np.array, (self.area_errors_px, self.bounds_px, self.area_sigmas_px))
        if len(error) < 2:
            return {"regions": len(error), "lost": self.lost}
        corner, corner_sigma = np.array(self.corner_errors_px), np.array(self.corner_sigmas_px)
        out: dict[str, float | int | None] = {
            "regions": len(error),
            "lost": self.lost,
            "bias_px": float(error.mean()),
            "bias_error_px": float(error.std() / sqrt(len(error))),
            "spread_px": float(error.std()),
            "spread_over_bound": float((error / bound).std()),
            "within_1_sigma": float((abs(error) < sigma).mean()),
            "within_2_sigma": float((abs(error) < 1.96 * sigma).mean()),
        }
        if len(corner):
            # 2.45 sigma hold 95 % of distances in the plane; sigma is that of the worst direction
            out |= {
                "corner_rms_px": float(np.sqrt((corner**2).mean())),
                "corner_sigma_px": float(np.sqrt((corner_sigma**2).mean())),
                "corners_within_95_percent": float((corner < 2.45 * corner_sigma).mean()),
                "corners_lost": self.corners_lost,
            }
        return out


def region_at(snapshot: Snapshot, x: float, y: float) -> Region:
    """The region whose loops hold a point, by even-odd crossing count."""
    for region in snapshot.regions:
        inside = False
        for loop in region.loops:
            nxt = np.roll(loop, -1, 0)
            spans = (loop[:, 1] > y) != (nxt[:, 1] > y)
            with np.errstate(divide="ignore", invalid="ignore"):
                at = loop[:, 0] + (y - loop[:, 1]) / (nxt[:, 1] - loop[:, 1]) * (nxt[:, 0] - loop[:, 0])
            inside ^= bool((spans & (at > x)).sum() % 2)
        if inside:
            return region
    raise AssertionError(f"no region at {x}, {y}")


def measure(kind: str, mixing: str, noise: float, scenes: int) -> Tally:
    """A new net on every scene."""
    tally = Tally()
    for seed in range(scenes):
        scene = random_scene(kind, mixing, seed)
        tally.add(scene, Net().track(scene.draw(noise, seed)), noise)
    return tally


def _other_colour(rng: np.random.Generator, ground: np.ndarray) -> np.ndarray:
    while True:
        colour = rng.uniform(20, 235, 3)
        difference = colour - ground
        hue = difference - difference.mean()
        if np.linalg.norm(difference) > LEAST_CONTRAST and np.linalg.norm(hue) > LEAST_HUE_CONTRAST:
            return colour


_GRID = np.linspace(-8, 8, 16001)
_ERF = np.array([erf(v / sqrt(2)) for v in _GRID])


def _gauss_integral(u: np.ndarray) -> np.ndarray:
    return 0.5 * (1 + np.interp(u, _GRID, _ERF))


def _ramp(distance: np.ndarray, blur_px: float) -> np.ndarray:
    """Share of a unit pixel at `distance` beyond an edge that is past it, through the blur."""

    def integral(x: np.ndarray) -> np.ndarray:
        u = x / blur_px
        return x * _gauss_integral(u) + blur_px * np.exp(-0.5 * u * u) / sqrt(2 * pi)

    return integral(distance + 0.5) - integral(distance - 0.5)


def _decoded(srgb) -> np.ndarray:
    s = np.asarray(srgb, float) / 255
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)


def _encoded(light: np.ndarray) -> np.ndarray:
    light = np.maximum(light, 0)
    return 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def table_of(mixing: str, results: dict[tuple[str, float], dict]) -> Table:
    """One row for each kind of shape and noise."""
    table = Table(title=f"Flat scenes that mix {mixing}, {WIDTH}x{HEIGHT}, blur {BLUR_PX} px, a new net each")
    for heading in ("shape", "noise", "lost"):
        table.add_column(heading)
    for heading in ("bias px", "spread px", "x bound", "in 1, 1.96 s", "corner px", "in 95 %"):
        table.add_column(heading, justify="right")
    for (kind, noise), f in results.items():
        row = [kind, f"{noise:.0f}", f"{f['lost']} of {f['lost'] + f['regions']}"]
        if "bias_px" in f:
            row += [
                f"{f['bias_px']:+.2f}+-{f['bias_error_px']:.2f}",
                f"{f['spread_px']:.2f}",
                f"{f['spread_over_bound']:.2f}",
                f"{100 * f['within_1_sigma']:.0f}, {100 * f['within_2_sigma']:.0f} %",
            ]
        if "corner_rms_px" in f:
            row += [f"{f['corner_rms_px']:.3f}", f"{100 * f['corners_within_95_percent']:.0f} %"]
        table.add_row(*row)
    return table


def main() -> None:
    """Measure, print the table, and write it as JSON if asked to."""
    options = read_options(Options)
    check_json(options.json)
    at_least("scenes", options.scenes, 1)
    console = Console(width=110)
    document = []
    for mixing in MIXINGS:
        results = {
            (kind, noise): measure(kind, mixing, noise, options.scenes).figures()
            for kind in KINDS
            for noise in NOISES
        }
        console.print(table_of(mixing, results))
        for (kind, noise), figures in results.items():
            document.append({"mixing": mixing, "shape": kind, "noise": noise, **figures})
    write_json(options.json, document)


if __name__ == "__main__":
    run_command(main)
