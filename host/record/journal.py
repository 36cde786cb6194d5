"""What the pilot was told and what it made of it, as entries that JSON holds without losing a bit.

Every entry says with ``do`` what it is:

``begin``    the recording's first: format, lens, task, the command line's options, versions
``frame``    the camera gave a picture: its number here, its number there, time, checksum of its pixels
``hear``     one wheel reading            ``restarted``  the robot's counts begin anew
``take``     a picture is taken           ``made``       what net, depth, place and command came of it
``decide``   a command without a picture  ``decided``    the command
``react``    how long a reaction takes    ``forget``     the robot is somewhere else
``drove``    what the wheels were told after a picture, and how long all of it took
``refused``  a picture that was not driven on, or that none came, and why
``wheels``   what telemetry said last, once for each picture
``ended``    the drive is over: outcome and reason
``end``      the recording was closed; how much did not get into it

``begin``, ``frame``, ``hear``, ``restarted``, ``take``, ``decide``, ``react`` and ``forget`` are all that the
pilot knows of the world: `host.replay` makes the rest of them again.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from host.camera.lens import Lens
from host.depth.report import DepthReport, RegionDepth
from host.errors import InputError
from host.nav.command import Command
from host.nav.odometry import WheelReading, heading_of
from host.nav.pilot import View
from host.nav.task import Approach, Explore, MeasureOnly, Route, Task
from host.pose import Pose
from host.rbdn.snapshot import Snapshot

FORMAT = 1
LIBRARY = "rbdn-robot"  # who wrote the file, in its head

Entry = dict[str, Any]


def lens_as_dict(lens: Lens) -> Entry:
    """All of a lens."""
    return {
        "width": lens.width,
        "height": lens.height,
        **{name: float(getattr(lens, name)) for name in ("fx", "fy", "cx", "cy")},
        "distortion": [float(term) for term in lens.distortion],
    }


def lens_of(entry: Mapping[str, Any]) -> Lens:
    """The inverse of `lens_as_dict`."""
    return Lens(**{**entry, "distortion": tuple(entry["distortion"])})


def task_as_dict(task: Task) -> Entry:
    """A task that has not begun."""
    match task:
        case Route():
            return {"kind": "route", "goals_cm": [[float(v) for v in goal] for goal in task.goals_cm]}
        case Approach():
            return {"kind": "approach", "stop_cm": task.stop_cm}
        case Explore():
            return {"kind": "explore"}
        case MeasureOnly():
            return {"kind": "measure only"}
    return {"kind": type(task).__name__}


def task_of(entry: Mapping[str, Any]) -> Task:
    """The inverse of `task_as_dict`.

    Raises
    ------
    InputError
        A task that this program does not know.
    """
    match entry["kind"]:
        case "route":
            return Route([(x, z) for x, z in entry["goals_cm"]])
        case "approach":
            return Approach(entry["stop_cm"])
        case "explore":
            return Explore()
        case "measure only":
            return MeasureOnly()
    raise InputError(
        f"the task {entry['kind']!r} is not known here; replay with the program that recorded it"
    )


def reading_as_dict(reading: WheelReading) -> Entry:
    """A wheel reading."""
    entry = {
        "do": "hear",
        "t_s": reading.t_s,
        "counts": [reading.count_left, reading.count_right],
        "edges_s": [reading.edge_left_s, reading.edge_right_s],
        "directions": [reading.direction_left, reading.direction_right],
    }
    duties = [reading.duty_left, reading.duty_right]
    return entry if duties == [None, None] else entry | {"duties": duties}


def reading_of(entry: Mapping[str, Any]) -> WheelReading:
    """The inverse of `reading_as_dict`."""
    both = [entry["counts"], entry["edges_s"], entry["directions"], entry.get("duties", ())]
    return WheelReading(entry["t_s"], *(value for pair in both for value in pair))


def command_as_dict(command: Command) -> Entry:
    """A command, exactly."""
    return {
        "v_mm_s": float(command.v_mm_s),
        "omega_rad_s": float(command.omega_rad_s),
        "reason": command.reason,
        "outcome": command.outcome,
        "hands_off": command.hands_off,
    }


def made_as_dict(number: int, view: View) -> Entry:
    """What came of a picture. Numbers that people ask for, and one checksum for all the others."""
    depths = view.depths.regions
    regions = []
    for region in view.snapshot.regions:
        depth = depths.get(region.id)
        known = depth is not None and depth.depth_cm is not None
        regions.append(
            [
                region.id,
                region.area_px,
                depth.depth_cm if known and depth else None,
                depth.sigma_cm if known and depth else None,
                depth.method if known and depth else None,
            ]
        )
    return {
        "do": "made",
        "frame": number,
        "regions": regions,
        "net": net_checksum(view.snapshot),
        "depth": depth_checksum(view.depths),
        "pose": place_of(view.pose),
        "poses": _checksum(_pose_numbers(view.pose, view.dead_reckoning, view.smooth)),
        "command": command_as_dict(view.command),
        "limits": list(view.snapshot.limits),
    }


def place_of(pose: Pose) -> list[float]:
    """[x in cm, z in cm, heading in rad] of a camera."""
    return [float(pose.position_cm[0]), float(pose.position_cm[2]), heading_of(pose)]


def net_checksum(snapshot: Snapshot) -> str:
    """Of all the net says of a frame, but for the time it took."""
    numbers: list[float] = []
    parts: list[Any] = []
    for r in snapshot.regions:
        parent = math.nan if r.parent is None else r.parent
        numbers += [r.id, parent, r.born_seq, r.area_px, r.sigma_area_px, r.touches_border, *r.mean_rgb]
        numbers += [len(loop) for loop in r.loops]
        parts += [*r.loops, *r.loop_vertices, *r.loop_neighbours]
    vertices, contour = snapshot.vertices, snapshot.contour
    parts += [vertices.ids, vertices.xy_px, vertices.sigma_px]
    parts += [contour.xy_px, contour.normal, contour.left, contour.right, contour.length_px, contour.sigma_px]
    happened = "".join(f"{e.kind} {e.id} {e.parent};" for e in snapshot.events)
    return _checksum([np.array(numbers, float), *parts], happened)


def depth_checksum(report: DepthReport) -> str:
    """Of all that is known of depth after a frame."""
    numbers: list[float | None] = []
    words: list[str | None] = []
    for region, depth in report.regions.items():
        numbers += [region, *_region_numbers(depth)]
        words += [depth.method, depth.method_note, *depth.estimates, *depth.declined.values()]
    found, motion = report.vertices, report.motion
    parts = [found.ids, found.xyz_cm, found.sigma_cm]
    if found.sensitivity is not None:
        parts.append(found.sensitivity)
    if motion is not None:
        numbers += [motion.pitch_rad, motion.yaw_rad, motion.travel_cm]
        for c in motion.since:
            numbers += [c.since_s, c.yaw_rad, c.sigma_yaw_rad, c.travel_cm, c.sigma_travel_cm]
        parts += _pose_numbers(motion.camera)
    flat = np.array([math.nan if n is None else n for n in numbers], float)
    return _checksum([flat, *parts], "|".join(word or "" for word in words))


def _region_numbers(depth: RegionDepth) -> list[float | None]:
    out = [depth.depth_cm, depth.sigma_cm, depth.silhouette_cm, *(depth.slope or ()), depth.moving]
    for estimate in depth.estimates.values():
        out += [estimate.depth_cm, estimate.sigma_cm, estimate.sensitivity]
    return out


def _pose_numbers(*poses: Pose) -> list[np.ndarray]:
    out = []
    for pose in poses:
        out += [pose.rotation, pose.position_cm]
        out.append(np.array([pose.t_s, pose.sigma_z_cm, pose.sigma_rot_rad], float))
    return out


def _checksum(parts: Iterable[np.ndarray], words: str = "") -> str:
    sums = hashlib.blake2b(digest_size=8)
    for part in parts:
        sums.update(np.ascontiguousarray(part).data)
    sums.update(words.encode())
    return sums.hexdigest()
