"""No damage on the line makes a command nobody sent: link.c under every small flip and ten million others.

``CORRUPTIONS=1000000000 pytest -s tests/link/test_link_executes_nothing_wrong.py`` looks longer.
"""

from __future__ import annotations

import os
import random

import pytest
from link_in_c import LinkInC

from host.link.protocol import LAYOUTS, Layout, build, encode

CORRUPTIONS = int(os.environ.get("CORRUPTIONS", "10000000"))
TO_ROBOT = [layout for layout in LAYOUTS.values() if not layout.to_host]
POOL = 600
HABITS = ("zeros", "ones", "small", "any")


def payload(layout: Layout, habit: str, chance: random.Random) -> bytes:
    """Zeros are where COBS multiplies flips, small numbers are usual, any bits are the general case."""
    if habit == "zeros":
        return bytes(layout.size)
    if habit == "ones":
        return b"\xff" * layout.size
    if habit == "small":
        return layout.packing.pack(*(chance.randrange(200) for _ in layout.fields)) if layout.fields else b""
    return chance.randbytes(layout.size)


def frame(layout: Layout, habit: str, chance: random.Random) -> bytes:
    seq = 0 if habit == "zeros" else chance.randrange(256)
    values = layout.packing.unpack(payload(layout, habit, chance)) if layout.fields else ()
    return encode(build(layout, values), seq)


@pytest.mark.parametrize("layout", TO_ROBOT, ids=lambda layout: layout.type.__name__)
def test_no_one_two_or_three_flipped_bits_make_a_command(c_link: LinkInC, layout: Layout):
    chance = random.Random(layout.id)
    total = 0
    for habit in HABITS:
        sent = frame(layout, habit, chance)
        tried, accepted = c_link.flip_bits(sent)
        bits = 8 * len(sent)
        assert tried == bits + bits * (bits - 1) // 2 + bits * (bits - 1) * (bits - 2) // 6
        assert accepted == 0, habit
        total += tried
    print(f"\n{layout.type.__name__}: {total:,} flips, none executed")


def test_no_random_corruption_makes_a_command(c_link: LinkInC):
    chance = random.Random(1)
    frames = [frame(chance.choice(TO_ROBOT), chance.choice(HABITS), chance) for _ in range(POOL)]
    left, wrong, whole, lost, part = CORRUPTIONS, 0, 0, 0, 1_000_000_000
    while left > 0:
        these = min(left, part)
        results = c_link.corrupt(frames, these, seed=chance.getrandbits(64) | 1)
        wrong, whole, lost = (a + b for a, b in zip((wrong, whole, lost), results, strict=True))
        left -= these
    print(f"\n{CORRUPTIONS:,} corruptions: {wrong} wrong, {whole:,} harmless, {lost:,} lost both frames")
    assert wrong == 0
    assert whole < 0.02 * CORRUPTIONS  # and nearly all of them truly were corruptions
    assert 0.2 * CORRUPTIONS < lost < 0.9 * CORRUPTIONS  # the others hit one frame and spared the other
