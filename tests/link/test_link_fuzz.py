"""The decoder in C under libFuzzer and sanitizers, and whatever it found interesting through both decoders.

Ten seconds here; ``FUZZ_SECONDS=600 pytest -s tests/link/test_link_fuzz.py`` looks longer.
"""

from __future__ import annotations

import os
import random
import re
import shutil
import subprocess
from dataclasses import asdict
from pathlib import Path

import pytest
from link_in_c import FIRMWARE, HERE, LinkInC, counted
from messages_any import sealed

from host.link.protocol import LAYOUTS, Decoder, build, encode

C_TESTS = HERE.parent / "firmware"
FUZZ_SECONDS = int(os.environ.get("FUZZ_SECONDS", "10"))
LONGEST = 600  # bytes of an input


@pytest.fixture(scope="module")
def fuzzer(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Skips where clang or its fuzzer is missing, except in CI, where that is a failure."""
    clang = shutil.which("clang")
    program = tmp_path_factory.mktemp("fuzzer") / "fuzz_link"
    why = "clang is missing"
    if clang is not None:
        flags = ["-std=gnu11", "-O1", "-g", "-Wall", "-Wextra", "-Werror", f"-I{FIRMWARE}", f"-I{C_TESTS}"]
        checks = ["-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all"]
        sources = [HERE / "fuzz_link.c", FIRMWARE / "link.c"]
        done = subprocess.run(
            [clang, *flags, *checks, *sources, "-o", program], capture_output=True, text=True
        )
        if done.returncode == 0:
            return program
        if "clang_rt" not in done.stderr:
            pytest.fail(f"clang says:\n{done.stderr}", pytrace=False)
        why = "clang's fuzzer is missing"
    why += ": sudo apt-get install clang libclang-rt-dev"
    if os.environ.get("CI", "").lower() in ("1", "true"):
        pytest.fail(why, pytrace=False)
    pytest.skip(why)


def write_seeds(folder: Path) -> None:
    """Every message, lawful frames of none, runs of frames, noise."""
    chance = random.Random(1)
    frames = []
    for layout in LAYOUTS.values():
        if layout.to_host:
            body = bytes([layout.id, 1]) + bytes(layout.size)
            frames.append(sealed(body[:50]))
            continue
        for payload in (bytes(layout.size), chance.randbytes(layout.size)):
            values = layout.packing.unpack(payload) if layout.fields else ()
            frames.append(encode(build(layout, values), chance.randrange(256)))
        frames.append(sealed(bytes([layout.id, 2]) + chance.randbytes(layout.size + 1)))
    frames += [sealed(b""), sealed(b"\x7f\x01"), b"\0\0\0", b"\x01" * 40 + b"\0", chance.randbytes(200)]
    frames += [b"".join(chance.choices(frames, k=8)) for _ in range(20)]
    for n, frame in enumerate(frames):
        (folder / f"seed{n:03}").write_bytes(frame)


def test_no_bytes_break_the_decoder_and_both_decoders_agree_on_all_the_fuzzer_found(
    fuzzer: Path, c_link: LinkInC, tmp_path: Path
):
    corpus = tmp_path / "corpus"
    corpus.mkdir()
    write_seeds(corpus)
    seeds = len(list(corpus.iterdir()))
    limits = [f"-max_total_time={FUZZ_SECONDS}", f"-max_len={LONGEST}", "-print_final_stats=1"]
    done = subprocess.run(
        [fuzzer, *limits, f"-artifact_prefix={tmp_path}/", corpus],
        capture_output=True,
        text=True,
        timeout=FUZZ_SECONDS + 120,
    )
    if done.returncode:
        pytest.fail(done.stderr[-4000:], pytrace=False)
    found = re.search(r"number_of_executed_units:\s*(\d+)", done.stderr)
    assert found
    executed = int(found[1])

    messages = 0
    inputs = sorted(corpus.iterdir())
    for path in inputs:
        data = path.read_bytes()
        c_link.fresh()
        decoder = Decoder(to_host=False)
        in_python = decoder.feed(data)
        assert c_link.receive(data) == in_python, path
        in_c = asdict(c_link.counters())
        assert {name: in_c[name] for name in counted(decoder)} == counted(decoder), path
        messages += len(in_python)
    print(
        f"\n{executed:,} inputs executed; {len(inputs)} kept, {messages:,} messages in them, no disagreement"
    )
    assert executed > 1000 * FUZZ_SECONDS
    assert len(inputs) > seeds  # it went beyond what it was given
    assert messages > 100
