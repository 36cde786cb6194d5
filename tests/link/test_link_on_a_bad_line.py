"""The client, a bad line and the firmware: setpoints stay fresh, moves and writes happen exactly once."""

from __future__ import annotations

import contextlib

import pytest

from host.errors import DeviceError
from host.link.faults import Faults, FaultyLine
from host.link.parameters import Param
from host.link.protocol import (
    DEAD_MAN_US,
    Decoder,
    Drive,
    Fault,
    Move,
    Outcome,
    Refusal,
    ResetCause,
    State,
    Turn,
)
from host.link.requests import Result
from host.link.robot import Robot
from host.link.transport import Transport
from host.sim.board import Line
from host.sim.rolling import RollingRobot

POLL_S = 0.01
DRIVE_EVERY = 5  # polls
STANDS_CM_S = 0.1
STOOD_MS = 30  # without turning for this long, the next motion is another one
NOISY = Faults(bit_error_rate=1e-4)
ROUGH = Faults(
    drop=0.05, truncate=0.01, duplicate=0.1, reorder=0.05, bit_error_rate=1e-4, delay_s=0.005, jitter_s=0.005
)


class Bench:
    """A rolling robot, a bad line to it, and what truly reached it and what it truly did."""

    def __init__(self, faults: Faults, seed: int = 0) -> None:
        self.sim = RollingRobot(seed=seed)
        self.clock = self.sim.clock
        self.line = FaultyLine(self, self.clock, seed=seed)
        self.plugged: Line = self.sim.line()
        self.setpoints: list[tuple[int, int]] = []  # when a DRIVE reached the board, when it was given; us
        self.starts = 0  # of motion
        self.ages_ms: list[float] = []
        self.faults_seen: set[Fault] = set()
        self._decoder = Decoder(to_host=False)
        self._stood_ms = STOOD_MS
        self.sim.watchers += [self._pump, self._watch]
        self.robot = Robot(self.line, self.clock, self.open)
        self.robot.connect()
        vars(self.line.to_robot).update(vars(faults))
        vars(self.line.to_host).update(vars(faults))

    # --- The true line ----------------------------------------------------------------------------

    def write(self, data: bytes) -> None:
        self.plugged.write(data)
        arrives_us = self.sim.board.time_us + 40 * len(data)
        for _, message in self._decoder.feed(data):
            if isinstance(message, Drive):
                self.setpoints.append((arrives_us, message.expires_us - DEAD_MAN_US))

    def read(self) -> bytes:
        return self.plugged.read()

    def close(self) -> None:
        self.plugged.close()

    def open(self) -> Transport:
        self.plugged = self.sim.line()
        return self.line

    # --- What the robot truly does ----------------------------------------------------------------

    def _pump(self) -> None:
        with contextlib.suppress(DeviceError):  # unplugged
            self.line.pump()

    def _watch(self) -> None:
        now_us = self.sim.board.time_us
        if self.setpoints:
            reached = [given_us for arrives_us, given_us in self.setpoints[-9:] if arrives_us <= now_us]
            if reached:
                self.ages_ms.append((now_us - reached[-1]) / 1000)
        turning = max(map(abs, self.sim.body.wheel_speeds_cm_s)) > STANDS_CM_S
        self.starts += turning and self._stood_ms >= STOOD_MS
        self._stood_ms = 0 if turning else self._stood_ms + 1

    # --- The host ---------------------------------------------------------------------------------

    def run(self, seconds: float, drive: tuple[float, float] | None = None) -> None:
        """Let time pass, perhaps driving at 20 Hz."""
        for n in range(round(seconds / POLL_S)):
            if drive is not None and n % DRIVE_EVERY == 0:
                self.robot.drive(*drive)
            self.clock.sleep_s(POLL_S)
            for report in self.robot.poll():
                self.faults_seen.add(report.fault)


def percentile(values: list[float], share: float) -> float:
    return sorted(values)[int(share * len(values))]


# --- Setpoints ------------------------------------------------------------------------------------


@pytest.mark.parametrize("faults", [NOISY, Faults(drop=0.1)], ids=["bit errors 1e-4", "a tenth lost"])
def test_driven_twenty_times_a_second_setpoints_stay_fresh_and_nothing_stops(faults: Faults):
    ages_ms: list[float] = []
    for seed in range(4):
        bench = Bench(faults, seed)
        bench.run(1.0, drive=(150, 0.3))
        bench.ages_ms.clear()
        bench.run(40.0, drive=(150, 0.3))
        ages_ms += bench.ages_ms
        assert bench.faults_seen == {Fault.NONE}
        assert bench.starts == 1
        injected = bench.line.injected_to_robot
        assert injected.damaged + injected.dropped > 5
    p99 = percentile(ages_ms, 0.99)
    print(f"\nsetpoint age p50 {percentile(ages_ms, 0.5):.1f}, p99 {p99:.1f}, most {max(ages_ms):.1f} ms")
    if faults is NOISY:
        assert p99 <= 60.0


def test_a_stop_that_is_lost_is_repeated():
    bench = Bench(Faults())
    bench.run(1.0, drive=(150, 0))
    bench.line.to_robot.drop = 1.0
    bench.robot.stop()
    bench.line.to_robot.drop = 0.0
    bench.run(1.0)  # which a wheel takes to be known to stand
    assert bench.robot.latest is not None
    assert (bench.robot.latest.state, bench.faults_seen) == (State.READY, {Fault.NONE})


# --- Requests -------------------------------------------------------------------------------------


@pytest.mark.parametrize("faults", [NOISY, ROUGH], ids=["bit errors 1e-4", "everything"])
def test_two_hundred_moves_are_each_done_exactly_once(faults: Faults):
    bench = Bench(faults, seed=5)
    robot, before = bench.robot, bench.robot.latest
    for n in range(200):
        errand = robot.move(20 if n % 2 else -20, 300) if n % 3 else robot.turn(0.2 if n % 2 else -0.2, 3.0)
        result = robot.wait(errand)
        assert result == Result(Outcome.DONE), n
        bench.run(0.15)  # a late copy would begin it again
        assert bench.starts == n + 1
    robot.poll()
    assert before is not None
    assert robot.latest is not None
    assert robot.latest.request - before.request == 200
    kinds = bench.line.injected_to_robot
    print(f"\n200 moves, {bench.starts} starts; {kinds}")


def test_parameters_are_written_and_saved_exactly_once():
    bench = Bench(ROUGH, seed=6)
    robot, saves, taken = bench.robot, 0, 0
    for n in range(200):
        robot.write_param(Param.TRACK_UM, 150_000 + n)
        assert robot.read_param(Param.TRACK_UM) == 150_000 + n
        taken += 1
        if n % 10 == 9:
            robot.save_params()
            taken += 1
            saves += 1
            assert generations(bench.sim.board.eeprom)[-1] == saves
        assert robot.latest is not None
        assert robot.latest.request == taken
    print(f"\n200 writes, {saves} saves, {taken} requests taken")


def generations(eeprom: bytes) -> list[int]:
    """The running numbers of what has been saved, oldest first."""
    numbers = [int.from_bytes(eeprom[at + 4 : at + 8], "little") for at in (16, 528)]
    return sorted(number for number in numbers if number != 0xFFFF_FFFF)


# --- Lost during a move ---------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [Move, Turn])
@pytest.mark.parametrize("how", ["unplugged", "restarted"])
def test_a_move_that_loses_its_robot_ends_and_is_never_begun_again(kind: type, how: str):
    bench = Bench(Faults(), seed=7)
    robot = bench.robot
    errand = robot.move(1500, 300) if kind is Move else robot.turn(12.0, 2.0)
    bench.run(1.0)
    assert errand.taken
    if how == "unplugged":
        bench.plugged.close()
        bench.clock.sleep_s(1.0)
    else:
        bench.sim.board.reset(ResetCause.BROWN_OUT)
    with pytest.raises(DeviceError):
        robot.wait(errand)
    back = robot.reconnect()
    assert back.restarted == (how == "restarted")
    result = robot.wait(errand)
    assert result.outcome == Outcome.ABORTED
    assert result.reason == (Refusal.BAD_NONCE if how == "restarted" else Refusal.BY_FAULT)
    bench.run(0.5)
    stood_at = bench.sim.body.axle
    bench.run(2.0)
    assert bench.sim.body.axle == stood_at
    assert bench.starts == 1
    if how == "unplugged":
        robot.clear()
        bench.run(0.05)
    assert robot.wait(robot.move(100, 200)).done
    assert bench.starts == 2
