"""The real line: a serial port through pyserial."""

from __future__ import annotations

import contextlib
import errno
import getpass
import os
import termios
import threading

import serial

from host.errors import DeviceError
from host.link.protocol import BAUD

LINE_ERRORS = (OSError, termios.error)  # the latter is no OSError
GONE = (errno.EIO, errno.ENXIO, errno.ENODEV)
WRITE_TIMEOUT_S = 0.1  # a frame takes 1 ms; a line blocked for longer is a broken one


class SerialPort:
    """Transport over a serial port such as ``/dev/ttyACM0``, at the protocol's 250000 baud.

    Any thread may write, so that a stop need not wait for the one that drives; only one may read.

    Raises
    ------
    DeviceError
        The port is missing, forbidden or busy.
    """

    def __init__(self, path: str) -> None:
        self._path = path
        self._writing = threading.Lock()
        try:
            self._port = serial.Serial(path, BAUD, timeout=0, write_timeout=WRITE_TIMEOUT_S, exclusive=True)
        except (ValueError, *LINE_ERRORS) as error:
            raise DeviceError(why_not_open(path, error)) from None
        try:
            self._port.reset_input_buffer()
        except LINE_ERRORS as error:
            self.close()
            raise DeviceError(why_not_open(path, error)) from None

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        try:
            with self._writing:
                self._port.write(data)
        except serial.SerialTimeoutException:
            raise DeviceError(f"{self._path} takes no more bytes: check the cable, then reconnect") from None
        except LINE_ERRORS as error:
            raise self._lost(error) from None

    def read(self) -> bytes:
        """What has arrived, without waiting."""
        try:
            return self._port.read(self._port.in_waiting)
        except LINE_ERRORS as error:
            raise self._lost(error) from None

    def close(self) -> None:
        """Close the port."""
        with self._writing, contextlib.suppress(*LINE_ERRORS):  # one that is gone is as good as closed
            self._port.close()

    def _lost(self, error: Exception) -> DeviceError:
        return DeviceError(f"{self._path} is gone ({error}): plug the robot in again, then reconnect")


def why_not_open(path: str, error: Exception) -> str:
    """What an error from opening a port means, and what to do about it."""
    # termios.error is no OSError, and has its number in its arguments alone.
    number = error.args[0] if isinstance(error, termios.error) else getattr(error, "errno", None)
    if number == errno.EACCES:
        user = getpass.getuser()
        return (
            f"{path} may not be opened by {user}: run `sudo usermod -aG dialout {user}`, then log out and in"
        )
    if number == errno.ENOENT:
        ports = ", ".join(_ports())
        remedy = f"the ports here are {ports}" if ports else "plug the robot in, no serial port is here"
        return f"{path} does not exist: {remedy}"
    if number in (errno.EBUSY, errno.EAGAIN):
        return f"{path} is in use: close the other program that has it open"
    if number in GONE:
        return f"{path} went away while it was opened: check the plug, then try again"
    return f"{path} is no serial port that can be opened: name the robot's, such as /dev/ttyACM0"


def _ports() -> list[str]:
    names = sorted(name for name in os.listdir("/dev") if name.startswith(("ttyACM", "ttyUSB")))
    return [f"/dev/{name}" for name in names]
