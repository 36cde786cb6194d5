"""A board with a bootloader at a pseudo terminal, in real time: a serial port with an Uno on it."""

from __future__ import annotations

import fcntl
import os
import pty
import select
import struct
import threading
import time
import tty

from host.link.protocol import ResetCause
from host.sim.avr.board import AvrBoard

STEP_US = 1000
BEHIND_MAX_S = 0.05  # then time passes more slowly for the board than for everybody else
TCGETS2 = 0x802C542A  # of linux/termbits.h, whose speed may be any number
TERMIOS2 = "4I20x2I"


class UploadBench:
    """Runs a board in a thread while it is entered.

    Opening the port resets the board, as the control line DTR does on an Uno; the serial line has the speed
    that whoever opened it has set.

    Attributes
    ----------
    path : str
        The port.
    """

    def __init__(self, board: AvrBoard) -> None:
        self._board = board
        self._terminal, port = pty.openpty()
        tty.setraw(port)
        self.path = os.ttyname(port)
        os.close(port)
        self._running = True
        self._is_open = False
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> UploadBench:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._running = False
        self._thread.join()
        os.close(self._terminal)

    def _run(self) -> None:
        due_s = time.monotonic()
        while self._running:
            self._exchange()
            self._board.step(STEP_US)
            due_s = max(due_s + STEP_US * 1e-6, time.monotonic() - BEHIND_MAX_S)
            time.sleep(max(0.0, due_s - time.monotonic()))

    def _exchange(self) -> None:
        poll = select.poll()
        poll.register(self._terminal, select.POLLIN)
        events = dict(poll.poll(0)).get(self._terminal, 0)
        was_open, self._is_open = self._is_open, not events & select.POLLHUP
        said = self._board.read()
        if not self._is_open:
            return
        if not was_open:
            self._board.reset(ResetCause.EXTERNAL)
        self._board.set_baud(self._baud())
        if events & select.POLLIN:
            self._board.write(os.read(self._terminal, 4096))
        if said and was_open:
            os.write(self._terminal, said)

    def _baud(self) -> int:
        told = fcntl.ioctl(self._terminal, TCGETS2, bytes(struct.calcsize(TERMIOS2)))
        return struct.unpack(TERMIOS2, told)[-1]
