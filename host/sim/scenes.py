"""The simulated scenes by name, and the URIs that choose one."""

from __future__ import annotations

from urllib.parse import parse_qsl

from host.errors import UsageError
from host.sim.drive_scenes import boxes, clutter, corridor, room, with_mover
from host.sim.experiment_scenes import experiment_1, experiment_2, experiment_3, slants
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
    "room": ("seed", "objects", "movers"),
    "corridor": ("seed", "movers"),
    "clutter": ("seed", "movers"),
    "slants": ("seed", "angle_deg"),
}
HIGHEST = {"seed": 2**31 - 1, "objects": 30, "movers": 1, "angle_deg": 60}


def world_from_uri(uri: str) -> World:
    """The world that a URI like ``sim:room?seed=3`` names.

    Raises
    ------
    UsageError
        Unknown scene or parameter (the known ones are named), or a value that is no number in range.
    """
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
        if not (text.isascii() and text.isdigit() and int(text) <= HIGHEST[key]):
            values_known = f"a whole number from 0 to {HIGHEST[key]}"
            raise UsageError(f"camera {uri!r}: {key} must be {values_known}, not {text!r}")
        if key in values:
            raise UsageError(f"camera {uri!r}: {key} is given twice; keep one of them")
        values[key] = int(text)
    movers = values.pop("movers", 0)
    world = SCENES[name](**values)
    return with_mover(world) if movers else world
