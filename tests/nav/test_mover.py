"""What was seen of something that goes to and fro tells where it is when nobody sees it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from host.nav.mover import Mover, Sight
from host.nav.tracks import LONG_HELD_S, Movers
from host.nav.yielding import Verdict
from host.pose import Pose

SPEED = 15.0
LOW, HIGH = -45.0, 30.0
LINE_Z = 100.0


def true_x(t_s: float) -> float:
    """To and fro between both ends, beginning at the left one."""
    gone = SPEED * t_s % (2 * (HIGH - LOW))
    return LOW + min(gone, 2 * (HIGH - LOW) - gone)


def seen(until_s: float, left: float, right: float, noise_cm: float = 0.5) -> Movers:
    """What is remembered of it after it was looked at between these places, from straight before."""
    rng, movers = np.random.default_rng(1), Movers()
    for k in range(round(15 * until_s)):
        t_s = k / 15
        movers.forget(t_s)
        x = true_x(t_s)
        if left < x < right:
            place_x, place_z = x + noise_cm * rng.normal(), LINE_Z + 4 * rng.normal()
            ray = x / math.hypot(x, LINE_Z), LINE_Z / math.hypot(x, LINE_Z)
            sight = Sight(t_s, place_x, place_z, ray, LINE_Z)
            way = math.copysign(SPEED, true_x(t_s + 0.01) - x)
            movers.note(3, sight, (way, 0.0), 8.0)
    movers.forget(until_s)
    return movers


def test_a_shadow_that_goes_with_it_is_not_where_it_has_been():
    movers = Movers()
    for k in range(45):
        t_s, x = k / 15, 20.0 * k / 15 - 40.0
        movers.forget(t_s)
        for region, at in ((3, x), (9, x + 20.0)):  # of what is in view of both, the shadow comes later
            if region == 3 or k > 15:
                ray = at / math.hypot(at, LINE_Z), LINE_Z / math.hypot(at, LINE_Z)
                movers.note(region, Sight(t_s, at, LINE_Z, ray, LINE_Z), (20.0, 0.0), 8.0)
    (mover,) = movers.sure
    assert x_of(mover, mover.been_cm[1]) == pytest.approx(x, abs=4.0)


def x_of(mover: Mover, on_line: float) -> float:
    return mover.origin_cm[0] + on_line * mover.ahead[0]


@pytest.mark.parametrize(("left", "right"), [(-60, 60), (-30, 20)])
def test_when_both_ends_are_known_it_is_foreseen_out_of_sight_though_they_were_never_in_view(left, right):
    until = 22.0
    (mover,) = seen(until, left, right).sure
    for after in (1.0, 3.0, 6.0, 9.0):
        (should,) = mover.place(np.array([until + after]))
        assert x_of(mover, should) == pytest.approx(true_x(until + after), abs=4.0)


def test_where_it_can_be_holds_where_it_is_and_grows_with_the_time_nobody_saw_it():
    until = 22.0
    (mover,) = seen(until, -30, 20).sure
    widths = []
    for after in (0.5, 4.0, 12.0):
        low, high = mover.reach(np.array([until + after]))
        ends = sorted((x_of(mover, float(low[0])), x_of(mover, float(high[0]))))
        assert ends[0] <= true_x(until + after) <= ends[1]
        widths.append(ends[1] - ends[0])
    assert widths[0] < 20.0 and widths[0] < widths[2] < 60.0


def test_beyond_where_it_has_been_it_may_turn_at_once_or_go_on():
    until = (30.0 - LOW) / SPEED - 1.0  # it has just left the view to the right
    (mover,) = seen(until, -40, true_x(until)).sure
    low, high = mover.reach(np.array([until + 2.0]))
    ends = sorted((x_of(mover, float(low[0])), x_of(mover, float(high[0]))))
    x = true_x(until)
    assert ends[0] < x - 1.5 * SPEED and ends[1] > x + 1.5 * SPEED


def test_it_is_remembered_for_a_while_and_then_no_more():
    movers = seen(6.0, -60, 60)
    movers.forget(6.0 + 15.0)
    assert len(movers.sure) == 1
    movers.forget(6.0 + 60.0)
    assert movers.sure == []


@pytest.mark.parametrize("missed", [False, True])
def test_known_to_go_to_and_fro_it_is_remembered_for_long_unless_it_was_seen_not_to_be_there(missed):
    """Forgotten after 40 s it was run into, where the way led along its line."""
    until = 22.0
    movers = seen(until, -60, 60)
    for _ in range(12 if missed else 0):
        movers.look_for(until + 1.0, lambda places, half_cm: np.ones(len(places), bool))
    movers.forget(until + 60.0)
    assert len(movers.sure) == (0 if missed else 1)


def test_what_seems_to_go_and_gets_nowhere_is_no_mover():
    """The edge of a wall passed by wandered; the robot stepped back from that into what truly moved."""
    rng, movers = np.random.default_rng(1), Movers()
    for k in range(60):
        t_s = k / 15
        movers.forget(t_s)
        place = Sight(t_s, 20.0 * rng.random(), LINE_Z, (0.0, 1.0), LINE_Z)
        movers.note(3, place, (7.0, 0.0), 8.0)
    assert movers._all[0].seen > 20 and movers._all[0].gone_cm > 15.0
    assert movers.sure == [] and movers.velocity(3, t_s) is None


def test_a_glance_that_showed_it_move_only_once_or_twice_is_soon_forgotten():
    movers = seen(0.3, -60, 60)
    (mover,) = movers.sure
    assert not mover.certain
    movers.forget(0.3 + 4.0)
    assert movers.sure == []


def test_the_part_of_the_picture_where_it_may_be_is_told():
    until = 22.0
    (mover,) = seen(until, -60, 60).sure
    seen_now = mover.seen_between(Pose.planar(0, 0, 0, t_s=until))
    assert seen_now is not None
    low, high = seen_now
    assert low < true_x(until) / LINE_Z < high and high - low < 0.6
    assert mover.seen_between(Pose.planar(0, 0, math.pi, t_s=until)) is None


def test_what_seems_to_go_elsewhere_as_it_comes_into_view_keeps_the_motion_that_foretold_the_place():
    until = 22.0
    movers = seen(until, -30, 20)
    back = next(t for t in np.arange(until + 0.5, until + 12, 1 / 15) if -30 < true_x(t) < -25)
    movers.forget(back)
    place = Sight(back, true_x(back), LINE_Z - 3, (-0.26, 0.97), LINE_Z)
    movers.note(3, place, (9.0, -12.0), 8.0)  # half of it is outside the picture
    (mover,) = movers.sure
    assert mover.low_cm is not None and mover.high_cm is not None
    assert x_of(mover, float(mover.place(np.array([back + 5.0]))[0])) == pytest.approx(
        true_x(back + 5.0), abs=5.0
    )


def test_one_region_that_wanders_off_as_it_leaves_the_view_spoils_nothing_that_was_known():
    until = 22.0
    movers = seen(until, -30, 20)
    (before,) = movers.sure
    for k in range(12):  # the net calls a part of the wall by its name
        movers.note(3, Sight(until, -60.0, 130.0 + k, (-0.42, 0.9), 140.0), (-7.0, 21.0), 8.0)
    assert before in movers.sure


def test_what_is_not_where_it_should_be_may_be_anywhere_until_it_is_seen_to_go_again():
    until = 22.0
    movers = seen(until, -60, 60)
    for k in range(12):
        t_s = until + k / 15
        movers.forget(t_s)
        movers.look_for(t_s, lambda places, half_cm: np.ones(len(places), bool))
    (mover,) = movers.sure
    low, high = mover.reach(np.array([until + 1.0]))
    assert mover.lost and high[0] - low[0] > HIGH - LOW
    movers.note(3, Sight(until + 1.0, 0.0, LINE_Z, (0.0, 1.0), LINE_Z), (-SPEED, 0.0), 8.0)
    (mover,) = movers.sure
    assert not mover.lost
    assert x_of(mover, float(mover.place(np.array([until + 2.0]))[0])) == pytest.approx(-SPEED, abs=4.0)


def test_who_turned_round_unseen_and_is_then_only_glimpsed_still_goes():
    """Fitted slower and slower it was taken for something that stands, and was driven into."""

    def sight(t_s: float, x: float) -> Sight:
        away = math.hypot(x, LINE_Z)
        return Sight(t_s, x, LINE_Z, (x / away, LINE_Z / away), away)

    came = [sight(15.0 - k / 4, -35.0 + 12.0 * k / 4) for k in range(32, 0, -1)]
    sights = (*came, sight(14.97, -34.7), sight(15.76, -34.3))  # between these two it turned
    mover = Mover(
        8, 15.76, (0.0, LINE_Z), (1.0, 0.0), -37.4, -9.3, 9.0, sights, (7.0, 61.0), seen=180, since_s=14.8,
        named_s=15.76,
    )  # fmt: skip
    for k in range(30):
        mover = mover.told(sight(15.82 + k / 15, -32.8 + 12.0 * k / 15), 8, None)
    assert mover.goes
    assert mover.velocity_cm_s[0] == pytest.approx(12.0, rel=0.2)


def test_what_hides_behind_something_is_where_it_should_be():
    until = 22.0
    movers = seen(until, -60, 60)
    for k in range(12):
        movers.look_for(until + k / 15, lambda places, half_cm: np.zeros(len(places), bool))
    assert not movers.sure[0].lost


@pytest.mark.parametrize("velocity", [None, (SPEED, 0.0)])
def test_a_mover_that_the_net_makes_one_with_the_floor_is_still_followed(velocity):
    """A brown thing on a brown floor lost its region after 0.8 s in view, and ran into the robot later."""
    until = 1.2
    movers = seen(until, -60, 60)
    for k in range(20):
        t_s = until + (k + 1) / 15
        movers.forget(t_s)
        x = true_x(t_s)
        movers.seen_mixed(Sight(t_s, x, LINE_Z, (x / LINE_Z, 1.0), LINE_Z), 8.0, velocity if k > 8 else None)
    (mover,) = movers.sure
    assert t_s - mover.t_s < 0.2 and mover.understood
    assert x_of(mover, float(mover.place(np.array([t_s + 1.0]))[0])) == pytest.approx(
        true_x(t_s + 1.0), abs=4.0
    )


def test_what_stands_in_the_floors_region_is_no_mover_that_was_long_out_of_sight():
    until = 22.0
    movers = seen(until, -60, 60)
    later = until + 3.0
    movers.forget(later)
    movers.seen_mixed(Sight(later, true_x(later) + 5.0, LINE_Z, (0.0, 1.0), LINE_Z), 8.0, None)
    movers.seen_mixed(Sight(later, true_x(later) + 5.0, LINE_Z, (0.0, 1.0), LINE_Z), 8.0, (0.0, SPEED))
    assert movers.sure[0].t_s < until


def test_a_foot_of_the_floors_region_beside_the_line_turns_no_mover_round():
    """One stray foot turned a mover round that was leaving the view, and the robot drove into it."""
    until = 2.0
    movers = seen(until, -60, 60)
    (before,) = movers.sure
    later = until + 0.2
    movers.forget(later)
    movers.seen_mixed(Sight(later, true_x(later) - 6.0, LINE_Z + 17.0, (0.0, 1.0), LINE_Z), 8.0, None)
    assert movers.sure == [before]


def test_who_is_followed_in_the_floors_region_gives_up_its_old_name():
    """Another thing that the net gave it was taken back from the map in every picture."""
    until = 3.0
    movers = seen(until, -60, 60)
    assert movers.velocity(3, until) is not None
    for k in range(round(15 * (LONG_HELD_S + 1.0))):
        t_s = until + (k + 1) / 15
        movers.forget(t_s)
        x = true_x(t_s)
        way = math.copysign(SPEED, true_x(t_s + 0.01) - x)
        movers.seen_mixed(Sight(t_s, x, LINE_Z, (x / LINE_Z, 1.0), LINE_Z), 8.0, (way, 0.0))
    (mover,) = movers.sure
    assert t_s - mover.t_s < 0.2
    assert t_s - mover.named_s > LONG_HELD_S
    assert movers.velocity(3, t_s) is None


def test_what_another_net_sees_bears_no_name_of_a_mover_that_is_remembered():
    """A wall was given the number that a mover had, and was no wall on the map."""
    until = 22.0
    movers = seen(until, -60, 60)
    (before,) = movers.sure
    movers.unname()
    (mover,) = movers.sure
    assert movers.velocity(3, until) is None
    assert mover.reach(np.array([until + 2.0])) == before.reach(np.array([until + 2.0]))
    assert "region" not in str(Verdict(mover, 10.0))
    movers.note(7, Sight(until, true_x(until), LINE_Z, (0.0, 1.0), LINE_Z), (-SPEED, 0.0), 8.0)
    assert [one.region for one in movers.sure] == [7]
