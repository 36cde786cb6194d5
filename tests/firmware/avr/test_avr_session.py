"""The whole simulated robot with the real firmware in it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from host.link.robot import Robot
from host.sim import session
from host.sim.avr.board import AvrBoard
from host.sim.session import Simulation


def test_a_simulated_drive_goes_as_far_with_the_real_firmware_as_with_the_other(
    make_board: Callable[..., AvrBoard], built: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def make(seed: int, eeprom: bytes = b"") -> AvrBoard:
        return AvrBoard(seed, eeprom, elf=built / "uno.elf", library=built / "librig.so")

    monkeypatch.setattr(session, "AvrBoard", make)

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
