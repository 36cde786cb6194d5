"""A picture's worth of the live page as bytes, made in the server's thread."""

from __future__ import annotations

import json
import math
import struct
from typing import Any

import cv2
import numpy as np

from host.camera.frame import Frame
from host.nav.map import OCCUPIED, Mover
from host.nav.odometry import body_of
from host.nav.pilot import View
from host.rbdn.snapshot import Region
from host.view.page.shot import Job, Shot

WIDEST_PX = 640  # larger pictures are shrunk: a phone shows no more
QUALITY = 80
REASONS = 12
PATH_POINTS = 400
GOES_ON_S = 1.0  # so long something that moves is shown to go on when it is out of sight
EVIDENCE_STEPS = 30.0  # of a byte for one unit of log-odds


def packed(shot: Shot, job: Job) -> bytes:
    """Length of the JSON (4 bytes, little-endian), JSON, JPEG, and the map's cells as signed bytes."""
    image = b"" if shot.frame is None else jpeg_of(shot.frame)
    cells, place = _map(shot)
    content = {
        "kind": "shot",
        "number": shot.number,
        "jpeg_bytes": len(image),
        "picture": None if shot.frame is None else _picture(shot.frame, shot.view),
        "map": place | _way(shot, job),
        **_state(shot, job),
    }
    text = json.dumps(content, allow_nan=False, separators=(",", ":")).encode()
    return struct.pack("<I", len(text)) + text + image + cells


def jpeg_of(frame: Frame) -> bytes:
    """The camera's own bytes where it gave any and they are not too many."""
    image = frame.image
    shrink = image.shape[1] / WIDEST_PX
    if shrink > 1:
        size = WIDEST_PX, round(image.shape[0] / shrink)
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    elif frame.encoded is not None:
        return frame.encoded
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()


def _picture(frame: Frame, view: View | None) -> dict[str, Any]:
    height, width = frame.image.shape[:2]
    regions = [] if view is None else [_region(region, view) for region in view.snapshot.regions]
    return {"width": width, "height": height, "regions": regions}


def _region(region: Region, view: View) -> dict[str, Any]:
    depth = view.depths.regions.get(region.id)
    return {
        "id": region.id,
        "area": round(region.area_px),
        "loops": [np.round(loop, 1).ravel().tolist() for loop in region.loops],
        "depth_cm": None if depth is None else _number(depth.depth_cm, 1),
        "sigma_cm": None if depth is None else _number(depth.sigma_cm, 1),
        "moving": depth is not None and depth.moving,
    }


def _map(shot: Shot) -> tuple[bytes, dict[str, Any]]:
    """The part of the grid where anything is known, and where that is."""
    evidence, cell = shot.evidence, shot.cell_cm
    known = np.abs(evidence) * EVIDENCE_STEPS >= 1
    rows, cols = (np.flatnonzero(known.any(axis=axis)) for axis in (1, 0))
    if len(rows) == 0:
        return b"", {"rows": 0, "cols": 0, "x_cm": 0, "z_cm": 0, "cell_cm": cell}
    r0, r1, c0, c1 = rows[0], rows[-1] + 1, cols[0], cols[-1] + 1
    steps = np.clip(np.round(evidence[r0:r1, c0:c1] * EVIDENCE_STEPS), -127, 127).astype(np.int8)
    return steps.tobytes(), {
        "rows": int(r1 - r0),
        "cols": int(c1 - c0),
        "x_cm": float(c0 * cell - shot.half_cm),  # of the first cell's corner
        "z_cm": float(r0 * cell - shot.half_cm),
        "cell_cm": cell,
        "full": round(OCCUPIED * EVIDENCE_STEPS),
    }


def _way(shot: Shot, job: Job) -> dict[str, Any]:
    ahead_cm = job.body.camera_ahead_cm
    path = shot.log.path[:]
    path = path[:: math.ceil(len(path) / PATH_POINTS) or 1]
    pose = shot.log.last_pose if shot.view is None else shot.view.pose
    places = [body_of(one, ahead_cm) for one in path]
    here = None if pose is None else body_of(pose, ahead_cm)
    if here is not None:
        places.append(here)
    return {
        "path": [round(v, 1) for x, z, _ in places for v in (x, z)],
        "here": None if here is None else [round(v, 4) for v in here],
        "way": [] if shot.view is None else [round(v, 1) for point in shot.view.command.way for v in point],
        "goals": [list(goal) for goal in job.goals_cm],
        "movers": [] if pose is None else [_mover(mover, pose.t_s) for mover in shot.movers],
        "radius_cm": job.body.radius_cm,
    }


def _mover(mover: Mover, t_s: float) -> list[float]:
    """x, z, their change in a second, and half its width, cm."""
    (x, z), (ahead_x, ahead_z), speed = mover.origin_cm, mover.ahead, mover.speed_cm_s
    at_cm = mover.at_cm + speed * min(t_s - mover.t_s, GOES_ON_S)
    place = x + at_cm * ahead_x, z + at_cm * ahead_z, speed * ahead_x, speed * ahead_z, mover.half_cm
    return [round(v, 1) for v in place]


def _state(shot: Shot, job: Job) -> dict[str, Any]:
    log, robot, view = shot.log, job.robot, shot.view
    latest, theirs, ours = robot.latest, robot.robot_counters, robot.counters
    command = None if view is None else view.command
    v_cm_s = 0.0 if command is None or command.hands_off else command.v_mm_s / 10
    turn = 0.0 if command is None or command.hands_off else command.omega_rad_s
    side_cm_s = turn * job.body.track_cm / 2
    decisions = log.decisions[-REASONS:]
    return {
        "task": job.words,
        "t_s": round(log.duration_s, 2),
        "distance_cm": round(log.distance_cm),
        "frames": log.frames,
        "dropped": log.dropped_frames,
        "refused": view is None,
        "state": "no word" if latest is None else latest.state.name.lower(),
        "fault": None if latest is None or not latest.fault else latest.fault.name.lower().replace("_", " "),
        "reason": decisions[-1].reason if decisions else "",
        "reasons": [[one.t_s, one.reason] for one in decisions],
        "wheels": {
            "wanted": [round(v_cm_s + side_cm_s, 2), round(v_cm_s - side_cm_s, 2)],
            "real": [0, 0] if latest is None else [latest.speed_left_mm_s / 10, latest.speed_right_mm_s / 10],
        },
        "stages": {} if view is None else {name: round(ms, 2) for name, ms in view.stage_ms.items()},
        "link": {
            "round_trip_ms": _ms(robot.round_trip_s),
            "battery_v": None if latest is None or not latest.battery_mv else latest.battery_mv / 1000,
            "frames": ours.frames,
            "lost": [ours.lost, None if theirs is None else theirs.lost],
            "crc": [ours.crc, None if theirs is None else theirs.crc],
            "reconnections": len(log.reconnections),
        },
    }


def _ms(seconds: float | None) -> float | None:
    return None if seconds is None else round(1e3 * seconds, 1)


def _number(value: float | None, digits: int) -> float | None:
    return None if value is None or not math.isfinite(value) else round(value, digits)
