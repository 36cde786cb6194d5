"""A whole simulated robot in virtual time: what the program sees of it is a camera, a line and a clock."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from host.camera.frame import Frame
from host.camera.lens import Lens
from host.errors import DeviceError
from host.link.parameters import Param
from host.pose import Pose
from host.sim.body import BodyModel
from host.sim.clock import Pacer
from host.sim.eeprom import image
from host.sim.render import Renderer, Webcam, WebcamModel
from host.sim.rolling import RollingRobot
from host.sim.scenes import fps_from_uri, webcam_from_uri, world_from_uri

FRAMES_PER_S = 15.0
BANDS = 12  # of rows exposed at one moment each, where rows are read out one after another


class SimulatedCamera:
    """The robot's webcam, a ``host.camera.frame.FrameSource``. Frame k is begun at k / `fps` seconds."""

    def __init__(
        self,
        lens: Lens,
        fps: float,
        rolling: RollingRobot,
        take: Callable[[int, int], tuple[np.ndarray, bytes | None]],
        model: WebcamModel,
        seed: int,
    ) -> None:
        self.lens: Lens | None = lens
        self._fps = fps
        self._rolling, self._take = rolling, take
        self._model, self._seed = model, seed
        self._last_seq = -1
        self._open = True

    def read(self, timeout_s: float) -> Frame | None:
        """The newest frame not yet read, or the next one, for which virtual time passes; None once closed.

        Raises
        ------
        DeviceError
            when no frame comes within the timeout, all of which has then passed.
        """
        if not self._open:
            return None
        now_us = self._rolling.board.time_us
        seq = self._last_seq + 1
        guess = int((now_us * 1e-6 - self._model.latency_s - self._model.readout_s) * self._fps) - 1
        seq = max(seq, guess)
        while self._ready_us(seq + 1) <= now_us:
            seq += 1
        wait_us = self._ready_us(seq) - now_us
        if wait_us > timeout_s * 1e6:
            self._rolling.advance_to(now_us + int(timeout_s * 1e6))
            raise DeviceError(
                f"camera: no picture within {timeout_s:g} s at {self._fps:g} a second; wait longer"
            )
        if wait_us > 0:
            self._rolling.advance_to(self._ready_us(seq))
        self._last_seq = seq
        t_us = self._time_us(seq)
        image, encoded = self._take(t_us, seq)
        return Frame(image, t_us * 1e-6 + self._model.stamp_late_s, seq, encoded)

    def close(self) -> None:
        """No more pictures from here."""
        self._open = False

    def _time_us(self, seq: int) -> int:
        """When the middle row is exposed."""
        return round((seq / self._fps + self._model.readout_s / 2) * 1e6)

    def _ready_us(self, seq: int) -> int:
        model = self._model
        late_s = model.readout_s / 2 + model.latency_s
        if model.jitter_s:
            late_s += model.jitter_s * float(np.random.default_rng((self._seed, 3, seq)).random())
        return self._time_us(seq) + round(late_s * 1e6)


def believed(body: BodyModel) -> bytes:
    """The EEPROM of a board whose maker has measured wheels and track, and believes the result."""
    um_per_count = round(body.cm_per_count * 1e4)
    return image({
        Param.UM_PER_COUNT_LEFT: um_per_count,
        Param.UM_PER_COUNT_RIGHT: um_per_count,
        Param.TRACK_UM: round(body.track_cm * 1e4),
    })  # fmt: skip


class Simulation:
    """World, body, board and camera in lock-step; equal calls give equal runs.

    Hand `camera`, `transport` and `clock` to the program and keep the rest for scoring: through those three
    it learns no more than on a real robot.

    Parameters
    ----------
    uri
        The world, such as ``sim:room?seed=3``; its seed decides noise, and wheels unless `body_seed` does.
    fps
        Frames a second, 1 to 1000; what the URI says by default, or else 15.
    avr
        Run the real firmware in a simulated ATmega328P instead of the firmware compiled for this machine.
    real_time
        Virtual time never runs ahead of real time. What happens in it stays the same.

    Attributes
    ----------
    camera : SimulatedCamera
    transport : Line
    clock : SimulatedClock
    world : World
    body : Body
    renderer : Renderer
    board : Board
    pacer : Pacer or None
        Of a simulation in real time.

    Raises
    ------
    UsageError
        The URI names no world, or the ATmega's firmware or simulator is not built.
    """

    def __init__(
        self,
        uri: str,
        *,
        body: BodyModel | None = None,
        body_seed: int | None = None,
        webcam: WebcamModel | None = None,
        fps: float | None = None,
        avr: bool = False,
        real_time: bool = False,
    ) -> None:
        fps = fps_from_uri(uri) or FRAMES_PER_S if fps is None else fps
        if not 1.0 <= fps <= 1000.0:
            raise ValueError(f"fps must be 1 to 1000, not {fps}")
        self.world = world_from_uri(uri)
        self.renderer = Renderer(self.world)
        body, seed = body or BodyModel(), self.world.seed
        rolling = RollingRobot(
            body,
            avr=avr,
            seed=seed if body_seed is None else body_seed,
            world=self.world,
            eeprom=believed(body),
        )
        self.board, self.body, self.clock = rolling.board, rolling.body, rolling.clock
        self.transport = rolling.line()
        self.pacer = Pacer() if real_time else None
        if self.pacer is not None:
            hold = self.pacer.hold
            rolling.watchers.append(lambda: hold(self.board.time_us))
        self._webcam_model = webcam or webcam_from_uri(uri)
        self._webcam = Webcam(self._webcam_model, self.world.lens, seed)
        self.camera = SimulatedCamera(self.world.lens, fps, rolling, self._take, self._webcam_model, seed)

    def exposed_s(self, stamp_s: float) -> float:
        """When the middle row of a picture was truly exposed; for scoring alone."""
        return stamp_s - self._webcam_model.stamp_late_s

    def true_pose(self, t_s: float) -> Pose:
        """Where the camera truly was at a time of the last 30 s; for scoring alone.

        Raises
        ------
        ValueError
            The time is further back, or yet to come.
        """
        return self.body.pose_at(round(t_s * 1e6))

    def renderer_at(self, t_s: float) -> Renderer:
        """The world as it stands at a time; for scoring alone."""
        return Renderer(self.world.at(t_s)) if self.world.movers else self.renderer

    def _take(self, t_us: int, seq: int) -> tuple[np.ndarray, bytes | None]:
        model = self._webcam_model
        bands = BANDS if model.readout_s else 1
        late_us = (model.readout_s * 1e6 * ((n + 0.5) / bands - 0.5) for n in range(bands))
        poses = [self.body.pose_at(t_us + round(late)) for late in late_us]
        light = self.renderer_at(t_us * 1e-6).rolling_light(poses, model.psf_px)
        return self._webcam.deliver(light, t_us * 1e-6, seq)
