"""The pictures of docs/algorithm.md: all are drawn, none is missing, and they show what the page says."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from host.rbdn import Net
from host.view import mesh_picture, method_pictures
from host.view.mesh_picture import Part, draw_edges, draw_moves, fill_loops, in_a_row, mark_pixels
from host.view.method_pictures import PICTURES, REPAIRS, misfits

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "algorithm.md").read_text()
GREY = np.full((40, 60, 3), 128, np.uint8)


def test_the_program_draws_every_picture_of_the_page_small_enough_to_keep(tmp_path: Path):
    done = subprocess.run(
        [sys.executable, "-m", "host.view.method_pictures", tmp_path],
        cwd=ROOT, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    drawn = {path.name: path for path in tmp_path.iterdir()}
    assert set(drawn) == set(PICTURES) == set(re.findall(r"\(pictures/(\S+)\)", PAGE))
    for path in drawn.values():
        picture = cv2.imread(str(path))
        assert min(picture.shape[:2]) > 300 and picture.std() > 20, path.name
        assert (ROOT / "docs" / "pictures" / path.name).is_file()
    assert sum(path.stat().st_size for path in drawn.values()) < 600_000


def test_a_folder_that_cannot_be_written_is_named_in_one_line(tmp_path: Path):
    (tmp_path / "taken").write_text("")
    done = subprocess.run(
        [sys.executable, "-m", "host.view.method_pictures", tmp_path / "taken"],
        cwd=ROOT, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1 and "taken" in done.stderr


@pytest.mark.parametrize("repair", REPAIRS, ids=lambda repair: repair.step)
def test_each_repair_is_seen_to_do_what_its_caption_says(repair):
    part = Part(0, 0, 72, 56, 1)
    fitted, shown = (method_pictures._drawn(shapes, part) for shapes in (repair.fitted, repair.shown))
    before, after, _ = method_pictures._repaired(repair, fitted, shown)
    gained = len(after["vertices_px"]) - len(before["vertices_px"])
    edges = len(after["edges"]) - len(before["edges"])
    assert {
        "insert": gained > 0 and edges == gained,
        "delete": gained < 0 and edges == gained,
        "zip": edges < 0,
        "snap": gained == 0 and edges > 0,
    }[repair.step]


def test_pixels_that_fit_the_polygon_beyond_an_edge_are_marked_up_to_the_reach():
    image = np.full((64, 64, 3), (200, 200, 200), np.uint8)
    image[:, 27:] = (40, 40, 200)  # the squares' edge lies at 32
    net = Net()
    faces = method_pictures.squares(net, image)
    marked = misfits(image, faces)[20:28]
    assert marked[:, 27:32].all()
    assert marked[:, 16:24].all(), "grey, as all of the polygon to the left"
    assert not marked[:, 24:27].any() and not marked[:, 32:48].any()


def test_edges_lie_where_the_net_has_them():
    faces = {"vertices_px": np.array([[10.0, 20.0], [30.0, 20.0]]), "edges": np.array([[0, 1, 0, 1]])}
    part = Part(5, 10, 40, 20, 6)
    canvas = part.canvas(GREY)
    before = canvas.copy()
    draw_edges(canvas, part, faces, (0, 0, 255), width=1)
    rows, columns = np.nonzero(np.abs(canvas.astype(int) - before).max(2) > 60)
    assert rows.mean() == pytest.approx((20 - 10 + 0.5) * 6 - 0.5, abs=0.6)
    assert (columns.min(), columns.max()) == pytest.approx((32, 153), abs=1.5)


def test_an_arrow_points_to_where_a_vertex_goes_and_a_still_one_has_none():
    part = Part(0, 0, 60, 40, 8)
    canvas = part.canvas(GREY)
    before = canvas.copy()
    places = np.array([[10.0, 10.0], [40.0, 30.0]])
    draw_moves(canvas, part, places, places + np.array([[8.0, 0.0], [0.1, 0.0]]))
    changed = np.abs(canvas.astype(int) - before).max(2) > 60
    columns = np.nonzero(changed)[1]
    assert columns.min() >= 80 and columns.max() == pytest.approx(18.5 * 8, abs=3)
    assert changed[:, 110:].sum() > changed[:, :110].sum(), "the head is at the far end"


def test_a_hole_is_not_filled():
    part = Part(0, 0, 60, 40, 2)
    canvas = part.canvas(GREY)
    before = canvas.copy()
    outer = np.array([[5.0, 5], [50, 5], [50, 35], [5, 35]])
    hole = np.array([[20.0, 15], [30, 15], [30, 25], [20, 25]])
    fill_loops(canvas, part, [outer, hole], (0, 0, 255), 0.5)
    changed = (canvas != before).any(2)
    assert changed[20, 20] and not changed[40, 50]


def test_marks_cover_the_middle_of_their_pixels_only():
    part = Part(10, 10, 20, 20, 8)
    mask = np.zeros((40, 60), bool)
    mask[12, 14] = mask[0, 0] = True
    canvas = part.canvas(GREY)
    mark_pixels(canvas, part, mask, (0, 0, 255))
    rows, columns = np.nonzero((canvas == (0, 0, 255)).all(2))
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (18, 21, 34, 37)


def test_a_caption_wider_than_its_picture_is_refused():
    with pytest.raises(ValueError, match="wider"):
        in_a_row([GREY, GREY], ["short", "much too long for a picture of sixty pixels"])
    wide = in_a_row([GREY, GREY], ["a", "b"])
    assert wide.shape == (40 + mesh_picture.CAPTION_PX, 120 + mesh_picture.GAP_PX, 3)
