"""What is generated from the schema is fresh, and what is pinned still holds."""

from __future__ import annotations

import json
import re
import shutil
import sys
from pathlib import Path

import pytest
from link_in_c import LinkInC

from host.errors import EXIT_INPUT, InputError, run_command
from host.link import generate, protocol
from host.link.protocol import LAYOUTS, Decoder, Message, Received, build, encode

GOLDEN = json.loads((generate.ROOT / generate.GOLDEN).read_text())


def message_of(entry: dict) -> Message:
    layout = next(one for one in LAYOUTS.values() if one.type.__name__ == entry["message"])
    assert [field.name for field in layout.fields] == list(entry["fields"])
    return build(layout, tuple(entry["fields"].values()))


@pytest.fixture
def copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A checkout of the generated files alone, on which the command works."""
    for path in generate.outputs(generate.ROOT):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(generate.ROOT / path, tmp_path / path)
    monkeypatch.setattr(generate, "ROOT", tmp_path)
    return tmp_path


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["generate", *arguments])
    with pytest.raises(SystemExit) as ended:
        run_command(generate.main)
    assert isinstance(ended.value.code, int)
    return ended.value.code


# --- Freshness ------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", [generate.HEADER, generate.MANUAL, generate.GOLDEN], ids=str)
def test_the_generated_file_says_what_the_schema_says(path: Path):
    assert (generate.ROOT / path).read_text() == generate.outputs(generate.ROOT)[path], (
        f"{path} is stale: run `python -m host.link.generate`"
    )


@pytest.mark.parametrize("path", [generate.HEADER, generate.MANUAL, generate.GOLDEN], ids=str)
def test_check_names_a_stale_file_and_leaves_it_and_writing_renews_it(
    copy: Path, path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    fresh = (copy / path).read_text()
    stale = fresh.replace("expires_us", "expires_ms")
    if path == generate.MANUAL:  # only its tables are generated
        stale = fresh.replace("| expires_us |", "| expires_ms |")
    assert stale != fresh
    (copy / path).write_text(stale)
    assert run(monkeypatch, "--check") == EXIT_INPUT
    assert capsys.readouterr().err == f"error: {path} is stale: run `python -m host.link.generate`\n"
    assert (copy / path).read_text() == stale
    assert run(monkeypatch) == 0
    assert (copy / path).read_text() == fresh
    assert run(monkeypatch, "--check") == 0


def test_a_manual_that_lost_a_marker_is_an_error_and_not_overwritten(
    copy: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    manual = copy / generate.MANUAL
    damaged = manual.read_text().replace("<!-- generated: counters -->\n", "")
    manual.write_text(damaged)
    assert run(monkeypatch) == EXIT_INPUT
    assert "docs/protocol.md has no passage '<!-- generated: counters -->'" in capsys.readouterr().err
    assert manual.read_text() == damaged


def test_outside_a_checkout_the_command_says_so(tmp_path: Path):
    with pytest.raises(InputError, match=r"docs/protocol\.md is missing: run this from a checkout"):
        generate.outputs(tmp_path)


# --- Pinned bytes ---------------------------------------------------------------------------------


@pytest.mark.parametrize("entry", GOLDEN, ids=lambda entry: f"{entry['message']}-{entry['seq']}")
def test_the_golden_frames_are_what_both_ends_speak(c_link: LinkInC, entry: dict):
    message, seq, wire = message_of(entry), entry["seq"], bytes.fromhex(entry["wire"])
    to_host = LAYOUTS[message.ID].to_host
    assert encode(message, seq) == wire
    assert Decoder(to_host=to_host).feed(wire) == [Received(seq, message)]
    c_link.fresh()
    assert c_link.encode(message, seq) == wire
    c_link.fresh()
    assert c_link.receive(wire) == ([] if to_host else [Received(seq, message)])


def test_every_message_has_golden_frames():
    assert {entry["message"] for entry in GOLDEN} == {layout.type.__name__ for layout in LAYOUTS.values()}


def test_the_frames_worked_out_in_the_manual_are_right():
    text = (generate.ROOT / generate.MANUAL).read_text()
    rows = re.findall(r"^\| ([A-Z_]+)((?: \w+=-?\d+)*) \| (\d+) \| `([0-9a-f ]+)` \|$", text, re.MULTILINE)
    assert len(rows) == 5
    for name, assignments, seq, wire in rows:
        layout = next(one for one in LAYOUTS.values() if generate.c_name(one).upper() == f"MSG_{name}")
        values = [pair.split("=") for pair in assignments.split()]
        assert [field.name for field in layout.fields] == [field for field, _ in values]
        message = build(layout, tuple(int(value) for _, value in values))
        assert encode(message, int(seq)).hex(" ") == wire


def test_hello_and_its_request_never_change_their_layout():
    shapes = {
        layout.id: [(field.name, field.wire.name) for field in layout.fields]
        for layout in LAYOUTS.values()
        if layout.type in (protocol.Hello, protocol.HelloRequest)
    }
    version_and_hash = [("protocol_version", "u8"), ("schema_hash", "u32")]
    rest = [("build_id", "u32"), ("reset_cause", "u8"), ("boot_nonce", "u32")]
    assert shapes == {0x01: version_and_hash, 0x81: version_and_hash + rest}


def test_the_schema_hash_covers_messages_enumerations_and_version():
    text = protocol.schema_text()
    assert protocol.crc32c(text.encode()) == protocol.SCHEMA_HASH
    for layout in LAYOUTS.values():
        shape = "".join(f" {field.name}:{field.wire.name}" for field in layout.fields)
        assert f"message {layout.id:#04x} {layout.type.__name__}{shape}\n" in text
    for enumeration in protocol.ENUMERATIONS:
        for member in enumeration:
            assert re.search(rf"enum {enumeration.__name__} .*\b{member.name}={member.value}\b", text)
    assert text.startswith(f"version {protocol.PROTOCOL_VERSION}\n")
