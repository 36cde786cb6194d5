"""Is the program itself whole: Python, libraries, native modules, room for results?

Needs nothing but Python itself, so that it also works where little else does.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import json
import operator
import os
import re
import shutil
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from urllib.parse import unquote, urlparse

from host.doctor.finding import Finding, Part
from host.errors import UsageError
from host.record.atomic import check_writable

ROOT = Path(__file__).resolve().parents[2]
PROJECT = "rbdn-robot"
SET_UP = "run 'make setup'"
# The same module under other names, of which pip does not know that they are one.
OPENCV = (
    "opencv-python-headless",
    "opencv-python",
    "opencv-contrib-python-headless",
    "opencv-contrib-python",
)
RECORDING_MB_PER_MIN = 100
TIGHT_MB, FULL_MB = 1000, 100
PART = Part("installation")
Version = tuple[int, ...]
COMPARED = {
    ">=": operator.ge,
    "<=": operator.le,
    "==": operator.eq,
    ">": operator.gt,
    "<": operator.lt,
}


def check_installation(runs: Path, root: Path = ROOT) -> Iterator[Finding]:
    """All of it, in the order in which to mend it."""
    requirements, python = declared(root)
    yield check_python(sys.version_info[:3], python)
    yield from check_libraries(requirements, installed)
    yield check_native(native_modules(root), root, importlib.import_module)
    yield check_checkout(root, _installed_from())
    yield check_folder(runs)
    yield check_room(runs, lambda folder: shutil.disk_usage(folder).free)


def declared(root: Path = ROOT) -> tuple[list[str], str]:
    """The libraries and the Python that pyproject.toml asks for, else those of the installed package."""
    try:
        project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    except (OSError, KeyError, tomllib.TOMLDecodeError):
        try:
            told = importlib.metadata.metadata(PROJECT)
        except importlib.metadata.PackageNotFoundError:
            return [], ""
        wanted = importlib.metadata.requires(PROJECT) or []
        return [one for one in wanted if "extra ==" not in one], told["Requires-Python"] or ""
    return project.get("dependencies", []), project.get("requires-python", "")


def check_python(version: Version, wanted: str) -> Finding:
    """Is this Python new enough?"""
    have = ".".join(map(str, version))
    if not _within(version, wanted):
        return PART.fail(
            "Python", f"{have}, {wanted} is needed", "run 'make clean; make setup PYTHON=python3.12'"
        )
    return PART.ok("Python", have)


def installed(name: str) -> str | None:
    """Version of a library; None where there is none."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def check_libraries(
    requirements: Iterable[str], version_of: Callable[[str], str | None]
) -> Iterator[Finding]:
    """Is every library there, in a version that this program was written for?"""
    missing, wrong, right = [], [], []
    for requirement in requirements:
        name, wanted = _parsed(requirement)
        names = OPENCV if name in OPENCV else (name,)
        found = [(one, version) for one in names if (version := version_of(one)) is not None]
        if len(found) > 1:
            several = " and ".join(one for one, _ in found)
            fix = f"run '.venv/bin/pip uninstall {' '.join(one for one, _ in found)}', then 'make setup'"
            yield PART.warn("libraries", f"{several} are one module and overwrite each other", fix)
        if not found:
            missing.append(name)
        elif not _within(_numbers(found[0][1]), wanted):
            wrong.append(f"{name} {found[0][1]}, {wanted} is needed")
        else:
            right.append(f"{found[0][0]} {found[0][1]}")
    if missing:
        yield PART.fail("libraries", f"{', '.join(missing)} not there", SET_UP)
    if wrong:
        yield PART.fail("libraries", "; ".join(wrong), SET_UP)
    if right and not missing and not wrong:
        yield PART.ok("libraries", ", ".join(right))


def native_modules(root: Path = ROOT) -> dict[str, list[str]]:
    """Module -> patterns of its sources, as CMakeLists.txt has them; where there is none, only the names."""
    try:
        text = (root / "CMakeLists.txt").read_text()
    except OSError:
        names = ("rbdn._core", "depth._depth", "nav._nav", "sim._render", "sim._board")
        return {f"host.{name}": [] for name in names}
    found = re.findall(r"^native_module\((\w+) (\S+) ([^)]*)\)", text, re.MULTILINE)
    return {f"{folder.replace('/', '.')}.{name}": sources.split() for name, folder, sources in found}


def check_native(modules: Mapping[str, list[str]], root: Path, load: Callable[[str], object]) -> Finding:
    """Do they load, and were they built from the sources as they are now?"""
    missing, broken, old = [], [], []
    for name, patterns in modules.items():
        try:
            file = getattr(load(name), "__file__", None)
        except ModuleNotFoundError as error:
            missing.append(name if error.name == name or not error.name else f"{name} (for {error.name})")
            continue
        except ImportError as error:  # for another Python or machine
            broken.append(f"{name} does not load ({' '.join(str(error).split())[:120]})")
            continue
        newest = _newest(root, patterns)
        if file is not None and newest is not None and _changed_s(newest) > _changed_s(Path(file)):
            old.append(f"{name} is older than {newest.relative_to(root)}")
    if missing or broken:
        told = [*([f"{', '.join(missing)} not there"] if missing else []), *broken]
        return PART.fail(
            "native modules", "; ".join(told), f"{SET_UP}; if that did not help: 'make clean' first"
        )
    if old:
        return PART.fail("native modules", "; ".join(old), f"{SET_UP}, which builds them anew")
    return PART.ok("native modules", f"{len(modules)} load and are as new as their sources")


def check_checkout(root: Path, installed_from: Path | None) -> Finding:
    """Is it this very checkout that is installed, and not another one?"""
    if not (root / "pyproject.toml").exists() or installed_from is None:
        return PART.ok("checkout", f"runs from {root}")
    if installed_from.resolve() != root.resolve():
        return PART.fail(
            "checkout",
            f"this is {root}, but the native modules are those of {installed_from}",
            f"{SET_UP} here, and use this checkout's .venv/bin/python",
        )
    return PART.ok("checkout", f"{root} is the one that is installed")


def check_folder(runs: Path) -> Finding:
    """Can results be written?"""
    try:
        check_writable(runs, folder=True)
    except UsageError as error:
        return PART.fail(
            "results",
            str(error).split("; ")[0],
            f"start from a folder of your own, or 'sudo chown $USER {runs}'",
        )
    return PART.ok("results", f"{runs} can be written")


def check_room(runs: Path, free_bytes: Callable[[Path], int]) -> Finding:
    """Is there room for recordings?"""
    folder = runs.absolute()
    while not folder.exists():
        folder = folder.parent
    free_mb = free_bytes(folder) / 1e6
    minutes = free_mb / RECORDING_MB_PER_MIN
    told = f"{free_mb / 1000:.1f} GB free, about {minutes:.0f} minutes of recording"
    if free_mb < FULL_MB:
        return PART.fail("disk", told, f"delete old runs in {runs}")
    if free_mb < TIGHT_MB:
        return PART.warn("disk", told, f"delete old runs in {runs} before recording")
    return PART.ok("disk", told)


def _installed_from() -> Path | None:
    """The folder that pip was given."""
    try:
        told = importlib.metadata.distribution(PROJECT).read_text("direct_url.json")
    except importlib.metadata.PackageNotFoundError:
        return None
    if told is None:
        return None
    url = urlparse(json.loads(told).get("url", ""))
    return Path(unquote(url.path)) if url.scheme == "file" else None


def _parsed(requirement: str) -> tuple[str, str]:
    """(name, versions) of a requirement such as ``opencv-python-headless>=4.10,<6``."""
    name = re.match(r"[\w.-]+", requirement)
    assert name is not None, requirement
    return name[0], requirement[name.end() :].split(";")[0].strip()


def _within(version: Version, wanted: str) -> bool:
    """Does a version keep to bounds such as ``>=4.10,<6``?"""
    for bound in filter(None, (part.strip() for part in wanted.split(","))):
        match = re.fullmatch(r"(>=|<=|==|>|<)\s*([\d.]+)", bound)
        assert match is not None, f"bound {bound!r} is not understood"
        limit = _numbers(match[2])
        have = (*version, 0, 0, 0)[: max(len(limit), 3)]
        limit = (*limit, 0, 0, 0)[: len(have)]
        if not COMPARED[match[1]](have, limit):
            return False
    return True


def _numbers(version: str) -> Version:
    return tuple(int(part) for part in re.findall(r"\d+", version.split("+")[0])[:3])


def _newest(root: Path, patterns: Iterable[str]) -> Path | None:
    headers = (str(Path(pattern).parent / "*.h*") for pattern in patterns)
    files = {file for pattern in (*patterns, *headers) for file in root.glob(pattern)}
    return max(files, key=_changed_s, default=None)


def _changed_s(file: Path) -> float:
    return os.stat(file).st_mtime
