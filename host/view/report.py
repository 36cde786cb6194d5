"""The report of a drive: one HTML page that stands alone, made from its result.json and its pictures."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import cv2

from host.config import Config
from host.view import html_page
from host.view.drive_plots import (
    TRUTH,
    depth_plot,
    error_plot,
    honesty,
    line_plots,
    speed_plot,
    stage_plot,
    stops_of,
    time_plot,
    way_plot,
)
from host.view.figures import FIGURES, grade, outcome_text
from host.view.plot import Plot, draw

PICTURE_PX = 640  # wide, in the page
JPEG_QUALITY = 72
MOST_DECISIONS = 400  # told in the page; result.json has more
STOP_LATE_S = 0.2  # from a stop's place in the log to the look at what was truly ahead


def report(result: dict[str, Any], folder: Path) -> bytes:
    """The page; `folder` holds the pictures that the result names."""
    title = result["task"][:1].upper() + result["task"][1:]
    about = f"{folder.name} · camera {result['camera']} · robot {result['robot']}"
    if result.get("true_path") is not None:
        about += " · simulated"
    body = (
        f'<p class="about">{html.escape(about)}</p>\n'
        f'<div class="verdict {grade(result)}">{html.escape(outcome_text(result))}</div>\n'
        + figures_table(result)
        + '<h2>How it went</h2>\n<div class="plots">\n'
        + "".join(_plots(result))
        + "</div>\n"
        + _pictures(result, folder)
        + _decisions(result)
        + _line(result)
        + _settings(result)
    )
    return html_page.page(title, body)


def changed_settings(config: Config) -> dict[str, dict[str, Any]]:
    """Those that are not the defaults: ``{"nav.speed_cm_s": {"value": 15.0, "default": 20.0}}``."""
    usual = asdict(Config())
    return {
        f"{section}.{key}": {"value": value, "default": usual[section][key]}
        for section, values in asdict(config).items()
        for key, value in values.items()
        if value != usual[section][key]
    }


def figures_table(result: dict[str, Any]) -> str:
    """All that is known."""
    rows = [
        (f"{figure.name} *" if figure.truth else figure.name, figure.text(value))
        for figure in FIGURES
        if (value := figure.of(result)) is not None
    ]
    starred = any(figure.truth and figure.of(result) is not None for figure in FIGURES)
    note = f'<p class="about">* {TRUTH}, which the robot never sees</p>\n' if starred else ""
    half = (len(rows) + 1) // 2
    halves = "".join(html_page.table((), part) for part in (rows[:half], rows[half:]))
    return f'<div class="plots">{halves}</div>\n{note}'


def figure(plot: Plot, caption: str = "") -> str:
    """A plot with a line below."""
    below = f"<figcaption>{html.escape(caption)}</figcaption>" if caption else ""
    return f"<figure>{draw(plot)}{below}</figure>\n"


def _plots(result: dict[str, Any]) -> Iterator[str]:
    seen = "Green was seen to be free, red is taken."
    rings = f"Bands and whiskers are one sigma. Rings: {TRUTH}." if result.get("depths") else ""
    slowest = "Of each moment the slowest picture."
    for plot, caption in (
        (way_plot(result), seen),
        (depth_plot(result), rings),
        (error_plot(result), honesty(result)),
        (speed_plot(result), "Dashed lines are stops."),
        (time_plot(result), slowest),
        (stage_plot(result), slowest),
        *((plot, "") for plot in line_plots(result)),
    ):
        if plot is not None:
            yield figure(plot, caption)


def _pictures(result: dict[str, Any], folder: Path) -> str:
    stops, others = [], []
    for picture in result.get("pictures", []):
        source = _jpeg(folder / picture["file"])
        if source is None:
            continue
        words = f"{max(0.0, picture['t_s']):.1f} s: {picture['told']}"
        kept = others if picture["file"].startswith("frame") else stops
        kept.append(
            f'<figure><img alt="{html.escape(picture["file"])}" src="{source}">'
            f"<figcaption>{html.escape(words)}</figcaption></figure>\n"
        )
    out = "<h2>Stops</h2>\n" + _stops(result)
    if stops:
        out += f'<div class="plots">\n{"".join(stops)}</div>\n'
    if others:
        out += f'<h2>On the way</h2>\n<div class="plots">\n{"".join(others)}</div>\n'
    return out


def _stops(result: dict[str, Any]) -> str:
    """When and why it stood, and how far it could have gone on where that is known."""
    told, true = stops_of(result)[-MOST_DECISIONS:], result.get("stops") or []
    if not told:
        return "<p>None on the way.</p>\n"
    if not true:
        return html_page.table(("stopped at", "why"), [(f"{t_s:.1f} s", why) for t_s, why in told], "words")
    rows = []
    for t_s, why in told:
        # The same reason may come again and again: of those the one at this time.
        late = {abs(one["t_s"] - result["began_s"] - t_s): one for one in true if one["reason"] == why}
        room = f"{late[min(late)]['true_room_cm']:.0f} cm" if late and min(late) < STOP_LATE_S else ""
        rows.append((f"{t_s:.1f} s", why, room))
    return html_page.table(("stopped at", "why", f"truly free ahead ({TRUTH})"), rows, "words")


def _jpeg(path: Path) -> str | None:
    """As a data URI, no wider than the page; None where it cannot be read."""
    picture = cv2.imread(str(path))
    if picture is None:
        return None
    if picture.shape[1] > PICTURE_PX:
        size = PICTURE_PX, round(picture.shape[0] * PICTURE_PX / picture.shape[1])
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return f"data:image/jpeg;base64,{base64.b64encode(data.tobytes()).decode()}"


def _decisions(result: dict[str, Any]) -> str:
    told = result.get("decisions", [])
    rows = [
        (f"{one['t_s']:.1f} s", f"{one['v_mm_s'] / 10:.0f} cm/s", str(one["pictures"]), one["reason"])
        for one in told[:MOST_DECISIONS]
    ]
    more = len(told) - len(rows) + result.get("decisions_left_out", 0)
    note = f'<p class="about">and {more} more</p>\n' if more else ""
    table = html_page.table(("from", "speed", "pictures", "what and why"), rows, "words")
    details = f"<details><summary>{len(told)} entries</summary>{table}{note}</details>\n"
    return "<h2>What it did, and why</h2>\n" + details


def _line(result: dict[str, Any]) -> str:
    link = result.get("link") or {}
    host, robot = link.get("host") or {}, link.get("robot") or {}
    rows = [(name, str(host.get(name, "–")), str(robot.get(name, "–"))) for name in {**host, **robot}]
    rows.append(("refused by the robot", "–", str(link.get("refused_by_robot", "–"))))
    out = "<h2>Serial line</h2>\n" + html_page.table(("frames", "to the host", "to the robot"), rows)
    lost = [
        (f"{one['t_s']:.1f} s", f"{one['away_s']:.1f} s", one["why"])
        for one in result.get("reconnections", [])
    ]
    return out + (html_page.table(("lost at", "for", "why"), lost, "words") if lost else "")


def _settings(result: dict[str, Any]) -> str:
    rows = [
        (name, str(one["value"]), str(one["default"])) for name, one in (result.get("settings") or {}).items()
    ]
    out = "<h2>Settings that are not the defaults</h2>\n"
    out += html_page.table(("setting", "here", "default"), rows) if rows else "<p>None.</p>\n"
    versions = [(name, str(value)) for name, value in (result.get("versions") or {}).items()]
    return out + ("<h2>Versions</h2>\n" + html_page.table((), versions, "words") if versions else "")
