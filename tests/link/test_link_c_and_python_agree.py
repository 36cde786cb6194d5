"""The firmware's link.c and messages.h against protocol.py: the same bytes, the same verdict on any bytes."""

from __future__ import annotations

from dataclasses import asdict

from hypothesis import given, settings
from hypothesis import strategies as st
from link_in_c import LinkInC, counted
from messages_any import SEQS, lines, messages

from host.link.protocol import Decoder, Message, Received, crc32c, encode


@given(st.binary(max_size=255))
def test_both_compute_the_same_checksum(c_link: LinkInC, data: bytes):
    assert c_link.crc32c(data) == crc32c(data)


@given(messages(to_host=True) | messages(to_host=False), SEQS)
@settings(max_examples=200)
def test_both_make_the_same_frame_of_any_message(c_link: LinkInC, message: Message, seq: int):
    c_link.fresh()
    assert c_link.encode(message, seq) == encode(message, seq)


@given(messages(to_host=False), SEQS)
@settings(max_examples=200)
def test_c_reads_what_python_wrote(c_link: LinkInC, message: Message, seq: int):
    c_link.fresh()
    assert c_link.receive(encode(message, seq)) == [Received(seq, message)]


@given(messages(to_host=True), SEQS)
@settings(max_examples=200)
def test_python_reads_what_c_wrote(c_link: LinkInC, message: Message, seq: int):
    c_link.fresh()
    assert Decoder(to_host=True).feed(c_link.encode(message, seq)) == [Received(seq, message)]


@given(st.lists(lines(to_host=False), max_size=4))
@settings(max_examples=200)
def test_both_hear_the_same_messages_and_count_the_same_losses_on_any_line(
    c_link: LinkInC, heard: list[bytes]
):
    c_link.fresh()
    decoder = Decoder(to_host=False)
    for line in heard:
        assert c_link.receive(line) == decoder.feed(line)
    in_c = asdict(c_link.counters())
    assert {name: in_c[name] for name in counted(decoder)} == counted(decoder)
