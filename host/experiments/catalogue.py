"""All runs there are: the paper's three experiments, and sweeps that vary one thing at a time."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

from host.depth.config import DepthConfig
from host.experiments.course import Course
from host.experiments.task import Task
from host.rbdn import NetConfig
from host.sim.experiment_scenes import experiment_1, experiment_2, experiment_3, slants
from host.sim.render import WebcamModel
from host.sim.things import Board, Material
from host.sim.world import World

SHAKE_RAD = math.radians(1.0)
STEADY = 0.0
LOOKS_1_CM = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
EXPERIMENT_1 = Course("experiment_1", 10.0, 31, SHAKE_RAD, LOOKS_1_CM)
EXPERIMENT_2 = Course("experiment_2", 5.0, 16, SHAKE_RAD, (5.0,))
EXPERIMENT_3 = Course("experiment_3", 200.0, 31, SHAKE_RAD, (100.0, 200.0))
STEADY_1 = Course("experiment_1_steady", 10.0, 31, STEADY, (10.0,))
STEADY_2 = Course("experiment_2_steady", 5.0, 16, STEADY, (5.0,))
# Sweeps: fewer frames and seeds, and no shaking, so that what is varied shows.
AREA = Course("area", 10.0, 11, STEADY, (10.0,))
NOISE = Course("noise", 10.0, 11, STEADY, (10.0,))
SLANT = Course("slant", 10.0, 11, STEADY, (10.0,))
SWEEP_SEEDS = 5
SIDES_CM = (3.0, 4.5, 7.0, 10.0, 15.0, 22.0, 30.0)
NOISES = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)  # times an ordinary webcam's
SLANTS_DEG = (0.0, 15.0, 30.0, 45.0, 60.0)
WEBCAM = WebcamModel()


def tasks(seeds: int, net: NetConfig, depth: DepthConfig) -> list[Task]:
    """Everything to run, the longest first; the settings are for our way."""
    task = partial(Task, net=net, depth=depth)
    out = [
        task(course, partial(scene, seed), seed, WEBCAM, keep_stills=seed == 0)
        for course, scene in (
            (EXPERIMENT_3, experiment_3),
            (EXPERIMENT_1, experiment_1),
            (STEADY_1, experiment_1),
            (EXPERIMENT_2, experiment_2),
            (STEADY_2, experiment_2),
        )
        for seed in range(seeds)
    ]
    for seed in range(min(seeds, SWEEP_SEEDS)):
        out += [
            task(SLANT, partial(slants, seed, slant), seed, WEBCAM, setting=slant) for slant in SLANTS_DEG
        ]
        out += [task(NOISE, partial(experiment_1, seed), seed, _noisy(n), setting=n) for n in NOISES]
        out += [task(AREA, partial(_board, seed, side), seed, WEBCAM, setting=side) for side in SIDES_CM]
    return out


def _noisy(times: float) -> WebcamModel:
    """The ordinary webcam with so many times its noise."""
    full_well = WEBCAM.full_well / times**2 if times else math.inf
    return replace(WEBCAM, full_well=full_well, read_noise=WEBCAM.read_noise * times)


def _board(seed: int, side_cm: float) -> World:
    """A square board at 85 cm, at the camera's height or on the floor, in the first experiment's room."""
    world = experiment_1(seed)
    paint = Material((36, 84, 170), contrast=0.02, scale_cm=3.0, seed=seed)
    base_cm = world.camera_height_cm - side_cm / 2
    board = Board("board", 3.0, 85.0, side_cm, side_cm, 0.0, paint, max(0.0, base_cm))
    return replace(world, things=(board,))
