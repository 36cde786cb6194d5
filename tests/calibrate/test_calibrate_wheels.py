"""The whole calibration of a simulated robot that is not what it believes, and its talk with a person."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable
from pathlib import Path

import pytest

from host.calibrate import tape, wheels
from host.calibrate.__main__ import main
from host.calibrate.tape import PersonWithTape, SimulatedTape
from host.calibrate.wheels import Calibration, WheelsOptions, calibrate, sentences
from host.errors import DeviceError, UsageError
from host.link.parameters import PARAMETERS, Param
from host.link.requests import Errand
from host.link.robot import Robot
from host.sim.rolling import RollingRobot, open_rolling, parse_uri


def hidden(seed: int) -> str:
    """A robot that differs from its maker's beliefs in everything."""
    chance = random.Random(seed)
    wheels, track = chance.choice((-3, 3)), chance.choice((-4, 4))
    motors, lag = chance.uniform(-15, 15), chance.uniform(30, 90)
    dead_zone, battery = chance.uniform(5, 15), chance.uniform(6900, 8400)
    return (
        f"sim:?seed={seed}&wheels={wheels}&track={track}&size=1&edges=10&motors={motors:.1f}&lag_ms={lag:.0f}"
        f"&dead_zone={dead_zone:.1f}&battery_mv={battery:.0f}"
    )


@pytest.fixture(scope="module", params=[1, 2])
def calibrated(request: pytest.FixtureRequest):
    """Done once for each seed, with smaller and fewer squares than a person would drive."""
    uri = hidden(request.param)
    rolling = open_rolling(uri)
    options = WheelsOptions(robot=uri, side_mm=2000.0, runs=3, checks=2, seed=request.param)
    return uri, rolling, options, calibrate(options, rolling)


def test_the_systematic_error_is_cut_to_a_tenth_and_less(calibrated) -> None:
    *_, result = calibrated
    assert result.before is not None and result.after is not None
    assert result.after.systematic_mm < result.before.systematic_mm / 10


def test_wheels_and_track_are_found(calibrated) -> None:
    uri, _, _, result = calibrated
    _, _, model = parse_uri(uri)
    sizes = result.sizes
    assert sizes is not None
    assert sizes.um_right / sizes.um_left == pytest.approx(model.right_wheel / model.left_wheel, rel=2e-4)
    assert sizes.um_left == pytest.approx(5000 * model.left_wheel, rel=0.002)  # 4 mm in two straights of 2 m
    assert sizes.track_um == pytest.approx(150_000 * model.true_track, rel=0.003)


def test_the_motors_duties_are_found(calibrated) -> None:
    uri, _, _, result = calibrated
    _, _, model = parse_uri(uri)
    volts = model.battery_mv / 7400
    for motor, lag_s, gain in zip(
        result.motors, result.lag_s, (1 + model.mismatch / 2, 1 - model.mismatch / 2), strict=True
    ):
        # The body's speed is that of full duty at its own battery's voltage; counts are of 5 mm.
        slope = (1 - model.dead_zone) / (model.full_speed_cm_s / 0.5 * gain) * volts
        assert motor.static == pytest.approx(model.dead_zone * volts, rel=0.03)
        assert motor.velocity == pytest.approx(slope, rel=0.03)
        assert lag_s == pytest.approx(model.lag_s, abs=0.012)


def test_the_robot_has_the_parameters_and_has_them_still_after_a_restart(calibrated) -> None:
    _, rolling, _, result = calibrated
    assert len(result.parameters) == 8
    again = Robot(rolling.line(), rolling.clock)
    rolling.board.reset()
    again.connect()
    for param, value in result.parameters.items():
        assert again.read_param(param) == value


def test_a_person_is_told_all_of_it_in_plain_words(calibrated) -> None:
    _, _, options, result = calibrated
    told = "\n".join(sentences(result, options))
    for part in (
        "counts per metre",
        "UMBmark: right wheel over left",
        "times less",
        "robot.toml, [body]",
        "wheel_ratio = ",
    ):
        assert part in told


def test_a_robot_that_is_what_it_believes_is_left_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "wheels.json"
    arguments = ["--side-mm", "1000", "--straight-mm", "1000", "--runs", "1", "--checks", "1", "--no-save"]
    main(["wheels", "--robot", "sim:?motors=0", *arguments, "--json", str(out)])
    told = json.loads(out.read_text())
    assert told["ratios"]["diameters"] == pytest.approx(1.0, abs=1e-3)
    assert told["ratios"]["wheelbase"] == pytest.approx(1.0, abs=0.01)
    assert "counts per metre" in capsys.readouterr().out


def test_parameters_that_are_not_saved_are_gone_after_a_restart() -> None:
    rolling = open_rolling("sim:?wheels=2")
    options = WheelsOptions(side_mm=500.0, straight_mm=500.0, runs=1, checks=1, save=False)
    result = calibrate(options, rolling)
    assert isinstance(result, Calibration) and result.parameters
    rolling.board.reset()
    with Robot(rolling.line(), rolling.clock) as robot:
        robot.connect()
        assert robot.read_param(Param.UM_PER_COUNT_LEFT) == 5000


class _Interrupted(SimulatedTape):
    """A person who ends it when asked for the fourth way, with the wheels' coarse sizes written."""

    ways = 0
    how: Callable[[], None]

    def read(self) -> tuple[float, float]:
        self.ways += 1
        if self.ways == 4:
            type(self).how()
        return super().read()


def _ctrl_c() -> None:
    raise KeyboardInterrupt


def _gone() -> None:
    raise DeviceError("the tape broke")


@pytest.fixture
def interrupted(monkeypatch: pytest.MonkeyPatch):
    """Calibrates a robot until `how` happens; gives the robot, simulated."""

    def begin(how: Callable[[RollingRobot], None], error: type[BaseException]) -> RollingRobot:
        rolling = open_rolling("sim:?wheels=2&seed=1")
        monkeypatch.setattr(_Interrupted, "how", lambda: how(rolling), raising=False)
        monkeypatch.setattr(wheels, "SimulatedTape", _Interrupted)
        with pytest.raises(error):
            calibrate(WheelsOptions(side_mm=500.0, straight_mm=500.0, runs=1, checks=1), rolling)
        return rolling

    return begin


def parameters(rolling: RollingRobot) -> dict[Param, int]:
    with Robot(rolling.line(), rolling.clock) as robot:
        robot.connect()
        return robot.read_params()


@pytest.mark.parametrize(("how", "error"), [(_ctrl_c, KeyboardInterrupt), (_gone, DeviceError)])
def test_what_ends_it_early_leaves_the_robot_as_it_was(
    interrupted, capsys: pytest.CaptureFixture[str], how: Callable[[], None], error: type[BaseException]
) -> None:
    rolling = interrupted(lambda _: how(), error)
    assert parameters(rolling) == {param: known.default for param, known in PARAMETERS.items()}
    assert "the robot has the parameters that it had before" in capsys.readouterr().err


def test_ctrl_c_on_the_way_leaves_the_robot_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    written = []

    def write(self: Robot, param: Param, value: int) -> None:
        write_param(self, param, value)
        written.append((param, value))

    def move(self: Robot, *arguments: float) -> Errand:
        errand = begin_move(self, *arguments)
        if written and len(written) < 4:  # sizes, and no motors yet
            monkeypatch.setattr(Robot, "move", begin_move)
            raise KeyboardInterrupt
        return errand

    write_param, begin_move = Robot.write_param, Robot.move
    monkeypatch.setattr(Robot, "write_param", write)
    monkeypatch.setattr(Robot, "move", move)
    rolling = open_rolling("sim:?wheels=2&seed=1")
    with pytest.raises(KeyboardInterrupt):
        calibrate(WheelsOptions(side_mm=500.0, straight_mm=500.0, runs=1, checks=1), rolling)
    assert any(value != PARAMETERS[param].default for param, value in written)
    assert parameters(rolling) == {param: known.default for param, known in PARAMETERS.items()}


@pytest.mark.parametrize("listens", [True, False])
def test_ctrl_c_while_the_robot_saves_leaves_it_as_it_was_or_says_that_it_is_not(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], listens: bool
) -> None:
    rolling = open_rolling("sim:?wheels=2&seed=1")

    def save(self: Robot) -> None:
        monkeypatch.setattr(Robot, "save_params", save_params)
        save_params(self)  # the robot has done it, and nobody has heard so yet
        if not listens:
            rolling.board.read = lambda: b""  # type: ignore[method-assign]
        raise KeyboardInterrupt

    save_params = Robot.save_params
    monkeypatch.setattr(Robot, "save_params", save)
    with pytest.raises(KeyboardInterrupt):
        calibrate(WheelsOptions(side_mm=500.0, straight_mm=500.0, runs=1, checks=1), rolling)
    told = capsys.readouterr().err
    if not listens:
        assert "the robot keeps unfinished values of " in told
        assert "and may have saved them: calibrate it again" in told
        return
    assert "the robot has the parameters that it had before" in told
    rolling.board.reset()
    assert parameters(rolling) == {param: known.default for param, known in PARAMETERS.items()}


def test_a_robot_that_cannot_be_given_its_old_parameters_is_said_to_keep_the_new(
    interrupted, capsys: pytest.CaptureFixture[str]
) -> None:
    def unplug(rolling: RollingRobot) -> None:
        rolling.board.read = lambda: b""  # type: ignore[attr-defined]
        raise KeyboardInterrupt

    interrupted(unplug, KeyboardInterrupt)
    told = capsys.readouterr().err
    assert "the robot keeps unfinished values of UM_PER_COUNT_LEFT, UM_PER_COUNT_RIGHT" in told
    assert "until its next start: restart it" in told


def test_a_robot_that_stops_itself_is_not_calibrated() -> None:
    with pytest.raises(DeviceError, match="the robot stopped itself: the battery is empty"):
        calibrate(WheelsOptions(robot="sim:?battery_mv=6500"))


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["wheel"], "nothing called 'wheel' can be calibrated; did you mean wheels?"),
        (["lens"], "nothing called 'lens' can be calibrated"),
        (["wheels", "--side-mm", "10"], "--side-mm must be from 500 to 20000, not 10"),
        (["wheels", "--runs", "0"], "--runs must be from 1 to 100, not 0"),
        (["wheels", "--rate-rad-s", "nan"], "--rate-rad-s must be from 0.2 to 6"),
        (["wheels", "--robot", "sim:?whels=3"], "no option 'whels'; known are"),
        (["wheels", "--json", "/proc/no/where.json"], "/proc"),
    ],
)
def test_a_wrong_command_line_gets_one_line(arguments: list[str], complaint: str) -> None:
    with pytest.raises(UsageError) as told:
        main(arguments)
    assert complaint in str(told.value) and "\n" not in str(told.value)


def test_help_is_the_commands_manual(capsys: pytest.CaptureFixture[str]) -> None:
    main([])
    assert "host.calibrate wheels" in capsys.readouterr().out


# --- The tape -----------------------------------------------------------------------------------


def test_the_simulated_tape_reads_to_a_millimetre_from_a_mark_aimed_to_half_a_degree() -> None:
    rolling = open_rolling("sim:")
    found = []
    for seed in range(200):
        one = SimulatedTape(rolling, seed)
        one.mark("")
        found.append(one.read())
    errors = [value for pair in found for value in pair]
    assert math.sqrt(sum(e * e for e in errors) / len(errors)) == pytest.approx(1.0, abs=0.15)


class _Keyboard:
    """Lines that a person types, after some looks at it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *lines: str) -> None:
        self._lines = list(lines)
        self.looks = 0
        monkeypatch.setattr(tape.sys, "stdin", self)
        monkeypatch.setattr(tape.select, "select", self._select)

    def _select(self, *_: object) -> tuple[list, list, list]:
        self.looks += 1
        return ([self] if self.looks % 3 == 0 else []), [], []

    def readline(self) -> str:
        return self._lines.pop(0) if self._lines else ""


def test_a_person_is_asked_until_there_are_two_numbers_while_the_robot_is_listened_to(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    said, heard = [], []
    _Keyboard(monkeypatch, "\n", "two metres\n", "1993\n", "1993 nan\n", "1993, -12.5\n")
    person = PersonWithTape(lambda: heard.append(1), said.append)
    person.mark("A straight way of 2 m.")
    assert person.read() == (1993.0, -12.5)
    assert "A straight way of 2 m." in said[0] and said[-1].startswith("Two numbers, such as")
    assert len(said) == 5 and len(heard) == 10


def test_without_a_person_there_is_no_calibration(monkeypatch: pytest.MonkeyPatch) -> None:
    _Keyboard(monkeypatch)
    with pytest.raises(UsageError, match="nobody answers: calibrating a real robot needs a person"):
        PersonWithTape(lambda: None, lambda text: None).mark("x")
