"""The whole simulated robot with the real firmware in it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from host.link.robot import Robot
from host.sim import rolling
from host.sim.avr.board import AvrBoard
from host.sim.session import Simulation

ROOT = Path(__file__).resolve().parents[3]


def test_a_simulated_drive_goes_as_far_with_the_real_firmware_as_with_the_other(
    make_board: Callable[..., AvrBoard], built: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def make(seed: int, eeprom: bytes = b"") -> AvrBoard:
        return AvrBoard(seed, eeprom, elf=built / "uno.elf", library=built / "librig.so")

    monkeypatch.setattr(rolling, "AvrBoard", make)

    def drive(avr: bool) -> tuple[float, float]:
        simulation = Simulation("sim:room?seed=2", avr=avr)
        assert isinstance(simulation.board, AvrBoard) == avr
        with Robot(simulation.transport, simulation.clock) as robot:
            robot.connect()
            simulation.clock.sleep_s(0.1 - simulation.clock.now_s() % 0.1)
            for _ in range(20):
                robot.drive(200, 0.5)
                simulation.clock.sleep_s(0.05)
                robot.poll()
            assert robot.refusals == 0
        return simulation.body.distance_cm, simulation.body.speed_cm_s

    real, other = drive(True), drive(False)
    assert 12 < other[0] < 25
    assert real == pytest.approx(other, abs=0.5)


MAIN_JOB = """
import sys
from functools import partial
from pathlib import Path
from host.sim import rolling
from host.sim.avr.board import AvrBoard
built = Path(sys.argv.pop(1))
rolling.AvrBoard = partial(AvrBoard, elf=built / "uno.elf", library=built / "librig.so")
from host import nav_loop
sys.exit(nav_loop.main())
"""


def test_the_main_job_reaches_its_goal_with_the_real_firmware(built: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-c", MAIN_JOB, built, "--robot", "avr:", "--camera", "sim:room?seed=1"]
    options = ["--no-view", "--max-time", "120", "--json", tmp_path / "result.json"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [*command, *options], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads((tmp_path / "result.json").read_text())
    assert (result["outcome"], result["collisions"]) == ("goal", 0)
