"""A recorded drive for the Rerun viewer: camera with net and depths, map, plots and events on one time line.

    python -m host.view.rerun run.mcap [--out FILE.rrd]
    rerun run.rrd

Net, depths and map are made again from the recording, as host.replay does. Needs the extra ``viz``.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in the drive: threads add in another order

from host.errors import InputError, UsageError, begin_command, run_command

if __name__ == "__main__":
    begin_command()

import itertools
import shutil
import sys
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from host.config import read_options
from host.progress import progress

if TYPE_CHECKING:  # so that --help need not wait for OpenCV and Rerun
    import numpy as np
    import rerun

    from host.nav.map import ObstacleMap
    from host.nav.pilot import View
    from host.record.mcap_reader import Recording
    from host.record.replayed import Step, Tally

ROOM_SHARE, ROOM_BYTES = 2.0, 5e6  # of the size of the recording, and besides: enough
MAP_EVERY = 3  # pictures; the map changes slowly
MOST_SERIES = 12  # regions whose depth is drawn over time: those seen most often
LEVELS = {20: "INFO", 30: "WARN", 40: "ERROR"}
FREE, FILLED, WAY = (70, 110, 90), (230, 120, 60), (250, 210, 80)
ROBOT, GOAL = (90, 170, 255), (120, 230, 120)
COLOURS = ((250, 210, 80), (90, 170, 255), (240, 130, 170), (120, 220, 140), (200, 160, 250))  # of plots


@dataclass(frozen=True)
class Options:
    """Make a file for the Rerun viewer of a recorded drive."""

    recording: Positional[Annotated[Path, arg(metavar="RECORDING")]]  # made with nav_loop --record
    out: Path | None = None  # file to write, run.rrd beside run.mcap if not given


def main() -> None:
    """The command."""
    options = read_options(Options)
    import_rerun()
    from host.record.atomic import check_writable
    from host.record.mcap_reader import Recording

    recording = Recording(options.recording)
    out = options.out or options.recording.with_suffix(".rrd")
    check_writable(out, folder=False, beside=(options.recording,))
    if recording.note is not None:
        print(f"note: {recording.note}", file=sys.stderr)
    tally = write_rerun(recording, out)
    for note in tally.notes:
        print(f"note: {note}", file=sys.stderr)
    if not tally.same:
        print(f"note: shown is what the program makes of it now; it differs first in {tally.first}")
    print(f"{tally.pictures} pictures: {out}; see it with: rerun {out}")


def import_rerun() -> Any:
    """The module; UsageError with the command that installs it."""
    try:
        import rerun
    except ImportError:
        raise UsageError(
            "rerun-sdk not found, which writes files for the Rerun viewer: .venv/bin/pip install -e '.[viz]'"
        ) from None
    return rerun


def write_rerun(recording: Recording, out: Path) -> Tally:
    """Make a recorded drive again and write it for the viewer, with the views laid out.

    Raises
    ------
    InputError
        There is nothing in it to be seen.
    """
    from host.record.replayed import Tally, replay

    rr = import_rerun()
    draft = out.with_name(f".{out.name}.part")
    stream = rr.RecordingStream("rbdn-robot", recording_id=recording.begin.get("started"))
    stream.set_log_time_enabled(False)  # when this was made is nothing to look at
    tally = Tally()
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        _check_room(recording.path, out)
        stream.save(draft, default_blueprint=_blueprint())
        scene = _Scene(stream, recording)
        with progress("replaying", recording.frame_count) as advance:
            for step in replay(recording, None, tally):
                tally.count(step)
                if step.view is not None:
                    scene.add(step, step.view)
                    advance()
        if tally.pictures == 0:
            raise InputError(f"{recording.path}: no picture in it was driven on; there is nothing to show")
        scene.finish()
        stream.flush()
        stream.disconnect()
        os.replace(draft, out)
    except OSError as error:
        raise UsageError(f"{out}: cannot be written ({error.strerror}); choose another place") from None
    finally:
        draft.unlink(missing_ok=True)
    return tally


def _check_room(recording: Path, out: Path) -> None:
    """Rerun's writer waits for ever where the disk is full, so it must not come to that."""
    needed = ROOM_SHARE * recording.stat().st_size + ROOM_BYTES
    free = shutil.disk_usage(out.parent).free
    if free < needed:
        raise UsageError(
            f"{out}: takes up to {needed / 1e6:.0f} MB and {free / 1e6:.0f} are free there; "
            "delete something, or name another disk with --out"
        )


def _blueprint() -> Any:
    import rerun.blueprint as rrb

    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Spatial2DView(origin="/camera", name="camera, net and depths"),
                rrb.TextLogView(origin="/events", name="events"),
                row_shares=[3, 1],
            ),
            rrb.Spatial2DView(origin="/map", name="map from above, cm"),
            rrb.Vertical(
                rrb.TimeSeriesView(origin="/depth", name="depth of regions, cm"),
                rrb.TimeSeriesView(origin="/speed", name="speed, cm/s"),
                rrb.TimeSeriesView(origin="/latency", name="time, ms"),
            ),
            column_shares=[4, 3, 3],
        ),
        collapse_panels=True,
    )


@dataclass
class _Series:
    """Numbers over time."""

    times_s: list[float] = field(default_factory=list)
    values: list[float] = field(default_factory=list)


class _Scene:
    """What is put into the stream, picture by picture, and at the end what runs through all of them."""

    def __init__(self, stream: rerun.RecordingStream, recording: Recording) -> None:
        self._rr = import_rerun()
        self._stream, self._recording = stream, recording
        self._ahead_cm = recording.config.body.camera_ahead_cm
        self._radius_cm = recording.config.body.radius_cm
        self._depths: dict[int, _Series] = defaultdict(_Series)
        self._path: list[tuple[float, float]] = []
        self._pictures = 0

    def add(self, step: Step, view: View) -> None:
        """One picture and all that was made of it."""
        rr, stream = self._rr, self._stream
        stream.set_time("time", duration=step.t_s)
        stream.set_time("picture", sequence=step.frame)
        self._camera(view)
        self._robot(view)
        if self._pictures % MAP_EVERY == 0:
            self._map(step.map)
        for region, depth in view.depths.regions.items():
            if depth.depth_cm is not None:
                self._depths[region].times_s.append(step.t_s)
                self._depths[region].values.append(depth.depth_cm)
        if step.differences:
            stream.log("/events/replay", rr.TextLog(str(step.differences[0]), level="WARN"))
        self._pictures += 1

    def _camera(self, view: View) -> None:
        from host.view.palette import depth_text, region_colour

        rr, stream = self._rr, self._stream
        file, kind = view.frame.encoded, "image/jpeg"
        if file is None:
            file, kind = _png(view.frame.image), "image/png"
        stream.log("/camera/image", rr.EncodedImage(contents=file, media_type=kind, draw_order=-1.0))
        strips, colours, places, labels = [], [], [], []
        for region in view.snapshot.regions:
            colour = region_colour(region.id)[::-1]
            for loop in region.loops:
                # Rerun puts a pixel's corner where we have its middle.
                strips.append([*(loop + 0.5).tolist(), (loop[0] + 0.5).tolist()])
                colours.append(colour)
            depth = view.depths.regions.get(region.id)
            if depth is not None and depth.depth_cm is not None:
                places.append((region.loops[0].mean(axis=0) + 0.5).tolist())
                labels.append(f"{region.id}: {depth_text(depth.depth_cm, depth.sigma_cm)}")
        stream.log("/camera/net", rr.LineStrips2D(strips, colors=colours, radii=0.6))
        points = rr.Points2D(places, labels=labels, show_labels=True, radii=1.5, colors=(240, 240, 240))
        stream.log("/camera/depths", points)

    def _robot(self, view: View) -> None:
        import math

        from host.nav.odometry import body_of

        rr, stream = self._rr, self._stream
        x, z, heading = body_of(view.pose, self._ahead_cm)
        nose = x + self._radius_cm * math.sin(heading), z + self._radius_cm * math.cos(heading)
        self._path.append((x, -z))
        stream.log(
            "/map/robot", rr.Points2D([(x, -z)], radii=self._radius_cm, colors=(*ROBOT, 130), draw_order=10.0)
        )
        stream.log("/map/heading", rr.LineStrips2D([[(x, -z), (nose[0], -nose[1])]], colors=ROBOT, radii=1.0))
        stream.log("/map/path", rr.LineStrips2D([self._path], colors=ROBOT, radii=0.7))
        way = [(a, -b) for a, b in view.command.way]
        stream.log("/map/way", rr.LineStrips2D([way] if len(way) > 1 else [], colors=WAY, radii=0.7))

    def _map(self, obstacle_map: ObstacleMap) -> None:
        from host.view.palette import region_colour

        rr, stream = self._rr, self._stream
        half_cell = obstacle_map.config.cell_cm / 2
        for name, cells, colour in (
            ("free", obstacle_map.free, (*FREE, 90)),
            ("filled", obstacle_map.occupied, FILLED),
        ):
            points = _from_above(obstacle_map.points_where(cells))
            stream.log(f"/map/{name}", rr.Points2D(points, radii=half_cell, colors=colour, draw_order=0.0))
        things = obstacle_map.standing()
        ends = [_from_above_pair(thing.left_cm, thing.right_cm) for thing in things]
        labels = [f"{thing.region}: {thing.depth_cm:.0f} cm" for thing in things]
        colours = [region_colour(thing.region)[::-1] for thing in things]
        stream.log("/map/things", rr.LineStrips2D(ends, labels=labels, colors=colours, radii=1.2))

    def finish(self) -> None:
        """Plots, events and the goal."""
        from host.view.palette import region_colour

        rr, stream = self._rr, self._stream
        goals = self._recording.begin["task"].get("goals_cm", [])
        if goals:
            points = rr.Points2D(
                [(x, -z) for x, z in goals], radii=6.0, colors=GOAL, labels=["goal"] * len(goals)
            )
            stream.log("/map/goals", points, static=True)
        often = sorted(self._depths, key=lambda region: -len(self._depths[region].values))[:MOST_SERIES]
        for region in sorted(often):
            colour = region_colour(region)[::-1]
            self._plot(f"/depth/region_{region}", self._depths[region], f"region {region}", colour)
        for (name, series), colour in zip(self._driven().items(), itertools.cycle(COLOURS)):
            self._plot(name, series, name.rsplit("/", 1)[-1].replace("_", " "), colour)
        self._events()

    def _driven(self) -> dict[str, _Series]:
        """Speeds and times, from what was recorded live."""
        out: dict[str, _Series] = defaultdict(_Series)
        times_s: dict[int, float] = {}
        first_s: float | None = None
        now_s = 0.0

        def note(name: str, value: float) -> None:
            out[name].times_s.append(now_s)
            out[name].values.append(value)

        for entry in self._recording.journal():
            match entry["do"]:
                case "frame":
                    first_s = entry["t_s"] if first_s is None else first_s
                    times_s = {entry["frame"]: entry["t_s"] - first_s}
                case "drove":
                    now_s = times_s.get(entry["frame"], now_s)
                    note("/speed/asked_for", entry["command"]["v_mm_s"] / 10)
                    note("/latency/picture_to_command", entry["latency_ms"])
                    note("/latency/computing", sum(entry["stage_ms"].values()))
                case "wheels":
                    for side, speed_mm_s in zip(("left", "right"), entry["speeds_mm_s"], strict=True):
                        note(f"/speed/{side}_wheel", speed_mm_s / 10)
        return out

    def _plot(self, entity: str, series: _Series, name: str, colour: tuple[int, ...]) -> None:
        rr, stream = self._rr, self._stream
        stream.log(entity, rr.SeriesLines(names=name, colors=colour), static=True)
        times = [rr.TimeColumn("time", duration=series.times_s)]
        stream.send_columns(entity, times, rr.Scalars.columns(scalars=series.values))

    def _events(self) -> None:
        rr, stream, recording = self._rr, self._stream, self._recording
        first_s = next(frame.t_s for frame in recording.frames())
        stream.reset_time()
        for event in recording.events():
            stream.set_time("time", duration=recording.host_time_s(event.t_ns) - first_s)
            text = rr.TextLog(event.text, level=LEVELS.get(event.level, "INFO"))
            stream.log(f"/events/{event.source}", text)


def _from_above(points_cm: np.ndarray) -> np.ndarray:
    """(N, 2) of (x, z) on a page whose y leads down."""
    return points_cm * (1.0, -1.0)


def _from_above_pair(a: tuple[float, float], b: tuple[float, float]) -> list[tuple[float, float]]:
    return [(a[0], -a[1]), (b[0], -b[1])]


def _png(image: np.ndarray) -> bytes:
    import cv2

    return cv2.imencode(".png", image)[1].tobytes()


if __name__ == "__main__":
    run_command(main)
