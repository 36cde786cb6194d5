"""The floor from above: where the robot went, where it wanted to go and what it knows to stand there."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np

from host.view.palette import INK, MUTED, PAPER, Colour, depth_text, region_colour, text_size, write

SUBPIXEL_BITS = 4
LARGEST_PX = 900  # longer side of the plan
MARGIN_CM = 25.0
LEGEND_PX = 190
GRID: Colour = (232, 229, 225)
GRID_AXIS: Colour = (205, 200, 195)
FREE: Colour = (236, 243, 234)
OCCUPIED: Colour = (196, 200, 222)
PATH: Colour = (176, 108, 40)
ROBOT: Colour = (201, 163, 120)
GOAL: Colour = (88, 140, 60)
SCALE = 0.5


@dataclass(frozen=True)
class FloorObstacle:
    """A thing as seen on the floor."""

    region: int
    ends_cm: np.ndarray  # (2, 2): x, z of its left and right end
    depth_cm: float
    sigma_cm: float | None


@dataclass(frozen=True)
class Floor:
    """What the plan shows, in cm of the world: x to the right, z ahead (up in the picture)."""

    path_cm: np.ndarray  # (N, 2) x, z of the robot's middle, N >= 1
    heading_rad: float  # at the end of the path, positive to the right
    robot_radius_cm: float
    goal_cm: tuple[float, float] | None = None
    obstacles: tuple[FloorObstacle, ...] = ()
    occupied_cm: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))  # (M, 2) middles of map cells
    free_cm: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))  # (K, 2) likewise, seen to be empty
    cell_cm: float = 5.0


def draw_floor(floor: Floor, caption: str = "") -> np.ndarray:
    """Draw the plan, (H, W, 3) uint8, BGR, with a legend at its right."""
    plan = _Plan(floor)
    plan.cells(floor.free_cm, floor.cell_cm, FREE)
    plan.cells(floor.occupied_cm, floor.cell_cm, OCCUPIED)
    plan.grid()
    for obstacle in floor.obstacles:
        plan.line(obstacle.ends_cm, region_colour(obstacle.region), 4)
    plan.line(floor.path_cm, PATH, 2)
    plan.disc(floor.path_cm[0], 2.0, PATH)
    if floor.goal_cm is not None:
        plan.cross(np.array(floor.goal_cm), GOAL)
    plan.robot(floor.path_cm[-1], floor.heading_rad, floor.robot_radius_cm)
    plan.obstacle_labels(floor.obstacles)
    return plan.with_legend(floor, caption)


class _Plan:
    """A canvas that takes cm."""

    def __init__(self, floor: Floor) -> None:
        shown = [
            floor.path_cm - floor.robot_radius_cm,
            floor.path_cm + floor.robot_radius_cm,
            floor.occupied_cm,
        ]
        shown += [obstacle.ends_cm for obstacle in floor.obstacles]
        if floor.goal_cm is not None:
            shown.append(np.array([floor.goal_cm]))
        every = np.vstack(shown)
        self.low = every.min(axis=0) - MARGIN_CM
        self.high = every.max(axis=0) + MARGIN_CM
        side = self.high - self.low
        least = 0.5 * side.max()  # a straight drive would leave a strip too thin for its labels
        widen = np.maximum(least - side, 0) / 2
        self.low, self.high = self.low - widen, self.high + widen
        self.px_per_cm = LARGEST_PX / (self.high - self.low).max()
        width, height = np.ceil((self.high - self.low) * self.px_per_cm).astype(int)
        self.canvas = np.full((int(height), int(width), 3), PAPER, np.uint8)

    def at(self, points_cm: np.ndarray) -> np.ndarray:
        """(N, 2) cm to fixed-point pixels (N, 2)."""
        x, z = np.atleast_2d(points_cm).T
        pixels = np.column_stack([x - self.low[0], self.high[1] - z]) * self.px_per_cm
        return np.round(pixels * (1 << SUBPIXEL_BITS)).astype(np.int32)

    def whole(self, point_cm: np.ndarray) -> tuple[int, int]:
        x, y = self.at(point_cm)[0] >> SUBPIXEL_BITS
        return int(x), int(y)

    def grid(self) -> None:
        step = next(s for s in (10, 20, 50, 100, 200, 500, 1000, 10**9) if s * self.px_per_cm >= 45)
        for axis, (low, high) in enumerate(zip(self.low, self.high, strict=True)):
            for value in range(math.ceil(low / step) * step, math.floor(high) + 1, step):
                ends = np.array([self.low, self.high])
                ends[:, axis] = value
                self.line(ends, GRID if value else GRID_AXIS, 1)
                x, y = self.whole(ends[0])
                text = f"{value}" if value or axis else "0 cm"
                if axis == 0:
                    write(self.canvas, text, (x + 4, self.canvas.shape[0] - 6), 0.8 * SCALE, MUTED)
                else:
                    write(self.canvas, text, (4, y - 4), 0.8 * SCALE, MUTED)

    def cells(self, middles_cm: np.ndarray, side_cm: float, colour: Colour) -> None:
        for middle in middles_cm:
            corner = middle + side_cm / 2 * np.array([-1, 1])
            (x0, y0), (x1, y1) = self.whole(corner), self.whole(middle - side_cm / 2 * np.array([-1, 1]))
            self.canvas[max(y0, 0) : max(y1, 0), max(x0, 0) : max(x1, 0)] = colour

    def line(self, points_cm: np.ndarray, colour: Colour, width: int) -> None:
        points = self.at(points_cm).reshape(-1, 1, 2)
        cv2.polylines(self.canvas, [points], False, colour, width, cv2.LINE_AA, SUBPIXEL_BITS)

    def disc(self, middle_cm: np.ndarray, radius_cm: float, colour: Colour, width: int = -1) -> None:
        x, y = (int(v) for v in self.at(middle_cm)[0])
        radius = round(radius_cm * self.px_per_cm * (1 << SUBPIXEL_BITS))
        cv2.circle(self.canvas, (x, y), radius, colour, width, cv2.LINE_AA, SUBPIXEL_BITS)

    def cross(self, middle_cm: np.ndarray, colour: Colour) -> None:
        cv2.drawMarker(
            self.canvas, self.whole(middle_cm), colour, cv2.MARKER_TILTED_CROSS, 16, 2, cv2.LINE_AA
        )

    def robot(self, middle_cm: np.ndarray, heading_rad: float, radius_cm: float) -> None:
        below = self.canvas.copy()
        self.disc(middle_cm, radius_cm, ROBOT)
        cv2.addWeighted(self.canvas, 0.55, below, 0.45, 0, dst=self.canvas)
        self.disc(middle_cm, radius_cm, PATH, 2)
        nose = middle_cm + radius_cm * np.array([math.sin(heading_rad), math.cos(heading_rad)])
        self.line(np.array([middle_cm, nose]), PATH, 2)

    def obstacle_labels(self, obstacles: tuple[FloorObstacle, ...]) -> None:
        taken: list[tuple[int, int, int, int]] = []
        for obstacle in obstacles:
            text = str(obstacle.region)
            width, height = text_size(text, 0.9 * SCALE)
            x, y = self.whole(obstacle.ends_cm.mean(axis=0))
            box = (x - width // 2, y - 8 - height, x + width // 2, y - 8)
            if any(box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3] for b in taken):
                continue
            taken.append(box)
            write(self.canvas, text, (box[0], box[3]), 0.9 * SCALE, INK)

    def with_legend(self, floor: Floor, caption: str) -> np.ndarray:
        """The plan with a column at its right that says what is what."""
        height = max(self.canvas.shape[0], 260)
        column = np.full((height, LEGEND_PX, 3), 255, np.uint8)
        rows: list[tuple[Colour, str]] = [(PATH, "way driven"), (ROBOT, "robot")]
        if floor.goal_cm is not None:
            rows.append((GOAL, "goal"))
        if len(floor.occupied_cm):
            rows.append((OCCUPIED, "taken"))
        if len(floor.free_cm):
            rows.append((FREE, "seen free"))
        y = 30
        for colour, text in rows:
            cv2.rectangle(column, (14, y - 11), (30, y + 1), colour, -1)
            cv2.rectangle(column, (14, y - 11), (30, y + 1), MUTED, 1, cv2.LINE_AA)
            write(column, text, (40, y), SCALE, INK)
            y += 24
        if floor.obstacles:
            y += 14
            write(column, "regions, as seen", (14, y), SCALE, MUTED)
            y += 24
        for k, obstacle in enumerate(floor.obstacles):
            if y > height - 40 and k + 1 < len(floor.obstacles):
                write(column, f"and {len(floor.obstacles) - k} more", (14, y), SCALE, MUTED)
                break
            cv2.rectangle(column, (14, y - 7), (30, y - 3), region_colour(obstacle.region), -1)
            text = f"{obstacle.region}: {depth_text(obstacle.depth_cm, obstacle.sigma_cm)}"
            write(column, text, (40, y), 0.9 * SCALE, INK)
            y += 22
        padded = np.full((height, self.canvas.shape[1], 3), PAPER, np.uint8)
        padded[: self.canvas.shape[0]] = self.canvas
        picture = np.hstack([padded, column])
        if not caption:
            return picture
        bar = np.full((36, picture.shape[1], 3), 255, np.uint8)
        write(bar, caption, (12, 24), 1.1 * SCALE, INK)
        return np.vstack([bar, picture])
