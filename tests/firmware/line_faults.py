"""What may stand on the line once a robot has lost its host: each fault by name, from a seed.

A fault is a generator of (pause in microseconds, bytes): the bytes come on the line that long after the ones
before. None of them holds a command that a robot may obey, so from its beginning on the robot is on its own.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from host.link.protocol import (
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    Clear,
    Drive,
    HelloRequest,
    Message,
    Move,
    Param,
    ParamRead,
    Ping,
    cobs_encode,
    crc32c,
    encode,
)

BYTE_US = 40
PERIOD_US = 50_000  # of a host's commands


@dataclass
class Lost:
    """What is known of the host and its robot at the moment of the fault."""

    rng: random.Random
    seq: int  # of the last message
    sent: list[bytes]  # the last frames, the newest last
    mcu_us: int  # the robot's clock
    boot_nonce: int
    request: int  # the last one the robot took

    def frame(self, message: Message) -> bytes:
        """The next frame of a host that goes on counting."""
        self.seq = (self.seq + 1) % 256
        return encode(message, self.seq)

    def fresh_drive(self) -> bytes:
        """A good command, to be spoilt."""
        self.mcu_us += PERIOD_US
        return self.frame(Drive(self.rng.randint(-500, 500), 0, (self.mcu_us + 200_000) % 2**32))

    def framed(self, message_id: int, payload: bytes) -> bytes:
        """A whole and correct frame of anything."""
        self.seq = (self.seq + 1) % 256
        body = bytes([message_id, self.seq]) + payload
        return cobs_encode(body + struct.pack("<I", crc32c(body))) + b"\0"


Chunks = Iterator[tuple[int, bytes]]
Fault = Callable[[Lost], Chunks]
FAULTS: dict[str, Fault] = {}


def fault(generator: Fault) -> Fault:
    """Add to FAULTS under the generator's name."""
    FAULTS[generator.__name__] = generator
    return generator


# --- Silence ------------------------------------------------------------------------------------


@fault
def unplugged(lost: Lost) -> Chunks:
    return iter(())


@fault
def half_a_frame(lost: Lost) -> Chunks:
    frame = lost.fresh_drive()
    yield 0, frame[: lost.rng.randrange(1, len(frame))]


@fault
def half_a_frame_and_its_end_too_late(lost: Lost) -> Chunks:
    frame = lost.fresh_drive()
    cut = lost.rng.randrange(1, len(frame))
    yield 0, frame[:cut]
    yield 300_000, frame[cut:]


@fault
def a_frame_that_trickles_in(lost: Lost) -> Chunks:
    for byte in lost.fresh_drive():
        yield 20_000, bytes([byte])


@fault
def an_idle_line_of_delimiters(lost: Lost) -> Chunks:
    while True:
        yield lost.rng.randint(0, 5000), b"\0" * lost.rng.randint(1, 20)


# --- Babble -------------------------------------------------------------------------------------


def _line_full_of(next_bytes: Callable[[int], bytes]) -> Chunks:
    while True:
        yield 1000, next_bytes(1000 // BYTE_US)


@fault
def babble(lost: Lost) -> Chunks:
    return _line_full_of(lost.rng.randbytes)


@fault
def babble_of_one_byte(lost: Lost) -> Chunks:
    byte = lost.rng.randbytes(1)
    return _line_full_of(lambda count: byte * count)


@fault
def babble_without_delimiters(lost: Lost) -> Chunks:
    return _line_full_of(lambda count: bytes(lost.rng.randint(1, 255) for _ in range(count)))


@fault
def babble_of_short_frames(lost: Lost) -> Chunks:
    return _line_full_of(lambda count: bytes(lost.rng.choice((0, 1, 2, 3)) for _ in range(count)))


@fault
def a_break(lost: Lost) -> Chunks:
    return _line_full_of(bytes)


@fault
def bursts_of_noise(lost: Lost) -> Chunks:
    while True:
        yield lost.rng.randint(5000, 80_000), lost.rng.randbytes(lost.rng.randint(1, 60))


@fault
def what_the_robot_says_echoed(lost: Lost) -> Chunks:
    while True:
        yield 10_000, lost.framed(0x83, lost.rng.randbytes(47))


# --- Spoilt commands ----------------------------------------------------------------------------


def _spoilt(lost: Lost, spoil: Callable[[bytes], bytes]) -> Chunks:
    while True:
        yield PERIOD_US, spoil(lost.fresh_drive())


@fault
def a_wrong_bit_in_each(lost: Lost) -> Chunks:
    def flip(frame: bytes) -> bytes:
        spoilt = bytearray(frame)
        spoilt[lost.rng.randrange(len(frame) - 1)] ^= 1 << lost.rng.randrange(8)
        return bytes(spoilt)

    return _spoilt(lost, flip)


@fault
def many_wrong_bits_in_each(lost: Lost) -> Chunks:
    def damage(frame: bytes) -> bytes:
        wrong = [lost.rng.randrange(1, 256) if lost.rng.random() < 0.3 else 0 for _ in frame[1:]]
        return bytes(byte ^ bits for byte, bits in zip(frame[1:], wrong, strict=True))

    return _spoilt(lost, damage)


@fault
def a_byte_missing_in_each(lost: Lost) -> Chunks:
    def drop(frame: bytes) -> bytes:
        at = lost.rng.randrange(len(frame) - 1)
        return frame[:at] + frame[at + 1 :]

    return _spoilt(lost, drop)


@fault
def a_byte_twice_in_each(lost: Lost) -> Chunks:
    def double(frame: bytes) -> bytes:
        at = lost.rng.randrange(len(frame) - 1)
        return frame[:at] + frame[at : at + 1] + frame[at:]

    return _spoilt(lost, double)


@fault
def cut_short_each(lost: Lost) -> Chunks:
    return _spoilt(lost, lambda frame: frame[: lost.rng.randrange(len(frame) - 1)] + b"\0")


@fault
def without_delimiters(lost: Lost) -> Chunks:
    return _spoilt(lost, lambda frame: frame[:-1])


@fault
def all_bits_inverted(lost: Lost) -> Chunks:
    return _spoilt(lost, lambda frame: bytes(byte ^ 0xFF for byte in frame))


@fault
def at_half_the_baud_rate(lost: Lost) -> Chunks:
    """Each bit lasts two: what a receiver at full speed makes of it."""

    def slow(frame: bytes) -> bytes:
        line = [1, 1]
        for byte in frame:
            line += [0, 0, *(bit for n in range(8) for bit in [byte >> n & 1] * 2), 1, 1]
        heard, at = bytearray(), 0
        while at + 10 <= len(line):
            if line[at]:
                at += 1
                continue
            heard.append(sum(line[at + 1 + n] << n for n in range(8)))
            at += 10
        return bytes(heard)

    return _spoilt(lost, slow)


@fault
def with_another_checksum(lost: Lost) -> Chunks:
    while True:
        lost.seq = (lost.seq + 1) % 256
        body = bytes([Drive.ID, lost.seq]) + struct.pack("<hhI", 300, 0, (lost.mcu_us + 200_000) % 2**32)
        yield PERIOD_US, cobs_encode(body + struct.pack("<I", crc32c(body) ^ 0xFFFF_FFFF)) + b"\0"


# --- Whole messages that are no commands any more -----------------------------------------------


def _again(lost: Lost, next_frame: Callable[[], bytes]) -> Chunks:
    while True:
        yield PERIOD_US, next_frame()


@fault
def the_last_frame_over_and_over(lost: Lost) -> Chunks:
    return _again(lost, lambda: lost.sent[-1])


@fault
def the_last_frames_over_and_over(lost: Lost) -> Chunks:
    return _again(lost, lambda: lost.rng.choice(lost.sent[-8:]))


@fault
def commands_that_were_held_up(lost: Lost) -> Chunks:
    held_us = lost.rng.randint(200_000, 2_000_000)
    return _again(lost, lambda: lost.frame(Drive(300, 0, (lost.mcu_us - held_us) % 2**32)))


@fault
def commands_by_a_lost_clock(lost: Lost) -> Chunks:
    ahead_us = lost.rng.randint(5_000_000, 2**31 - 1)
    return _again(lost, lambda: lost.frame(Drive(300, 0, (lost.mcu_us + ahead_us) % 2**32)))


@fault
def pings_alone(lost: Lost) -> Chunks:
    return _again(lost, lambda: lost.frame(Ping(lost.rng.getrandbits(32))))


@fault
def hello_requests_alone(lost: Lost) -> Chunks:
    return _again(lost, lambda: lost.frame(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH)))


@fault
def a_host_of_another_schema(lost: Lost) -> Chunks:
    yield PERIOD_US, lost.frame(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH ^ 1 << lost.rng.randrange(32)))
    yield from _again(lost, lost.fresh_drive)


@fault
def questions_for_parameters(lost: Lost) -> Chunks:
    return _again(lost, lambda: lost.frame(ParamRead(lost.rng.choice(list(Param)))))


@fault
def clears_alone(lost: Lost) -> Chunks:
    return _again(lost, lambda: lost.frame(Clear(lost.boot_nonce)))


@fault
def moves_for_another_start(lost: Lost) -> Chunks:
    def move() -> bytes:
        lost.request += 1
        until_us = (lost.mcu_us + 200_000) % 2**32
        return lost.frame(Move(lost.boot_nonce ^ 1, lost.request % 2**16, 500, 300, until_us))

    return _again(lost, move)


@fault
def messages_that_do_not_exist(lost: Lost) -> Chunks:
    return _again(lost, lambda: lost.framed(lost.rng.randint(0x20, 0x7F), lost.rng.randbytes(8)))


@fault
def messages_of_the_wrong_length(lost: Lost) -> Chunks:
    return _again(lost, lambda: lost.framed(Drive.ID, lost.rng.randbytes(lost.rng.choice((0, 1, 7, 9, 13)))))
