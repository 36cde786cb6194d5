"""The figures that depth must reach, and what was found."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from host.experiments.findings import Pull, Times, Turn
from host.experiments.markdown import number, percent, table
from host.experiments.summary import Findings, Summary, summary_of
from host.experiments.tables import BOXES, FLAT

JUDGED = ("area", "outline", "vertex", "fused", "corner")  # methods whose sigmas are
ONE_SIGMA, TWO_SIGMA = (64.0, 72.0), (92.0, 98.0)  # percent of errors that should lie within


@dataclass(frozen=True)
class Target:
    """One figure: at most `most`, at least `least`."""

    what: str
    unit: str
    found: float
    most: float = math.inf
    least: float = -math.inf
    answers: str = ""  # how many runs gave one

    @property
    def known(self) -> bool:
        """Whether there was anything to find it from."""
        return math.isfinite(self.found)

    @property
    def found_text(self) -> str:
        """With its unit."""
        return f"{self.found:.3g} {self.unit}" if self.known else "-"

    @property
    def reached(self) -> bool:
        """A figure that could not be found is not reached."""
        return self.least <= self.found <= self.most

    @property
    def wanted(self) -> str:
        """In words."""
        if math.isfinite(self.least) and math.isfinite(self.most):
            return f"{self.least:g} to {self.most:g} {self.unit}"
        return (
            f"{self.most:g} {self.unit}"
            if math.isfinite(self.most)
            else f"at least {self.least:g} {self.unit}"
        )


def targets(findings: Findings, pulls: list[Pull], times: list[Times], turns: list[Turn]) -> list[Target]:
    """Every figure that these runs can show, in the order they are asked for."""
    depth_ms = [t.depth_ms for t in times if t.course == "experiment_1" and t.method == "ours"]
    return [
        *_experiment_1(findings),
        *_experiment_2(findings),
        *_experiment_3(findings),
        *_slants(findings),
        *_odometry(findings, turns),
        *_honesty(pulls),
        Target("depth, a frame of experiment 1: median", "ms", float(np.median(depth_ms)), 1.0),
    ]


def targets_table(rows: list[Target]) -> str:
    """Wanted and found."""
    cells = [
        [row.what, row.wanted, row.found_text, row.answers, "yes" if row.reached else "**no**"]
        for row in rows
    ]
    return table(("figure", "wanted", "found", "answers", "reached"), cells)


def honesty_table(pulls: list[Pull]) -> str:
    """Share of errors within one and two sigmas, by method."""
    rows = []
    for method in JUDGED:
        size = np.abs([pull.sigmas for pull in pulls if pull.method == method])
        if len(size) == 0:
            continue
        shares = (percent(100 * float(np.mean(size < sigmas))) for sigmas in (1, 2))
        rows.append([method, str(len(size)), *shares, number(float(np.percentile(size, 95)), 2)])
    return table(("method", "depths", "within 1 sigma", "within 2 sigma", "95 % within, sigmas"), rows)


def _experiment_1(findings: Findings) -> Iterator[Target]:
    at_end = findings.where(course="experiment_1", travel_cm=10.0, at="first", odometry="exact")
    for method in ("fused", "area"):
        s = at_end.where(method=method, thing=BOXES).summary
        yield Target(f"experiment 1, both boxes, {method}: median", "%", s.median, 0.1, answers=_share(s))
        yield Target(f"experiment 1, both boxes, {method}: 95 % of runs", "%", s.p95, 0.4, answers=_share(s))
    s = at_end.where(lambda f: " " in f.thing, method="vertex").summary
    yield Target("experiment 1, eight corners: median", "%", s.median, 0.5, answers=_share(s))
    yield Target("experiment 1, eight corners: largest", "%", s.largest, 3.0, answers=_share(s))


def _experiment_2(findings: Findings) -> Iterator[Target]:
    at_end = findings.where(travel_cm=5.0, at="first", odometry="exact")
    for thing, most in (("box", 1.5), ("tomato", 1.0), ("pepper", 1.5)):
        s = at_end.where(course="experiment_2", method="fused", thing=thing).summary
        yield Target(f"experiment 2, {thing}: median", "%", s.median, most, answers=_share(s))
    for thing in ("box", "tomato", "pepper"):
        rows = at_end.where(course="experiment_2", thing=thing)
        exact = {f.seed: f.found_cm or math.nan for f in rows.where(method="exact areas").rows}
        off = summary_of(
            100 * ((f.found_cm or math.nan) / exact.get(f.seed, math.nan) - 1)
            for f in rows.where(method="area").rows
        )
        what = f"experiment 2, {thing}: area method against Eq. 16 on exact areas, median"
        yield Target(what, "%", off.median, 0.4, answers=_share(off))


def _experiment_3(findings: Findings) -> Iterator[Target]:
    for travel, flat in ((100.0, 0.4), (200.0, 0.15)):
        at_end = findings.where(
            course="experiment_3", travel_cm=travel, at="last", odometry="exact", method="fused"
        )
        s = at_end.where(thing=FLAT).summary
        yield Target(f"experiment 3, {travel:.0f} cm, flat boards: rms", "%", s.rms, flat, answers=_share(s))
        for thing in ("pot", "tree"):
            s = at_end.where(thing=thing).summary
            yield Target(f"experiment 3, {travel:.0f} cm, {thing}: rms", "%", s.rms, 1.5, answers=_share(s))


def _slants(findings: Findings) -> Iterator[Target]:
    rows = findings.where(course="slant", at="last", odometry="exact", method="fused")
    for slant in rows.values("setting"):
        s = rows.where(setting=slant, thing=("turned_left", "turned_right", "leaning")).summary
        yield Target(f"boards slanted by {slant:.0f} degrees: rms", "%", s.rms, 2.0, answers=_share(s))
    for name, things in (
        ("posters on the side walls", ("poster_left", "poster_right")),
        ("mat on the floor", "mat"),
    ):
        s = rows.where(thing=things).summary
        yield Target(f"{name}: rms", "%", s.rms, 2.0, answers=_share(s))


def _odometry(findings: Findings, turns: list[Turn]) -> Iterator[Target]:
    boxes = findings.where(travel_cm=10.0, at="first", method="fused", thing=BOXES)
    s = boxes.where(course="experiment_1", odometry="encoder").summary
    yield Target("experiment 1, encoder counts of 0.5 cm: median", "%", s.median, 0.5, answers=_share(s))
    shaken_turns = [t for t in turns if t.course == "experiment_1"]
    for what, left in (
        ("left of the turn between two frames", [t.step_left_rad for t in shaken_turns]),
        ("left of the camera's angle to its way", [t.left_rad for t in shaken_turns]),
    ):
        rms = math.degrees(float(np.sqrt(np.mean(np.square(left)))))
        yield Target(
            f"unknown turn of up to 1 degree a frame, {what}: rms",
            "degrees",
            rms,
            0.01,
            answers=f"{len(left)}",
        )
    exact = boxes.where(odometry="exact")
    shaken, steady = (exact.where(course=c).summary for c in ("experiment_1", "experiment_1_steady"))
    yield Target(
        "depth error with that turn over without: rms", "times", shaken.rms / steady.rms, 1.5,
        answers=_share(shaken),
    )  # fmt: skip


def _honesty(pulls: list[Pull]) -> Iterator[Target]:
    for method in JUDGED:
        size = np.abs([pull.sigmas for pull in pulls if pull.method == method])
        for sigmas, (least, most) in ((1, ONE_SIGMA), (2, TWO_SIGMA)):
            share = 100 * float(np.mean(size < sigmas)) if len(size) else math.nan
            what = f"sigma of {'single corners' if method == 'corner' else method}: errors within {sigmas}"
            yield Target(what, "%", share, most, least, answers=f"{len(size)}")


def _share(s: Summary) -> str:
    return f"{s.found} of {s.asked}"
