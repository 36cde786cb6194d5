"""A simulated robot on a pseudo-terminal, driven by programs that know of serial ports alone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from host.errors import UsageError
from host.link.clock import SystemClock
from host.link.parameters import Param
from host.link.robot import Robot
from host.link.serial_port import SerialPort
from host.sim.clock import LATE_S, Pacer
from host.sim.serve import symbolic_link

SERVE = [sys.executable, "-m", "host.sim.serve"]
STRANGER = """
import sys, time, serial
from host.link.protocol import Decoder, HelloRequest, PROTOCOL_VERSION, SCHEMA_HASH, Hello, encode
port = serial.Serial(sys.argv[1], 250000, timeout=0.05, exclusive=True)
decoder, until_s, seq = Decoder(to_host=True), time.monotonic() + 5, 0
heard = []
while time.monotonic() < until_s and not any(isinstance(m, Hello) for m in heard):
    port.write(b"\\0" + encode(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH), seq))
    seq += 1
    heard += [received.message for received in decoder.feed(port.read(4096))]
print(sorted({type(message).__name__ for message in heard}))
"""


@pytest.fixture
def served(tmp_path: Path):
    """A server with a link to its port; ended however the test leaves it."""
    link = tmp_path / "robot"
    process = subprocess.Popen([*SERVE, "sim:", "--link", str(link)], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith(f"{link} -> /dev/"), line
        yield process, link
    finally:
        process.kill()
        process.wait()


def test_a_program_with_nothing_but_pyserial_talks_to_it(served) -> None:
    _, link = served
    told = subprocess.run(
        [sys.executable, "-c", STRANGER, str(link)], capture_output=True, text=True, timeout=30, check=True
    )
    assert "Hello" in told.stdout


def test_the_client_drives_it_and_time_is_real(served) -> None:
    _, link = served
    clock = SystemClock()
    with Robot(SerialPort(str(link)), clock) as robot:
        robot.connect()
        begin_s, begin = clock.now_s(), robot.latest
        while clock.now_s() - begin_s < 1.5:
            robot.drive(200.0, 0.0)
            clock.sleep_s(0.02)
            robot.poll()
        passed_s = clock.now_s() - begin_s
        assert begin is not None and robot.latest is not None
        mcu_s = (robot.latest.mcu_time_us - begin.mcu_time_us) * 1e-6
        assert mcu_s == pytest.approx(passed_s, abs=0.2)  # two polls' lateness on a busy machine
        assert robot.latest.count_left - begin.count_left > 20


def test_it_can_be_opened_again_and_nothing_is_echoed(served) -> None:
    _, link = served
    for _ in range(2):
        with Robot(SerialPort(str(link)), SystemClock()) as robot:
            robot.connect()
            status = robot.robot_counters
    assert status is None or status.unknown == 0  # an echo would be messages of the wrong direction


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_it_with_130_and_takes_the_link_along(served, number: signal.Signals) -> None:
    process, link = served
    process.send_signal(number)
    assert process.wait(timeout=10) == 130
    assert not link.is_symlink()


def test_those_who_have_the_port_open_see_it_go(served) -> None:
    process, link = served
    port = os.open(link, os.O_RDWR | os.O_NOCTTY)
    process.send_signal(signal.SIGTERM)
    process.wait(timeout=10)
    time.sleep(0.05)
    try:
        with pytest.raises(OSError):
            while True:
                if not os.read(port, 4096):
                    raise OSError("end of file")
    finally:
        os.close(port)


def test_it_serves_for_as_long_as_asked_and_ends_well() -> None:
    done = subprocess.run([*SERVE, "sim:", "--seconds", "0.3"], capture_output=True, text=True, timeout=30)
    assert done.returncode == 0 and done.stdout.startswith("/dev/")


def test_a_stale_link_is_replaced_and_a_later_servers_is_left(tmp_path: Path) -> None:
    path = tmp_path / "robot"
    path.symlink_to("/nowhere")
    with symbolic_link(path, "/dev/null"):
        assert os.readlink(path) == "/dev/null"
        path.unlink()
        path.symlink_to("/dev/zero")
    assert os.readlink(path) == "/dev/zero"


def test_a_link_never_replaces_a_file(tmp_path: Path) -> None:
    path = tmp_path / "thesis.txt"
    path.write_text("precious")
    with (
        pytest.raises(UsageError, match="something is there and would be lost"),
        symbolic_link(path, "/dev/null"),
    ):
        pass
    assert path.read_text() == "precious"


def test_a_link_where_none_can_be_is_refused(tmp_path: Path) -> None:
    with (
        pytest.raises(UsageError, match="cannot be made"),
        symbolic_link(tmp_path / "no/such/folder/robot", "/dev/null"),
    ):
        pass


def test_parameters_saved_are_there_when_it_is_served_again(tmp_path: Path) -> None:
    kept, link = tmp_path / "eeprom.bin", tmp_path / "robot"
    values, nonces = [], set()
    for _ in range(2):
        arguments = ["sim:", "--link", str(link), "--eeprom", str(kept)]
        with subprocess.Popen([*SERVE, *arguments], stdout=subprocess.PIPE, text=True) as server:
            assert server.stdout is not None and server.stdout.readline()
            with Robot(SerialPort(str(link)), SystemClock()) as robot:
                nonces.add(robot.connect().boot_nonce)
                values.append(robot.read_param(Param.TRACK_UM))
                robot.write_param(Param.TRACK_UM, 151_234)
                robot.save_params()
            server.terminate()
    assert values == [150_000, 151_234]
    assert len(nonces) == 2


def test_a_file_that_is_no_eeprom_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "thesis.txt"
    path.write_text("precious")
    done = subprocess.run([*SERVE, "sim:", "--eeprom", str(path)], capture_output=True, text=True, timeout=30)
    assert done.returncode == 3 and "is no EEPROM of 1024 bytes" in done.stderr
    assert path.read_text() == "precious"


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["simm:"], "write sim: or avr:"),
        (["sim:", "--world", "sim:moon"], "no such simulated scene"),
        (["sim:", "--seconds", "0"], "--seconds must be above 0"),
        (["sim:", "--lnk", "x"], "did you mean --link"),
    ],
)
def test_a_wrong_command_line_gets_one_line_and_code_2(arguments: list[str], complaint: str) -> None:
    done = subprocess.run([*SERVE, *arguments], capture_output=True, text=True, timeout=30)
    assert done.returncode == 2 and complaint in done.stderr and done.stderr.count("\n") == 1


def test_a_machine_that_keeps_up_loses_nothing() -> None:
    now_s = 10.0
    pacer = Pacer(lambda: now_s)
    reached_us = 0
    for _ in range(100):
        now_s += 0.9 * LATE_S
        reached_us = pacer.due_us(reached_us)
    assert pacer.lost_s == 0.0 and reached_us == pytest.approx(100 * 0.9 * LATE_S * 1e6, abs=1)


def test_a_machine_that_stalls_goes_on_from_there_and_says_how_much_was_lost() -> None:
    now_s = 10.0
    pacer = Pacer(lambda: now_s)
    now_s += 3.0
    assert pacer.due_us(0) == 0
    assert pacer.lost_s == pytest.approx(3.0) and pacer.worst_s == pytest.approx(3.0)
    now_s += 0.01
    assert pacer.due_us(0) == pytest.approx(10_000, abs=1)
