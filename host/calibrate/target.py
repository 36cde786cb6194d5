"""The calibration board as a PDF to print in true size, and beside it a file that tells the others of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from host.calibrate.board import Board, write_board
from host.errors import UsageError
from host.record.atomic import check_writable, write_whole

PAPERS_MM = {"a4": (297.0, 210.0), "letter": (279.4, 215.9)}  # on their side
POINTS_PER_MM = 72 / 25.4
RULER_MM = 100.0
BELOW_MM = 18.0  # under the board, for the ruler and the text
TEXT_MM = 2.9


@dataclass(frozen=True)
class TargetOptions:
    """Write the board to print for `camera` and `check`: a PDF in true size, and its description."""

    out: Path = Path("target.pdf")  # beside it goes the description, with .json instead of .pdf
    paper: Literal["a4", "letter"] = "a4"  # a4 or letter, on its side; the board is the same on both

    def __post_init__(self) -> None:
        if self.out.suffix.lower() != ".pdf":
            raise UsageError(f"--out {self.out}: the board is written as PDF; name a file that ends in .pdf")


def pdf(board: Board, paper: str) -> bytes:
    """One page with the board, a ruler and what to do; equal calls give equal bytes."""
    width, height = PAPERS_MM[paper]
    across, down = board.size_mm
    left, top = (width - across) / 2, (height - down - BELOW_MM) / 2 + down + BELOW_MM  # from below
    parts = [f"{POINTS_PER_MM:.8f} 0 0 {POINTS_PER_MM:.8f} 0 0 cm 0 g"]
    # One path for all: where two rectangles touch there must be no seam.
    parts += [f"{left + x:.4f} {top - y - h:.4f} {w:.4f} {h:.4f} re" for x, y, w, h in board.black_mm]
    parts.append("f")
    parts += _ruler(left, top - down - 6.0)
    name = {"a4": "A4", "letter": "Letter"}[paper]
    lines = (
        "Print at 100 % (actual size, no fitting to the page); measure 100 mm here.",
        f"{board.words}, {name}.",
        "Glue it flat on something stiff: wood, glass, foam board. Then: python -m host.calibrate camera",
    )
    for k, line in enumerate(lines):
        place = f"{left + RULER_MM + 4:.3f} {top - down - 5.2 - k * 1.4 * TEXT_MM:.3f}"
        parts.append(f"BT /F1 {TEXT_MM:g} Tf {place} Td ({_escaped(line)}) Tj ET")
    return _document(width, height, "\n".join(parts).encode("latin-1"))


def _ruler(x: float, y: float) -> list[str]:
    """A line with a tick every 10 mm, its ends' outer edges exactly so far apart."""
    thin = 0.2
    out = [f"{x:.4f} {y - thin / 2:.4f} {RULER_MM:.4f} {thin} re"]
    for k in range(11):
        long = 5.0 if k in (0, 5, 10) else 3.0
        at = x + 10 * k - (0 if k == 0 else thin if k == 10 else thin / 2)
        out.append(f"{at:.4f} {y - long / 2:.4f} {thin} {long} re")
    out.append("f")
    for k in (0, 50, 100):
        out.append(f"BT /F1 2.6 Tf {x + k - (0, 4.5, 9.0)[k // 50]:.3f} {y - 6:.3f} Td ({k} mm) Tj ET")
    return out


def _escaped(text: str) -> str:
    return text.replace("\\", r"\\").replace("(", r"\(").replace(")", r"\)")


def _document(width_mm: float, height_mm: float, content: bytes) -> bytes:
    """The least that a PDF is; it asks printing programs not to scale it."""
    box = f"0 0 {width_mm * POINTS_PER_MM:.4f} {height_mm * POINTS_PER_MM:.4f}"
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox [{box}] /Contents 4 0 R "
        "/Resources << /Font << /F1 5 0 R >> >> >>".encode(),
        b"<< /Length %d >>\nstream\n%s\nendstream" % (len(content), content),
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>",
    ]
    out, places = b"%PDF-1.6\n%\xe2\xe3\xcf\xd3\n", []
    for k, body in enumerate(objects, 1):
        places.append(len(out))
        out += b"%d 0 obj\n%s\nendobj\n" % (k, body)
    table = b"".join(b"%010d 00000 n \n" % place for place in places)
    count = len(objects) + 1
    return out + (
        b"xref\n0 %d\n0000000000 65535 f \n%strailer\n<< /Size %d /Root 1 0 R >>\nstartxref\n%d\n%%%%EOF\n"
        % (count, table, count, len(out))
    )


def run(options: TargetOptions) -> None:
    """The command's body."""
    board, description = Board(), options.out.with_suffix(".json")
    for path in (options.out, description):
        check_writable(path, folder=False)
    write_whole(options.out, pdf(board, options.paper))
    write_board(board, description)
    print(f"{options.out}: {board.words}, on {options.paper}.")
    print("Print it at 100 %, measure its ruler, and glue it flat on something stiff.")
    print(f"Then: python -m host.calibrate camera --camera 0 --board {description}")
