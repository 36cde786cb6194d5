"""Write what follows from the schema: firmware/src/messages.h, docs/protocol.md's tables, golden vectors.

``python -m host.link.generate`` writes; with ``--check`` it writes nothing and fails when one is stale.
"""

from __future__ import annotations

import json
import random
import re
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

from host.config import read_options
from host.errors import InputError, run_command
from host.link import protocol
from host.link.parameters import PARAMETERS
from host.link.protocol import LAYOUTS, Layout, Wire

ROOT = Path(__file__).resolve().parents[2]
HEADER = Path("firmware/src/messages.h")
MANUAL = Path("docs/protocol.md")
GOLDEN = Path("tests/link/golden.json")

ENUM_PREFIXES = {
    protocol.State: "STATE",
    protocol.Fault: "FAULT",
    protocol.ResetCause: "RESET",
    protocol.Refusal: "REFUSED",
    protocol.Outcome: "OUTCOME",
    protocol.StopHow: "STOP",
    protocol.Param: "PARAM",
}
CONSTANTS = {
    "PROTOCOL_VERSION": (protocol.PROTOCOL_VERSION, "of framing, checksum and handshake"),
    "SCHEMA_HASH": (protocol.SCHEMA_HASH, "of every message and enumeration below"),
    "PARAMS_VERSION": (protocol.PARAMS_VERSION, "of the list of parameters, kept with them in EEPROM"),
    "LINK_BAUD": (protocol.BAUD, "exact on a 16 MHz ATmega328P"),
    "DEAD_MAN_US": (protocol.DEAD_MAN_US, "a setpoint holds no longer, whatever its DRIVE says"),
    "DRIVE_AHEAD_MAX_US": (protocol.DRIVE_AHEAD_MAX_US, "refuse a DRIVE whose deadline is further ahead"),
    "TELEMETRY_PERIOD_US": (protocol.TELEMETRY_PERIOD_US, "between two TELEMETRY"),
    "LINK_STATUS_PERIOD_US": (protocol.LINK_STATUS_PERIOD_US, "between two LINK_STATUS"),
    "LINK_STALE_WINDOW": (protocol.STALE_WINDOW, "sequence numbers this close behind are repeats"),
    "LINK_OVERHEAD": (protocol.OVERHEAD, "bytes of id, sequence number and checksum"),
    "LINK_RAW_MAX_TO_ROBOT": (protocol.RAW_MAX_TO_ROBOT, "longest frame before COBS"),
    "LINK_RAW_MAX_TO_HOST": (protocol.RAW_MAX_TO_HOST, "longest frame before COBS"),
    "NO_EDGE_US": (protocol.NO_EDGE_US, "edge age of a wheel that has not turned"),
}
HASHES = ("SCHEMA_HASH", "PARAMS_VERSION")  # written in hexadecimal

# --- Names --------------------------------------------------------------------------------------


def snake(name: str) -> str:
    """``HelloRequest`` -> ``hello_request``, ``EStop`` -> ``estop``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()


def c_name(layout: Layout) -> str:
    """Prefix of everything about one message in messages.h."""
    return "msg_" + snake(layout.type.__name__)


def c_type(wire: Wire) -> str:
    """C's name for a wire type."""
    return f"{'' if wire.signed else 'u'}int{8 * wire.size}_t"


def offsets(layout: Layout) -> list[int]:
    """Where each field begins in the payload."""
    return [sum(field.wire.size for field in layout.fields[:n]) for n in range(len(layout.fields))]


def first_line(documented: type) -> str:
    """The purpose line of a class."""
    return (documented.__doc__ or "").strip().splitlines()[0]


# --- messages.h ---------------------------------------------------------------------------------

HEADER_TOP = """\
// Messages of the link: ids, payload sizes, and how each lies in its payload.
// Generated from host/link/protocol.py by `python -m host.link.generate`; do not edit.
//
// For every message NAME there is MSG_NAME (its id) and MSG_NAME_SIZE (bytes of payload), and unless it is
// empty a struct msg_name with
//     msg_name_encode(&message, payload)    writes MSG_NAME_SIZE bytes
//     msg_name_decode(&message, payload)    reads MSG_NAME_SIZE bytes
// Everything on the wire is little endian and unpadded, whatever the machine.
#ifndef MESSAGES_H
#define MESSAGES_H

#include <stdint.h> // integers of known width
"""

HEADER_HELPERS = """
// --- Bytes ---------------------------------------------------------------------------------------

static inline void msg_put_u8(uint8_t *at, uint8_t value)
{
    at[0] = value;
}

static inline void msg_put_u16(uint8_t *at, uint16_t value)
{
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
}

static inline void msg_put_u32(uint8_t *at, uint32_t value)
{
    msg_put_u16(at, (uint16_t)value);
    msg_put_u16(at + 2, (uint16_t)(value >> 16));
}

static inline uint8_t msg_get_u8(const uint8_t *at)
{
    return at[0];
}

static inline uint16_t msg_get_u16(const uint8_t *at)
{
    return (uint16_t)(at[0] | (uint16_t)at[1] << 8);
}

static inline uint32_t msg_get_u32(const uint8_t *at)
{
    return msg_get_u16(at) | (uint32_t)msg_get_u16(at + 2) << 16;
}
"""


def _c_banner(title: str) -> str:
    return f"\n// --- {title} {'-' * (94 - len(title))}\n"


def _c_message(layout: Layout) -> str:
    name, upper = c_name(layout), c_name(layout).upper()
    lines = [
        f"// {first_line(layout.type)}",
        f"#define {upper} 0x{layout.id:02X}u",
        f"#define {upper}_SIZE {layout.size}u",
    ]
    if not layout.fields:
        return "\n".join(lines) + "\n"
    members = [(f"{c_type(field.wire)} {field.name};", field.meaning) for field in layout.fields]
    width = max(len(member) for member, _ in members)
    lines += ["", f"struct {name} {{"]
    lines += [f"    {member:<{width}} // {meaning}" for member, meaning in members]
    lines += ["};", ""]
    puts, gets = [], []
    for field, at in zip(layout.fields, offsets(layout), strict=True):
        bits = 8 * field.wire.size
        cast = f"({c_type(field.wire)})" if field.wire.signed else ""
        uncast = f"(uint{bits}_t)" if field.wire.signed else ""
        puts.append(f"    msg_put_u{bits}(payload + {at}, {uncast}message->{field.name});")
        gets.append(f"    message->{field.name} = {cast}msg_get_u{bits}(payload + {at});")
    lines += [f"static inline void {name}_encode(const struct {name} *message, uint8_t *payload)", "{"]
    lines += [*puts, "}", ""]
    lines += [f"static inline void {name}_decode(struct {name} *message, const uint8_t *payload)", "{"]
    lines += [*gets, "}"]
    return "\n".join(lines) + "\n"


def _c_size_lookup() -> str:
    cases = [
        f"    case {c_name(layout).upper()}: return {c_name(layout).upper()}_SIZE;"
        for layout in LAYOUTS.values()
        if not layout.to_host
    ]
    return "\n".join([
        "#define MSG_UNKNOWN 0xFFu",
        "",
        "// Payload size of a message to the robot; MSG_UNKNOWN when no such message has this id.",
        "static inline uint8_t msg_to_robot_size(uint8_t id)",
        "{",
        "    switch (id) {",
        *cases,
        "    default: return MSG_UNKNOWN;",
        "    }",
        "}",
        "",
    ])  # fmt: skip


def _c_enumeration(enumeration: type[IntEnum]) -> str:
    prefix = ENUM_PREFIXES[enumeration]
    lines = [f"// {first_line(enumeration)}", f"enum {snake(enumeration.__name__)} {{"]
    lines += [f"    {prefix}_{member.name} = {member.value}," for member in enumeration]
    return "\n".join([*lines, "};"]) + "\n"


def _c_parameters() -> str:
    lines = [
        "// X(name, default, lowest, highest) for every parameter, in the order of enum param.",
        "#define PARAM_LIST(X) \\",
        *(
            f"    X({param.name}, {default}, {lowest}, {highest}) /* {meaning} */ \\"
            for param, (default, lowest, highest, meaning) in PARAMETERS.items()
        ),
    ]
    lines[-1] = lines[-1].removesuffix(" \\")
    return "\n".join([*lines, "", f"#define PARAM_COUNT {len(PARAMETERS)}u"]) + "\n"


def header() -> str:
    """All of messages.h."""
    parts = [HEADER_TOP]
    for name, (value, meaning) in CONSTANTS.items():
        number = f"0x{value:08X}" if name in HASHES else str(value)
        number = f"UINT32_C({number})" if value > 0xFFFF else f"{number}u"
        parts.append(f"#define {name} {number} // {meaning}\n")
    parts[1] = "\n" + parts[1]
    parts.append(_c_banner("Enumerations"))
    parts += ["\n" + _c_enumeration(enumeration) for enumeration in protocol.ENUMERATIONS]
    parts.append("\n" + _c_parameters())
    parts.append(HEADER_HELPERS)
    for to_host, title in ((False, "Messages to the robot"), (True, "Messages to the host")):
        parts.append(_c_banner(title))
        parts += ["\n" + _c_message(layout) for layout in LAYOUTS.values() if layout.to_host == to_host]
        if not to_host:
            parts.append("\n" + _c_size_lookup())
    parts.append("\n#endif\n")
    return "".join(parts)


# --- Tables of docs/protocol.md -----------------------------------------------------------------


def _table(columns: list[str], rows: list[list[str]]) -> str:
    lines = ["| " + " | ".join(cells) + " |" for cells in [columns, ["---"] * len(columns), *rows]]
    return "\n".join(lines) + "\n"


def _message_section(layout: Layout) -> str:
    title = snake(layout.type.__name__).upper()
    text = f"#### 0x{layout.id:02X} {title}: {layout.size} bytes\n\n{first_line(layout.type)}\n"
    if layout.fields:
        rows = [
            [str(at), field.name, field.wire.name, _meaning(field)]
            for field, at in zip(layout.fields, offsets(layout), strict=True)
        ]
        text += "\n" + _table(["offset", "field", "type", "meaning"], rows)
    return text


def _meaning(field: protocol.Field) -> str:
    return f"{field.meaning} ({field.enumeration.__name__})" if field.enumeration else field.meaning


def tables() -> dict[str, str]:
    """The generated passages of docs/protocol.md, by the name of their marker."""
    constants = [
        [name, f"0x{value:08X}" if name in HASHES else str(value), meaning]
        for name, (value, meaning) in CONSTANTS.items()
    ]
    enumerations = [
        f"#### {enumeration.__name__}\n\n{first_line(enumeration)}\n\n"
        + _table(["value", "name"], [[str(member.value), member.name] for member in enumeration])
        for enumeration in protocol.ENUMERATIONS
    ]

    parameters = [
        [str(param.value), param.name, *map(str, (default, lowest, highest)), meaning]
        for param, (default, lowest, highest, meaning) in PARAMETERS.items()
    ]

    def messages(to_host: bool) -> str:
        return "\n".join(_message_section(one) for one in LAYOUTS.values() if one.to_host == to_host)

    counters = next(one for one in LAYOUTS.values() if one.type is protocol.LinkStatus)
    return {
        "constants": _table(["name", "value", "meaning"], constants),
        "messages to the robot": messages(to_host=False),
        "messages to the host": messages(to_host=True),
        "enumerations": "\n".join(enumerations),
        "parameters": _table(["value", "name", "default", "lowest", "highest", "meaning"], parameters),
        "counters": _table(["counter", "counts"], [[one.name, one.meaning] for one in counters.fields]),
        "schema": "```\n" + protocol.schema_text() + "```\n",
    }


def manual(written: str) -> str:
    """docs/protocol.md with its generated passages renewed; what stands around them is left alone."""
    for name, table in tables().items():
        begin, end = f"<!-- generated: {name} -->\n", "<!-- end -->\n"
        before, found, rest = written.partition(begin)
        _, ended, after = rest.partition(end)
        if not found or not ended:
            raise InputError(f"{MANUAL} has no passage '{begin.strip()}' to '{end.strip()}': put it back")
        written = before + begin + "\n" + table + "\n" + end + after
    return written


# --- Golden vectors -----------------------------------------------------------------------------


def _samples(layout: Layout) -> list[tuple[int, ...]]:
    """Values of the fields: all zero, all lowest, all highest, and two of mixed bytes."""
    choices = [list(one.enumeration) if one.enumeration else one.wire.values for one in layout.fields]
    mixed = random.Random(layout.id)
    samples = [tuple(0 if 0 in values else values[0] for values in choices)]
    samples += [tuple(values[end] for values in choices) for end in (0, -1)]
    samples += [tuple(mixed.choice(values) for values in choices) for _ in range(2)]
    return list(dict.fromkeys(samples))


def golden() -> str:
    """Frames of every message, as JSON, one a line."""
    lines = []
    for layout in LAYOUTS.values():
        for sample in _samples(layout):
            seq = (len(lines) * 37) & 0xFF
            wire = protocol.encode(protocol.build(layout, sample), seq)
            values = {field.name: int(value) for field, value in zip(layout.fields, sample, strict=True)}
            entry = {"message": layout.type.__name__, "seq": seq, "fields": values, "wire": wire.hex()}
            lines.append(json.dumps(entry))
    return "[\n" + ",\n".join(lines) + "\n]\n"


# --- Command ------------------------------------------------------------------------------------


def outputs(root: Path) -> dict[Path, str]:
    """Every generated file below `root` and what it should hold."""
    try:
        written = (root / MANUAL).read_text()
    except FileNotFoundError:
        raise InputError(f"{MANUAL} is missing: run this from a checkout of the repository") from None
    return {HEADER: header(), MANUAL: manual(written), GOLDEN: golden()}


@dataclass(frozen=True)
class GenerateOptions:
    """Write what follows from host/link/protocol.py: header, tables, test vectors."""

    check: bool = False  # write nothing; fail when a file is stale


def main() -> None:
    """Write the generated files, or check them."""
    check = read_options(GenerateOptions).check
    for path, text in outputs(ROOT).items():
        target = ROOT / path
        if target.exists() and target.read_text() == text:
            continue
        if check:
            raise InputError(f"{path} is stale: run `python -m host.link.generate`")
        target.write_text(text)
        print(f"wrote {path}")


if __name__ == "__main__":
    run_command(main)
