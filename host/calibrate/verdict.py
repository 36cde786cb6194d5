"""From views of the board to a lens, a verdict on it in words, and what is written of it."""

from __future__ import annotations

import math
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2

from host.calibrate.board import Board, read_board
from host.calibrate.intrinsics import NAMES, Solution, solve
from host.calibrate.views import CELLS_NEEDED, EACH_TILT, LEAST_VIEWS, Coverage
from host.calibrate.watch import Watched
from host.errors import InputError
from host.record.atomic import write_whole

BOARD_FILE = Path("target.json")
MOST_RMS_PX = 0.5  # at a width of 640
MOST_HELD_OUT = 1.3  # of the rms
MOST_FOCAL_SIGMA = 0.002  # relative
MOST_CENTRE_SIGMA = 0.0015  # of the width
LEAST_TILTS = 3  # of the four ways


@dataclass(frozen=True)
class LensCalibration:
    """All that was found."""

    watched: Watched
    solution: Solution
    faults: list[str]  # why it does not pass; none if it does

    @property
    def coverage(self) -> Coverage:
        """What the views cover."""
        return self.watched.coverage


def chosen_board(path: Path | None) -> Board:
    """The board that is meant: of a file, or the one `target` prints."""
    if path is None and not BOARD_FILE.is_file():
        return Board()
    return read_board(path or BOARD_FILE)


def calibrate(watched: Watched) -> LensCalibration:
    """From views to a lens and a verdict.

    Raises
    ------
    InputError
        The views are too few or too alike for any lens.
    """
    coverage = watched.coverage
    count = len(coverage.views)
    if count < LEAST_VIEWS:
        same = coverage.seen["same"]
        if same > 3 * count:
            raise InputError(
                f"all views alike: {same} of {sum(coverage.seen.values())} pictures show the board as "
                f"{count} others do, and {LEAST_VIEWS} different ones are needed; {coverage.missing()[0]}"
            )
        raise InputError(
            f"too few views: {count}, and at least {LEAST_VIEWS} are needed; {coverage.missing()[0]}"
        )
    solution = solve([view.corners for view in coverage.views], coverage.width, coverage.height)
    return LensCalibration(watched, solution, faults(coverage, solution))


def faults(coverage: Coverage, solution: Solution) -> list[str]:
    """Why a lens is not good enough to measure by, in words; nothing if it is."""
    out, lens, scale = [], solution.lens, max(1.0, coverage.width / 640)
    if solution.rms_px > MOST_RMS_PX * scale:
        out.append(
            f"corners lie {solution.rms_px:.2f} px from where the lens puts them, {MOST_RMS_PX * scale:.2f} "
            "are allowed: is the board flat and stiff, the camera in focus?"
        )
    if solution.held_out_px > MOST_HELD_OUT * solution.rms_px:
        out.append(
            f"views left out of the reckoning lie {solution.held_out_px:.2f} px off, the others "
            f"{solution.rms_px:.2f}: take more views"
        )
    tilted = sum(count >= EACH_TILT for count in coverage.tilts.values())
    if tilted < LEAST_TILTS:
        out.append(f"the board was tilted in {tilted} of 4 ways only: {coverage.missing()[0]}")
    if coverage.covered < CELLS_NEEDED:
        out.append(
            f"corners came to {100 * coverage.covered:.0f} % of the picture, {100 * CELLS_NEEDED:.0f} are "
            f"needed, fewest at: {coverage.bare_part()}"
        )
    focal = max(solution.sigmas[0] / lens.fx, solution.sigmas[1] / lens.fy)
    if focal > MOST_FOCAL_SIGMA:
        out.append(
            f"the focal length is known to {100 * focal:.2f} % only, {100 * MOST_FOCAL_SIGMA:g} is wanted: "
            "more views, and tilted further"
        )
    centre = float(solution.sigmas[2:4].max())
    if centre > MOST_CENTRE_SIGMA * coverage.width:
        out.append(
            f"the picture's centre is known to {centre:.1f} px only, "
            f"{MOST_CENTRE_SIGMA * coverage.width:.1f} are wanted: more views, and tilted further"
        )
    return out


def about(found: LensCalibration, uri: str) -> dict[str, Any]:
    """What camera.json says beside the lens."""
    solution, coverage = found.solution, found.coverage
    values = [round(float(sigma), 8) for sigma in solution.sigmas]
    return {
        "camera": uri,
        "camera_name": found.watched.camera_name,
        "calibrated": time.strftime("%Y-%m-%d %H:%M"),
        "board": asdict(coverage.board),
        "views": len(coverage.views),
        "corners": sum(len(view.corners.points) for view in coverage.views),
        "rms_px": round(solution.rms_px, 4),
        "held_out_px": None if math.isnan(solution.held_out_px) else round(solution.held_out_px, 4),
        "sigma": {**dict(zip(NAMES[:4], values[:4], strict=True)), "distortion": values[4:]},
        "covered": round(coverage.covered, 3),
    }


def write_picture(image: Any, path: Path) -> None:
    """As PNG."""
    write_whole(path, bytes(cv2.imencode(".png", image)[1]))


def show(found: LensCalibration, uri: str, out: Path, picture: Path) -> None:
    """One table, and what it means."""
    from rich.console import Console
    from rich.table import Table

    console = Console()
    if not console.is_terminal:
        console.width = 110
    lens, solution, coverage = found.solution.lens, found.solution, found.coverage
    console.print(f"lens of {uri}, {lens.width}x{lens.height} px", highlight=False, markup=False)
    table = Table()
    for name in ("", "value", "standard error"):
        table.add_column(name, justify="left" if not name else "right")
    for name, value, sigma in zip(
        NAMES, (lens.fx, lens.fy, lens.cx, lens.cy, *lens.distortion), solution.sigmas, strict=True
    ):
        digits = 2 if name in NAMES[:4] else 5
        error = f"± {sigma:.{digits}f}" if sigma else "held at 0"
        table.add_row(name, f"{value:.{digits}f}", error)
    console.print(table)
    console.print("\n".join(coverage.lines(advice=False)), highlight=False, markup=False)
    held_out = "" if math.isnan(solution.held_out_px) else f", {solution.held_out_px:.3f} in views left out"
    corners = sum(len(view.corners.points) for view in coverage.views)
    lines = [
        f"{len(coverage.views)} views, {corners} corners; they lie {solution.rms_px:.3f} px (rms) from where "
        f"the lens puts them{held_out}.",
        f"Coverage and what is left, as a picture: {picture}",
    ]
    if found.faults:
        lines += [f"Not good enough, nothing written: {fault}." for fault in found.faults]
    else:
        lines.append(f"Good: written to {out}. Use it with --lens {out}")
    for line in lines:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
