"""Camera, robot and clock from their URIs: all three simulated, or all three real."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from host.camera.config import WebcamConfig
from host.camera.frame import FrameSource
from host.camera.lens import Lens
from host.camera.lens_file import check_camera, read_lens
from host.camera.source import camera_name, is_live, open_camera
from host.camera.timely import Timely
from host.errors import UsageError
from host.link.clock import Clock, SystemClock
from host.link.ports import RobotPort
from host.link.robot import Robot
from host.link.transport import Transport
from host.sim.kinds import is_simulated

if TYPE_CHECKING:  # so that --help need not wait for the pilot and the simulator
    from host.nav.pilot import View
    from host.nav.result import DriveLog
    from host.sim.scoring import DepthSample, Score

TRUTHS = (
    "collisions", "run_into", "min_clearance_cm", "true_distance_cm", "room_ahead_cm", "final_pose_error",
    "dead_reckoning_error", "depth_errors", "depths", "fronts", "stops", "true_path",
)  # fmt: skip


@dataclass(frozen=True)
class Rig:
    """What a drive needs of the outside world, with an open session."""

    camera: FrameSource
    robot: Robot
    clock: Clock
    lens: Lens
    goal_cm: tuple[float, float] | None  # the task that a simulated world sets
    score: Score | None  # knows the truth of a simulated world; hears, and is asked when all is over
    monotonic_s: Callable[[float], float] = lambda t_s: t_s  # from the clock's time to time.monotonic's

    def watch(self, view: View) -> None:
        """Let the truth look at what was made of a frame."""
        if self.score is not None:
            self.score.watch(view.frame.t_s, view.snapshot, view.depths, view.standing)
            command = view.command
            if command.outcome is None and not command.hands_off:
                self.score.hear(command.v_mm_s != 0.0 or command.omega_rad_s != 0.0, command.reason)

    def refuse(self, why: str) -> None:
        """Let the truth hear that the robot stands, and why."""
        if self.score is not None:
            self.score.hear(False, f"stop: {why}")

    def truth(self, log: DriveLog) -> dict[str, Any]:
        """The part of result.json that only the simulator knows; nulls elsewhere."""
        if self.score is None:
            return dict.fromkeys(TRUTHS)
        stops = [
            {"t_s": round(s.t_s, 3), "reason": s.reason, "true_room_cm": s.true_room_cm, "false": s.is_false}
            for s in self.score.stops
        ]
        way = [[round(t_s, 3), round(x, 2), round(z, 2)] for t_s, x, z in self.score.way]
        summary = self.score.summary(log.last_pose, log.last_dead_reckoning)
        depths, fronts = _as_rows(self.score.samples), _as_rows(self.score.fronts)
        return {**summary, "depths": depths, "fronts": fronts, "stops": stops, "true_path": way}

    def link_counters(self) -> dict[str, Any]:
        """What both ends of the line saw go wrong."""
        theirs = self.robot.robot_counters
        return {
            "host": asdict(self.robot.counters),
            "robot": None if theirs is None else asdict(theirs),
            "refused_by_robot": self.robot.refusals,
        }


@contextmanager
def open_rig(
    camera_uri: str,
    robot_uri: str,
    lens_file: Path | None,
    real_time: bool = False,
    tap: Callable[[Transport, Clock], Transport] | None = None,
    webcam: WebcamConfig | None = None,
) -> Iterator[Rig]:
    """Open everything and connect; close it all at the end, motors first.

    With `real_time` a simulation does not run as fast as it can, but so that somebody can watch. What `tap`
    makes of the line to the robot takes its place, also of one that is opened anew.

    Raises
    ------
    UsageError
        A URI names nothing, one is simulated and the other not, the pictures are of another time, or a real
        camera's lens is not known.
    InputError
        A file named as camera is missing or damaged.
    DeviceError
        Camera or robot do not answer.
    """
    tap = tap or (lambda line, clock: line)
    simulated = is_simulated(robot_uri)
    if simulated:
        from host.sim.rolling import parse_uri as parse_robot

        parse_robot(robot_uri)
    if not camera_uri.startswith("sim:") and not is_live(camera_uri):
        open_camera(camera_uri).close()
        has_poses = camera_uri.endswith(".mcap") or (Path(camera_uri) / "poses.csv").exists()
        measure = f", or measure in them with 'python -m host.measure {camera_uri}'" if has_poses else ""
        raise UsageError(
            f"camera {camera_uri}: nothing can be driven by pictures that are not of now; name a webcam or a "
            f"stream{measure}"
        )
    if simulated != camera_uri.startswith("sim:"):
        remedy = "; --robot auto finds a real one" if simulated else ""
        raise UsageError(
            f"camera {camera_uri} and robot {robot_uri} do not go together: simulate both or neither{remedy}"
        )
    if simulated and lens_file is not None:
        raise UsageError(f"--lens {lens_file}: a simulated camera brings its own lens; leave it out")
    if simulated:
        from host.sim.board import Line
        from host.sim.rolling import parse_uri as parse_robot
        from host.sim.scenes import world_from_uri
        from host.sim.scoring import Score
        from host.sim.session import Simulation

        avr, body_seed, body = parse_robot(robot_uri, world_from_uri(camera_uri).seed)
        simulation = Simulation(camera_uri, body=body, body_seed=body_seed, avr=avr, real_time=real_time)
        clock = simulation.clock
        line = tap(simulation.transport, clock)
        with Robot(line, clock, lambda: tap(Line(simulation.board), clock)) as robot:
            robot.connect()
            world = simulation.world
            camera = _on_time(simulation.camera, webcam)
            rig = Rig(camera, robot, simulation.clock, world.lens, world.goal_cm, Score(simulation))
            paced = simulation.pacer
            yield rig if paced is None else replace(rig, monotonic_s=paced.real_s)
        return
    lens = None if lens_file is None else read_lens(lens_file)
    if lens_file is not None:
        check_camera(lens_file, camera_name(camera_uri))
    camera = open_camera(camera_uri, lens, webcam)
    try:
        if camera.lens is None:
            raise UsageError(f"camera {camera_uri}: its lens is not known; name its camera.json with --lens")
        clock = SystemClock()
        port = RobotPort(robot_uri)
        with Robot(tap(port.open(), clock), clock, lambda: tap(port.open(), clock)) as robot:
            robot.connect()
            yield Rig(_on_time(camera, webcam), robot, clock, camera.lens, None, None)
    finally:
        camera.close()


def _on_time(camera: FrameSource, webcam: WebcamConfig | None) -> FrameSource:
    return camera if webcam is None or not webcam.late_s else Timely(camera, webcam.late_s)


def _as_rows(samples: Iterable[DepthSample]) -> list[dict[str, Any]]:
    """For result.json."""
    return [
        {
            "t_s": round(s.t_s, 3),
            "region": s.region,
            "background": s.background,
            "depth_cm": round(s.depth_cm, 2),
            "sigma_cm": None if s.sigma_cm is None else round(s.sigma_cm, 2),
            "true_cm": round(s.true_cm, 2),
            "error_percent": round(100 * s.error, 2),
        }
        for s in samples
    ]
