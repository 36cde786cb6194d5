"""The pictures of docs/algorithm.md, drawn by the net itself from rendered scenes.

python -m host.view.method_pictures [FOLDER]
"""

from __future__ import annotations

from host.errors import begin_command, run_command

if __name__ == "__main__":
    begin_command()

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
from tyro.conf import Positional, arg

from host.camera.lens import Lens
from host.config import read_options
from host.depth.estimator import Estimator
from host.depth.report import DepthReport
from host.pose import Pose
from host.rbdn import Net, NetConfig, Snapshot, _core
from host.record.atomic import check_writable, write_whole
from host.sim.export import Way
from host.sim.render import Renderer, Webcam, WebcamModel
from host.sim.scenes import world_from_uri
from host.view.colour_scale import depth_scale
from host.view.depth_picture import draw_depth
from host.view.labels import middle_of
from host.view.mesh_picture import (
    LETTERS,
    SUBPIXEL_BITS,
    Part,
    above_each_other,
    draw_edges,
    draw_loop,
    draw_moves,
    draw_vertices,
    fill_loops,
    in_a_row,
    mark_pixels,
)
from host.view.palette import INK, PAPER, Colour, region_colour, shade, text_size, write
from host.view.space_picture import draw_space, space_of

FOLDER = Path("docs/pictures")
ROOM, SHADED_ROOM, TRACKED_ROOM = "sim:room?seed=15", "sim:room?seed=13", "sim:room?seed=12"
TRACKED_FRAMES, EVERY = 41, 8
STEP_CM, TURN_RAD = 3.0, -0.006  # of the tracked drive, a frame
TABLE, BOXES = "sim:tabletop?seed=11", "sim:boxes"
DEPTH_FRAMES = 11  # 1 cm apart
DEPTH_SCALE = 0.72  # of the depth pictures on the page
SMALLEST_NAMED_PX = 150
REACH_PX = NetConfig().start_reach_px
ONE_CYCLE = REACH_PX - 2  # what the engine's step "deform" takes for one cycle with this reach
JPEG_QUALITY = 74
LEFT_BAND: Colour = (150, 110, 40)
RIGHT_BAND: Colour = (40, 120, 160)
CLAIMED: Colour = (60, 60, 235)
Faces = dict[str, np.ndarray]


@dataclass(frozen=True)
class PicturesOptions:
    """Draw the pictures of docs/algorithm.md anew."""

    folder: Positional[Annotated[Path, arg(metavar="[FOLDER]")]] = FOLDER  # where they go


def main() -> None:
    """The command."""
    folder = read_options(PicturesOptions).folder
    check_writable(folder, folder=True)
    for name, draw in PICTURES.items():
        how = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY] if name.endswith(".jpg") else []
        _, content = cv2.imencode(Path(name).suffix, draw(), how)
        write_whole(folder / name, content.tobytes())
        print(folder / name)


# --- The first frame -------------------------------------------------------------------------------


def first_frame() -> np.ndarray:
    """From squares to regions: four stages of the first frame."""
    image = room_frame()
    net = Net()
    stages = [squares(net, image)]
    net._core.step(_core.Step.merge, 0, image)
    stages.append(net.faces())
    for _ in range(3):
        net._core.step(_core.Step.deform, ONE_CYCLE, image)
    stages.append(net.faces())
    done = Net()
    done.track(image)
    stages.append(done.faces())
    part = Part(0, 0, image.shape[1], image.shape[0], 2)
    panels = []
    for faces in stages:
        panel = part.canvas(image)
        draw_edges(panel, part, faces, width=1)
        panels.append(panel)
    draw_vertices(panels[-1], part, done.faces()["vertices_px"])
    return above_each_other(
        [
            in_a_row(panels[:2], ["equal squares", "squares of like colour merged"]),
            in_a_row(panels[2:], ["after three cycles", "at rest"]),
        ]
    )


def forces() -> np.ndarray:
    """Pixels that fit the polygon beyond an edge better, counted edge by edge, and where the vertices go."""
    image = room_frame()
    net = Net()
    squares(net, image)
    net._core.step(_core.Step.merge, 0, image)
    before = net.faces()
    claimed = net._core.disparity(image, REACH_PX)
    net._core.step(_core.Step.deform, ONE_CYCLE, image)
    after = net.faces()
    part = Part(82, 82, 46, 40, 14)
    counts = part.canvas(image, pale=0.15)
    mark_pixels(counts, part, misfits(image, before), CLAIMED)
    edge = _fullest_edge(before, claimed, part)
    _bands(counts, part, before, edge, claimed[edge])
    moves = part.canvas(image, pale=0.15)
    for panel in (counts, moves):
        draw_edges(panel, part, before, width=3)
        draw_vertices(panel, part, before["vertices_px"])
    draw_moves(moves, part, before["vertices_px"], after["vertices_px"])
    return in_a_row([counts, moves], ["mismatched pixels, counted beside one edge", "the moves they ask for"])


def squares(net: Net, image: np.ndarray) -> Faces:
    """The net of equal squares that a first frame starts with."""
    net._core.disparity(image, REACH_PX)  # looking at the squares makes them
    return net.faces()


def misfits(image: np.ndarray, faces: Faces) -> np.ndarray:
    """(H, W) pixels within reach of another polygon whose mean is nearer to them than their own's."""
    colours = _core.working_colours(_core.Config(), image)
    labels, means = faces["labels"], faces["means"]
    return (
        _misfits_along_rows(labels, colours, means)
        | _misfits_along_rows(labels.T, colours.swapaxes(0, 1), means).T
    )


def _misfits_along_rows(labels: np.ndarray, colours: np.ndarray, means: np.ndarray) -> np.ndarray:
    out = np.zeros_like(labels, bool)
    width = labels.shape[1]
    for y, x in np.argwhere(labels[:, 1:] != labels[:, :-1]):
        left, right = labels[y, x], labels[y, x + 1]
        for start, step, own, beyond in ((x, -1, left, right), (x + 1, 1, right, left)):
            for at in range(start, start + step * REACH_PX, step):
                if not 0 <= at < width or labels[y, at] != own:
                    break
                if np.sum((colours[y, at] - means[own]) ** 2) <= np.sum(
                    (colours[y, at] - means[beyond]) ** 2
                ):
                    break
                out[y, at] = True
    return out


def _fullest_edge(faces: Faces, claimed: np.ndarray, part: Part) -> int:
    """The edge inside the part with the most claimed pixels beside it."""
    ends = faces["vertices_px"][faces["edges"][:, :2]] - (part.left, part.top)
    inside = ((ends > 2) & (ends < (part.width - 3, part.height - 3))).all((1, 2))
    return int(np.argmax(np.where(inside, claimed.sum((1, 2)), -1)))


def _bands(canvas: np.ndarray, part: Part, faces: Faces, edge: int, claimed: np.ndarray) -> None:
    """The four sensitivity regions of an edge (Fig. 3 of the paper) with the pixels counted in each."""
    a, b = faces["vertices_px"][faces["edges"][edge, :2]]
    along = (b - a) / np.hypot(*(b - a))
    left = np.array([along[1], -along[0]])
    for side, (normal, colour) in enumerate(((left, LEFT_BAND), (-left, RIGHT_BAND))):
        for half in range(2):
            start, end = (a, (a + b) / 2) if half == 0 else ((a + b) / 2, b)
            corners = np.array([start, end, end + REACH_PX * normal, start + REACH_PX * normal])
            fill_loops(canvas, part, [corners], colour, 0.3 if half == 0 else 0.45)
            _number(canvas, part, corners.mean(0), int(claimed[side, half]), on_paper=True)


def _number(canvas: np.ndarray, part: Part, at_px: np.ndarray, number: int, on_paper: bool = False) -> None:
    x, y = (int(v) for v in part.at(at_px)[0] >> SUBPIXEL_BITS)
    width, height = text_size(str(number), LETTERS)
    left, low = x - width // 2, y + height // 2
    if on_paper:
        shade(canvas, (left - 4, low - height - 4, left + width + 4, low + 5), PAPER, 0.9)
    write(canvas, str(number), (left, low), LETTERS, INK)


# --- Maintenance -----------------------------------------------------------------------------------

WALL: Colour = (205, 212, 216)
RED: Colour = (60, 70, 200)
BLUE: Colour = (170, 90, 60)
Corners = list[tuple[float, float]]
Shape = tuple[Corners, Colour]


@dataclass(frozen=True)
class Repair:
    """A change in the picture after which one operation on the net has something to do."""

    step: str  # as the engine calls it
    caption: str
    fitted: list[Shape]  # what the net was fitted to
    shown: list[Shape]  # what it sees now
    square_px: int = 16  # of the net's start


def _house(shoulder_y: float, roof_y: float, floor_y: float) -> Corners:
    return [(16, shoulder_y), (36, roof_y), (56, shoulder_y), (56, floor_y), (16, floor_y)]


def _tower(half_width: float) -> Corners:
    return [(16, 30), (36 - half_width, 30), (36, 6), (36 + half_width, 30), (56, 30), (56, 46), (16, 46)]


def _diamond(x: float) -> Corners:
    return [(x, 29), (x + 14, 15), (x + 28, 29), (x + 14, 43)]


BOX = [(6.0, 14.0), (30.0, 14.0), (30.0, 44.0), (6.0, 44.0)]
REPAIRS = (
    Repair("insert", "a vertex is inserted", [(_house(16, 16, 40), RED)], [(_house(22, 10, 40), RED)], 8),
    Repair("delete", "a flat one is deleted", [(_house(24, 10, 46), RED)], [(_house(24, 23, 46), RED)]),
    Repair("zip", "a thorn is closed", [(_tower(5), RED)], [(_tower(3), RED)]),
    Repair(
        "snap", "a contact is joined", [(BOX, RED), (_diamond(39), BLUE)], [(BOX, RED), (_diamond(30), BLUE)]
    ),
)


def maintenance() -> np.ndarray:
    """Each operation on a small scene: before, after, and after three more cycles."""
    part = Part(0, 0, 72, 56, 5)
    rows = []
    for repair in REPAIRS:
        image = _drawn(repair.shown, part)
        before, after, later = _repaired(repair, _drawn(repair.fitted, part), image)
        panels = []
        for faces, other in ((before, after), (after, before), (later, later)):
            panel = part.canvas(image, pale=0.2)
            draw_edges(panel, part, faces)
            draw_edges(panel, part, _only_in(faces, other), CLAIMED, 3)
            draw_vertices(panel, part, faces["vertices_px"])
            panels.append(panel)
        rows.append(in_a_row(panels, ["before", repair.caption, "three cycles later"]))
    return above_each_other(rows)


def _repaired(repair: Repair, fitted: np.ndarray, shown: np.ndarray) -> tuple[Faces, Faces, Faces]:
    """The net just before and after the first time that the step changes it, and three cycles on."""
    step = getattr(_core.Step, repair.step)
    net = Net(NetConfig(square_px=repair.square_px, min_area_px=60))
    net.track(fitted)
    for cycle in range(30):
        if cycle > 0:
            net._core.step(_core.Step.deform, ONE_CYCLE, shown)
        before = net.faces()
        net._core.step(step, 0, shown)
        after = net.faces()
        if len(_only_in(before, after)["edges"]) > 0:
            break
    for _ in range(3):
        net._core.step(_core.Step.deform, ONE_CYCLE, shown)
    return before, after, net.faces()


def _only_in(faces: Faces, other: Faces) -> Faces:
    """Those edges of a net that another does not have."""

    def edges(net: Faces) -> list[frozenset[tuple[float, ...]]]:
        places = [tuple(place) for place in net["vertices_px"].round(3).tolist()]
        return [frozenset((places[a], places[b])) for a, b in net["edges"][:, :2]]

    known = set(edges(other))
    changed = [edge not in known for edge in edges(faces)]
    return {**faces, "edges": faces["edges"][changed]}


def _drawn(shapes: list[Shape], part: Part) -> np.ndarray:
    """Polygons on a wall with soft edges, as small as `part`."""
    fine = 8
    large = np.full((part.height * fine, part.width * fine, 3), WALL, np.uint8)
    for corners, colour in shapes:
        cv2.fillPoly(large, [np.round(np.array(corners) * fine).astype(np.int32)], colour)
    return cv2.resize(large, (part.width, part.height), interpolation=cv2.INTER_AREA)


# --- Regions and tracking --------------------------------------------------------------------------


def regions() -> np.ndarray:
    """Polygons, and the regions they are grouped into."""
    image = next(drive(SHADED_ROOM, 1))[0]
    net = Net()
    snapshot = net.track(image)
    part = Part(0, 0, image.shape[1], image.shape[0], 2)
    polygons = part.canvas(image)
    draw_edges(polygons, part, net.faces())
    draw_vertices(polygons, part, net.faces()["vertices_px"])
    captions = [
        f"{len(net.faces()['means'])} polygons",
        f"{len(snapshot.regions)} regions",
    ]
    return in_a_row([polygons, _coloured(image, snapshot, part)], captions)


def tracking() -> np.ndarray:
    """Frames of a drive; colours and numbers are the regions' ids."""
    panels, captions = [], []
    net: Net | None = None
    for k, (image, turned, lens) in enumerate(drive(TRACKED_ROOM, TRACKED_FRAMES)):
        net = net or Net(lens=lens)
        snapshot = net.track(image, turned)
        if k % EVERY == 0:
            part = Part(0, 0, image.shape[1], image.shape[0], 1)
            panels.append(_coloured(image, snapshot, part))
            captions.append(f"frame {k}")
    return above_each_other(
        [in_a_row(panels[k : k + 3], captions[k : k + 3]) for k in range(0, len(panels), 3)]
    )


def _coloured(image: np.ndarray, snapshot: Snapshot, part: Part) -> np.ndarray:
    canvas = part.canvas(image)
    for region in sorted(snapshot.regions, key=lambda r: -r.area_px):
        fill_loops(canvas, part, region.loops, region_colour(region.id), 0.35)
    for region in sorted(snapshot.regions, key=lambda r: -r.area_px):
        for loop in region.loops:
            draw_loop(canvas, part, loop, region_colour(region.id))
        if region.area_px > SMALLEST_NAMED_PX:
            _number(canvas, part, middle_of(region), region.id)
    return canvas


# --- Depth -----------------------------------------------------------------------------------------


def depth() -> np.ndarray:
    """Depth, sigma and error after a hand's breadth of driving."""
    measured = measure(TABLE)
    snapshot, depths = measured.snapshots[-1], measured.depths[-1]
    known = [r.depth_cm for r in depths.regions.values() if r.depth_cm is not None]
    picture = draw_depth(
        measured.image, snapshot, depths, depth_scale(np.array(known)), measured.true_depth_cm,
        f"after {DEPTH_FRAMES - 1} cm",
    )  # fmt: skip
    return cv2.resize(picture, None, fx=DEPTH_SCALE, fy=DEPTH_SCALE, interpolation=cv2.INTER_AREA)


def vertices() -> np.ndarray:
    """The vertices of the paper's two boxes in space."""
    measured = measure(BOXES)
    picture = draw_space(space_of(measured.snapshots[-1], measured.depths[-1], measured.poses))
    return cv2.resize(picture, None, fx=DEPTH_SCALE, fy=DEPTH_SCALE, interpolation=cv2.INTER_AREA)


@dataclass(frozen=True)
class Measured:
    """A short drive."""

    poses: list[Pose]
    snapshots: list[Snapshot]
    depths: list[DepthReport]
    image: np.ndarray  # the last one
    true_depth_cm: np.ndarray  # of the last one


def measure(uri: str) -> Measured:
    """Net and depth over a drive of 1 cm a frame."""
    world, model = world_from_uri(uri), WebcamModel()
    renderer, webcam = Renderer(world), Webcam(model, world.lens, world.seed)
    net, estimator = Net(lens=world.lens), Estimator(world.lens)
    poses = list(Way(DEPTH_FRAMES).poses())
    images = [webcam.take(renderer.light(p, model.psf_px), p.t_s, k) for k, p in enumerate(poses)]
    snapshots = [net.track(image) for image in images]
    depths = [estimator.update(seen, pose) for seen, pose in zip(snapshots, poses, strict=True)]
    return Measured(poses, snapshots, depths, images[-1], renderer.truth(poses[-1]).depth_cm)


# --- Scenes ----------------------------------------------------------------------------------------


def room_frame() -> np.ndarray:
    """What the robot sees first of its room."""
    return next(drive(ROOM, 1))[0]


def drive(uri: str, frames: int) -> Iterator[tuple[np.ndarray, np.ndarray | None, Lens]]:
    """What a webcam sees on the way through a room: image, turn since the last one, lens."""
    world, model = world_from_uri(uri), WebcamModel()
    renderer, webcam = Renderer(world), Webcam(model, world.lens, world.seed)
    before: Pose | None = None
    for k in range(frames):
        pose = Pose.planar(0.0, STEP_CM * k, TURN_RAD * k, t_s=0.1 * k)
        turned = None if before is None else pose.relative_to(before)[0]
        yield webcam.take(renderer.light(pose, model.psf_px), pose.t_s, k), turned, world.lens
        before = pose


PICTURES: dict[str, Callable[[], np.ndarray]] = {
    "first_frame.jpg": first_frame,
    "forces.jpg": forces,
    "maintenance.jpg": maintenance,
    "regions.jpg": regions,
    "tracking.jpg": tracking,
    "depth.jpg": depth,
    "vertices.jpg": vertices,
}

if __name__ == "__main__":
    run_command(main)
