"""The simulated scenes by name, and the URIs that choose one."""

from __future__ import annotations

from dataclasses import replace
from urllib.parse import parse_qsl

from host.errors import UsageError
from host.sim.drive_scenes import boxes, clutter, corridor, room, with_mover
from host.sim.experiment_scenes import experiment_1, experiment_2, experiment_3, slants
from host.sim.render import WebcamModel
from host.sim.tabletop_scenes import tabletop
from host.sim.world import World

SCENES = {
    "room": room,
    "corridor": corridor,
    "clutter": clutter,
    "boxes": boxes,
    "tabletop": tabletop,
    "experiment_1": experiment_1,
    "experiment_2": experiment_2,
    "experiment_3": experiment_3,
    "slants": slants,
}
PARAMETERS = {name: ("seed",) for name in SCENES} | {
    "room": ("seed", "objects", "movers", "rough", "fps"),
    "corridor": ("seed", "movers", "rough", "fps"),
    "clutter": ("seed", "movers", "rough", "fps"),
    "slants": ("seed", "angle_deg"),
}
HIGHEST = {"seed": 2**31 - 1, "objects": 30, "movers": 1, "rough": 1, "fps": 60, "angle_deg": 60}
LOWEST = {"fps": 5}  # else 0

# A cheap webcam in poor light, on a busy host.
ROUGH = WebcamModel(
    psf_px=0.8, vignetting=0.25, exposure_drift=0.05, full_well=2500.0, read_noise=0.004, jpeg_quality=75,
    readout_s=0.025, latency_s=0.03, jitter_s=0.02, stamp_late_s=0.01,
)  # fmt: skip
ROUGH_DISTORTION = (-0.08, 0.02, 0.0, 0.0, 0.0)


def world_from_uri(uri: str) -> World:
    """The world that a URI like ``sim:room?seed=3`` names.

    Raises
    ------
    UsageError
        Unknown scene or parameter (the known ones are named), or a value that is no number in range.
    """
    name, values = _parse(uri)
    movers, rough = values.pop("movers", 0), values.pop("rough", 0)
    values.pop("fps", None)
    world = SCENES[name](**values)
    if rough:
        world = replace(world, lens=replace(world.lens, distortion=ROUGH_DISTORTION))
    return with_mover(world) if movers else world


def webcam_from_uri(uri: str) -> WebcamModel:
    """The webcam in that world: an ordinary one, or with ``rough=1`` one that makes everything harder.

    Raises
    ------
    UsageError
        As ``world_from_uri``.
    """
    _, values = _parse(uri)
    return ROUGH if values.get("rough") else WebcamModel()


def fps_from_uri(uri: str) -> int | None:
    """Frames a second that the URI asks for; None where it does not.

    Raises
    ------
    UsageError
        As ``world_from_uri``.
    """
    return _parse(uri)[1].get("fps")


def _parse(uri: str) -> tuple[str, dict[str, int]]:
    kind, colon, rest = uri.partition(":")
    name, _, query = rest.partition("?")
    if kind != "sim" or not colon or name not in SCENES:
        known = ", ".join(f"sim:{s}" for s in SCENES)
        raise UsageError(f"camera {uri!r}: no such simulated scene; known are {known}")
    values: dict[str, int] = {}
    for key, text in parse_qsl(query, keep_blank_values=True):
        if key not in PARAMETERS[name]:
            known = ", ".join(PARAMETERS[name])
            raise UsageError(f"camera {uri!r}: sim:{name} has no parameter {key!r}; known are {known}")
        lowest = LOWEST.get(key, 0)
        if not (text.isascii() and text.isdigit() and lowest <= int(text) <= HIGHEST[key]):
            values_known = f"a whole number from {lowest} to {HIGHEST[key]}"
            raise UsageError(f"camera {uri!r}: {key} must be {values_known}, not {text!r}")
        if key in values:
            raise UsageError(f"camera {uri!r}: {key} is given twice; keep one of them")
        values[key] = int(text)
    return name, values
