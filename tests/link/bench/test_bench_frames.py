"""Frames with the reason why they are broken, captures that come back as they were, and what a tap hears."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from host.errors import InputError, UsageError
from host.link.bench.capture import CaptureWriter, Piece, read_capture, read_raw
from host.link.bench.frames import FrameReader
from host.link.bench.witness import Witness
from host.link.protocol import (
    Decoder,
    Drive,
    Hello,
    LinkStatus,
    Outcome,
    Ping,
    Pong,
    Refusal,
    ResetCause,
    State,
    Telemetry,
    encode,
)
from host.link.protocol import Fault as RobotFault


def telemetry(t_us: int, *, nonce: int = 7, fault: RobotFault = RobotFault.NONE) -> Telemetry:
    return Telemetry(
        t_us,
        State.READY,
        fault,
        0,
        0,
        0,
        0,
        0,
        0,
        0,
        0,
        7400,
        0,
        0,
        nonce,
        0,
        0,
        0,
        0,
        Outcome.NONE,
        Refusal.NONE,
    )


def test_a_whole_frame_has_its_message_and_a_broken_one_its_reason() -> None:
    reader = FrameReader(to_host=False)
    good = encode(Drive(100, 0, 5), 1)
    wrong = bytearray(encode(Ping(5), 2))
    wrong[-2] ^= 0x40  # of the checksum
    frames = reader.feed(
        1.0, b"\0" + good + bytes(wrong) + b"\x05\x01\0" + encode(Pong(1, 2), 3) + b"\1" * 300 + b"\0"
    )
    assert [frame.error for frame in frames] == [None, "crc", "framing", "unknown", "overlong"]
    assert frames[0].message == Drive(100, 0, 5) and frames[0].seq == 1 and frames[0].coded + b"\0" == good


def test_gaps_are_told_with_the_frame_behind_them() -> None:
    reader = FrameReader(to_host=False)
    frames = reader.feed(0.0, encode(Ping(1), 1) + encode(Ping(2), 5) + encode(Ping(3), 5))
    assert [frame.lost for frame in frames] == [0, 3, 0] and frames[2].error == "stale"


@given(data=st.binary(max_size=300), cuts=st.lists(st.integers(0, 300), max_size=5))
def test_it_counts_as_the_decoder_does_however_the_bytes_come(data: bytes, cuts: list[int]) -> None:
    reader, decoder = FrameReader(to_host=True), Decoder(to_host=True)
    data = data + encode(Pong(1, 2), 9) + b"\0"
    messages = [received.message for received in decoder.feed(data)]
    frames, at = [], 0
    for cut in [*sorted(cut % (len(data) + 1) for cut in cuts), len(data)]:
        frames += reader.feed(0.0, data[at:cut])
        at = cut
    assert [frame.message for frame in frames if frame.message] == messages
    assert asdict(reader.counters) == asdict(decoder.counters)


@given(
    pieces=st.lists(
        st.tuples(st.integers(0, 10**9), st.booleans(), st.binary(min_size=1, max_size=30)), max_size=20
    )
)
@settings(max_examples=50)
def test_a_capture_comes_back_as_it_was(tmp_path_factory: pytest.TempPathFactory, pieces) -> None:
    path = tmp_path_factory.mktemp("capture") / "c.txt"
    pieces = sorted(pieces, key=lambda piece: piece[0])
    writer = CaptureWriter(path)
    for t_us, to_host, data in pieces:
        writer.add(t_us * 1e-6, to_host, data)
    writer.close()
    back = read_capture(path)
    start = pieces[0][0] if pieces else 0
    assert [(p.to_host, p.data) for p in back] == [(to_host, data) for _, to_host, data in pieces]
    assert [p.t_s for p in back] == pytest.approx([1e-6 * (t - start) for t, _, _ in pieces], abs=2e-6)


@pytest.mark.parametrize("line", ["hello", "1.0 ? 00", "x > 00", "1.0 > 0g", "nan > 00", "1.0 > 00 00"])
def test_a_damaged_line_of_a_capture_is_named(tmp_path: Path, line: str) -> None:
    path = tmp_path / "c.txt"
    path.write_text(f"robot link capture 1\n0.0 > 00\n{line}\n")
    with pytest.raises(InputError, match=r"c\.txt, line 3: not a time, > or <, and bytes; cut the line out"):
        read_capture(path)


@pytest.mark.parametrize("content", [b"", b"\x00\xff\x00", b"robot link capture 2\n", b"something else"])
def test_what_is_no_capture_is_said_to_be_none(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "c.txt"
    path.write_bytes(content)
    with pytest.raises(InputError, match="is no capture of ours; for bytes of one direction"):
        read_capture(path)


def test_a_missing_capture_is_said_to_be_missing(tmp_path: Path) -> None:
    for read in (read_capture, lambda path: read_raw(path, to_host=True)):
        with pytest.raises(InputError, match="cannot be read"):
            read(tmp_path / "none.txt")


def test_raw_bytes_are_one_piece_of_one_direction(tmp_path: Path) -> None:
    path = tmp_path / "raw.bin"
    path.write_bytes(b"\0\1\2")
    assert read_raw(path, to_host=False) == [Piece(0.0, False, b"\0\1\2")]


def test_a_capture_does_not_go_where_it_cannot(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is a folder"):
        CaptureWriter(tmp_path)


def heard(*told: tuple[float, object]) -> Witness:
    """A witness of messages to the host at some times."""
    witness, reader = Witness(), FrameReader(to_host=True)
    for seq, (t_s, message) in enumerate(told):
        for frame in reader.feed(t_s, encode(message, seq)):  # type: ignore[arg-type]
            witness.see(frame)
    return witness


def test_the_witness_counts_what_the_robot_lost_since_it_listens_across_a_wrap() -> None:
    status = [LinkStatus(*([value] * 10)) for value in (65530, 65535, 4)]
    evidence = heard(*((0.2 * k, one) for k, one in enumerate(status))).evidence()
    assert set(evidence.robot.values()) == {10}


def test_the_witness_sees_a_restart_and_its_cause_whichever_comes_first() -> None:
    hello = Hello(1, 2, 3, ResetCause.BROWN_OUT, 8)
    before, after = telemetry(10), telemetry(20, nonce=8)
    for order in ((before, hello, after), (before, after, hello)):
        assert heard(*((0.01 * k, one) for k, one in enumerate(order))).evidence().restarts == ["brown out"]
    assert heard((0.0, before), (0.1, after)).evidence().restarts == ["unknown"]


def test_the_witness_knows_the_pace_of_telemetry_by_the_robots_clock() -> None:
    witness = heard(*((0.5 * k, telemetry(12_500 * k)) for k in range(9)))
    assert witness.evidence().telemetry_hz == pytest.approx(80.0)
    assert witness.evidence().longest_silence_s == pytest.approx(0.5)


def test_the_witness_counts_each_fault_once_for_each_time_it_is_latched() -> None:
    stall, none = RobotFault.STALL, RobotFault.NONE
    told = [telemetry(k, fault=fault) for k, fault in enumerate((none, stall, stall, none, stall))]
    assert heard(*((0.01 * k, one) for k, one in enumerate(told))).evidence().faults == {"stall": 2}


def test_the_witness_blames_nobody_for_the_frame_within_which_the_port_was_opened() -> None:
    witness, reader = Witness(), FrameReader(to_host=True)
    cut_short = encode(telemetry(10), 4)[7:]
    for frame in reader.feed(0.0, cut_short + encode(telemetry(20), 5) + cut_short):
        witness.see(frame)
    assert witness.host["frames"] == 1
    assert witness.host["crc"] + witness.host["framing"] == 1  # the later one


def test_the_witness_takes_a_fault_that_was_there_before_for_no_new_one() -> None:
    told = [telemetry(k, fault=RobotFault.LINK_LOST) for k in range(3)]
    assert heard(*((0.01 * k, one) for k, one in enumerate(told))).evidence().faults == {}
