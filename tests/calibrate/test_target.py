"""The printed board has its true size, is the one that is looked for, and is known to the other commands."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from host.calibrate.__main__ import main
from host.calibrate.board import Board, read_board
from host.calibrate.target import PAPERS_MM, POINTS_PER_MM, pdf
from host.errors import InputError, UsageError

DOT_MM = 0.125


def printed(content: bytes) -> tuple[np.ndarray, tuple[float, float]]:
    """What a printer that scales nothing puts on paper, 8 dots a mm; and the paper's size in mm."""
    box = re.search(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", content)
    scale = re.search(rb"\n?([\d.]+) 0 0 ([\d.]+) 0 0 cm", content)
    assert box and scale and scale[1] == scale[2]
    width, height = (float(v) / 72 * 25.4 for v in box.groups())
    per_unit = float(scale[1]) / 72 * 25.4  # mm
    paper = np.full((round(height / DOT_MM), round(width / DOT_MM)), 255, np.uint8)
    for found in re.finditer(rb"([\d.]+) ([\d.]+) ([\d.]+) ([\d.]+) re", content):
        x, y, w, h = (float(v) * per_unit for v in found.groups())
        left, right = round(x / DOT_MM), round((x + w) / DOT_MM)
        top, bottom = round((height - y - h) / DOT_MM), round((height - y) / DOT_MM)
        paper[top : max(bottom, top + 1), left : max(right, left + 1)] = 0
    return paper, (width, height)


@pytest.mark.parametrize("paper", ["a4", "letter"])
def test_squares_and_ruler_have_their_true_size(paper: str) -> None:
    dots, size = printed(pdf(Board(), paper))
    assert size == pytest.approx(PAPERS_MM[paper], abs=0.01)
    seen = Board().find(cv2.GaussianBlur(dots, (0, 0), 1.0))
    assert seen is not None and len(seen.ids) == 35
    across = {int(n): p * DOT_MM for n, p in zip(seen.ids, seen.points, strict=True)}
    for n in range(6):
        assert across[n + 1] - across[n] == pytest.approx((30.0, 0.0), abs=0.02)
        assert across[n + 7] - across[n] == pytest.approx((0.0, 30.0), abs=0.02)
    below = dots[round(190 / DOT_MM) :]
    ruler = below[(below == 0).sum(1) > 90 / DOT_MM]
    assert len(ruler)
    line = np.flatnonzero(ruler[0] == 0)
    assert (line[-1] + 1 - line[0]) * DOT_MM == pytest.approx(100.0, abs=DOT_MM)


def test_the_board_fits_its_paper_and_leaves_what_printers_cannot_reach() -> None:
    for paper in PAPERS_MM:
        dots, _ = printed(pdf(Board(), paper))
        rim = round(5.0 / DOT_MM)
        inside = dots[rim:-rim, rim:-rim]
        assert (dots == 0).sum() == (inside == 0).sum()


def test_the_drawing_is_the_board_that_opencv_knows() -> None:
    board, dots = Board(), 8
    width, height = (round(side * dots) for side in board.size_mm)
    drawn = np.full((height, width), 255, np.uint8)
    for x, y, w, h in board.black_mm:
        drawn[round(y * dots) : round((y + h) * dots), round(x * dots) : round((x + w) * dots)] = 0
    marks = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    theirs = cv2.aruco.CharucoBoard((8, 6), 30.0, 22.5, marks).generateImage((width, height))
    assert (drawn == theirs).all()


def test_what_to_do_is_printed_and_no_program_is_asked_to_scale() -> None:
    content = pdf(Board(), "a4")
    for part in (b"Print at 100 %", b"measure 100 mm here", b"8 x 6 squares of 30 mm", b"DICT_4X4_50"):
        assert part in content
    assert b"/PrintScaling /None" in content
    assert abs(POINTS_PER_MM - 72 / 25.4) < 1e-12
    table = int(re.search(rb"startxref\n(\d+)", content)[1])  # type: ignore[index]
    assert content[table:].startswith(b"xref")
    for number, place in enumerate(re.findall(rb"(\d{10}) 00000 n", content), 1):
        assert content[int(place) :].startswith(b"%d 0 obj" % number)


def test_the_command_writes_the_board_and_what_tells_of_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["target", "--out", str(tmp_path / "b.pdf"), "--paper", "letter"])
    assert (tmp_path / "b.pdf").read_bytes() == pdf(Board(), "letter")
    assert read_board(tmp_path / "b.json") == Board()
    told = capsys.readouterr().out
    assert "100 %" in told and f"--board {tmp_path / 'b.json'}" in told


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--paper", "a5"], "'a5'"),
        (["--out", "board.png"], "--out board.png: the board is written as PDF"),
        (["--out", "/proc/no/board.pdf"], "/proc/no/board.pdf: "),
    ],
)
def test_a_wrong_command_line_gets_one_line(arguments: list[str], complaint: str) -> None:
    with pytest.raises(UsageError) as told:
        main(["target", *arguments])
    assert complaint in str(told.value) and "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("{", "tells of no board: Expecting property name"),
        ("[]", "it must be one JSON object"),
        ('{"colums": 8}', "unknown key 'colums'; the keys are columns, rows"),
        ('{"columns": 8.5}', "columns = 8.5 is not of the right kind"),
        ('{"columns": 2}', "2 by 6 squares: give 3 to 40 each way"),
        ('{"dictionary": "DICT_9"}', "dictionary 'DICT_9': give one of DICT_4X4_50"),
        ('{"marker_mm": 40}', "a marker takes 0.3 to 0.95 of its square"),
        ('{"columns": 20, "rows": 20}', "200 markers are more than DICT_4X4_50 has"),
    ],
)
def test_a_file_that_tells_of_no_board_is_refused(tmp_path: Path, text: str, complaint: str) -> None:
    file = tmp_path / "target.json"
    file.write_text(text)
    with pytest.raises(InputError) as told:
        read_board(file)
    assert complaint in str(told.value) and str(file) in str(told.value) and "\n" not in str(told.value)


def test_a_board_file_that_is_not_there_is_said_to_come_from_target(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"'python -m host.calibrate target' writes one"):
        read_board(tmp_path / "none.json")
