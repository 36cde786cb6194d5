"""A region that is no longer what it was begins anew."""

from __future__ import annotations

from dataclasses import replace

import pytest
from drives import FIRST, Run, ahead, drive, wall
from solid_scene import Eye, Thing, board

from host.pose import Pose
from host.rbdn.snapshot import Event, Snapshot

CHANGE = 9  # frame


def near_and_far(near: int, far: int) -> list[Thing]:
    """Two boards that touch in the picture, at 60 and 110 cm."""
    return [
        board(near, (-7, 0, 60), (13, 20)),
        board(far, (11, 2, 110), (24, 24)),
        board(30, (25, -12, 80), (9, 9)),
        wall(),
    ]


def changing(
    before: list[Thing], after: list[Thing], events: tuple[Event, ...], frames: int, seed: int
) -> Run:
    """A drive on which the net sees one set of regions up to `CHANGE`, and then the other."""
    first, second = Eye(before, noise_px=0.1, seed=seed), Eye(after, noise_px=0.1, seed=seed + 50)

    def look(k: int, eye: Eye, pose: Pose) -> Snapshot:
        seen = (first if k < CHANGE else second).look(pose, events if k == CHANGE else ())
        return replace(seen, seq=k)

    return drive(second, ahead(frames, 1.0 * (frames - 1)), change=look)


@pytest.mark.parametrize("seed", range(4))
def test_the_parts_of_a_region_that_split_are_right_or_decline(seed: int):
    run = changing(near_and_far(10, 10), near_and_far(10, 11), (Event("split", 11, 10),), 22, seed)
    for frame in range(CHANGE, 22):
        truth = run.eye.truth(run.poses[frame])
        for name in (10, 11):
            found = run.region(name, frame)
            if found.depth_cm is not None:
                assert abs(found.depth_cm / truth[name] - 1) < max(0.04, 3 * found.sigma_cm / found.depth_cm)
    assert abs(run.errors()[10]) < 0.015
    assert abs(run.errors()[11]) < 0.03


@pytest.mark.parametrize("seed", range(4))
def test_a_region_that_took_in_another_does_not_keep_its_depth_as_if_nothing_had_happened(seed: int):
    run = changing(near_and_far(10, 11), near_and_far(10, 10), (Event("merge", 11, 10),), 20, seed)
    before, after = run.region(10, CHANGE - 1), run.region(10, CHANGE)
    assert before.sigma_cm is not None
    assert after.sigma_cm is None or after.sigma_cm > before.sigma_cm
    assert "area" in after.declined


@pytest.mark.parametrize("seed", range(4))
def test_a_name_used_again_for_another_thing_brings_no_old_depth(seed: int):
    before = [board(10, (-12, 0, 60), (14, 18)), board(30, (25, -12, 80), (9, 9)), wall()]
    after = [board(10, (14, 3, 120), (30, 24)), board(30, (25, -12, 80), (9, 9)), wall()]
    events = (Event("end", 10, None), Event("birth", 10, 1))
    run = changing(before, after, events, 24, seed)
    for frame in range(CHANGE, 24):
        found = run.region(10, frame)
        if found.depth_cm is not None:
            truth = run.eye.truth(run.poses[frame])[10]
            assert abs(found.depth_cm / truth - 1) < max(0.04, 3 * found.sigma_cm / found.depth_cm)
    assert abs(run.errors()[10]) < 0.02


def test_what_changes_elsewhere_does_not_touch_a_regions_depth():
    run = changing(near_and_far(10, 10), near_and_far(10, 11), (Event("split", 11, 10),), 14, 0)
    calm = drive(Eye(near_and_far(10, 11), noise_px=0.1), ahead(14, 13.0))
    for frame in range(CHANGE, 14):
        found, quiet = run.region(30, frame), calm.region(30, frame)
        assert found.depth_cm is not None
        assert found.sigma_cm < 1.5 * quiet.sigma_cm
        assert abs(run.errors(frame)[30]) < 0.02


def test_a_region_that_is_lost_for_some_frames_and_returns_has_its_depth():
    things = near_and_far(10, 11)
    eye = Eye(things, noise_px=0.1)

    def look(k: int, eye: Eye, pose: Pose) -> Snapshot:
        seen = eye.look(pose)
        if not 6 <= k < 10:
            return replace(seen, events=(Event("return", 30, 1),)) if k == 10 else seen
        contour, lost = seen.contour, (seen.contour.left == 30) | (seen.contour.right == 30)
        kept = {f: getattr(contour, f)[~lost] for f in contour.__dataclass_fields__}
        events = (Event("end", 30, None),) if k == 6 else ()
        regions = tuple(r for r in seen.regions if r.id != 30)
        return replace(seen, regions=regions, contour=replace(contour, **kept), events=events)

    run = drive(eye, ahead(16, 15.0), change=look)
    assert abs(run.errors()[30]) < 0.02
    assert 30 not in run.reports[8].regions


def test_ids_that_change_every_frame_still_give_depth_or_none_but_nothing_wrong():
    eye = Eye(
        [board(FIRST + k, (-24 + 16 * k, 4 * (-1) ** k, 70 + 15 * k), (10, 14)) for k in range(4)] + [wall()],
        noise_px=0.1,
    )

    def look(k: int, eye: Eye, pose: Pose) -> Snapshot:
        seen, by = eye.look(pose), 100 * k
        regions = tuple(replace(r, id=r.id + by) for r in seen.regions)
        contour = replace(seen.contour, left=seen.contour.left + by, right=seen.contour.right + by)
        return replace(seen, regions=regions, contour=contour)

    run = drive(eye, ahead(11, 10.0), change=look)
    truth = eye.truth(run.poses[-1])
    for k in range(4):
        found = run.region(FIRST + k + 1000)
        if found.depth_cm is not None:
            assert abs(found.depth_cm / truth[FIRST + k] - 1) < max(0.03, 3 * found.sigma_cm / found.depth_cm)
