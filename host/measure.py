"""Depth from a recorded sequence: net and estimators run over a folder, answers as table, JSON and pictures.

    python -m host.measure SEQUENCE [--poses FILE] [--json OUT] [--pictures DIR]
    python -m host.measure run.mcap                       # a recorded drive, with its wheels' poses
    python -m host.measure --still IMAGE [--out DIR]      # the regions of one image, without depth

Results appear only when the whole sequence was measured; an interrupted or failed run leaves what was there.
"""

from __future__ import annotations

from host.errors import InputError, UsageError, begin_command, run_command

if __name__ == "__main__":
    begin_command()

import json
import math
import os
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Protocol

from tyro.conf import Positional, arg

from host.config import Config, read_command_line
from host.progress import progress

if TYPE_CHECKING:  # so that --help need not wait for OpenCV
    import numpy as np

    from host.depth.report import DepthReport, Estimate
    from host.pose import Pose
    from host.rbdn.snapshot import Region, Snapshot
    from host.record.sequence import Sequence, SequenceFrame

FEWEST_FRAMES = 2
RUNS = Path("runs")


@dataclass(frozen=True)
class MeasureOptions:
    """Measure depth in a sequence (camera.json, poses.csv, images) or a recording, or regions in a still."""

    sequence: Positional[Annotated[Path | None, arg(metavar="[SEQUENCE]")]] = None
    """the sequence folder, or run.mcap"""
    poses: Path | None = None  # poses to use instead of the folder's poses.csv
    json: Path | None = None  # write all results to this file
    pictures: Path | None = None  # write pictures of net, depths and vertices into this folder
    still: Path | None = None  # instead of a sequence: an image (PNG or JPEG) whose regions to find
    out: Path | None = None  # folder for the still's picture and JSON, runs if not given


class Tracker(Protocol):
    """What `host.rbdn.Net` does here."""

    def track(self, image: np.ndarray, rotation: np.ndarray | None = None) -> Snapshot: ...


class DepthEstimator(Protocol):
    """What `host.depth.estimator.Estimator` does here."""

    def update(self, snapshot: Snapshot, pose: Pose) -> DepthReport: ...


@dataclass(frozen=True)
class MeasuredFrame:
    """One frame with all that was made of it."""

    source: SequenceFrame
    image: np.ndarray  # (H, W, 3) uint8, BGR
    snapshot: Snapshot
    depths: DepthReport
    depth_ms: float
    total_ms: float  # image in memory to depths out

    def as_dict(self) -> dict[str, Any]:
        """The frame as the results file has it; null where nothing is known."""
        return {
            "frame": self.source.number,
            "t_s": self.source.pose.t_s,
            "time_ms": {
                "net": self.snapshot.net_ms,
                "refine": self.snapshot.refine_ms,
                "depth": self.depth_ms,
                "total": self.total_ms,
            },
            "limits": list(self.snapshot.limits),
            "regions": [_region_dict(region, self.depths) for region in self.snapshot.regions],
            "vertices": _vertex_dicts(self.snapshot, self.depths),
        }


def measure_sequence(sequence: Sequence, net: Tracker, estimator: DepthEstimator) -> Iterator[MeasuredFrame]:
    """Run net and depth over a sequence, a frame at a time.

    Parameters
    ----------
    sequence
        At least two frames: a single one has no motion.
    net, estimator
        Fresh ones, made for the sequence's lens.

    Raises
    ------
    InputError
        where the sequence is too short or an image turns out to be damaged.
    """
    if len(sequence.frames) < FEWEST_FRAMES:
        raise InputError(
            f"{sequence.folder}: only {len(sequence.frames)} frame; depth comes from motion, "
            f"record at least {FEWEST_FRAMES}"
        )
    before: Pose | None = None
    for index, frame in enumerate(sequence.frames):
        image = sequence.image(index)
        turned = None if before is None else frame.pose.relative_to(before)[0]
        before = frame.pose
        start = time.perf_counter()
        try:
            snapshot = net.track(image, turned)
        except InputError as error:  # the net does not know the image's name
            raise InputError(f"{frame.path}: {error}") from error
        tracked = time.perf_counter()
        depths = estimator.update(snapshot, frame.pose)
        done = time.perf_counter()
        yield MeasuredFrame(frame, image, snapshot, depths, 1e3 * (done - tracked), 1e3 * (done - start))


def result_dict(sequence: Sequence, frames: list[dict[str, Any]]) -> dict[str, Any]:
    """The results file; `frames` as `MeasuredFrame.as_dict` gives them."""
    return {"sequence": sequence.folder.resolve().name, "camera": asdict(sequence.lens), "frames": frames}


def run(options: MeasureOptions, config: Config) -> None:
    """Do what the options ask for.

    Raises
    ------
    UsageError
        where they contradict each other.
    """
    if options.still is None:
        if options.out is not None:
            raise UsageError("--out is for --still; use --json and --pictures with a sequence")
        if options.sequence is None:
            raise UsageError("nothing to measure: give a sequence folder, or --still and an image")
        run_sequence(options.sequence, options, config)
        return
    for name in ("sequence", "poses", "json", "pictures"):
        if getattr(options, name) is not None:
            raise UsageError(f"--still takes one image and --out; leave out {getattr(options, name)}")
    from host.still import run_still

    run_still(options.still, options.out or RUNS, config.net)


def run_sequence(folder: Path, options: MeasureOptions, config: Config) -> None:
    """Measure and write what the options ask for; all input is looked at before any output is touched."""
    from host.depth.estimator import Estimator
    from host.rbdn import Net
    from host.record.atomic import check_writable, write_whole
    from host.view.sequence_pictures import SequencePictures

    sequence = _open_sequence(folder, options.poses)
    if options.json is not None:
        check_writable(options.json, folder=False)
    if options.pictures is not None:
        check_writable(options.pictures, folder=True)
    _refuse_to_overwrite_input(options, sequence)
    pictures = None if options.pictures is None else SequencePictures(sequence, options.pictures)
    frames: list[dict[str, Any]] = []
    last: MeasuredFrame | None = None
    with progress("measuring", len(sequence.frames) * (1 if pictures is None else 2)) as advance:
        for last in measure_sequence(
            sequence, Net(config.net, sequence.lens), Estimator(sequence.lens, config.depth)
        ):
            frames.append(last.as_dict())
            if pictures is not None:
                pictures.add(last.snapshot, last.depths)
            advance()
        if pictures is not None:
            pictures.write(advance)
    if options.json is not None:
        text = json.dumps(result_dict(sequence, frames), allow_nan=False)
        write_whole(options.json, text.encode() + b"\n")
    if last is not None:
        _print_table(last, frames, options)


def _open_sequence(path: Path, poses: Path | None) -> Sequence:
    from host.record.sequence import read_sequence

    if path.suffix != ".mcap" or os.path.isdir(path):
        return read_sequence(path, _poses_file(path, poses))
    if poses is not None:
        raise UsageError(f"--poses {poses}: a recording brings its wheels' poses; leave it out")
    from host.record.recorded_sequence import read_recorded_sequence

    sequence = read_recorded_sequence(path)
    for note in sequence.notes:
        print(f"note: {note}", file=sys.stderr)
    return sequence


def _poses_file(folder: Path, poses: Path | None) -> Path | None:
    # os.path, since Path raises where a name is too long
    if poses is not None and not os.path.exists(poses) and os.path.isfile(folder / poses):
        raise InputError(f"{poses}: no such file; did you mean {folder / poses}?")
    return poses


def _refuse_to_overwrite_input(options: MeasureOptions, sequence: Sequence) -> None:
    images = [frame.path.resolve() for frame in sequence.frames]
    if options.pictures is not None and options.pictures.resolve() in {image.parent for image in images}:
        raise UsageError(f"{options.pictures}: holds the sequence's own images; write pictures elsewhere")
    poses = options.poses or sequence.folder / "poses.csv"
    inputs = {
        sequence.folder.resolve(),
        (sequence.folder / "camera.json").resolve(),
        poses.resolve(),
        *images,
    }
    if options.json is not None and options.json.resolve() in inputs:
        raise UsageError(f"{options.json}: belongs to the sequence and would be overwritten; write elsewhere")


def _number(value: float | None) -> float | None:
    return float(value) if value is not None and math.isfinite(value) else None


def _region_dict(region: Region, depths: DepthReport) -> dict[str, Any]:
    depth = depths.regions.get(region.id)
    known = depth is not None and depth.depth_cm is not None
    out: dict[str, Any] = {
        "id": region.id,
        "parent": region.parent,
        "area_px": region.area_px,
        "touches_border": region.touches_border,
        "mean_rgb": list(region.mean_rgb),
        "loops": [loop.tolist() for loop in region.loops],
        "depth_cm": _number(depth.depth_cm) if depth else None,
        "sigma_cm": _number(depth.sigma_cm) if depth else None,
        "method": depth.method if depth and known else None,
        "estimates": {
            method: _estimate_dict(estimate)
            for method, estimate in (depth.estimates if depth else {}).items()
        },
    }
    if depth and depth.silhouette_cm is not None:
        out["silhouette_cm"] = _number(depth.silhouette_cm)
    if depth and depth.slope is not None:
        out["slope"] = [_number(part) for part in depth.slope]
    if depth and depth.moving:
        out["moving"] = True
    note = depth.method_note if depth else "not estimated in this frame"
    if note is not None or not known:
        out["method_note"] = note or "the motion supports no depth yet"
    return out


def _estimate_dict(estimate: Estimate) -> dict[str, float | None]:
    out = {"depth_cm": _number(estimate.depth_cm), "sigma_cm": _number(estimate.sigma_cm)}
    if estimate.sensitivity is not None:
        out["sensitivity"] = _number(estimate.sensitivity)
    return out


def _vertex_dicts(snapshot: Snapshot, depths: DepthReport) -> list[dict[str, Any]]:
    found = depths.vertices
    row_of = {int(vertex): row for row, vertex in enumerate(found.ids)}
    out = []
    for vertex, (x_px, y_px) in zip(snapshot.vertices.ids, snapshot.vertices.xy_px, strict=True):
        row = row_of.get(int(vertex))
        x_cm, y_cm, z_cm = (None, None, None) if row is None else map(_number, found.xyz_cm[row])
        told: dict[str, Any] = {
            "id": int(vertex),
            "x_px": float(x_px),
            "y_px": float(y_px),
            "X_cm": x_cm,
            "Y_cm": y_cm,
            "Z_cm": z_cm,
            "sigma_cm": None if row is None else _number(found.sigma_cm[row]),
        }
        if row is not None and found.sensitivity is not None and math.isfinite(found.sensitivity[row]):
            told["sensitivity"] = float(found.sensitivity[row])
        out.append(told)
    return out


def _print_table(last: MeasuredFrame, frames: list[dict[str, Any]], options: MeasureOptions) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from host.view.palette import region_colour

    console = Console()
    if not console.is_terminal:
        console.width = 110
    table = Table(title=f"frame {last.source.number}, nearest first", title_justify="left")
    table.add_column("region", justify="right")
    for name in ("area px", "depth cm", "sigma cm"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("method")
    table.add_column("note", overflow="fold")
    regions = frames[-1]["regions"]
    for region in sorted(regions, key=lambda r: (r["depth_cm"] is None, r["depth_cm"] or 0, -r["area_px"])):
        blue, green, red = region_colour(region["id"])
        table.add_row(
            Text(str(region["id"]), style=f"rgb({red},{green},{blue})"),
            f"{region['area_px']:.0f}",
            _cell(region["depth_cm"]),
            _cell(region["sigma_cm"]),
            region["method"] or "-",
            region.get("method_note") or "",
        )
    console.print(table)
    times = sorted(frame["time_ms"]["total"] for frame in frames)
    known = sum(region["depth_cm"] is not None for region in regions)
    console.print(
        f"{len(frames)} frames, {times[len(times) // 2]:.1f} ms each (median); "
        f"{known} of {len(regions)} regions have a depth at the end",
        highlight=False,
    )
    for limit, count in Counter(limit for frame in frames for limit in frame["limits"]).items():
        console.print(f"in {count} of {len(frames)} frames: {limit}", highlight=False)
    for what, place in (("results", options.json), ("pictures", options.pictures)):
        if place is not None:
            console.print(f"{what}: {place}", highlight=False, soft_wrap=True, markup=False)


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def main() -> None:
    """The command."""
    options, config = read_command_line(MeasureOptions)
    run(options, config)


if __name__ == "__main__":
    run_command(main)
