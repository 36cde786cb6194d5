"""The simulated robot as the program meets it: a camera, a line and a clock, all in one virtual time."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from host.errors import DeviceError, UsageError
from host.link.protocol import State
from host.link.robot import Robot
from host.sim.board import Board
from host.sim.body import Body, BodyModel
from host.sim.render import IDEAL, Webcam
from host.sim.scenes import world_from_uri
from host.sim.session import Simulation
from host.sim.things import moved


def drive(simulation: Simulation, frames: int, v_mm_s: float, omega_rad_s: float) -> Robot:
    robot = Robot(simulation.transport, simulation.clock)
    robot.connect()
    for _ in range(frames):
        simulation.camera.read(0.3)
        robot.poll()
        robot.drive(v_mm_s, omega_rad_s)
    return robot


def test_the_firmware_drives_the_body_at_the_speed_asked_for() -> None:
    simulation = Simulation("sim:boxes", webcam=IDEAL)
    robot = drive(simulation, 30, 200.0, 0.0)
    assert simulation.body.speed_cm_s == pytest.approx(20.0, abs=1.0)
    assert robot.latest is not None and robot.latest.state == State.DRIVING
    travelled_cm = 0.25 * (robot.latest.count_left + robot.latest.count_right)
    assert travelled_cm == pytest.approx(simulation.body.distance_cm, abs=0.8)


def test_omega_is_positive_to_the_right_from_the_line_to_the_pose() -> None:
    simulation = Simulation("sim:boxes", webcam=IDEAL)
    drive(simulation, 20, 0.0, 0.5)
    rotation = simulation.true_pose(simulation.clock.now_s()).rotation
    assert 0.4 < math.atan2(rotation[0, 2], rotation[2, 2]) < 0.7


def test_a_program_that_falls_silent_is_stopped_by_the_dead_man() -> None:
    simulation = Simulation("sim:boxes", webcam=IDEAL)
    drive(simulation, 20, 200.0, 0.0)
    simulation.clock.sleep_s(1.0)
    assert simulation.body.speed_cm_s == 0.0


def test_equal_calls_give_equal_pictures_bytes_and_poses() -> None:
    def run() -> tuple:
        simulation = Simulation("sim:room?seed=5")
        drive(simulation, 6, 150.0, 0.2)
        frame = simulation.camera.read(0.3)
        assert frame is not None
        return (
            frame.image.tobytes(),
            simulation.transport.read(),
            tuple(simulation.true_pose(0.4).position_cm),
        )

    assert run() == run()


def test_how_time_is_cut_up_changes_nothing() -> None:
    """Waiting often and briefly, or once and long: the same body and the same board."""
    ends = []
    for pieces in (1, 7, 1000):
        simulation = Simulation("sim:boxes", webcam=IDEAL)
        drive(simulation, 10, 200.0, 0.3)
        for _ in range(pieces):
            simulation.clock.sleep_s(0.1 / pieces)
        simulation.clock.sleep_s(0.8 - simulation.clock.now_s())
        pose = simulation.true_pose(0.79)
        ends.append((*pose.position_cm, pose.rotation[0, 2]))
    assert ends[0] == ends[1] == ends[2]


def test_sleep_adds_up_to_the_microsecond_however_short_its_pieces() -> None:
    simulation = Simulation("sim:boxes")
    for _ in range(10_000):
        simulation.clock.sleep_s(0.3e-6)
    assert simulation.clock.now_s() == pytest.approx(0.003, abs=1.5e-6)


def test_reading_the_camera_takes_virtual_time_until_the_next_frame() -> None:
    simulation = Simulation("sim:boxes", webcam=IDEAL, fps=20.0)
    frames = [simulation.camera.read(0.3) for _ in range(4)]
    assert [frame.seq for frame in frames if frame] == [0, 1, 2, 3]
    assert [frame.t_s for frame in frames if frame] == pytest.approx([0.0, 0.05, 0.10, 0.15])
    assert simulation.clock.now_s() == pytest.approx(0.15)


def test_a_slow_reader_gets_the_newest_frame_with_its_own_time_and_place() -> None:
    simulation = Simulation("sim:boxes", webcam=IDEAL, fps=10.0)
    drive(simulation, 10, 300.0, 0.0)
    last = round(simulation.clock.now_s() * 10)
    simulation.clock.sleep_s(0.15)
    late = simulation.camera.read(0.3)
    assert late is not None and late.seq == last + 1
    assert simulation.clock.now_s() == pytest.approx(late.t_s + 0.05)
    there = simulation.renderer.light(simulation.true_pose(late.t_s))
    again = simulation._webcam.take(there, late.t_s, late.seq)
    assert np.array_equal(late.image, again)
    here = simulation.renderer.light(simulation.true_pose(simulation.clock.now_s()))
    assert not np.array_equal(late.image, simulation._webcam.take(here, late.t_s, late.seq))


@pytest.mark.parametrize("fps", [15.0, 29.97, 30.0, 7.3])
def test_every_frame_is_read_once_at_any_rate(fps: float) -> None:
    """Rounding of frame times must neither repeat nor skip one."""
    simulation = Simulation("sim:boxes", fps=fps)
    taken: list[int] = []
    camera = simulation.camera
    camera._take = lambda t_us, seq: (taken.append(seq) or np.zeros((1, 1, 3), np.uint8), None)  # is quick
    for _ in range(300):
        camera.read(0.5)
    assert taken == list(range(300))


def test_a_frame_beyond_the_timeout_is_a_device_error_and_the_time_has_passed() -> None:
    simulation = Simulation("sim:boxes", webcam=IDEAL, fps=5.0)
    simulation.camera.read(0.3)
    with pytest.raises(DeviceError, match=r"no picture within 0\.1 s"):
        simulation.camera.read(0.1)
    assert simulation.clock.now_s() == pytest.approx(0.1)
    frame = simulation.camera.read(0.3)
    assert frame is not None and frame.seq == 1


def test_a_closed_camera_is_at_its_end() -> None:
    simulation = Simulation("sim:boxes")
    simulation.camera.close()
    assert simulation.camera.read(0.3) is None


def test_frames_are_colour_pictures_of_the_lens_size() -> None:
    simulation = Simulation("sim:room?seed=2")
    frame, lens = simulation.camera.read(0.3), simulation.camera.lens
    assert frame is not None and lens is not None
    assert frame.image.shape == (lens.height, lens.width, 3) and frame.image.dtype == np.uint8
    assert frame.image.std() > 10


def test_what_the_program_gets_shows_no_truth() -> None:
    simulation = Simulation("sim:boxes")
    for thing in (simulation.camera, simulation.transport, simulation.clock):
        shown = {name for name in dir(thing) if not name.startswith("_")}
        assert shown <= {"lens", "read", "write", "close", "now_s", "sleep_s"}


@pytest.mark.parametrize("uri", ["sim:moon", "sim:room?colour=3", "sim:room?seed=x"])
def test_a_world_that_does_not_exist_is_a_usage_error(uri: str) -> None:
    with pytest.raises(UsageError, match=r"known are|whole number"):
        Simulation(uri)


@pytest.mark.parametrize("fps", [0.0, 1001.0, math.nan])
def test_an_impossible_frame_rate_is_refused(fps: float) -> None:
    with pytest.raises(ValueError, match="fps"):
        Simulation("sim:boxes", fps=fps)


# --- A camera that takes its time, and a world that moves -------------------------------------------


def test_each_row_of_a_picture_taken_while_turning_shows_the_world_from_where_the_camera_was_then() -> None:
    readout_s = 0.04
    simulation = Simulation("sim:boxes", webcam=replace(IDEAL, readout_s=readout_s))
    drive(simulation, 6, 0.0, 1.0)
    frame = simulation.camera.read(0.3)
    assert frame is not None
    develop = Webcam(IDEAL, simulation.world.lens, 0)
    pictures = []
    for row in (5, 105, 235):
        then = simulation.true_pose(frame.t_s + readout_s * ((row + 0.5) / 240 - 0.5))
        picture = develop.take(simulation.renderer.light(then), 0.0, 0).astype(int)
        # a row's moment is known to a twelfth of the readout, in which the picture moves by a pixel
        wrong = np.abs(picture[row] - frame.image[row]).max(axis=1) > 24
        assert wrong.mean() < 0.04
        pictures.append(picture)
    apart = np.abs(pictures[2][105] - pictures[0][105]).max(axis=1) > 24
    assert apart.mean() > 0.1  # else this would prove nothing


def test_a_camera_at_rest_sees_the_same_however_slowly_its_rows_are_read() -> None:
    images = []
    for readout_s in (0.0, 0.03):
        simulation = Simulation("sim:boxes", webcam=replace(IDEAL, psf_px=0.65, readout_s=readout_s))
        frame = simulation.camera.read(0.3)
        assert frame is not None
        images.append(frame.image.astype(int))
    assert np.abs(images[1] - images[0]).max() <= 1


def test_a_late_picture_comes_late_in_turn_and_says_when_it_was_taken() -> None:
    webcam = replace(IDEAL, readout_s=0.02, latency_s=0.05, jitter_s=0.03, stamp_late_s=0.01)
    simulation = Simulation("sim:boxes", webcam=webcam, fps=20)
    delays = []
    for seq in range(15):
        frame = simulation.camera.read(0.3)
        assert frame is not None and frame.seq == seq
        taken_s = seq / 20 + 0.01
        assert frame.t_s == pytest.approx(taken_s + 0.01, abs=1e-6)
        delays.append(simulation.clock.now_s() - taken_s)
    assert 0.06 - 1e-6 <= min(delays) < max(delays) <= 0.09 + 1e-6
    assert np.std(delays) > 0.004


def test_a_mover_is_elsewhere_in_a_later_picture_and_stops_who_drives_into_it() -> None:
    simulation = Simulation("sim:room?seed=2&movers=1", webcam=IDEAL)
    (mover,) = simulation.world.movers
    start, later = mover.at(0.0), mover.at(1.0)
    assert math.hypot(later.x_cm - start.x_cm, later.z_cm - start.z_cm) == pytest.approx(mover.speed_cm_s)
    first = simulation.camera.read(0.3)
    simulation.clock.sleep_s(1.5)
    second = simulation.camera.read(0.3)
    assert first is not None and second is not None
    assert np.abs(second.image.astype(int) - first.image).max() > 40

    standing = replace(mover, thing=moved(mover.thing, -mover.thing.x_cm, 40.0 - mover.thing.z_cm))
    standing = replace(standing, other_end_cm=(0.5, 40.0))
    world = replace(simulation.world, movers=(standing,))
    board = Board(0)
    body = Body(world, board, BodyModel(), 0)
    body._left.speed_cm_s = body._right.speed_cm_s = 40.0
    for _ in range(2000):
        body._left.speed_cm_s = body._right.speed_cm_s = 40.0
        body.step()
        board.step(1000)
    assert body.collisions == 1


@pytest.mark.parametrize("scene", ["room", "corridor", "clutter"])
def test_every_world_has_a_mover_that_crosses_the_straight_way_and_keeps_clear(scene: str) -> None:
    for seed in range(60):
        world = world_from_uri(f"sim:{scene}?seed={seed}&movers=1")
        (mover,) = world.movers
        times_s = np.arange(0.0, 60.0, 0.2)
        places = np.array([(mover.at(t).x_cm, mover.at(t).z_cm) for t in times_s])
        assert world.distance_cm(places).min() > mover.thing.reach_cm
        goal = np.array(world.goal_cm)
        along, aside = goal / np.hypot(*goal), np.array([goal[1], -goal[0]]) / np.hypot(*goal)
        way, off = places @ along, places @ aside
        assert way.std() < 1e-6 and 0.3 < way.mean() / np.hypot(*goal) < 0.75
        assert off.min() < -mover.thing.reach_cm - 8 and off.max() > mover.thing.reach_cm + 8
        crossings_s = times_s[1:][np.sign(off[1:]) != np.sign(off[:-1])]
        assert np.diff(crossings_s).max() < 12.5
        met_s = (way.mean() - 40.0) / 14.0
        assert np.abs(crossings_s - met_s).min() < 0.5


def test_things_that_leave_a_mover_no_room_are_taken_away_and_no_others() -> None:
    plain, crossed = (world_from_uri(f"sim:room?seed=3{more}") for more in ("", "&movers=1"))
    assert 1 <= len(plain.things) - len(crossed.things) <= 4
    assert set(crossed.things) < set(plain.things)
    plain, crossed = (world_from_uri(f"sim:room?seed=4{more}") for more in ("", "&movers=1"))
    assert crossed.things == plain.things


def test_the_uri_says_how_many_frames_a_second() -> None:
    for uri, fps in (("sim:room?seed=1", 15), ("sim:clutter?fps=60", 60), ("sim:corridor?fps=5", 5)):
        simulation = Simulation(uri, webcam=IDEAL)
        simulation.camera.read(0.3)
        frame = simulation.camera.read(0.3)
        assert frame is not None and frame.t_s == pytest.approx(1 / fps, abs=1e-6)
    for uri in ("sim:room?fps=4", "sim:room?fps=61", "sim:boxes?fps=15"):
        with pytest.raises(UsageError, match=r"from 5 to 60|has no parameter 'fps'"):
            Simulation(uri)


def test_a_webcams_jpeg_comes_with_the_picture_that_it_is_decoded_to():
    frame = Simulation("sim:room?seed=1").camera.read(1.0)
    assert frame is not None and frame.encoded is not None
    decoded = cv2.imdecode(np.frombuffer(frame.encoded, np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(decoded, frame.image)
    bare = Simulation("sim:room?seed=1", webcam=IDEAL).camera.read(1.0)
    assert bare is not None and bare.encoded is None
