"""A rolling robot at the far end of a bad line, and what truly reached it and what it truly did."""

from __future__ import annotations

import contextlib
import math

import pytest

from host.errors import DeviceError
from host.link.clock import Clock
from host.link.faults import Faults, FaultyLine
from host.link.parameters import Param
from host.link.protocol import Decoder, Drive, Fault, Move, Outcome, Refusal, ResetCause, Turn
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
    """All of it, with a session open; the line is bad from then on.

    Attributes
    ----------
    ages_ms : list of float
        How old, every millisecond, the setpoint was that had reached the board last.
    starts : int
        How often the wheels began to turn.
    faults_seen : set of Fault
        In telemetry.
    """

    def __init__(self, faults: Faults, seed: int = 0, *, avr: bool = False) -> None:
        self.sim = RollingRobot(seed=seed, avr=avr)
        self.clock = self.sim.clock
        self.line = _Noted(self, self.clock, seed=seed)
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
                self.setpoints.append((arrives_us, self.line.given_us[message.expires_us]))

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


class _Noted(FaultyLine):
    """Notes when each setpoint was given: by its deadline, which a repetition has in common with it."""

    def __init__(self, bench: Bench, clock: Clock, seed: int) -> None:
        super().__init__(bench, clock, seed=seed)
        self.given_us: dict[int, int] = {}
        self._board = bench.sim.board
        self._sent = Decoder(to_host=False)

    def write(self, data: bytes) -> None:
        for _, message in self._sent.feed(data):
            if isinstance(message, Drive):
                self.given_us.setdefault(message.expires_us, self._board.time_us)
        super().write(data)


def setpoint_ages_ms(bench: Bench, seconds: float) -> list[float]:
    """Drive at 20 Hz; how old the robot's setpoint was, every millisecond."""
    bench.run(1.0, drive=(150, 0.3))
    bench.ages_ms.clear()
    bench.run(seconds, drive=(150, 0.3))
    assert bench.faults_seen == {Fault.NONE}
    assert bench.starts == 1
    injected = bench.line.injected_to_robot
    assert injected.damaged + injected.dropped > 5
    return bench.ages_ms


def percentile(values: list[float], share: float) -> float:
    return sorted(values)[int(share * len(values))]


def move_often(bench: Bench, moves: int) -> None:
    """Moves and turns; what the wheels do tells that each was done once and nothing else was."""
    robot, before, travelled = bench.robot, bench.robot.latest, 0.0
    for n in range(moves):
        asked = -1 if n % 2 else 1
        x, z, heading = bench.sim.body.axle
        if n % 3:
            errand = robot.move(60 * asked, 300)
            assert robot.wait(errand) == Result(Outcome.DONE), n
        else:
            errand = robot.turn(0.6 * asked, 3.0)
            assert robot.wait(errand) == Result(Outcome.DONE), n
        starts = bench.starts
        bench.run(0.15)  # a late copy would begin it again
        assert bench.starts == starts, n
        x, z, heading = (now - then for now, then in zip(bench.sim.body.axle, (x, z, heading), strict=True))
        done = math.hypot(x, z) / 6.0 if n % 3 else heading / 0.6 * asked
        assert 0.7 < done < 1.3, n
        travelled += done
    assert before is not None
    assert robot.latest is not None
    assert robot.latest.request - before.request == moves
    print(f"\n{moves} moves asked for, {travelled:.1f} made; {bench.line.injected_to_robot}")


def write_often(bench: Bench, writes: int) -> None:
    """Parameters written, and every tenth time saved, each of which must be taken once."""
    robot, saves, taken = bench.robot, 0, 0
    for n in range(writes):
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
    print(f"\n{writes} writes, {saves} saves, {taken} requests taken")


def generations(eeprom: bytes) -> list[int]:
    """The running numbers of what has been saved, oldest first."""
    numbers = [int.from_bytes(eeprom[at + 4 : at + 8], "little") for at in (16, 528)]
    return sorted(number for number in numbers if number != 0xFFFF_FFFF)


def lose_during_a_move(bench: Bench, kind: type[Move] | type[Turn], how: str) -> None:
    """The move ends and is told as ended; nothing begins again by itself; the next move works."""
    robot = bench.robot
    errand = robot.move(1500, 300) if kind is Move else robot.turn(12.0, 2.0)
    bench.run(1.0)
    assert errand.taken
    if how == "restarted":
        bench.sim.board.reset(ResetCause.BROWN_OUT)
    else:
        if how == "unplugged":
            bench.plugged.close()
        bench.clock.sleep_s(1.0)
    if how == "paused":  # the host, which then finds its session as it was
        bench.run(0.05)
    else:
        with pytest.raises(DeviceError):
            robot.wait(errand)
        assert robot.reconnect().restarted == (how == "restarted")
    result = robot.wait(errand)
    assert result.outcome == Outcome.ABORTED
    assert result.reason == (Refusal.BAD_NONCE if how == "restarted" else Refusal.BY_FAULT)
    bench.run(0.5)
    stood_at = bench.sim.body.axle
    bench.run(2.0)
    assert bench.sim.body.axle == stood_at
    assert bench.starts == 1
    if how != "restarted":
        assert result.fault == Fault.LINK_LOST
        robot.clear()
        bench.run(0.05)
    assert robot.wait(robot.move(100, 200)).done
    assert bench.sim.body.axle != stood_at
