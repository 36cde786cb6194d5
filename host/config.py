"""The rooms' settings in one place: from robot.toml, from the command line, and back to text.

Each room keeps its own frozen dataclass, with a comment to every field and every number's range checked by
``host.ranges`` in ``__post_init__`` (ValueError that begins with the key). Adding a field there is all it
takes; ``python -m host.config > robot.toml`` then brings the file up to date.
"""

from __future__ import annotations

import ast
import contextlib
import dataclasses
import difflib
import functools
import inspect
import io
import json
import re
import sys
import tomllib
import typing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from host.camera.config import WebcamConfig
from host.depth.config import DepthConfig
from host.errors import UsageError, run_command
from host.nav.config import BodyConfig, NavConfig
from host.rbdn.config import NetConfig

DEFAULT_FILE = Path("robot.toml")
HEADING = """\
# The robot's settings, with their defaults. Lengths end in _cm or _px, times in _s, angles in _rad.
# Each can also be set for one run: --nav.speed-cm-s 15
"""
Options = TypeVar("Options")


@dataclass(frozen=True)
class Config:
    """Everything that may be set; one field for each section of robot.toml."""

    net: NetConfig = field(default_factory=NetConfig)
    depth: DepthConfig = field(default_factory=DepthConfig)
    body: BodyConfig = field(default_factory=BodyConfig)
    nav: NavConfig = field(default_factory=NavConfig)
    webcam: WebcamConfig = field(default_factory=WebcamConfig)


SECTIONS: dict[str, type] = typing.get_type_hints(Config)


def read_config(path: Path) -> Config:
    """Read a robot.toml. What it does not mention keeps its default.

    Raises
    ------
    UsageError
        naming the file and the line or key that cannot be followed.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")  # some editors begin with a mark
    except FileNotFoundError as error:
        raise UsageError(f"{path}: no such configuration file; check --config") from error
    except OSError as error:
        raise UsageError(f"{path}: cannot be read ({error.strerror}); check --config") from error
    except UnicodeDecodeError as error:
        raise UsageError(f"{path}: is not text; it must be TOML in UTF-8") from error
    return parse_config(text, path)


def parse_config(text: str, path: Path) -> Config:
    """What a robot.toml says; `path` is where it was found, for errors, which are those of `read_config`."""
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path}: not valid TOML: {error}; correct it there") from error
    except (RecursionError, ValueError) as error:  # lists in lists in lists; a number of thousands of digits
        raise UsageError(f"{path}: no robot has such settings; 'python -m host.config' shows some") from error
    for name, table in tables.items():
        if name not in SECTIONS:
            what = f"section [{name}]" if isinstance(table, dict) else f"key {name} outside any section"
            nearest = _nearest(name, SECTIONS, "the sections are")
            raise UsageError(f"{_place(path, text, name)}: unknown {what}; {nearest}")
        if not isinstance(table, dict):
            place = _place(path, text, name)
            raise UsageError(f"{place}: {name} must be a section; write [{name}] and its keys below")
    return Config(**{name: _section(path, text, name, tables[name]) for name in tables})


def config_text(config: Config) -> str:
    """The configuration as commented TOML that `read_config` reads back equal."""
    parts = [HEADING]
    for section, kind in SECTIONS.items():
        parts.append(f"\n# {(inspect.getdoc(kind) or '').splitlines()[0]}\n[{section}]\n")
        for key, (above, comment) in _comments(kind).items():
            parts.extend(f"\n# {line}\n" for line in above)
            value = _toml(getattr(getattr(config, section), key))
            parts.append(f"{key} = {value}  # {comment}\n" if comment else f"{key} = {value}\n")
    return "".join(parts)


def read_command_line(
    kind: type[Options], arguments: list[str] | None = None, subcommand: str = ""
) -> tuple[Options, Config]:
    """Parse a command's own options, and with them any setting as ``--section.key VALUE``.

    Settings come from ``--config FILE``, else from robot.toml in the working directory if there is one,
    else from the defaults; those on the command line win. ``--dump-config`` prints them and ends the command.

    Parameters
    ----------
    kind
        Dataclass of the command's options, each field commented; its docstring introduces ``--help``.
    arguments
        Instead of the process's own.
    subcommand
        Its name, for the usage line.

    Raises
    ------
    UsageError
        in one line, with the nearest name where one is misspelt.
    SystemExit
        after ``--help`` and ``--dump-config``.
    """
    import tyro  # here, so that reading a configuration does not need it

    arguments = sys.argv[1:] if arguments is None else arguments
    path = _config_file(arguments)
    settings = read_config(path) if path is not None else Config()
    file_help = f"settings to use instead of those in {DEFAULT_FILE} in the working directory"
    dump_help = "only print the settings in force, as such a file"
    dump = tyro.conf.arg(help=dump_help)
    parts: list[Any] = [
        *_option_fields(kind),
        ("config", typing.Annotated[Path | None, tyro.conf.arg(metavar="PATH", help=file_help)], None),
        ("dump_config", typing.Annotated[tyro.conf.FlagCreatePairsOff[bool], dump], False),
        *((name, section, field(default=getattr(settings, name))) for name, section in SECTIONS.items()),
    ]
    parsed = _parse(kind, parts, arguments, f"{_program()} {subcommand}".strip())
    config = Config(**{name: getattr(parsed, name) for name in SECTIONS})
    if parsed.dump_config:
        print(config_text(config), end="")
        sys.exit()
    return _options_of(kind, parsed), config


def read_options(kind: type[Options], arguments: list[str] | None = None, subcommand: str = "") -> Options:
    """Parse the options of a command that needs no settings; else as `read_command_line`.

    Parameters
    ----------
    subcommand
        Its name, for the usage line.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    program = f"{_program()} {subcommand}".strip()
    return _options_of(kind, _parse(kind, list(_option_fields(kind)), arguments, program))


def _parse(kind: type, parts: list[Any], arguments: list[str], program: str) -> Any:
    """What tyro makes of the arguments; UsageError in one line instead of its many."""
    import tyro

    command = dataclasses.make_dataclass(kind.__name__, parts, frozen=True)
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return tyro.cli(command, args=arguments, description=inspect.getdoc(kind), prog=program)
    except SystemExit as stop:
        if not stop.code:
            raise
        raise UsageError(_one_line(said.getvalue())) from None


def _options_of(kind: type[Options], parsed: Any) -> Options:
    return kind(**{f.name: getattr(parsed, f.name) for f in dataclasses.fields(kind)})  # type: ignore[arg-type]


def _program() -> str:
    """How the running command was called, for the usage line."""
    module = getattr(sys.modules["__main__"], "__spec__", None)
    return f"python -m {module.name.removesuffix('.__main__')}" if module else Path(sys.argv[0]).name


def _option_fields(kind: type) -> typing.Iterator[tuple[str, Any, Any]]:
    """Name, type with help text, and default of each option, since tyro finds no comments in a made class."""
    import tyro

    types = typing.get_type_hints(kind, include_extras=True)
    comments = _comments(kind)
    for option in dataclasses.fields(kind):
        metavar = "PATH" if types[option.name] == Path | None else None
        typed = typing.Annotated[
            types[option.name], tyro.conf.arg(help=comments[option.name][1], metavar=metavar)
        ]
        yield option.name, typed, field(default=option.default, default_factory=option.default_factory)


def _config_file(arguments: list[str]) -> Path | None:
    """The file named by --config, which must be known before the other settings are parsed over it."""
    named = DEFAULT_FILE if DEFAULT_FILE.is_file() else None
    for k, argument in enumerate(arguments):  # the last one counts, as of every option
        if argument == "--config" and k + 1 < len(arguments):
            named = Path(arguments[k + 1])
        elif argument.startswith("--config="):
            named = Path(argument.removeprefix("--config="))
    return named


def _section(path: Path, text: str, section: str, table: dict[str, Any]) -> Any:
    kind = SECTIONS[section]
    types = typing.get_type_hints(kind)
    for key, value in table.items():
        place = _place(path, text, section, key)
        if key not in types:
            nearest = _nearest(key, types, f"the keys of [{section}] are")
            raise UsageError(f"{place}: unknown key {section}.{key}; {nearest}")
        if not _fits(value, types[key]):
            raise UsageError(
                f"{place}: {section}.{key} = {_brief(value)} is not {_kind_name(types[key])}; correct it"
            )
    values = {key: types[key](value) if types[key] in (int, float) else value for key, value in table.items()}
    try:
        return kind(**values)
    except ValueError as error:
        place = _place(path, text, section, str(error).split()[0])
        raise UsageError(f"{place}: {section}.{error}; correct it") from error


def _place(path: Path, text: str, section: str, key: str | None = None) -> str:
    """The file, and the line in it where a section, or a key of one, is written; if it is found."""
    inside: str | None = None
    for number, line in enumerate(text.splitlines(), 1):
        head = re.match(r"""\s*\[+\s*["']?([\w-]+)""", line)
        name = re.match(r"""\s*["']?([\w-]+)["']?\s*[=.]""", line)
        inside = head[1] if head else inside
        written = (inside, name[1]) if name else (inside, None) if head else None
        if written == (section, key) or (key is None and written == (None, section)):
            return f"{path}: line {number}"
    return str(path)


def _fits(value: Any, kind: Any) -> bool:
    if kind is float:
        return (
            isinstance(value, int | float)
            and not isinstance(value, bool)
            and abs(value) <= sys.float_info.max
        )
    if kind is int:
        return isinstance(value, int) and not isinstance(value, bool)
    if typing.get_origin(kind) is typing.Literal:
        return value in typing.get_args(kind)
    return isinstance(value, kind)


def _kind_name(kind: Any) -> str:
    if typing.get_origin(kind) is typing.Literal:
        return "one of " + ", ".join(map(repr, typing.get_args(kind)))
    names = {int: "a whole number", float: "a finite number", bool: "true or false", str: "a text in quotes"}
    return names[kind]


def _nearest(name: str, known: typing.Iterable[str], otherwise: str) -> str:
    close = difflib.get_close_matches(name, list(known), n=1)
    return f"did you mean {close[0]}?" if close else f"{otherwise} {', '.join(known)}"


def _brief(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 40 else text[:37] + "..."


def _toml(value: Any) -> str:
    return json.dumps(value) if isinstance(value, bool | str) else repr(value)


@functools.cache
def _comments(kind: type) -> dict[str, tuple[list[str], str]]:
    """For each field the comment lines above it and the one beside it (or the docstring below it)."""
    source = inspect.getsource(kind)
    lines = source.splitlines()
    (body,) = (node.body for node in ast.parse(source).body if isinstance(node, ast.ClassDef))
    out = {}
    for node, after in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.AnnAssign) or not isinstance(node.target, ast.Name):
            continue
        above = []
        for line in reversed(lines[: node.lineno - 1]):
            if not line.strip().startswith("#"):
                break
            above.insert(0, line.strip().lstrip("# "))
        beside = lines[(node.end_lineno or node.lineno) - 1][node.end_col_offset or 0 :].strip().lstrip("# ")
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            beside = " ".join(str(after.value.value).split())
        out[node.target.id] = (above, beside)
    return out


# What tyro says of what it is given -> in our words.
SAID = (
    (r"Missing value for argument '(--.*?)'.*", r"\1 needs a value"),
    (r"Missing value for argument '(.*?)'.*", r"\1 is missing"),
    (r"invalid choice (.*) for argument '(.*?)'. Expected one of \((.*?),?\)", r"\2: \1 is not one of \3"),
    (r"(.*)invalid literal for int\(\) with base 10: (.*)", r"\1\2 is not a whole number"),
    (r"(.*)could not convert string to float: (.*)", r"\1\2 is not a number"),
)


def _one_line(box: str) -> str:
    """What tyro says in a frame of several lines, as one."""
    text = " ".join(re.sub(r"[╭╮╰╯│─]", " ", "\n".join(box.splitlines()[1:])).split())
    text = re.split(r" For full helptext| Argument helptext", text)[0]
    problem, _, suggestions = text.partition(" Perhaps you meant:")
    problem = problem.removeprefix("Error parsing ").removesuffix(".").strip()
    section, colon, setting = problem.partition(": ")
    if colon and section in SECTIONS:
        problem = f"{section}.{setting}"  # said by the section's own check, beginning with the key
    if problem.startswith("Missing from "):
        needed = [one.split()[0] for one in problem.partition(": ")[2].split("(required)") if one.strip()]
        problem = f"{' and '.join(needed)} {'is' if len(needed) == 1 else 'are'} missing"
    for theirs, ours in SAID:
        problem = re.sub(rf"^{theirs}$", ours, problem)
    nearest = re.findall(r"--[\w.-]+", suggestions)
    remedy = f"did you mean {nearest[0]}?" if nearest else "see --help"
    return f"{problem}; {remedy}" if problem else "the command line makes no sense; see --help"


@dataclass(frozen=True)
class DumpOptions:
    """Print the settings in force as a commented robot.toml."""


def _print_settings() -> None:
    _, config = read_command_line(DumpOptions)
    print(config_text(config), end="")


if __name__ == "__main__":
    run_command(_print_settings)
