"""What README and docs point to is there: links, headings, files and commands with their options."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])


def anchors(page: Path) -> set[str]:
    """Of the headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        if target.startswith(("http://", "https://")):
            continue
        file, _, heading = target.partition("#")
        linked = (page.parent / file).resolve() if file else page
        assert linked.exists(), target
        assert not heading or heading in anchors(linked), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_that_is_shown_exists_and_knows_its_options(page):
    if page.name == "CHANGELOG.md":
        return
    for module, rest in re.findall(r"python -m ((?:host|bench)[\w.]*)([^`\n#]*)", page.read_text()):
        place = ROOT / module.replace(".", "/")
        assert place.with_suffix(".py").is_file() or (place / "__main__.py").is_file(), module
        source = place.with_suffix(".py").read_text() if place.with_suffix(".py").is_file() else ""
        for one in sorted(place.glob("*.py")):
            source += one.read_text()
        for option in re.findall(r"(?<!\S)--([a-z][\w-]*)(?=[\s=]|$)", rest):
            assert re.search(rf"\b{option.replace('-', '_')}\b", source), f"{module} --{option}"


def test_what_the_package_names_is_there_and_the_rig_under_the_gpl_is_not_installed():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    for name in project["project"]["license-files"]:
        assert (ROOT / name).read_text()
    left_out = project["tool"]["scikit-build"]["wheel"]["exclude"]
    assert {"**/*.c", "**/*.h"} <= set(left_out)
    rig = [path.name for path in (ROOT / "host").rglob("*") if path.suffix in (".c", ".h")]
    assert set(rig) == {"rig.c", "rig.h"} and all(name in (ROOT / "NOTICE").read_text() for name in rig)
