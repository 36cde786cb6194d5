"""What a live page is shown, for its tests: the first pictures of a simulated drive."""

from __future__ import annotations

import asyncio
import json
import struct
from dataclasses import dataclass
from functools import cache
from typing import Any

import aiohttp

from host.camera.frame import Frame
from host.depth.config import DepthConfig
from host.link.robot import Robot
from host.nav.config import BodyConfig, NavConfig
from host.nav.drive import drive
from host.nav.map import ObstacleMap
from host.nav.pilot import Pilot, View
from host.nav.result import DriveLog
from host.nav.task import Route
from host.rbdn import NetConfig
from host.sim.session import Simulation
from host.view.page.server import LivePage


@dataclass(frozen=True)
class Seen:
    """The last picture of a short drive."""

    view: View
    map: ObstacleMap
    log: DriveLog
    robot: Robot
    goal_cm: tuple[float, float]

    def show(self, page: LivePage, frame: Frame | None = None) -> None:
        page.show(frame or self.view.frame, self.view, self.map, self.log)


@cache
def seen() -> Seen:
    simulation = Simulation("sim:room?seed=1")
    robot = Robot(simulation.transport, simulation.clock)
    robot.connect()
    goal = simulation.world.goal_cm
    pilot = Pilot(
        simulation.world.lens, Route([goal]),
        net=NetConfig(), depth=DepthConfig(), body=BodyConfig(), nav=NavConfig(),
    )  # fmt: skip
    views: list[View] = []
    log, _ = drive(
        simulation.camera, robot, simulation.clock, pilot, NavConfig(), 2.0, 600.0,
        lambda view, log: views.append(view),
    )  # fmt: skip
    return Seen(views[-1], pilot.map, log, robot, goal)


class Listener:
    """Remembers what a robot was told by the page."""

    def __init__(self) -> None:
        self.halted: str | None = None

    def halt(self, why: str) -> None:
        self.halted = why


async def next_shot(socket: aiohttp.ClientWebSocketResponse) -> dict[str, Any]:
    """The next picture's JSON; other notes are passed over."""
    while True:
        message = await asyncio.wait_for(socket.receive(), 5.0)
        assert message.type in (aiohttp.WSMsgType.BINARY, aiohttp.WSMsgType.TEXT), message
        if message.type == aiohttp.WSMsgType.BINARY:
            return parted(message.data)[0]


def parted(data: bytes) -> tuple[dict[str, Any], bytes, bytes]:
    """JSON, JPEG and cells of a packed picture."""
    (length,) = struct.unpack_from("<I", data)
    content = json.loads(data[4 : 4 + length])
    rest = data[4 + length :]
    return content, rest[: content["jpeg_bytes"]], rest[content["jpeg_bytes"] :]
