"""A halt that another thread asks for: at once on the line, and the end of the drive."""

from __future__ import annotations

import threading

import pytest

from host.depth.config import DepthConfig
from host.errors import EXIT_SAFETY
from host.link.protocol import Fault, State
from host.link.robot import Robot
from host.nav.config import BodyConfig, NavConfig
from host.nav.drive import drive
from host.nav.pilot import Pilot
from host.nav.task import Route
from host.rbdn import NetConfig
from host.sim.board import Side
from host.sim.clock import Pacer
from host.sim.session import Simulation
from tests.loop.driving import stands

LINE_S = 0.005  # a frame takes 0.4 ms, and the robot obeys the byte that ends it
ROLLS_S = 0.5  # a motor without power keeps e^-10 of its speed for so long


@pytest.fixture
def driving() -> tuple[Simulation, Robot]:
    """A robot at full speed."""
    simulation = Simulation("sim:room?seed=1")
    robot = Robot(simulation.transport, simulation.clock)
    robot.connect()
    for _ in range(20):
        robot.drive(200, 0)
        simulation.clock.sleep_s(0.05)
        robot.poll()
    assert simulation.body.speed_cm_s > 15
    return simulation, robot


def test_a_halt_takes_the_motors_power_at_once_while_nobody_polls(driving):
    simulation, robot = driving
    robot.halt("because")
    simulation.clock.sleep_s(LINE_S)
    assert [simulation.board.duty(side) for side in Side] == [0.0, 0.0]
    simulation.clock.sleep_s(ROLLS_S)
    assert simulation.body.speed_cm_s == 0.0


def test_nothing_that_is_sent_after_a_halt_moves_the_robot_again(driving):
    simulation, robot = driving
    robot.halt("because")
    for _ in range(25):
        robot.clear()
        robot.drive(200, 0)
        simulation.clock.sleep_s(0.02)
        robot.poll()
    assert robot.latest is not None
    assert (robot.latest.state, robot.latest.fault) == (State.FAULT, Fault.ESTOP_FRAME)
    assert simulation.body.speed_cm_s == 0.0
    assert robot.counters.lost == 0


def test_a_halt_on_a_line_that_is_gone_raises_nothing_and_is_remembered(driving):
    simulation, robot = driving
    simulation.transport.close()
    robot.halt("because")
    assert robot.halted == "because"


def test_a_halt_from_another_thread_ends_the_drive_for_safety_with_its_reason():
    simulation = Simulation("sim:room?seed=1")
    robot = Robot(simulation.transport, simulation.clock)
    robot.connect()
    pilot = Pilot(
        simulation.world.lens, Route([simulation.world.goal_cm]),
        net=NetConfig(), depth=DepthConfig(), body=BodyConfig(), nav=NavConfig(),
    )  # fmt: skip

    def on_view(view, log):
        if log.frames == 10:
            assert simulation.body.speed_cm_s > 1
            thread = threading.Thread(target=robot.halt, args=["STOP pressed"])
            thread.start()
            thread.join()

    log, code = drive(simulation.camera, robot, simulation.clock, pilot, NavConfig(), 5.0, 600.0, on_view)
    assert (code, log.outcome, log.reason) == (EXIT_SAFETY, "stopped", "STOP pressed")
    assert log.frames <= 12
    assert stands(simulation)


def test_a_simulation_in_real_time_waits_until_virtual_time_is_due():
    now_s = 0.0
    pacer = Pacer(lambda: now_s)
    assert pacer.real_s(3.0) == 3.0
    now_s = 2.0  # nothing happened for so long: it is lost
    pacer.hold(0)
    assert pacer.real_s(3.0) == 5.0


def test_a_drive_in_real_time_is_the_same_drive():
    ends = []
    for real_time in (False, True):
        simulation = Simulation("sim:room?seed=2", real_time=real_time)
        robot = Robot(simulation.transport, simulation.clock)
        robot.connect()
        robot.drive(200, 0)
        simulation.clock.sleep_s(0.15)
        robot.stop()
        simulation.clock.sleep_s(0.2)
        assert simulation.pacer is None or simulation.pacer.worst_s < 10
        frame = simulation.camera.read(0.1)
        ends.append((simulation.body.distance_cm, simulation.board.time_us, frame.image.tobytes()))
    assert ends[0] == ends[1]
