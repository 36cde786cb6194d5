"""robot.toml and the command line: what is written is read back, and what cannot be followed is named."""

from __future__ import annotations

import dataclasses
import math
import re
import typing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from host.config import (
    SECTIONS,
    Config,
    config_text,
    read_command_line,
    read_config,
)
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


def range_of(section: str, key: str) -> tuple[float, float] | None:
    """As the refusal of a value far beyond tells it; None for what is no number."""
    default = getattr(Config(), section)
    value = getattr(default, key)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    far = 10**12 if isinstance(value, int) else 1e12
    with pytest.raises(ValueError) as error:
        dataclasses.replace(default, **{key: far})
    told = re.fullmatch(rf"{key} = \S+ is outside (\S+) to (\S+)", str(error.value))
    assert told, f"{section}.{key}: {error.value!r} does not name key, value and range"
    return float(told[1]), float(told[2])


RANGES = {(section, key): range_of(section, key) for section, key in EVERY_KEY}


@pytest.mark.parametrize(("section", "key"), [where for where, limits in RANGES.items() if limits])
def test_every_number_is_held_to_a_range_that_holds_its_default(section: str, key: str):
    default = getattr(Config(), section)
    low, high = RANGES[section, key] or (0, 0)
    kind = type(getattr(default, key))
    assert low <= getattr(default, key) <= high
    for wrong in (low - 1, high + 1, *((math.nan, math.inf, -math.inf) if kind is float else ())):
        with pytest.raises(ValueError, match=rf"^{key} = "):
            dataclasses.replace(default, **{key: kind(wrong)})
    for end in (low, high):
        try:
            dataclasses.replace(default, **{key: kind(end)})
        except ValueError as error:  # two settings that do not go together
            assert "is outside" not in str(error) and key in str(error)


def anything(section: str, key: str, kind: Any) -> st.SearchStrategy:
    """All that a setting may be."""
    if typing.get_origin(kind) is typing.Literal:
        return st.sampled_from(typing.get_args(kind))
    limits = RANGES[section, key]
    if limits is None:
        return st.booleans() if kind is bool else st.text(max_size=20)
    low, high = limits
    return st.integers(round(low), round(high)) if kind is int else st.floats(low, high)


@st.composite
def any_settings(draw: st.DrawFn) -> Config:
    """Every setting drawn from its whole range; a section that does not go together keeps its defaults."""
    sections = {}
    for section, kind in SECTIONS.items():
        types = typing.get_type_hints(kind)
        values = {key: draw(anything(section, key, types[key])) for key in types}
        try:
            sections[section] = kind(**values)
        except ValueError as error:
            assert "is outside" not in str(error)
            sections[section] = kind()
    return Config(**sections)


@given(any_settings())
@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_settings_written_are_read_back(tmp_path: Path, config: Config):
    (tmp_path / "robot.toml").write_text(config_text(config))
    assert read_config(tmp_path / "robot.toml") == config


@pytest.mark.parametrize(("section", "key"), EVERY_KEY)
def test_every_setting_is_written_and_read_by_itself(tmp_path: Path, section: str, key: str):
    default, limits = Config(), RANGES[section, key]
    part = getattr(default, section)
    value = getattr(part, key)
    if limits is None:
        kind = typing.get_type_hints(type(part))[key]
        others = typing.get_args(kind) or ((not value,) if kind is bool else (f"{value}x",))
        other = next(one for one in others if one != value)
    else:
        step = 1 if isinstance(value, int) else 0.01 * value or 0.01
        other = value - step if value - step >= limits[0] else value + step
    try:
        config = dataclasses.replace(default, **{section: dataclasses.replace(part, **{key: other})})
    except ValueError:  # a text of which only few are allowed
        assert isinstance(value, str)
        return
    (tmp_path / "robot.toml").write_text(config_text(config))
    assert read_config(tmp_path / "robot.toml") == config != default


def test_dump_config_prints_the_settings_in_force_and_no_more_is_done(tmp_path: Path, capsys):
    (tmp_path / "mine.toml").write_text("[nav]\nspeed_cm_s = 30.0\n")
    arguments = ["--config", str(tmp_path / "mine.toml"), "--net.square-px", "20", "--net.mode", "paper"]
    with pytest.raises(SystemExit) as stop:
        read_command_line(SomeOptions, ["--name", "a", "--dump-config", *arguments])
    assert not stop.value.code
    (tmp_path / "dumped.toml").write_text(capsys.readouterr().out)
    _, config = read_command_line(SomeOptions, ["--name", "a", *arguments])
    assert read_config(tmp_path / "dumped.toml") == config
    expected = Config(nav=NavConfig(speed_cm_s=30.0), net=NetConfig(square_px=20, mode="paper"))
    assert config == expected


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
        ("[nett]\nsquare_px = 8\n", ["line 1: unknown section [nett]", "did you mean net?"]),
        ("[camera_of_mine]\n", ["unknown section [camera_of_mine]", "net, depth"]),
        ("square_px = 8\n", ["line 1: unknown key square_px outside any section"]),
        ("net = 8\n", ["net must be a section"]),
        ("[net]\nsquare_pix = 8\n", ["line 2: unknown key net.square_pix", "did you mean square_px?"]),
        ("[net]\nzzz = 8\n", ["unknown key net.zzz", "square_px, "]),
        ("[net.square_px]\na = 1\n", ["net.square_px", "whole number"]),
        ("[net]\nsquare_px = 8.0\n", ["net.square_px = 8.0", "whole number"]),
        ('[net]\nmode = "papre"\n', ["net.mode = 'papre'", "one of 'ours', 'paper'"]),
        ("[net]\nsquare_px = true\n", ["net.square_px = True", "whole number"]),
        ('[net]\nmerge_distance = "8"\n', ["net.merge_distance = '8'", "number"]),
        ("[net]\nmerge_distance = [8]\n", ["net.merge_distance = [8]", "number"]),
        ("[net]\nmerge_distance = nan\n", ["net.merge_distance = nan", "finite"]),
        ("[nav]\nspeed_cm_s = inf\n", ["nav.speed_cm_s = inf", "finite"]),
        ("[net]\nsquare_px = -3\n", ["line 2: net.square_px = -3", "4 to 200"]),
        ("# mine\n[nav]\n\ncreep_cm_s = 90\n", ["line 4: nav.creep_cm_s = 90.0 is over speed_cm_s = 20.0"]),
        ("[net]\nmerge_distance = 1" + 400 * "0" + "\n", ["line 2: net.merge_distance = 1000", "finite"]),
        ("[net]\nsquare_px = 1" + 5000 * "0" + "\n", ["no robot has such settings"]),
        ("a = " + 3000 * "[", ["no robot has such settings"]),
        ("a = " + 3000 * "[" + 3000 * "]" + "\n", ["no robot has such settings"]),
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


def test_of_several_files_the_last_counts_and_a_mark_before_the_first_letter_does_not(tmp_path: Path):
    one, other = tmp_path / "one.toml", tmp_path / "other.toml"
    one.write_text("[nav]\nspeed_cm_s = 11\n")
    other.write_text("\ufeff[nav]\nspeed_cm_s = 13\n", encoding="utf-8")
    _, config = read_command_line(SomeOptions, ["--name=a", "--config", str(one), f"--config={other}"])
    assert config.nav.speed_cm_s == 13.0


def test_robot_toml_of_the_working_directory_is_used(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert read_command_line(SomeOptions, ["--name", "a"])[1] == Config()
    (tmp_path / "robot.toml").write_text("[net]\nsquare_px = 20\n")
    assert read_command_line(SomeOptions, ["--name", "a"])[1] == Config(net=NetConfig(square_px=20))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], ["--name is missing; see --help"]),
        (["--name"], ["--name needs a value; see --help"]),
        (["--name", "a", "--count", "many"], ["--count: 'many' is not a whole number; see --help"]),
        (["--name", "a", "--nav.speed-cm-s", "fast"], ["--nav.speed-cm-s: 'fast' is not a number"]),
        (["--name", "a", "--net.mode", "papre"], ["--net.mode: 'papre' is not one of 'ours', 'paper'"]),
        (["--name", "a", "--cont", "3"], ["--cont", "did you mean --count?"]),
        (["--name", "a", "--nav.sped-cm-s", "3"], ["did you mean --nav.speed-cm-s?"]),
        (["--name", "a", "--depth.min-step-cm", "inf"], ["depth.min_step_cm = inf", "0.001 to 100"]),
        (["--name", "a", "--net.square-px", "-3"], ["net.square_px = -3 is outside 4 to 200"]),
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
@settings(max_examples=8, deadline=None)
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
