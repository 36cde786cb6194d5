"""A simulated robot on a port of its own, in real time, for every program that talks to a serial port.

    python -m host.sim.serve sim: --link /tmp/robot     # the firmware compiled for this machine
    python -m host.sim.serve avr:?motors=15             # the real program in a simulated ATmega328P

Prints the port's path and serves until Ctrl-C. Like a real robot's UART it does not care who listens.
"""

from __future__ import annotations

from host.errors import InputError, UsageError, begin_command, run_command

if __name__ == "__main__":
    begin_command()

import contextlib
import errno
import os
import random
import select
import signal
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from host.config import read_options
from host.record.atomic import check_writable, write_whole
from host.sim.clock import Pacer

if TYPE_CHECKING:  # so that --help need not wait for OpenCV
    from host.sim.rolling import RollingRobot

EEPROM_BYTES = 1024  # of an ATmega328P
PACE_S = 0.001  # between two looks at the line when nothing comes
REPORT_S = 5.0  # between two complaints that the machine is too slow


@dataclass(frozen=True)
class ServeOptions:
    """Put a simulated robot on a port (a pseudo-terminal) in real time, until Ctrl-C."""

    robot: Positional[Annotated[str, arg(metavar="ROBOT")]] = "sim:"  # sim: or avr:, as in sim:?seed=3
    link: Path | None = None  # make a symbolic link to the port here, removed at the end
    world: str | None = None  # what it may bump into, such as sim:room?seed=1; else an endless floor
    eeprom: Path | None = None  # keep the robot's EEPROM, and with it its parameters, in this file
    seconds: float | None = None  # serve no longer than this

    def __post_init__(self) -> None:
        if self.seconds is not None and not 0 < self.seconds < 1e9:
            raise UsageError(f"--seconds must be above 0, not {self.seconds:g}")


class Port:
    """A pseudo-terminal, raw at both ends; `path` is what other programs open."""

    def __init__(self) -> None:
        self._ours, self._theirs = os.openpty()  # theirs stays open, or each leaving program would end it
        tty.setraw(self._ours)
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        self.path = os.ttyname(self._theirs)

    def read(self, wait_s: float) -> bytes:
        """What other programs have sent, waiting at most so long for it."""
        ready, _, _ = select.select([self._ours], [], [], wait_s)
        return os.read(self._ours, 4096) if ready else b""

    def write(self, data: bytes) -> None:
        """Send; when nobody fetches it, what is old is thrown away."""
        while data:
            try:
                data = data[os.write(self._ours, data) :]
            except BlockingIOError:
                termios.tcflush(self._theirs, termios.TCIFLUSH)
                return

    def close(self) -> None:
        """Gone for those who have it open, as if unplugged."""
        os.close(self._ours)
        os.close(self._theirs)


@contextlib.contextmanager
def symbolic_link(path: Path | None, target: str) -> Iterator[None]:
    """A link to `target` for as long as the block lasts; one left over from before is replaced.

    Raises
    ------
    UsageError
        Something that is no link is there, or the place is not writable.
    """
    if path is None:
        yield
        return
    if path.exists() and not path.is_symlink():
        raise UsageError(f"--link {path}: something is there and would be lost; name another place")
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        beside.symlink_to(target)
        os.replace(beside, path)
    except OSError as error:
        raise UsageError(f"--link {path}: cannot be made ({error.strerror}); name another place") from None
    try:
        yield
    finally:
        with contextlib.suppress(OSError):  # it may be gone, or belong to a later server
            if os.readlink(path) == target:
                path.unlink()


def serve(robot: RollingRobot, port: Port, seconds: float | None, say: Callable[[str], None]) -> None:
    """Let the robot live on the port, for some seconds of real time or for ever; `say` hears when it lags."""
    line, board = robot.line(), robot.board
    begin_us = board.time_us
    pacer = Pacer()
    start_s = said_s = time.monotonic()
    told_s = 0.0
    while seconds is None or time.monotonic() - start_s < seconds:
        heard = port.read(PACE_S)
        due_us = begin_us + pacer.due_us(board.time_us - begin_us)
        robot.advance_to(max(due_us, board.time_us))
        if heard:
            line.write(heard)
        if sent := line.read():
            port.write(sent)
        now_s = time.monotonic()
        if pacer.lost_s > told_s and now_s - said_s > REPORT_S:
            share = 100 * (pacer.lost_s - told_s) / (now_s - said_s)
            for_s = now_s - said_s
            say(f"this machine is too slow: for {for_s:.0f} s the robot's time ran {share:.1f} % slow")
            told_s, said_s = pacer.lost_s, now_s
    if pacer.lost_s:
        say(f"{pacer.lost_s:.2f} s of real time were lost, at most {pacer.worst_s:.2f} s at once")


def run(options: ServeOptions) -> None:
    """The command's body."""
    from host.sim.rolling import open_rolling
    from host.sim.scenes import world_from_uri

    signal.signal(signal.SIGHUP, signal.default_int_handler)  # a closed terminal ends it as Ctrl-C does
    world = None if options.world is None else world_from_uri(options.world)
    uri = options.robot
    if "seed=" not in uri:  # as after any power-on, the boot nonce is another one
        uri += f"{'&' if '?' in uri else '?'}seed={random.SystemRandom().randrange(1 << 31)}"
    robot = open_rolling(uri, world, read_eeprom(options.eeprom))
    port = Port()
    try:
        with symbolic_link(options.link, port.path):
            print(port.path if options.link is None else f"{options.link} -> {port.path}", flush=True)
            serve(robot, port, options.seconds, lambda text: print(text, file=sys.stderr, flush=True))
    except OSError as error:
        if error.errno == errno.EIO:
            raise UsageError(f"{port.path} was taken away: is /dev/pts mounted?") from None
        raise
    finally:
        port.close()
        if options.eeprom is not None:
            write_whole(options.eeprom, robot.board.eeprom)


def read_eeprom(path: Path | None) -> bytes:
    """What was kept last time; nothing where there is no file yet.

    Raises
    ------
    InputError, UsageError
        The file cannot be an EEPROM, or none can be written there.
    """
    if path is None:
        return b""
    check_writable(path, folder=False)
    if not path.exists():
        return b""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    if len(content) != EEPROM_BYTES:
        raise InputError(
            f"{path}: is no EEPROM of {EEPROM_BYTES} bytes, and would be overwritten; name another"
        )
    return content


def main() -> None:
    """The command."""
    run(read_options(ServeOptions))


if __name__ == "__main__":
    run_command(main)
