"""What a stranger sees who did not set up, or who changes their mind at once."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from host.errors import UsageError, run_command

ROOT = Path(__file__).resolve().parents[1]
COMMANDS = [["host/nav_loop.py"], ["-m", "host.measure", "nowhere"]]


@pytest.mark.parametrize("command", COMMANDS)
def test_without_the_packages_one_line_says_how_to_get_them(command):
    # -S leaves out site-packages, as on a machine where nothing was set up
    run = subprocess.run([sys.executable, "-S", *command], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1 and "make setup" in run.stderr


def test_every_native_module_that_was_not_built_is_named():
    # as if the interpreter found all that it needs, but none of what CMake builds
    built = re.findall(r"^native_module\((\w+) (\S+)", (ROOT / "CMakeLists.txt").read_text(), re.MULTILINE)
    names = [f"{folder.replace('/', '.')}.{module}" for module, folder in built]
    program = (
        "from host import errors\n"
        "find = errors.find_spec\n"
        f"errors.find_spec = lambda name: None if name in {names} else find(name)\n"
        "errors.begin_command()\n"
    )
    run = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 2 and len(names) == 5
    assert run.stderr.startswith("error: ") and run.stderr.count("\n") == 1
    assert set(names) == set(run.stderr.removeprefix("error: ").split(" not found")[0].split(", "))


IMPORTS = ["import no_such_library", "from math import no_such_name"]


@pytest.mark.parametrize("command", [*IMPORTS, *(f"run_command(lambda: exec({one!r}))" for one in IMPORTS)])
def test_what_does_not_load_is_told_in_one_line_with_who_can_tell_more(command):
    program = f"from host.errors import *\nbegin_command()\n{command}"
    run = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 2
    assert run.stderr.startswith("error: ") and run.stderr.count("\n") == 1
    assert "no_such" in run.stderr and "make setup" in run.stderr and "host.doctor" in run.stderr


def test_an_error_about_a_name_with_a_line_feed_is_one_line_too_and_nothing_a_terminal_obeys(capfd):
    def refuse() -> None:
        raise UsageError("a\nb\x1b[2J: no such file")

    with pytest.raises(SystemExit) as stop:
        run_command(refuse)
    assert stop.value.code == 2 and capfd.readouterr().err == "error: a b [2J: no such file\n"


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (OSError(36, "File name too long", "xxx"), "error: xxx: File name too long; choose another place\n"),
        (OSError(28, "No space left on device"), "error: No space left on device; choose another place\n"),
    ],
)
def test_what_the_system_refuses_where_nobody_foresaw_it_is_one_line_too(error, told, capfd):
    def refuse() -> None:
        raise error

    with pytest.raises(SystemExit) as stop:
        run_command(refuse)
    assert stop.value.code == 3 and capfd.readouterr().err == told


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("wait_s", [0.1, 0.3])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_during_the_start_ends_it_in_one_line(command, wait_s, number):
    # A shell starts what runs behind with SIGINT ignored, and a child would inherit that from this process.
    heeding = signal.signal(signal.SIGINT, signal.default_int_handler)
    process = subprocess.Popen([sys.executable, *command], cwd=ROOT, stderr=subprocess.PIPE, text=True)
    signal.signal(signal.SIGINT, heeding)
    time.sleep(wait_s)
    if process.poll() is None:
        process.send_signal(number)
    _, stderr = process.communicate(timeout=60)
    assert "Traceback" not in stderr
    # Before Python itself has come up, the system's own answer stands.
    assert process.returncode in (130, -number) or (process.returncode == 3 and "nowhere" in stderr)
