"""What the camera delivers: size, rate, times, light, sharpness; from two seconds of its pictures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from host.camera.frame import Frame, FrameSource
from host.doctor.finding import Finding, Part, split_error
from host.errors import RobotError
from host.link.clock import Clock
from host.nav.focus import CLEAR_SHARE, LEAST_TILES, tiles_of
from host.nav.watch import DARK_LEVEL, FLAT_LEVELS

WATCHED_S = 2.0
MOST_PICTURES = 60
FEWEST_PICTURES = 5
TIMEOUT_S = 5.0  # webcams take up to this long to deliver their first picture
SLOW_HZ = 8.0  # below, the robot creeps
LONG_GAP_S = 0.3  # the robot stops for a picture that is older
UNEVEN = 1.6  # of the usual time between two pictures
GLARE_LEVEL, GLARE_SHARE = 250, 0.3
STEADY = 0.04  # relative change of brightness that a fixed exposure keeps to under even light
EVERY_PX = 4
REPEATED_SHARE = 0.2
PART = Part("camera")
LOCK = "keep webcam.lock = true in robot.toml; 'v4l2-ctl -L' lists what the camera can hold still"


@dataclass(frozen=True)
class Taken:
    """A picture and when it was got."""

    frame: Frame
    got_s: float


def take_pictures(
    camera: FrameSource, clock: Clock, watched_s: float = WATCHED_S
) -> tuple[list[Taken], RobotError | None]:
    """The pictures of a while, and what ended it early."""
    taken: list[Taken] = []
    timeout_s = TIMEOUT_S
    until_s = float("inf")
    try:
        while clock.now_s() < until_s and len(taken) < MOST_PICTURES:
            frame = camera.read(timeout_s)
            if frame is None:
                break
            taken.append(Taken(frame, clock.now_s()))
            if len(taken) == 1:
                until_s, timeout_s = clock.now_s() + watched_s, 2 * watched_s
    except RobotError as error:
        return taken, error
    return taken, None


def check_driver(told: Sequence[str]) -> Iterator[Finding]:
    """What was said while the camera was opened and read: of size, rate, times, exposure and the like."""
    for one in dict.fromkeys(told):
        yield PART.warn("settings", *split_error(one))
    if not told:
        yield PART.ok("settings", "as asked for")


def check_pictures(taken: Sequence[Taken], ended: RobotError | None, live: bool) -> Iterator[Finding]:
    """All that pictures tell.

    Parameters
    ----------
    taken, ended
        As `take_pictures` gives them.
    live
        Whether they come by themselves, from a camera, and not from files.
    """
    if not taken and ended is None:
        yield PART.fail("pictures", "none came", "name another camera, file or folder")
        return
    if ended is not None:
        yield PART.error("pictures", ended)
    if not taken:
        return
    height, width = taken[0].frame.image.shape[:2]
    if ended is None:
        yield PART.ok("pictures", f"{len(taken)} of {width}x{height} px")
    if live and ended is None:
        yield check_rate(taken)
        yield check_times(taken)
    yield check_light(taken)
    if len(taken) < FEWEST_PICTURES:
        yield PART.untried("exposure", f"takes {FEWEST_PICTURES} pictures, {len(taken)} came")
        return
    if live:
        yield check_frozen(taken)
    yield check_exposure(taken)
    yield check_sharpness(taken)


def rate_hz(taken: Sequence[Taken]) -> float | None:
    """Pictures a second by their own times; None where that cannot be told."""
    steps = np.diff([one.frame.t_s for one in taken])
    usual_s = float(np.median(steps)) if len(steps) else 0.0
    return 1.0 / usual_s if usual_s > 0.0 else None


def check_rate(taken: Sequence[Taken]) -> Finding:
    """Often enough, and evenly?"""
    hz = rate_hz(taken)
    if hz is None:
        return PART.fail("rate", "the pictures' times do not tell it", "use another camera or USB port")
    got = [one.got_s for one in taken]
    longest_s = max(np.diff(got), default=0.0)
    steps = np.diff([one.frame.t_s for one in taken])
    uneven = int(np.count_nonzero(steps > UNEVEN / hz))
    dropped = taken[-1].frame.seq - taken[0].frame.seq + 1 - len(taken)
    told = f"{hz:.1f} a second, {uneven} late, {dropped} dropped, longest wait {1000 * longest_s:.0f} ms"
    if longest_s > LONG_GAP_S:
        return PART.fail(
            "rate", told, "use another USB port without a hub, better light, or a smaller picture"
        )
    if hz < SLOW_HZ or uneven > len(steps) / 5:
        return PART.warn(
            "rate", told, "give it more light or fix its exposure, which it lengthens in the dark"
        )
    return PART.ok("rate", told)


def check_times(taken: Sequence[Taken]) -> Finding:
    """Do the pictures' times go forward, and are they the clock's?"""
    steps = np.diff([one.frame.t_s for one in taken])
    ages_s = np.array([one.got_s - one.frame.t_s for one in taken])
    age_ms = 1000 * float(np.median(ages_s))
    wild_ms = 1000 * float(ages_s.max() - ages_s.min())
    told = f"pictures are {age_ms:.0f} ms old when they come, to within {wild_ms:.0f} ms"
    if (steps <= 0.0).any():
        return PART.fail(
            "times", "a picture's time is not after that of the one before", "use another camera or driver"
        )
    if age_ms < -5.0:
        return PART.fail(
            "times", f"pictures come {-age_ms:.0f} ms before they are taken", "use another camera or driver"
        )
    if age_ms > 1000 * LONG_GAP_S:
        return PART.fail("times", told, "use another USB port without a hub, or a smaller picture")
    if wild_ms > 100.0:
        return PART.warn("times", told, "close other programs: the computer is busy")
    return PART.ok("times", told)


def check_light(taken: Sequence[Taken]) -> Finding:
    """Is there anything to see?"""
    samples = _samples(taken)
    mean, spread = float(np.median(samples.mean((1, 2, 3)))), float(np.median(samples.std((1, 2, 3))))
    glare = float((samples.min(-1) >= GLARE_LEVEL).mean())
    told = f"mean grey level {mean:.0f}, spread {spread:.0f}"
    if mean < DARK_LEVEL:
        return PART.fail("light", "the picture is black", "take the lens cap off, turn on the light")
    if spread < FLAT_LEVELS:
        return PART.fail(
            "light",
            "the picture is one even colour",
            "uncover the lens; if it is white, less light or exposure",
        )
    if glare > GLARE_SHARE:
        return PART.warn("light", f"{100 * glare:.0f} % of the picture is white", "shorten the exposure")
    return PART.ok("light", told)


def check_frozen(taken: Sequence[Taken]) -> Finding:
    """Is every picture a new one? A real sensor's noise never comes twice."""
    different = len({one.tobytes() for one in _samples(taken)})
    repeated = len(taken) - different
    if different == 1:
        return PART.fail("news", "all pictures are the same one", "unplug the camera and plug it in again")
    if repeated > REPEATED_SHARE * len(taken):
        told = f"{repeated} of {len(taken)} pictures were seen before"
        return PART.fail("news", told, "unplug the camera and plug it in again")
    return PART.ok("news", f"{different} of {len(taken)} pictures differ")


def check_exposure(taken: Sequence[Taken]) -> Finding:
    """Does the camera leave the exposure alone? Under even light brightness stays."""
    means = _samples(taken).mean((1, 2, 3))
    change = float((means.max() - means.min()) / max(means.mean(), 1.0))
    told = f"brightness keeps to within {100 * change:.1f} %"
    if change > STEADY:
        return PART.warn("exposure", f"brightness changes by {100 * change:.0f} % while nothing moves", LOCK)
    return PART.ok("exposure", told)


def check_sharpness(taken: Sequence[Taken]) -> Finding:
    """Are there sharp edges?"""
    clear = [int(np.count_nonzero(tiles_of(one.frame.image)[0] > CLEAR_SHARE)) for one in taken]
    tiles = int(np.median(clear))
    if tiles < LEAST_TILES:
        return PART.warn(
            "sharpness",
            "hardly any sharp edge in the picture",
            "wipe and focus the lens, fix its focus, or let it look at things with edges",
        )
    return PART.ok("sharpness", f"sharp edges in {tiles} of 60 parts of the picture")


def _samples(taken: Sequence[Taken]) -> np.ndarray:
    return np.stack([one.frame.image[::EVERY_PX, ::EVERY_PX] for one in taken])
