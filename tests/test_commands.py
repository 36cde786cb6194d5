"""Every command, given nonsense: one line that tells what is wrong, the right exit code, and nothing done."""

from __future__ import annotations

import re
import runpy
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from bench.help_time import commands
from host.errors import ENDINGS, EXIT_DEVICE, EXIT_INPUT, EXIT_USAGE

ROOT = Path(__file__).resolve().parent.parent
COMMANDS = commands(ROOT)
# What commands must be given, such that it is not to blame.
GIVEN = {
    "bench.stills": ["."],
    "host.compare": ["a", "b"],
    "host.link.bench replay": ["capture.txt"],
    "host.link.bench report": ["a.json"],
    "host.measure": ["run"],
    "host.record.export": ["run.mcap", "out"],
    "host.replay": ["run.mcap"],
    "host.sim.export": ["out"],
    "host.view.animate": ["run.mcap"],
    "host.view.rerun": ["run.mcap"],
}


# A module that is run as a program and was imported before: what these tests are about.
pytestmark = pytest.mark.filterwarnings("ignore:.* found in sys.modules:RuntimeWarning")


@pytest.fixture(autouse=True)
def as_it_was() -> Iterator[None]:
    """What a command changes in its process is put back."""
    kept = {number: signal.getsignal(number) for number in ENDINGS}
    path = list(sys.path)
    yield
    for number, handler in kept.items():
        signal.signal(number, handler)
    sys.path[:] = path


def run(command: str, *arguments: str) -> int:
    """The command as Python would run it, but in this process, where all is imported; its exit code."""
    module, *before = command.split()
    given, sys.argv = sys.argv, [module, *before, *arguments]
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else 0
    finally:
        sys.argv = given
    return 0


def complaint(capfd) -> str:
    """The one line on stderr; nothing is on stdout."""
    out, err = capfd.readouterr()
    assert out == "", out
    assert re.fullmatch(r"error: .+\n", err), err
    return err


def test_all_commands_are_known():
    assert {"host.nav_loop", "host.measure", "host.doctor", "host.calibrate wheels", "bench.net"} <= set(
        COMMANDS
    )
    assert len(COMMANDS) >= 30


@pytest.mark.parametrize("command", COMMANDS)
def test_an_option_that_there_is_not_gets_one_line(command, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    assert run(command, *GIVEN.get(command, []), "--nonsense=3") == EXIT_USAGE
    said = complaint(capfd)
    assert "nonsense" in said or "missing; see --help" in said  # the latter where more must be given
    assert not list(tmp_path.iterdir())


def takes(command: str, option: str) -> bool:
    """By its source, which is quicker than by its help."""
    module, *sub = command.split()
    base = ROOT / Path(*module.split("."))
    path = (
        base / f"{sub[0]}.py" if sub else base / "__main__.py" if base.is_dir() else base.with_suffix(".py")
    )
    return path.exists() and f"\n    {option}: Path | None = None" in path.read_text(encoding="utf-8")


@pytest.mark.parametrize("command", [c for c in COMMANDS if takes(c, "json")])
def test_a_folder_in_the_place_of_the_json_file_is_told_before_any_work(
    command, tmp_path, monkeypatch, capfd
):
    monkeypatch.chdir(tmp_path)
    code = run(command, *GIVEN.get(command, []), "--json", ".")
    said = complaint(capfd)
    assert code in (EXIT_USAGE, EXIT_INPUT)
    assert "is a folder" in said or code == EXIT_INPUT  # where what it works on is looked at first
    assert not list(tmp_path.iterdir())


MISSING = [
    ("host.measure nowhere", EXIT_INPUT, "nowhere"),
    ("host.measure file.txt", EXIT_INPUT, "file.txt"),
    ("host.measure --still nowhere.png", EXIT_INPUT, "nowhere.png"),
    ("host.measure --still file.txt", EXIT_INPUT, "file.txt"),
    ("host.measure --still .", EXIT_INPUT, "."),
    ("host.replay nowhere.mcap", EXIT_INPUT, "nowhere.mcap"),
    ("host.replay file.txt", EXIT_INPUT, "file.txt"),
    ("host.replay .", EXIT_INPUT, "."),
    ("host.compare nowhere folder", EXIT_INPUT, "nowhere"),
    ("host.compare file.txt folder", EXIT_INPUT, "file.txt"),
    ("host.record.export nowhere.mcap out", EXIT_INPUT, "nowhere.mcap"),
    ("host.record.export file.txt out", EXIT_INPUT, "file.txt"),
    ("host.view.animate nowhere.mcap", EXIT_INPUT, "nowhere.mcap"),
    ("host.view.animate file.txt", EXIT_INPUT, "file.txt"),
    ("host.view.rerun nowhere.mcap", EXIT_INPUT, "nowhere.mcap"),
    ("host.view.rerun file.txt", EXIT_INPUT, "file.txt"),
    ("host.view.rerun .", EXIT_INPUT, "."),
    ("host.sim.export file.txt", EXIT_USAGE, "file.txt"),
    ("host.sim.export out --camera sim:nowhere", EXIT_USAGE, "sim:nowhere"),
    ("host.sim.serve nowhere", EXIT_USAGE, "nowhere"),
    ("host.sim.serve sim: --world sim:nowhere", EXIT_USAGE, "sim:nowhere"),
    ("host.sim.serve sim: --eeprom folder", EXIT_USAGE, "folder"),
    ("host.sim.serve sim: --link file.txt/port", EXIT_USAGE, "file.txt"),
    ("host.experiments --out file.txt", EXIT_USAGE, "file.txt"),
    ("host.calibrate nonsense", EXIT_USAGE, "nonsense"),
    ("host.calibrate wheels --robot nowhere", EXIT_DEVICE, "nowhere"),
    ("host.calibrate camera --camera nowhere", EXIT_INPUT, "nowhere"),
    ("host.calibrate target --out folder", EXIT_USAGE, "folder"),
    ("host.link.bench nonsense", EXIT_USAGE, "nonsense"),
    ("host.link.bench echo --robot nowhere", EXIT_DEVICE, "nowhere"),
    ("host.link.bench echo --robot folder", EXIT_DEVICE, "folder"),
    ("host.link.bench monitor --robot nowhere", EXIT_DEVICE, "nowhere"),
    ("host.link.bench soak --capture folder", EXIT_USAGE, "folder"),
    ("host.link.bench cut --html folder", EXIT_USAGE, "folder"),
    ("host.link.bench replay nowhere", EXIT_INPUT, "nowhere"),
    ("host.link.bench replay folder", EXIT_INPUT, "folder"),
    ("host.link.bench replay image.bin", EXIT_INPUT, "image.bin"),
    ("host.link.bench report nowhere --html out.html", EXIT_INPUT, "nowhere"),
    ("host.link.bench report file.txt --html out.html", EXIT_INPUT, "file.txt"),
    ("host.view.method_pictures file.txt", EXIT_USAGE, "file.txt"),
    ("host.nav_loop --camera nowhere --robot nowhere", EXIT_INPUT, "nowhere"),
    ("host.nav_loop --camera image.bin --robot nowhere", EXIT_INPUT, "image.bin"),
    ("host.nav_loop --camera folder --robot nowhere", EXIT_INPUT, "folder"),
    ("host.nav_loop --record folder", EXIT_USAGE, "folder"),
    ("host.nav_loop --record new --json new", EXIT_USAGE, "new: is given for something else too"),
    ("host.nav_loop --lens file.txt --json file.txt", EXIT_USAGE, "file.txt: is given for something else"),
    ("host.replay file.txt --json file.txt", EXIT_USAGE, "file.txt: is given for something else too"),
    ("host.replay image.bin --config file.txt --json file.txt", EXIT_USAGE, "file.txt: is given for"),
    ("host.doctor --lens file.txt --json file.txt", EXIT_USAGE, "file.txt: is given for something else"),
    ("host.nav_loop --config folder", EXIT_USAGE, "folder"),
    ("host.nav_loop --config image.bin", EXIT_USAGE, "image.bin"),
    ("host.nav_loop --camera /dev/null --robot nowhere", EXIT_DEVICE, "/dev/null"),
    ("bench.stills nowhere", EXIT_INPUT, "nowhere"),
    ("bench.tracking nowhere", EXIT_INPUT, "nowhere"),
]


@pytest.mark.parametrize(("line", "code", "word"), MISSING)
def test_what_is_missing_or_of_another_kind_is_told_with_its_name(
    line, code, word, tmp_path, monkeypatch, capfd
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file.txt").write_text("nothing of use\n")
    (tmp_path / "image.bin").write_bytes(bytes(range(256)) * 8)
    (tmp_path / "folder").mkdir()
    before = sorted(tmp_path.rglob("*"))
    module, *arguments = line.split()
    assert run(module, *arguments) == code
    assert word in complaint(capfd)
    assert sorted(tmp_path.rglob("*")) == before
