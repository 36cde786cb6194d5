"""Ways in which a line can die under a driving robot. None of them sends a command that should be obeyed."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, replace

from host.link.bench.frames import Frame
from host.link.bench.target import Target
from host.link.protocol import (
    BAUD,
    LAYOUTS,
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    Clear,
    Drive,
    HelloRequest,
    KeepAlive,
    Message,
    Move,
    ParamRead,
    Ping,
    ResetCause,
    cobs_encode,
    crc32c,
    encode,
)

EVERY_S = 0.02  # what is sent instead of commands comes as often as they did


@dataclass
class Dying:
    """What a way to die knows: the line, and what was last sent on it."""

    target: Target
    chance: random.Random
    drive: Drive  # the last one sent
    drive_seq: int
    nonce: int
    recent: list[bytes]  # the last second's frames to the robot, delimiters included
    heard: bytes  # the last of what the robot sent
    sent: int = 0  # messages since, for their sequence numbers

    def put(self, data: bytes) -> None:
        """Bytes onto the line."""
        self.target.near.write(data)

    def tell(self, message: Message, *, later_us: int = 0) -> None:
        """A whole message with the next sequence number; `later_us` moves its deadline."""
        self.sent += 1
        if later_us and isinstance(message, Drive | KeepAlive):
            message = replace(message, expires_us=(message.expires_us + later_us) & 0xFFFF_FFFF)
        self.put(b"\0" + encode(message, (self.drive_seq + self.sent) & 0xFF))


Step = Callable[[Dying, float], None]  # what is done every EVERY_S, told how long it has been dead


@dataclass(frozen=True)
class Way:
    """One way to die."""

    name: str
    step: Step
    at_once: Callable[[Dying], None] | None = None
    simulated: bool = False  # cannot be done from the host's end of a real line


def ways() -> list[Way]:
    """All of them."""
    return [
        Way("nothing is sent any more", _nothing),
        Way("unplugged", _nothing, _unplug, simulated=True),
        Way("only the way to the robot is cut", _drives_on, _cut_there),
        Way("half a DRIVE, then nothing", _nothing, _half),
        Way("every DRIVE is cut short", lambda d, t: d.put(_fresh(d, t)[: d.chance.randrange(2, 14)])),
        Way("every DRIVE lacks its delimiter", lambda d, t: d.put(_fresh(d, t).strip(b"\0"))),
        Way("every DRIVE has one bit wrong", lambda d, t: d.put(_flipped(d, _fresh(d, t), 1))),
        Way("every DRIVE has eight bits wrong", lambda d, t: d.put(_flipped(d, _fresh(d, t), 8))),
        Way("every DRIVE has a wrong checksum", lambda d, t: d.put(_resealed(d, t, spoil=True))),
        Way("every DRIVE is a byte too long", lambda d, t: d.put(_resealed(d, t, extra=b"\1"))),
        Way("noise without pause", lambda d, t: d.put(d.chance.randbytes(500))),
        Way("noise in bursts", lambda d, t: d.put(d.chance.randbytes(d.chance.randrange(40)))),
        Way("the line is stuck at 00", lambda d, t: d.put(bytes(500))),
        Way("the line is stuck at FF", lambda d, t: d.put(b"\xff" * 500)),
        Way("the line hums 55", lambda d, t: d.put(b"\x55" * 500)),
        Way("the last DRIVE again and again", lambda d, t: d.put(d.recent[-1])),
        Way("the last DRIVE, numbered anew", lambda d, t: d.tell(d.drive)),
        Way("the last second again and again", _replay),
        Way("every DRIVE comes 0.3 s late", lambda d, t: d.put(_fresh(d, t - 0.3))),
        Way("every deadline is too far ahead", lambda d, t: d.tell(d.drive, later_us=int(t * 1e6) + 10**6)),
        Way("only PING", lambda d, t: d.tell(Ping(d.sent))),
        Way("only HELLO_REQUEST", lambda d, t: d.tell(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH))),
        Way("HELLO_REQUEST of another schema", lambda d, t: d.tell(HelloRequest(PROTOCOL_VERSION, 1))),
        Way("only KEEP_ALIVE", lambda d, t: d.tell(KeepAlive(d.drive.expires_us), later_us=int(t * 1e6))),
        Way("only PARAM_READ", lambda d, t: d.tell(ParamRead(d.chance.randrange(256)))),
        Way("CLEAR with a wrong nonce", lambda d, t: d.tell(Clear(d.nonce ^ 1))),
        Way("MOVE with a wrong nonce", lambda d, t: d.tell(_foreign_move(d, t))),
        Way("the robot's own messages come back", lambda d, t: d.put(d.heard)),
        Way("messages that nobody knows", lambda d, t: d.put(_unknown(d))),
        Way("the robot restarts", _drives_on, _restart, simulated=True),
    ]


# --- What is sent -------------------------------------------------------------------------------


def _nothing(dying: Dying, dead_s: float) -> None:
    pass


def _later(dying: Dying, dead_s: float) -> Drive:
    """The last DRIVE as the host would send it now."""
    ahead_us = int(dead_s * 1e6)
    return replace(dying.drive, expires_us=(dying.drive.expires_us + ahead_us) & 0xFFFF_FFFF)


def _fresh(dying: Dying, dead_s: float) -> bytes:
    dying.sent += 1
    return b"\0" + encode(_later(dying, dead_s), (dying.drive_seq + dying.sent) & 0xFF)


def _drives_on(dying: Dying, dead_s: float) -> None:
    dying.put(_fresh(dying, dead_s))


def _half(dying: Dying) -> None:
    frame = _fresh(dying, 0.0)
    dying.put(frame[: len(frame) // 2])


def _flipped(dying: Dying, frame: bytes, count: int) -> bytes:
    damaged = bytearray(frame)
    for bit in dying.chance.sample(range(8, 8 * len(frame)), count):  # the idle delimiter may stay
        damaged[bit // 8] ^= 1 << bit % 8
    return bytes(damaged)


def _resealed(dying: Dying, dead_s: float, *, extra: bytes = b"", spoil: bool = False) -> bytes:
    """A DRIVE in a frame that is right but for what is asked."""
    dying.sent += 1
    drive = _later(dying, dead_s)
    payload = LAYOUTS[Drive.ID].packing.pack(drive.v_mm_s, drive.omega_mrad_s, drive.expires_us)
    body = bytes([Drive.ID, (dying.drive_seq + dying.sent) & 0xFF]) + payload + extra
    checksum = crc32c(body) ^ (1 << dying.chance.randrange(32) if spoil else 0)
    return b"\0" + cobs_encode(body + checksum.to_bytes(4, "little")) + b"\0"


def _unknown(dying: Dying) -> bytes:
    dying.sent += 1
    unknown = [number for number in range(0x80) if number not in LAYOUTS]
    body = bytes(
        [dying.chance.choice(unknown), (dying.drive_seq + dying.sent) & 0xFF]
    ) + dying.chance.randbytes(8)
    return b"\0" + cobs_encode(body + crc32c(body).to_bytes(4, "little")) + b"\0"


def _foreign_move(dying: Dying, dead_s: float) -> Move:
    return Move(dying.nonce ^ 1, 1, 1000, 300, _later(dying, dead_s).expires_us)


def _replay(dying: Dying, dead_s: float) -> None:
    dying.put(dying.recent[int(dead_s / EVERY_S) % len(dying.recent)])


# --- What is done to the line -------------------------------------------------------------------


def _unplug(dying: Dying) -> None:
    dying.target.faults.to_robot.drop = dying.target.faults.to_host.drop = 1.0


def _cut_there(dying: Dying) -> None:
    dying.target.faults.to_robot.drop = 1.0


def _restart(dying: Dying) -> None:
    assert dying.target.rolling is not None
    dying.target.rolling.board.reset(ResetCause.BROWN_OUT)


class Recorder:
    """Remembers of a tap what a way to die wants to know."""

    def __init__(self) -> None:
        self.drive: Drive | None = None
        self.drive_seq = 0
        self.recent: list[bytes] = []
        self.heard = b""
        self.obeyed_s: dict[int, float] = {}  # when each DRIVE's last byte arrived, by its sequence number
        self._deadlines: dict[int, int] = {}

    def see(self, frame: Frame) -> None:
        """Take note of a frame."""
        if frame.to_host:
            self.heard = frame.coded + b"\0"
        elif isinstance(frame.message, Drive) and frame.seq is not None:
            self.drive, self.drive_seq = frame.message, frame.seq
            self.recent = [*self.recent[-49:], b"\0" + frame.coded + b"\0"]
            if self._deadlines.get(frame.seq) != frame.message.expires_us:  # else the same one again
                self.obeyed_s[frame.seq] = frame.t_s + 10 / BAUD * (len(frame.coded) + 2)
            self._deadlines[frame.seq] = frame.message.expires_us
