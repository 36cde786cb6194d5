"""The line made worse on purpose: faults as often as asked, counted, and the same again for the same seed."""

from __future__ import annotations

import itertools
from dataclasses import asdict, dataclass, field

import pytest
from scripted_robot import VirtualClock

from host.link.faults import Faults, FaultyLine, Injected
from host.link.protocol import Decoder, Ping, encode


@dataclass
class Loop:
    """A line whose robot sends everything back at once."""

    sent: bytes = b""
    waiting: bytes = b""
    writes: list[bytes] = field(default_factory=list)

    def write(self, data: bytes) -> None:
        self.writes.append(data)
        self.waiting += data

    def read(self) -> bytes:
        data, self.waiting = self.waiting, b""
        return data

    def close(self) -> None:
        self.writes.append(b"closed")


def numbered(count: int) -> list[bytes]:
    return [b"\0" + encode(Ping(n), n & 0xFF) for n in range(count)]


def through(frames: list[bytes], faults: Faults, seed: int = 0) -> tuple[bytes, Injected]:
    """What arrives of frames sent 5 ms apart, and what was done to them."""
    clock, loop = VirtualClock(), Loop()
    line = FaultyLine(loop, clock, to_robot=faults, seed=seed)
    for frame in frames:
        line.write(frame)
        clock.sleep_s(0.005)
    clock.sleep_s(1.0)
    line.pump()
    return b"".join(loop.writes), line.injected_to_robot


def numbers(data: bytes) -> list[int]:
    """Which of the frames came whole, in the order they came."""
    found = []
    for part in data.split(b"\0"):
        for received in Decoder(to_host=False).feed(part + b"\0"):
            assert isinstance(received.message, Ping)
            found.append(received.message.host_time_us)
    return found


def test_without_faults_every_byte_passes_at_once():
    clock, loop = VirtualClock(), Loop()
    line = FaultyLine(loop, clock)
    frame = numbered(1)[0]
    line.write(frame)
    assert loop.writes == [frame]
    assert line.read() == frame
    line.write(b"half a fr")
    assert loop.writes[-1] == b"half a fr"
    line.close()
    assert loop.writes[-1] == b"closed"


@pytest.mark.parametrize("kind", ["drop", "truncate", "duplicate", "reorder"])
def test_a_fault_strikes_as_many_frames_as_asked_and_counts_them(kind: str):
    _, injected = through(numbered(5000), Faults(**{kind: 0.1}))
    counted = {"drop": "dropped", "truncate": "truncated", "duplicate": "duplicated", "reorder": "reordered"}
    assert injected.frames == 5000
    assert 400 < asdict(injected)[counted[kind]] < 600
    assert sum(asdict(injected).values()) == 5000 + asdict(injected)[counted[kind]]  # and nothing else


def test_dropped_frames_are_missing_and_the_others_whole():
    data, injected = through(numbered(1000), Faults(drop=0.2))
    assert len(numbers(data)) == 1000 - injected.dropped
    assert numbers(data) == sorted(numbers(data))


def test_duplicated_frames_come_twice():
    data, injected = through(numbered(1000), Faults(duplicate=0.2))
    assert len(numbers(data)) == 1000 + injected.duplicated
    assert set(numbers(data)) == set(range(1000))


def test_reordered_frames_are_overtaken_and_none_is_lost():
    data, injected = through(numbered(1000), Faults(reorder=0.2))
    found = numbers(data)
    assert sorted(found) == list(range(1000))
    overtaken = sum(b < a for a, b in itertools.pairwise(found))
    assert 0.6 * injected.reordered < overtaken <= injected.reordered


def test_a_truncated_frame_is_lost_and_takes_no_more_than_the_next_one_with_it():
    data, injected = through(numbered(1000), Faults(truncate=0.1))
    assert 1000 - 2 * injected.truncated <= len(numbers(data)) < 1000 - 0.8 * injected.truncated


def test_bits_flip_at_the_rate_asked():
    frames = numbered(4000)
    data, injected = through(frames, Faults(bit_error_rate=1e-3))
    sent = b"".join(frames)
    differing = sum((a ^ b).bit_count() for a, b in zip(sent, data, strict=True))
    assert differing == injected.bits_flipped
    assert injected.bits_flipped == pytest.approx(8 * len(sent) * 1e-3, rel=0.15)
    assert 0 < injected.damaged <= injected.bits_flipped


def test_at_a_rate_of_one_every_bit_flips():
    data, injected = through([b"\x0f"], Faults(bit_error_rate=1.0))
    assert (data, injected.bits_flipped) == (b"\xf0", 8)


def test_delay_and_jitter_keep_the_order_and_their_bounds():
    clock, loop = VirtualClock(), Loop()
    line = FaultyLine(loop, clock, to_robot=Faults(delay_s=0.02, jitter_s=0.01))
    sent_s, delays_s = {}, []
    for n, frame in enumerate(numbered(500)):
        sent_s[n] = clock.now_s()
        before = len(loop.writes)
        line.write(frame)
        for _ in range(10):
            for k in numbers(b"".join(loop.writes[before:])):
                delays_s.append(clock.now_s() - sent_s[k])
            before = len(loop.writes)
            clock.sleep_s(0.001)
            line.pump()
        for k in numbers(b"".join(loop.writes[before:])):
            delays_s.append(clock.now_s() - sent_s[k])
    assert numbers(b"".join(loop.writes)) == list(range(len(delays_s)))
    assert min(delays_s) >= 0.02
    assert max(delays_s) < 0.032
    assert max(delays_s) - min(delays_s) > 0.007


def test_both_directions_have_their_own_faults_which_may_change_meanwhile():
    clock = VirtualClock()
    line = FaultyLine(Loop(), clock, to_host=Faults(drop=1.0))
    frame = numbered(1)[0]
    line.write(frame)
    assert line.read() == b""
    assert (line.injected_to_robot.dropped, line.injected_to_host.dropped) == (0, 1)
    line.to_host.drop = 0.0
    line.write(frame)
    assert line.read() == frame
    line.to_robot.drop = 1.0
    line.write(frame)
    assert line.read() == b""


def test_equal_seeds_give_equal_faults_and_others_give_others():
    faults = dict(drop=0.1, truncate=0.1, duplicate=0.1, reorder=0.1, bit_error_rate=1e-3, jitter_s=0.01)
    once, again, other = (through(numbered(300), Faults(**faults), seed) for seed in (1, 1, 2))
    assert once == again
    assert once[0] != other[0]


def test_a_frame_from_the_robot_may_come_in_pieces_and_is_struck_as_one():
    clock, loop = VirtualClock(), Loop()
    line = FaultyLine(loop, clock)
    frame = encode(Ping(7), 0)
    loop.waiting = frame[:5]
    assert line.read() == b""
    loop.waiting = frame[5:]
    assert line.read() == frame
    assert line.injected_to_host.frames == 1
    loop.waiting = b"\x55" * 1000  # noise without an end does not pile up
    assert len(line.read()) == 1000
