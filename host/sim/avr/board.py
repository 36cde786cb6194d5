"""The robot's board with its real processor: the ELF that is flashed, run by simavr in virtual time."""

from __future__ import annotations

import math
import random
import struct
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from host.errors import DeviceError, UsageError
from host.link.protocol import ResetCause
from host.sim.board import Side

ROOT = Path(__file__).resolve().parents[3]
ELF = ROOT / "build/firmware/uno.elf"
LIBRARY = ROOT / "build/avr/librig.so"

CYCLES_PER_US = 16
RAM_BYTES = 2048
RAM_ADDRESS = 0x800000  # where an AVR's ELF puts data memory
RAM_FIRST = 0x100

EEPROM_BYTES = 1024
FLASH_BYTES = 32768

# Vector numbers of the interrupts that the firmware uses.
VECTORS = {"encoder": 4, "millisecond": 7, "clock": 16, "receive": 18, "transmit": 19}

MCUSR_BITS = {
    ResetCause.UNKNOWN: 0,
    ResetCause.POWER_ON: 1,
    ResetCause.EXTERNAL: 2,
    ResetCause.BROWN_OUT: 4,
    ResetCause.WATCHDOG: 8,
}

DECLARATIONS = """
    struct rig;
    struct rig_interrupt { uint64_t runs, worst_cycles, cycles; };
    struct rig_stats {
        struct rig_interrupt interrupts[32];
        uint64_t cycles, asleep_cycles, byte_wait_worst_cycles, masked_worst_cycles;
        uint32_t rx_overruns, rx_wrong_baud, resets;
    };
    struct rig *rig_new(const char *elf, const uint8_t *noise);
    void rig_free(struct rig *);
    int rig_run_to(struct rig *, uint64_t cycle);
    void rig_write(struct rig *, const uint8_t *bytes, size_t count);
    size_t rig_read(struct rig *, uint8_t *bytes, size_t size);
    void rig_baud(struct rig *, uint32_t baud);
    void rig_encoders(struct rig *, size_t count, const uint8_t *sides, const uint8_t *pins,
                      const uint64_t *at_cycles);
    double rig_duty(const struct rig *, uint8_t side);
    int rig_coasting(const struct rig *, uint8_t side);
    void rig_eeprom_set(struct rig *, const uint8_t *bytes);
    void rig_eeprom(struct rig *, uint8_t *bytes);
    uint8_t rig_peek(const struct rig *, uint16_t address);
    void rig_poke(struct rig *, uint16_t address, uint8_t byte);
    void rig_bootloader(struct rig *, uint32_t address, const uint8_t *bytes, size_t count);
    void rig_flash(const struct rig *, uint8_t *bytes);
    void rig_battery_mv(struct rig *, uint32_t mv);
    void rig_estop(struct rig *, int pressed);
    void rig_reset(struct rig *, uint8_t mcusr, const uint8_t *noise);
    void rig_hang(struct rig *, uint64_t cycles);
    const struct rig_stats *rig_stats(struct rig *);
    void rig_clear_stats(struct rig *);
    void rig_watch_mask(struct rig *, int on);
    size_t rig_stack_used(const struct rig *, uint16_t static_end);
"""


@dataclass(frozen=True)
class Interrupt:
    """One interrupt's runs since `AvrBoard.clear_stats`; cycles include entry and return."""

    runs: int
    worst_cycles: int
    mean_cycles: float


@dataclass(frozen=True)
class Stats:
    """What the processor did since `AvrBoard.clear_stats`.

    Attributes
    ----------
    interrupts
        By name: encoder, millisecond, clock, receive, transmit.
    load
        Share of the cycles not slept, 0 to 1.
    byte_wait_worst_cycles
        Longest that a received byte waited to be read from the USART.
    masked_worst_cycles
        Longest stretch with interrupts off, interrupts themselves included; 0 unless `watch_mask` is on.
    rx_overruns
        Received bytes lost because the USART's buffer was full.
    rx_wrong_baud
        Bytes lost either way because the firmware had set another baud rate than the line's.
    resets
        Resets by the watchdog.
    """

    interrupts: dict[str, Interrupt]
    load: float
    byte_wait_worst_cycles: int
    masked_worst_cycles: int
    rx_overruns: int
    rx_wrong_baud: int
    resets: int


def _static_end(elf: Path) -> int:
    """First data address past the firmware's variables."""
    image = elf.read_bytes()
    if image[:6] != b"\x7fELF\x01\x01":
        raise UsageError(f"{elf} is no 32-bit ELF file: build it with `make firmware`")
    at, each, count = *struct.unpack_from("<I", image, 0x20), *struct.unpack_from("<HH", image, 0x2E)
    end = RAM_FIRST
    for section in range(count):
        _, _, flags, address, _, size = struct.unpack_from("<6I", image, at + section * each)
        if flags & 2 and RAM_ADDRESS <= address < RAM_ADDRESS + 0x10000:  # occupies memory, data memory
            end = max(end, address + size - RAM_ADDRESS)
    return end


def read_hex(path: Path) -> tuple[int, bytes]:
    """First address and contents of an Intel hex file; what it leaves out in between is 0xFF.

    Raises
    ------
    UsageError
        The file is no such thing.
    """
    image = bytearray()
    first = None
    for line in path.read_text("latin-1").split():
        record = bytes.fromhex(line[1:]) if line.startswith(":") else b""
        if len(record) < 5 or len(record) != record[0] + 5 or sum(record) % 256:
            raise UsageError(f"{path} is no Intel hex file, or damaged: build or fetch it anew")
        kind, at = record[3], int.from_bytes(record[1:3], "big")
        if kind == 0:
            first = at if first is None else first
            image = image.ljust(at - first, b"\xff")
            image[at - first : at - first + record[0]] = record[4:-1]
    if first is None:
        raise UsageError(f"{path} holds no program: build or fetch it anew")
    return first, bytes(image)


def _load_library(path: Path) -> tuple[Any, Any]:
    try:
        import cffi
    except ImportError:
        raise UsageError("simulating the ATmega needs cffi: pip install cffi") from None
    ffi = cffi.FFI()
    ffi.cdef(DECLARATIONS)
    try:
        return ffi, ffi.dlopen(str(path))
    except OSError as error:
        raise UsageError(
            f"the ATmega's simulator is not ready ({error}): run tools/setup_avr, then make avr"
        ) from None


class AvrBoard:
    """An ATmega328P with its firmware, in the place of ``host.sim.board.Board``.

    Same calls, same units; equal calls give equal runs. What differs is what a real processor does: work
    takes time, its clock starts some milliseconds after a reset, and the watchdog ends a hung main loop.

    Parameters
    ----------
    seed
        Decides what RAM holds at power-on, and with it the boot nonces.
    eeprom
        What the EEPROM holds, at most 1024 bytes; the rest is erased.
    elf, library
        Firmware and simulator; those that ``make avr`` builds by default.
    bootloader
        An Intel hex file. The processor then starts in it, after every reset, and holds nothing else:
        no `elf` is loaded.

    Raises
    ------
    UsageError
        Firmware or simulator is not built, or does not fit.
    """

    def __init__(
        self,
        seed: int = 0,
        eeprom: bytes = b"",
        *,
        elf: Path = ELF,
        library: Path = LIBRARY,
        bootloader: Path | None = None,
    ) -> None:
        if len(eeprom) > EEPROM_BYTES:
            raise ValueError(f"an ATmega328P holds {EEPROM_BYTES} bytes of EEPROM, not {len(eeprom)}")
        if bootloader is None and not elf.is_file():
            raise UsageError(f"there is no firmware at {elf}: run tools/setup_avr, then make avr")
        self._static_end = RAM_FIRST if bootloader else _static_end(elf)
        self._ffi, self._c = _load_library(library)
        self._noise = random.Random(seed)
        program = self._ffi.NULL if bootloader else str(elf).encode()
        made = self._c.rig_new(program, self._noise.randbytes(RAM_BYTES))
        if made == self._ffi.NULL:
            raise UsageError(f"simavr cannot run {elf}: build it anew with `make firmware`")
        self._rig = self._ffi.gc(made, self._c.rig_free)
        self._c.rig_eeprom_set(self._rig, eeprom.ljust(EEPROM_BYTES, b"\xff"))
        if bootloader:
            address, code = read_hex(bootloader)
            if address + len(code) > FLASH_BYTES:
                raise UsageError(f"{bootloader} reaches past the end of the ATmega328P's program memory")
            self._c.rig_bootloader(self._rig, address, code, len(code))
        self._bytes = self._ffi.new("uint8_t[]", 4096)
        self._time_us = 0
        self._running = threading.Lock()  # the library runs without the interpreter's own lock

    # --- Time -----------------------------------------------------------------------------------

    @property
    def time_us(self) -> int:
        """Virtual time since the board was made."""
        return self._time_us

    def step(self, us: int) -> None:
        """Let `us` microseconds pass; DeviceError if the processor crashes."""
        if us < 0:
            raise ValueError(f"time does not go back: step({us})")
        self._time_us += us
        with self._running:
            crashed = self._c.rig_run_to(self._rig, self._time_us * CYCLES_PER_US)
        if crashed:
            raise DeviceError(f"the simulated ATmega crashed by {self._time_us} us: a fault of its firmware")

    # --- Serial line ----------------------------------------------------------------------------

    def write(self, data: bytes) -> None:
        """Queue bytes on the line to the board; the first arrives 40 us after the last one queued before."""
        with self._running:
            self._c.rig_write(self._rig, data, len(data))

    def read(self) -> bytes:
        """Bytes that have arrived from the board since the last call."""
        parts = []
        while count := self._c.rig_read(self._rig, self._bytes, len(self._bytes)):
            parts.append(bytes(self._ffi.buffer(self._bytes, count)))
        return b"".join(parts)

    def set_baud(self, baud: int) -> None:
        """Speed of the line from the next byte on, 250000 at first."""
        self._c.rig_baud(self._rig, baud)

    # --- Wheels ---------------------------------------------------------------------------------

    def set_encoder_pins(self, side: Side, a: bool, b: bool, at_us: int | None = None) -> None:
        """Put levels on the two pins of one encoder, now or at a coming time; see ``Board``."""
        if at_us is None:
            at_us = self._time_us
        elif at_us < self._time_us:
            raise ValueError(f"an edge at {at_us} us comes too late: it is {self._time_us} us")
        pins = bytes([bool(b) << 1 | bool(a)])
        self._c.rig_encoders(self._rig, 1, bytes([side]), pins, [at_us * CYCLES_PER_US])

    def set_many_encoder_pins(self, sides: np.ndarray, pins: np.ndarray, at_us: np.ndarray) -> None:
        """Many calls of `set_encoder_pins` at once: arrays of sides, of pins as (b << 1) | a, and of times.

        Raises
        ------
        ValueError
            A time has passed.
        """
        if len(at_us) and at_us.min() < self._time_us:
            raise ValueError(f"an edge at {at_us.min()} us comes too late: it is {self._time_us} us")
        sides, pins = sides.astype(np.uint8), pins.astype(np.uint8)
        cycles = at_us.astype(np.uint64) * CYCLES_PER_US
        self._c.rig_encoders(
            self._rig,
            len(at_us),
            self._ffi.from_buffer("uint8_t[]", sides),
            self._ffi.from_buffer("uint8_t[]", pins),
            self._ffi.from_buffer("uint64_t[]", cycles),
        )

    def duty(self, side: Side) -> float:
        """What the motor driver gives one motor, -1 to 1, by the processor's pins and PWM registers.

        Raises
        ------
        DeviceError
            The firmware runs the PWM timer in a way that no driver was meant to see.
        """
        duty = self._c.rig_duty(self._rig, side)
        if math.isnan(duty):
            raise DeviceError(
                f"the simulated ATmega's PWM is not set up as docs/hardware.md says: {side.name}"
            )
        return duty

    def coasting(self, side: Side) -> bool:
        """The driver leaves this motor's ends open, so that it rolls freely instead of braking."""
        return bool(self._c.rig_coasting(self._rig, side))

    # --- Memories -------------------------------------------------------------------------------

    @property
    def eeprom(self) -> bytes:
        """All 1024 bytes of the EEPROM; a byte whose writing has not ended is still the old one."""
        contents = self._ffi.new("uint8_t[]", EEPROM_BYTES)
        self._c.rig_eeprom(self._rig, contents)
        return bytes(self._ffi.buffer(contents))

    @property
    def flash(self) -> bytes:
        """All 32768 bytes of program memory."""
        contents = self._ffi.new("uint8_t[]", FLASH_BYTES)
        self._c.rig_flash(self._rig, contents)
        return bytes(self._ffi.buffer(contents))

    def peek(self, address: int) -> int:
        """One byte of data memory, registers included."""
        return self._c.rig_peek(self._rig, address)

    def poke(self, address: int, byte: int) -> None:
        """Change one byte of data memory behind the processor's back."""
        self._c.rig_poke(self._rig, address, byte)

    # --- Surroundings ---------------------------------------------------------------------------

    def set_battery_mv(self, mv: int) -> None:
        """Battery voltage in millivolts, 7400 at first."""
        self._c.rig_battery_mv(self._rig, mv)

    def press_estop(self, pressed: bool) -> None:
        """Press or release the emergency stop button."""
        self._c.rig_estop(self._rig, pressed)

    def reset(self, cause: ResetCause = ResetCause.EXTERNAL) -> None:
        """Restart the processor. RAM is kept unless the cause is POWER_ON.

        An EEPROM byte whose writing has not ended is lost if power went, POWER_ON or BROWN_OUT: it may then
        be anything.
        """
        noise = self._noise.randbytes(RAM_BYTES) if cause == ResetCause.POWER_ON else self._ffi.NULL
        self._c.rig_reset(self._rig, MCUSR_BITS[cause], noise)

    def hang(self, us: int) -> None:
        """Keep the main loop from running for `us` microseconds, or until the watchdog ends it."""
        self._c.rig_hang(self._rig, us * CYCLES_PER_US)

    # --- Measuring ------------------------------------------------------------------------------

    def clear_stats(self) -> None:
        """Start measuring anew."""
        self._c.rig_clear_stats(self._rig)

    def watch_mask(self, on: bool) -> None:
        """Measure how long interrupts are off; ten times slower."""
        self._c.rig_watch_mask(self._rig, on)

    def stats(self) -> Stats:
        """What has been measured."""
        told = self._c.rig_stats(self._rig)
        interrupts = {}
        for name, vector in VECTORS.items():
            one = told.interrupts[vector]
            mean_cycles = one.cycles / one.runs if one.runs else 0.0
            interrupts[name] = Interrupt(one.runs, one.worst_cycles, mean_cycles)
        return Stats(
            interrupts=interrupts,
            load=1.0 - told.asleep_cycles / told.cycles if told.cycles else 0.0,
            byte_wait_worst_cycles=told.byte_wait_worst_cycles,
            masked_worst_cycles=told.masked_worst_cycles,
            rx_overruns=told.rx_overruns,
            rx_wrong_baud=told.rx_wrong_baud,
            resets=told.resets,
        )

    @property
    def static_end(self) -> int:
        """First address past the firmware's variables, where the stack must not come."""
        return self._static_end

    @property
    def stack_bytes(self) -> int:
        """Most stack in use at once since power-on."""
        return self._c.rig_stack_used(self._rig, self._static_end)
