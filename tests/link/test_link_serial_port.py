"""The serial port on a pseudo-terminal, and what a person is told when it cannot be had."""

from __future__ import annotations

import contextlib
import errno
import getpass
import os
import termios
import threading
import time
import tty
from pathlib import Path

import pytest
import serial

from host.errors import DeviceError
from host.link.serial_port import SerialPort


@pytest.fixture
def line():
    """The far end of a line, and the path of the near one."""
    far, near = os.openpty()
    tty.setraw(near)
    yield far, os.ttyname(near)
    os.close(near)
    with contextlib.suppress(OSError):  # some tests have unplugged it
        os.close(far)


def test_bytes_go_both_ways_unchanged(line):
    far, path = line
    port = SerialPort(path)
    everything = bytes(range(256))
    port.write(everything)
    assert os.read(far, 1000) == everything
    assert port.read() == b""
    os.write(far, everything)
    until_s = time.monotonic() + 1
    received = b""
    while len(received) < 256 and time.monotonic() < until_s:
        received += port.read()
    assert received == everything
    port.close()


def test_what_came_before_the_port_was_opened_is_forgotten(line):
    far, path = line
    os.write(far, b"old")
    port = SerialPort(path)
    os.write(far, b"new")
    time.sleep(0.01)
    assert port.read() == b"new"
    port.close()


def test_a_missing_port_is_named(tmp_path: Path):
    with pytest.raises(DeviceError, match="ttyNONE does not exist") as told:
        SerialPort(str(tmp_path / "ttyNONE"))
    assert "\n" not in str(told.value)


def test_a_forbidden_port_names_the_group_and_the_command(monkeypatch: pytest.MonkeyPatch):
    def refuse(*_, **__):
        raise serial.SerialException(errno.EACCES, "could not open port /dev/ttyACM0: Permission denied")

    monkeypatch.setattr(serial, "Serial", refuse)
    monkeypatch.setattr(getpass, "getuser", lambda: "ada")
    with pytest.raises(DeviceError) as told:
        SerialPort("/dev/ttyACM0")
    assert str(told.value) == (
        "/dev/ttyACM0 may not be opened by ada: run `sudo usermod -aG dialout ada`, then log out and in"
    )


def test_a_port_in_use_is_said_to_be(line):
    _, path = line
    port = SerialPort(path)
    with pytest.raises(DeviceError, match="in use: close the other program"):
        SerialPort(path)
    port.close()


def test_a_file_that_is_no_port_is_said_to_be_none(tmp_path: Path):
    (tmp_path / "notes.txt").write_text("hello")
    with pytest.raises(DeviceError, match=r"notes\.txt is no serial port that can be opened: name"):
        SerialPort(str(tmp_path / "notes.txt"))


def test_an_unplugged_port_is_said_to_be_gone(line):
    far, path = line
    port = SerialPort(path)
    os.close(far)
    with pytest.raises(DeviceError, match=r"is gone .*: plug the robot in again"):
        port.read()
    port.close()


def refuse(*_: object) -> None:
    raise termios.error(errno.EIO, "Input/output error")


def test_a_port_that_goes_while_it_is_opened_is_said_to_and_not_held(line, monkeypatch: pytest.MonkeyPatch):
    _, path = line
    open_files = len(os.listdir("/proc/self/fd"))
    with monkeypatch.context() as patch:
        patch.setattr(termios, "tcflush", refuse)
        with pytest.raises(DeviceError, match="went away while it was opened: check the plug"):
            SerialPort(path)
    assert len(os.listdir("/proc/self/fd")) == open_files
    SerialPort(path).close()


@pytest.mark.parametrize(
    ("method", "act"), [("read", lambda port: port.read()), ("write", lambda port: port.write(b"x"))]
)
def test_an_error_of_the_terminal_is_a_port_that_is_gone(line, monkeypatch: pytest.MonkeyPatch, method, act):
    _, path = line
    port = SerialPort(path)
    monkeypatch.setattr(serial.Serial, method, refuse)
    with pytest.raises(DeviceError, match=r"is gone .*: plug the robot in again"):
        act(port)
    port.close()


def test_a_line_that_takes_nothing_more_is_not_waited_for(line):
    _, path = line
    port = SerialPort(path)
    began_s = time.monotonic()
    with pytest.raises(DeviceError, match="takes no more bytes"):
        for _ in range(100):
            port.write(b"\x55" * 4096)
    assert time.monotonic() - began_s < 1
    port.close()


def test_two_threads_may_write_and_neither_breaks_into_the_others_bytes(line):
    far, path = line
    port = SerialPort(path)
    pieces = {b"a" * 3000, b"b" * 3000}
    writers = [
        threading.Thread(target=lambda piece=piece: [port.write(piece) for _ in range(20)])
        for piece in pieces
    ]
    for writer in writers:
        writer.start()
    received = b""
    while len(received) < 2 * 20 * 3000:
        received += os.read(far, 65536)
    for writer in writers:
        writer.join()
    assert {received[k : k + 3000] for k in range(0, len(received), 3000)} == pieces
    port.close()
