"""The remembered front of what is ahead, from columns of feet as a camera 15 cm above the floor has them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from host.nav.front import Met, Profile, Sight
from host.nav.picture import NO_REGION
from host.nav.stand import FAIR, Standing

WALL = 7
NEAREST_CM = 35.0
RADIUS_CM = 12.0
CAMERA_AHEAD_CM = 12.0
ACROSS = (np.arange(160) - 79.5) * 2 / 280


@dataclass
class Columns:
    """What `Feet` says of every column."""

    depth_cm: np.ndarray
    region: np.ndarray
    cut: np.ndarray
    across: np.ndarray = field(default_factory=lambda: ACROSS)
    height_cm: float = 15.0
    slope: np.ndarray = field(default_factory=lambda: np.full(160, 15.0 / 500.0))
    nearest_cm: float = NEAREST_CM

    @property
    def sure(self) -> np.ndarray:
        return np.ones(len(self.cut), bool)

    @property
    def floor_cm(self) -> np.ndarray:
        return np.where(self.cut, NEAREST_CM, self.depth_cm)


def flat_front(away_cm: float, noise_cm: float = 0.0, seed: int = 0) -> Columns:
    """Something across the whole view, its foot seen or below the picture."""
    cut = np.full(160, away_cm < NEAREST_CM)
    depth = np.full(160, max(away_cm, NEAREST_CM))
    depth += np.random.default_rng(seed).normal(0.0, noise_cm, 160)
    return Columns(depth, np.full(160, WALL), cut)


def bare_floor() -> Columns:
    return Columns(np.full(160, 500.0), np.full(160, NO_REGION), np.zeros(160, bool))


def look(profile: Profile, columns: Columns, along_cm: float, standing: tuple[Standing, ...] = ()) -> None:
    """One frame from the axle this far along the way."""
    camera = (0.0, along_cm + CAMERA_AHEAD_CM)
    profile.see(Sight(columns, standing, camera, 0.0, along_cm))  # type: ignore[arg-type]


def met(profile: Profile, along_cm: float) -> Met:
    found = profile.met(0.0, along_cm, RADIUS_CM)
    assert found is not None
    return found


def come_up_to(profile: Profile, front_cm: float, end_cm: float) -> None:
    """Drive from 100 cm before a front, by 0.7 cm a frame, to this far before it."""
    for k, along in enumerate(np.arange(front_cm - 100.0, front_cm - end_cm, 0.7)):
        look(profile, flat_front(front_cm - along - CAMERA_AHEAD_CM, 0.5, seed=k), float(along))


def test_a_front_whose_foot_went_below_the_picture_is_where_it_was():
    profile = Profile(0.0, 0.0, 0.0)
    come_up_to(profile, 200.0, 22.0)
    found = met(profile, 178.0)
    assert found.by_foot and found.region == WALL
    assert found.room_cm == pytest.approx(200.0 - 178.0 - RADIUS_CM, abs=0.7)
    assert found.sigma_cm < 1.5


def test_a_late_depth_of_what_is_cut_off_does_not_move_a_front_that_was_seen():
    profile = Profile(0.0, 0.0, 0.0)
    come_up_to(profile, 200.0, 22.0)
    before = met(profile, 178.0).room_cm
    away = 200.0 - 178.0 - CAMERA_AHEAD_CM
    late = Standing(WALL, np.arange(160), np.full(160, away - 7.0), away, 4.5, "outline", FAIR)
    for _ in range(30):
        look(profile, flat_front(away), 178.0, (late,))
    assert met(profile, 178.0).room_cm == pytest.approx(before, abs=0.3)


def test_without_a_foot_ever_seen_a_depth_places_the_front_as_surely_as_it_is_itself():
    profile = Profile(0.0, 0.0, 0.0)
    found = Standing(WALL, np.arange(160), np.full(160, 30.0), 30.0, 4.0, "outline", FAIR)
    for _ in range(3):
        look(profile, flat_front(30.0), 0.0, (found,))
    ahead = met(profile, 0.0)
    assert not ahead.by_foot
    assert ahead.room_cm == pytest.approx(30.0 + CAMERA_AHEAD_CM - RADIUS_CM, abs=0.1)
    assert 2.0 < ahead.sigma_cm <= 4.1


def test_what_is_looked_at_again_and_is_not_there_is_forgotten():
    profile = Profile(0.0, 0.0, 0.0)
    for k in range(12):
        look(profile, flat_front(80.0, 0.5, seed=k), 0.0)
    assert met(profile, 0.0).room_cm == pytest.approx(80.0, abs=1.5)
    for _ in range(12):
        look(profile, bare_floor(), 0.0)
    assert profile.met(0.0, 0.0, RADIUS_CM) is None
    assert profile.clear_cm(0.0, 0.0, RADIUS_CM) > 60.0


def test_a_disc_meets_only_what_it_is_wide_enough_for():
    profile = Profile(0.0, 0.0, 0.0)
    beside = bare_floor()
    there = ACROSS * 60.0 > 14.0
    beside.depth_cm[there], beside.region[there] = 60.0, WALL
    for _ in range(6):
        look(profile, beside, 0.0)
    assert profile.met(0.0, 0.0, RADIUS_CM) is None
    assert profile.met(6.0, 0.0, RADIUS_CM) is not None


def seen_as_round(slopes: np.ndarray, left: int) -> tuple[Columns, Standing]:
    """Something with these feet, from this column on, before bare floor; its outer feet made it a ball."""
    columns = bare_floor()
    mine = np.arange(left, left + len(slopes))
    columns.slope[mine] = slopes
    columns.depth_cm[mine], columns.region[mine] = columns.height_cm / slopes, WALL
    nearest = float(columns.depth_cm[mine].min())
    return columns, Standing(WALL, mine, np.full(len(mine), nearest - 6.0), nearest, 1.0, "foot", FAIR, 8.0)


def test_a_slanted_front_that_the_picture_cuts_off_is_no_ball():
    """It is met where its feet are in each column, also when too little of it is left in view to tell."""
    profile = Profile(0.0, 0.0, 0.0)
    slanted, thing = seen_as_round(np.linspace(0.25, 0.42, 54), 106)  # 60 cm away at 11 cm aside, 36 at 20
    for _ in range(4):
        look(profile, slanted, 0.0, (thing,))
    little, rest = seen_as_round(np.linspace(0.38, 0.42, 12), 148)
    look(profile, little, 0.0, (rest,))
    way = 15.0 / np.linspace(0.25, 0.42, 54) + CAMERA_AHEAD_CM
    aside = np.abs(ACROSS[106:160]) * (way - CAMERA_AHEAD_CM)
    inside = aside < RADIUS_CM
    expected = (way[inside] - np.sqrt(RADIUS_CM**2 - aside[inside] ** 2)).min()
    assert met(profile, 0.0).room_cm == pytest.approx(expected, abs=1.5)


def test_a_ball_is_met_at_its_nearest_point_which_lies_before_its_foot():
    profile = Profile(0.0, 0.0, 0.0)
    outline = 0.11 + 0.2 * np.sqrt(1.0 - np.linspace(-0.98, 0.98, 56) ** 2)
    ball, thing = seen_as_round(outline, 52)
    for _ in range(4):
        look(profile, ball, 0.0, (thing,))
    assert met(profile, 0.0).along_cm == pytest.approx(15.0 / 0.31 - 6.0 + CAMERA_AHEAD_CM, abs=0.5)


def test_a_front_is_firm_once_it_was_seen_often_and_not_seen_past_since():
    profile = Profile(0.0, 0.0, 0.0)
    for k in range(4):
        look(profile, flat_front(50.0, 0.3, seed=k), 0.0)
    assert not met(profile, 0.0).firm
    for k in range(4):
        look(profile, flat_front(50.0, 0.3, seed=k), 0.0)
    assert met(profile, 0.0).firm
    look(profile, bare_floor(), 0.0)
    assert not met(profile, 0.0).firm


@pytest.mark.parametrize(("pictures", "stays"), [(3, False), (7, True)])
def test_a_fleck_before_a_firm_front_is_gone_when_that_is_seen_again_more_often(pictures, stays):
    profile = Profile(0.0, 0.0, 0.0)
    for k in range(8):
        look(profile, flat_front(60.0, 0.3, seed=k), 0.0)
    for _ in range(pictures):
        look(profile, flat_front(38.0), 0.0)
    for k in range(5):  # now its own place is below what is surely in view
        look(profile, flat_front(58.0, 0.3, seed=k), 2.0)
    front = 38.0 if stays else 60.0
    assert met(profile, 2.0).along_cm == pytest.approx(front + CAMERA_AHEAD_CM - 2.0, abs=1.0)


def test_the_shade_before_a_thing_gives_way_to_the_thing_s_own_foot():
    """Only the picture showed the first foot, and that shows shades too."""
    profile, floor, columns = Profile(0.0, 0.0, 0.0), 3, np.arange(160)
    for k in range(12):
        shade = flat_front(46.0, 0.3, seed=k)
        shade.region[:] = floor
        seam = Standing(floor, columns, shade.depth_cm, 46.0, 2.8, "foot", FAIR, seam=True)
        look(profile, shade, 0.0, (seam,))
    for k in range(8):
        foot = flat_front(50.0, 0.3, seed=k)
        look(profile, foot, 0.0, (Standing(WALL, columns, foot.depth_cm, 50.0, 1.0, "foot", FAIR),))
    assert met(profile, 0.0).along_cm == pytest.approx(50.0 + CAMERA_AHEAD_CM, abs=1.5)


def beside_the_way(far_cm: float = 300.0) -> Columns:
    """A box's front 80 cm away, from 15 cm aside of the way on, before a far wall of another colour."""
    columns = Columns(np.full(160, far_cm), np.full(160, WALL + 1), np.zeros(160, bool))
    box = ACROSS * 80.0 > 15.0
    columns.depth_cm[box], columns.region[box] = 80.0, WALL
    columns.slope = columns.height_cm / columns.depth_cm
    return columns


def ball_beside_the_way() -> Columns:
    """A ball of 15 cm radius, 80 cm away and 22 cm aside, one region with the far wall behind it."""
    columns = Columns(np.full(160, 300.0), np.full(160, WALL), np.zeros(160, bool))
    middle, radius = 22.0 / 80.0, 15.0 / 80.0
    off = np.abs(ACROSS - middle)
    limb = np.sqrt(np.maximum(radius**2 - off**2, 0.0))  # its picture is a circle that stands on the floor
    columns.slope = np.where(off < radius, limb, 15.0 / 300.0)
    columns.slope = np.maximum(columns.slope, 15.0 / 300.0)
    columns.depth_cm = columns.height_cm / columns.slope
    return columns


def test_cells_that_stick_into_the_way_from_a_box_beside_it_are_its_flank():
    profile = Profile(0.0, 0.0, 0.0)
    for _ in range(20):
        look(profile, beside_the_way(), 0.0)
    places = np.array([[10.0, 95.0], [10.0, 105.0], [10.0, 60.0], [0.0, 95.0], [-10.0, 95.0]])
    flank = profile.is_flank(places, (0.0, 0.0), RADIUS_CM)
    assert flank.tolist() == [True, True, False, False, False]
    assert not profile.may_hang_over((10.0, 95.0), (0.0, 0.0), RADIUS_CM)


def test_floor_that_is_seen_under_the_side_of_a_ball_does_not_clear_the_way():
    profile = Profile(0.0, 0.0, 0.0)
    for _ in range(20):
        look(profile, ball_beside_the_way(), 0.0)
    assert profile.clear_cm(0.0, 0.0, RADIUS_CM) > 80.0
    beside = (12.0, 104.0)
    assert profile.may_hang_over(beside, (0.0, 0.0), RADIUS_CM)
    assert not profile.is_flank(np.array([beside]), (0.0, 0.0), RADIUS_CM).any()
    assert not profile.may_hang_over((-12.0, 104.0), (0.0, 0.0), RADIUS_CM)


def test_a_ball_that_is_known_to_be_round_hides_nothing_more_beside_the_way():
    profile, columns = Profile(0.0, 0.0, 0.0), ball_beside_the_way()
    mine = np.flatnonzero(columns.slope > 0.1)
    columns.region[:] = WALL + 1
    columns.region[mine] = WALL
    ball = Standing(WALL, mine, np.full(len(mine), 65.0), 80.0, 1.0, "foot", FAIR, round_cm=15.0)
    for _ in range(20):
        look(profile, columns, 0.0, (ball,))
    beside = (12.0, 95.0)
    assert not profile.may_hang_over(beside, (0.0, 0.0), RADIUS_CM)
    assert profile.is_flank(np.array([beside]), (0.0, 0.0), RADIUS_CM).all()


def test_one_odd_picture_does_not_make_a_straight_front_curved():
    profile = Profile(0.0, 0.0, 0.0)
    for _ in range(20):
        look(profile, beside_the_way(), 0.0)
    odd = beside_the_way()
    box = odd.region == WALL
    odd.slope[box] += 0.01 * np.sin(np.linspace(0.0, 9.0, int(box.sum())))
    look(profile, odd, 0.0)
    assert profile.is_flank(np.array([[10.0, 95.0]]), (0.0, 0.0), RADIUS_CM).all()
