"""A whole drive in the simulator, with parts of it replaced, for the tests of the loop."""

from __future__ import annotations

from host.camera.frame import Frame
from host.depth.config import DepthConfig
from host.link.robot import Robot
from host.nav.config import BodyConfig, NavConfig
from host.nav.drive import drive
from host.nav.pilot import Pilot, View
from host.nav.result import DriveLog
from host.nav.task import Route, Task
from host.rbdn import NetConfig
from host.sim.session import Simulation

CONFIG = NavConfig()


class TamperedCamera:
    """A simulated camera that goes wrong from some time on."""

    def __init__(self, simulation: Simulation, from_s: float, tamper):
        self._camera, self._clock = simulation.camera, simulation.clock
        self._from_s, self._tamper = from_s, tamper
        self.lens = self._camera.lens
        self._last: Frame | None = None

    def read(self, timeout_s: float) -> Frame | None:
        frame = self._camera.read(timeout_s)
        if self._clock.now_s() >= self._from_s and frame is not None:
            return self._tamper(frame, self._last)
        self._last = frame
        return frame

    def close(self) -> None:
        self._camera.close()


class SlowPilot(Pilot):
    """On a machine that takes its time: so much passes for every picture before there is a command."""

    def __init__(self, simulation: Simulation, compute_s: float, task: Task, **configs):
        super().__init__(simulation.world.lens, task, **configs)
        self._clock, self._compute_s = simulation.clock, compute_s

    def take(self, frame: Frame, now_s: float) -> View:
        self._clock.sleep_s(self._compute_s)
        return super().take(frame, now_s)


def run(
    simulation: Simulation,
    *,
    camera=None,
    line=None,
    reopen=None,
    net: NetConfig | None = None,
    task: Task | None = None,
    max_time_s=15.0,
    compute_s=0.0,
    on_view=lambda view, log: None,
) -> tuple[DriveLog, int]:
    """Drive with the given parts in place of the simulation's own."""
    robot = Robot(line or simulation.transport, simulation.clock, reopen)
    robot.connect()
    pilot = SlowPilot(
        simulation, compute_s, task or Route([simulation.world.goal_cm]),
        net=net or NetConfig(), depth=DepthConfig(), body=BodyConfig(), nav=CONFIG,
    )  # fmt: skip
    return drive(
        camera or simulation.camera, robot, simulation.clock, pilot, CONFIG,
        max_time_s=max_time_s, max_wall_s=1200.0, on_view=on_view,
    )  # fmt: skip


def travel_cm(simulation: Simulation) -> float:
    return simulation.body.distance_cm


def stands(simulation: Simulation) -> bool:
    """Whether the robot stands half a second after the loop has ended, and stays where it is."""
    simulation.clock.sleep_s(0.5)
    before = travel_cm(simulation)
    simulation.clock.sleep_s(0.5)
    return simulation.body.speed_cm_s == 0.0 and travel_cm(simulation) == before
