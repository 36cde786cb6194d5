"""An installation with each of its faults: what the doctor says, and the remedy."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from host.doctor.finding import EXIT_CODES, Finding, Outcome, Part, exit_code, split_error
from host.doctor.installation import (
    ROOT,
    check_checkout,
    check_folder,
    check_installation,
    check_libraries,
    check_native,
    check_python,
    check_room,
    declared,
    native_modules,
)
from host.errors import DeviceError


def one(findings) -> Finding:
    (finding,) = findings
    return finding


def test_this_very_installation_is_whole(tmp_path: Path):
    found = list(check_installation(tmp_path))
    old = [f for f in found if f.name == "native modules" and "older" in f.told]  # while being worked on
    assert {f.outcome for f in found if f not in old} == {Outcome.OK}
    assert {f.name for f in found} == {"Python", "libraries", "native modules", "checkout", "results", "disk"}


@pytest.mark.parametrize(
    ("version", "outcome"),
    [((3, 10, 12), "FAIL"), ((3, 11, 0), "ok"), ((3, 13, 1), "ok"), ((4, 0, 0), "FAIL")],
)
def test_a_python_that_does_not_fit_is_told_with_what_would(version, outcome):
    found = check_python(version, ">=3.11,<4")
    assert found.outcome == outcome
    if outcome == "FAIL":
        assert ">=3.11" in found.told and "PYTHON=" in found.fix


def test_what_is_asked_for_is_what_pyproject_asks_for():
    requirements, python = declared(ROOT)
    assert any(one.startswith("opencv-python-headless>=4.10") for one in requirements)
    assert python == ">=3.11"
    installed, _ = declared(Path("/nowhere"))  # as from a wheel
    assert {r.split(">")[0].split("<")[0] for r in installed} <= {r.split(">")[0] for r in requirements}


HAVE = {"numpy": "2.1.0", "opencv-python-headless": "4.10.0.84", "rich": "13.0"}
WANT = ["numpy>=1.26", "opencv-python-headless>=4.10,<6", "rich>=13"]


@pytest.mark.parametrize(
    ("change", "outcome", "words"),
    [
        ({}, "ok", ["numpy 2.1.0"]),
        ({"numpy": None}, "FAIL", ["numpy not there"]),
        ({"numpy": "1.25.2"}, "FAIL", ["numpy 1.25.2, >=1.26 is needed"]),
        ({"numpy": "1.26"}, "ok", []),
        ({"numpy": "1.100.0rc1"}, "ok", []),
        ({"opencv-python-headless": "6.0.0.1"}, "FAIL", ["6.0.0.1, >=4.10,<6"]),
        ({"opencv-python-headless": "4.9.0.80"}, "FAIL", ["4.9.0.80"]),
        ({"opencv-python-headless": None, "opencv-python": "4.12.0.88"}, "ok", ["opencv-python 4.12"]),
        ({"rich": "12.6"}, "FAIL", ["rich 12.6"]),
    ],
)
def test_libraries_missing_or_of_another_version_are_named(change, outcome, words):
    found = one(check_libraries(WANT, (HAVE | change).get))
    assert found.outcome == outcome
    for word in words:
        assert word in found.told
    assert outcome == "ok" or found.fix == "run 'make setup'"


def test_two_opencvs_that_overwrite_each_other_are_noticed():
    found = list(check_libraries(WANT, (HAVE | {"opencv-contrib-python": "4.11.0.86"}).get))
    assert found[0].outcome == Outcome.WARN
    assert "overwrite each other" in found[0].told and "pip uninstall" in found[0].fix


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """One native module with its source, older than the module."""
    (tmp_path / "CMakeLists.txt").write_text("native_module(_one host/a host/a/core/*.cpp)\n")
    (tmp_path / "host/a/core").mkdir(parents=True)
    for k, name in enumerate(("host/a/core/one.cpp", "host/a/core/one.hpp", "_one.so")):
        (tmp_path / name).write_text("")
        os.utime(tmp_path / name, (1000 + k, 1000 + k))
    return tmp_path


def loaded(checkout: Path):
    return lambda _: SimpleNamespace(__file__=checkout / "_one.so")


def test_a_native_module_as_new_as_its_sources_is_well(checkout: Path):
    found = check_native(
        native_modules(checkout), checkout, lambda _: SimpleNamespace(__file__=checkout / "_one.so")
    )
    assert found.outcome == Outcome.OK


@pytest.mark.parametrize("source", ["host/a/core/one.cpp", "host/a/core/one.hpp"])
def test_a_native_module_older_than_its_sources_is_told_with_the_source(checkout: Path, source: str):
    os.utime(checkout / source, (2000, 2000))
    found = check_native(
        native_modules(checkout), checkout, lambda _: SimpleNamespace(__file__=checkout / "_one.so")
    )
    assert found.outcome == Outcome.FAIL
    assert f"host.a._one is older than {source}" in found.told and "make setup" in found.fix


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (ModuleNotFoundError("no", name="host.a._one"), "host.a._one not there"),
        (ModuleNotFoundError("no", name="numpy"), "host.a._one (for numpy) not there"),
        (ImportError("wrong ELF class:\nELFCLASS32"), "does not load (wrong ELF class: ELFCLASS32)"),
    ],
)
def test_a_native_module_that_is_missing_or_broken_is_told(checkout: Path, error: ImportError, words: str):
    def load(name: str) -> object:
        raise error

    found = check_native(native_modules(checkout), checkout, load)
    assert found.outcome == Outcome.FAIL and words in found.told and "make setup" in found.fix


def test_the_native_modules_of_another_checkout_are_told_from_ours(tmp_path: Path):
    found = check_checkout(ROOT, tmp_path)
    assert found.outcome == Outcome.FAIL
    assert str(tmp_path) in found.told and "this checkout's" in found.fix


def test_a_file_in_the_place_of_the_results_is_told(tmp_path: Path):
    (tmp_path / "runs").write_text("")
    found = check_folder(tmp_path / "runs")
    assert found.outcome == Outcome.FAIL and "is a file" in found.told and found.fix
    assert check_folder(tmp_path / "new").outcome == Outcome.OK


@pytest.mark.parametrize(("free_mb", "outcome"), [(50, "FAIL"), (500, "warn"), (5000, "ok")])
def test_a_disk_without_room_is_told_before_a_recording_fails(tmp_path: Path, free_mb: float, outcome: str):
    found = check_room(tmp_path / "runs", lambda folder: round(free_mb * 1e6))
    assert found.outcome == outcome
    assert "minutes of recording" in found.told and (outcome == "ok" or "delete old runs" in found.fix)


def test_where_even_the_libraries_are_missing_the_doctor_still_speaks():
    # -S leaves out site-packages, as on a machine where nothing was set up
    run = subprocess.run(
        [sys.executable, "-S", "-m", "host.doctor"], cwd=ROOT, capture_output=True, text=True
    )
    assert run.returncode == EXIT_CODES["installation"] == 2
    assert "numpy, opencv-python-headless" in run.stdout and "run 'make setup'" in run.stdout
    assert not run.stderr


def test_a_failure_without_a_remedy_cannot_be_told():
    with pytest.raises(ValueError, match="mend"):
        Part("camera").fail("rate", "too slow", "")


def test_the_exit_code_is_the_highest_of_what_failed():
    fine, doubtful = Part("wheels").ok("stop", "stands"), Part("wheels").warn("stop", "late", "mend it")
    assert exit_code([fine, doubtful, Part("wheels").untried("stop", "not up")]) == 0
    codes = {part: exit_code([fine, Part(part).fail("a", "b", "c")]) for part in EXIT_CODES}
    assert codes == EXIT_CODES
    assert (
        exit_code([Part(part).fail("a", "b", "c") for part in ("calibration", "robot", "installation")]) == 4
    )


@pytest.mark.parametrize(
    ("text", "told", "fix"),
    [
        (
            "camera 0: not there (present: none); plug it in",
            "camera 0: not there (present: none)",
            "plug it in",
        ),
        ("/dev/x is in use: close the other program", "/dev/x is in use", "close the other program"),
        ("something", "something", "see docs/hardware.md"),
    ],
)
def test_an_error_is_parted_from_its_remedy(text: str, told: str, fix: str):
    assert split_error(DeviceError(text)) == (told, fix)
