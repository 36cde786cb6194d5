"""The robot's port found by handshake, what is said of the others, and the plug that comes back elsewhere."""

from __future__ import annotations

import contextlib
import errno
import getpass
import os
import threading
import tty
from pathlib import Path

import pytest
import serial
from plugged_robot import Plug, drive, plugged_in

from host.errors import DeviceError, UsageError
from host.link import ports, serial_port
from host.link.clock import SystemClock
from host.link.ports import RobotPort, SerialDevice, ask_all, find_robot, list_devices
from host.link.protocol import PROTOCOL_VERSION, Hello, ResetCause, State, encode
from host.link.robot import Robot
from host.link.serial_port import SerialPort
from host.nav.rig import open_rig

UNO = (0x2341, 0x0043)
PRINTER = (0x0525, 0xA4A7)


class Device(threading.Thread):
    """Something else on a port: says `words` again and again, from `after_s` on."""

    def __init__(self, words: bytes = b"", after_s: float = 0.0) -> None:
        super().__init__(daemon=True)
        self._far, self._near = os.openpty()
        tty.setraw(self._near)
        self.path = os.ttyname(self._near)
        self._words, self._after_s = words, after_s
        self._done = threading.Event()
        self.start()

    def run(self) -> None:
        os.set_blocking(self._far, False)
        self._done.wait(self._after_s)
        while not self._done.wait(0.02):
            with contextlib.suppress(BlockingIOError):
                os.write(self._far, self._words)

    def close(self) -> None:
        self._done.set()
        self.join()
        os.close(self._far)
        os.close(self._near)

    @property
    def heard(self) -> bytes:
        try:
            return os.read(self._far, 65536)
        except BlockingIOError:
            return b""


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine decides no test."""
    monkeypatch.setattr(serial_port, "WRITE_TIMEOUT_S", 5.0)


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch):
    """Makes devices on ports, which are gone at the end; nobody waits long for an answer."""
    monkeypatch.setattr(ports, "ANSWER_S", 0.6)
    made: list[Device] = []

    def make(*args, **kwargs) -> Device:
        made.append(Device(*args, **kwargs))
        return made[-1]

    yield make
    for device in made:
        device.close()


@pytest.fixture
def plug(tmp_path: Path):
    with plugged_in(tmp_path / "ttyACM0") as plug:
        yield plug


def uno(path: object, number: str | None = "7543", location: str | None = "1-1") -> SerialDevice:
    return SerialDevice(str(path), "Arduino Uno", UNO, number, location)


def test_the_one_port_that_answers_is_the_robot_and_it_is_told(plug: Plug, make):
    chatter, silent = make(b"ok T:25.1\n"), make()
    devices = [uno(silent.path, "1"), uno(plug.path), uno(chatter.path, "3")]
    told: list[str] = []
    port = RobotPort("auto", lambda: devices, told.append)
    with Robot(port.open(), SystemClock()) as robot:
        build = robot.connect().build_id
    assert port.name == str(plug.path)
    assert told == [f"robot: {plug.path} (Arduino Uno, serial number 7543): a robot, build {build:08x}"]


def test_a_robot_that_a_bootloader_holds_up_is_waited_for(make):
    late = make(b"\0" + encode(Hello(PROTOCOL_VERSION, ports.SCHEMA_HASH, 7, ResetCause.EXTERNAL, 9), 0), 0.3)
    answer = find_robot([uno(late.path)])
    assert answer.hello is not None and answer.hello.build_id == 7
    assert answer.line is not None
    answer.line.close()


def test_every_port_that_is_no_robot_is_listed_with_its_reason(make, monkeypatch: pytest.MonkeyPatch):
    other = b"\0" + encode(Hello(PROTOCOL_VERSION, 0x12345678, 7, ResetCause.EXTERNAL, 9), 0)
    chatter, silent, foreign, busy = make(b"ok T:25.1\n"), make(), make(other), make()
    holder = SerialPort(busy.path)
    real, all_at_once = serial.Serial, threading.Barrier(6, timeout=10)

    def refuse(path, *args, **kwargs):
        all_at_once.wait()
        if path == "/dev/ttyACM9":
            raise serial.SerialException(errno.EACCES, "could not open port: Permission denied")
        return real(path, *args, **kwargs)

    monkeypatch.setattr(serial, "Serial", refuse)
    monkeypatch.setattr(getpass, "getuser", lambda: "ada")
    paths = [chatter.path, silent.path, foreign.path, busy.path, "/dev/ttyACM9", "/dev/ttyGONE"]
    answers = ask_all([uno(path) for path in paths])
    said = [str(answer) for answer in answers]
    assert all(path in line for path, line in zip(paths, said, strict=True))
    assert "bytes came that no robot sends: other firmware" in said[0]
    assert "silent for 0.6 s: no robot, or one without firmware, which `make flash`" in said[1]
    assert "schema 12345678; this program has" in said[2] and "flash the firmware that belongs" in said[2]
    assert "is in use: close the other program" in said[3]
    assert "run `sudo usermod -aG dialout ada`, then log out and in" in said[4]
    assert "does not exist" in said[5]
    with pytest.raises(DeviceError) as told:
        find_robot([uno(path) for path in paths])
    assert str(told.value).startswith("robot auto: none answers. ")
    assert all(line.split(":")[0] in str(told.value) for line in said)
    assert "sudo usermod -aG dialout ada" in str(told.value)
    assert "\n" not in str(told.value)
    holder.close()
    monkeypatch.setattr(serial, "Serial", real)
    SerialPort(chatter.path).close()  # nothing was left open


def test_a_port_that_hangs_while_it_is_opened_is_not_waited_for(plug: Plug, make, monkeypatch):
    real, over = serial.Serial, threading.Event()

    def hang(path, *args, **kwargs):
        if path == "/dev/ttyHANG":
            over.wait(20)
        return real(path, *args, **kwargs)

    monkeypatch.setattr(serial, "Serial", hang)
    monkeypatch.setattr(ports, "OPEN_S", 0.2)
    answers = ask_all([uno("/dev/ttyHANG"), uno(plug.path)])
    over.set()
    assert "/dev/ttyHANG (Arduino Uno, serial number 7543): does not open within 0.8 s" in str(answers[0])
    assert answers[1].line is not None
    answers[1].line.close()


def test_of_several_robots_none_is_taken_and_how_to_choose_is_told(plug: Plug, tmp_path: Path, make):
    second = Plug(tmp_path / "ttyACM1", seed=2)
    second.start()
    second.put_in(True)
    by_id = "/dev/serial/by-id/usb-Arduino_7543-if00"
    devices = [
        SerialDevice(str(plug.path), "Arduino Uno", UNO, "7543", "1-1", by_id), uno(second.path, "8000"),
    ]  # fmt: skip
    with pytest.raises(UsageError) as told:
        find_robot(devices)
    assert all(str(device) in str(told.value) for device in devices)
    assert str(told.value).endswith(f"name one with --robot, such as --robot {by_id}")
    SerialPort(str(plug.path)).close()  # let go of
    second.end()


def test_other_usb_devices_are_left_alone_where_a_likely_one_is_the_robot(plug: Plug, make):
    printer = make()
    found = find_robot([uno(plug.path), SerialDevice(printer.path, "Printer", PRINTER, "1")])
    assert found.line is not None
    found.line.close()
    assert printer.heard == b""


def test_other_usb_devices_are_asked_where_no_likely_one_answers(plug: Plug, make):
    silent = make()
    found = find_robot([uno(silent.path), SerialDevice(str(plug.path), "Own board", PRINTER, "1")])
    assert found.line is not None and found.device.path == str(plug.path)
    found.line.close()


@pytest.mark.parametrize(
    ("devices", "words"),
    [
        ([], "no USB serial port is here: plug the robot in"),
        (
            [SerialDevice("/dev/ttyS0")],
            "/dev/ttyS0 is no USB: name one with --robot, such as --robot /dev/",
        ),
    ],
)
def test_where_nothing_can_be_a_robot_that_is_said(devices, words):
    with pytest.raises(DeviceError, match="robot auto: ") as told:
        find_robot(devices)
    assert words in str(told.value)


class Listed:
    """What pyserial tells of a port."""

    def __init__(self, device, vid=None, pid=None, product=None, serial_number=None, location=None) -> None:
        self.device, self.vid, self.pid, self.product = device, vid, pid, product
        self.serial_number, self.location = serial_number, location


def test_ports_are_listed_likeliest_first_with_the_names_that_last(tmp_path: Path, monkeypatch):
    (tmp_path / "ttyUSB3").touch()
    (tmp_path / "by-id").mkdir()
    (tmp_path / "by-id/usb-1a86_USB_Serial").symlink_to(tmp_path / "ttyUSB3")
    listed = [
        Listed("/dev/ttyS0"),
        Listed("/dev/ttyACM7", 0x0525, 0xA4A7, None, "1"),
        Listed(str(tmp_path / "ttyUSB3"), 0x1A86, 0x7523, "USB Serial", None, "1-2"),
        Listed("/dev/ttyACM0", 0x2341, 0x0043, "Arduino Uno", "7543"),
    ]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: listed)
    monkeypatch.setattr(ports, "BY_ID", str(tmp_path / "by-id"))
    devices = list_devices()
    assert [str(device) for device in devices] == [
        "/dev/ttyACM0 (Arduino Uno, serial number 7543)",
        f"{tmp_path}/ttyUSB3 (CH340, USB Serial)",
        "/dev/ttyACM7 (USB device, serial number 1)",
        "/dev/ttyS0 (serial port)",
    ]
    assert [device.likely for device in devices] == [True, True, False, False]
    assert devices[1].lasting_name == str(tmp_path / "by-id/usb-1a86_USB_Serial")


@pytest.mark.parametrize("named", ["auto", "by its path"])
def test_a_robot_that_comes_back_under_another_name_is_found_again(plug: Plug, make, named: str):
    other = make()  # of the same kind, but another number
    first, second = plug.path, plug.path.with_name("ttyACM1")
    devices = [uno(first), uno(other.path, "1")]
    told: list[str] = []
    port = RobotPort("auto" if named == "auto" else str(first), lambda: list(devices), told.append)
    with Robot(port.open(), SystemClock(), port.open) as robot:
        robot.connect()
        asked_before = other.heard
        drive(robot, 0.2)
        plug.put_in(False)
        del devices[0]
        with pytest.raises(DeviceError):
            drive(robot, 2.0)
        plug.path = second

        def come_back() -> None:
            plug.put_in(True)
            devices.append(uno(second))

        threading.Timer(0.4, come_back).start()
        back = robot.reconnect()
        assert not back.restarted
        drive(robot, 0.2)
        assert robot.latest is not None and robot.latest.state == State.DRIVING
    assert port.name == str(second)
    assert told[-1] == f"robot: now on {second} (Arduino Uno, serial number 7543)"
    assert other.heard == b""  # its number tells it apart
    assert (asked_before != b"") == (named == "auto")


def test_a_plug_that_stays_away_is_named_and_another_device_in_its_place_is_not_taken(plug: Plug, make):
    devices = [uno(plug.path)]
    port = RobotPort(str(plug.path), lambda: list(devices))
    port.open().close()
    devices[:] = [uno(plug.path, "another")]
    with pytest.raises(DeviceError, match=r"ttyACM0 \(Arduino Uno, serial number 7543\) is not plugged in"):
        port.open()


@pytest.mark.parametrize("moved", [False, True], ids=["same socket", "another socket"])
def test_chips_without_a_number_are_told_apart_by_socket_or_by_asking(plug: Plug, make, moved: bool):
    silent = make()
    devices = [uno(silent.path, None, "1-1"), uno(plug.path, None, "1-2")]
    port = RobotPort(str(plug.path), lambda: list(devices), lambda _: None)
    port.open().close()
    if moved:
        devices = [uno(silent.path, None, "1-3"), uno(plug.path, None, "1-4")]
    port.open().close()
    assert port.name == str(plug.path)
    assert (silent.heard != b"") == moved


def test_of_two_robots_without_numbers_that_changed_sockets_none_is_taken(plug: Plug, tmp_path: Path, make):
    devices = [uno(plug.path, None, "1-1")]
    port = RobotPort(str(plug.path), lambda: list(devices), lambda _: None)
    port.open().close()
    second = Plug(tmp_path / "ttyACM1", seed=2)
    second.start()
    second.put_in(True)
    devices = [uno(plug.path, None, "1-3"), uno(second.path, None, "1-4")]
    with pytest.raises(DeviceError, match=r"several answer: .*ttyACM0.*ttyACM1"):
        port.open()
    second.end()


def test_a_plug_that_is_pulled_while_the_ports_are_listed_ends_nothing(monkeypatch: pytest.MonkeyPatch):
    def comports() -> list:
        return [int(None, 16)]  # type: ignore[call-overload]  # as pyserial reads an idVendor that has gone

    monkeypatch.setattr("serial.tools.list_ports.comports", comports)
    assert list_devices() == []


def test_robot_auto_and_a_simulated_camera_do_not_go_together():
    with pytest.raises(UsageError, match="do not go together"), open_rig("sim:room?seed=1", "auto", None):
        pass
