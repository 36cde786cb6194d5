"""How late pictures are stamped comes out of turns to and fro; what tells too little is refused."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from host.calibrate import turning as turning_to_and_fro
from host.calibrate.__main__ import main
from host.calibrate.paths import Path as Way
from host.calibrate.ride import Drive, Picture, Ride
from host.calibrate.turning import SWING_RAD, motions, solve
from host.camera.config import WebcamConfig
from host.camera.frame import Frame
from host.camera.lens import Lens
from host.camera.timely import Timely
from host.config import read_config
from host.errors import InputError, UsageError
from host.nav.config import BodyConfig
from host.nav.rig import open_rig
from host.sim.render import WebcamModel

LENS = Lens(320, 240, 280.0, 280.0, 159.5, 119.5)
LATE_S, READOUT_S = 0.013, 0.02


def panorama() -> np.ndarray:
    """Things all around, by direction: 280 px a radian."""
    rng = np.random.default_rng(3)
    return cv2.GaussianBlur(rng.uniform(0, 255, (240, 1400)).astype(np.float32), (0, 0), 2.5) * 4 - 380


def turning(late_s: float, readout_s: float, play_rad: float = 0.0, sweeps: int = 2) -> Ride:
    """Turns as of a robot far from everything; the wheels' play holds them back at each reversal."""
    times, headings, parts = [0.0], [0.0], [0]
    for k, motion in enumerate(motions(sweeps), 1):
        rate = motion.omega_rad_s
        while (headings[-1] - motion.heading_rad) * rate < 0:
            times.append(times[-1] + 0.005)
            headings.append(headings[-1] + rate * 0.005)
            parts.append(k)
    t_s, wheels = np.array(times), np.array(headings)
    way = np.sign(np.gradient(wheels))
    true = wheels - play_rad / 2 * way
    world, pictures = panorama(), []
    rows, columns = np.meshgrid(np.arange(240.0), np.arange(320.0), indexing="ij")
    for stamp_s in np.arange(0.1, t_s[-1] - 0.1, 1 / 15):
        exposed = stamp_s - late_s + readout_s * (rows[:, :1] / 240 - 0.5)
        heading = np.interp(exposed, t_s, true)
        x = (np.arctan((columns - LENS.cx) / LENS.fx) + heading) * 280 + 700
        gray = cv2.remap(world, x.astype(np.float32), rows.astype(np.float32), cv2.INTER_LINEAR)
        part = parts[int(np.searchsorted(t_s, stamp_s))]
        pictures.append(Picture(float(stamp_s), np.clip(gray, 0, 255).astype(np.uint8), part))
    body = BodyConfig()
    counts = wheels * body.track_cm / 2 / body.cm_per_count
    return Ride(LENS, pictures, Way(t_s, counts, -counts))


@pytest.mark.parametrize("play_rad", [0.0, 0.03])
def test_delay_and_readout_are_found_whatever_the_gears_play(play_rad: float) -> None:
    found = solve(turning(LATE_S, READOUT_S, play_rad), BodyConfig())
    assert found.late_s == pytest.approx(LATE_S, abs=0.0015)
    assert found.readout_s == pytest.approx(READOUT_S, abs=0.004)
    assert abs(found.play_rad) == pytest.approx(play_rad, abs=0.004)
    assert found.sigma_s < 0.003


def test_a_robot_that_does_not_turn_tells_nothing() -> None:
    still = turning(0.0, 0.0)
    wheels = Way(still.wheels.t_s, 0 * still.wheels.left, 0 * still.wheels.right)
    with pytest.raises(InputError, match="the robot hardly turned, or too few pictures came"):
        solve(Ride(LENS, still.pictures, wheels), BodyConfig())


def test_where_nothing_is_to_be_seen_nothing_is_told() -> None:
    ride = turning(0.0, 0.0)
    grey = [Picture(p.t_s, np.full_like(p.gray, 128), p.part) for p in ride.pictures]
    with pytest.raises(InputError, match="too little to be seen on the way: 0 pairs of pictures, 12 are"):
        solve(Ride(LENS, grey, ride.wheels), BodyConfig())


def test_turns_end_at_their_heading() -> None:
    first, second = motions(3)[:2]
    assert first.over(SWING_RAD / 2 + 0.01, 0.0) and not first.over(SWING_RAD / 2 - 0.01, 0.0)
    assert second.over(-SWING_RAD / 2 - 0.01, 0.0) and not second.over(0.0, 0.0)
    assert not Drive(0.0, 1.0, 1.0).over(9.0, 9.0)


def test_the_command_finds_a_simulated_webcams_delay_and_keeps_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.toml").write_text("[webcam]\nfps = 20.0  # mine\n")
    monkeypatch.setattr("host.sim.session.webcam_from_uri", lambda uri: WebcamModel(stamp_late_s=0.02))
    monkeypatch.setattr(turning_to_and_fro, "RATES_RAD_S", (1.6, 1.1))  # quicker than a person would
    monkeypatch.setattr(turning_to_and_fro, "SWING_RAD", 1.1)
    robot = ["--robot", "sim:?rough=1&seed=2", "--camera", "sim:room?seed=2"]
    main(["delay", *robot, "--sweeps", "2", "--save"])
    text = (tmp_path / "robot.toml").read_text()
    assert "fps = 20.0  # mine" in text
    kept = read_config(tmp_path / "robot.toml").webcam.late_s
    assert kept == pytest.approx(0.020, abs=0.003)
    assert "Pictures are stamped" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--sweeps", "1"], "--sweeps must be from 2 to 100, not 1"),
        (["--camera", "0"], "do not go together: simulate both or neither"),
    ],
)
def test_a_wrong_command_line_gets_one_line(arguments: list[str], complaint: str) -> None:
    with pytest.raises((UsageError, InputError)) as told:
        main(["delay", *arguments])
    assert complaint in str(told.value) and "\n" not in str(told.value)


def test_what_is_set_takes_a_simulated_cameras_times_back() -> None:
    uris = "sim:room?seed=1&rough=1", "sim:", None
    with open_rig(*uris) as late, open_rig(*uris, webcam=WebcamConfig(late_s=0.01)) as timely:
        as_stamped, as_taken = late.camera.read(1.0), timely.camera.read(1.0)
    assert as_stamped is not None and as_taken is not None
    assert as_stamped.t_s - as_taken.t_s == pytest.approx(0.01)


def test_a_timely_cameras_pictures_bear_the_time_of_their_exposure() -> None:
    class Late:
        lens = LENS
        closed = False

        def read(self, timeout_s: float) -> Frame | None:
            return None if self.closed else Frame(np.zeros((2, 2, 3), np.uint8), 5.0, 7)

        def close(self) -> None:
            self.closed = True

    late = Late()
    camera = Timely(late, 0.04)
    frame = camera.read(1.0)
    assert frame is not None and frame.t_s == pytest.approx(4.96) and frame.seq == 7
    assert camera.lens is LENS
    camera.close()
    assert late.closed and camera.read(1.0) is None
