"""The paper's Tables 1 to 3 with our columns beside its own."""

from __future__ import annotations

from host.depth.two_frames import solve_two_views
from host.experiments.findings import Finding, Times
from host.experiments.markdown import number, percent, table
from host.experiments.published import (
    FOCAL_PX,
    TABLE_1,
    TABLE_1_TRAVEL_CM,
    TABLE_2,
    TABLE_3,
    TIMES,
    MeanDepth,
    table_1_views,
)
from host.experiments.summary import Findings, Summary

BOXES = ("red_box", "green_box")
FLAT = ("blue_board", "yellow_board", "window")


def corner_depths(findings: Findings) -> str:
    """Table 1, vertex-based: depths of the eight corners at the first frame."""
    solved = solve_two_views(table_1_views(), FOCAL_PX, TABLE_1_TRAVEL_CM).corner_depth_cm
    rows = []
    for corner, own in zip(TABLE_1, solved, strict=True):
        thing, real = f"{corner.box} {corner.name}", corner.real_cm[2]
        paper, ours = (_of(findings, "experiment_1", 10.0, m, thing) for m in ("paper vertex", "vertex"))
        rows.append([
            thing.replace("_box", ""), number(real),
            f"{number(corner.vertex_cm[2], 2)} ({percent(corner.vertex_error[2])})",
            f"{number(own, 2)} ({percent(100 * abs(own / real - 1))})",
            _first_and_median(paper), _first_and_median(ours), percent(ours.summary.largest),
            f"{ours.summary.found} of {ours.summary.asked}",
        ])  # fmt: skip
    header = ("corner", "real Z, cm", "paper", "paper's measurements, shift solved", "paper mode", "ours",
              "ours, largest", "ours, seen")  # fmt: skip
    return table(header, rows)


def box_depths(findings: Findings) -> str:
    """Table 1, area-based: depths of both boxes at the first frame."""
    solved = solve_two_views(table_1_views(), FOCAL_PX, TABLE_1_TRAVEL_CM).face_depth_cm
    rows = []
    for box, own in zip(BOXES, solved, strict=True):
        printed = next(corner for corner in TABLE_1 if corner.box == box)
        cells = [
            _first_and_median(_of(findings, "experiment_1", 10.0, method, box))
            for method in ("exact areas", "paper area", "area", "outline", "fused")
        ]
        rows.append([
            box.replace("_box", ""),
            f"{number(printed.area_cm[2], 2)} ({percent(printed.area_error[2])})",
            f"{number(own, 2)} ({percent(100 * abs(own / 85.0 - 1))})", *cells,
        ])  # fmt: skip
    header = ("box", "paper", "paper's measurements, shift solved", "Eq. 16 on exact areas", "paper mode",
              "ours: area", "ours: outline", "ours: fused")  # fmt: skip
    return table(header, rows)


def corner_places(findings: Findings) -> str:
    """Table 1: X and Y of the corners at the first frame, of the run with the paper's own boxes."""
    rows = []
    for corner in TABLE_1:
        thing = f"{corner.box} {corner.name}"
        cells = [
            _pair(_run_0(_of(findings, "experiment_1", 10.0, method, thing)))
            for method in ("paper vertex", "vertex")
        ]
        x, y, _ = corner.real_cm
        rows.append([
            thing.replace("_box", ""), f"{x:.2f}, {y:.2f}",
            f"{corner.vertex_cm[0]:.2f}, {corner.vertex_cm[1]:.2f}",
            f"{corner.area_cm[0]:.2f}, {corner.area_cm[1]:.2f}", *cells,
        ])  # fmt: skip
    header = ("corner", "real X, Y, cm", "paper, vertex-based", "paper, area-based", "paper mode", "ours")
    return table(header, rows)


def sensitivities(findings: Findings) -> str:
    """Table 1: how much is measured over the 10 cm, of the run with the paper's own boxes."""
    rows = []
    for corner in TABLE_1:
        thing = f"{corner.box} {corner.name}"
        cells = [
            number(_growth(findings, method, name), digits)
            for method, name, digits in (
                ("paper vertex", thing, 1),
                ("vertex", thing, 1),
                ("paper area", corner.box, 0),
                ("area", corner.box, 0),
            )
        ]
        rows.append([
            thing.replace("_box", ""), number(corner.vertex_growth_px, 2), *cells[:2],
            str(corner.area_growth_px2), *cells[2:],
        ])  # fmt: skip
    header = ("corner", "paper, y, px", "paper mode, y", "ours, x and y", "paper, area, px²", "paper mode",
              "ours")  # fmt: skip
    return table(header, rows)


def table_2(findings: Findings) -> str:
    """Average depths at the first frame, after 5 cm."""
    return _mean_depths(findings, "experiment_2", "first", TABLE_2)


def table_3(findings: Findings) -> str:
    """Average depths at the later frames, after 100 and 200 cm."""
    flat = [
        MeanDepth(thing, travel, float("nan"), float("nan"), float("nan"))
        for travel in (100.0, 200.0)
        for thing in FLAT
    ]
    return _mean_depths(findings, "experiment_3", "last", (*TABLE_3, *flat))


def _mean_depths(findings: Findings, course: str, at: str, printed: tuple[MeanDepth, ...]) -> str:
    rows = []
    for row in printed:
        cells = [
            _first_and_median(_of(findings, course, row.travel_cm, method, row.thing, at))
            for method in ("exact areas", "paper area", "area", "outline", "fused")
        ]
        run_0 = _run_0(_of(findings, course, row.travel_cm, "fused", row.thing, at))
        paper = f"{number(row.found_cm)} ({percent(row.error)})" if row.found_cm > 0 else "-"
        real = number(run_0.true_cm) if run_0 else "-"
        rows.append([row.thing.replace("_", " "), f"{row.travel_cm:.0f}", real, paper, *cells])
    header = ("thing", "driven, cm", "real, cm", "paper", "Eq. 16 on exact areas", "paper mode", "ours: area",
              "ours: outline", "ours: fused")  # fmt: skip
    return table(header, rows)


def spread_table(findings: Findings) -> str:
    """Errors of all runs of each experiment, by method."""
    methods = ("exact areas", "paper area", "area", "outline", "fused")
    rows = []
    for what, course, travel, at, things in (
        ("experiment 1, both boxes", "experiment_1", 10.0, "first", BOXES),
        ("the same without shaking", "experiment_1_steady", 10.0, "first", BOXES),
        ("experiment 2, box", "experiment_2", 5.0, "first", ("box",)),
        ("experiment 2, tomato", "experiment_2", 5.0, "first", ("tomato",)),
        ("experiment 2, pepper", "experiment_2", 5.0, "first", ("pepper",)),
        ("all three without shaking", "experiment_2_steady", 5.0, "first", ("box", "tomato", "pepper")),
        ("experiment 3, 100 cm, pot and tree", "experiment_3", 100.0, "last", ("pot", "tree")),
        ("experiment 3, 200 cm, pot and tree", "experiment_3", 200.0, "last", ("pot", "tree")),
        ("experiment 3, 100 cm, flat things", "experiment_3", 100.0, "last", FLAT),
        ("experiment 3, 200 cm, flat things", "experiment_3", 200.0, "last", FLAT),
    ):
        of_course = findings.where(course=course, travel_cm=travel, at=at, odometry="exact", thing=things)
        rows.append([what, *(_spread(of_course.where(method=method).summary) for method in methods)])
    header = ("rms / median / 95 %, %", "Eq. 16 on exact areas", "paper mode", "ours: area", "ours: outline",
              "ours: fused")  # fmt: skip
    return table(header, rows)


def _spread(s: Summary) -> str:
    if s.found == 0:
        return "-"
    values = " / ".join(percent(value).removesuffix(" %") for value in (s.rms, s.median, s.p95))
    return values if s.found == s.asked else f"{values} ({s.found} of {s.asked})"


def encoder_table(findings: Findings) -> str:
    """Exact odometry against whole counts of 0.5 cm."""
    rows = []
    for course, travel, at, things in (
        ("experiment_1", 10.0, "first", BOXES),
        ("experiment_2", 5.0, "first", ("box", "tomato", "pepper")),
        ("experiment_3", 200.0, "last", ("pot", "tree")),
    ):
        for method in ("paper area", "fused"):
            cells = []
            for odometry in ("exact", "encoder"):
                s = findings.where(
                    course=course, travel_cm=travel, at=at, method=method, odometry=odometry, thing=things
                ).summary
                cells += [percent(s.median), percent(s.p95), f"{s.found} of {s.asked}"]
            name = {"paper area": "paper mode", "fused": "ours"}[method]
            rows.append([f"{course.replace('_', ' ')}, {travel:.0f} cm: {name}", *cells])
    header = ("run", "exact: median", "95 %", "answers", "counted: median", "95 %", "answers")
    return table(header, rows)


def times_table(times: list[Times], courses: tuple[str, ...]) -> str:
    """The paper's times and ours, medians over the runs."""
    rows = []
    for course in courses:
        paper = TIMES[course]
        cells = [f"{1e3 * paper.first_frame_s:.0f}", f"{1e3 * paper.tracking_s:.0f}"]
        for method in ("paper", "ours"):
            runs = [t for t in times if t.course == course and t.method == method]
            cells += [number(_median([t.first_frame_ms for t in runs]))]
            cells += [f"{number(_median([t.tracking_ms for t in runs]), 0)} / {runs[0].frames - 1}"]
        cells.append(
            number(_median([t.depth_ms for t in times if t.course == course and t.method == "ours"]), 2)
        )
        rows.append([course.replace("_", " "), *cells])
    header = ("ms", "paper: first frame", "paper: tracking", "paper mode: first frame", "tracking / frames",
              "ours: first frame", "tracking / frames", "ours: depth, a frame")  # fmt: skip
    return table(header, rows)


def _median(values: list[float]) -> float:
    ordered = sorted(values)
    return ordered[len(ordered) // 2]


def _of(
    findings: Findings, course: str, travel_cm: float, method: str, thing: str, at: str = "first"
) -> Findings:
    return findings.where(
        course=course, travel_cm=travel_cm, method=method, thing=thing, at=at, odometry="exact"
    )


def _run_0(findings: Findings) -> Finding | None:
    return next((row for row in findings.rows if row.seed == 0), None)


def _first_and_median(findings: Findings) -> str:
    """Depth of run 0 with the median error of all runs; a dash without an answer."""
    run_0, s = _run_0(findings), findings.summary
    depth = number(run_0.found_cm, 2) if run_0 else "-"
    return f"{depth} ({percent(s.median)})" if s.found else "-"


def _pair(finding: Finding | None) -> str:
    if finding is None or finding.place_cm is None:
        return "-"
    return f"{finding.place_cm[0]:.2f}, {finding.place_cm[1]:.2f}"


def _growth(findings: Findings, method: str, thing: str) -> float | None:
    run_0 = _run_0(_of(findings, "experiment_1", 10.0, method, thing))
    return None if run_0 is None else run_0.growth
