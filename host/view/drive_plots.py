"""The plots of a drive, from its result.json: the way, depths, speeds, times, the line."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

from host.view.plot import Mark, Plot, Series, Underlay

MOST_REGIONS = 8
MOST_MARKS = 60
SHOWN = 0.98  # of the errors; the few beyond would flatten the others
TRUTH = "truth of the simulator"
GAP_S = 2.0  # without a depth, and the line of a region is broken


def stops_of(result: dict[str, Any]) -> list[tuple[float, str]]:
    """When it came to stand on the way, and why; not the end of the drive."""
    found, moved = [], False
    decisions = result.get("decisions", [])[:-1]
    if decisions and decisions[-1]["reason"] == result["reason"]:
        decisions.pop()
    for told in decisions:
        stands = told["v_mm_s"] == told["omega_rad_s"] == 0.0
        if stands and moved:
            found.append((told["t_s"], told["reason"]))
        moved = not stands
    return found


def way_plot(result: dict[str, Any], title: str = "The way, from above") -> Plot | None:
    """The camera's way over the final map; None where no picture was driven on."""
    trace = result.get("trace") or {}
    if not any(x is not None for x in trace.get("x_cm", [])):
        return None
    floor = result.get("floor") or {}
    series = [_line(thing) for thing in floor.get("things", [])]
    if result.get("true_path"):
        _, xs, zs = (list(column) for column in zip(*result["true_path"], strict=True))
        series.append(Series(f"true way ({TRUTH})", xs, zs, look="dashed", colour=5))
    rows = zip(trace["t_s"], trace["heading_deg"], trace["v_mm_s"], strict=True)
    titles = [
        "" if heading is None else f"{t_s:.1f} s: {v / 10:.0f} cm/s, heading {heading:.0f}°"
        for t_s, heading, v in rows
    ]
    series.append(Series("way of the camera", trace["x_cm"], trace["z_cm"], titles=titles, colour=0))
    series += _robot(floor.get("robot"))
    stops = [(t_s, why, _place_at(trace, t_s)) for t_s, why in stops_of(result)[-MOST_MARKS:]]
    placed = [(t_s, why, place) for t_s, why, place in stops if place is not None]
    if placed:
        series.append(
            Series(
                "stops",
                [place[0] for _, _, place in placed],
                [place[1] for _, _, place in placed],
                titles=[f"{t_s:.1f} s: {why}" for t_s, why, _ in placed],
                look="points",
                colour=3,
            )
        )
    if result.get("goal_cm"):
        x, z = result["goal_cm"]
        series.append(Series("goal", [x], [z], titles=[f"goal {x:.0f}, {z:.0f} cm"], look="points", colour=2))
    under = None
    if floor.get("png"):
        href = f"data:image/png;base64,{floor['png']}"
        under = Underlay(href, floor["left_cm"], floor["near_cm"], floor["width_cm"], floor["height_cm"])
    return Plot(title, "plan", "cm to the right", "cm ahead", series, underlay=under)


def _line(thing: dict[str, Any]) -> Series:
    (x0, z0), (x1, z1) = thing["ends_cm"]
    told = thing["told"]
    return Series("things, where last seen", [x0, x1], [z0, z1], titles=[told, told], look="thick", colour=1)


def _robot(robot: dict[str, Any] | None) -> Iterator[Series]:
    """Its rim at the end, with a line to the front."""
    if robot is None:
        return
    x, z, radius, heading = (
        robot["x_cm"],
        robot["z_cm"],
        robot["radius_cm"],
        math.radians(robot["heading_deg"]),
    )
    turns = [heading + math.tau * k / 36 for k in range(37)]
    xs = [x + radius * math.sin(turn) for turn in turns] + [x]
    zs = [z + radius * math.cos(turn) for turn in turns] + [z]
    yield Series("robot at the end", xs, zs, titles=["robot at the end"] * len(xs), colour=4)


def _place_at(trace: dict[str, Any], t_s: float) -> tuple[float, float] | None:
    places = [
        (abs(t - t_s), x, z)
        for t, x, z in zip(trace["t_s"], trace["x_cm"], trace["z_cm"], strict=True)
        if x is not None
    ]
    return min(places)[1:] if places else None


def depth_plot(result: dict[str, Any]) -> Plot | None:
    """Depths of the regions known longest, with their sigmas; rings are the simulator's truth."""
    regions = sorted((result.get("depths_over_time") or {}).items(), key=lambda one: -len(one[1]["t_s"]))
    series = []
    for k, (region, found) in enumerate(regions[:MOST_REGIONS]):
        rows = list(_with_gaps(zip(found["t_s"], found["depth_cm"], found["sigma_cm"], strict=True)))
        titles = [
            f"region {region} at {t:.1f} s: {depth:.1f} cm" + (f" ± {sigma:.1f}" if sigma else "")
            for t, depth, sigma in rows
        ]
        columns = [list(column) for column in zip(*rows, strict=True)]
        series.append(Series(f"region {region}", *columns, titles=titles, colour=k))
        true = [one for one in result.get("depths") or [] if str(one["region"]) == region]
        if true:
            times = [one["t_s"] - result["began_s"] for one in true]
            said = [f"region {region}, {TRUTH}: {one['true_cm']:.1f} cm" for one in true]
            depths = [one["true_cm"] for one in true]
            series.append(Series("", times, depths, titles=said, look="rings", colour=k))
    return Plot("Depth", "line", "s", "cm", series) if series else None


def _with_gaps(rows: Iterable[tuple[float, float, float | None]]) -> Iterator[tuple[float, float, float]]:
    """So that no line is drawn over a time in which the region had no depth."""
    last_s = math.inf
    for t_s, depth, sigma in rows:
        if t_s - last_s > GAP_S:
            yield math.nan, math.nan, 0.0
        last_s = t_s
        yield t_s, depth, sigma or 0.0


def error_plot(result: dict[str, Any]) -> Plot | None:
    """Errors of the depths, with their sigmas, where the truth is known."""
    samples = result.get("depths")
    if not samples:
        return None
    sizes = sorted(abs(one["error_percent"]) for one in samples)
    most = sizes[int(SHOWN * (len(sizes) - 1))]
    series = []
    for name, of_room, colour in (("things", False, 0), ("walls and floor", True, 5)):
        those = [one for one in samples if one["background"] == of_room and abs(one["error_percent"]) <= most]
        series.append(
            Series(
                name,
                [one["t_s"] - result["began_s"] for one in those],
                [one["error_percent"] for one in those],
                [100 * (one["sigma_cm"] or 0.0) / one["true_cm"] for one in those],
                [
                    f"region {one['region']} at {one['t_s'] - result['began_s']:.1f} s: "
                    f"{one['depth_cm']:.1f} cm, truly {one['true_cm']:.1f}"
                    for one in those
                ],
                colour=colour,
            )
        )
    return Plot(f"Error of depth ({TRUTH})", "points", "s", "%", series, limit=0.0)


def honesty(result: dict[str, Any]) -> str:
    """How many of the errors are within one and two sigmas, in words; empty where that is not known."""
    pulls = [
        abs(one["depth_cm"] - one["true_cm"]) / one["sigma_cm"]
        for one in result.get("depths") or []
        if one["sigma_cm"] and not one["background"]
    ]
    if not pulls:
        return ""
    one, two = (100 * sum(pull <= limit for pull in pulls) / len(pulls) for limit in (1, 2))
    return (
        f"Of the errors of things {one:.0f} % are within one sigma (honest: 68), {two:.0f} % within two (95)."
    )


def speed_plot(result: dict[str, Any]) -> Plot | None:
    """Told and done, with the stops as marks."""
    trace = result.get("trace") or {}
    if not trace.get("t_s"):
        return None
    series = [Series("told", trace["t_s"], [v / 10 for v in trace["v_mm_s"]], colour=0)]
    for name, column, colour in (("left wheel", "left_mm_s", 1), ("right wheel", "right_mm_s", 2)):
        if any(v is not None for v in trace[column]):
            speeds = [math.nan if v is None else v / 10 for v in trace[column]]
            series.append(Series(name, trace["t_s"], speeds, colour=colour))
    marks = [Mark(t_s, f"{t_s:.1f} s: {why}") for t_s, why in stops_of(result)[-MOST_MARKS:]]
    return Plot("Speed", "line", "s", "cm/s", series, marks=marks)


def time_plot(result: dict[str, Any]) -> Plot | None:
    """Exposure to command and picture to command: of each moment the slowest picture."""
    trace = result.get("trace") or {}
    columns = (("exposure to command", "latency_ms", 1), ("picture to command", "frame_time_ms", 0))
    series = [
        Series(name, trace["t_s"], trace[column], colour=colour)
        for name, column, colour in columns
        if any(v is not None for v in trace.get(column, []))
    ]
    return Plot("Latency", "line", "s", "ms", series) if series else None


def stage_plot(result: dict[str, Any]) -> Plot | None:
    """Real time by stage, of the same pictures."""
    trace = result.get("trace") or {}
    series = [Series(stage, trace["t_s"], times) for stage, times in (trace.get("stage_ms") or {}).items()]
    return Plot("Of it, stage by stage", "line", "s", "ms", series) if series else None


def line_plots(result: dict[str, Any]) -> list[Plot]:
    """Battery and damage on the line; none where there is nothing to see."""
    trace = result.get("trace") or {}
    plots = []
    if any(v is not None for v in trace.get("battery_mv", [])):
        volts = [math.nan if v is None else v / 1000 for v in trace["battery_mv"]]
        low, high = min(v for v in volts if v == v), max(v for v in volts if v == v)
        kind = "points" if high - low < 0.5 else "line"  # a scale from zero would show a flat line
        plots.append(Plot("Battery", kind, "s", "V", [Series("battery", trace["t_s"], volts)]))
    if any(trace.get("damaged", [])):
        damage = [Series("damaged", trace["t_s"], trace["damaged"])]
        plots.append(Plot("Frames damaged or lost so far, both ways", "line", "s", "frames", damage))
    return plots
