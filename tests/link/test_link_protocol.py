"""The codec by itself: round trips, losses counted by kind, and no corruption that becomes a message."""

from __future__ import annotations

import itertools
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from messages_any import SEQS, lines, messages, sealed, wounded_frames

from host.link.protocol import (
    LAYOUTS,
    OVERHEAD,
    RAW_MAX,
    STALE_WINDOW,
    Clear,
    Counters,
    Decoder,
    Drive,
    EStop,
    Hello,
    HelloRequest,
    LinkStatus,
    Message,
    Nack,
    Ping,
    Received,
    Refusal,
    ResetCause,
    Stop,
    cobs_decode,
    cobs_encode,
    crc32c,
    encode,
)


def decode(data: bytes, *, to_host: bool = False) -> tuple[list[Received], Counters]:
    decoder = Decoder(to_host=to_host)
    return decoder.feed(data), decoder.counters


# --- Checksum and framing -------------------------------------------------------------------------


def test_the_checksum_is_crc_32c_as_in_rfc_3720():
    assert crc32c(b"123456789") == 0xE306_9283
    assert crc32c(bytes(32)) == 0x8A91_36AA
    assert crc32c(b"\xff" * 32) == 0x62A8_AB43
    assert crc32c(bytes(range(32))) == 0x46DD_794E


def test_cobs_examples_of_its_paper_hold():
    assert cobs_encode(b"") == b"\x01"
    assert cobs_encode(b"\x00") == b"\x01\x01"
    assert cobs_encode(b"\x00\x00") == b"\x01\x01\x01"
    assert cobs_encode(b"\x11\x22\x00\x33") == b"\x03\x11\x22\x02\x33"
    assert cobs_encode(b"\x11\x00\x00\x00") == b"\x02\x11\x01\x01\x01"


@given(st.binary(max_size=RAW_MAX))
def test_cobs_costs_one_byte_and_leaves_no_zero(raw: bytes):
    coded = cobs_encode(raw)
    assert len(coded) == len(raw) + 1
    assert 0 not in coded
    assert cobs_decode(coded) == raw


@given(st.lists(st.integers(1, 255), min_size=1).map(bytes))
def test_whatever_cobs_decodes_it_encodes_back(coded: bytes):
    raw = cobs_decode(coded)
    if raw is not None:
        assert cobs_encode(raw) == coded


def test_the_layout_on_the_wire_is_id_sequence_number_little_endian_fields_and_checksum():
    frame = encode(Drive(v_mm_s=300, omega_mrad_s=-500, expires_us=0x075B_CD15), 7)
    body = bytes.fromhex("03 07 2c 01 0c fe 15 cd 5b 07")
    assert cobs_decode(frame[:-1]) == body + struct.pack("<I", crc32c(body))
    assert frame[-1] == 0


# --- Round trip -----------------------------------------------------------------------------------


@pytest.mark.parametrize("to_host", [False, True])
@given(st.data())
def test_messages_come_back_as_they_were_sent_however_the_bytes_are_cut(to_host: bool, data: st.DataObject):
    sent = data.draw(st.lists(messages(to_host=to_host), max_size=8))
    first = data.draw(SEQS)
    stream = b"".join(encode(message, (first + n) & 0xFF) for n, message in enumerate(sent))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)))))
    decoder = Decoder(to_host=to_host)
    received = [
        one
        for begin, end in itertools.pairwise([0, *cuts, len(stream)])
        for one in decoder.feed(stream[begin:end])
    ]
    assert [message for _, message in received] == sent
    assert [seq for seq, _ in received] == [(first + n) & 0xFF for n in range(len(sent))]
    assert decoder.counters == Counters(frames=len(sent))


@pytest.mark.parametrize("message", [Drive(40_000, 0, 0), Drive(0, -32_769, 0), Ping(-1), Clear(1 << 32)])
def test_a_value_beyond_its_wire_type_is_refused_with_its_message_named(message: Message):
    with pytest.raises(ValueError, match=type(message).__name__):
        encode(message, 0)


# --- Losses ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("message", [Drive(0, 1, 0), Stop(), Clear(0x0100_0000), HelloRequest(0, 0x0101)])
def test_no_one_or_two_flipped_bits_make_a_message(message: Message):
    frame = encode(message, 0)
    whole = int.from_bytes(frame, "little")
    bits = 8 * len(frame)
    for a, b in itertools.combinations_with_replacement(range(bits), 2):
        flipped = whole ^ (1 << a | 1 << b)
        received, _ = decode(flipped.to_bytes(len(frame), "little") + b"\0")
        assert received == []


@given(wounded_frames(), messages(to_host=False), SEQS)
@settings(max_examples=200)
def test_a_wounded_frame_never_becomes_another_message(wounded: bytes, message: Message, seq: int):
    received, counters = decode(wounded + b"\0")
    for one in received:  # the wounds may have healed each other: then the frame stands there unhurt
        assert encode(one.message, one.seq) in wounded + b"\0"
    assert counters.frames == len(received) + counters.unknown + counters.length + counters.stale


@given(st.binary(max_size=200), messages(to_host=False), SEQS)
def test_after_any_garbage_the_first_frame_behind_a_delimiter_arrives(
    garbage: bytes, message: Message, seq: int
):
    received, _ = decode(garbage + b"\0" + encode(message, seq))
    assert received[-1:] == [Received(seq, message)]


@given(lines(to_host=True), st.booleans())
def test_no_bytes_make_the_decoder_raise_and_every_frame_is_accounted_for(line: bytes, to_host: bool):
    received, counters = decode(line + b"\0", to_host=to_host)
    ended = sum(1 for part in (line + b"\0").split(b"\0") if part)
    assert counters.frames + counters.crc + counters.framing + counters.overlong == ended
    dropped = counters.unknown + counters.length + counters.value
    assert counters.frames - dropped - counters.stale <= len(received) <= counters.frames - dropped


def test_each_loss_has_its_own_counter():
    good = encode(Clear(0x0102_0304), 0)
    wrong_checksum = bytes([*good[:3], good[3] ^ 1, *good[4:]])
    assert decode(wrong_checksum)[1] == Counters(crc=1)
    assert decode(good[:5] + b"\0")[1] == Counters(framing=1)
    assert decode(sealed(b""))[1] == Counters(framing=1)  # no room for id and sequence number
    assert decode(b"\1" * 1000 + b"\0")[1] == Counters(overlong=1)
    assert decode(sealed(b"\x7f\0"))[1] == Counters(frames=1, unknown=1)
    assert decode(encode(Nack(3, 0, Refusal.SCHEMA), 0))[1] == Counters(frames=1, unknown=1)
    assert decode(sealed(bytes([Clear.ID, 0, 1, 2, 3])))[1] == Counters(frames=1, length=1)
    hello = bytes([Hello.ID, 0]) + bytes(9) + b"\xee" + bytes(4)
    assert decode(sealed(hello), to_host=True)[1] == Counters(frames=1, value=1)


def test_a_partial_frame_takes_no_more_memory_however_long_the_babble():
    decoder = Decoder(to_host=False)
    for _ in range(100):
        decoder.feed(b"\x55" * 10_000)
    assert len(decoder._partial) < 100
    assert decoder.feed(b"\0" + encode(Stop(), 0)) == [Received(0, Stop())]
    assert decoder.counters == Counters(frames=1, overlong=1)


# --- Order ----------------------------------------------------------------------------------------


def stops(*seqs: int) -> bytes:
    return b"".join(encode(Stop(), seq) for seq in seqs)


def test_gaps_in_the_sequence_are_counted_as_lost_messages():
    received, counters = decode(stops(250, 251, 253, 3))
    assert [seq for seq, _ in received] == [250, 251, 253, 3]
    assert counters == Counters(frames=4, lost=6)


def test_a_repeated_or_overtaken_message_is_dropped():
    received, counters = decode(stops(40, 40, 39, 40 - STALE_WINDOW + 1, 41))
    assert [seq for seq, _ in received] == [40, 41]
    assert counters == Counters(frames=5, stale=3)


def test_an_emergency_stop_is_handed_on_in_any_order():
    received, _ = decode(stops(40) + encode(EStop(), 40) + encode(EStop(), 30) + stops(41))
    assert [one.message for one in received] == [Stop(), EStop(), EStop(), Stop()]


def test_hello_starts_a_new_sequence_in_either_direction():
    asked = decode(stops(40) + encode(HelloRequest(1, 2), 38) + stops(39))
    assert len(asked[0]) == 3
    assert asked[1] == Counters(frames=3)
    status = LinkStatus(*[0] * 10)
    hello = Hello(1, 2, 3, ResetCause.BROWN_OUT, 4)
    answered = decode(encode(status, 7) + encode(hello, 0) + encode(status, 1), to_host=True)
    assert len(answered[0]) == 3
    assert answered[1] == Counters(frames=3)


# --- The schema -----------------------------------------------------------------------------------


def test_ids_tell_the_direction_and_are_unique():
    assert len({layout.type for layout in LAYOUTS.values()}) == len(LAYOUTS) == 18
    assert all(0 < layout.id < 0x100 for layout in LAYOUTS.values())


def test_telemetry_at_100_hz_takes_at_most_a_quarter_of_the_line():
    bytes_s = 100 * (LAYOUTS[0x83].size + OVERHEAD + 2)
    assert bytes_s <= 0.25 * 25_000
