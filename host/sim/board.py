"""The robot's board without the board: the firmware's C, compiled for this machine, in virtual time."""

from __future__ import annotations

import threading
from enum import IntEnum

from host.errors import DeviceError
from host.link.protocol import ResetCause
from host.sim import _board


class Side(IntEnum):
    """Which wheel."""

    LEFT = 0
    RIGHT = 1


class Board:
    """One board: serial line and encoder pins in, motor duties out.

    Nothing happens between two calls: time passes in `step` alone. Inside, interrupts come at their own
    microsecond, each byte takes 40 us on the line (250000 baud) and the control tick comes every 5 ms, so
    equal calls give equal runs. Boards are independent of each other.

    Parameters
    ----------
    seed
        Decides the boot nonces, nothing else.
    eeprom
        What the EEPROM holds, at most 1024 bytes; the rest is erased. ``host.sim.eeprom.image`` makes it.
    """

    def __init__(self, seed: int = 0, eeprom: bytes = b"") -> None:
        if len(eeprom) > _board.EEPROM_BYTES:
            raise ValueError(f"the EEPROM holds {_board.EEPROM_BYTES} bytes, not {len(eeprom)}")
        self._board = _board.Board(seed=seed, eeprom=eeprom)

    # --- Time -----------------------------------------------------------------------------------

    @property
    def time_us(self) -> int:
        """Virtual time since the board was made; the robot's own clock starts anew at each `reset`."""
        return self._board.time_us

    def step(self, us: int) -> None:
        """Let `us` microseconds pass."""
        if us < 0:
            raise ValueError(f"time does not go back: step({us})")
        self._board.step(us)

    # --- Serial line ----------------------------------------------------------------------------

    def write(self, data: bytes) -> None:
        """Queue bytes on the line to the board; the first arrives 40 us after the last one queued before."""
        self._board.write(data)

    def read(self) -> bytes:
        """Bytes that have arrived from the board since the last call."""
        return self._board.read()

    # --- Wheels ---------------------------------------------------------------------------------

    def set_encoder_pins(self, side: Side, a: bool, b: bool, at_us: int | None = None) -> None:
        """Put levels on the two pins of one encoder. Rolling forward, A leads B.

        Parameters
        ----------
        side
            Which wheel.
        a, b
            Levels from then on. The board starts with all pins low.
        at_us
            When, on the clock of `time_us`: now by default, or later, when a coming `step` gets there.

        Raises
        ------
        ValueError
            `at_us` has passed.
        """
        now_us = self._board.time_us
        if at_us is None:
            at_us = now_us
        elif at_us < now_us:
            raise ValueError(f"an edge at {at_us} us comes too late: it is {now_us} us")
        self._board.set_encoder_pins(side, bool(a), bool(b), at_us)

    def duty(self, side: Side) -> float:
        """Voltage on one motor as a fraction of the battery's, -1 to 1; 0 brakes it, unless `coasting`."""
        return self._board.duty(side) / _board.DUTY_FULL

    def coasting(self, side: Side) -> bool:
        """Whether the motor is open, so that its wheel rolls freely."""
        return self._board.coasting(side)

    # --- Surroundings ---------------------------------------------------------------------------

    def set_battery_mv(self, mv: int) -> None:
        """Battery voltage in millivolts, 7400 at first; 0 means that the board cannot measure it."""
        self._board.set_battery_mv(mv)

    def press_estop(self, pressed: bool) -> None:
        """Press or release the emergency stop button."""
        self._board.press_estop(pressed)

    @property
    def eeprom(self) -> bytes:
        """All 1024 bytes as they are now."""
        return self._board.eeprom

    def reset(self, cause: ResetCause = ResetCause.EXTERNAL) -> None:
        """Restart the firmware: its state is lost, its clock starts at 0, and it has another boot nonce."""
        self._board.reset(cause)

    def hang(self, us: int) -> None:
        """Keep the main loop from running for `us` microseconds from now; interrupts still come.

        Motors keep their duty, ticks are missed, and received bytes beyond 64 are lost and counted. 60 ms
        after the last tick the watchdog ends it: a reset, which turns the motors off.
        """
        self._board.hang(us)


class Line:
    """The serial line to a board, as ``host.link.robot.Robot`` wants its transport.

    Any thread may write, also while another lets time pass.
    """

    def __init__(self, board: Board) -> None:
        self._board = board
        self._writing = threading.Lock()
        self._plugged = True

    def write(self, data: bytes) -> None:
        """Send all of `data`; DeviceError when the line is unplugged."""
        with self._writing:
            self._check()
            self._board.write(data)

    def read(self) -> bytes:
        """What has arrived since the last call; DeviceError when the line is unplugged."""
        self._check()
        return self._board.read()

    def close(self) -> None:
        """Unplug: the board hears nothing more from here, and is heard no more."""
        with self._writing:
            self._plugged = False

    def _check(self) -> None:
        if not self._plugged:
            raise DeviceError("the line to the simulated board is closed: make a new Line to plug in again")
