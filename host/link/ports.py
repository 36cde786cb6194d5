"""Which serial port is the robot's: the one that answers HELLO, and later the same plug wherever it is."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from host.by_id import lasting_names
from host.errors import DeviceError, UsageError, tell
from host.link.protocol import PROTOCOL_VERSION, SCHEMA_HASH, Decoder, Hello, HelloRequest, encode
from host.link.serial_port import SerialPort

AUTO = "auto"
BY_ID = "/dev/serial/by-id"
# Makers of the chips between USB and a robot's processor.
ROBOT_MAKERS = {0x2341: "Arduino", 0x2A03: "Arduino", 0x1A86: "CH340", 0x0403: "FTDI", 0x10C4: "CP210x"}
ANSWER_S = 3.0  # opening a port resets an Arduino, whose bootloader then waits up to 2 s
OPEN_S = 1.0  # beyond that, for a port that hangs while it is opened
ASK_AGAIN_S = 0.1
LISTEN_S = 0.005
NAME_ONE = "name one with --robot, such as --robot {}"


@dataclass(frozen=True)
class SerialDevice:
    """A serial port that this machine has."""

    path: str  # such as /dev/ttyACM0
    what: str = "serial port"  # in a person's words
    usb: tuple[int, int] | None = None  # vendor and product
    serial_number: str | None = None
    location: str | None = None  # of the USB socket
    lasting_name: str | None = None  # below /dev/serial/by-id, the same after every plugging in

    def __str__(self) -> str:
        number = f", serial number {self.serial_number}" if self.serial_number else ""
        return f"{self.path} ({self.what}{number})"

    @property
    def likely(self) -> bool:
        """Has it a chip as robots have?"""
        return self.usb is not None and self.usb[0] in ROBOT_MAKERS

    def same_plug(self, other: SerialDevice) -> bool:
        """Can the other be this one, as far as USB tells?"""
        return (self.usb, self.serial_number) == (other.usb, other.serial_number)


def list_devices() -> list[SerialDevice]:
    """The serial ports of this machine, likeliest first."""
    from serial.tools import list_ports

    names = lasting_names(BY_ID)
    try:
        ports = list_ports.comports()
    except (OSError, TypeError, ValueError):  # a plug was pulled out while it was looked at
        return []
    devices = []
    for port in ports:
        usb = None if port.vid is None or port.pid is None else (port.vid, port.pid)
        maker = None if usb is None else ROBOT_MAKERS.get(usb[0])
        what = port.product or maker or ("serial port" if usb is None else "USB device")
        if maker is not None and maker.lower() not in what.lower():
            what = f"{maker}, {what}"
        lasting_name = names.get(os.path.realpath(port.device))
        devices.append(SerialDevice(port.device, what, usb, port.serial_number, port.location, lasting_name))
    return sorted(devices, key=lambda device: (not device.likely, device.usb is None, device.path))


@dataclass
class Answer:
    """What came of asking at a port; `line` stays open where a robot answered."""

    device: SerialDevice
    why_not: str = ""  # no robot that can be driven, in words for a person; empty where it is one
    hello: Hello | None = None
    line: SerialPort | None = field(default=None, repr=False)

    def __str__(self) -> str:
        if self.hello is not None and not self.why_not:
            return f"{self.device}: a robot, build {self.hello.build_id:08x}"
        path = self.device.path
        # An error from opening names the path itself.
        return self.why_not if self.why_not.startswith(path) else f"{self.device}: {self.why_not}"


def ask_all(devices: Sequence[SerialDevice]) -> list[Answer]:
    """Say HELLO at all ports at once; done when all have answered or `ANSWER_S` is over.

    Whoever asks has the open lines and must close them.
    """
    answers = [Answer(device) for device in devices]
    over = threading.Event()
    threads = [
        threading.Thread(target=_ask, args=(answer, over), name=answer.device.path, daemon=True)
        for answer in answers
    ]
    for thread in threads:
        thread.start()
    give_up_s = time.monotonic() + ANSWER_S + OPEN_S
    for thread in threads:
        thread.join(max(0.0, give_up_s - time.monotonic()))
    over.set()
    out = []
    for answer, thread in zip(answers, threads, strict=True):
        if thread.is_alive():
            answer = Answer(answer.device, f"does not open within {ANSWER_S + OPEN_S:g} s: pull it out")
        elif answer.line is not None:
            with contextlib.suppress(DeviceError):  # which whoever uses it will hear again
                answer.line.read()  # what was said while others were waited for
        out.append(answer)
    return out


def _ask(answer: Answer, over: threading.Event) -> None:
    """Fill in the answer of one port."""
    try:
        line = SerialPort(answer.device.path)
    except DeviceError as error:
        answer.why_not = str(error)
        return
    try:
        answer.hello, heard = _handshake(line, over)
    except DeviceError as error:
        answer.why_not = str(error)
        line.close()
        return
    hello = answer.hello
    if hello is None and heard:
        answer.why_not = f"{heard} bytes came that no robot sends: other firmware, or another device"
    elif hello is None:
        answer.why_not = (
            f"silent for {ANSWER_S:g} s: no robot, or one without firmware, which `make flash` puts on it"
        )
    elif (hello.protocol_version, hello.schema_hash) != (PROTOCOL_VERSION, SCHEMA_HASH):
        answer.why_not = (
            f"a robot of protocol {hello.protocol_version}, schema {hello.schema_hash:08x}; this program has "
            f"{PROTOCOL_VERSION}, {SCHEMA_HASH:08x}: flash the firmware that belongs to this program"
        )
    if answer.why_not or over.is_set():
        line.close()
    else:
        answer.line = line


def _handshake(line: SerialPort, over: threading.Event) -> tuple[Hello | None, int]:
    """(what a robot said, bytes that were heard)."""
    decoder, heard, seq, asked_s = Decoder(to_host=True), 0, 0, float("-inf")
    give_up_s = time.monotonic() + ANSWER_S
    while (now_s := time.monotonic()) < give_up_s and not over.is_set():
        if now_s - asked_s >= ASK_AGAIN_S:
            line.write(b"\0" + encode(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH), seq & 0xFF))
            seq, asked_s = seq + 1, now_s
        time.sleep(LISTEN_S)
        data = line.read()
        heard += len(data)
        for received in decoder.feed(data):
            if isinstance(received.message, Hello):
                return received.message, heard
    return None, heard


def find_robot(devices: Sequence[SerialDevice]) -> Answer:
    """The one robot among the ports, with its line open.

    Ports with chips as robots have are asked first; the other USB ports only where none of those is one,
    since a port that is opened may restart what hangs on it.

    Raises
    ------
    DeviceError
        None answers, with the reason for each port.
    UsageError
        Several do, with how to choose.
    """
    asked: list[Answer] = []
    for group in ([d for d in devices if d.likely], [d for d in devices if d.usb and not d.likely]):
        answers = ask_all(group)
        found = [answer for answer in answers if answer.line is not None]
        if len(found) == 1:
            return found[0]
        if found:
            for answer in found:
                if answer.line is not None:
                    answer.line.close()
            names = [answer.device.lasting_name or answer.device.path for answer in found]
            several = ", ".join(str(answer.device) for answer in found)
            raise UsageError(f"robot {AUTO}: several answer: {several}; {NAME_ONE.format(names[0])}")
        asked += answers
    if not asked:
        plain = [device.path for device in devices]
        is_no = "are no" if len(plain) > 1 else "is no"
        other = f"; {', '.join(plain)} {is_no} USB: {NAME_ONE.format(plain[0])}" if plain else ""
        raise DeviceError(f"robot {AUTO}: no USB serial port is here: plug the robot in{other}")
    raise DeviceError(f"robot {AUTO}: none answers. {'. '.join(map(str, asked))}")


class RobotPort:
    """Where a robot is plugged in: a port that is named, or looked for by ``auto``.

    `open` gives its line, and after an unplugging a new one, also where the same plug has come back under
    another name, as ttyACM1 instead of ttyACM0.

    Parameters
    ----------
    robot
        A port's path, or ``auto``.
    devices
        The ports there are; those of this machine by default.
    tell
        Hears which port was found, in one line.

    Attributes
    ----------
    name : str
        The port's path, once it has been opened.
    """

    def __init__(
        self,
        robot: str,
        devices: Callable[[], list[SerialDevice]] = list_devices,
        tell: Callable[[str], None] = tell,
    ) -> None:
        self.name = robot
        self._devices, self._tell = devices, tell
        self._opened = False
        self._device: SerialDevice | None = None  # what is known of the plug

    def open(self) -> SerialPort:
        """Its line, opened anew.

        Raises
        ------
        DeviceError, UsageError
            As `find_robot` and the serial port say. Later on only the former: the plug is not back, or it
            cannot be told which it is.
        """
        if self._opened:
            return self._open_again()
        if self.name == AUTO:
            found = find_robot(self._devices())
            assert found.line is not None, "that is what found means"
            line, self._device = found.line, found.device
            self.name = found.device.path
            self._tell(f"robot: {found}")
        else:
            line = SerialPort(self.name)
            real = os.path.realpath(self.name)
            self._device = next((d for d in self._devices() if os.path.realpath(d.path) == real), None)
        self._opened = True
        return line

    def _open_again(self) -> SerialPort:
        if self._device is None or self._device.usb is None:
            return SerialPort(self.name)
        same = [device for device in self._devices() if device.same_plug(self._device)]
        if len(same) > 1:  # chips without a number of their own are told apart by their sockets
            same = [device for device in same if device.location == self._device.location] or same
        if not same:
            raise DeviceError(f"{self._device} is not plugged in: plug it in again")
        if len(same) == 1:
            line, device = SerialPort(same[0].path), same[0]
        else:
            try:
                found = find_robot(same)
            except UsageError as error:  # in the middle of a drive nobody can choose
                raise DeviceError(str(error)) from None
            assert found.line is not None, "that is what found means"
            line, device = found.line, found.device
        if os.path.realpath(device.path) != os.path.realpath(self.name):
            self._tell(f"robot: now on {device}")
        self.name, self._device = device.path, device
        return line
