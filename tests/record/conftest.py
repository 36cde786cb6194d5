"""A short drive in the simulator, recorded once for all tests of recordings."""

from __future__ import annotations

from pathlib import Path

import pytest

from host.config import Config
from host.link.robot import Robot
from host.nav.drive import drive
from host.nav.task import Route
from host.record.recorder import Recorder
from host.sim.session import Simulation

DRIVE_S = 2.5
CAMERA = "sim:room?seed=3&rough=1"  # with JPEG, late pictures and so on


def record_drive(path: Path, max_time_s: float = DRIVE_S) -> None:
    simulation, config = Simulation(CAMERA), Config()
    task = Route([simulation.world.goal_cm])
    clock = simulation.clock
    with (
        Recorder(path) as recorder,
        Robot(recorder.line(simulation.transport, clock), clock) as robot,
    ):
        robot.connect()
        pilot = recorder.pilot(clock, simulation.world.lens, task, config, {"camera": CAMERA, "goal": None})
        log, _ = drive(
            simulation.camera, robot, clock, pilot, config.nav, max_time_s, 600.0,
            lambda view, log: recorder.drove(view, log, robot),
            on_refusal=lambda frame, why, log: recorder.refused(frame, why, log, robot),
        )  # fmt: skip
        recorder.ended(log, robot)


@pytest.fixture(scope="session")
def recorded_drive(tmp_path_factory) -> Path:
    """A few seconds of an ordinary drive. Not to be written to."""
    path = tmp_path_factory.mktemp("recorded") / "run.mcap"
    record_drive(path)
    return path
