"""robot.toml and the command line: what is written is read back, and what cannot be followed is named."""

from __future__ import annotations

import dataclasses
import math
import typing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from host.config import SECTIONS, Config, config_text, read_command_line, read_config
from host.errors import UsageError
from host.nav.config import NavConfig
from host.rbdn.config import NetConfig

ROOT = Path(__file__).parent.parent
EVERY_KEY = [(section, f.name) for section, kind in SECTIONS.items() for f in dataclasses.fields(kind)]


@dataclass(frozen=True)
class SomeOptions:
    """Options of a command that only tests have."""

    name: str  # something needed
    count: int = 3  # something with a default


def test_robot_toml_in_the_checkout_is_up_to_date():
    assert (ROOT / "robot.toml").read_text() == config_text(Config()), (
        "settings changed: run 'rm robot.toml; python -m host.config > robot.toml'"
    )


@pytest.mark.parametrize(("section", "key"), EVERY_KEY)
def test_every_setting_is_explained_in_the_file(section: str, key: str):
    lines = config_text(Config()).split(f"[{section}]\n")[1].split("\n[")[0].splitlines()
    (at,) = (k for k, line in enumerate(lines) if line.startswith(f"{key} = "))
    beside = lines[at].partition("# ")[2]
    above = lines[at - 1] if at and lines[at - 1].startswith("# ") else ""
    assert len(f"{above} {beside}".split()) >= 2


def near(value: float | int | str, kind: Any) -> st.SearchStrategy:
    """Values close enough to a default to stay in its range."""
    if typing.get_origin(kind) is typing.Literal:
        return st.sampled_from(typing.get_args(kind))
    if isinstance(value, bool):
        return st.booleans()
    if isinstance(value, int):
        return st.integers(value, value + 3)
    return st.floats(0.95, 1.0).map(lambda share: share * value)


@given(st.data())
@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_settings_written_are_read_back(tmp_path: Path, data):
    sections = {}
    for section, kind in SECTIONS.items():
        default = getattr(Config(), section)
        types = typing.get_type_hints(kind)
        values = {key: data.draw(near(getattr(default, key), types[key])) for key in types}
        sections[section] = kind(**values)
    config = Config(**sections)
    (tmp_path / "robot.toml").write_text(config_text(config))
    assert read_config(tmp_path / "robot.toml") == config


def test_what_a_file_does_not_mention_keeps_its_default(tmp_path: Path):
    file = tmp_path / "robot.toml"
    file.write_text("[nav]\nspeed_cm_s = 30\n")
    config = read_config(file)
    assert config == Config(nav=NavConfig(speed_cm_s=30.0))
    assert isinstance(config.nav.speed_cm_s, float)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[net\n", ["not valid TOML", "line 1"]),
        ("[net]\nsquare_px = \n", ["not valid TOML", "line 2"]),
        ("[net]\nsquare_px = 8\nsquare_px = 9\n", ["not valid TOML", "line 3"]),
        ("[nett]\nsquare_px = 8\n", ["unknown section [nett]", "did you mean net?"]),
        ("[camera_of_mine]\n", ["unknown section [camera_of_mine]", "net, depth"]),
        ("square_px = 8\n", ["unknown key square_px outside any section"]),
        ("net = 8\n", ["net must be a section"]),
        ("[net]\nsquare_pix = 8\n", ["unknown key net.square_pix", "did you mean square_px?"]),
        ("[net]\nzzz = 8\n", ["unknown key net.zzz", "square_px, "]),
        ("[net.square_px]\na = 1\n", ["net.square_px", "whole number"]),
        ("[net]\nsquare_px = 8.0\n", ["net.square_px = 8.0", "whole number"]),
        ('[net]\nmode = "papre"\n', ["net.mode = 'papre'", "one of 'ours', 'paper'"]),
        ("[net]\nsquare_px = true\n", ["net.square_px = True", "whole number"]),
        ('[net]\nmerge_distance = "8"\n', ["net.merge_distance = '8'", "number"]),
        ("[net]\nmerge_distance = [8]\n", ["net.merge_distance = [8]", "number"]),
        ("[net]\nmerge_distance = nan\n", ["net.merge_distance = nan", "finite"]),
        ("[nav]\nspeed_cm_s = inf\n", ["nav.speed_cm_s = inf", "finite"]),
        ("[net]\nsquare_px = -3\n", ["section [net]", "square_px = -3", "4 to 200"]),
    ],
)
def test_a_file_that_cannot_be_followed_is_named_with_its_key(tmp_path: Path, text: str, words: list[str]):
    file = tmp_path / "mine.toml"
    file.write_text(text)
    with pytest.raises(UsageError) as error:
        read_config(file)
    for word in ["mine.toml", *words]:
        assert word in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("content", [b"\xff\xfe[net]", b"\x00"])
def test_a_file_that_is_no_text_is_refused(tmp_path: Path, content: bytes):
    (tmp_path / "a.toml").write_bytes(content)
    with pytest.raises(UsageError, match=r"a\.toml"):
        read_config(tmp_path / "a.toml")


@given(st.sampled_from(EVERY_KEY), st.sampled_from(["", "_", "x"]), st.integers(0, 30))
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_misspelt_key_is_answered_with_the_right_one(tmp_path: Path, where, junk: str, place: int):
    section, key = where
    misspelt = key[: place % len(key)] + junk + key[place % len(key) + 1 :]
    if misspelt in typing.get_type_hints(SECTIONS[section]) or not misspelt:
        return
    (tmp_path / "robot.toml").write_text(f"[{section}]\n{misspelt} = 1\n")
    with pytest.raises(UsageError, match=r"did you mean \w+\?") as error:
        read_config(tmp_path / "robot.toml")
    assert f"unknown key {section}.{misspelt};" in str(error.value)


def test_the_command_line_wins_over_the_file_and_the_file_over_defaults(tmp_path: Path):
    file = tmp_path / "mine.toml"
    file.write_text("[nav]\nspeed_cm_s = 30.0\nclearance_cm = 5.0\n[net]\nsquare_px = 20\n")
    options, config = read_command_line(
        SomeOptions, ["--name", "a", "--config", str(file), "--nav.speed-cm-s", "25"]
    )
    assert options == SomeOptions("a", 3)
    expected = Config(nav=NavConfig(speed_cm_s=25.0, clearance_cm=5.0), net=NetConfig(square_px=20))
    assert config == expected
    assert read_command_line(SomeOptions, ["--name=a", f"--config={file}"])[1].nav.speed_cm_s == 30.0


def test_robot_toml_of_the_working_directory_is_used(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert read_command_line(SomeOptions, ["--name", "a"])[1] == Config()
    (tmp_path / "robot.toml").write_text("[net]\nsquare_px = 20\n")
    assert read_command_line(SomeOptions, ["--name", "a"])[1] == Config(net=NetConfig(square_px=20))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], ["--name"]),
        (["--name", "a", "--count", "many"], ["--count", "many"]),
        (["--name", "a", "--cont", "3"], ["--cont", "did you mean --count?"]),
        (["--name", "a", "--nav.sped-cm-s", "3"], ["did you mean --nav.speed-cm-s?"]),
        (["--name", "a", "--depth.min-step-cm", "inf"], ["--depth.min-step-cm", "inf", "finite"]),
        (["--name", "a", "--net.square-px", "-3"], ["square_px = -3"]),
        (["--name", "a", "--config"], ["--config"]),
        (["--name", "a", "--config", "none.toml"], ["none.toml", "no such"]),
        (["--name", "a", "stray\nline"], ["stray line"]),
    ],
)
def test_a_command_line_that_cannot_be_followed_is_answered_in_one_line(arguments, words):
    with pytest.raises(UsageError) as error:
        read_command_line(SomeOptions, arguments)
    for word in words:
        assert word in str(error.value)
    assert "\n" not in str(error.value)


@given(st.lists(st.text(max_size=8), max_size=4))
@settings(max_examples=15, deadline=None)
def test_no_command_line_brings_more_than_a_usage_error(arguments):
    try:
        options, config = read_command_line(SomeOptions, ["--name", "a", *arguments])
    except UsageError as error:
        assert len(str(error).splitlines()) == 1
    except SystemExit as stop:
        assert not stop.code and {"-h", "--help"} & set(arguments)
    else:
        assert math.isfinite(config.nav.speed_cm_s)
        assert isinstance(options, SomeOptions)
