"""Does a lens still hold? A few pictures of the board tell, or without a board a short straight drive."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from host.config import Config
from host.errors import EXIT_DONE, EXIT_INPUT, UsageError

if TYPE_CHECKING:
    from host.calibrate.views import Coverage
    from host.camera.lens import Lens

LEAST_VIEWS = 3
USUAL_RMS_PX = 0.15  # of a lens whose file does not say how well it fitted
MOST_RMS = 2.0  # times what the lens left when it was calibrated
SPARE_PX = 0.1  # and so much for another light and another focus of the eye
OFF_SIGMAS = 4.0
OFF_FOCAL, OFF_CENTRE = 0.005, 0.005  # of the focal length, and of the width, that matter to depths
OFF_HEIGHT = 0.05  # of the height
OFF_RAD = math.radians(1.0)


@dataclass(frozen=True)
class CheckOptions:
    """See whether a calibration holds: the lens with the board, or with --robot its seat by a short drive."""

    camera: str = "0"  # as for `camera`; with --robot as for `mount`
    lens: Path | None = None  # the camera.json to check; camera.json here
    board: Path | None = None  # what `target` wrote beside its PDF; else target.json here, if any
    robot: str | None = None  # drive half a metre instead of looking at the board: a port, auto, or sim:
    views: int = 6  # of the board

    def __post_init__(self) -> None:
        if not LEAST_VIEWS <= self.views <= 50:
            raise UsageError(f"--views must be from {LEAST_VIEWS} to 50, not {self.views}")


@dataclass(frozen=True)
class Finding:
    """What was compared: as it is said, what is allowed, and whether that holds."""

    text: str
    holds: bool


def by_board(coverage: Coverage, lens: Lens, usual_rms_px: float) -> list[Finding]:
    """How the board's corners lie by this lens, and which lens would suit them better."""
    from host.calibrate.intrinsics import adjust, place_of

    views = [view.corners for view in coverage.views]
    squares = [float((place_of(view, lens).residuals[0] ** 2).sum()) for view in views]
    rms = math.sqrt(sum(squares) / sum(len(view.points) for view in views))
    allowed = MOST_RMS * usual_rms_px + SPARE_PX
    out = [
        Finding(
            f"corners lie {rms:.2f} px from where the lens puts them; {allowed:.2f} are allowed",
            rms < allowed,
        )
    ]
    better = adjust(views, lens)
    for name, now, then, sigma, matters in (
        ("focal length across", better.lens.fx, lens.fx, better.sigmas[0], OFF_FOCAL * lens.fx),
        ("focal length down", better.lens.fy, lens.fy, better.sigmas[1], OFF_FOCAL * lens.fy),
        ("centre across", better.lens.cx, lens.cx, better.sigmas[2], OFF_CENTRE * lens.width),
        ("centre down", better.lens.cy, lens.cy, better.sigmas[3], OFF_CENTRE * lens.width),
    ):
        off = now - then
        holds = abs(off) < max(OFF_SIGMAS * sigma, matters)
        out.append(
            Finding(
                f"{name}: these views want {off:+.2f} px (± {sigma:.2f}); "
                f"{max(OFF_SIGMAS * sigma, matters):.2f} are allowed",
                holds,
            )
        )
    return out


def by_drive(options: CheckOptions, config: Config) -> list[Finding]:
    """How the floor flows on a straight drive, against the camera's place as it is set."""
    from host.calibrate.mount import MountOptions, measure

    assert options.robot is not None
    found = measure(MountOptions(options.camera, options.robot, options.lens), config)
    height = config.body.camera_height_cm
    sigma, *angles = found.sigmas
    allowed_cm = max(OFF_HEIGHT * height, 3 * sigma)
    out = [
        Finding(
            f"the floor flows as of {found.height_cm:.1f} cm below (± {sigma:.1f}), {height:g} are set; "
            f"{allowed_cm:.1f} either way are allowed",
            abs(found.height_cm - height) < allowed_cm,
        )
    ]
    for name, angle, sigma in (
        ("above or below", found.pitch, angles[0]), ("aside of", found.yaw, angles[2])
    ):  # fmt: skip
        allowed = max(OFF_RAD, 3 * sigma)
        out.append(
            Finding(
                f"the picture opens {abs(math.degrees(angle)):.1f} degrees {name} where it should "
                f"(± {math.degrees(sigma):.1f}); {math.degrees(allowed):.1f} are allowed",
                abs(angle) < allowed,
            )
        )
    return out


def run(options: CheckOptions, config: Config) -> int:
    """The command's body; 3 where the lens holds no more."""
    if options.robot is not None:
        findings = by_drive(options, config)
        remedy = (
            "'python -m host.calibrate mount' tells how the camera sits now, 'check' with the board its lens"
        )
    else:
        findings = look(options, config)
        remedy = "calibrate anew: python -m host.calibrate camera"
    for finding in findings:
        print(f"{'holds' if finding.holds else 'OFF  '}  {finding.text}")
    if all(finding.holds for finding in findings):
        print("The calibration holds.")
        return EXIT_DONE
    print(f"The calibration holds no more; {remedy}")
    return EXIT_INPUT


def look(options: CheckOptions, config: Config) -> list[Finding]:
    """Views of the board, compared with the lens.

    Raises
    ------
    InputError
        The lens cannot be read or is for pictures of another size, or the board was not seen.
    """
    from host.calibrate.verdict import chosen_board
    from host.calibrate.watch import watch
    from host.camera.lens_file import check_camera, read_about, read_lens
    from host.camera.source import camera_name
    from host.errors import InputError

    file = options.lens or Path("camera.json")
    lens, about = read_lens(file), read_about(file)
    check_camera(file, camera_name(options.camera))
    found = watch(
        options.camera,
        chosen_board(options.board),
        config.webcam,
        lambda cover: len(cover.views) >= options.views,
    )
    cover = found.coverage
    if (cover.width, cover.height) != (lens.width, lens.height):
        raise InputError(
            f"{file}: is for pictures of {lens.width}x{lens.height} px, camera {options.camera} gives "
            f"{cover.width}x{cover.height}; calibrate at the size that is used"
        )
    if len(cover.views) < LEAST_VIEWS:
        raise InputError(
            f"too few views: {len(cover.views)}, and at least {LEAST_VIEWS} are needed; {cover.missing()[0]}"
        )
    usual = about.get("rms_px")
    return by_board(cover, lens, usual if isinstance(usual, int | float) and 0 < usual < 10 else USUAL_RMS_PX)
