"""The whole visit: simulated, with nothing to look at, with what goes wrong between the parts."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from host.camera.lens import Lens
from host.camera.lens_file import write_lens
from host.config import Config
from host.doctor.__main__ import main
from host.doctor.finding import EXIT_CODES, Finding, Outcome, exit_code
from host.doctor.show import show, write_json
from host.doctor.visit import DoctorOptions, visit
from host.errors import UsageError
from host.link.robot import Robot
from host.sim.serve import Port


@pytest.fixture(autouse=True)
def empty_place(tmp_path: Path, monkeypatch) -> None:
    """No webcam, an empty folder, and no time lost with looking for this computer's pauses."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("host.doctor.visit.WEBCAM", tmp_path / "video0")
    monkeypatch.setattr("host.doctor.timing.NAPS", 3)


class Nobody:
    there = False

    def ask(self, question, meanwhile):
        raise AssertionError(f"nobody is here to answer {question!r}")


class Somebody:
    there = True

    def __init__(self, says: str) -> None:
        self.says, self.asked = says, []

    def ask(self, question, meanwhile):
        self.asked.append(question)
        return self.says


def by_part(findings: list[Finding]) -> dict[str, list[Finding]]:
    return {part: [f for f in findings if f.part == part] for part in EXIT_CODES}


def test_a_simulated_robot_goes_through_every_check(tmp_path: Path, monkeypatch, capsys):
    code = main(["--camera", "sim:room?seed=1", "--robot", "sim:", "--json", "out.json"])
    told = json.loads((tmp_path / "out.json").read_text())
    failed = [c for c in told["checks"] if c["outcome"] == "FAIL"]
    # what depends on how busy this computer is, or on who works on its native modules
    assert {c["name"] for c in failed} <= {"pauses", "picture time", "native modules"}
    assert code == told["exit_code"] and told["versions"]["opencv"]
    assert not [c for c in told["checks"] if c["outcome"] == "not tried"]
    assert {c["part"] for c in told["checks"]} == set(EXIT_CODES)
    shown = capsys.readouterr().out
    assert "left wheel" in shown and "sharpness" in shown
    assert "never measured" in shown and "host.calibrate wheels" in shown


def test_with_nothing_to_look_at_it_is_told_how_to_name_it(tmp_path: Path, monkeypatch):
    found = by_part(visit(DoctorOptions(), Config(), Nobody()))
    for part, word in (
        ("camera", "--camera"),
        ("robot", "--robot"),
        ("wheels", "no robot"),
        ("calibration", "--lens"),
    ):
        assert {f.outcome for f in found[part]} == {Outcome.UNTRIED}
        assert word in found[part][0].told


@pytest.mark.parametrize(
    ("options", "part", "told", "code"),
    [
        ({"camera": "/dev/video99"}, "camera", "not there", 4),
        ({"camera": "nowhere"}, "camera", "no such file", 4),
        ({"camera": "sim:nowhere"}, "camera", "no such simulated scene", 4),
        ({"robot": "/dev/ttyNONE"}, "robot", "does not exist", 4),
        ({"robot": "."}, "robot", "no serial port", 4),
        ({"robot": "sim:nowhere"}, "robot", "write sim:", 4),
        ({"robot": "sim:?battery_mv=6000"}, "robot", "6.00 V", 4),
        ({"lens": Path("camera.json")}, "calibration", "no such file", 3),
    ],
)
def test_what_cannot_be_opened_is_a_finding_and_no_end(tmp_path, monkeypatch, options, part, told, code):
    findings = visit(DoctorOptions(**options), Config(), Nobody())
    failed = [f for f in findings if f.outcome == Outcome.FAIL and f.part == part]
    assert len(failed) == 1 and failed[0].fix
    assert told in f"{failed[0].told}: {failed[0].fix}"
    assert "\n" not in failed[0].told + failed[0].fix
    assert by_part(findings)["wheels"][0].outcome == Outcome.UNTRIED
    assert by_part(findings)["timing"]
    assert exit_code(failed) == code


def test_a_lens_for_another_size_than_the_pictures_is_told(tmp_path):
    (tmp_path / "pictures").mkdir()
    chance = np.random.default_rng(1)
    for k in range(6):
        cv2.imwrite(str(tmp_path / f"pictures/{k}.png"), chance.integers(0, 255, (48, 64, 3), np.uint8))
    write_lens(tmp_path / "camera.json", Lens(640, 480, 600.0, 600.0, 320.0, 240.0))
    options = DoctorOptions(camera="pictures", lens=tmp_path / "camera.json")
    findings = visit(options, Config(), Nobody())
    (failed,) = [f for f in findings if f.outcome == Outcome.FAIL and f.name != "native modules"]
    assert failed.part == "calibration" and exit_code([failed]) == 3
    assert "640x480 px, the camera delivers 64x48" in failed.told and "calibrate" in failed.fix


@pytest.mark.parametrize(
    ("person", "options", "outcome", "told"),
    [
        (Nobody(), {}, "not tried", "add --wheels-up"),
        (Somebody("no"), {}, "not tried", "the wheels are not up"),
        (Somebody(""), {}, "not tried", "the wheels are not up"),
        (Nobody(), {"by_hand": True}, "not tried", "nobody at a terminal"),
        (Nobody(), {"wheels_up": True}, "ok", "counts when told forward"),
        (Somebody("yes"), {}, "ok", "counts when told forward"),
    ],
)
def test_real_wheels_turn_only_after_a_yes(tmp_path, monkeypatch, person, options, outcome, told):
    monkeypatch.setattr("host.doctor.visit._simulated", lambda uri: False)  # the doctor takes it for real
    monkeypatch.setattr("host.doctor.robot.check_port", lambda uri: None)
    found = by_part(visit(DoctorOptions(robot="sim:", **options), Config(), person))["wheels"]
    assert found[0].outcome == outcome and told in found[0].told
    if isinstance(person, Somebody):
        assert "on blocks" in person.asked[0]
    if outcome == "ok":
        (left,) = [f for f in found if f.name == "left is left"]
        assert left.outcome == ("ok" if person.there else "not tried")


def test_a_port_with_nobody_behind_it_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(Robot.connect, "__defaults__", (0.3,))
    port = Port()
    try:
        found = by_part(visit(DoctorOptions(robot=port.path), Config(), Nobody()))
    finally:
        port.close()
    assert [f.name for f in found["robot"]] == ["port", "handshake"]
    assert found["robot"][1].outcome == Outcome.FAIL
    assert found["wheels"][0].outcome == Outcome.UNTRIED


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--by-hand", "--wheels-up"], "exclude each other"),
        (["--by-hand"], "needs --robot"),
        (["--json", "."], "is a folder"),
        (["--camra", "0"], "did you mean --camera?"),
    ],
)
def test_a_visit_that_makes_no_sense_is_refused_in_one_line(tmp_path, monkeypatch, arguments, words):
    with pytest.raises(UsageError, match=words) as error:
        main(arguments)
    assert "\n" not in str(error.value)


def test_without_rich_the_findings_are_plain_lines(monkeypatch, capsys):
    monkeypatch.setattr("host.doctor.show.find_spec", lambda name: None)
    show([Finding("camera", "rate", Outcome.FAIL, "too slow", "use another port")])
    assert capsys.readouterr().out.splitlines() == [
        "FAIL      camera, rate: too slow",
        "          -> use another port",
        "1 of 1 checks failed: begin with the uppermost",
    ]


def test_what_is_found_gets_into_a_file_also_where_the_versions_cannot_be_told(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "host.record.versions", None)
    write_json([Finding("camera", "rate", Outcome.FAIL, "slow", "mend it")], tmp_path / "out.json")
    told = json.loads((tmp_path / "out.json").read_text())
    assert told["exit_code"] == EXIT_CODES["camera"] and told["versions"] == {}


def test_a_library_that_only_one_part_needs_spares_the_others(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "host.link.ports", None)
    found = by_part(visit(DoctorOptions(), Config(), Nobody()))
    (library,) = found["robot"]
    assert library.outcome == Outcome.FAIL and "not found" in library.told and "make setup" in library.fix
    assert found["timing"]
