"""Pictures: the net, the depths and the way driven are really in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from host.depth.report import DepthReport, RegionDepth, VertexDepths
from host.rbdn.snapshot import Contour, Region, Snapshot, Vertices
from host.view.floor_picture import GOAL, LEGEND_PX, OCCUPIED, PATH, Floor, FloorObstacle, draw_floor
from host.view.net_picture import draw_net, draw_regions
from host.view.palette import depth_text, region_colour

SQUARE = np.array([[100.0, 80], [220, 80], [220, 160], [100, 160]])
NOTHING = RegionDepth(None, None, None, "too little motion")
KNOWN = RegionDepth(85.23, 0.61, "area", None)
GREY = np.full((240, 320, 3), 120, np.uint8)


def snapshot(*loops: np.ndarray) -> Snapshot:
    """Regions 1, 2, ... with one loop each."""
    regions = tuple(
        Region(
            id=k,
            parent=None,
            born_seq=0,
            area_px=float(np.prod(np.ptp(loop, axis=0))),
            sigma_area_px=1.0,
            touches_border=False,
            mean_rgb=(0.0, 0.0, 0.0),
            loops=(loop,),
            loop_vertices=(np.arange(len(loop)),),
            loop_neighbours=(np.zeros(len(loop), np.int64),),
        )
        for k, loop in enumerate(loops, start=1)
    )
    none = np.zeros(0)
    contour = Contour(np.zeros((0, 2)), np.zeros((0, 2)), none, none, none, none)
    vertices = Vertices(np.arange(len(loops[0])), loops[0], np.zeros(len(loops[0])))
    return Snapshot(0, regions, vertices, contour, (), 1, 1.0, 1.0)


def report(*depths: RegionDepth) -> DepthReport:
    nothing = VertexDepths(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0))
    return DepthReport(dict(enumerate(depths, start=1)), nothing)


def close_to(picture: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    return np.abs(picture.astype(int) - colour).max(axis=2) < 30


def test_a_small_frame_is_enlarged_and_the_given_image_left_alone():
    image = GREY.copy()
    picture = draw_net(image, snapshot(SQUARE), report(KNOWN))
    assert picture.shape[1] == 960
    assert picture.dtype == np.uint8
    assert np.array_equal(image, GREY)


def test_a_still_shows_every_region_in_its_colour_and_names_the_larger_ones():
    small = np.array([[5.0, 5], [15, 5], [15, 15], [5, 15]])
    picture = draw_regions(GREY, snapshot(SQUARE, small), "still")
    for loop, region in ((SQUARE, 1), (small, 2)):
        x, y = (3 * loop[0]).astype(int) + 9
        tint = picture[y, x].astype(float) - 120
        towards = np.array(region_colour(region)) - 120.0
        assert tint @ towards > 0.95 * np.linalg.norm(tint) * np.linalg.norm(towards) > 0
    letters = close_to(picture[:720], (240, 238, 235))
    inside = letters[250:475, 310:655].sum()
    assert inside > 10 and letters[20:45, 20:45].sum() == 0


def test_outlines_lie_where_the_net_says_to_the_pixel():
    picture = draw_net(GREY, snapshot(SQUARE), report(NOTHING))
    on_outline = close_to(picture[:720], region_colour(1))
    rows, columns = np.nonzero(on_outline)
    assert (columns.min(), columns.max()) == (300, 662)  # (100 + 0.5) * 3 - 0.5 = 301, two pixels wide
    assert (rows.min(), rows.max()) == (240, 482)
    assert on_outline[:, 301].sum() > 200


def test_depth_is_written_into_its_region_and_only_there():
    scene = snapshot(SQUARE)
    without, with_depth = (draw_net(GREY, scene, report(d)) for d in (NOTHING, KNOWN))
    other = draw_net(GREY, scene, report(replace(KNOWN, depth_cm=47.9)))
    inside = (slice(250, 475), slice(310, 655))
    assert (close_to(with_depth[inside], (240, 238, 235)).sum()) > 80  # letters
    assert close_to(without[inside], (240, 238, 235)).sum() == 0
    changed = np.abs(with_depth[:720].astype(int) - other[:720]).max(axis=2) > 20
    assert changed[inside].sum() > 20
    changed[inside] = False
    assert not changed.any()


def test_labels_of_neighbouring_small_regions_do_not_cover_each_other():
    loops = [np.array([[x, 100.0], [x + 14, 100], [x + 14, 114], [x, 114]]) for x in (100.0, 116, 132, 148)]
    scene, one_by_one = snapshot(*loops), []
    for k in range(4):
        depths = [KNOWN if j <= k else NOTHING for j in range(4)]
        one_by_one.append(close_to(draw_net(GREY, scene, report(*depths))[:720], (240, 238, 235)).sum())
    steps = np.diff(one_by_one)
    assert (steps > 0.5 * steps.max()).all()  # each label adds its letters


def test_a_label_at_the_picture_edge_stays_inside():
    corner = np.array([[-0.5, -0.5], [12, -0.5], [12, 12], [-0.5, 12]])
    picture = draw_net(GREY, snapshot(corner), report(KNOWN))
    middle = draw_net(GREY, snapshot(corner + 100), report(KNOWN))
    bright = [close_to(p[:720], (240, 238, 235)).sum() for p in (picture, middle)]
    assert abs(bright[0] - bright[1]) < 60


def test_the_caption_is_written_below():
    empty, full = (draw_net(GREY, snapshot(SQUARE), report(KNOWN), text) for text in ("", "frame 12"))
    assert np.array_equal(empty[:720], full[:720])
    assert (empty[720:] != full[720:]).any()


def test_ids_have_colours_that_differ_from_their_neighbours():
    colours = np.array([region_colour(k) for k in range(40)], float)
    for k in range(39):
        assert np.linalg.norm(colours[k] - colours[k + 1]) > 60


def test_depth_is_written_with_the_digits_its_sigma_supports():
    assert depth_text(85.23, 0.61) in ("85.2 ± 0.6 cm", "85.2 +- 0.6 cm")
    assert depth_text(272.4, 41.3).split()[0] == "272"
    assert depth_text(85.23, None) == "85 cm"


def straight(*, goal: tuple[float, float] | None = None, **more) -> Floor:
    path = np.column_stack([np.zeros(50), np.linspace(0, 150, 50)])
    return Floor(path, 0.0, 12.0, goal_cm=goal, **more)


def test_the_way_goes_up_and_right_is_right():
    left, right = (
        draw_floor(Floor(np.array([[0.0, 0], [x, 150]]), 0.0, 12.0))[:, :-LEGEND_PX] for x in (-80, 80)
    )
    for picture, sign in ((left, -1), (right, 1)):
        rows, columns = np.nonzero(close_to(picture, PATH))
        assert sign * np.corrcoef(rows, columns)[0, 1] < -0.5  # ahead is up, so rows fall


def test_the_goal_is_marked_only_where_there_is_one():
    assert close_to(draw_floor(straight())[:, :-LEGEND_PX], GOAL).sum() == 0
    assert close_to(draw_floor(straight(goal=(30, 160)))[:, :-LEGEND_PX], GOAL).sum() > 30


def test_obstacles_and_taken_cells_are_drawn_to_scale():
    thing = FloorObstacle(5, np.array([[-40.0, 100], [-10, 100]]), 100.0, 2.0)
    cells = np.array([[40.0, 80], [45, 80]])
    picture = draw_floor(straight(obstacles=(thing,), occupied_cm=cells))[:, :-LEGEND_PX]
    obstacle = np.nonzero(close_to(picture, region_colour(5)))[1]
    taken = np.nonzero((picture == OCCUPIED).all(axis=2))[1]
    assert abs(np.ptp(obstacle) / np.ptp(taken) - 30 / 10) < 0.4  # the line has round ends


def test_a_robot_that_never_moved_can_be_drawn():
    picture = draw_floor(Floor(np.zeros((1, 2)), 0.0, 12.0), "no frames")
    assert close_to(picture, PATH).sum() > 50
