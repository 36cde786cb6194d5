"""Wheels, track and motors, measured by driving and written to the robot's parameters.

First both motors at several speeds each way, which gives the duties that the controller starts from. Then a
straight way and squares in both directions (UMBmark), after which a tape tells where the robot came to
stand. At the end squares driven with the new parameters show what became better.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from host.calibrate import feedforward
from host.calibrate.feedforward import MotorFit, Start, Steady
from host.calibrate.paths import Path as Way
from host.calibrate.paths import PathRecorder, Taped, fit
from host.calibrate.tape import PersonWithTape, SimulatedTape, Tape
from host.calibrate.umbmark import Benchmark, Ratios, Return, Sizes, benchmark, ratios
from host.errors import DeviceError, UsageError
from host.link.clock import Clock, SystemClock
from host.link.explain import FAULTS
from host.link.parameters import PARAMETERS, Param
from host.link.ports import RobotPort
from host.link.protocol import State, Telemetry
from host.link.robot import Robot
from host.sim.kinds import is_simulated

if TYPE_CHECKING:  # so that --help need not wait for the simulator
    from host.sim.rolling import RollingRobot

LOOK_S = 0.01
SETTLED_S = 0.3  # standing for so long, the robot rolls no further
RUN_UP_S = 1.2  # to even speed
MEASURED_S = 1.0  # at it
SPEED_SHARES = (0.2, 0.4, 0.6, 0.8)  # of the fastest
PUT_BACK_S = 3.0  # for the robot to rest, or to be heard again, before its old parameters are written
STRAIGHTS = 2
WANTED_MM = 10.0  # to which a centre of gravity should be known
SIZE_STEPS = 5  # um per count either way in which whole numbers are sought that keep the ratio
SCALE_WEIGHT = 0.02  # a wrong scale is so much less bad than a wrong ratio


@dataclass(frozen=True)
class WheelsOptions:
    """Measure wheel sizes, track and motors by driving, and write them to the robot's parameters."""

    robot: str = "sim:"  # auto, a port such as /dev/ttyACM0, or sim: or avr:, as in sim:?wheels=3&track=4
    side_mm: float = 4000.0  # of the square; so much free floor is needed, and half a metre more
    straight_mm: float = 2000.0  # driven for the scale
    runs: int = 5  # squares in each direction to measure with
    checks: int = 5  # squares in each direction afterwards, to see what became better
    speed_mm_s: float = 300.0  # on the straights
    rate_rad_s: float = 1.5  # in the turns
    save: bool = True  # keep the new parameters in the robot's EEPROM
    seed: int = 0  # of the simulated tape's errors
    json: Path | None = None  # write all figures to this file

    def __post_init__(self) -> None:
        limits = {
            "side_mm": (500.0, 20_000.0), "straight_mm": (500.0, 20_000.0),
            "runs": (1, 100), "checks": (1, 100), "speed_mm_s": (50.0, 1000.0), "rate_rad_s": (0.2, 6.0),
            "seed": (0, 2**31 - 1),
        }  # fmt: skip
        for name, (lowest, highest) in limits.items():
            value = getattr(self, name)
            if not lowest <= value <= highest:
                option = name.replace("_", "-")
                raise UsageError(f"--{option} must be from {lowest:.10g} to {highest:.10g}, not {value:.10g}")


@dataclass
class Calibration:
    """All that was measured."""

    parameters_before: dict[Param, int]
    parameters: dict[Param, int] = field(default_factory=dict)  # the changed ones
    motors: tuple[MotorFit, ...] = ()  # left and right; speeds in counts a second
    lag_s: tuple[float, ...] = ()
    sizes: Sizes | None = None
    sigmas: Sizes | None = None
    ratios: Ratios | None = None  # by all paths at once, against the old parameters
    ratios_by_paper: Ratios | None = None  # by the equations of the paper, against those after the straight
    before: Benchmark | None = None  # the check squares, reckoned with the old parameters
    after: Benchmark | None = None  # and with the new
    squares_closed_mm: list[float] = field(default_factory=list)  # how far from its start each check ended


class Calibrator:
    """One robot that is being calibrated."""

    def __init__(self, robot: Robot, clock: Clock, tape: Tape, options: WheelsOptions) -> None:
        self.robot, self.clock, self.tape, self.options = robot, clock, tape, options
        self.values = robot.read_params()
        self.result = Calibration(dict(self.values))
        self._touched: set[Param] = set()  # what may differ from before, written or on its way
        self._saving = False  # or saved: the EEPROM may differ, too

    def run(self, advance: Callable[[float], None] = lambda amount: None) -> Calibration:
        """All of it; `advance` is told of each of `steps` when it is done.

        What ends it early, Ctrl-C too, leaves the robot with the parameters that it had before.
        """
        try:
            result = self._measure(advance)
            if self.options.save:
                self._saving = True
                self.robot.save_params()
        except BaseException:
            self._put_back()
            raise
        told = self.robot.read_params()
        for param, value in result.parameters.items():
            if told[param] != value:
                raise DeviceError(f"the robot has {param.name} = {told[param]}, not {value} as was written")
        return result

    def _measure(self, advance: Callable[[float], None]) -> Calibration:
        options, result = self.options, self.result
        starts = self.motors(advance)
        straights = [self.straight(advance) for _ in range(STRAIGHTS)]
        self.write_sizes(self.coarse(straights))
        squares = [self.square(k % 2 == 0, advance) for k in range(2 * options.runs)]
        coarse = self.sizes
        result.ratios_by_paper = ratios(
            benchmark(_returns(squares, coarse)), options.side_mm, coarse.track_um / 1000
        )
        taped = [*straights, *(one for one, _ in squares)]
        result.sizes, result.sigmas = fit(taped, coarse)
        old = _sizes(result.parameters_before)
        result.ratios = Ratios(
            result.sizes.um_right / result.sizes.um_left * old.um_left / old.um_right,
            result.sizes.track_um / old.track_um,
        )
        self.write_sizes(result.sizes)
        self.write_motors(starts)
        checks = [self.square(k % 2 == 0, advance) for k in range(2 * options.checks)]
        result.before = benchmark(_returns(checks, old))
        result.after = benchmark(_returns(checks, self.sizes))
        result.squares_closed_mm = [math.hypot(one.ahead_mm, one.right_mm) for one, _ in checks]
        return result

    def _put_back(self) -> None:
        """Write the old parameters, if the robot still listens; say on stderr how that went."""
        if not self._touched:
            return
        try:
            if not self.robot.connected:
                self.robot.reconnect(PUT_BACK_S)
            self.robot.stop()
            self._rest()
            for param in sorted(self._touched):
                self.robot.write_param(param, self.result.parameters_before[param])
            if self._saving:
                self.robot.save_params()
        except DeviceError as error:
            names = ", ".join(param.name for param in sorted(self._touched))
            what_to_do = "until its next start: restart it"
            if self._saving:
                what_to_do = "and may have saved them: calibrate it again"
            text = f"the robot keeps unfinished values of {names} {what_to_do} ({error})"
        else:
            text = "the robot has the parameters that it had before"
        print(text, file=sys.stderr)

    def _rest(self) -> None:
        """Wait until parameters may be written: it stands, with a fault or without, and nothing is open."""
        rested_s, give_up_s = 0.0, self.clock.now_s() + PUT_BACK_S
        while rested_s < 2 * SETTLED_S and self.clock.now_s() < give_up_s:
            self.clock.sleep_s(LOOK_S)
            self.robot.poll()
            latest = self.robot.latest
            rests = latest is not None and latest.state in (State.READY, State.FAULT)
            rested_s = rested_s + LOOK_S if rests else 0.0

    @property
    def steps(self) -> int:
        """How often `advance` will be called."""
        return len(SPEED_SHARES) * 2 + STRAIGHTS + 2 * (self.options.runs + self.options.checks)

    @property
    def sizes(self) -> Sizes:
        """As the robot believes now."""
        return _sizes(self.values)

    # --- Motors ---------------------------------------------------------------------------------

    def motors(self, advance: Callable[[float], None]) -> list[tuple[list[Steady], list[RawStart]]]:
        """Both wheels at several speeds each way; what each needed."""
        self._mark("First the motors: a metre and a half of free floor ahead.")
        fastest = min(self.values[Param.SPEED_MAX_MM_S], 600)
        found: list[tuple[list[Steady], list[RawStart]]] = [([], []), ([], [])]
        for share in SPEED_SHARES:
            for sign in (1, -1):
                reports = self._drive(sign * share * fastest)
                for side, (steady, starts) in enumerate(found):
                    one, start = wheel_samples(reports, side, self.values[Param.BATTERY_FULL_MV])
                    steady.append(one)
                    starts.append(start)
                advance(1)
        return found

    def _drive(self, speed_mm_s: float) -> list[Telemetry]:
        self._stand()
        reports = self.robot.poll()
        begin_s = self.clock.now_s()
        while self.clock.now_s() - begin_s < RUN_UP_S + MEASURED_S:
            self.robot.drive(speed_mm_s, 0.0)
            self.clock.sleep_s(2 * LOOK_S)
            reports += self._poll()
        self.robot.stop()
        return reports

    def write_motors(self, found: Sequence[tuple[list[Steady], list[RawStart]]]) -> None:
        """Fit and write the duties; speeds are in counts until the wheels' sizes are known."""
        fits = [feedforward.fit_steady(steady) for steady, _ in found]
        pushes = []
        for fit_, (_, starts), static in zip(
            fits, found, (Param.STATIC_DUTY_LEFT, Param.STATIC_DUTY_RIGHT), strict=True
        ):
            # What exceeds the static duty counts only while it does.
            pushes.append(feedforward.fit_acceleration([s.above(fit_.static) for s in starts], fit_))
            self._write(static, feedforward.static_duty(fit_))
        mm = (self.sizes.um_left / 1000, self.sizes.um_right / 1000)
        self._write(Param.VELOCITY_Q8_LEFT, feedforward.velocity_q8(fits[0], mm[0]))
        self._write(Param.VELOCITY_Q8_RIGHT, feedforward.velocity_q8(fits[1], mm[1]))
        both = np.mean([push / size for push, size in zip(pushes, mm, strict=True)])
        self._write(Param.ACCELERATION_Q8, feedforward.acceleration_q8(float(both), 1.0))
        self.result.motors = tuple(fits)
        self.result.lag_s = tuple(push / f.velocity for push, f in zip(pushes, fits, strict=True))

    # --- Ways -----------------------------------------------------------------------------------

    def straight(self, advance: Callable[[float], None]) -> Taped:
        """Drive straight and ask the tape."""
        way_mm = self.options.straight_mm
        self._mark(f"A straight way of {way_mm / 1000:g} m.")
        path = self._ways([("straight", way_mm)])
        advance(1)
        return Taped(path, *self.tape.read())

    def square(self, clockwise: bool, advance: Callable[[float], None]) -> tuple[Taped, bool]:
        """Drive once round a square and ask the tape."""
        side_mm, turn = self.options.side_mm, math.pi / 2 if clockwise else -math.pi / 2
        self._mark(
            f"A square of {side_mm / 1000:g} m, turning {'right' if clockwise else 'left'}: it comes back."
        )
        path = self._ways([("straight", side_mm), ("turn", turn)] * 4)
        advance(1)
        return Taped(path, *self.tape.read()), clockwise

    def _mark(self, what_next: str) -> None:
        self._stand()
        self.tape.mark(what_next)

    def _ways(self, ways: Sequence[tuple[str, float]]) -> Way:
        recorder = PathRecorder()
        self._stand()
        self.robot.poll()
        self._listen(0.1, recorder)
        for kind, amount in ways:
            if kind == "straight":
                errand = self.robot.move(amount, self.options.speed_mm_s)
                limit_s = 10.0 + 3 * abs(amount) / self.options.speed_mm_s
            else:
                errand = self.robot.turn(amount, self.options.rate_rad_s)
                limit_s = 10.0 + 3 * abs(amount) / self.options.rate_rad_s
            give_up_s = self.clock.now_s() + limit_s
            while errand.result is None:
                if self.clock.now_s() > give_up_s:
                    self.robot.stop()
                    raise DeviceError(f"the robot did not get there within {limit_s:.0f} s: is its way free?")
                self._listen(LOOK_S, recorder)
            errand.result.require_done(f"driving a {kind}" if kind == "straight" else "turning")
        self._listen(SETTLED_S, recorder)
        return recorder.path()

    def coarse(self, straights: Sequence[Taped]) -> Sizes:
        """Wheels from the straight ways alone: how far, and how far aside. The track stays as it was."""
        old = self.sizes
        scale, bends = [], []
        for one in straights:
            ahead, right, _ = one.path.end(old)
            scale.append(math.hypot(one.ahead_mm, one.right_mm) / math.hypot(ahead, right))
            # A chord leaves the start at half the angle that its arc turns by.
            bends.append(2 * (math.atan2(one.right_mm, one.ahead_mm) - math.atan2(right, ahead)))
        way_mm = float(np.mean([math.hypot(one.ahead_mm, one.right_mm) for one in straights]))
        uneven = float(np.mean(bends)) * old.track_um / 1000 / way_mm  # left over right, less one
        mean = float(np.mean(scale))
        return Sizes(
            old.um_left * mean * (1 + uneven / 2), old.um_right * mean * (1 - uneven / 2), old.track_um
        )

    def write_sizes(self, sizes: Sizes) -> None:
        """As whole micrometres, chosen so that the ratio of the wheels is kept best."""
        left, right, track = whole_sizes(sizes)
        self._write(Param.UM_PER_COUNT_LEFT, left)
        self._write(Param.UM_PER_COUNT_RIGHT, right)
        self._write(Param.TRACK_UM, track)

    # --- The robot ------------------------------------------------------------------------------

    def _write(self, param: Param, value: int) -> None:
        known = PARAMETERS[param]
        if not known.lowest <= value <= known.highest:
            raise DeviceError(
                f"{param.name} came out as {value}, which no robot of this kind has ({known.lowest} to "
                f"{known.highest}): was the tape read right?"
            )
        self._stand()
        if self.values[param] != value:
            self._touched.add(param)
            self.robot.write_param(param, value)
        self.values[param] = value
        if self.result.parameters_before[param] != value or param in self.result.parameters:
            self.result.parameters[param] = value

    def _listen(self, seconds: float, recorder: PathRecorder | None = None) -> None:
        until_s = self.clock.now_s() + seconds
        while self.clock.now_s() < until_s:
            self.clock.sleep_s(LOOK_S)
            reports = self._poll()
            if recorder is not None:
                recorder.add(reports)

    def _poll(self) -> list[Telemetry]:
        reports = self.robot.poll()
        latest = self.robot.latest
        if latest is not None and latest.state == State.FAULT:
            raise DeviceError(f"the robot stopped itself: {FAULTS[latest.fault]}")
        return reports

    def _stand(self) -> None:
        """Wait until it is ready, and rolls no more."""
        give_up_s = self.clock.now_s() + 5.0
        while (latest := self.robot.latest) is None or latest.state != State.READY:
            if self.clock.now_s() > give_up_s:
                raise DeviceError("the robot does not come to rest")
            self._listen(LOOK_S)
        self._listen(SETTLED_S)


def wheel_samples(reports: Sequence[Telemetry], side: int, battery_full_mv: int) -> tuple[Steady, RawStart]:
    """What one wheel did while its robot was told to drive: even speed at the end, and the way to it."""
    recorder = PathRecorder()
    recorder.add(reports)
    path = recorder.path()
    counts = path.left if side == 0 else path.right
    t_s = np.unwrap([float(r.mcu_time_us) for r in reports], period=2.0**32) * 1e-6
    duties = np.array([r.duty_left_permille if side == 0 else r.duty_right_permille for r in reports]) / 1000
    battery = np.array([r.battery_mv or battery_full_mv for r in reports]) / battery_full_mv
    duties = duties * battery
    begin_s, end_s = t_s[-1] - MEASURED_S, t_s[-1] - 0.05  # the last edges may not have been told
    even = (path.t_s >= begin_s) & (path.t_s <= end_s)
    if even.sum() < 4:
        raise DeviceError(
            f"the {'left' if side == 0 else 'right'} wheel hardly turned: is it free, and its motor wired?"
        )
    speed = float(np.polyfit(path.t_s[even], counts[even], 1)[0])
    measured = (t_s >= begin_s) & (t_s <= end_s)
    steady = Steady(speed, float(duties[measured].mean()))
    until = t_s <= begin_s
    way = abs(float(np.interp(t_s[until][-1], path.t_s, counts) - counts[0]))
    return steady, RawStart(way, abs(speed), t_s[until], duties[until] * np.sign(speed))


@dataclass(frozen=True)
class RawStart:
    """A start whose static duty is not known yet."""

    way: float
    speed: float
    t_s: np.ndarray
    duties: np.ndarray

    def above(self, static: float) -> Start:
        """What was pushed beyond the static duty; a duty holds until the next report."""
        over = np.maximum(self.duties - static, 0.0)
        push = float((over[:-1] * np.diff(self.t_s)).sum())
        return Start(self.way, self.speed, push)


def whole_sizes(sizes: Sizes) -> tuple[int, int, int]:
    """Whole micrometres near the sizes of both wheels and the track.

    The ratios are kept best, for they bend the way; a wrong scale only stretches it, by 0.1 % at most.
    """
    total = sizes.um_left + sizes.um_right
    best = math.inf, 0, 0
    for left in range(round(sizes.um_left) - SIZE_STEPS, round(sizes.um_left) + SIZE_STEPS + 1):
        right = round(left * sizes.um_right / sizes.um_left)
        bend = abs(right / left * sizes.um_left / sizes.um_right - 1)
        best = min(best, (bend + SCALE_WEIGHT * abs((left + right) / total - 1), left, right))
    _, left, right = best
    return left, right, round(sizes.track_um * (left + right) / total)


def _sizes(values: dict[Param, int]) -> Sizes:
    names = (Param.UM_PER_COUNT_LEFT, Param.UM_PER_COUNT_RIGHT, Param.TRACK_UM)
    return Sizes(*(float(values[name]) for name in names))


def _returns(squares: Sequence[tuple[Taped, bool]], sizes: Sizes) -> list[Return]:
    """Where each ended less where odometry with these sizes says; y to the left, as in the paper."""
    out = []
    for one, clockwise in squares:
        ahead, right, _ = one.path.end(sizes)
        out.append(Return(clockwise, one.ahead_mm - ahead, -(one.right_mm - right)))
    return out


def as_dict(result: Calibration) -> dict[str, Any]:
    """For the JSON file."""

    def bench(found: Benchmark | None) -> dict[str, Any] | None:
        if found is None:
            return None
        scatter = {"scatter_mm": found.scatter_mm, "sigma_mm": found.sigma_mm}
        known = {name: value if math.isfinite(value) else None for name, value in scatter.items()}
        return asdict(found) | {"systematic_mm": found.systematic_mm} | known

    return {
        "parameters_before": {param.name: value for param, value in result.parameters_before.items()},
        "parameters_changed": {param.name: value for param, value in result.parameters.items()},
        "motors": [asdict(one) for one in result.motors],
        "lag_s": list(result.lag_s),
        "sizes": result.sizes and asdict(result.sizes),
        "sigmas": result.sigmas and asdict(result.sigmas),
        "ratios": result.ratios and asdict(result.ratios),
        "ratios_by_paper": result.ratios_by_paper and asdict(result.ratios_by_paper),
        "before": bench(result.before),
        "after": bench(result.after),
        "squares_closed_mm": result.squares_closed_mm,
    }


def calibrate(options: WheelsOptions, rolling: RollingRobot | None = None) -> Calibration:
    """Open the robot and calibrate it."""
    from host.link.bench.terminal import progress
    from host.sim.rolling import open_rolling

    if rolling is None and is_simulated(options.robot):
        rolling = open_rolling(options.robot)
    clock = SystemClock() if rolling is None else rolling.clock
    line = RobotPort(options.robot).open() if rolling is None else rolling.line()
    with Robot(line, clock) as robot:
        robot.connect()
        tape: Tape = PersonWithTape(robot.poll) if rolling is None else SimulatedTape(rolling, options.seed)
        calibrator = Calibrator(robot, clock, tape, options)
        if rolling is None:
            return calibrator.run()  # a bar would be in the way of the questions
        with progress("calibrating", calibrator.steps) as advance:
            return calibrator.run(advance)


def run(options: WheelsOptions) -> None:
    """The command's body."""
    from host.nav.result import write_json
    from host.record.atomic import check_writable

    if options.json is not None:
        check_writable(options.json, folder=False)
    result = calibrate(options)
    show(result, options)
    if options.json is not None:
        write_json({"robot": options.robot, **as_dict(result)}, options.json)


def show(result: Calibration, options: WheelsOptions) -> None:
    """One table, and what it means."""
    from rich.console import Console
    from rich.table import Table

    console = Console()
    if not console.is_terminal:
        console.width = 110
    table = Table(title=f"calibration of {options.robot}", title_justify="left")
    for name in ("parameter", "before", "now"):
        table.add_column(name, justify="left" if name == "parameter" else "right")
    for param, value in sorted(result.parameters.items()):
        table.add_row(param.name, f"{result.parameters_before[param]:,}", f"{value:,}")
    console.print(table)
    for line in sentences(result, options):
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def sentences(result: Calibration, options: WheelsOptions) -> list[str]:
    """What a person should know of it."""
    before, after, found = result.before, result.after, result.ratios
    sizes, sigmas = result.sizes, result.sigmas
    assert before and after and found and sizes and sigmas
    gain = before.systematic_mm / max(after.systematic_mm, 1e-9)
    counts_per_m = 2e6 / (sizes.um_left + sizes.um_right)
    lines = [
        f"{counts_per_m:.2f} counts per metre (± {counts_per_m * sigmas.um_left / sizes.um_left:.2f}), track "
        f"{sizes.track_um / 1000:.1f} mm (± {sigmas.track_um / 1000:.1f}).",
        f"UMBmark: right wheel over left {found.diameters:.5f}, track over nominal {found.wheelbase:.5f}.",
        f"Systematic error of {options.side_mm / 1000:g} m squares, {after.runs} each way: "
        f"{before.systematic_mm:.0f} mm with the old parameters, {after.systematic_mm:.0f} mm with the new: "
        + (f"{gain:.0f} times less." if gain >= 1.5 else "the old ones were right."),
    ]
    if math.isfinite(after.scatter_mm):
        lines.append(
            f"One square scatters by {after.scatter_mm:.0f} mm: {after.runs_needed(WANTED_MM)} in each "
            f"direction tell the systematic error to {WANTED_MM:.0f} mm."
        )
    mean_cm = (sizes.um_left + sizes.um_right) / 2e4
    lines.append(
        f"Now write into robot.toml, [body]: cm_per_count = {mean_cm:.4f}, "
        f"track_cm = {sizes.track_um / 1e4:.2f}, wheel_ratio = {sizes.um_left / sizes.um_right:.4f}"
    )
    return lines
