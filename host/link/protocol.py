"""The link's schema and codec: typed messages on one side, bytes on the other, and no I/O.

The schema is the message classes below. ``python -m host.link.generate`` writes firmware/src/messages.h,
the tables of docs/protocol.md and the golden vectors from them. docs/protocol.md says how to use them.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Annotated, ClassVar, NamedTuple, cast, get_args, get_type_hints

from host.link.parameters import PARAMETERS, Param

PROTOCOL_VERSION = 1  # of framing, checksum and handshake; messages are covered by SCHEMA_HASH
BAUD = 250_000  # exact on a 16 MHz ATmega328P, where 115200 is 2.1 % off

DEAD_MAN_US = 200_000  # a setpoint holds no longer than this, whatever its DRIVE says
DRIVE_AHEAD_MAX_US = 500_000  # a deadline further ahead shows that the host has lost the robot's clock
TELEMETRY_PERIOD_US = 10_000
LINK_STATUS_PERIOD_US = 200_000
STALE_WINDOW = 16  # sequence numbers this close behind the newest are repeats or were overtaken
NO_EDGE_US = 0xFFFF_FFFF  # edge age while a wheel has not turned since boot, or not for 2^31 us

# --- Wire types ---------------------------------------------------------------------------------


class Wire(NamedTuple):
    """How an integer travels; always little endian."""

    name: str
    code: str  # of the struct module

    @property
    def size(self) -> int:
        return struct.calcsize("<" + self.code)

    @property
    def signed(self) -> bool:
        return self.code.islower()

    @property
    def values(self) -> range:
        """All it can carry."""
        count = 1 << 8 * self.size
        return range(-count // 2, count // 2) if self.signed else range(count)


u8 = Wire("u8", "B")
u16 = Wire("u16", "H")
u32 = Wire("u32", "I")
i8 = Wire("i8", "b")
i16 = Wire("i16", "h")
i32 = Wire("i32", "i")

# --- Enumerations -------------------------------------------------------------------------------


class State(IntEnum):
    """What the supervisor allows."""

    BOOT = 0  # no host has said HELLO_REQUEST yet; motors off
    READY = 1  # standing, may drive
    DRIVING = 2  # follows DRIVE
    MOVING = 3  # follows a move of known length
    STOPPED = 4  # braking after STOP
    FAULT = 5  # motors off until CLEAR


class Fault(IntEnum):
    """Why the motors are off; the first cause is kept until CLEAR."""

    NONE = 0
    LINK_LOST = 1  # the last setpoint expired and nobody said STOP
    ESTOP_FRAME = 2
    ESTOP_BUTTON = 3
    STALL = 4
    ENCODER_DEAD = 5
    ENCODER_REVERSED = 6  # or the two wheels swapped
    RUNAWAY = 7
    BATTERY_LOW = 8
    OVERRUN = 9  # the control tick came too late
    WATCHDOG = 10


class ResetCause(IntEnum):
    """Why the robot last started."""

    UNKNOWN = 0
    POWER_ON = 1
    EXTERNAL = 2  # reset button, or DTR when the port was opened
    BROWN_OUT = 3
    WATCHDOG = 4


class Refusal(IntEnum):
    """Why a message was not obeyed, or not to its end."""

    NONE = 0
    NO_SESSION = 1  # HELLO_REQUEST must come first after every start
    SCHEMA = 2  # HELLO_REQUEST named another protocol version or schema hash
    EXPIRED = 3  # the deadline had passed when the message arrived
    BAD_VALUE = 4  # a number out of range, or a deadline too far ahead
    FAULT_LATCHED = 5  # CLEAR first
    BAD_NONCE = 6  # meant for another start of the robot
    FAULT_PERSISTS = 7  # CLEAR while the cause is still there
    NOT_STANDING = 8  # parameters change, and moves begin, only while READY
    BUSY = 9  # the request before is still RUNNING; this one was not taken
    OLD_REQUEST = 10  # a later request has been taken since
    BY_STOP = 11  # a move ended by STOP
    BY_DRIVE = 12  # a move ended by DRIVE
    BY_FAULT = 13  # a move ended by the fault that TELEMETRY names
    NOT_STORED = 14  # what the EEPROM holds is not what was written to it


class Outcome(IntEnum):
    """What became of the last request."""

    NONE = 0  # no request since the robot's start
    RUNNING = 1  # accepted; a move goes on, or the EEPROM is being written
    DONE = 2
    ABORTED = 3  # accepted, and ended early; `reason` says why
    REFUSED = 4  # never begun; `reason` says why


class StopHow(IntEnum):
    """What STOP does with the motors."""

    BRAKE = 0  # shorted
    COAST = 1  # open: the wheels roll out and can be turned by hand


# --- Messages to the robot: ids below 0x80 ------------------------------------------------------


@dataclass(frozen=True, slots=True)
class HelloRequest:
    """Opens a session; the robot answers HELLO, and NACK besides when the schemas differ.

    Fixed for ever, as HELLO is: two versions must be able to say that they differ.
    """

    ID: ClassVar[int] = 0x01
    protocol_version: Annotated[int, u8, "the host's PROTOCOL_VERSION"]
    schema_hash: Annotated[int, u32, "the host's SCHEMA_HASH"]


@dataclass(frozen=True, slots=True)
class Ping:
    """Asks for PONG: the robot's clock, and whether anybody is there."""

    ID: ClassVar[int] = 0x02
    host_time_us: Annotated[int, u32, "any number; comes back in PONG"]


@dataclass(frozen=True, slots=True)
class Drive:
    """A setpoint; the latest wins, and it dies at its deadline."""

    ID: ClassVar[int] = 0x03
    v_mm_s: Annotated[int, i16, "forward speed"]
    omega_mrad_s: Annotated[int, i16, "turn rate, positive to the right"]
    expires_us: Annotated[int, u32, "robot's clock at which the setpoint dies; at most 200 ms hold"]


@dataclass(frozen=True, slots=True)
class Stop:
    """Motors off without a fault: brake to a standstill, or coast."""

    ID: ClassVar[int] = 0x04
    how: Annotated[int, u8, "StopHow; what is not one of these brakes"] = StopHow.BRAKE


@dataclass(frozen=True, slots=True)
class EStop:
    """Motors off at once, in any state and any order; latched until CLEAR."""

    ID: ClassVar[int] = 0x05


@dataclass(frozen=True, slots=True)
class Clear:
    """Unlatch the fault; the nonce proves that this start of the robot is meant."""

    ID: ClassVar[int] = 0x06
    boot_nonce: Annotated[int, u32, "from HELLO or TELEMETRY"]


@dataclass(frozen=True, slots=True)
class Move:
    """Drive straight for a distance, heading held. A request: done exactly once."""

    ID: ClassVar[int] = 0x07
    boot_nonce: Annotated[int, u32, "from HELLO or TELEMETRY"]
    request: Annotated[int, u16, "one more than the `request` of TELEMETRY"]
    distance_mm: Annotated[int, i16, "forward positive"]
    speed_mm_s: Annotated[int, u16, "fastest on the way, above 0"]
    expires_us: Annotated[int, u32, "robot's clock at which it ends unless KEEP_ALIVE comes"]


@dataclass(frozen=True, slots=True)
class Turn:
    """Turn on the spot by an angle. A request: done exactly once."""

    ID: ClassVar[int] = 0x08
    boot_nonce: Annotated[int, u32, "from HELLO or TELEMETRY"]
    request: Annotated[int, u16, "one more than the `request` of TELEMETRY"]
    angle_mrad: Annotated[int, i16, "positive to the right"]
    rate_mrad_s: Annotated[int, u16, "fastest on the way, above 0"]
    expires_us: Annotated[int, u32, "robot's clock at which it ends unless KEEP_ALIVE comes"]


@dataclass(frozen=True, slots=True)
class KeepAlive:
    """Lets a move go on; the latest wins."""

    ID: ClassVar[int] = 0x09
    expires_us: Annotated[int, u32, "robot's clock at which the move brakes; at most 200 ms hold"]


@dataclass(frozen=True, slots=True)
class ParamRead:
    """Asks for PARAM_VALUE."""

    ID: ClassVar[int] = 0x0A
    param: Annotated[int, u8, "a Param"]


@dataclass(frozen=True, slots=True)
class ParamWrite:
    """Set a parameter until the next start. A request: done exactly once, answered by PARAM_VALUE."""

    ID: ClassVar[int] = 0x0B
    boot_nonce: Annotated[int, u32, "from HELLO or TELEMETRY"]
    request: Annotated[int, u16, "one more than the `request` of TELEMETRY"]
    param: Annotated[int, u8, "a Param"]
    value: Annotated[int, i32, "within the parameter's range"]


@dataclass(frozen=True, slots=True)
class ParamSave:
    """Keep all parameters as they are in EEPROM. A request: done exactly once."""

    ID: ClassVar[int] = 0x0C
    boot_nonce: Annotated[int, u32, "from HELLO or TELEMETRY"]
    request: Annotated[int, u16, "one more than the `request` of TELEMETRY"]


# --- Messages to the host: ids from 0x80 --------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Hello:
    """Who the robot is: answers HELLO_REQUEST, and is sent once unasked after every start.

    Fixed for ever, as HELLO_REQUEST is.
    """

    ID: ClassVar[int] = 0x81
    protocol_version: Annotated[int, u8, "the robot's PROTOCOL_VERSION"]
    schema_hash: Annotated[int, u32, "the robot's SCHEMA_HASH"]
    build_id: Annotated[int, u32, "of the firmware"]
    reset_cause: Annotated[ResetCause, u8, "why the robot last started"]
    boot_nonce: Annotated[int, u32, "another number after every start"]


@dataclass(frozen=True, slots=True)
class Pong:
    """Answers PING."""

    ID: ClassVar[int] = 0x82
    host_time_us: Annotated[int, u32, "from PING"]
    mcu_time_us: Annotated[int, u32, "robot's clock when PING was handled"]


@dataclass(frozen=True, slots=True)
class Telemetry:
    """The robot's state, every 10 ms."""

    ID: ClassVar[int] = 0x83
    mcu_time_us: Annotated[int, u32, "robot's clock at which everything below held"]
    state: Annotated[State, u8, "what the supervisor allows"]
    fault: Annotated[Fault, u8, "why not"]
    count_left: Annotated[int, i32, "left encoder, counts since boot, forward positive"]
    count_right: Annotated[int, i32, "right encoder, counts since boot, forward positive"]
    edge_age_left_us: Annotated[int, u32, "since the left encoder's last edge; 2^32-1: none, or over 2^31"]
    edge_age_right_us: Annotated[int, u32, "since the right encoder's last edge; 2^32-1: none, or over 2^31"]
    speed_left_mm_s: Annotated[int, i16, "left wheel, as estimated by the control loop"]
    speed_right_mm_s: Annotated[int, i16, "right wheel, as estimated by the control loop"]
    duty_left_permille: Annotated[int, i16, "left motor, -1000 to 1000"]
    duty_right_permille: Annotated[int, i16, "right motor, -1000 to 1000"]
    battery_mv: Annotated[int, u16, "0: not measured"]
    illegal_left: Annotated[int, u16, "impossible transitions of the left encoder, wraps"]
    illegal_right: Annotated[int, u16, "impossible transitions of the right encoder, wraps"]
    boot_nonce: Annotated[int, u32, "as in HELLO; a change means that the robot restarted"]
    drive_seq: Annotated[int, u8, "sequence number of the last DRIVE obeyed"]
    direction_left: Annotated[int, i8, "of the left encoder's last edge: 1 forward, -1 backward, 0: none"]
    direction_right: Annotated[int, i8, "of the right encoder's last edge: 1 forward, -1 backward, 0: none"]
    request: Annotated[int, u16, "the last request taken, 0 before the first"]
    outcome: Annotated[Outcome, u8, "what became of it"]
    reason: Annotated[Refusal, u8, "why it was refused or ended early"]


@dataclass(frozen=True, slots=True)
class Nack:
    """A message arrived whole and was not obeyed."""

    ID: ClassVar[int] = 0x84
    message: Annotated[int, u8, "id of the message refused"]
    seq: Annotated[int, u8, "its sequence number"]
    reason: Annotated[Refusal, u8, "why"]


@dataclass(frozen=True, slots=True)
class LinkStatus:
    """What the robot's end of the link saw, every 200 ms; counts since boot, each wraps."""

    ID: ClassVar[int] = 0x85
    frames: Annotated[int, u16, "received whole and correct"]
    crc: Annotated[int, u16, "frames dropped: checksum wrong"]
    framing: Annotated[int, u16, "frames dropped: COBS broken, or too short to be a frame"]
    overlong: Annotated[int, u16, "frames dropped: longer than any message"]
    unknown: Annotated[int, u16, "frames dropped: no message has this id"]
    length: Annotated[int, u16, "frames dropped: wrong length for the message"]
    lost: Annotated[int, u16, "messages that never came, by the gaps in the sequence numbers"]
    stale: Annotated[int, u16, "frames dropped: repeated, or overtaken by a later one"]
    tx_dropped: Annotated[int, u16, "messages not sent for want of room"]
    rx_overrun: Annotated[int, u16, "bytes lost before the decoder saw them"]


@dataclass(frozen=True, slots=True)
class ParamValue:
    """Answers PARAM_READ and PARAM_WRITE."""

    ID: ClassVar[int] = 0x86
    param: Annotated[Param, u8, "which parameter"]
    value: Annotated[int, i32, "as it is now"]


Request = Move | Turn | ParamWrite | ParamSave  # done exactly once
Message = (
    HelloRequest | Ping | Drive | Stop | EStop | Clear | Move | Turn | KeepAlive | ParamRead | ParamWrite
    | ParamSave | Hello | Pong | Telemetry | Nack | LinkStatus | ParamValue
)  # fmt: skip

MESSAGES: tuple[type[Message], ...] = get_args(Message)
ENUMERATIONS: tuple[type[IntEnum], ...] = (
    State, Fault, ResetCause, Refusal, Outcome, StopHow, Param,
)  # fmt: skip

# --- Layouts, read from the classes -------------------------------------------------------------


class Field(NamedTuple):
    """One field of a message."""

    name: str
    wire: Wire
    enumeration: type[IntEnum] | None
    meaning: str


class Layout(NamedTuple):
    """How a message lies in a payload: its fields in order, without padding."""

    type: type[Message]
    fields: tuple[Field, ...]
    packing: struct.Struct
    enumerations: tuple[tuple[int, dict[int, IntEnum]], ...]  # place of a field, and what its numbers mean

    @property
    def id(self) -> int:
        return self.type.ID

    @property
    def to_host(self) -> bool:
        return self.id >= 0x80

    @property
    def size(self) -> int:
        """Bytes of payload."""
        return self.packing.size


def _layout(message: type[Message]) -> Layout:
    hints = get_type_hints(message, include_extras=True)
    listed = []
    for field in fields(message):
        kind, wire, meaning = get_args(hints[field.name])
        listed.append(Field(field.name, wire, None if kind is int else kind, meaning))
    packing = struct.Struct("<" + "".join(field.wire.code for field in listed))
    enumerations = tuple(
        (place, {member.value: member for member in field.enumeration})
        for place, field in enumerate(listed)
        if field.enumeration
    )
    return Layout(message, tuple(listed), packing, enumerations)


LAYOUTS: dict[int, Layout] = {message.ID: _layout(message) for message in MESSAGES}


def build(layout: Layout, values: tuple[int, ...]) -> Message:
    """The message of `layout` with these field values; ValueError if an enumeration lacks one."""
    meant: list[int] = [*values]
    for place, members in layout.enumerations:
        member = members.get(values[place])
        if member is None:
            raise ValueError(f"{values[place]} is no {layout.fields[place].meaning}")
        meant[place] = member
    of_fields = cast(Callable[..., Message], layout.type)
    return of_fields(*meant)


# --- Checksum -----------------------------------------------------------------------------------


def _crc_table() -> tuple[int, ...]:
    table = []
    for value in range(256):
        for _ in range(8):
            value = value >> 1 ^ (0x82F6_3B78 if value & 1 else 0)
        table.append(value)
    return tuple(table)


_CRC_TABLE = _crc_table()


def crc32c(data: bytes) -> int:
    """CRC-32C (Castagnoli): reflected polynomial 0x82F63B78, start and final XOR 0xFFFFFFFF."""
    crc = 0xFFFF_FFFF
    for byte in data:
        crc = crc >> 8 ^ _CRC_TABLE[(crc ^ byte) & 0xFF]
    return crc ^ 0xFFFF_FFFF


def schema_text() -> str:
    """Everything two ends must agree on to read each other's payloads, one thing a line."""
    lines = [f"version {PROTOCOL_VERSION}"]
    for enumeration in ENUMERATIONS:
        values = " ".join(f"{member.name}={member.value}" for member in enumeration)
        lines.append(f"enum {enumeration.__name__} {values}")
    for layout in sorted(LAYOUTS.values(), key=lambda layout: layout.id):
        parts = [f"{field.name}:{field.wire.name}" for field in layout.fields]
        lines.append(" ".join([f"message {layout.id:#04x} {layout.type.__name__}", *parts]))
    return "\n".join(lines) + "\n" + parameters_text()


def parameters_text() -> str:
    """The part of `schema_text` that says what an EEPROM written by one firmware means to another."""
    return "".join(
        f"param {param.name} default={default} lowest={lowest} highest={highest}\n"
        for param, (default, lowest, highest, _) in PARAMETERS.items()
    )


SCHEMA_HASH = crc32c(schema_text().encode())
PARAMS_VERSION = crc32c(parameters_text().encode())

# --- Frames: COBS(id, seq, payload, CRC-32C), 0x00 ----------------------------------------------

OVERHEAD = 6  # id, sequence number, checksum
RAW_MAX = 253  # COBS then needs one extra byte, always, and never its 0xFF block


def _raw_max(to_host: bool) -> int:
    return OVERHEAD + max(layout.size for layout in LAYOUTS.values() if layout.to_host == to_host)


RAW_MAX_TO_ROBOT = _raw_max(to_host=False)
RAW_MAX_TO_HOST = _raw_max(to_host=True)
assert max(RAW_MAX_TO_ROBOT, RAW_MAX_TO_HOST) <= RAW_MAX


def cobs_encode(raw: bytes) -> bytes:
    """`raw` (at most 253 bytes) without its zeros, one byte longer."""
    return b"".join(bytes([len(block) + 1]) + block for block in raw.split(b"\0"))


def cobs_decode(coded: bytes) -> bytes | None:
    """What `coded`, at least one byte and no zeros, stands for; None if its blocks do not add up."""
    raw = bytearray(coded)
    at, end = 0, len(raw)
    while at < end:  # each block begins with its length, where there was a zero
        length = raw[at]
        raw[at] = 0
        at += length
    return bytes(raw[1:]) if at == end else None


def encode(message: Message, seq: int) -> bytes:
    """The bytes of one frame, its delimiter included.

    Parameters
    ----------
    message
        Any message of the schema.
    seq
        Sequence number, 0 to 255.

    Raises
    ------
    ValueError
        A field does not fit its wire type.
    """
    layout = LAYOUTS[message.ID]
    try:
        payload = layout.packing.pack(*(getattr(message, field.name) for field in layout.fields))
    except struct.error as error:
        raise ValueError(f"{message} does not fit its wire types: {error}") from None
    body = bytes([message.ID, seq]) + payload
    return cobs_encode(body + struct.pack("<I", crc32c(body))) + b"\0"


class Received(NamedTuple):
    """A message that came whole and in its turn."""

    seq: int
    message: Message


@dataclass
class Counters:
    """What this end of the link saw; the names are those of LinkStatus."""

    frames: int = 0  # received whole and correct
    crc: int = 0  # dropped: checksum wrong
    framing: int = 0  # dropped: COBS broken, or too short to be a frame
    overlong: int = 0  # dropped: longer than any message
    unknown: int = 0  # dropped: no message of this direction has this id
    length: int = 0  # dropped: wrong length for the message
    value: int = 0  # dropped: a number its enumeration does not have
    lost: int = 0  # messages that never came, by the gaps in the sequence numbers
    stale: int = 0  # dropped: repeated, or overtaken by a later one


class Decoder:
    """Bytes of one direction in, messages out; finds its feet again at the next delimiter.

    Parameters
    ----------
    to_host
        Which direction's messages to accept: True on the host, False on the robot.
    """

    def __init__(self, *, to_host: bool) -> None:
        self.counters = Counters()
        self._to_host = to_host
        self._opening = Hello.ID if to_host else HelloRequest.ID
        self._coded_max = 1 + (RAW_MAX_TO_HOST if to_host else RAW_MAX_TO_ROBOT)
        self._partial = b""
        self._newest: int | None = None

    def feed(self, data: bytes) -> list[Received]:
        """Messages completed by `data`, in order. Never raises, whatever the bytes."""
        *ended, rest = data.split(b"\0")
        received = []
        for part in ended:
            frame, self._partial = self._partial + part, b""
            if frame and (one := self._decode(frame)):
                received.append(one)
        # One byte too many is kept: enough to know at the delimiter that the frame was overlong.
        self._partial = (self._partial + rest)[: self._coded_max + 1]
        return received

    def _decode(self, coded: bytes) -> Received | None:
        counters = self.counters
        if len(coded) > self._coded_max:
            counters.overlong += 1
            return None
        raw = cobs_decode(coded)
        if raw is None or len(raw) < OVERHEAD:
            counters.framing += 1
            return None
        body, (checksum,) = raw[:-4], struct.unpack("<I", raw[-4:])
        if crc32c(body) != checksum:
            counters.crc += 1
            return None
        counters.frames += 1
        message = self._parse(body[0], body[2:])
        return Received(body[1], message) if self._in_turn(body[0], body[1]) and message else None

    def _parse(self, message_id: int, payload: bytes) -> Message | None:
        layout = LAYOUTS.get(message_id)
        if layout is None or layout.to_host != self._to_host:
            self.counters.unknown += 1
            return None
        if len(payload) != layout.size:
            self.counters.length += 1
            return None
        try:
            return build(layout, layout.packing.unpack(payload))
        except ValueError:
            self.counters.value += 1
            return None

    def _in_turn(self, message_id: int, seq: int) -> bool:
        """Follow the sequence numbers; False for what is repeated or was overtaken."""
        if self._newest is None or message_id == self._opening:
            self._newest = seq  # a session starts here: nothing before it can be missing
            return True
        behind = (self._newest - seq) & 0xFF
        if behind < STALE_WINDOW:
            self.counters.stale += 1
            return message_id == EStop.ID  # honoured in any order
        self.counters.lost += (seq - self._newest - 1) & 0xFF
        self._newest = seq
        return True
