"""Hypothesis strategies: any message, any frame, any kind of line noise."""

from __future__ import annotations

from hypothesis import strategies as st

from host.link.protocol import LAYOUTS, Layout, Message, build, cobs_encode, crc32c, encode

SEQS = st.integers(0, 255)


def _message(layout: Layout) -> st.SearchStrategy[Message]:
    values = [
        st.sampled_from([int(member) for member in field.enumeration])
        if field.enumeration
        else st.integers(field.wire.values[0], field.wire.values[-1]) | st.sampled_from([0, 1])
        for field in layout.fields
    ]
    return st.tuples(*values).map(lambda drawn: build(layout, drawn))


def messages(*, to_host: bool) -> st.SearchStrategy[Message]:
    """Any message of one direction, zeros being common."""
    return st.one_of([_message(layout) for layout in LAYOUTS.values() if layout.to_host == to_host])


def sealed(body: bytes) -> bytes:
    """A frame with a right checksum around any body, known to the schema or not."""
    return cobs_encode(body + crc32c(body).to_bytes(4, "little")) + b"\0"


@st.composite
def wounded_frames(draw: st.DrawFn) -> bytes:
    """A frame to the robot after a few flips, losses, doublings and overwritings."""
    wire = bytearray(encode(draw(messages(to_host=False)), draw(SEQS)))
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(wire) - 1))
        match draw(st.sampled_from(["flip", "lose", "double", "overwrite"])):
            case "flip":
                wire[at] ^= 1 << draw(st.integers(0, 7))
            case "lose" if len(wire) > 1:
                del wire[at]
            case "double":
                wire.insert(at, wire[at])
            case _:
                wire[at] = draw(st.integers(0, 255))
    return bytes(wire)


def lines(*, to_host: bool) -> st.SearchStrategy[bytes]:
    """What may stand on a bad line: frames, wounded frames, lawful frames of no message, noise."""
    frames = st.builds(encode, messages(to_host=to_host), SEQS)
    bodies = st.binary(max_size=60).map(sealed) | st.builds(
        lambda message_id, rest: sealed(bytes([message_id]) + rest),
        st.sampled_from(sorted(LAYOUTS)),
        st.binary(max_size=12),
    )
    return st.lists(frames | wounded_frames() | bodies | st.binary(max_size=80), max_size=12).map(b"".join)
