"""A simulated robot without a camera: board, wheels, battery and line in virtual time, on an endless floor.

Its URI is ``sim:`` for the firmware compiled for this machine, or ``avr:`` for the real program in a
simulated ATmega328P; what is hidden from the robot follows a question mark: ``sim:?seed=3&wheels=2``.
``rough=1`` draws a poor body from the seed; what else is given in the URI then stands above what was drawn.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import cast
from urllib.parse import parse_qsl

import numpy as np

from host.camera.lens import Lens
from host.errors import UsageError
from host.sim.avr.board import AvrBoard
from host.sim.board import Board, Line
from host.sim.body import Body, BodyModel
from host.sim.clock import SimulatedClock
from host.sim.kinds import is_simulated
from host.sim.things import Material
from host.sim.world import Room, World

# What a URI may say of the body: lowest, highest, meaning.
OPTIONS = {
    "seed": (0.0, 2.0**31 - 1, "decides boot nonces, where the wheels stand at first, all that is random"),
    "rough": (0.0, 1.0, "1 for a poor body, drawn from the seed"),
    "motors": (-50.0, 50.0, "percent by which the left motor is faster than the right"),
    "wheels": (-20.0, 20.0, "percent by which the left wheel is larger than the right"),
    "size": (-20.0, 20.0, "percent by which both wheels go further than the robot believes, slip counted"),
    "track": (-20.0, 20.0, "percent by which the wheels are further apart than the robot believes"),
    "edges": (0.0, 40.0, "percent of a count by which encoder edges are off their places"),
    "speed": (10.0, 200.0, "cm/s at full duty and full battery"),
    "lag_ms": (5.0, 500.0, "time constant of the motors"),
    "dead_zone": (0.0, 60.0, "percent of duty below which a motor stands"),
    "battery_mv": (3000.0, 12_600.0, "battery without load"),
    "nod": (-10.0, 10.0, "degrees by which the camera looks down"),
    "tip": (-10.0, 10.0, "degrees by which the camera's right side is lower than its left"),
    "aside": (-10.0, 10.0, "degrees by which the camera looks to the right of straight ahead"),
    "raised": (-5.0, 20.0, "cm by which the camera is higher than the robot believes"),
    "slip": (0.0, 20.0, "percent of the wheels' turning that moves nothing; it varies by a third"),
}
WHOLE = ("seed", "rough")
# What rough=1 draws of them, evenly between two values; of the battery depends how fast the robot is.
ROUGH = {
    "motors": (-15.0, 15.0),
    "wheels": (-0.5, 0.5),  # what a calibration leaves, as track and size
    "size": (-0.3, 0.3),
    "track": (-0.5, 0.5),
    "edges": (0.0, 10.0),
    "lag_ms": (30.0, 90.0),
    "dead_zone": (5.0, 15.0),
    "battery_mv": (6600.0, 8400.0),
    "slip": (0.5, 1.0),
}
ROUGH_SLIP_PER_CM_S2 = 3e-5  # 1 % at 333 cm/s^2
ROUGH_SLIPS_PER_M = 0.1
ROUGH_DRAIN_MV_PER_MIN = 30.0


def parse_uri(uri: str, seed: int = 0) -> tuple[bool, int, BodyModel]:
    """Whether the ATmega is simulated, the seed, and the body.

    Parameters
    ----------
    seed
        That holds where the URI gives none.

    Raises
    ------
    UsageError
        No such robot, an option it does not have, or a value out of range; the known ones are named.
    """
    kind, _, rest = uri.partition(":")
    path, _, query = rest.partition("?")
    if not is_simulated(uri) or path:
        raise UsageError(f"robot {uri!r}: write sim: or avr:, perhaps with options as in sim:?seed=3")
    values: dict[str, float] = {}
    for key, text in parse_qsl(query, keep_blank_values=True):
        if key not in OPTIONS:
            raise UsageError(f"robot {uri!r}: no option {key!r}; known are {', '.join(OPTIONS)}")
        if key in values:
            raise UsageError(f"robot {uri!r}: {key} is given twice; keep one of them")
        values[key] = _number(uri, key, text)
    seed = int(values.get("seed", seed))
    return kind == "avr", seed, _body(values, seed)


def _body(values: dict[str, float], seed: int) -> BodyModel:
    plain, rough = BodyModel(), bool(values.get("rough", 0.0))
    speed = plain.full_speed_cm_s
    if rough:
        chance = np.random.default_rng((0x60DE, seed))
        values = {key: float(chance.uniform(*between)) for key, between in ROUGH.items()} | values
        speed *= values["battery_mv"] / plain.battery_mv
    share = {key: values.get(key, 0.0) / 100 for key in ("wheels", "size", "track", "edges", "slip")}
    size = (1 + share["size"]) / (1 - share["slip"])
    return BodyModel(
        mismatch=values.get("motors", 100 * plain.mismatch) / 100,
        left_wheel=size * (1 + share["wheels"] / 2),
        right_wheel=size * (1 - share["wheels"] / 2),
        true_track=1 + share["track"],
        phase_error=share["edges"],
        full_speed_cm_s=values.get("speed", speed),
        lag_s=values.get("lag_ms", 1000 * plain.lag_s) / 1000,
        dead_zone=values.get("dead_zone", 100 * plain.dead_zone) / 100,
        battery_mv=values.get("battery_mv", plain.battery_mv),
        nod_rad=math.radians(values.get("nod", 0.0)),
        tip_rad=math.radians(values.get("tip", 0.0)),
        aside_rad=math.radians(values.get("aside", 0.0)),
        raised_cm=values.get("raised", 0.0),
        slip=share["slip"],
        slip_per_cm_s2=ROUGH_SLIP_PER_CM_S2 if rough else 0.0,
        slips_per_m=ROUGH_SLIPS_PER_M if rough else 0.0,
        drain_mv_per_min=ROUGH_DRAIN_MV_PER_MIN if rough else 0.0,
    )


def _number(uri: str, key: str, text: str) -> float:
    lowest, highest, _ = OPTIONS[key]
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not lowest <= value <= highest or (key in WHOLE and value != int(value)):
        kind = "a whole number" if key in WHOLE else "a number"
        raise UsageError(
            f"robot {uri!r}: {key} must be {kind} from {lowest:.0f} to {highest:.0f}, not {text!r}"
        )
    return value


def endless_floor(seed: int) -> World:
    """Nothing within a kilometre."""
    grey = Material((128.0, 128.0, 128.0))
    far_cm = 1e5
    room = Room(
        -far_cm, far_cm, -far_cm, far_cm, 250.0, grey, grey, grey, grey, grey, grey, (0.0, 200.0, 0.0)
    )
    lens = Lens(320, 240, 371.0, 371.0, 159.5, 119.5)
    return World("floor", room, (), 15.0, lens, (0.0, 200.0), seed)


class RollingRobot:
    """Board and body in lock-step; equal calls give equal runs.

    Parameters
    ----------
    avr
        Run the real firmware in a simulated ATmega328P instead of the firmware compiled for this machine.
    world
        What it may bump into; an endless floor by default.
    eeprom
        What the board's EEPROM holds; erased by default.

    Attributes
    ----------
    board : Board
    body : Body
    clock : SimulatedClock
        Virtual time: it passes only while somebody waits.
    watchers : list of callables
        Called after every millisecond, when both know all of it.

    Raises
    ------
    UsageError
        The ATmega's firmware or simulator is not built.
    """

    def __init__(
        self,
        model: BodyModel | None = None,
        *,
        avr: bool = False,
        seed: int = 0,
        world: World | None = None,
        eeprom: bytes = b"",
    ) -> None:
        make_board = cast(type[Board], AvrBoard) if avr else Board  # alike in all that is used here
        self.board = make_board(seed, eeprom=eeprom)
        self.model = model or BodyModel()
        self.body = Body(world or endless_floor(seed), self.board, self.model, seed)
        self.clock = SimulatedClock(lambda: self.board.time_us, self.advance_to)
        self.watchers: list[Callable[[], None]] = []

    def line(self) -> Line:
        """Plug in."""
        return Line(self.board)

    def advance_to(self, until_us: int) -> None:
        """Let virtual time pass."""
        body, board = self.body, self.board
        while (now_us := board.time_us) < until_us:
            if body.time_us == now_us:
                body.step()  # knows the edges of the coming millisecond, which the board is told beforehand
            board.step(min(until_us, body.time_us) - now_us)
            if board.time_us == body.time_us:
                for watch in self.watchers:
                    watch()


def open_rolling(uri: str, world: World | None = None, eeprom: bytes = b"") -> RollingRobot:
    """The simulated robot that a URI names; UsageError as `parse_uri`."""
    avr, seed, model = parse_uri(uri)
    return RollingRobot(model, avr=avr, seed=seed, world=world, eeprom=eeprom)
